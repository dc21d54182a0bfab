// srfs-detect: the on-board detection methods on files. Several files are one sequence, in the order given.

#include <time.h>

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
#include <nlohmann/json.hpp>

#include "image/frame_file.hpp"
#include "image/method.hpp"

namespace {

using Json = nlohmann::ordered_json;
using namespace srfs::image;
using srfs::Result;

enum ExitCode { done = 0, file_refused = 1, bad_usage = 2 };

double rounded(double value, double unit) {
  return std::round(value / unit) * unit;
}

Json to_json(const Star& s, int frame) {
  return {{"frame", frame},
          {"x", rounded(s.x, 1e-4)},
          {"y", rounded(s.y, 1e-4)},
          {"flux", rounded(s.flux, 1e-2)},
          {"snr", rounded(s.snr, 1e-3)},
          {"fwhm", rounded(s.fwhm_px, 1e-3)}};
}

Json to_json(const Streak& s, int frame) {
  return {{"frame", frame},
          {"x1", rounded(s.x1, 1e-3)},
          {"y1", rounded(s.y1, 1e-3)},
          {"x2", rounded(s.x2, 1e-3)},
          {"y2", rounded(s.y2, 1e-3)},
          {"snr", rounded(s.snr, 1e-3)},
          {"flux", rounded(s.flux, 1e-2)},
          {"width", rounded(s.width_px, 1e-3)}};
}

Json to_json(const TrackPoint& p) {
  Json point{{"frame", p.frame},
             {"x", rounded(p.x, 1e-3)},
             {"y", rounded(p.y, 1e-3)},
             {"snr", rounded(p.snr, 1e-3)}};
  if (p.streak) {
    point["x1"] = rounded(p.streak->x1, 1e-3), point["y1"] = rounded(p.streak->y1, 1e-3);
    point["x2"] = rounded(p.streak->x2, 1e-3), point["y2"] = rounded(p.streak->y2, 1e-3);
  }
  return point;
}

Json to_json(const Tracklet& t) {
  Json points = Json::array();
  for (const TrackPoint& p : t.points) points.push_back(to_json(p));
  return {{"x", rounded(t.x0, 1e-3)},   {"y", rounded(t.y0, 1e-3)},    {"vx", rounded(t.vx, 1e-5)},
          {"vy", rounded(t.vy, 1e-5)},  {"snr", rounded(t.snr, 1e-3)}, {"rms", rounded(t.rms_px, 1e-4)},
          {"points", std::move(points)}};
}

/// Of pixel (x, y): X = dx + a x - b y, Y = dy + b x + a y in the reference frame.
Json to_json(const FrameRegistration& r) {
  if (!r.registered) return nullptr;
  const FrameTransform& t = r.registration.to_reference;
  return {{"dx", rounded(t.shift_x, 1e-4)},
          {"dy", rounded(t.shift_y, 1e-4)},
          {"a", t.a},
          {"b", t.b},
          {"stars", r.registration.stars},
          {"rms", rounded(r.registration.rms_px, 1e-4)}};
}

Json to_json(const std::optional<Attitude>& a) {
  if (!a) return nullptr;
  return {{"ra_deg", rounded(a->ra_deg, 1e-6)},
          {"dec_deg", rounded(a->dec_deg, 1e-6)},
          {"roll_deg", rounded(a->roll_deg, 1e-5)},
          {"scale_arcsec_px", rounded(a->scale_arcsec_px, 1e-5)},
          {"mirrored", a->mirrored},
          {"stars", a->stars},
          {"rms_arcsec", rounded(a->rms_arcsec, 1e-3)}};
}

Json to_json(const Defect& d) {
  return {{"x", d.x},
          {"y", d.y},
          {"kind", d.kind == Defect::Kind::hot ? "hot" : "dark"},
          {"level", rounded(d.level_adu, 1e-2)},
          {"frames", d.frames}};
}

/// Writes what a frame's product shows: NAME_thumbnail.png, or NAME_roi.fits.
Result<Json, Refusal> written(const Cutout& cutout, const std::string& source, const std::string& method,
                              const std::string& folder) {
  const auto size = [](const auto& pixels) { return std::pair(pixels.width(), pixels.height()); };
  const auto [width, height] = std::visit(size, cutout.pixels);
  Json json{{"x", cutout.x}, {"y", cutout.y}, {"width", width}, {"height", height}, {"file", nullptr}};
  if (folder.empty()) return json;
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
  Json solution = nullptr;  ///< of the first frame that has one
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
  report.frames.push_back({{"file", path},
                           {"width", frame.pixels.width()},
                           {"height", frame.pixels.height()},
                           {"background", rounded(found.background, 1e-3)},
                           {"noise", rounded(found.noise, 1e-3)},
                           {"fwhm", rounded(found.fwhm_px, 1e-3)},
                           {"stars", found.stars.size()},
                           {"streaks", found.streaks.size()},
                           {"spikes", found.spikes},
                           {"saturated", found.saturated},
                           {"invalid", found.invalid},
                           {"notes", found.notes},
                           {"solution", to_json(found.attitude)},
                           {"elapsed_ms", rounded(elapsed.wall_ms, 1e-2)},
                           {"cpu_ms", rounded(elapsed.cpu_ms, 1e-2)}});
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

void print_text(const Report& report) {
  for (std::size_t i = 0; i < report.frames.size(); ++i) {
    const Json& f = report.frames[i];
    fmt::print("{}: {} x {}, {} stars, {} streaks, sky {:.1f} +- {:.2f}, {:.0f} ms\n",
               f["file"].get<std::string>(), f["width"].get<int>(), f["height"].get<int>(),
               f["stars"].get<int>(), f["streaks"].get<int>(), f["background"].get<double>(),
               f["noise"].get<double>(), f["elapsed_ms"].get<double>());
    for (const Json& note : f["notes"]) fmt::print("  note: {}\n", note.get<std::string>());
    if (f.contains("cutout") && !f["cutout"]["file"].is_null())
      fmt::print("  {}\n", f["cutout"]["file"].get<std::string>());
    if (const Json& a = f["solution"]; !a.is_null())
      fmt::print("  attitude: RA {:.4f}, Dec {:+.4f}, roll {:.3f} degrees, {:.3f} arcsec/px{}, {} stars\n",
                 a["ra_deg"].get<double>(), a["dec_deg"].get<double>(), a["roll_deg"].get<double>(),
                 a["scale_arcsec_px"].get<double>(), a["mirrored"].get<bool>() ? ", mirrored" : "",
                 a["stars"].get<int>());
    for (const Json& s : report.streaks) {
      if (s["frame"] == i)
        fmt::print("  streak ({:.2f}, {:.2f}) - ({:.2f}, {:.2f})  snr {:.1f}\n", s["x1"].get<double>(),
                   s["y1"].get<double>(), s["x2"].get<double>(), s["y2"].get<double>(),
                   s["snr"].get<double>());
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
      fmt::print("  frame {}: ({:.2f}, {:.2f})  snr {:.1f}\n", p["frame"].get<int>(), p["x"].get<double>(),
                 p["y"].get<double>(), p["snr"].get<double>());
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

int run(const std::string& name, const std::vector<std::string>& given, const std::vector<std::string>& files,
        const std::string& folder, bool as_json) {
  const auto refuse = [](const Refusal& why, ExitCode code) {
    std::fprintf(stderr, "srfs-detect: %s\n", why.reason.c_str());
    return code;
  };
  const auto entry = find_method(name);
  if (!entry) return refuse(entry.error(), bad_usage);
  const auto parameters = Parameters::parse((*entry)->parameters, given);
  if (!parameters) return refuse(parameters.error(), bad_usage);
  const auto method = (*entry)->make(*parameters);
  Report report;
  for (const std::string& file : files) {
    const auto frame = read_frame(file);
    if (!frame) return refuse(frame.error(), file_refused);
    const auto begin = std::chrono::steady_clock::now();
    const double cpu_before_ms = cpu_ms();
    const auto found = method->process(*frame);
    if (!found) return refuse(Refusal{file + ": " + found.error().reason}, file_refused);
    add(report, file, *frame, *found,
        {std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count(),
         cpu_ms() - cpu_before_ms});
    if (!found->cutout) continue;
    auto cutout = written(*found->cutout, file, name, folder);
    if (!cutout) return refuse(cutout.error(), file_refused);
    report.frames.back()["cutout"] = *std::move(cutout);
  }
  add(report, method->finish());
  if (as_json) {
    const Json all{{"method", name},
                   {"frames", report.frames},
                   {"stars", report.stars},
                   {"streaks", report.streaks},
                   {"tracklets", report.tracklets},
                   {"defects", report.defects},
                   {"solution", report.solution}};
    std::printf("%s\n", all.dump().c_str());
  } else {
    print_text(report);
    print_tracklets(report);
    for (const Json& d : report.defects)
      fmt::print("{} pixel ({}, {})  {:+.1f} ADU in {} frames\n", d["kind"].get<std::string>(),
                 d["x"].get<int>(), d["y"].get<int>(), d["level"].get<double>(), d["frames"].get<int>());
  }
  return done;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Finds stars and debris in frames (FITS, TIFF, PNG, JPEG) as the spacecraft does. Pixel (0, 0) is the "
      "centre of the first pixel."};
  std::string method;
  std::vector<std::string> parameters;
  std::vector<std::string> files;
  std::string folder;
  bool json = false;
  app.add_option("--method", method, "What to look for; see below")->required();
  app.add_option("--params", parameters, "name=value of the method, may be given several times")
      ->allow_extra_args(false);
  app.add_option("--out", folder, "Where pictures and cut-outs are written (thumbnail, roi)")
      ->check(CLI::ExistingDirectory);
  app.add_flag("--json", json, "One JSON object");
  app.add_option("FILE", files, "Several are one sequence, in this order")->required();
  app.footer(list_of_methods());
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? done : bad_usage;
  }
  try {
    return run(method, parameters, files, folder, json);
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "srfs-detect: not enough memory for this frame\n");
    return file_refused;
  }
}
