// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "image/picture.hpp"
#include "image/tracklet_linker.hpp"
#include "nodes/image_processing/findings_report.hpp"

namespace srfs {

/// Around a streak, with a margin; nothing where it is not in the frame. Pure.
[[nodiscard]] std::optional<image::Rectangle> around(const image::Streak& streak, int width, int height,
                                                     double fwhm_px);

/// Pictures of what was found, for people, made from the frames as they come by once more. Pure.
///
/// A streak's picture is its surroundings, at most 256 px long; a tracklet's is up to eight pieces of 32 px
/// side by side, in the order of the frames. At most 16 tracklets and 24 streaks, the most significant.
class CutOuts {
 public:
  explicit CutOuts(const TaskFindings& findings);

  /// Frames that show something, ascending.
  [[nodiscard]] std::vector<int> frames() const;
  /// @param fwhm_px  of its stars; 0: unknown
  void take(int frame, const image::Plane& pixels, double fwhm_px);

  struct Picture {
    std::string name;  ///< tracklet_0000.png or streak_0000.png, the number its place in findings.json
    image::Grid<std::uint8_t> pixels;
  };
  /// Most important first: tracklets, then streaks.
  [[nodiscard]] std::vector<Picture> pictures() const;

  static constexpr std::size_t tracklets_most = 16;
  static constexpr std::size_t streaks_most = 24;
  static constexpr int longest_px = 256;
  static constexpr int piece_px = 32;
  static constexpr std::size_t pieces_most = 8;

 private:
  struct TrackletPicture {
    std::vector<image::TrackPoint> points;  ///< the pieces
    image::Plane pixels;
    std::size_t taken = 0;
  };
  struct StreakPicture {
    FoundStreak streak;
    image::Grid<std::uint8_t> pixels;
  };
  std::vector<TrackletPicture> tracklets_;
  std::vector<StreakPicture> streaks_;
};

}  // namespace srfs
