// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/file/frame_mark.hpp"

#include <algorithm>
#include <cstdlib>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "base/text.hpp"

namespace srfs::image {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t mark_octets_max = 4096;

struct Detection {
  std::string method;
  ProcessingRun run;
};

/// What the ground has of a frame.
struct Sent {
  bool is_there = false;
  bool all = false;
  std::vector<ProcessingRun> runs;
  [[nodiscard]] bool has(ProcessingRun run) const {
    return all || std::find(runs.begin(), runs.end(), run) != runs.end();
  }
};

std::string_view extension(FrameMark mark) {
  switch (mark) {
    case FrameMark::detected:
      return ".detected";
    case FrameMark::nothing:
      return ".nothing";
    case FrameMark::sent:
      return ".sent";
  }
  std::abort();
}

std::vector<std::string_view> lines_of(std::string_view text) {
  std::vector<std::string_view> lines;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    if (end > 0) lines.push_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return lines;
}

std::optional<ProcessingRun> run_in(std::string_view text) {
  return to_number<ProcessingRun>(text, 16);
}

/// Empty: no such mark.
std::vector<Detection> detections_of(const fs::path& frame) {
  if (!has_mark(frame, FrameMark::detected)) return {};
  const auto text = read_file(mark_path(frame, FrameMark::detected), mark_octets_max);
  std::vector<Detection> found;
  for (const std::string_view line : lines_of(text ? std::string_view(*text) : std::string_view())) {
    const std::size_t space = std::min(line.find(' '), line.size());
    const auto run = run_in(line.substr(std::min(space + 1, line.size())));
    found.push_back({std::string(line.substr(0, space)), run.value_or(0)});
  }
  if (found.empty()) found.push_back({"", 0});
  return found;
}

Sent sent_of(const fs::path& frame) {
  Sent sent;
  sent.is_there = has_mark(frame, FrameMark::sent);
  if (!sent.is_there) return sent;
  const auto text = read_file(mark_path(frame, FrameMark::sent), mark_octets_max);
  if (!text) return sent;
  sent.all = text->empty();
  for (const std::string_view line : lines_of(*text)) {
    if (const auto run = run_in(line)) sent.runs.push_back(*run);
  }
  return sent;
}

bool is_of_run(const std::vector<Detection>& found, ProcessingRun run) {
  return std::any_of(found.begin(), found.end(), [run](const Detection& d) { return d.run == run; });
}

bool is_all_sent(const std::vector<Detection>& found, const Sent& sent) {
  return std::all_of(found.begin(), found.end(), [&](const Detection& d) { return sent.has(d.run); });
}

bool is_gone(const fs::path& frame) {
  std::error_code failed;
  return !fs::exists(frame, failed);
}

}  // namespace

ProcessingRun run_of_goal(const std::array<std::uint8_t, 16>& goal_id) {
  ProcessingRun run = 0;
  for (std::size_t i = 0; i < sizeof run; ++i) run = run << 8 | goal_id.at(i);
  return std::max<ProcessingRun>(run, 1);
}

fs::path mark_path(const fs::path& frame, FrameMark mark) {
  fs::path path = frame;
  path.replace_extension(extension(mark));
  return path;
}

bool has_mark(const fs::path& frame, FrameMark mark) {
  std::error_code failed;
  return fs::exists(mark_path(frame, mark), failed);
}

Result<void, FileError> mark_frame(const fs::path& frame, FrameMark mark) {
  if (is_gone(frame)) return {};
  return write_file_atomically(mark_path(frame, mark), "");
}

Result<void, FileError> mark_detected(const fs::path& frame, std::string_view method, ProcessingRun run) {
  if (is_gone(frame)) return {};
  // What was sent until now did not have this detection.
  if (sent_of(frame).all) {
    if (auto removed = remove_durably(mark_path(frame, FrameMark::sent)); !removed) return removed;
  }
  std::string text;
  for (const Detection& d : detections_of(frame)) {
    if (d.method != method) text += fmt::format("{} {:08x}\n", d.method, d.run);
  }
  text += fmt::format("{} {:08x}\n", method, run);
  if (auto written = write_file_atomically(mark_path(frame, FrameMark::detected), text); !written)
    return written;
  if (!has_mark(frame, FrameMark::nothing)) return {};
  return remove_durably(mark_path(frame, FrameMark::nothing));
}

Result<void, FileError> mark_sent(const fs::path& frame, std::optional<ProcessingRun> run) {
  if (is_gone(frame)) return {};
  const std::vector<Detection> found = detections_of(frame);
  const Sent before = sent_of(frame);
  if (before.all) return {};
  std::vector<ProcessingRun> runs{run.value_or(0)};
  for (const Detection& d : found) {
    const bool on_the_ground = !run || before.has(d.run);
    if (on_the_ground && d.run != runs.front()) runs.push_back(d.run);
  }
  std::string text;
  for (const ProcessingRun r : runs) text += fmt::format("{:08x}\n", r);
  return write_file_atomically(mark_path(frame, FrameMark::sent), text);
}

bool lacks_sent_mark(const fs::path& frame, std::optional<ProcessingRun> run) {
  const std::vector<Detection> found = detections_of(frame);
  const Sent sent = sent_of(frame);
  if (found.empty()) return !sent.is_there && (!run || has_mark(frame, FrameMark::nothing));
  if (run) return is_of_run(found, *run) && !sent.has(*run);
  return !is_all_sent(found, sent);
}

bool has_unsent_detection(const fs::path& frame) {
  return !is_all_sent(detections_of(frame), sent_of(frame));
}

}  // namespace srfs::image
