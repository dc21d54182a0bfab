// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "base/file.hpp"
#include "nodes/image_acquisition/frame_removal.hpp"

namespace srfs {

/// Name of a stored frame below the folder of images: "frames/0000000017/0001.fits".
[[nodiscard]] std::string frame_file(std::uint32_t task, std::uint16_t number);

struct StoreFigures {
  std::size_t frames = 0;
  std::uint64_t octets = 0;
  std::uint64_t removed = 0;  ///< to make room, since the start
};

/// Frames on disk within a quota; frame_removal.hpp describes what makes room. A frame is there whole or not
/// at all, also across power loss; the folder itself is the only record. Every call blocks on the disk: one
/// worker thread.
class FrameStore {
 public:
  static constexpr std::uint16_t number_max = 9999;
  /// Files beyond this number are ignored: the index takes 24 octets each.
  static constexpr std::size_t frames_max = 100'000;

  struct Failure {
    bool full = false;  ///< no room may be made; else the disk failed
    std::string reason;
  };

  FrameStore(std::filesystem::path images, std::uint64_t quota_octets)
      : images_(std::move(images)), quota_(quota_octets) {}

  /// Reads what is there, and removes what a power loss left half done: temporary files and marks without
  /// their frame. @return why not all of it can be read: the store is closed then, for it does not know which
  /// numbers are taken and what may go; to be opened again
  [[nodiscard]] Result<void, FileError> open();
  [[nodiscard]] bool is_open() const { return open_; }
  /// Number of the next frame of a task: after the highest that is there. nullopt: no more numbers, or
  /// closed.
  [[nodiscard]] std::optional<std::uint16_t> next_number(std::uint32_t task) const;
  /// Stores a frame, whose number next_number() gave. @return its name below the folder of images
  [[nodiscard]] Result<std::string, Failure> add(std::uint32_t task, std::uint16_t number, OctetView content);
  [[nodiscard]] StoreFigures figures() const { return {frames_.size(), octets_, removed_}; }

 private:
  [[nodiscard]] Result<void, FileError> read_index();
  [[nodiscard]] Result<void, FileError> take_task(const std::filesystem::path& folder, std::uint32_t task);
  void look_at_marks();
  [[nodiscard]] Result<void, Failure> make_room(std::uint64_t needed, std::uint32_t task);
  [[nodiscard]] bool remove(const StoredFrame& frame);

  std::filesystem::path images_;
  std::uint64_t quota_;
  bool open_ = false;
  std::vector<StoredFrame> frames_;  ///< oldest first
  std::map<std::uint32_t, std::uint16_t> last_number_;
  std::uint64_t octets_ = 0;
  std::uint64_t removed_ = 0;
};

}  // namespace srfs
