// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/sky_camera.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "image/star_catalogue.hpp"

namespace srfs::sim {
namespace {

constexpr double degree = std::numbers::pi / 180;
constexpr std::size_t noise_values = std::size_t{1} << 21;
constexpr double pass_before_fraction =
    0.35;  // of the field's width: where an object is when its pass begins
constexpr double pass_offset_fraction = 0.15;  // by so much it may miss the middle
constexpr std::size_t passes_max = 8;

/// Share of a Gaussian's light in the pixels -r to r around its own, along one axis.
constexpr int psf_radius = 7;
using Shares = std::array<float, 2 * psf_radius + 1>;
Shares shares(double offset, double sigma) {
  Shares out;
  const double scale = 1 / (sigma * std::numbers::sqrt2);
  double below = std::erf((-psf_radius - 0.5 - offset) * scale);
  for (int i = -psf_radius; i <= psf_radius; ++i) {
    const double above = std::erf((i + 0.5 - offset) * scale);
    out[static_cast<std::size_t>(i + psf_radius)] = static_cast<float>((above - below) / 2);
    below = above;
  }
  return out;
}

/// One row of the sensor: shot and read noise, amplifier, converter.
struct ReadOut {
  float background_e;
  float exposure_s;
  float read_variance;
  float adu_per_e;
  float bias_adu;
  float highest_adu;
};
void read_row(const float* light, const float* response, const float* dark_e_s, const float* noise,
              std::uint16_t* out, int width, const ReadOut& r) {
  for (int x = 0; x < width; ++x) {
    const float e = light[x] + response[x] * r.background_e + dark_e_s[x] * r.exposure_s;
    const float adu = r.bias_adu + (e + std::sqrt(e + r.read_variance) * noise[x]) * r.adu_per_e + 0.5F;
    out[x] = static_cast<std::uint16_t>(static_cast<int>(std::min(std::max(adu, 0.0F), r.highest_adu)));
  }
}

}  // namespace

/// The stars, by place.
struct SkyCamera::Sky {
  std::vector<image::CatalogueStar> stars = image::bright_stars();
  image::SkyIndex index{directions(), 3 * degree};

 private:
  [[nodiscard]] std::vector<Eigen::Vector3d> directions() const {
    std::vector<Eigen::Vector3d> all;
    all.reserve(stars.size());
    for (const image::CatalogueStar& star : stars) all.push_back(star.direction);
    return all;
  }
};

Eigen::Quaterniond CameraPose::after(double seconds) const {
  const double rate = rate_rad_s.norm();
  if (rate * seconds < 1e-12) return attitude;
  return attitude * Eigen::Quaterniond(Eigen::AngleAxisd(rate * seconds, rate_rad_s / rate));
}

CameraPose pose_of(const FixedPointing& pointing, double seconds) {
  const Eigen::Vector3d z = image::direction_of(pointing.ra_deg, pointing.dec_deg);
  const double ra = pointing.ra_deg * degree;
  const Eigen::Vector3d east(-std::sin(ra), std::cos(ra), 0);
  const Eigen::Vector3d north = z.cross(east);
  const double roll = pointing.roll_deg * degree;
  const Eigen::Vector3d up = std::cos(roll) * north + std::sin(roll) * east;
  Eigen::Matrix3d body;
  body.col(0) = z.cross(up);
  body.col(1) = -up;
  body.col(2) = z;
  CameraPose pose;
  pose.attitude = Eigen::Quaterniond(body);
  pose.rate_rad_s = {0, pointing.drift_arcsec_s / 3600 * degree, 0};
  pose.attitude = pose.after(seconds);
  return pose;
}

SkyCamera::SkyCamera(const SkyCameraSettings& settings, std::function<void()> between_pieces)
    : settings_(settings),
      between_pieces_(between_pieces ? std::move(between_pieces) : [] {}),
      focal_px_(settings.width / 2.0 / std::tan(settings.field_deg * degree / 2)),
      sigma_px_(settings.fwhm_px / 2.3548),
      sky_(std::make_unique<Sky>()),
      random_(settings.seed),
      response_(settings.width, settings.height),
      dark_e_s_(settings.width, settings.height),
      light_e_(settings.width, settings.height),
      noise_(noise_values) {
  for (float& v : response_.cells())
    v = static_cast<float>(std::max(0.1, 1 + settings_.prnu * random_.normal()));
  for (int i = 0; i < settings_.hot_pixels; ++i) {
    const auto at = static_cast<std::size_t>(random_.uniform() * static_cast<double>(dark_e_s_.size()));
    dark_e_s_.cells()[at] = static_cast<float>(settings.background_e_s * 5 * std::exp(random_.uniform(0, 4)));
  }
  for (std::size_t i = 0; settings.warm_share > 0 && i < dark_e_s_.size(); ++i) {
    if (random_.uniform() < settings.warm_share)
      dark_e_s_.cells()[i] += static_cast<float>(-settings.warm_e_s * std::log1p(-random_.uniform()));
  }
  for (float& v : noise_) v = static_cast<float>(random_.normal());
}

SkyCamera::~SkyCamera() = default;

std::optional<Eigen::Vector2d> SkyCamera::project(const Eigen::Quaterniond& attitude,
                                                  const Eigen::Vector3d& direction) const {
  const Eigen::Vector3d d = attitude.conjugate() * direction;
  if (d.z() < 0.2) return std::nullopt;  // behind, or far beside
  return Eigen::Vector2d((settings_.width - 1) / 2.0 + focal_px_ * d.x() / d.z(),
                         (settings_.height - 1) / 2.0 + focal_px_ * d.y() / d.z());
}

void SkyCamera::draw_point(double x, double y, double flux_e) {
  const int x0 = static_cast<int>(std::lround(x));
  const int y0 = static_cast<int>(std::lround(y));
  if (x0 < -psf_radius || y0 < -psf_radius || x0 >= settings_.width + psf_radius ||
      y0 >= settings_.height + psf_radius)
    return;
  const Shares across = shares(x - x0, sigma_px_);
  const Shares down = shares(y - y0, sigma_px_);
  for (int j = std::max(-psf_radius, -y0); j <= std::min(psf_radius, settings_.height - 1 - y0); ++j) {
    const float row_e = static_cast<float>(flux_e) * down[static_cast<std::size_t>(j + psf_radius)];
    float* const row = light_e_.row(y0 + j);
    for (int i = std::max(-psf_radius, -x0); i <= std::min(psf_radius, settings_.width - 1 - x0); ++i)
      row[x0 + i] += row_e * across[static_cast<std::size_t>(i + psf_radius)];
  }
}

void SkyCamera::draw_line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double flux_e) {
  constexpr int steps_max = 20'000;
  const double length = (to - from).norm();
  const int steps = std::clamp(static_cast<int>(std::ceil(length * 2)), 1, steps_max);
  for (int i = 0; i < steps; ++i) {
    const Eigen::Vector2d at = from + (i + 0.5) / steps * (to - from);
    draw_point(at.x(), at.y(), flux_e / steps);
  }
}

bool SkyCamera::touches(const Eigen::Vector2d& from, const Eigen::Vector2d& to) const {
  const Eigen::Vector2d low = from.cwiseMin(to);
  const Eigen::Vector2d high = from.cwiseMax(to);
  return high.x() >= 0 && high.y() >= 0 && low.x() <= settings_.width - 1 && low.y() <= settings_.height - 1;
}

void SkyCamera::draw_stars(const CameraPose& pose, double exposure_s, SkyTruth& truth) {
  const Eigen::Quaterniond end = pose.after(exposure_s);
  const double half = std::atan(std::hypot(settings_.width, settings_.height) / 2 / focal_px_);
  const double radius = std::min(half + pose.rate_rad_s.norm() * exposure_s, 60 * degree);
  std::vector<std::size_t> seen;
  sky_->index.near(pose.attitude * Eigen::Vector3d::UnitZ(), radius,
                   [&](std::size_t star, double) { seen.push_back(star); });
  std::sort(seen.begin(), seen.end());  // the catalogue has the brightest first
  for (const std::size_t i : seen) {
    between_pieces_();
    const image::CatalogueStar& star = sky_->stars[i];
    const auto from = project(pose.attitude, star.direction);
    const auto to = project(end, star.direction);
    if (!from || !to || !touches(*from, *to)) continue;
    const double flux_e = settings_.magnitude_zero_e_s * std::pow(10, -0.4 * star.magnitude) * exposure_s;
    draw_line(*from, *to, flux_e);
    truth.stars.push_back({(from->x() + to->x()) / 2, (from->y() + to->y()) / 2, flux_e});
  }
}

Eigen::Vector3d SkyCamera::Pass::at(double t_s, double rate_rad_s) const {
  return Eigen::AngleAxisd((t_s - epoch_s) * rate_rad_s, axis) * direction;
}

void SkyCamera::begin_passes(const CameraPose& pose, double begin_s) {
  const DebrisSettings& debris = settings_.debris;
  const double field = settings_.field_deg * degree;
  const double life_s = field / (debris.rate_deg_s * degree);
  std::erase_if(passes_, [&](const Pass& pass) { return begin_s - pass.epoch_s > life_s; });
  const bool due = debris.interval_s > 0 && begin_s >= next_pass_s_;
  if ((!due && !pass_next_) || passes_.size() >= passes_max) return;
  const double angle = random_.uniform(0, 2 * std::numbers::pi);
  const Eigen::Vector3d along = pose.attitude * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0);
  const Eigen::Vector3d beside = pose.attitude * Eigen::Vector3d(-std::sin(angle), std::cos(angle), 0);
  const double before = pass_next_ ? 0.02 * field : pass_before_fraction * field;
  const double offset = pass_next_ ? 0 : random_.uniform(-1, 1) * pass_offset_fraction * field;
  Pass pass;
  pass.direction =
      (pose.attitude * Eigen::Vector3d::UnitZ() - std::tan(before) * along + std::tan(offset) * beside)
          .normalized();
  pass.axis = pass.direction.cross(along).normalized();
  pass.epoch_s = begin_s;
  pass.magnitude = debris.magnitude;
  passes_.push_back(pass);
  pass_next_ = false;
  next_pass_s_ = begin_s + debris.interval_s * random_.uniform(0.5, 1.5);
}

void SkyCamera::draw_debris(const CameraPose& pose, double begin_s, double exposure_s, SkyTruth& truth) {
  const double rate = settings_.debris.rate_deg_s * degree;
  for (const Pass& pass : passes_) {
    between_pieces_();
    const auto from = project(pose.attitude, pass.at(begin_s, rate));
    const auto to = project(pose.after(exposure_s), pass.at(begin_s + exposure_s, rate));
    if (!from || !to || !touches(*from, *to)) continue;
    const double flux_e = settings_.magnitude_zero_e_s * std::pow(10, -0.4 * pass.magnitude) * exposure_s;
    draw_line(*from, *to, flux_e);
    truth.streaks.push_back({from->x(), from->y(), to->x(), to->y(), flux_e});
  }
}

void SkyCamera::read_out(double exposure_s, double gain_db, image::Grid<std::uint16_t>& pixels) {
  const double amplification = std::pow(10, gain_db / 20);
  const ReadOut r{covered_ ? 0.0F : static_cast<float>(settings_.background_e_s * exposure_s),
                  static_cast<float>(exposure_s),
                  static_cast<float>(settings_.read_noise_e * settings_.read_noise_e),
                  static_cast<float>(amplification / settings_.gain_e_per_adu),
                  static_cast<float>(settings_.bias_adu),
                  static_cast<float>((1 << settings_.bits) - 1)};
  const auto last_start = static_cast<double>(noise_.size() - static_cast<std::size_t>(settings_.width));
  for (int y = 0; y < settings_.height; ++y) {
    between_pieces_();
    const auto start = static_cast<std::size_t>(random_.uniform() * last_start);
    read_row(light_e_.row(y), response_.row(y), dark_e_s_.row(y), noise_.data() + start, pixels.row(y),
             settings_.width, r);
  }
}

SkyPicture SkyCamera::expose(const CameraPose& pose, double begin_s, double exposure_s, double gain_db) {
  SkyPicture picture;
  const Eigen::Vector3d middle = pose.attitude * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d up = pose.attitude * -Eigen::Vector3d::UnitY();
  const double ra = std::atan2(middle.y(), middle.x());
  const Eigen::Vector3d east(-std::sin(ra), std::cos(ra), 0);
  picture.truth.ra_deg = ra < 0 ? ra / degree + 360 : ra / degree;
  picture.truth.dec_deg = std::asin(std::clamp(middle.z(), -1.0, 1.0)) / degree;
  picture.truth.roll_deg = std::atan2(up.dot(east), up.dot(middle.cross(east))) / degree;
  picture.truth.scale_arcsec_px = 3600 / degree / focal_px_;

  for (int y = 0; y < settings_.height; ++y) {
    between_pieces_();
    std::fill_n(light_e_.row(y), settings_.width, 0.0F);
  }
  begin_passes(pose, begin_s);
  if (!covered_) {
    draw_stars(pose, exposure_s, picture.truth);
    draw_debris(pose, begin_s, exposure_s, picture.truth);
  }
  picture.pixels = image::Grid<std::uint16_t>::unset(settings_.width, settings_.height);
  read_out(exposure_s, gain_db, picture.pixels);
  return picture;
}

}  // namespace srfs::sim
