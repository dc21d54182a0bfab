// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/link/transmitter_switch.hpp"

#include <sstream>

#include <fmt/format.h>

#include "base/checked_text.hpp"

namespace srfs {

TransmitterSwitch::TransmitterSwitch(std::string boot_id, std::string_view stored, MonotonicTime now)
    : boot_id_(std::move(boot_id)) {
  std::istringstream in(without_check(stored).value_or(""));
  std::string boot;
  std::int64_t from_ns = 0;
  std::int64_t duration_s = 0;
  bool renewed = false;
  if (!(in >> boot >> from_ns >> duration_s >> renewed) || duration_s < 1 || duration_s > longest.count())
    return;
  const seconds duration(duration_s);
  if (boot == boot_id_) {
    const MonotonicTime from{nanoseconds(from_ns)};
    if (from <= now + grace && now < from + duration) silence_ = {from, from + duration, duration, renewed};
  } else if (!renewed) {
    silence_ = {now, now + duration, duration, true};
  }
}

void TransmitterSwitch::switch_off(seconds duration, MonotonicTime now) {
  const MonotonicTime from = may_transmit(now) ? now + grace : now;
  silence_ = {from, from + duration, duration};
}

nanoseconds TransmitterSwitch::rest(MonotonicTime now) const {
  return silence_ && now < silence_->until ? silence_->until - now : nanoseconds(0);
}

std::optional<MonotonicTime> TransmitterSwitch::next_due(MonotonicTime now) const {
  if (!silence_) return std::nullopt;
  return now < silence_->from ? silence_->from : silence_->until;
}

bool TransmitterSwitch::take_end(MonotonicTime now) {
  if (!silence_ || now < silence_->until) return false;
  silence_.reset();
  return true;
}

std::string TransmitterSwitch::stored_text() const {
  if (!silence_) return {};
  return with_check(fmt::format("{} {} {} {:d}", boot_id_, silence_->from.ns(), silence_->duration.count(),
                                silence_->renewed));
}

}  // namespace srfs
