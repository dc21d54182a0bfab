// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_acquisition/frame_check.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "base/crc32c.hpp"

namespace srfs {
namespace {

constexpr nanoseconds clock_slack = milliseconds(2);  // a driver's stamp against our clock

/// A dark sensor or a lamp gives the same everywhere, which may well come twice.
bool is_uniform(const hw::CameraFrame& frame) {
  const auto& cells = frame.pixels.cells();
  return std::all_of(cells.begin(), cells.end(), [&](std::uint16_t v) { return v == cells.front(); });
}

}  // namespace

std::optional<std::string> FrameCheck::judge(const hw::CameraFrame& frame, MonotonicTime begun) {
  if (frame.pixels.empty()) return "a frame without pixels";
  const auto& cells = frame.pixels.cells();
  const OctetView octets(reinterpret_cast<const std::uint8_t*>(cells.data()),
                         cells.size() * sizeof(std::uint16_t));
  const Last now{frame.pixels.width(), frame.pixels.height(), frame.sequence,
                 frame.may_repeat ? 0 : crc32c(octets)};
  const std::optional<Last> before = last_;
  if (frame.begin + clock_slack < begun) return "a frame older than its exposure";
  last_ = now;
  if (!before || frame.may_repeat) return std::nullopt;
  if (before->width != now.width || before->height != now.height) {
    return fmt::format("a frame of {} x {} pixels after {} x {}", now.width, now.height, before->width,
                       before->height);
  }
  if (before->sequence == now.sequence) return fmt::format("frame {} received twice", now.sequence);
  if (before->crc == now.crc && !is_uniform(frame))
    return fmt::format("frame {} has the pixels of frame {}", now.sequence, before->sequence);
  return std::nullopt;
}

}  // namespace srfs
