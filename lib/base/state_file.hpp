// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/file.hpp"
#include "base/log.hpp"
#include "base/result.hpp"

namespace srfs {

/// How a state stands in a file.
template <class T>
struct StateCodec {
  std::string (*encode)(const T&);                  ///< with a checksum
  std::optional<T> (*decode)(std::string_view);     ///< nullopt: damaged
  bool (*is_newer)(const T& state, const T& than);  ///< of two sound copies
};

/// A small state that outlives its process in two copies, each replaced atomically: a write cut short, a full
/// disk or a rotten block costs one of them at most. Blocks on the disk.
template <class T>
class StateFile {
 public:
  enum class Writes : std::uint8_t {
    both,     ///< each time: where both are on the medium, a rotten one costs nothing
    in_turn,  ///< the older one: half the writes; a rotten copy costs the last change
  };
  static constexpr std::size_t largest_octets = 65536;  ///< of a copy; a larger one is damaged

  StateFile(std::filesystem::path first, std::filesystem::path second, StateCodec<T> codec,
            Writes writes = Writes::both, Access access = Access::everyone)
      : copies_{std::move(first), std::move(second)}, codec_(codec), writes_(writes), access_(access) {}

  struct Found {
    std::optional<T> state;                      ///< the newer sound copy
    std::vector<std::filesystem::path> damaged;  ///< at most two
    [[nodiscard]] bool existed() const { return state.has_value() || !damaged.empty(); }
  };
  /// A copy that cannot be read, whatever the reason, is damaged, and logged; only one that is not there is
  /// not.
  [[nodiscard]] Found load() {
    Found found;
    for (std::size_t i = 0; i < copies_.size(); ++i) {
      std::error_code ec;
      if (!std::filesystem::exists(copies_.at(i), ec) && !ec) continue;
      const auto text = read_file(copies_.at(i), largest_octets);
      auto state = text ? codec_.decode(*text) : std::nullopt;
      if (!state) {
        log::error("{} is damaged", copies_.at(i).string());
        found.damaged.push_back(copies_.at(i));
      } else if (!found.state || codec_.is_newer(*state, *found.state)) {
        found.state = std::move(state);
        newest_ = i;
      }
    }
    return found;
  }

  struct Stored {
    unsigned copies = 0;  ///< on the medium
    std::string problem;  ///< of the copies that are not, for people; empty: all is well
    [[nodiscard]] bool durable() const { return copies > 0; }
  };
  /// Tries every copy that is to be written; in turn: the newest one only if the older one cannot be.
  [[nodiscard]] Stored store(const T& state) {
    const std::string text = codec_.encode(state);
    Stored stored;
    for (const std::size_t i : {1 - newest_, newest_}) {
      if (writes_ == Writes::in_turn && stored.durable()) break;
      if (const auto written = write_file_atomically(copies_.at(i), text, access_); !written) {
        stored.problem += (stored.problem.empty() ? "" : "; ") + written.error().message;
      } else {
        ++stored.copies;
        newest_ = i;
      }
    }
    return stored;
  }

 private:
  std::array<std::filesystem::path, 2> copies_;
  StateCodec<T> codec_;
  Writes writes_;
  Access access_;
  std::size_t newest_ = 1;  ///< written last, or found newer
};

}  // namespace srfs
