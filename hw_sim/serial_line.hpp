// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <random>

#include "base/octets.hpp"
#include "base/time.hpp"

namespace srfs::sim {

/// What happened to the octets of one direction.
struct SerialLineCounters {
  std::uint64_t sent = 0;     ///< octets given to the line
  std::uint64_t carried = 0;  ///< octets that reached the far end
  std::uint64_t flipped_bits = 0;
  std::uint64_t bursts = 0;   ///< begun; each spoils the next burst_octets octets
  std::uint64_t dropped = 0;  ///< octets the reader was too slow for
};

/// One direction of an RS422 line, 8N1: octets leave at the line's rate (ten bit times each), bits may be
/// inverted.
///
/// The sender side is bounded by back-pressure: accept() takes what room() allows and the caller reads no
/// more. The reader side is bounded by loss: arrived octets wait in a receive buffer of 64 KiB where the
/// oldest make room. Pure.
class SerialLine {
 public:
  static constexpr std::size_t capacity = 65536;
  /// More than RS(255,223) corrects in a code word: a frame that a burst meets whole is lost.
  static constexpr unsigned burst_octets = 32;

  SerialLine(std::uint32_t baud, std::uint64_t seed) : octet_time_(10'000'000'000 / baud), random_(seed) {}

  /// Octets the sending side can give now.
  [[nodiscard]] std::size_t room() const { return capacity - on_line_.size(); }
  /// Starts @p octets (at most room()) behind those already waiting.
  void accept(OctetView octets, MonotonicTime now);
  /// Moves what has left the wire at @p now to the receive buffer.
  void advance(MonotonicTime now);
  /// When the next octets arrive; several are gathered for up to a millisecond. nullopt: the line is idle.
  [[nodiscard]] std::optional<MonotonicTime> next_deadline() const;

  /// What the reader can take, in order: a copy of at most @p most octets.
  [[nodiscard]] Octets arrived(std::size_t most) const;
  [[nodiscard]] bool has_arrived() const { return !received_.empty(); }
  /// The reader took the first @p octets.
  void taken(std::size_t octets);
  /// There is no listener: what waits in the receive buffer, and @p elsewhere octets, are lost.
  void lose_received(std::size_t elsewhere);

  /// @param probability  of each bit to be inverted, 0-1
  void set_flip_probability(double probability);
  /// @param probability  of each octet to begin a burst of noise, 0-1
  void set_burst_probability(double probability) { burst_probability_ = probability; }
  [[nodiscard]] const SerialLineCounters& counters() const { return counters_; }

 private:
  [[nodiscard]] std::uint8_t flipped(std::uint8_t octet);
  [[nodiscard]] std::uint8_t drowned(std::uint8_t octet);

  nanoseconds octet_time_;
  std::mt19937_64 random_;
  double flip_probability_ = 0;
  std::uint64_t bits_to_flip_ = 0;  // good bits until the next inverted one
  double burst_probability_ = 0;
  unsigned burst_left_ = 0;  // octets
  SerialLineCounters counters_;
  std::deque<std::uint8_t> on_line_;
  MonotonicTime first_arrives_;  // of on_line_.front()
  std::deque<std::uint8_t> received_;
};

}  // namespace srfs::sim
