// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <random>
#include <vector>

#include "nodes/ttc/command/journal_log.hpp"

namespace srfs::testing_support {

/// Thrown when the simulated power is lost.
struct PowerLoss {};

/// Two segments on a medium that can lose unsynced data. After a power loss such data is complete, cut at any
/// octet, present in some of its blocks, or missing. The loss occurs at a chosen call.
class SimulatedMedium final : public JournalMedium {
 public:
  explicit SimulatedMedium(std::uint64_t seed) : random_(seed) {}

  [[nodiscard]] Octets read(unsigned segment) override { return now_.at(segment); }
  Result<void, FileError> write(unsigned segment, std::size_t offset, OctetView octets) override {
    if (failing) return Err(FileError{"no space"});
    const bool lost = calls++ == lose_at;
    put(now_.at(segment), offset, octets);
    unsynced_.push_back({segment, offset, {octets.begin(), octets.end()}});
    if (lost) lose_power();
    return {};
  }
  Result<void, FileError> sync(unsigned segment) override {
    if (failing) return Err(FileError{"no space"});
    if (calls++ == lose_at) lose_power();
    for (const Write& w : unsynced_) {
      if (w.segment == segment) put(durable_.at(segment), w.offset, w.octets);
    }
    std::erase_if(unsynced_, [segment](const Write& w) { return w.segment == segment; });
    return {};
  }
  void flip(unsigned segment, std::size_t offset) {
    now_.at(segment).at(offset) ^= 0x10;
    durable_.at(segment).at(offset) ^= 0x10;
  }

  std::uint64_t lose_at = UINT64_MAX;  ///< the call that the power loss interrupts
  std::uint64_t calls = 0;
  bool failing = false;

 private:
  struct Write {
    unsigned segment;
    std::size_t offset;
    Octets octets;
  };
  static void put(Octets& file, std::size_t offset, OctetView octets) {
    if (file.size() < offset + octets.size()) file.resize(offset + octets.size());
    std::copy(octets.begin(), octets.end(), file.begin() + static_cast<std::ptrdiff_t>(offset));
  }
  [[noreturn]] void lose_power() {
    constexpr std::size_t block = 512;
    for (const Write& w : unsynced_) {
      const OctetView octets(w.octets);
      Octets& file = durable_.at(w.segment);
      switch (random_() % 4) {
        case 0:
          break;
        case 1:
          put(file, w.offset, octets);
          break;
        case 2:
          put(file, w.offset, octets.first(random_() % (octets.size() + 1)));
          break;
        default:
          for (std::size_t at = 0; at < octets.size(); at += block) {
            if (random_() % 2 == 0)
              put(file, w.offset + at, octets.subspan(at, std::min(block, octets.size() - at)));
          }
      }
    }
    unsynced_.clear();
    now_ = durable_;
    lose_at = UINT64_MAX;
    throw PowerLoss{};
  }

  std::mt19937_64 random_;
  std::array<Octets, segments> durable_;
  std::array<Octets, segments> now_;
  std::vector<Write> unsynced_;
};

}  // namespace srfs::testing_support
