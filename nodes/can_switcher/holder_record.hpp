// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "base/result.hpp"

namespace srfs {

/// The process that may write to the bus, kept for the switcher that starts after this one was killed: one
/// word of a mapped file on tmpfs. The word survives the process at any instant (not the computer: then the
/// holder is gone too). Storing it waits for no disk and is never torn.
class HolderRecord {
 public:
  struct Holder {
    std::size_t slot = 0;       ///< index in the plan
    std::uint32_t process = 0;  ///< incarnation of the payload's process; 0: not known
    friend bool operator==(const Holder&, const Holder&) = default;
  };

  /// Creates the file and its folder when they are missing. Error: ready to print.
  [[nodiscard]] static Result<HolderRecord, std::string> open(const std::filesystem::path& file);

  /// Nothing: the bus is free.
  void write(const std::optional<Holder>& holder);
  [[nodiscard]] std::optional<Holder> read() const;

 private:
  struct Unmap {
    void operator()(std::uint64_t* word) const;
  };
  explicit HolderRecord(std::uint64_t* word) : word_(word) {}
  std::unique_ptr<std::uint64_t, Unmap> word_;
};

}  // namespace srfs
