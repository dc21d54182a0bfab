// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/can_switcher/bus_meter.hpp"

#include <algorithm>

namespace srfs {
namespace {

/// ISO 15765-2 normal fixed addressing, to or from address 01, of any priority.
bool is_of_the_computer(std::uint32_t id, bool extended) {
  constexpr std::uint32_t computer = 0x01;
  return extended && (id >> 16U & 0x3FFU) == 0x0DA &&
         ((id >> 8U & 0xFFU) == computer || (id & 0xFFU) == computer);
}

}  // namespace

void BusMeter::on_frame(std::uint32_t id, bool extended, unsigned bits) {
  bits_ += bits;
  ++frames_;
  ++counters_.frames;
  if (!is_of_the_computer(id, extended)) ++counters_.foreign_frames;
  if (votes_ == 0) candidate_ = id;
  if (id == candidate_) {
    ++votes_;
  } else {
    --votes_;
  }
}

BusMeter::Flood BusMeter::end_window(MonotonicTime now, std::uint32_t bit_rate) {
  const double period_s = std::chrono::duration<double>(now - window_start_).count();
  const double possible = period_s * bit_rate;
  last_ = {.load = possible > 0 ? static_cast<double>(bits_) / possible : 0,
           .frames = frames_,
           .most_frequent = candidate_};
  peak_ = std::max(peak_, last_.load);
  window_start_ = now;
  bits_ = 0;
  frames_ = votes_ = 0;
  if (!flooded_since_ && last_.load >= flooded_from) {
    flooded_since_ = now;
    ++counters_.floods;
    return Flood::began;
  }
  if (flooded_since_ && last_.load < quiet_below) {
    flood_lasted_ = now - *flooded_since_;
    flooded_since_.reset();
    return Flood::ended;
  }
  return Flood::no_change;
}

}  // namespace srfs
