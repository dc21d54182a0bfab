// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/api/web_files.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <queue>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/fd.hpp"
#include "base/file.hpp"
#include "base/text.hpp"
#include "base/time.hpp"
#include "image/file/fits.hpp"
#include "image/picture.hpp"
#include "image/product/frame_strips.hpp"
#include "image/product/png.hpp"
#include "image/product/star_list.hpp"

namespace srfs::ground::api {
namespace {

constexpr std::size_t page_octets_max = 16U << 20;
constexpr std::size_t file_octets_max = 64U << 20;
constexpr int picture_width_most = 2048;
constexpr std::string_view png_mark = "\x89PNG";
constexpr std::string_view jpeg_mark = "\xFF\xD8\xFF";
constexpr std::string_view fits_mark = "SIMPLE  =";

struct Kind {
  std::string_view ending;
  std::string_view media;
};
constexpr std::array page_kinds{Kind{".html", "text/html; charset=utf-8"},
                                Kind{".js", "text/javascript; charset=utf-8"},
                                Kind{".mjs", "text/javascript; charset=utf-8"},
                                Kind{".css", "text/css; charset=utf-8"},
                                Kind{".json", "application/json"},
                                Kind{".yaml", "application/yaml"},
                                Kind{".svg", "image/svg+xml"},
                                Kind{".png", "image/png"},
                                Kind{".ico", "image/x-icon"},
                                Kind{".woff2", "font/woff2"},
                                Kind{".txt", "text/plain; charset=utf-8"}};

std::string media_of(const std::string& name) {
  for (const Kind& kind : page_kinds) {
    if (name.ends_with(kind.ending)) return std::string(kind.media);
  }
  return "application/octet-stream";
}

/// A regular file below a folder, opened without following a link in its last part. nullopt: there is none.
std::optional<std::string> read_below(const std::filesystem::path& path, std::size_t octets_max) {
  const Fd file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
  struct stat status {};
  if (!file || ::fstat(file.get(), &status) != 0 || !S_ISREG(status.st_mode)) return std::nullopt;
  auto content = read_open_file(file.get(), path, octets_max);
  if (!content) return std::nullopt;
  return std::move(*content);
}

OctetView octets_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

std::string type_of(const std::string& name, const std::string& content) {
  if (content.starts_with("SRFSTARS")) return "stars";
  if (name.ends_with(".strips")) return "strips";
  for (const std::string_view mark : {png_mark, jpeg_mark, fits_mark}) {
    if (content.starts_with(mark)) return "picture";
  }
  if (name.ends_with(".json")) return "findings";
  if (name.ends_with(".txt") || name.ends_with(".csv") || name.ends_with(".log") || name.ends_with(".yaml"))
    return "text";
  return "octets";
}

/// The beginning tells the type.
std::string type_of_file(const std::filesystem::path& path) {
  const Fd file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
  std::string head(4096, '\0');
  const ssize_t got = file ? ::read(file.get(), head.data(), head.size()) : 0;
  head.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
  return type_of(path.filename().string(), head);
}

HttpResponse png_of(const image::Plane& pixels) {
  const auto png = image::encode_png(image::thumbnail(pixels, picture_width_most));
  if (!png) return error_response(500, png.error().reason);
  return {.status = 200, .type = "image/png", .body = {png->begin(), png->end()}};
}

/// What a browser shows: PNG and JPEG as they are; FITS and strips as PNG.
HttpResponse as_picture(const std::string& name, const std::string& content) {
  if (content.starts_with(png_mark)) return {.status = 200, .type = "image/png", .body = content};
  if (content.starts_with(jpeg_mark)) return {.status = 200, .type = "image/jpeg", .body = content};
  const OctetView octets = octets_of(content);
  if (content.starts_with(fits_mark)) {
    const auto frame = image::decode_fits(octets);
    return frame ? png_of(frame->pixels) : error_response(409, name + ": " + frame.error().reason);
  }
  const auto strips = image::decode_strips(octets);
  if (!strips) return error_response(409, name + ": no picture that is shown here: " + strips.error().reason);
  return png_of(strips->frame.pixels);
}

HttpResponse as_json(const std::string& name, const std::string& content) {
  const OctetView octets = octets_of(content);
  if (const auto stars = image::decode_star_list(octets)) {
    nlohmann::json json{{"type", "stars"}, {"stars", nlohmann::json::array()}};
    for (const auto& star : *stars)
      json["stars"].push_back(
          {{"frame", star.frame}, {"x", star.x}, {"y", star.y}, {"flux_adu", star.flux}, {"snr", star.snr}});
    return json_response(200, json);
  }
  if (const auto strips = image::decode_strips(octets)) {
    nlohmann::json json{{"type", "strips"},
                        {"width", strips->frame.pixels.width()},
                        {"height", strips->frame.pixels.height()},
                        {"strips", strips->strips},
                        {"rows", strips->rows},
                        {"missing", strips->missing},
                        {"exposed", nullptr}};
    if (const auto begin = image::utc_of(strips->frame.time_s)) json["exposed"] = to_iso8601(*begin);
    return json_response(200, json);
  }
  // Checked without building it: a spacecraft's file may be nested as deeply as it is long.
  if (!nlohmann::json::accept(content))
    return error_response(409, name + ": no product whose content is known");
  return {.status = 200, .body = content};
}

}  // namespace

HttpResponse page_file(const std::filesystem::path& root, const Target& target) {
  if (root.empty()) return error_response(404, "no page is installed here; the API is at /api/v1");
  std::filesystem::path path = root;
  for (const std::string& segment : target.segments) {
    if (segment.starts_with('.')) return error_response(404, "no such file");
    path /= segment;
  }
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) path /= "index.html";
  const auto real = std::filesystem::canonical(path, error);
  if (error) return error_response(404, "no such file");
  const auto below = std::filesystem::canonical(root, error);
  const bool inside =
      std::mismatch(below.begin(), below.end(), real.begin(), real.end()).first == below.end();
  auto content = inside ? read_below(real, page_octets_max) : std::nullopt;
  if (!content) return error_response(404, "no such file");
  return {.status = 200,
          .type = media_of(real.filename().string()),
          .body = std::move(*content),
          .headers = {{"Cache-Control", "no-cache"}}};
}

nlohmann::json list_files(const std::filesystem::path& folder, std::size_t most) {
  struct Received {
    UtcTime time;
    std::string name;
    off_t octets = 0;
    bool operator<(const Received& other) const { return time > other.time; }  // the oldest is on top
  };
  std::priority_queue<Received> newest;
  nlohmann::json list = nlohmann::json::array();
  std::error_code error;
  for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    struct stat status {};
    if (::lstat(entry->path().c_str(), &status) != 0 || !S_ISREG(status.st_mode)) continue;
    const auto time = UtcTime(seconds(status.st_mtim.tv_sec) + nanoseconds(status.st_mtim.tv_nsec));
    newest.push({time, entry->path().filename().string(), status.st_size});
    if (newest.size() > most) newest.pop();
  }
  for (; !newest.empty(); newest.pop()) {
    const Received& file = newest.top();
    list.push_back({{"name", file.name},
                    {"octets", file.octets},
                    {"time", to_iso8601(file.time)},
                    {"type", type_of_file(folder / file.name)}});
  }
  std::reverse(list.begin(), list.end());
  return list;
}

HttpResponse received_file(const std::filesystem::path& folder, const std::string& name,
                           const std::string& view) {
  if (name.starts_with('.') || name.find('/') != std::string::npos)
    return error_response(404, "no such file");
  auto content = read_below(folder / name, file_octets_max);
  if (!content) return error_response(404, "no file of this name was received, or it is longer than 64 MiB");
  if (view == "png") return as_picture(name, *content);
  if (view == "json") return as_json(name, *content);
  if (!view.empty()) return error_response(400, "'view': expected png or json");
  // What the spacecraft sends is never a page of this site.
  return {.status = 200,
          .type = "application/octet-stream",
          .body = std::move(*content),
          .headers = {{"Content-Disposition", "attachment"}}};
}

std::filesystem::path default_web_root() {
  std::error_code error;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", error);
  const auto prefix = program.parent_path().parent_path();
  for (const auto& folder : {prefix / "share/srfs/web", prefix / "web"}) {
    if (std::filesystem::exists(folder / "index.html", error)) return folder;
  }
  return {};
}

}  // namespace srfs::ground::api
