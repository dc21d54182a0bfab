// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/payload/sensor_inputs.hpp"

namespace srfs {

std::optional<SensorInputs::Change> SensorInputs::on_reading(Reading reading, MonotonicTime now) {
  const auto bits = [](unsigned value) { return static_cast<std::uint8_t>(value); };
  valid_ = bits(reading.read & assigned_);
  if (valid_ != assigned_) ++failures_;
  const std::uint8_t after = bits((levels_ & ~valid_) | (reading.levels & valid_));
  const std::uint8_t first_time = bits(valid_ & ~known_);
  if (((after ^ levels_) & known_) != 0) ++changes_;
  levels_ = after;
  known_ = bits(known_ | valid_);
  reported_ = bits((reported_ & ~first_time) | (after & first_time));

  if (levels_ == reported_ || (last_event_ && now - *last_event_ < event_period)) return std::nullopt;
  last_event_ = now;
  const Change change{reported_, levels_};
  reported_ = levels_;
  return change;
}

}  // namespace srfs
