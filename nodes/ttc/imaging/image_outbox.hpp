// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <mission/structures.hpp>

#include "image/file/frame_mark.hpp"

namespace srfs {

/// What a file in the outbox belongs to, by its name: image_RANK_rRUN_TASK_NAME is a product of a run of a
/// task's processing, strip_RANK_TASK_FRAME_NAME a part of one frame.
struct OutboxImage {
  std::uint32_t task = 0;
  std::uint16_t frame = 0;  ///< 0: a product of all its frames
  /// Of a product. 0: not known, or one that does not say what was found; not in the name then
  image::ProcessingRun run = 0;
  friend bool operator==(const OutboxImage&, const OutboxImage&) = default;
};
/// nullopt: another file. @param name without folder
[[nodiscard]] std::optional<OutboxImage> outbox_image(std::string_view name);
/// @param rank from 1, in the order of importance. @param name of the file on board
[[nodiscard]] std::string outbox_image_name(const OutboxImage& image, std::size_t rank,
                                            std::string_view name);

struct QueuedProducts {
  std::uint16_t failure = 0;  ///< code of the dictionary; 0: all are queued
  std::string reason = {};
  std::size_t queued = 0;
};

/// What became of an imaging task's order to the disk.
struct ImagingOutcome {
  std::optional<std::vector<std::string>> frames = {};
  QueuedProducts products{.failure = mission::failure::disk_failed};  ///< queued, or taken out again
};

/// Imaging's files between the folder of images and the folder of files: products into the outbox, and frames
/// marked as sent when the ground has all that a run made of them. The outbox is the only memory, so a
/// restart forgets nothing. The file on board stays: it is linked, not moved. Used on the thread that owns
/// the disk; blocks on it.
class ImageOutbox {
 public:
  static constexpr std::size_t max_frames = 256;         ///< of one order; a task number used again has more
  static constexpr std::size_t max_outbox_files = 1000;  ///< cfdp::TransferFolders reads 1024
  static constexpr std::size_t max_to_mark = 64;
  static constexpr std::size_t marks_per_call = 4;  ///< each waits for the disk several times

  /// @param images VAR/images. @param files VAR/files
  ImageOutbox(std::filesystem::path images, std::filesystem::path files)
      : images_(std::move(images)), files_(std::move(files)) {}

  /// Frames of a task in order, below the folder of images. @param frame only this one; 0: all
  [[nodiscard]] std::vector<std::string> frames_of(std::uint32_t task, std::uint16_t frame) const;
  /// The same, the newest max_frames at most.
  [[nodiscard]] std::vector<std::string> newest_frames_of(std::uint32_t task, std::uint16_t frame) const;
  /// Puts products into the outbox, the first first. @param products below the folder of images
  /// @param is_sending  whether a transfer has this name of the outbox, also a cancelled one that the
  /// ground has not ended yet
  [[nodiscard]] QueuedProducts queue(const OutboxImage& image, const std::vector<std::string>& products,
                                     const std::function<bool(const std::string&)>& is_sending = {});
  /// Names in the outbox of a task, whatever they are of it.
  [[nodiscard]] std::vector<std::string> queued(std::uint32_t task) const;
  /// Takes files out of the outbox. @return how many
  std::size_t remove(const std::vector<std::string>& names);

  /// The ground has a file of the outbox, which has left it. @param source_file as CFDP names it
  /// @return whether it is one of imaging
  bool on_sent(std::string_view source_file);
  /// Marks some of the frames whose products were all sent, of those in which that run found something or
  /// nothing ever was found, or that were sent whole. A restart in between forgets the rest: their
  /// frames are then kept for longer.
  void mark_some();

 private:
  [[nodiscard]] bool is_left(const OutboxImage& image) const;

  std::filesystem::path images_;
  std::filesystem::path files_;
  std::deque<OutboxImage> to_mark_;
};

}  // namespace srfs
