#include "image/streak_finder.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <Eigen/Dense>

#include "image/filter.hpp"
#include "image/line_search.hpp"

namespace srfs::image {
namespace {

constexpr double hit_least = 5.2;
constexpr int fits_max = 300;   ///< candidates that are looked at
constexpr int box_radius = 16;  ///< of the high-pass

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// Ends, height along the middle line, width beside the frame's.
struct Line {
  double x1, y1, x2, y2;
  double height = 1;
  double scale = 1;

  [[nodiscard]] double length() const { return std::hypot(x2 - x1, y2 - y1); }
};

/// Takes away what is larger than a streak is wide: the mean of the clipped surroundings.
void high_pass(Plane& plane) {
  const int w = plane.width();
  const int h = plane.height();
  std::vector<float> column(static_cast<std::size_t>(w), 0.0F);
  std::vector<float> sums(static_cast<std::size_t>(w) + 1);
  const Plane in = plane;
  const auto add_row = [&](int y, float sign) {
    const float* row = in.row(y);
    for (int x = 0; x < w; ++x) column[static_cast<std::size_t>(x)] += sign * std::clamp(row[x], -3.0F, 3.0F);
  };
  int rows = 0;
  for (int y = 0; y < std::min(h, box_radius); ++y) add_row(y, 1), ++rows;
  for (int y = 0; y < h; ++y) {
    if (y + box_radius < h) add_row(y + box_radius, 1), ++rows;
    if (y - box_radius - 1 >= 0) add_row(y - box_radius - 1, -1), --rows;
    for (int x = 0; x < w; ++x)
      sums[static_cast<std::size_t>(x) + 1] =
          sums[static_cast<std::size_t>(x)] + column[static_cast<std::size_t>(x)];
    float* to = plane.row(y);
    for (int x = 0; x < w; ++x) {
      const int from = std::max(0, x - box_radius);
      const int end = std::min(w, x + box_radius + 1);
      to[x] -= (sums[static_cast<std::size_t>(end)] - sums[static_cast<std::size_t>(from)]) /
               static_cast<float>(rows * (end - from));
    }
  }
}

class Finder {
 public:
  Finder(const CleanFrame& clean, const StarField& field, const StreakOptions& options)
      : clean_(clean),
        field_(field),
        options_(options),
        sigma_(double(clean.psf.sigma_px())),
        light_(field.residual) {}

  std::vector<Streak> run() {
    mask_ = field_.masked;
    for (std::size_t i = 0; i < mask_.size(); ++i)
      mask_.cells()[i] = mask_.cells()[i] != 0 || clean_.flaws.cells()[i] != 0 ? 1 : 0;
    high_pass(light_);
    without_stars_ = significance(light_, mask_);
    {
      // With the stars: a bright streak looks like stars in a row to who looks for stars only.
      Plane whole = clean_.signal;
      high_pass(whole);
      with_stars_ = significance(whole, clean_.flaws);
    }
    taken_.assign(field_.stars.size(), false);
    std::vector<Seed> seeds;
    add_seeds(without_stars_, 8, false, seeds);
    add_seeds(with_stars_, 5, true, seeds);
    std::stable_sort(seeds.begin(), seeds.end(),
                     [](const Seed& a, const Seed& b) { return a.significance > b.significance; });
    int fits = 0;
    for (const Seed& seed : seeds) {
      if (is_known(seed.line, seed.with_stars)) continue;
      if (seed.with_stars && !looks_like_streak(seed.line)) continue;
      if (++fits > fits_max) break;
      examine(seed);
    }
    merge();
    return result();
  }

  /// @param star  its index in the field
  [[nodiscard]] bool is_part_of_streak(std::size_t star) const { return taken_[star]; }

 private:
  struct Seed {
    Line line;
    double significance;
    bool with_stars;
  };

  void add_seeds(const Plane& plane, float clip, bool with_stars, std::vector<Seed>& seeds) const {
    const int step = sigma_ >= 1 ? 2 : 1;
    Plane cells(std::max(1, plane.width() / step), std::max(1, plane.height() / step));
    for (int y = 0; y < cells.height(); ++y) {
      for (int x = 0; x < cells.width(); ++x) cells.at(x, y) = plane.at(x * step, y * step);
    }
    for (const LineHit& hit : search_lines(cells, sigma_ / step, hit_least, clip))
      seeds.push_back(
          {Line{hit.x1 * step, hit.y1 * step, hit.x2 * step, hit.y2 * step}, hit.significance, with_stars});
  }

  /// Through the matched filter, noise 1; masked pixels are sky.
  [[nodiscard]] Plane significance(const Plane& plane, const Grid<std::uint8_t>& mask) {
    Plane shown = plane;
    for (std::size_t i = 0; i < shown.size(); ++i) {
      if (mask.cells()[i] != 0) shown.cells()[i] = 0;
    }
    Plane filtered = gaussian_filter(shown, static_cast<float>(sigma_));
    Surface noise = measure_sky(filtered, sky_cell_px(filtered.width(), filtered.height()), 0.05F).noise;
    std::vector<float> row_noise(static_cast<std::size_t>(filtered.width()));
    for (int y = 0; y < filtered.height(); ++y) {
      noise.row(y, row_noise);
      float* row = filtered.row(y);
      for (std::size_t x = 0; x < row_noise.size(); ++x) row[x] /= std::max(0.5F, row_noise[x]);
    }
    if (noise_.nodes().empty()) noise_ = std::move(noise);
    return filtered;
  }

  [[nodiscard]] bool usable(int x, int y) const { return mask_.at(x, y) == 0; }

  /// Some light on every part of it and less beside it, quickly judged.
  [[nodiscard]] bool looks_like_streak(const Line& l) const {
    const double length = std::max(1e-6, l.length());
    const double d = 1.5 * clean_.psf.fwhm_px();
    const double nx = -(l.y2 - l.y1) / length * d;
    const double ny = (l.x2 - l.x1) / length * d;
    double middle = 0;
    double beside = 0;
    int dark = 0;
    constexpr int n = 12;
    for (int i = 0; i <= n; ++i) {
      const double x = l.x1 + (l.x2 - l.x1) * i / n;
      const double y = l.y1 + (l.y2 - l.y1) * i / n;
      const double here = sample(with_stars_, x, y);
      middle += std::min(here, 30.0);
      beside += std::min(sample(with_stars_, x + nx, y + ny), 30.0) +
                std::min(sample(with_stars_, x - nx, y - ny), 30.0);
      dark += here < 1;
    }
    return dark <= n / 2 && beside / 2 < 0.6 * middle;
  }

  /// Within the light of a streak already found or refused.
  [[nodiscard]] bool is_known(const Line& seed, bool with_stars) const {
    const double mx = (seed.x1 + seed.x2) / 2;
    const double my = (seed.y1 + seed.y2) / 2;
    const auto covers = [&](const Line& l) {
      const double length = std::max(1e-6, l.length());
      const double ux = (l.x2 - l.x1) / length;
      const double uy = (l.y2 - l.y1) / length;
      const auto near = [&](double x, double y) {
        const double t = (x - l.x1) * ux + (y - l.y1) * uy;
        const double d = std::abs((y - l.y1) * ux - (x - l.x1) * uy);
        return t > -2 * sigma_ - 6 && t < length + 2 * sigma_ + 6 && d < 3 * sigma_ + 3;
      };
      return near(mx, my) || (near(0.75 * seed.x1 + 0.25 * seed.x2, 0.75 * seed.y1 + 0.25 * seed.y2)) ||
             near(0.25 * seed.x1 + 0.75 * seed.x2, 0.25 * seed.y1 + 0.75 * seed.y2);
    };
    return std::any_of(found_.begin(), found_.end(), covers) ||
           std::any_of(refused_[with_stars ? 1 : 0].begin(), refused_[with_stars ? 1 : 0].end(), covers);
  }

  [[nodiscard]] static double sample(const Plane& plane, double x, double y) {
    const int i = static_cast<int>(std::floor(x));
    const int j = static_cast<int>(std::floor(y));
    if (i < 0 || j < 0 || i + 1 >= plane.width() || j + 1 >= plane.height()) return 0;
    const double u = x - i;
    const double v = y - j;
    return (1 - v) * ((1 - u) * double(plane.at(i, j)) + u * double(plane.at(i + 1, j))) +
           v * ((1 - u) * double(plane.at(i, j + 1)) + u * double(plane.at(i + 1, j + 1)));
  }

  /// Clipped, so that one star left over does not turn the line to itself.
  [[nodiscard]] static double mean_along(const Plane& plane, const Line& l) {
    const int n = std::max(4, static_cast<int>(l.length()));
    double sum = 0;
    for (int i = 0; i <= n; ++i) {
      const double t = static_cast<double>(i) / n;
      sum += std::min(sample(plane, l.x1 + t * (l.x2 - l.x1), l.y1 + t * (l.y2 - l.y1)), 30.0);
    }
    return sum / (n + 1);
  }

  /// Moves the ends across the line to where most light is.
  void turn(const Plane& plane, Line& l) const {
    double best = mean_along(plane, l);
    for (double step = std::max(1.0, sigma_); step > 0.2; step /= 2) {
      for (int round = 0; round < 6; ++round) {
        const double length = std::max(1e-6, l.length());
        const double nx = -(l.y2 - l.y1) / length * step;
        const double ny = (l.x2 - l.x1) / length * step;
        bool moved = false;
        for (const auto& [a, b] :
             {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, -1}, {1, -1}, {-1, 1}}) {
          Line moved_line = l;
          moved_line.x1 += a * nx, moved_line.y1 += a * ny;
          moved_line.x2 += b * nx, moved_line.y2 += b * ny;
          const double value = mean_along(plane, moved_line);
          if (value <= best) continue;
          best = value;
          l = moved_line;
          moved = true;
          break;
        }
        if (!moved) break;
      }
    }
  }

  /// Moves the ends along the line to where the light falls below half.
  void stretch(const Plane& plane, Line& l) const {
    const double length = std::max(1e-6, l.length());
    const double ux = (l.x2 - l.x1) / length;
    const double uy = (l.y2 - l.y1) / length;
    const double half = 0.5 * std::min(mean_along(plane, l), 12.0);
    if (half <= 0) return;
    const double mx = (l.x1 + l.x2) / 2;
    const double my = (l.y1 + l.y2) / 2;
    const auto reach = [&](double sign) {
      double sum = 0;
      double highest = 0;
      double at = 1;
      const int most = plane.width() + plane.height();
      for (int t = 0; t < most; ++t) {
        const double x = mx + sign * t * ux;
        const double y = my + sign * t * uy;
        if (x < 0 || y < 0 || x > plane.width() - 1 || y > plane.height() - 1) break;
        sum += std::min(sample(plane, x, y), 4 * half) - half;
        if (sum > highest) highest = sum, at = t;
        if (highest - sum > std::max(8 * half, 0.25 * highest) && highest - sum > 6 * sigma_ * half) break;
      }
      return at;
    };
    const double after = reach(1);
    const double before = reach(-1);
    l.x1 = mx - before * ux, l.y1 = my - before * uy;
    l.x2 = mx + after * ux, l.y2 = my + after * uy;
  }

  /// Light of a line of height 1 at a pixel.
  struct Model {
    explicit Model(const Line& l, double sigma)
        : line(l),
          length(std::max(1e-3, l.length())),
          ux((l.x2 - l.x1) / length),
          uy((l.y2 - l.y1) / length),
          along(1 / (std::sqrt(2.0) * sigma)),
          across(0.5 / (sigma * sigma * l.scale * l.scale)) {}
    [[nodiscard]] double operator()(double x, double y) const {
      const double t = (x - line.x1) * ux + (y - line.y1) * uy;
      const double d = (y - line.y1) * ux - (x - line.x1) * uy;
      return 0.5 * (std::erf(t * along) - std::erf((t - length) * along)) * std::exp(-d * d * across);
    }
    Line line;
    double length, ux, uy, along, across;
  };

  /// Calls use(x, y) for the pixels within the light of a line.
  template <class Use>
  void for_pixels(const Line& l, Use&& use) const {
    const double length = std::max(1e-3, l.length());
    const double ux = (l.x2 - l.x1) / length;
    const double uy = (l.y2 - l.y1) / length;
    const double reach = 3 * sigma_ * std::max(1.0, l.scale) + 1;
    const int y0 = std::max(0, static_cast<int>(std::floor(std::min(l.y1, l.y2) - reach)));
    const int y1 = std::min(light_.height() - 1, static_cast<int>(std::ceil(std::max(l.y1, l.y2) + reach)));
    const int x0 = std::max(0, static_cast<int>(std::floor(std::min(l.x1, l.x2) - reach)));
    const int x1 = std::min(light_.width() - 1, static_cast<int>(std::ceil(std::max(l.x1, l.x2) + reach)));
    for (int y = y0; y <= y1; ++y) {
      int from = x0;
      int to = x1;
      if (std::abs(uy) > 0.05) {  // where this row is near the line
        const double middle = l.x1 + (y - l.y1) * ux / uy;
        from = std::max(from, static_cast<int>(std::floor(middle - reach / std::abs(uy))));
        to = std::min(to, static_cast<int>(std::ceil(middle + reach / std::abs(uy))));
      }
      for (int x = from; x <= to; ++x) {
        const double d = (y - l.y1) * ux - (x - l.x1) * uy;
        const double t = (x - l.x1) * ux + (y - l.y1) * uy;
        if (std::abs(d) <= reach && t > -reach && t < length + reach) use(x, y);
      }
    }
  }

  /// Gauss-Newton of ends, height and width. @return how significant the light is; 0: not a line
  [[nodiscard]] double fit(Line& l) const {
    double energy = 0;
    for (int round = 0; round < 15; ++round) {
      Matrix6 normal = Matrix6::Zero();
      Vector6 right = Vector6::Zero();
      energy = 0;
      constexpr double h = 0.02;
      const auto moved = [&](double a, double b, double c, double d, double s) {
        Line m = l;
        m.x1 += a, m.y1 += b, m.x2 += c, m.y2 += d, m.scale += s;
        return Model(m, sigma_);
      };
      const Model model(l, sigma_);
      const std::array steps{moved(h, 0, 0, 0, 0), moved(0, h, 0, 0, 0), moved(0, 0, h, 0, 0),
                             moved(0, 0, 0, h, 0), moved(0, 0, 0, 0, h)};
      for_pixels(l, [&](int x, int y) {
        if (!usable(x, y)) return;
        const double m = model(x, y);
        Vector6 gradient;
        for (int k = 0; k < 5; ++k)
          gradient[k] = l.height * (steps[static_cast<std::size_t>(k)](x, y) - m) / h;
        gradient[5] = m;
        const double r = double(light_.at(x, y)) - l.height * m;
        const double weight = 1 / (1 + 0.03 * std::abs(l.height) * m);
        normal.noalias() += weight * gradient * gradient.transpose();
        right += weight * r * gradient;
        energy += m * m;
      });
      if (!(energy > 0)) return 0;
      normal(4, 4) += 4 * std::max(1.0, l.height * l.height);  // the width is the frame's but for good reason
      right(4) += 4 * std::max(1.0, l.height * l.height) * (1 - l.scale);
      normal.diagonal() *= 1.001;
      const Vector6 step = normal.ldlt().solve(right);
      if (!step.allFinite()) return 0;
      const double longest =
          std::max({std::abs(step[0]), std::abs(step[1]), std::abs(step[2]), std::abs(step[3])});
      const double part = std::min(1.0, 2 * sigma_ / std::max(1e-9, longest));
      l.x1 += part * step[0], l.y1 += part * step[1], l.x2 += part * step[2], l.y2 += part * step[3];
      l.scale = std::clamp(l.scale + part * step[4], 0.3, 4.0);
      l.height += part * step[5];
      if (!(l.height > 0)) return 0;
      if (longest < 0.02) break;
    }
    return l.height * std::sqrt(energy) /
           std::max(0.5, double(noise_.at((l.x1 + l.x2) / 2, (l.y1 + l.y2) / 2)));
  }

  /// Lit on its whole length, by nothing sharper than the optics, and mostly seen.
  [[nodiscard]] bool is_even(const Line& l, double snr) const {
    constexpr int parts = 4;
    std::array<double, parts> product{};
    std::array<double, parts> energy{};
    double seen = 0;
    double all = 0;
    double spikes = 0;
    const Model model(l, sigma_);
    for_pixels(l, [&](int x, int y) {
      const double m = model(x, y);
      all += m;
      if ((clean_.flaws.at(x, y) & flaw_spike) != 0) spikes += m;
      if (!usable(x, y)) return;
      seen += m;
      const double t = ((x - l.x1) * model.ux + (y - l.y1) * model.uy) / model.length;
      const auto part = static_cast<std::size_t>(std::clamp(static_cast<int>(t * parts), 0, parts - 1));
      product[part] += m * double(light_.at(x, y));
      energy[part] += m * m;
    });
    if (seen < (l.length() < 25 ? 0.75 : 0.5) * all || spikes > 0.15 * all) return false;
    int lit = 0;
    int looked = 0;
    for (std::size_t k = 0; k < parts; ++k) {
      if (energy[k] < 0.05) continue;
      ++looked;
      const double height = product[k] / energy[k];
      const double error = 1 / std::sqrt(energy[k]);
      lit += height > 0.4 * l.height - 1.5 * error && height < 2.5 * l.height + 3 * error;
    }
    // The part that shines most may be a star; the rest has to be a streak without it.
    double rest_product = 0;
    double rest_energy = 0;
    std::size_t brightest = 0;
    for (std::size_t k = 1; k < parts; ++k) {
      if (product[k] > product[brightest]) brightest = k;
    }
    for (std::size_t k = 0; k < parts; ++k) {
      if (k != brightest) rest_product += product[k], rest_energy += energy[k];
    }
    const double rest = rest_energy > 0 ? rest_product / std::sqrt(rest_energy) : 0;
    return looked >= 2 && lit >= looked - 1 && rest > 0.45 * snr;
  }

  [[nodiscard]] bool is_streak(const Line& l, double snr) const {
    const double fwhm = clean_.psf.fwhm_px();
    // Between stars that touch there is room for something short and faint.
    if (snr < options_.snr_least * (l.length() < 25 ? 1.2 : 1) ||
        l.length() < std::max(0.75 * options_.length_least_px, 1.3 * fwhm))
      return false;
    if (l.scale > 1.8 || l.scale < 0.62) return false;
    return is_even(l, snr);
  }

  /// The line that fits best from here, on what a plane shows. @return its significance; 0: none
  [[nodiscard]] double trace(const Plane& plane, Line& l) const {
    for (int round = 0; round < 3; ++round) {
      turn(plane, l);
      stretch(plane, l);
      if (l.length() < 2) return 0;
    }
    l.height = std::max(0.1, mean_along(plane, l) * 0.4);
    return 1;
  }

  void examine(const Seed& seed) {
    if (!seed.with_stars) {
      Line l = seed.line;
      const double snr = trace(without_stars_, l) > 0 ? fit(l) : 0;
      const bool alone = snr > 0 && is_streak(l, snr);
      // Stars may have been fitted to its brighter parts.
      if (try_with_stars(alone ? l : seed.line, alone ? snr : 0)) return;
      if (alone) {
        found_.push_back(l);
        snrs_.push_back(snr);
        return;
      }
    } else if (try_with_stars(seed.line, 0)) {
      return;
    }
    refused_[seed.with_stars ? 1 : 0].push_back(seed.line);
  }

  /// Gives the light of the stars on the line back to it. @return whether a streak explains it better than
  /// the stars did
  bool try_with_stars(const Line& seed, double snr_without) {
    Line l = seed;
    if (!(trace(with_stars_, l) > 0)) return false;
    const std::vector<std::size_t> stars = stars_on(l);
    if (stars.empty() && snr_without > 0) return false;
    const Line area = l;
    std::vector<std::pair<std::size_t, std::uint8_t>> masked_before;
    give_back(stars, 1, &masked_before);
    const double snr = fit(l);
    bool better = snr > snr_without && is_streak(l, snr);
    if (better && !stars.empty()) {
      const double as_line = mismatch(area, l, &l);
      give_back(stars, -1, nullptr);
      const double as_stars = mismatch(area, l, nullptr);
      give_back(stars, 1, nullptr);
      better = as_line < as_stars + advantage(stars.size());
    }
    if (!better) {
      give_back(stars, -1, nullptr);
      for (const auto& [at, value] : masked_before) mask_.cells()[at] = value;
      return false;
    }
    for (const std::size_t i : stars) taken_[i] = true;
    found_.push_back(l);
    snrs_.push_back(snr);
    return true;
  }

  /// How much worse a line may fit than @p stars stars: it has fewer parameters, but in a crowded field stars
  /// that touch are the likelier explanation.
  [[nodiscard]] double advantage(std::size_t stars) const {
    const double n = static_cast<double>(field_.stars.size());
    const double reach = 1.5 * clean_.psf.fwhm_px();
    const double touching_pairs = n * n * 1.57 * reach * reach / static_cast<double>(light_.size());
    return std::min(4 * (3 * static_cast<double>(stars) - 5), 8.0) - 2 * std::log(1 + touching_pairs);
  }

  /// Stars not brighter than a streak's piece could be, whose centres lie on the line.
  [[nodiscard]] std::vector<std::size_t> stars_on(const Line& l) const {
    std::vector<std::size_t> on;
    const double length = std::max(1e-6, l.length());
    const double ux = (l.x2 - l.x1) / length;
    const double uy = (l.y2 - l.y1) / length;
    const double fwhm = clean_.psf.fwhm_px();
    for (std::size_t i = 0; i < field_.stars.size(); ++i) {
      const Star& s = field_.stars[i];
      const double t = (s.x - l.x1) * ux + (s.y - l.y1) * uy;
      const double d = std::abs((s.y - l.y1) * ux - (s.x - l.x1) * uy);
      if (!taken_[i] && t > -fwhm && t < length + fwhm && d < 0.75 * fwhm) on.push_back(i);
    }
    return on;
  }

  /// Adds the stars' light (@p sign 1) and unmasks their pixels, noting what was masked; or takes the light
  /// away (-1).
  void give_back(const std::vector<std::size_t>& stars, float sign,
                 std::vector<std::pair<std::size_t, std::uint8_t>>* masked) {
    for (const std::size_t i : stars) {
      const Star& s = field_.stars[i];
      const double height = s.flux / clean_.psf.flux() / double(clean_.noise_adu.at(s.x, s.y));
      const int r = std::min(
          100, static_cast<int>(std::ceil(clean_.psf.radius_at(std::clamp(0.1 / height, 1e-5, 0.5)))));
      const int x0 = static_cast<int>(std::lround(s.x));
      const int y0 = static_cast<int>(std::lround(s.y));
      for (int y = std::max(0, y0 - r); y <= std::min(light_.height() - 1, y0 + r); ++y) {
        for (int x = std::max(0, x0 - r); x <= std::min(light_.width() - 1, x0 + r); ++x) {
          light_.at(x, y) += sign * static_cast<float>(height) *
                             clean_.psf.height(static_cast<float>(x - s.x), static_cast<float>(y - s.y));
          if (masked == nullptr || mask_.at(x, y) == 0 || clean_.flaws.at(x, y) != 0) continue;
          masked->emplace_back(static_cast<std::size_t>(y) * static_cast<std::size_t>(light_.width()) +
                                   static_cast<std::size_t>(x),
                               mask_.at(x, y));
          mask_.at(x, y) = 0;
        }
      }
    }
  }

  /// Chi squared over the pixels of @p area, of the light minus @p model (or of the light alone). The weights
  /// are those of the model @p expected in either case.
  [[nodiscard]] double mismatch(const Line& area, const Line& expected, const Line* model) const {
    double sum = 0;
    const Model light(expected, sigma_);
    for_pixels(area, [&](int x, int y) {
      if (!usable(x, y)) return;
      const double m = expected.height * light(x, y);
      const double r = double(light_.at(x, y)) - (model != nullptr ? m : 0);
      sum += r * r / (1 + 0.03 * m + 0.0025 * m * m);
    });
    return sum;
  }

  /// Two pieces that go on in each other's direction.
  [[nodiscard]] static std::optional<Line> joined(const Line& a, const Line& b, double sigma) {
    const Line& l = a.length() >= b.length() ? a : b;
    const Line& s = a.length() >= b.length() ? b : a;
    const double length = std::max(1e-6, l.length());
    const double ux = (l.x2 - l.x1) / length;
    const double uy = (l.y2 - l.y1) / length;
    const auto along = [&](double x, double y) { return (x - l.x1) * ux + (y - l.y1) * uy; };
    const auto across = [&](double x, double y) { return std::abs((y - l.y1) * ux - (x - l.x1) * uy); };
    double t1 = along(s.x1, s.y1);
    double t2 = along(s.x2, s.y2);
    if (t1 > t2) std::swap(t1, t2);
    const double gap = std::max({0.0, t1 - length, -t2});
    const double slack = 1.5 * sigma + 1 + 0.03 * gap;
    if (across(s.x1, s.y1) > slack || across(s.x2, s.y2) > slack) return std::nullopt;
    if (gap > std::max(12.0, 0.6 * (length + s.length()))) return std::nullopt;
    const double from = std::min(0.0, t1);
    const double to = std::max(length, t2);
    Line whole = l;
    whole.x1 = l.x1 + from * ux, whole.y1 = l.y1 + from * uy;
    whole.x2 = l.x1 + to * ux, whole.y2 = l.y1 + to * uy;
    return whole;
  }

  void merge() {
    for (bool again = true; again;) {
      again = false;
      for (std::size_t i = 0; i < found_.size() && !again; ++i) {
        for (std::size_t j = i + 1; j < found_.size() && !again; ++j) {
          auto whole = joined(found_[i], found_[j], sigma_);
          if (!whole) continue;
          Line fitted = *whole;
          const double snr = fit(fitted);
          const bool better = snr >= std::max(snrs_[i], snrs_[j]) && is_streak(fitted, snr);
          // Pieces that do not make one whole lie beside each other; of those that overlap the better one
          // stays.
          const double overlap = found_[i].length() + found_[j].length() - whole->length();
          if (!better && overlap < 0.3 * std::min(found_[i].length(), found_[j].length())) continue;
          if (better)
            found_[i] = fitted, snrs_[i] = snr;
          else if (snrs_[j] > snrs_[i])
            found_[i] = found_[j], snrs_[i] = snrs_[j];
          found_.erase(found_.begin() + static_cast<std::ptrdiff_t>(j));
          snrs_.erase(snrs_.begin() + static_cast<std::ptrdiff_t>(j));
          again = true;
        }
      }
    }
  }

  [[nodiscard]] std::vector<Streak> result() const {
    std::vector<Streak> streaks;
    for (std::size_t i = 0; i < found_.size(); ++i) {
      const Line& l = found_[i];
      double light = 0;
      const Model model(l, sigma_);
      for_pixels(l, [&](int x, int y) { light += model(x, y); });
      const double unit = double(clean_.noise_adu.at((l.x1 + l.x2) / 2, (l.y1 + l.y2) / 2));
      streaks.push_back(
          {l.x1, l.y1, l.x2, l.y2, snrs_[i], l.height * light * unit, 2.3548 * sigma_ * l.scale});
    }
    std::sort(streaks.begin(), streaks.end(), [](const Streak& a, const Streak& b) { return a.snr > b.snr; });
    return streaks;
  }

  const CleanFrame& clean_;
  const StarField& field_;
  const StreakOptions& options_;
  double sigma_;
  Plane light_;  ///< without stars and background, in noise
  Grid<std::uint8_t> mask_;
  Plane without_stars_;  ///< through the matched filter, noise 1
  Plane with_stars_;
  Surface noise_;
  std::vector<Line> found_;
  std::vector<double> snrs_;
  std::array<std::vector<Line>, 2> refused_;  ///< by kind of seed
  std::vector<bool> taken_;                   ///< stars that are parts of streaks
};

}  // namespace

std::vector<Streak> find_streaks(const CleanFrame& clean, StarField& field, const StreakOptions& options) {
  Finder finder(clean, field, options);
  std::vector<Streak> streaks = finder.run();
  std::size_t i = 0;
  std::erase_if(field.stars, [&](const Star&) { return finder.is_part_of_streak(i++); });
  return streaks;
}

}  // namespace srfs::image
