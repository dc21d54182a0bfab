// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/serial_line.hpp"

#include <algorithm>
#include <cassert>

namespace srfs::sim {

void SerialLine::accept(OctetView octets, MonotonicTime now) {
  assert(octets.size() <= room());
  if (octets.empty()) return;
  if (on_line_.empty()) first_arrives_ = std::max(first_arrives_, now + octet_time_);
  on_line_.insert(on_line_.end(), octets.begin(), octets.end());
  counters_.sent += octets.size();
}

void SerialLine::advance(MonotonicTime now) {
  while (!on_line_.empty() && first_arrives_ <= now) {
    if (received_.size() == capacity) {
      received_.pop_front();
      ++counters_.dropped;
    }
    received_.push_back(drowned(flipped(on_line_.front())));
    on_line_.pop_front();
    first_arrives_ += octet_time_;
  }
}

std::optional<MonotonicTime> SerialLine::next_deadline() const {
  if (on_line_.empty()) return std::nullopt;
  const nanoseconds rest = octet_time_ * static_cast<std::int64_t>(on_line_.size() - 1);
  return first_arrives_ + std::min<nanoseconds>(rest, milliseconds(1));
}

Octets SerialLine::arrived(std::size_t most) const {
  const auto n = static_cast<std::ptrdiff_t>(std::min(most, received_.size()));
  return {received_.begin(), received_.begin() + n};
}

void SerialLine::taken(std::size_t octets) {
  assert(octets <= received_.size());
  received_.erase(received_.begin(), received_.begin() + static_cast<std::ptrdiff_t>(octets));
  counters_.carried += octets;
}

void SerialLine::lose_received(std::size_t elsewhere) {
  counters_.dropped += received_.size() + elsewhere;
  counters_.carried -= std::min<std::uint64_t>(counters_.carried, elsewhere);
  received_.clear();
}

void SerialLine::set_flip_probability(double probability) {
  flip_probability_ = probability;
  if (probability > 0)
    bits_to_flip_ = std::geometric_distribution<std::uint64_t>(std::min(probability, 0.999999))(random_);
}

std::uint8_t SerialLine::flipped(std::uint8_t octet) {
  if (flip_probability_ <= 0) return octet;
  unsigned value = octet;
  std::uint64_t from = 0;
  while (from + bits_to_flip_ < 8) {
    value ^= 1U << (from + bits_to_flip_);
    from += bits_to_flip_ + 1;
    ++counters_.flipped_bits;
    bits_to_flip_ =
        std::geometric_distribution<std::uint64_t>(std::min(flip_probability_, 0.999999))(random_);
  }
  bits_to_flip_ -= 8 - from;
  return static_cast<std::uint8_t>(value);
}

std::uint8_t SerialLine::drowned(std::uint8_t octet) {
  if (burst_probability_ > 0 && burst_left_ == 0 &&
      std::bernoulli_distribution(burst_probability_)(random_)) {
    burst_left_ = burst_octets;
    ++counters_.bursts;
  }
  if (burst_left_ == 0) return octet;
  --burst_left_;
  return static_cast<std::uint8_t>(octet ^ std::uniform_int_distribution<unsigned>(1, 255)(random_));
}

}  // namespace srfs::sim
