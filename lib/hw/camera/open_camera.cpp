// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include "base/text.hpp"
#include "hw/camera/camera_backends.hpp"
#include "hw/open.hpp"

namespace srfs::hw {
namespace {

std::optional<double> number_within(const std::string& text, double lowest, double highest) {
  const auto value = to_number<double>(text);
  return value && *value >= lowest && *value <= highest ? value : std::nullopt;
}

/// @return whether it is an option with a good value
bool take_option(V4l2Options& options, const std::string& key, const std::string& text,
                 const std::filesystem::path& var_dir) {
  if (key == "format") return (options.format = find_pixel_format(std::string_view(text))) != nullptr;
  if (key == "controls") {
    options.controls = below_var(text, var_dir);
    return !text.empty();
  }
  if (key == "width" || key == "height") {
    const auto pixels = number_within(text, 16, 16384);
    (key == "width" ? options.width : options.height) = static_cast<std::uint32_t>(pixels.value_or(0));
    return pixels.has_value();
  }
  if (key == "exposure_us") {
    const auto exposure = number_within(text, 1, 60'000'000);
    options.fixed_exposure = microseconds(static_cast<std::int64_t>(exposure.value_or(0)));
    return exposure.has_value();
  }
  if (key != "line_us" && key != "gain_step_db") return false;
  const auto value = number_within(text, 0.001, 10'000);
  (key == "line_us" ? options.line_us : options.gain_step_db) = value.value_or(0);
  return value.has_value();
}

Result<V4l2Options, HwError> v4l2_options(std::string_view uri, const DeviceUri& parsed,
                                          const std::filesystem::path& var_dir) {
  V4l2Options options;
  for (const auto& [key, text] : parsed.query) {
    if (!take_option(options, key, text, var_dir))
      return Err(HwError{fmt::format(
          "device '{}': '{}={}', expected width, height (16-16384), format (Y16, SRGGB12P...), line_us, "
          "gain_step_db (0.001-10000), exposure_us (1-60000000) or controls (a device)",
          uri, key, text)});
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
    const auto options = v4l2_options(uri, *parsed, var_dir);
    if (!options) return Err(options.error());
    return make_v4l2_camera(path, *options);
  }
  if (!parsed->query.empty())
    return Err(HwError{fmt::format("device '{}': {}: has no options", uri, parsed->scheme)});
  return parsed->scheme == "sim" ? make_sim_camera(path) : make_folder_camera(path);
}

}  // namespace srfs::hw
