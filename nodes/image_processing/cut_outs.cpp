// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_processing/cut_outs.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include <fmt/format.h>

namespace srfs {
namespace {

constexpr double margin_least_px = 8;
constexpr double far_away_px = 1e6;

int pixel(double place) {
  return static_cast<int>(std::lround(std::clamp(place, -far_away_px, far_away_px)));
}

/// Evenly chosen, the first and the last among them.
std::vector<image::TrackPoint> chosen(const std::vector<image::TrackPoint>& points, std::size_t most) {
  if (points.size() <= most) return points;
  std::vector<image::TrackPoint> some;
  for (std::size_t k = 0; k < most; ++k) some.push_back(points[k * (points.size() - 1) / (most - 1)]);
  return some;
}

/// Copies the piece around (x, y) to the column @p left; what is outside of the frame stays without a value.
void copy_piece(const image::Plane& from, double x, double y, image::Plane& to, int left) {
  const int x0 = pixel(x) - CutOuts::piece_px / 2;
  const int y0 = pixel(y) - CutOuts::piece_px / 2;
  for (int j = 0; j < CutOuts::piece_px; ++j) {
    for (int i = 0; i < CutOuts::piece_px; ++i) {
      if (from.contains(x0 + i, y0 + j)) to.at(left + i, j) = from.at(x0 + i, y0 + j);
    }
  }
}

}  // namespace

std::optional<image::Rectangle> around(const image::Streak& s, int width, int height, double fwhm_px) {
  const double margin = std::max(margin_least_px, 3 * fwhm_px);
  const int x0 = pixel(std::min(s.x1, s.x2) - margin);
  const int y0 = pixel(std::min(s.y1, s.y2) - margin);
  const int x1 = pixel(std::max(s.x1, s.x2) + margin);
  const int y1 = pixel(std::max(s.y1, s.y2) + margin);
  return image::within({x0, y0, x1 - x0 + 1, y1 - y0 + 1}, width, height);
}

CutOuts::CutOuts(const TaskFindings& findings) {
  for (const image::Tracklet& t : findings.tracklets) {
    if (tracklets_.size() >= tracklets_most) break;
    TrackletPicture picture;
    picture.points = chosen(t.points, pieces_most);
    if (picture.points.empty()) continue;
    picture.pixels = image::Plane(piece_px * static_cast<int>(picture.points.size()), piece_px,
                                  std::numeric_limits<float>::quiet_NaN());
    tracklets_.push_back(std::move(picture));
  }
  for (const FoundStreak& s : findings.streaks) {
    if (streaks_.size() >= streaks_most) break;
    streaks_.push_back({s, {}});
  }
}

std::vector<int> CutOuts::frames() const {
  std::set<int> frames;
  for (const auto& t : tracklets_) {
    for (const auto& p : t.points) frames.insert(p.frame);
  }
  for (const auto& s : streaks_) frames.insert(s.streak.frame);
  return {frames.begin(), frames.end()};
}

void CutOuts::take(int frame, const image::Plane& pixels, double fwhm_px) {
  for (auto& t : tracklets_) {
    for (std::size_t k = 0; k < t.points.size(); ++k) {
      if (t.points[k].frame != frame) continue;
      copy_piece(pixels, t.points[k].x, t.points[k].y, t.pixels, static_cast<int>(k) * piece_px);
      ++t.taken;
    }
  }
  for (auto& s : streaks_) {
    if (s.streak.frame != frame) continue;
    const auto place = around(s.streak.streak, pixels.width(), pixels.height(), fwhm_px);
    if (!place) continue;
    const double longer = std::max(place->width, place->height);
    const int width = static_cast<int>(std::lround(place->width * std::min(1.0, longest_px / longer)));
    s.pixels = image::thumbnail(image::cut_out(pixels, *place), std::max(1, width));
  }
}

std::vector<CutOuts::Picture> CutOuts::pictures() const {
  std::vector<Picture> pictures;
  for (std::size_t i = 0; i < tracklets_.size(); ++i) {
    if (tracklets_[i].taken == 0) continue;
    const image::Plane& pixels = tracklets_[i].pixels;
    pictures.push_back({fmt::format("tracklet_{:04}.png", i), image::thumbnail(pixels, pixels.width())});
  }
  for (std::size_t i = 0; i < streaks_.size(); ++i) {
    if (!streaks_[i].pixels.empty())
      pictures.push_back({fmt::format("streak_{:04}.png", i), streaks_[i].pixels});
  }
  return pictures;
}

}  // namespace srfs
