// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_acquisition/capture_sequence.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include <fmt/format.h>

#include <mission/structures.hpp>

namespace srfs {
namespace {

constexpr microseconds exposure_max = seconds(60);
constexpr double gain_max_db = 60;
constexpr std::uint16_t frames_max = 256;
constexpr milliseconds interval_max = seconds(3600);

CaptureFailure out_of_range(std::string what) {
  return {mission::failure::bad_argument, std::move(what)};
}

}  // namespace

std::optional<CaptureFailure> refuse(const CaptureRequest& r) {
  if (r.task == 0) return out_of_range("task 0; expected 1 or more");
  if (r.exposure < microseconds(1) || r.exposure > exposure_max)
    return out_of_range(fmt::format("exposure {} us; expected 1 to 60000000", r.exposure.count()));
  if (!(r.gain_db >= 0 && r.gain_db <= gain_max_db))
    return out_of_range(fmt::format("gain {} dB; expected 0 to 60", r.gain_db));
  if (r.frames < 1 || r.frames > frames_max)
    return out_of_range(fmt::format("{} frames; expected 1 to 256", r.frames));
  if (r.interval < milliseconds(0) || r.interval > interval_max)
    return out_of_range(fmt::format("interval {} ms; expected 0 to 3600000", r.interval.count()));
  return std::nullopt;
}

std::optional<CaptureFailure> refuse_past(UtcTime start, UtcTime now, nanoseconds latest) {
  if (start + latest >= now) return std::nullopt;
  const double late_s = std::chrono::duration<double>(now - start).count();
  return CaptureFailure{mission::failure::capture_time_past,
                        fmt::format("the start was {:.3f} s ago", late_s)};
}

std::optional<nanoseconds> CaptureSequence::due() const {
  if (taken_ > 0 && interval_ == nanoseconds(0)) return std::nullopt;
  return taken_ * interval_;
}

void CaptureSequence::on_sound(std::int32_t error_us) {
  ++taken_;
  tries_ = 0;
  const auto magnitude = [](std::int32_t v) { return std::abs(std::int64_t{v}); };
  if (magnitude(error_us) > magnitude(largest_error_us_)) largest_error_us_ = error_us;
}

bool CaptureSequence::on_unsound() {
  return ++tries_ < tries_max;
}

std::int32_t start_error_us(MonotonicTime begin, MonotonicTime due) {
  constexpr std::int64_t most = std::numeric_limits<std::int32_t>::max();
  return static_cast<std::int32_t>(std::clamp((begin - due).count() / 1000, -most, most));
}

}  // namespace srfs
