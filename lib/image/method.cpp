// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/method.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/text.hpp"
#include "image/known_stars.hpp"
#include "image/picture.hpp"
#include "image/plate_solver.hpp"
#include "image/sky_measurement.hpp"
#include "image/star_trails.hpp"
#include "image/streak_finder.hpp"
#include "image/synthetic_tracking.hpp"

namespace srfs::image {
namespace {

constexpr ParameterSpec fwhm{
    "fwhm", 0, 0, 12, "width of the stars, px FWHM, where the operator knows it; 0: measured in each frame"};
constexpr ParameterSpec calibrated{
    "calibrated", 1, 0, 1,
    "0: frames as they are; 1: minus the dark that fits, over the flat, where there are any"};
constexpr ParameterSpec stars_max{"max_stars", 10000, 1, 100000, "most stars to keep, brightest first"};

class StarCentroid final : public Method {
 public:
  explicit StarCentroid(const Parameters& parameters)
      : options_{parameters["threshold"], static_cast<int>(parameters["max_stars"])},
        clean_{parameters["fwhm"]} {}

  Result<FrameFindings, Refusal> process(const Frame& frame) override {
    FrameFindings findings;
    const CleanFrame clean = clean_frame(frame, findings, clean_);
    findings.stars = find_stars(clean, options_).stars;
    return findings;
  }

 private:
  StarOptions options_;
  CleanOptions clean_;
};

constexpr std::array star_centroid_parameters{
    ParameterSpec{"threshold", 0, 0, 1000,
                  "least SNR of a star; 0: automatic (4.2 to 5, about one false star in 70)"},
    stars_max,
    fwhm,
    calibrated,
};

constexpr ParameterSpec on_the_sky{
    "sky", 0, 0, 1, "1: also right ascension, declination, time and magnitude, by the frame's own stars"};

/// A frame whose attitude is known.
struct SolvedFrame {
  SkyMeasurement measurement;
  std::optional<KnownStars> known;
};

/// Measures frames against the sky, where that is asked for.
class SkySearch {
 public:
  explicit SkySearch(const Parameters& parameters) {
    if (parameters["sky"] != 0) solver_.emplace();
  }
  /// @param findings  gets the attitude, or why there is none
  [[nodiscard]] std::optional<SolvedFrame> look(const Frame& frame, const std::vector<Star>& stars,
                                                FrameFindings& findings) {
    if (!solver_) return std::nullopt;
    const int width = frame.pixels.width();
    const int height = frame.pixels.height();
    auto solution = solver_->solve(stars, width, height, {});
    if (!solution) {
      findings.notes.push_back(solver_->why_unsolved(stars, width, height, {}));
      return std::nullopt;
    }
    findings.attitude = solution->attitude;
    auto known = KnownStars::of(*solution, stars, width, height);
    return SolvedFrame{SkyMeasurement(*std::move(solution), stars, frame), std::move(known)};
  }

 private:
  std::optional<FieldSolver> solver_;
};

class StreakSearch final : public Method {
 public:
  explicit StreakSearch(const Parameters& parameters)
      : options_{parameters["threshold"], parameters["min_length"], parameters["caution"]},
        with_stars_(parameters["stars"] != 0),
        with_trails_(parameters["trails"] != 0),
        clean_{parameters["fwhm"]},
        sky_(parameters) {}

  Result<FrameFindings, Refusal> process(const Frame& frame) override {
    FrameFindings findings;
    const CleanFrame clean = clean_frame(frame, findings, clean_);
    StarField field = find_stars(clean, {.stars_max = std::numeric_limits<int>::max(), .close_ones = false});
    const std::vector<Star> all = with_stars_ ? field.stars : std::vector<Star>{};
    findings.streaks = find_streaks(clean, field, options_);
    const auto sky = sky_.look(frame, field.stars, findings);
    if (sky && sky->known) {
      const auto dropped = drop_known_stars(*sky->known, clean, findings.streaks, findings.notes);
      give_back(all, dropped, field.stars);
    }
    if (!with_trails_) drop_star_trails(field.stars.size(), findings);
    if (sky) {
      for (Streak& s : findings.streaks) s.sky = sky->measurement.of(s);
    }
    if (with_stars_) findings.stars = std::move(field.stars);
    return findings;
  }

 private:
  /// Stars that a streak's light was taken for, which is none. @param stars  some of @p all, in its order
  static void give_back(const std::vector<Star>& all, const std::vector<Streak>& dropped,
                        std::vector<Star>& stars) {
    if (all.empty() || dropped.empty()) return;
    std::vector<Star> more;
    auto next = stars.begin();
    for (const Star& s : all) {
      const bool is_kept = next != stars.end() && next->x == s.x && next->y == s.y;
      if (is_kept) ++next;
      const bool is_back = std::any_of(dropped.begin(), dropped.end(), [&](const Streak& streak) {
        return distance_px(streak, s.x, s.y) < streak.width_px;
      });
      if (is_kept || is_back) more.push_back(s);
    }
    stars = std::move(more);
  }

  static void drop_star_trails(std::size_t stars, FrameFindings& findings) {
    const auto trails = find_star_trails(findings.streaks, stars);
    if (!trails) return;
    std::vector<Streak> others;
    for (std::size_t i = 0; i < findings.streaks.size(); ++i) {
      if (!trails->is_trail[i]) others.push_back(findings.streaks[i]);
    }
    findings.notes.push_back(
        fmt::format("{} streaks of {:.0f} px at {:.0f} degrees are star trails: the camera turned",
                    findings.streaks.size() - others.size(), trails->length_px, trails->angle_deg));
    findings.streaks = std::move(others);
  }

  StreakOptions options_;
  bool with_stars_;
  bool with_trails_;
  CleanOptions clean_;
  SkySearch sky_;
};

constexpr std::array streak_parameters{
    ParameterSpec{"threshold", 7, 3, 1000, "least SNR of a whole streak"},
    ParameterSpec{"min_length", 10, 3, 10000, "px"},
    ParameterSpec{"caution", 8, -100, 1000, "chi-squared margin by which a short streak must beat stars"},
    ParameterSpec{"stars", 0, 0, 1, "1: also the stars"},
    ParameterSpec{"trails", 0, 0, 1, "1: also star trails, drawn when the camera turns"},
    on_the_sky,
    fwhm,
    calibrated,
};

/// Moving objects in several frames.
class TrackletSearch final : public Method {
 public:
  explicit TrackletSearch(const Parameters& parameters)
      : streaks_{parameters["streak_threshold"], parameters["min_length"], parameters["caution"]},
        links_{static_cast<int>(parameters["hits"]), parameters["threshold"], parameters["max_speed"]},
        with_faint_(parameters["faint"] != 0),
        clean_{parameters["fwhm"]},
        sky_(parameters) {}

  Result<FrameFindings, Refusal> process(const Frame& frame) override {
    if (frames_.size() >= frames_most)
      return Err(Refusal{fmt::format("more than {} frames in a sequence", frames_most)});
    FrameFindings findings;
    const CleanFrame clean = clean_frame(frame, findings, clean_);
    StarField field =
        find_stars(clean, {.snr_least = faint_least, .stars_max = faint_most, .close_ones = false});
    auto sky = sky_.look(frame, field.stars, findings);
    FrameDetections of_frame;
    of_frame.stars = field.stars;
    if (sky && sky->known) {
      for (const Star& s : of_frame.stars) of_frame.is_known_star.push_back(sky->known->explain(s));
    }
    if (with_faint_) keep_faint_light(clean, field, of_frame.is_known_star, findings);
    of_frame.streaks = find_streaks(clean, field, streaks_);
    if (sky && sky->known) drop_known_stars(*sky->known, clean, of_frame.streaks, findings.notes);
    measured_.push_back(sky ? std::optional(std::move(sky->measurement)) : std::nullopt);
    of_frame.width = frame.pixels.width();
    of_frame.height = frame.pixels.height();
    of_frame.fwhm_px = clean.psf.fwhm_px();
    of_frame.time_s = frame.time_s;
    frames_.push_back(std::move(of_frame));
    return findings;
  }

  SequenceFindings finish() override {
    SequenceFindings found = link_tracklets(frames_, links_);
    if (with_faint_) add_faint(found);
    add_sky(found, measured_);
    frames_.clear();
    measured_.clear();
    faint_.clear();
    return found;
  }

 private:
  void keep_faint_light(const CleanFrame& clean, const StarField& field, const std::vector<bool>& known,
                        FrameFindings& findings) {
    std::size_t octets = clean.signal.size();
    for (const FaintLight& of : faint_) octets += of.light.size();
    if (octets > faint_octets_most) {
      findings.notes.push_back(
          fmt::format("faint: left out, more than {} MB of frames", faint_octets_most >> 20));
      faint_.emplace_back();
      return;
    }
    faint_.push_back(faint_light(clean, field, known));
  }

  void add_faint(SequenceFindings& found) const {
    std::vector<double> times;
    for (std::size_t k = 0; k < frames_.size(); ++k)
      times.push_back(found.timed ? frames_[k].time_s.value_or(0) : static_cast<double>(k));
    const double zero = times.empty() ? 0 : times[static_cast<std::size_t>(found.reference)];
    for (double& t : times) t -= zero;
    auto faint = find_faint(faint_, times, found, {links_.snr_least, links_.speed_most});
    found.tracklets.insert(found.tracklets.end(), std::make_move_iterator(faint.begin()),
                           std::make_move_iterator(faint.end()));
    std::stable_sort(found.tracklets.begin(), found.tracklets.end(),
                     [](const Tracklet& a, const Tracklet& b) { return a.snr > b.snr; });
  }

  static constexpr std::size_t frames_most = 200;
  /// One frame's detections may be this faint: chance does not move evenly.
  static constexpr double faint_least = 3.5;
  static constexpr int faint_most = 50000;
  static constexpr std::size_t faint_octets_most = std::size_t{128} << 20;

  StreakOptions streaks_;
  LinkOptions links_;
  bool with_faint_;
  CleanOptions clean_;
  SkySearch sky_;
  std::vector<FrameDetections> frames_;
  std::vector<FaintLight> faint_;  ///< of each frame; empty where it takes too much memory
  std::vector<std::optional<SkyMeasurement>> measured_;  ///< of each frame
};

constexpr std::array tracklet_parameters{
    ParameterSpec{"threshold", 8.5, 4, 1000, "least combined SNR of all points"},
    ParameterSpec{
        "hits", 5, 3, 200,
        "least number of points in eight or more frames; in fewer, five eighths of them, at least 3"},
    ParameterSpec{"max_speed", 40, 0.1, 10000,
                  "px per frame; four times as much for objects seen as streaks"},
    ParameterSpec{"streak_threshold", 7, 3, 1000, "least SNR of a streak in one frame"},
    ParameterSpec{"min_length", 10, 3, 10000, "least length of a streak, px"},
    ParameterSpec{"caution", -100, -1000, 1000,
                  "chi-squared margin by which a streak must beat stars in one frame"},
    ParameterSpec{"faint", 0, 0, 1, "1: also objects too faint for one frame, by all frames together"},
    on_the_sky,
    fwhm,
    calibrated,
};

/// The attitude from the stars.
class PlateSolving final : public Method {
 public:
  explicit PlateSolving(const Parameters& parameters)
      : options_{parameters["min_field"], parameters["max_field"]},
        with_stars_(parameters["stars"] != 0),
        clean_{parameters["fwhm"]} {}

  Result<FrameFindings, Refusal> process(const Frame& frame) override {
    FrameFindings findings;
    const CleanFrame clean = clean_frame(frame, findings, clean_);
    findings.stars = find_stars(clean, {}).stars;
    const auto solution =
        solver_.solve(findings.stars, frame.pixels.width(), frame.pixels.height(), options_);
    if (solution)
      findings.attitude = solution->attitude;
    else
      findings.notes.push_back(
          solver_.why_unsolved(findings.stars, frame.pixels.width(), frame.pixels.height(), options_));
    if (!with_stars_) findings.stars.clear();
    return findings;
  }

 private:
  PlateOptions options_;
  bool with_stars_;
  CleanOptions clean_;
  FieldSolver solver_;
};

constexpr std::array plate_parameters{
    ParameterSpec{"min_field", field_least_deg, field_least_deg, field_most_deg,
                  "least width of the field of view, degrees"},
    ParameterSpec{"max_field", field_most_deg, field_least_deg, field_most_deg,
                  "largest width of the field of view, degrees"},
    ParameterSpec{"stars", 0, 0, 1, "1: also the stars"},
    fwhm,
    calibrated,
};

/// Pixels of the detector that are not as the others, from several frames.
class DefectMap final : public Method {
 public:
  explicit DefectMap(const Parameters& parameters)
      : share_(parameters["share"]),
        most_(static_cast<std::size_t>(parameters["max_defects"])),
        clean_{parameters["fwhm"]} {}

  Result<FrameFindings, Refusal> process(const Frame& frame) override {
    if (count_ && (count_->width() != frame.pixels.width() || count_->height() != frame.pixels.height()))
      return Err(Refusal{fmt::format("{} x {} px after frames of {} x {}", frame.pixels.width(),
                                     frame.pixels.height(), count_->width(), count_->height())});
    if (count_ && count_->frames() >= frames_most)
      return Err(Refusal{fmt::format("more than {} frames in a sequence", frames_most)});
    FrameFindings findings;
    const CleanFrame clean = clean_frame(frame, findings, clean_);
    if (!count_) count_.emplace(frame.pixels.width(), frame.pixels.height());
    count_->add(frame, clean);
    return findings;
  }

  SequenceFindings finish() override {
    SequenceFindings found;
    if (count_) found.defects = count_->defects(share_, most_);
    if (count_ && count_->frames() < frames_least)
      found.notes.push_back(
          fmt::format("with fewer than {} frames particles look like defects", frames_least));
    count_.reset();
    return found;
  }

 private:
  static constexpr int frames_most = 1000;
  static constexpr int frames_least = 3;
  double share_;
  std::size_t most_;
  CleanOptions clean_;
  std::optional<DefectCount> count_;
};

constexpr std::array defect_parameters{
    ParameterSpec{"share", 0.6, 0.05, 1, "share of the frames that must show a defect"},
    ParameterSpec{"max_defects", 10000, 1, 1000000, "most defects to keep, strongest first"},
    fwhm,
};

/// A master frame of the detector.
class MasterMaking final : public Method {
 public:
  explicit MasterMaking(const Parameters& parameters) : maker_(kind_of(parameters)) {}

  static MasterKind kind_of(const Parameters& parameters) {
    return parameters["kind"] == 0 ? MasterKind::dark : MasterKind::flat;
  }

  Result<FrameFindings, Refusal> process(const Frame& frame) override {
    if (auto added = maker_.add(frame); !added) return Err(added.error());
    return FrameFindings{};
  }

  SequenceFindings finish() override {
    SequenceFindings found;
    auto made = maker_.finish();
    if (made) {
      found.master = std::move(made->master);
      found.defects = std::move(made->defects);
    } else {
      found.notes.push_back(made.error().reason);
    }
    return found;
  }

 private:
  MasterMaker maker_;
};

constexpr std::array master_parameters{
    ParameterSpec{"kind", 0, 0, 1,
                  "0: a dark, of frames without light; 1: a flat, of frames lit evenly that a dark fits"},
};

class Thumbnail final : public Method {
 public:
  explicit Thumbnail(const Parameters& parameters) : width_(static_cast<int>(parameters["width"])) {}

  Result<FrameFindings, Refusal> process(const Frame& frame) override {
    FrameFindings findings;
    findings.cutout = Cutout{0, 0, thumbnail(frame.pixels, width_)};
    return findings;
  }

 private:
  int width_;
};

constexpr std::array thumbnail_parameters{
    ParameterSpec{"width", 320, 1, 4096, "px; at most the frame's"},
};

class RegionOfInterest final : public Method {
 public:
  explicit RegionOfInterest(const Parameters& parameters)
      : wanted_{static_cast<int>(parameters["x"]), static_cast<int>(parameters["y"]),
                static_cast<int>(parameters["width"]), static_cast<int>(parameters["height"])} {}

  Result<FrameFindings, Refusal> process(const Frame& frame) override {
    const auto part = within(wanted_, frame.pixels.width(), frame.pixels.height());
    if (!part)
      return Err(Refusal{fmt::format("the region begins at ({}, {}), the frame has {} x {} px", wanted_.x,
                                     wanted_.y, frame.pixels.width(), frame.pixels.height())});
    FrameFindings findings;
    if (part->width < wanted_.width || part->height < wanted_.height)
      findings.notes.push_back(
          fmt::format("only {} x {} px of the region are in the frame", part->width, part->height));
    findings.cutout = Cutout{part->x, part->y, cut_out(frame.pixels, *part)};
    return findings;
  }

 private:
  Rectangle wanted_;
};

constexpr std::array roi_parameters{
    ParameterSpec{"x", 0, 0, 1e6, "first column"},
    ParameterSpec{"y", 0, 0, 1e6, "first row"},
    ParameterSpec{"width", 128, 1, 1e6, "px"},
    ParameterSpec{"height", 128, 1, 1e6, "px"},
};

template <class M>
std::unique_ptr<Method> make(const Parameters& parameters) {
  return std::make_unique<M>(parameters);
}

/// What searches a frame.
MastersUsed both(const Parameters& parameters) {
  const bool is_wanted = parameters["calibrated"] != 0;
  return {is_wanted, is_wanted, false};
}

/// A flat is made of frames without their dark.
MastersUsed dark_of_flats(const Parameters& parameters) {
  const bool is_flat = MasterMaking::kind_of(parameters) == MasterKind::flat;
  return {is_flat, false, is_flat};
}

constexpr std::array entries{
    MethodEntry{"star_centroid", "stars: position, flux, SNR and width", star_centroid_parameters,
                make<StarCentroid>, both},
    MethodEntry{"streak", "streaks of moving objects: ends, SNR, flux and width", streak_parameters,
                make<StreakSearch>, both},
    MethodEntry{"tracklet", "objects that move over several frames: points, velocity, SNR",
                tracklet_parameters, make<TrackletSearch>, both},
    MethodEntry{"plate_solve", "attitude, field of view and distortion from the stars, or none",
                plate_parameters, make<PlateSolving>, both},
    MethodEntry{"defect_map", "hot and dark pixels of the detector, from several frames", defect_parameters,
                make<DefectMap>},
    MethodEntry{"calibrate", "a dark or flat of the detector, from several frames, with its defects",
                master_parameters, make<MasterMaking>, dark_of_flats},
    MethodEntry{"roi", "a section of the frame, unchanged", roi_parameters, make<RegionOfInterest>},
    MethodEntry{"thumbnail", "the frame scaled down, for viewing", thumbnail_parameters, make<Thumbnail>},
};

template <class Range>
std::string names_of(const Range& range) {
  std::vector<std::string_view> names;
  for (const auto& entry : range) names.push_back(entry.name);
  return fmt::format("{}", fmt::join(names, ", "));
}

}  // namespace

Result<Parameters, Refusal> Parameters::parse(std::span<const ParameterSpec> specs,
                                              std::span<const std::string> given) {
  Parameters parameters;
  for (const std::string& text : given) {
    const auto equals = text.find('=');
    const std::string_view name = std::string_view(text).substr(0, equals);
    const ParameterSpec* spec = nullptr;
    for (const ParameterSpec& s : specs) {
      if (s.name == name) spec = &s;
    }
    if (spec == nullptr)
      return Err(Refusal{fmt::format("no parameter '{}'; available: {}", name, names_of(specs))});
    if (equals == std::string::npos)
      return Err(Refusal{fmt::format("parameter '{}' has no value: expected {}=NUMBER", name, name)});
    const std::string_view number = std::string_view(text).substr(equals + 1);
    const double value = to_number<double>(number).value_or(NAN);
    if (!std::isfinite(value))
      return Err(Refusal{fmt::format("parameter '{}': '{}' is not a number", name, number)});
    if (value < spec->least || value > spec->most)
      return Err(Refusal{
          fmt::format("parameter '{}': {} is not within {} to {}", name, value, spec->least, spec->most)});
    if (!parameters.values_.emplace(name, value).second)
      return Err(Refusal{fmt::format("parameter '{}' is given twice", name)});
  }
  for (const ParameterSpec& spec : specs) parameters.values_.emplace(spec.name, spec.standard);
  return parameters;
}

double Parameters::operator[](std::string_view name) const {
  return values_.find(name)->second;
}

std::span<const MethodEntry> methods() {
  return entries;
}

Result<const MethodEntry*, Refusal> find_method(std::string_view name) {
  for (const MethodEntry& entry : entries) {
    if (entry.name == name) return &entry;
  }
  return Err(Refusal{fmt::format("no method '{}'; available: {}", name, names_of(entries))});
}

}  // namespace srfs::image
