#include <charconv>

#include <fmt/format.h>

#include "hw/camera/camera_backends.hpp"
#include "hw/open.hpp"

namespace srfs::hw {
namespace {

std::optional<double> to_number(const std::string& text, double lowest, double highest) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  if (!(value >= lowest && value <= highest)) return std::nullopt;
  return value;
}

Result<V4l2Options, HwError> v4l2_options(std::string_view uri, const DeviceUri& parsed) {
  V4l2Options options;
  for (const auto& [key, text] : parsed.query) {
    const bool pixels = key == "width" || key == "height";
    const auto value = to_number(text, pixels ? 16 : 0.001, pixels ? 16384 : 10'000);
    if (value && key == "width") {
      options.width = static_cast<std::uint32_t>(*value);
    } else if (value && key == "height") {
      options.height = static_cast<std::uint32_t>(*value);
    } else if (value && key == "line_us") {
      options.line_us = *value;
    } else if (value && key == "gain_step_db") {
      options.gain_step_db = *value;
    } else {
      return Err(
          HwError{fmt::format("device '{}': '{}={}', expected width, height (16-16384), line_us or "
                              "gain_step_db (0.001-10000)",
                              uri, key, text)});
    }
  }
  return options;
}

}  // namespace

Result<std::unique_ptr<Camera>, HwError> open_camera(std::string_view uri,
                                                     const std::filesystem::path& var_dir) {
  const auto parsed = parse_device_uri(uri, {"v4l2", "sim", "dir"});
  if (!parsed) return Err(parsed.error());
  const auto path = below_var(parsed->rest, var_dir);
  if (parsed->scheme == "v4l2") {
    const auto options = v4l2_options(uri, *parsed);
    if (!options) return Err(options.error());
    return make_v4l2_camera(path, *options);
  }
  if (!parsed->query.empty())
    return Err(HwError{fmt::format("device '{}': {}: has no options", uri, parsed->scheme)});
  return parsed->scheme == "sim" ? make_sim_camera(path) : make_folder_camera(path);
}

}  // namespace srfs::hw
