#include "image/star_finder.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "image/filter.hpp"
#include "image/rows.hpp"

namespace srfs::image {
namespace {

constexpr float candidate_least = 3.5F;  ///< in noise of the filtered frame
constexpr std::size_t candidates_max = 60000;
/// What a bright star's model may leave of it.
constexpr double model_error = 0.06;
/// Unexplained energy that the model's own error may leave.
constexpr double sharper_share = 0.02;
/// A wrong level of the sky that matters, times the width of a star, both in noise and px.
constexpr float level_least = 0.05F;

struct Peak {
  int x;
  int y;
  float value;
};

struct Fitted {
  double x = 0;
  double y = 0;
  double height = 0;
  double energy = 0;  ///< sum of the squared profile over the pixels used
  double scale = 1;   ///< width beside the frame's
  double scale_error = 0;
  double noise = 1;      ///< of the filtered frame here
  double left_over = 0;  ///< of brighter stars, here
  double significance = 0;
  int radius = 0;
  bool changed = true;  ///< it or its surroundings, since it was last fitted
  bool crowded = false;
};

class Finder {
 public:
  Finder(const CleanFrame& clean, const StarOptions& options)
      : clean_(clean),
        psf_(clean.psf),
        profile_(clean.psf.profile()),
        options_(options),
        residual_(clean.signal) {
    const int r = 3 * psf_.fit_radius();
    for (int y = -r; y <= r; ++y) {
      for (int x = -r; x <= r; ++x) {
        const double h = double(psf_.height(static_cast<float>(x), static_cast<float>(y)));
        energy_ += h * h;
      }
    }
  }

  StarField run() {
    for (int pass = 0; pass < 2; ++pass) {
      if (pass > 0) level_residual();
      filtered_ = gaussian_filter(residual_, psf_.sigma_px());
      // The second time without the known stars, whose light counts as noise the first time.
      noise_ = measure_sky(filtered_, sky_cell_px(filtered_.width(), filtered_.height()), 0.05F).noise;
      for (Fitted& star : stars_) star.noise = noise_at(star.x, star.y);
      const std::size_t known = stars_.size();
      for (const Peak& peak : find_peaks()) try_peak(peak, pass);
      if (stars_.size() == known) break;
      if (pass == 0) measure_shot_noise();
      find_crowds(known);
      refine();
    }
    select();
    return result();
  }

 private:
  [[nodiscard]] double noise_at(double x, double y) const { return std::max(0.5, double(noise_.at(x, y))); }

  /// Sky that was hidden by stars: in crowded fields their light lifted the level that was taken away.
  void level_residual() {
    Grid<std::uint8_t> masked(residual_.width(), residual_.height());
    for (const Fitted& star : stars_) mask(star, masked);
    const Surface level =
        measure_sky(residual_, sky_cell_px(residual_.width(), residual_.height()), 0.05F, &masked).level;
    const auto [lowest, highest] =
        std::minmax_element(level.nodes().cells().begin(), level.nodes().cells().end());
    if (std::max(-*lowest, *highest) * psf_.sigma_px() < level_least) return;
    std::vector<float> row(static_cast<std::size_t>(residual_.width()));
    for (int y = 0; y < residual_.height(); ++y) {
      level.row(y, row);
      subtract(residual_.row(y), row.data(), residual_.width());
    }
    for (Fitted& star : stars_) star.changed = true;
  }

  [[nodiscard]] std::vector<Peak> find_peaks() const {
    std::vector<Peak> peaks;
    const int w = filtered_.width();
    const int h = filtered_.height();
    std::vector<float> limit(static_cast<std::size_t>(w));
    std::vector<int> above_limit;
    for (int y = 0; y < h; ++y) {
      if (y % noise_rows == 0) {
        noise_.row(std::min(h - 1, y + noise_rows / 2), limit);
        for (float& v : limit) v = std::max(1.0F, candidate_least * v);
      }
      find_above(filtered_.row(y), limit.data(), w, above_limit);
      for (const int x : above_limit) {
        if (is_peak(x, y)) peaks.push_back({x, y, filtered_.at(x, y)});
      }
    }
    const auto brighter = [](const Peak& a, const Peak& b) {
      return a.value != b.value ? a.value > b.value : (a.y != b.y ? a.y < b.y : a.x < b.x);
    };
    if (peaks.size() > candidates_max) {
      std::nth_element(peaks.begin(), peaks.begin() + candidates_max, peaks.end(), brighter);
      peaks.resize(candidates_max);
    }
    std::sort(peaks.begin(), peaks.end(), brighter);
    return peaks;
  }

  /// Of equal neighbours the last counts.
  [[nodiscard]] bool is_peak(int x, int y) const {
    const float v = filtered_.at(x, y);
    for (int j = -1; j <= 1; ++j) {
      for (int i = -1; i <= 1; ++i) {
        if ((i == 0 && j == 0) || !filtered_.contains(x + i, y + j)) continue;
        const float other = filtered_.at(x + i, y + j);
        const bool later = j > 0 || (j == 0 && i > 0);
        if (later ? v <= other : v < other) return false;
      }
    }
    return true;
  }

  /// Light at the same distance on two opposite sides, about as much as in the middle: a streak or a surface.
  [[nodiscard]] bool drawn_out(const Peak& peak) const {
    const double d = std::max(2.0, 1.5 * psf_.fwhm_px());
    for (int k = 0; k < 8; ++k) {
      const double angle = k * std::numbers::pi / 8;
      const int dx = static_cast<int>(std::lround(d * std::cos(angle)));
      const int dy = static_cast<int>(std::lround(d * std::sin(angle)));
      if (!filtered_.contains(peak.x + dx, peak.y + dy) || !filtered_.contains(peak.x - dx, peak.y - dy))
        continue;
      const float one = filtered_.at(peak.x + dx, peak.y + dy);
      const float other = filtered_.at(peak.x - dx, peak.y - dy);
      if (std::min(one, other) > 0.5F * peak.value && std::max(one, other) < 1.3F * peak.value) return true;
    }
    return false;
  }

  void try_peak(const Peak& peak, int pass) {
    Fitted star;
    star.x = peak.x;
    star.y = peak.y;
    star.noise = noise_at(peak.x, peak.y);
    star.radius = psf_.fit_radius();
    star.height = double(peak.value) / std::sqrt(energy_);
    int run = 0;  // half the width of a saturated patch
    while (run < 40 && clean_.flaws.contains(peak.x + run, peak.y) &&
           (clean_.flaws.at(peak.x + run, peak.y) & flaw_saturated) != 0)
      ++run;
    star.radius += run;
    if (run == 0 && peak.value < 60 && drawn_out(peak)) return;
    if (!fit(star, 4, 0)) return;
    if (std::hypot(star.x - peak.x, star.y - peak.y) > std::max(1.5, 0.7 * psf_.fwhm_px()) + run) return;
    if (star.energy < (run > 0 ? 0.02 : 0.4) * energy_) return;
    judge(star, pass);
    if (star.significance < double(candidate_least)) return;
    if (run == 0 && (is_one_pixel(star) || !has_star_width(star, 3))) return;
    add_light(star, -1);
    stars_.push_back(star);
  }

  [[nodiscard]] static double significance_of(const Fitted& star) {
    return star.height / std::hypot(star.noise / std::sqrt(star.energy), star.left_over);
  }

  /// Significance beside the noise and beside what brighter stars leave.
  void judge(Fitted& star, int pass) const {
    const int x = std::clamp(static_cast<int>(std::lround(star.x)), 0, residual_.width() - 1);
    const int y = std::clamp(static_cast<int>(std::lround(star.y)), 0, residual_.height() - 1);
    double others = 0;
    for (int j = std::max(0, y - 1); j <= std::min(residual_.height() - 1, y + 1); ++j) {
      for (int i = std::max(0, x - 1); i <= std::min(residual_.width() - 1, x + 1); ++i)
        others = std::max(others, double(clean_.signal.at(i, j)) - double(residual_.at(i, j)));
    }
    star.left_over = (pass == 0 ? 1 : 1.5) * model_error * others;
    star.significance = significance_of(star);
  }

  struct Area {
    int x0, y0, x1, y1;
  };
  [[nodiscard]] Area area(double x, double y, int radius) const {
    const int xi = static_cast<int>(std::lround(x));
    const int yi = static_cast<int>(std::lround(y));
    return {std::max(0, xi - radius), std::max(0, yi - radius), std::min(residual_.width() - 1, xi + radius),
            std::min(residual_.height() - 1, yi + radius)};
  }

  /// The residual around a star, as far as it is fitted.
  void take_patch(const Fitted& star, int radius) {
    const int xi = static_cast<int>(std::lround(star.x));
    const int yi = static_cast<int>(std::lround(star.y));
    const int w = residual_.width();
    patch_.x0 = xi - radius;
    patch_.y0 = yi - radius;
    patch_.rows = 2 * radius + 1;
    patch_.width = (2 * radius + Patch::lanes) / Patch::lanes * Patch::lanes;
    patch_.light.assign(patch_.size(), 0.0F);
    patch_.use.assign(patch_.size(), 0.0F);
    const int from = std::max(0, patch_.x0);
    const int end = std::min(w, xi + radius + 1);
    for (int j = 0; j < patch_.rows; ++j) {
      const int y = patch_.y0 + j;
      if (y < 0 || y >= residual_.height() || from >= end) continue;
      const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(j) * patch_.width + (from - patch_.x0);
      std::copy_n(residual_.row(y) + from, end - from, patch_.light.begin() + at);
      const std::uint8_t* flaws = clean_.flaws.row(y) + from;
      for (int i = 0; i < end - from; ++i)
        patch_.use[static_cast<std::size_t>(at + i)] = flaws[i] == 0 ? 1.0F : 0.0F;
    }
  }

  /// Least squares of position and height on the residual frame. @param shot  share of a pixel's light in its
  /// variance
  [[nodiscard]] bool fit(Fitted& star, int rounds, double shot) {
    take_patch(star, star.radius);
    for (int round = 0; round < rounds; ++round) {
      const FitSums f = fit_sums(profile_, patch_, static_cast<float>(star.x), static_cast<float>(star.y),
                                 static_cast<float>(star.height), static_cast<float>(shot));
      star.energy = double(f.energy);
      // A star at the frame's edge or behind a saturated core leaves directions unseen.
      const double xx = double(f.xx) * 1.0001, yy = double(f.yy) * 1.0001, hh = double(f.hh) * 1.0001;
      const double xy = double(f.xy), xh = double(f.xh), yh = double(f.yh);
      const double rx = double(f.rx), ry = double(f.ry), rh = double(f.rh);
      const double c00 = yy * hh - yh * yh;
      const double c01 = xh * yh - xy * hh;
      const double c02 = xy * yh - xh * yy;
      const double det = xx * c00 + xy * c01 + xh * c02;
      if (!(det > 0)) return false;
      double dx = (c00 * rx + c01 * ry + c02 * rh) / det;
      double dy = (c01 * rx + (xx * hh - xh * xh) * ry + (xy * xh - xx * yh) * rh) / det;
      const double dh = (c02 * rx + (xy * xh - xx * yh) * ry + (xx * yy - xy * xy) * rh) / det;
      if (!std::isfinite(dx + dy + dh)) return false;
      const double longest = 0.4 * psf_.fwhm_px();
      const double length = std::hypot(dx, dy);
      if (length > longest) dx *= longest / length, dy *= longest / length;
      star.x += dx;
      star.y += dy;
      star.height += length > longest ? 0.0 : dh;
      if (!(star.height > 0)) return false;
      if (length < 0.03 * psf_.fwhm_px() / std::max(3.0, star.height) && std::abs(dh) < 0.05) break;
      if (std::hypot(star.x - patch_.x0 - star.radius, star.y - patch_.y0 - star.radius) > 0.8)
        take_patch(star, star.radius);
    }
    return star.x > -1 && star.y > -1 && star.x < residual_.width() && star.y < residual_.height();
  }

  void add_light(const Fitted& star, float sign) {
    // As far as its light is a tenth of the noise.
    const double reach =
        std::min(200.0, std::ceil(psf_.radius_at(std::clamp(0.1 / star.height, 1e-5, 0.5)) + 0.5));
    const Area a = area(star.x, star.y, static_cast<int>(reach));
    for (int y = a.y0; y <= a.y1; ++y) {
      const double dy = y - star.y;
      const int half = static_cast<int>(std::sqrt(std::max(1.0, reach * reach - dy * dy)));
      const int from = std::max(a.x0, static_cast<int>(star.x) - half);
      const int end = std::min(a.x1, static_cast<int>(star.x) + half) + 1;
      if (from >= end) continue;
      add_profile(profile_, sign * static_cast<float>(star.height), static_cast<float>(from - star.x),
                  static_cast<float>(dy), residual_.row(y) + from, end - from);
    }
  }

  /// Whether one pixel alone explains the peak better than a star does. The star is still in the residual.
  [[nodiscard]] bool is_one_pixel(const Fitted& star) {
    take_patch(star, star.radius);
    profile_heights(profile_, patch_, static_cast<float>(star.x), static_cast<float>(star.y), heights_);
    float product = 0;
    float energy = 0;
    float highest = 0;
    for (std::size_t i = 0; i < patch_.size(); ++i) {
      const float p = heights_[i] * patch_.use[i];
      const float v = patch_.light[i];
      product += p * v;
      energy += p * p;
      if (p > 0.3F) highest = std::max(highest, v);
    }
    return highest * highest > product * product / energy;
  }

  /// Measures the width beside the frame's. @return false for what is clearly no star
  [[nodiscard]] bool has_star_width(Fitted& star, int rounds) {
    take_patch(star, star.radius + 1);
    double log_scale = std::log(star.scale);
    double height = star.height;
    double ss_last = 0;
    for (int round = 0; round < rounds; ++round) {
      const WidthSums f = width_sums(profile_, patch_, static_cast<float>(star.x), static_cast<float>(star.y),
                                     static_cast<float>(height), static_cast<float>(std::exp(-2 * log_scale)),
                                     static_cast<float>(shot_));
      const double ss = double(f.ss), sh = double(f.sh), hh = double(f.hh), rs = double(f.rs),
                   rh = double(f.rh);
      const double det = ss * hh - sh * sh;
      if (!(det > 1e-9 * ss * hh)) break;
      const double step = std::clamp((hh * rs - sh * rh) / det, -0.4, 0.4);
      log_scale = std::clamp(log_scale + step, -1.5, 1.2);
      height = std::max(0.1 * star.height, height + (ss * rh - sh * rs) / det);
      ss_last = det / hh;
      if (std::abs(step) < 0.01) break;
    }
    star.scale = std::exp(log_scale);
    star.scale_error = ss_last > 0 ? star.scale / std::sqrt(ss_last) : star.scale;
    // Beyond three errors and beyond what blends and the field's corners do.
    if (star.scale - 3 * star.scale_error > 1.9) return false;
    return star.scale + 3 * star.scale_error > 0.6;
  }

  /// How much more bright pixels scatter than dark ones, from the bright stars' own residuals.
  void measure_shot_noise() {
    std::vector<float> shares;
    for (const Fitted& star : stars_) {
      if (star.height < 15 || shares.size() >= 200) continue;
      take_patch(star, star.radius);
      profile_heights(profile_, patch_, static_cast<float>(star.x), static_cast<float>(star.y), heights_);
      float excess = 0;
      float light = 0;
      for (std::size_t i = 0; i < patch_.size(); ++i) {
        excess += patch_.use[i] * (patch_.light[i] * patch_.light[i] - 1);
        light += patch_.use[i] * static_cast<float>(star.height) * heights_[i];
      }
      shares.push_back(excess / light);
    }
    if (shares.size() >= 5) shot_ = std::clamp(double(median_of(shares)), 0.0, 0.5);
  }

  /// Which stars have neighbours whose light matters, and which of those are new since @p known.
  void find_crowds(std::size_t known) {
    const int cell = std::max(2, static_cast<int>(std::lround(3 * psf_.fwhm_px())));
    Grid<int> all(residual_.width() / cell + 3, residual_.height() / cell + 3);
    Grid<int> fresh(all.width(), all.height());
    const auto place = [cell](double v) { return static_cast<int>(std::floor((v + 1) / cell)) + 1; };
    for (std::size_t i = 0; i < stars_.size(); ++i) {
      ++all.at(place(stars_[i].x), place(stars_[i].y));
      if (i >= known) ++fresh.at(place(stars_[i].x), place(stars_[i].y));
    }
    for (Fitted& star : stars_) {
      int near = 0;
      int new_ones = 0;
      for (int j = place(star.y) - 1; j <= place(star.y) + 1; ++j) {
        for (int i = place(star.x) - 1; i <= place(star.x) + 1; ++i) {
          if (!all.contains(i, j)) continue;
          near += all.at(i, j);
          new_ones += fresh.at(i, j);
        }
      }
      star.crowded = near > 1;
      star.changed = new_ones > 0;
    }
  }

  /// What changed again, with its neighbours taken away.
  void refine() {
    for (int round = 0; round < 2; ++round) {
      for (Fitted& star : stars_) {
        if (!star.changed || (round > 0 && !star.crowded)) continue;
        Fitted better = star;
        add_light(star, 1);
        if (fit(better, 2, shot_) && std::hypot(better.x - star.x, better.y - star.y) < psf_.fwhm_px())
          star = better;
        else
          star.height = 0;
        if (star.height > 0) add_light(star, -1);
      }
      std::erase_if(stars_, [](const Fitted& s) { return s.height <= 0; });
    }
    for (Fitted& star : stars_) {
      if (!star.changed) continue;
      // Beside the other stars only.
      add_light(star, 1);
      judge(star, 1);
      const bool saturated = star.radius > psf_.fit_radius();  // its core is unknown
      if ((has_star_width(star, 4) && !is_sharper(star)) || saturated) {
        add_light(star, -1);
      } else {
        sharp_.push_back(star);
        star.height = 0;
      }
    }
    std::erase_if(stars_, [](const Fitted& s) { return s.height <= 0; });
  }

  /// Dark where a star of this brightness would give light: the track of a particle. The star is in the
  /// residual.
  [[nodiscard]] bool is_sharper(const Fitted& star) {
    take_patch(star, star.radius);
    profile_heights(profile_, patch_, static_cast<float>(star.x), static_cast<float>(star.y), heights_);
    const auto height = static_cast<float>(star.height);
    float missing = 0;
    float energy = 0;
    int n = 0;
    for (std::size_t i = 0; i < patch_.size(); ++i) {
      const float p = heights_[i];
      if (p < 0.08F || patch_.use[i] == 0) continue;
      const float r = std::min(0.0F, patch_.light[i] - height * p);
      missing += r * r / (1 + static_cast<float>(shot_) * height * p);
      energy += height * height * p * p;
      ++n;
    }
    // Half of the pixels are below the model by their noise alone.
    const double by_noise = 0.5 * n + 3.5 * std::sqrt(1.25 * n);
    return double(missing) > by_noise + sharper_share * double(energy);
  }

  /// Keeps what is significant: the lower the limit, the more peaks of the noise come with it.
  void select() {
    for (Fitted& star : stars_) star.significance = significance_of(star);
    double least = options_.snr_least;
    if (least <= 0) {
      const double area =
          static_cast<double>(residual_.size()) / (4 * double(psf_.sigma_px()) * double(psf_.sigma_px()));
      for (least = 4.2; least < 5; least += 0.05) {
        const double false_ones = area * 0.0635 * least * std::exp(-least * least / 2);
        const auto found = std::count_if(stars_.begin(), stars_.end(),
                                         [&](const Fitted& s) { return s.significance >= least; });
        if (false_ones <= 0.015 * static_cast<double>(found)) break;
      }
    }
    for (const Fitted& star : stars_) {
      if (star.significance < least) add_light(star, 1);
    }
    std::erase_if(stars_, [&](const Fitted& s) { return s.significance < least; });
  }

  [[nodiscard]] StarField result() {
    StarField field;
    field.masked = Grid<std::uint8_t>(residual_.width(), residual_.height());
    for (const Fitted& s : stars_) {
      const double unit = double(clean_.noise_adu.at(s.x, s.y));
      const double noise = s.noise / std::sqrt(std::max(s.energy, 0.3 * energy_));
      field.stars.push_back(
          {s.x, s.y, s.height * psf_.flux() * unit, s.height / noise, psf_.fwhm_px() * s.scale});
      mask(s, field.masked);
    }
    std::sort(field.stars.begin(), field.stars.end(), [](const Star& a, const Star& b) {
      return a.flux != b.flux ? a.flux > b.flux : (a.y != b.y ? a.y < b.y : a.x < b.x);
    });
    for (const Fitted& s : sharp_) mask(s, field.masked);
    const auto most = static_cast<std::size_t>(std::max(0, options_.stars_max));
    if (field.stars.size() > most) field.stars.resize(most);
    field.residual = std::move(residual_);
    return field;
  }

  /// Where the model's error may be more than half the noise.
  void mask(const Fitted& star, Grid<std::uint8_t>& masked) const {
    const double reach =
        std::max(0.6 * psf_.fwhm_px(), psf_.radius_at(std::clamp(0.5 / (0.15 * star.height), 1e-5, 0.9)));
    const Area a = area(star.x, star.y, std::min(150, static_cast<int>(std::ceil(reach))));
    for (int y = a.y0; y <= a.y1; ++y) {
      for (int x = a.x0; x <= a.x1; ++x) {
        if (std::hypot(x - star.x, y - star.y) <= reach) masked.at(x, y) = 1;
      }
    }
  }

  const CleanFrame& clean_;
  const Psf& psf_;
  Profile profile_;
  const StarOptions& options_;
  Plane residual_;
  Plane filtered_;
  Surface noise_;
  Patch patch_;
  std::vector<float> heights_;
  double energy_ = 0;
  double shot_ = 0;
  std::vector<Fitted> stars_;
  std::vector<Fitted> sharp_;  ///< taken for stars at first
};

}  // namespace

StarField find_stars(const CleanFrame& clean, const StarOptions& options) {
  return Finder(clean, options).run();
}

}  // namespace srfs::image
