// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_acquisition/frame_store.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "base/text.hpp"
#include "image/file/frame_mark.hpp"

namespace srfs {
namespace {

namespace fs = std::filesystem;
using image::FrameMark;

constexpr std::array marks{FrameMark::detected, FrameMark::nothing, FrameMark::sent};
constexpr std::size_t task_digits = 10;
constexpr std::size_t number_digits = 4;

template <class T>
std::optional<T> whole_number(const std::string& text, std::size_t digits) {
  const auto value = to_number<T>(text);
  return text.size() == digits && value != T{0} ? value : std::nullopt;
}

FrameStanding standing_of(const fs::path& frame) {
  if (image::has_unsent_detection(frame)) return FrameStanding::detected;
  if (image::has_mark(frame, FrameMark::sent)) return FrameStanding::sent;
  return image::has_mark(frame, FrameMark::nothing) ? FrameStanding::nothing : FrameStanding::unmarked;
}

tl::unexpected<FileError> unreadable(const fs::path& path, const std::error_code& why) {
  return Err(FileError{fmt::format("{}: {}", path.string(), why.message())});
}

Result<std::vector<fs::path>, FileError> entries(const fs::path& folder) {
  std::vector<fs::path> found;
  std::error_code failed;
  for (fs::directory_iterator at(folder, failed), end; !failed && at != end; at.increment(failed))
    found.push_back(at->path());
  if (failed) return unreadable(folder, failed);
  return found;
}

}  // namespace

std::string frame_file(std::uint32_t task, std::uint16_t number) {
  return fmt::format("frames/{:010}/{:04}.fits", task, number);
}

Result<void, FileError> FrameStore::open() {
  auto read = read_index();
  open_ = read.has_value();
  if (open_) return read;
  frames_.clear();
  last_number_.clear();
  octets_ = 0;
  return read;
}

Result<void, FileError> FrameStore::read_index() {
  frames_.clear();
  last_number_.clear();
  octets_ = 0;
  std::error_code failed;
  fs::create_directories(images_ / "frames", failed);
  if (failed) return unreadable(images_ / "frames", failed);
  const auto folders = entries(images_ / "frames");
  if (!folders) return Err(folders.error());
  for (const fs::path& folder : *folders) {
    const auto task = whole_number<std::uint32_t>(folder.filename().string(), task_digits);
    if (!task) continue;
    const bool is_folder = fs::is_directory(folder, failed);
    if (failed) return unreadable(folder, failed);
    if (!is_folder) continue;
    if (auto taken = take_task(folder, *task); !taken) return taken;
  }
  // Their age is the file's: the clock may have been wrong then, the order within a run is right.
  std::vector<std::pair<fs::file_time_type, StoredFrame>> aged;
  aged.reserve(frames_.size());
  for (const StoredFrame& frame : frames_)
    aged.emplace_back(fs::last_write_time(images_ / frame_file(frame.task, frame.number), failed), frame);
  std::stable_sort(aged.begin(), aged.end(), [](const auto& a, const auto& b) {
    return std::tuple(a.first, a.second.task, a.second.number) <
           std::tuple(b.first, b.second.task, b.second.number);
  });
  for (std::size_t i = 0; i < aged.size(); ++i) frames_[i] = aged[i].second;
  return {};
}

Result<void, FileError> FrameStore::take_task(const fs::path& folder, std::uint32_t task) {
  const auto files = entries(folder);
  if (!files) return Err(files.error());
  std::error_code failed;
  for (const fs::path& file : *files) {
    // Of a frame; a mark may be being written by another process.
    if (file.extension() == ".tmp" && file.filename().string().find(".fits.") != std::string::npos) {
      fs::remove(file, failed);
      continue;
    }
    const auto number = whole_number<std::uint16_t>(file.stem().string(), number_digits);
    if (!number) continue;
    if (file.extension() != ".fits") {
      const bool frame_there = fs::exists(images_ / frame_file(task, *number), failed);
      const bool is_mark = std::any_of(marks.begin(), marks.end(),
                                       [&](FrameMark mark) { return file == image::mark_path(file, mark); });
      if (is_mark && !frame_there && !failed) fs::remove(file, failed);
      continue;
    }
    last_number_[task] = std::max(last_number_[task], *number);
    const auto octets = fs::file_size(file, failed);
    if (failed) return unreadable(file, failed);
    if (frames_.size() >= frames_max) continue;
    frames_.push_back({task, *number, octets, FrameStanding::unmarked});
    octets_ += octets;
  }
  return {};
}

std::optional<std::uint16_t> FrameStore::next_number(std::uint32_t task) const {
  const auto found = last_number_.find(task);
  const std::uint16_t last = found != last_number_.end() ? found->second : std::uint16_t{0};
  if (!open_ || last >= number_max || frames_.size() >= frames_max) return std::nullopt;
  return static_cast<std::uint16_t>(last + 1);
}

void FrameStore::look_at_marks() {
  for (StoredFrame& frame : frames_)
    frame.standing = standing_of(images_ / frame_file(frame.task, frame.number));
}

bool FrameStore::remove(const StoredFrame& frame) {
  const fs::path file = images_ / frame_file(frame.task, frame.number);
  if (!remove_durably(file)) return false;
  std::error_code ignored;
  for (const FrameMark mark : marks) fs::remove(image::mark_path(file, mark), ignored);
  fs::remove(file.parent_path(), ignored);  // when it was the last
  octets_ -= frame.octets;
  ++removed_;
  return true;
}

Result<void, FrameStore::Failure> FrameStore::make_room(std::uint64_t needed, std::uint32_t task) {
  if (octets_ + needed <= quota_) return {};
  look_at_marks();
  const auto chosen = frames_to_remove(frames_, quota_, needed, task);
  if (!chosen) {
    const auto kept = std::count_if(frames_.begin(), frames_.end(), [](const StoredFrame& frame) {
      return frame.standing == FrameStanding::detected;
    });
    return Err(Failure{true, fmt::format("{} of {} MiB used, {} of {} frames have detections not sent",
                                         octets_ >> 20, quota_ >> 20, kept, frames_.size())});
  }
  std::vector<bool> gone(frames_.size());
  for (const std::size_t i : *chosen) gone[i] = remove(frames_[i]);
  const bool all = std::all_of(chosen->begin(), chosen->end(), [&](std::size_t i) { return gone[i]; });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    if (!gone[i]) frames_[kept++] = frames_[i];
  }
  frames_.resize(kept);
  if (!all) return Err(Failure{false, "a frame cannot be removed"});
  return {};
}

Result<std::string, FrameStore::Failure> FrameStore::add(std::uint32_t task, std::uint16_t number,
                                                         OctetView content) {
  if (!open_) return Err(Failure{false, "the folder of frames could not be read"});
  if (auto room = make_room(content.size(), task); !room) return Err(std::move(room.error()));
  std::string name = frame_file(task, number);
  const auto written = write_file_atomically(images_ / name, as_text(content));
  if (!written) return Err(Failure{false, written.error().message});
  frames_.push_back({task, number, content.size(), FrameStanding::unmarked});
  octets_ += content.size();
  last_number_[task] = number;
  return name;
}

}  // namespace srfs
