// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// srfs-detect: the on-board detection methods on files. Several files are one sequence, in the order given.

#include <time.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <new>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "base/file.hpp"
#include "base/time.hpp"
#include "base/version.hpp"
#include "image/file/calibrator.hpp"
#include "image/file/frame_file.hpp"
#include "image/method.hpp"
#include "image/photograph/drawing.hpp"
#include "image/photograph/photograph.hpp"
#include "image/product/findings_json.hpp"
#include "image/product/tracking_message.hpp"

namespace {

using namespace srfs::image;
using srfs::Result;

enum ExitCode { done = 0, file_refused = 1, bad_usage = 2 };

double rounded(double value, double unit) {
  return std::round(value / unit) * unit;
}

/// Writes what a frame's product shows: NAME_thumbnail.png, or NAME_roi.fits.
Result<Json, Refusal> written(const Cutout& cutout, const std::string& source, const std::string& method,
                              const std::string& folder) {
  const auto size = [](const auto& pixels) { return std::pair(pixels.width(), pixels.height()); };
  const auto [width, height] = std::visit(size, cutout.pixels);
  Json json{{"x", cutout.x}, {"y", cutout.y}, {"width", width}, {"height", height}};
  const auto* const grey = std::get_if<srfs::image::Grid<std::uint8_t>>(&cutout.pixels);
  const std::filesystem::path path =
      std::filesystem::path(folder) / fmt::format("{}_{}.{}", std::filesystem::path(source).stem().string(),
                                                  method, grey != nullptr ? "png" : "fits");
  const auto done =
      grey != nullptr ? write_png(path, *grey) : write_fits(path, std::get<Plane>(cutout.pixels));
  if (!done) return srfs::Err(done.error());
  json["file"] = path.string();
  return json;
}

/// What was found so far, in the order of the files.
struct Report {
  Json frames = Json::array();
  Json stars = Json::array();
  Json streaks = Json::array();
  Json tracklets = Json::array();
  Json defects = Json::array();
  Json solution = nullptr;           ///< of the first frame that has one
  Json calibration = Json::array();  ///< what the frames were freed of before
  Json master = nullptr;             ///< that was made
};

struct Elapsed {
  double wall_ms;
  double cpu_ms;  ///< of this thread
};

double cpu_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

void add(Report& report, const std::string& path, const Frame& frame, const FrameFindings& found,
         const Elapsed& elapsed) {
  const int number = static_cast<int>(report.frames.size());
  for (const Star& s : found.stars) report.stars.push_back(to_json(s, number));
  for (const Streak& s : found.streaks) report.streaks.push_back(to_json(s, number));
  if (report.solution.is_null()) report.solution = to_json(found.attitude);
  report.frames.push_back(frame_summary(path, frame, found));
  report.frames.back()["elapsed_ms"] = rounded(elapsed.wall_ms, 1e-2);
  report.frames.back()["cpu_ms"] = rounded(elapsed.cpu_ms, 1e-2);
}

void add(Report& report, const SequenceFindings& found) {
  for (std::size_t k = 0; k < found.streaks.size(); ++k) {
    for (const Streak& s : found.streaks[k]) report.streaks.push_back(to_json(s, static_cast<int>(k)));
    report.frames[k]["streaks"] = found.streaks[k].size();
  }
  for (std::size_t k = 0; k < found.registrations.size(); ++k)
    report.frames[k]["registration"] = to_json(found.registrations[k]);
  for (const Defect& d : found.defects) report.defects.push_back(to_json(d));
  for (const Tracklet& t : found.tracklets) report.tracklets.push_back(to_json(t));
  for (const std::string& note : found.notes)
    report.frames[static_cast<std::size_t>(found.reference)]["notes"].push_back(note);
}

std::string on_sky(const Json& place) {
  return fmt::format("  RA {:.5f}, Dec {:+.5f}", place["ra_deg"].get<double>(),
                     place["dec_deg"].get<double>());
}

void print_text(const Report& report) {
  for (std::size_t i = 0; i < report.frames.size(); ++i) {
    const Json& f = report.frames[i];
    fmt::print("{}: {} x {}, {} stars, {} streaks, sky {:.1f} +- {:.2f}, {:.0f} ms\n",
               f["file"].get<std::string>(), f["width"].get<int>(), f["height"].get<int>(),
               f["stars"].get<int>(), f["streaks"].get<int>(), f["background"].get<double>(),
               f["noise"].get<double>(), f["elapsed_ms"].get<double>());
    for (const Json& note : f["notes"]) fmt::print("  note: {}\n", note.get<std::string>());
    if (f.contains("cutout")) fmt::print("  {}\n", f["cutout"]["file"].get<std::string>());
    if (const Json& a = f["solution"]; !a.is_null())
      fmt::print("  attitude: RA {:.4f}, Dec {:+.4f}, roll {:.3f} degrees, {:.3f} arcsec/px{}, {} stars\n",
                 a["ra_deg"].get<double>(), a["dec_deg"].get<double>(), a["roll_deg"].get<double>(),
                 a["scale_arcsec_px"].get<double>(), a["mirrored"].get<bool>() ? ", mirrored" : "",
                 a["stars"].get<int>());
    for (const Json& s : report.streaks) {
      if (s["frame"] == i)
        fmt::print("  streak ({:.2f}, {:.2f}) - ({:.2f}, {:.2f})  snr {:.1f}{}\n", s["x1"].get<double>(),
                   s["y1"].get<double>(), s["x2"].get<double>(), s["y2"].get<double>(),
                   s["snr"].get<double>(), s.contains("sky") ? on_sky(s["sky"]["middle"]) : "");
    }
    for (const Json& s : report.stars) {
      if (s["frame"] == i)
        fmt::print("  star ({:.2f}, {:.2f})  flux {:.0f}  snr {:.1f}  fwhm {:.2f}\n", s["x"].get<double>(),
                   s["y"].get<double>(), s["flux"].get<double>(), s["snr"].get<double>(),
                   s["fwhm"].get<double>());
    }
  }
}

void print_tracklets(const Report& report) {
  for (const Json& t : report.tracklets) {
    fmt::print("tracklet of {} points from ({:.2f}, {:.2f}), moving ({:.3f}, {:.3f}) px, snr {:.1f}\n",
               t["points"].size(), t["x"].get<double>(), t["y"].get<double>(), t["vx"].get<double>(),
               t["vy"].get<double>(), t["snr"].get<double>());
    for (const Json& p : t["points"])
      fmt::print("  frame {}: ({:.2f}, {:.2f})  snr {:.1f}{}\n", p["frame"].get<int>(), p["x"].get<double>(),
                 p["y"].get<double>(), p["snr"].get<double>(), p.contains("sky") ? on_sky(p["sky"]) : "");
  }
}

std::string list_of_methods() {
  std::string text = "Methods and their parameters:\n";
  for (const MethodEntry& m : methods()) {
    text += fmt::format("  {}: {}\n", m.name, m.description);
    for (const ParameterSpec& p : m.parameters)
      text += fmt::format("      {}={}  {} ({} to {})\n", p.name, p.standard, p.description, p.least, p.most);
  }
  return text;
}

/// What is drawn over the sequence's reference frame; points of the others are where they lie in it.
Overlay overlay_of(const std::vector<FrameFindings>& frames, const SequenceFindings& found) {
  Overlay overlay;
  const auto reference = static_cast<std::size_t>(found.reference);
  overlay.stars = frames[reference].stars;
  overlay.streaks = reference < found.streaks.size() ? found.streaks[reference] : frames[reference].streaks;
  for (const Tracklet& t : found.tracklets) {
    auto& track = overlay.tracks.emplace_back();
    for (const TrackPoint& p : t.points) {
      const auto frame = static_cast<std::size_t>(p.frame);
      if (frame >= found.registrations.size() || !found.registrations[frame].registered) continue;
      const FrameTransform::Point there = found.registrations[frame].registration.to_reference(p.x, p.y);
      track.push_back({there.x, there.y});
    }
  }
  return overlay;
}

constexpr int drawing_width_most = 4096;

struct Options {
  std::string method;
  std::vector<std::string> parameters;
  std::vector<std::string> files;
  std::string folder;  ///< for pictures and cut-outs
  std::string drawing;
  int drawing_width = drawing_width_most;
  std::string masters;   ///< folder of dark and flat
  std::string tracking;  ///< file of the tracking data message
  std::string observer = "SRFS";
  bool json = false;
};

/// What a tracking data message is made of: tracklets by their points, streaks of single frames by their
/// middle, where the direction does not matter.
class Tracked {
 public:
  void add(int frame, const std::vector<Streak>& streaks) {
    for (const Streak& s : streaks) {
      if (!s.sky) {
        ++without_angles_;
        continue;
      }
      const auto end = [](const SkyPlace& p) {
        return fmt::format("RA {:.7f}, Dec {:.7f}", p.ra_deg, p.dec_deg);
      };
      objects_.push_back({fmt::format("STREAK_{:03}", objects_.size() + 1),
                          {fmt::format("frame {}, ends (which was first is not known): {}; {}", frame,
                                       end(s.sky->first), end(s.sky->last))},
                          {{s.sky->middle, s.sky->begin_s, s.sky->exposure_s, s.sky->magnitude}}});
    }
  }
  void add(const std::vector<Tracklet>& tracklets) {
    for (const Tracklet& t : tracklets) {
      TrackedObject object{fmt::format("TRACK_{:03}", objects_.size() + 1), {}, {}};
      for (const TrackPoint& p : t.points) {
        if (p.sky)
          object.points.push_back(*p.sky);
        else
          ++without_angles_;
      }
      objects_.push_back(std::move(object));
    }
  }
  [[nodiscard]] srfs::Result<void, Refusal> write(const Options& options) const {
    const std::string text = tracking_message({srfs::system_utc_now(), "SRFS", options.observer}, objects_);
    if (text.empty())
      return srfs::Err(
          Refusal{fmt::format("{} not written: no object with angles and a time ({} without an attitude; the "
                              "frames need DATE-OBS)",
                              options.tracking, without_angles_)});
    if (without_angles_ > 0)
      std::fprintf(stderr, "srfs-detect: %zu streaks or points have no angles: no attitude of their frame\n",
                   without_angles_);
    const auto written = srfs::write_file_atomically(options.tracking, text);
    if (!written) return srfs::Err(Refusal{written.error().message});
    return {};
  }

 private:
  std::vector<TrackedObject> objects_;
  std::size_t without_angles_ = 0;
};

/// The parameters as given, with what the tracking data message needs.
std::vector<std::string> parameters_of(const Options& options) {
  std::vector<std::string> parameters = options.parameters;
  const bool is_given = std::any_of(parameters.begin(), parameters.end(),
                                    [](const std::string& p) { return p.starts_with("sky="); });
  if (!options.tracking.empty() && !is_given) parameters.emplace_back("sky=1");
  return parameters;
}

void print(const Report& report, const Options& options) {
  if (options.json) {
    const Json all{
        {"method", options.method},    {"frames", report.frames},           {"stars", report.stars},
        {"streaks", report.streaks},   {"tracklets", report.tracklets},     {"defects", report.defects},
        {"solution", report.solution}, {"calibration", report.calibration}, {"master", report.master}};
    std::printf("%s\n", all.dump().c_str());
    return;
  }
  print_text(report);
  print_tracklets(report);
  if (!report.master.is_null())
    fmt::print("{} of generation {}\n", report.master["kind"].get<std::string>(),
               report.master["generation"].get<int>());
  for (const Json& d : report.defects)
    fmt::print("{} pixel ({}, {})  {:+.1f} ADU in {} frames\n", d["kind"].get<std::string>(),
               d["x"].get<int>(), d["y"].get<int>(), d["level"].get<double>(), d["frames"].get<int>());
}

void print_problems(const std::vector<std::string>& problems) {
  for (const std::string& problem : problems) std::fprintf(stderr, "srfs-detect: %s\n", problem.c_str());
}

/// @return the master that a sequence made, in its folder
Result<Json, Refusal> stored_master(const SequenceFindings& sequence, const Options& options) {
  if (!sequence.master)
    return srfs::Err(Refusal{sequence.notes.empty() ? "no master" : sequence.notes.front()});
  const auto saved = MasterStore(options.masters).save(*sequence.master);
  if (!saved) return srfs::Err(saved.error());
  print_problems(saved->problems);
  return to_json(saved->master);
}

int run(const Options& options) {
  const auto refuse = [](const Refusal& why, ExitCode code) {
    std::fprintf(stderr, "srfs-detect: %s\n", why.reason.c_str());
    return code;
  };
  const auto entry = find_method(options.method);
  if (!entry) return refuse(entry.error(), bad_usage);
  const auto parameters = Parameters::parse((*entry)->parameters, parameters_of(options));
  if (!options.tracking.empty() && options.method != "streak" && options.method != "tracklet")
    return refuse(Refusal{fmt::format("--tdm needs --method streak or tracklet, not {}", options.method)},
                  bad_usage);
  if (!parameters) return refuse(parameters.error(), bad_usage);
  if (options.method == "calibrate" && options.masters.empty())
    return refuse(Refusal{"--method calibrate makes a master: give its folder with --calibration"},
                  bad_usage);
  if (options.method != "calibrate" && !options.masters.empty() &&
      !std::filesystem::is_directory(options.masters))
    return refuse(Refusal{fmt::format("--calibration {}: there is no such folder", options.masters)},
                  bad_usage);
  const auto method = (*entry)->make(*parameters);
  const MastersUsed wanted = options.masters.empty() ? MastersUsed{} : (*entry)->masters_for(*parameters);
  Calibrator calibrator(MasterStore(options.masters), wanted);
  Report report;
  Tracked tracked;
  std::vector<FrameFindings> drawn;  // where something is to be drawn
  for (const std::string& file : options.files) {
    auto frame = read_frame(file, decode_photograph);
    if (!frame) return refuse(frame.error(), file_refused);
    const auto applied = calibrator.apply(*frame);
    print_problems(calibrator.take_problems());
    if (!applied) return refuse(Refusal{file + ": " + applied.error().reason}, file_refused);
    const auto begin = std::chrono::steady_clock::now();
    const double cpu_before_ms = cpu_ms();
    auto found = method->process(*frame);
    if (!found) return refuse(Refusal{file + ": " + found.error().reason}, file_refused);
    found->notes.insert(found->notes.end(), applied->notes.begin(), applied->notes.end());
    add(report, file, *frame, *found,
        {std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count(),
         cpu_ms() - cpu_before_ms});
    name_masters(*applied, report.frames.back());
    if (found->cutout && options.folder.empty())
      return refuse(
          Refusal{fmt::format("--method {} makes a picture: give its folder with --out", options.method)},
          bad_usage);
    if (found->cutout) {
      auto cutout = written(*found->cutout, file, options.method, options.folder);
      if (!cutout) return refuse(cutout.error(), file_refused);
      report.frames.back()["cutout"] = *std::move(cutout);
      found->cutout.reset();
    }
    tracked.add(static_cast<int>(report.frames.size()) - 1, found->streaks);
    if (!options.drawing.empty()) drawn.push_back(*std::move(found));
  }
  const SequenceFindings sequence = method->finish();
  add(report, sequence);
  for (const StoredMaster& m : calibrator.used()) report.calibration.push_back(to_json(m));
  if (options.method == "calibrate") {
    auto stored = stored_master(sequence, options);
    if (!stored) return refuse(stored.error(), file_refused);
    report.master = *std::move(stored);
  }
  tracked.add(sequence.tracklets);
  print(report, options);
  if (!options.tracking.empty()) {
    if (const auto written = tracked.write(options); !written) return refuse(written.error(), file_refused);
  }
  if (options.drawing.empty()) return done;
  const auto frame =
      read_frame(options.files[static_cast<std::size_t>(sequence.reference)], decode_photograph);
  if (!frame) return refuse(frame.error(), file_refused);
  const auto written =
      write_png(options.drawing, draw(frame->pixels, overlay_of(drawn, sequence), options.drawing_width));
  return written ? done : refuse(written.error(), file_refused);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Finds stars and debris in frames (FITS, TIFF, PNG, JPEG) as the spacecraft does. Pixel (0, 0) is the "
      "centre of the first pixel."};
  Options options;
  app.add_option("--method", options.method, "What to search for; see below")->required();
  app.add_option("--params", options.parameters, "Parameter of the method, name=value; may be repeated")
      ->allow_extra_args(false);
  app.add_option("--out", options.folder, "Folder for pictures and cut-outs; thumbnail and roi need it")
      ->check(CLI::ExistingDirectory);
  app.add_option("--calibration", options.masters,
                 "Folder of darks and flats: --method calibrate writes there, the others use those that fit");
  app.add_option("--draw", options.drawing,
                 "PNG: the first frame (of a sequence its reference frame) with the findings drawn over it");
  app.add_option("--draw-width", options.drawing_width,
                 "Width of the drawing, px; at most the frame's (default: the frame's)")
      ->check(CLI::Range(16, drawing_width_most));
  app.add_option("--tdm", options.tracking,
                 "File for the angles and magnitudes of streaks or tracklets: CCSDS tracking data message; "
                 "implies sky=1");
  app.add_option("--observer", options.observer, "Name of the observing spacecraft or site in it")
      ->capture_default_str();
  app.add_flag("--json", options.json, "Write one JSON object");
  app.add_option("FILE", options.files, "Frames; several are one sequence, in this order")->required();
  app.set_version_flag("--version", srfs::version());
  app.footer(list_of_methods());
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? done : bad_usage;
  }
  try {
    return run(options);
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "srfs-detect: not enough memory for this frame\n");
    return file_refused;
  }
}
