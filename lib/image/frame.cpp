// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/frame.hpp"

#include <algorithm>
#include <cmath>

#include <sys/mman.h>

#include <fmt/format.h>

namespace srfs::image {
namespace {

thread_local std::int64_t pixels_most = frame_pixels_max;

}  // namespace

std::optional<UtcTime> utc_of(const std::optional<double>& seconds_since_1970) {
  constexpr double end_s = 4294967296.0;
  const double s = seconds_since_1970.value_or(0);
  if (!(s > 0 && s < end_s)) return std::nullopt;
  const double whole = std::floor(s);
  return UtcTime(seconds(static_cast<std::int64_t>(whole)) + microseconds(std::llround((s - whole) * 1e6)));
}

FramePixelsLimit::FramePixelsLimit(std::int64_t pixels) {
  pixels_most = std::min(pixels, frame_pixels_max);
}
FramePixelsLimit::~FramePixelsLimit() {
  pixels_most = frame_pixels_max;
}

void* allocate_frame_memory(std::size_t octets) {
  constexpr std::size_t page = std::size_t{2} << 20;
  if (octets < page) {
    void* memory = std::malloc(std::max<std::size_t>(1, octets));
    if (memory == nullptr) throw std::bad_alloc();
    return memory;
  }
  if (octets > SIZE_MAX - page) throw std::bad_alloc();
  const std::size_t whole = (octets + page - 1) / page * page;
  void* memory = std::aligned_alloc(page, whole);
  if (memory == nullptr) throw std::bad_alloc();
  madvise(memory, whole, MADV_HUGEPAGE);  // where the kernel has none it is as before
  return memory;
}

std::optional<Refusal> refuse_size(std::int64_t width, std::int64_t height) {
  if (width < 1 || height < 1) return Refusal{fmt::format("{} x {} pixels: no image", width, height)};
  if (width > pixels_most || height > pixels_most || width * height > pixels_most) {
    return Refusal{fmt::format("{} x {} pixels: more than {:.4g} million", width, height,
                               static_cast<double>(pixels_most) / 1e6)};
  }
  return std::nullopt;
}

}  // namespace srfs::image
