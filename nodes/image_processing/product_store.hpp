// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/octets.hpp"
#include "base/result.hpp"

namespace srfs {

enum class StoreProblem : std::uint8_t {
  quota,  ///< the task alone fills the store
  disk
};
struct StoreFailure {
  StoreProblem problem;
  std::string text;
};

/// Products on board, IMAGES/products/TASK/NAME, the task with ten digits. All together have a quota: the
/// products of the task that was begun first go first, never those of the task under way. Files are whole or
/// not there, also across power loss. Blocks on the disk; one caller at a time.
class ProductStore {
 public:
  /// Takes over what is there, oldest first by the files' times; what is half written goes.
  ProductStore(std::filesystem::path images, std::uint64_t quota_octets);

  /// A task is under way from now on. @param anew  what an earlier run of its processing made goes; full
  /// frames stay
  void begin(std::uint32_t task, bool anew);
  /// Writes a product of the task under way, which replaces one of the same name. When the disk refuses, the
  /// oldest task makes room, once.
  /// @return its name below the folder of images
  [[nodiscard]] Result<std::string, StoreFailure> put(const std::string& name, OctetView content);

  [[nodiscard]] std::uint64_t octets() const;
  /// Tasks whose products were removed to make room.
  [[nodiscard]] std::uint32_t removed_tasks() const { return removed_tasks_; }

  /// Begin of the names of full frames.
  static constexpr std::string_view frame_prefix = "frame_";

 private:
  struct Task {
    std::uint32_t number;
    std::uint64_t octets;
  };
  [[nodiscard]] std::filesystem::path folder(std::uint32_t task) const;
  [[nodiscard]] bool remove_oldest();
  void scan();

  std::filesystem::path images_;
  std::uint64_t quota_octets_;
  std::vector<Task> tasks_;  // oldest first; the last is under way once one was begun
  bool begun_ = false;
  std::uint32_t removed_tasks_ = 0;
};

}  // namespace srfs
