// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_processing/task_order.hpp"

#include <algorithm>

#include <fmt/format.h>
#include <mission/structures.hpp>

namespace srfs {
namespace {

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  return text;
}

std::vector<std::string> split(std::string_view text) {
  std::vector<std::string> parts;
  while (!trimmed(text).empty()) {
    const std::size_t comma = std::min(text.find(','), text.size());
    parts.emplace_back(trimmed(text.substr(0, comma)));
    text.remove_prefix(std::min(comma + 1, text.size()));
  }
  return parts;
}

}  // namespace

Result<TaskOrder, TaskRefusal> check_request(ProcessRequest request) {
  TaskOrder order;
  if (!request.method.empty() || !request.full_frames) {
    const auto method = image::find_method(request.method);
    if (!method) return Err(TaskRefusal{mission::failure::unknown_method, method.error().reason});
    auto parameters = image::Parameters::parse((*method)->parameters, split(request.parameters));
    if (!parameters)
      return Err(TaskRefusal{mission::failure::bad_method_parameter, parameters.error().reason});
    order.method = *method;
    order.parameters = *std::move(parameters);
  }
  if (request.files.empty())
    return Err(TaskRefusal{mission::failure::no_usable_frame, "the goal names no frame"});
  order.request = std::move(request);
  return order;
}

Result<std::filesystem::path, image::Refusal> frame_path(const std::filesystem::path& images,
                                                         const std::string& file) {
  const auto refuse = [](const char* why) { return Err(image::Refusal{why}); };
  const std::filesystem::path name(file);
  if (file.empty() || name.is_absolute()) return refuse("not a name below the image folder");
  if (std::any_of(file.begin(), file.end(), [](unsigned char c) { return c < 0x20 || c == 0x7F; }))
    return refuse("a name with control characters");
  for (const auto& part : name) {
    if (part.empty() || part.native().front() == '.')
      return refuse("a name that leads elsewhere, or is hidden");
  }
  std::error_code failed;
  const auto path = std::filesystem::canonical(images / name, failed);
  if (failed) return Err(image::Refusal{failed.message()});
  const auto root = std::filesystem::canonical(images, failed);
  if (failed) return Err(image::Refusal{failed.message()});
  const auto [end, unused] = std::mismatch(root.begin(), root.end(), path.begin(), path.end());
  if (end != root.end()) return refuse("a link that leads out of the image folder");
  return path;
}

bool looks_for_debris(std::string_view method) {
  return method == "streak" || method == "tracklet";
}

}  // namespace srfs
