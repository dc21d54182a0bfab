// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <new>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/result.hpp"
#include "base/time.hpp"

/// Detection of stars and space debris in frames. Pure: no files, no DDS, no clock.
/// Pixel (0, 0) is the centre of the first pixel of the first row; x goes along the row.
namespace srfs::image {

/// Why a frame, file, method or parameter is refused: ready to print.
struct Refusal {
  std::string reason;
};

/// @throws std::bad_alloc
[[nodiscard]] void* allocate_frame_memory(std::size_t octets);

/// Larger frames are refused: 100 MP take 2 GB while being worked on.
inline constexpr std::int64_t frame_pixels_max = 100'000'000;

/// Memory for frames: large blocks ask for large pages (a frame of 2 MP would be 2000 page faults), and what
/// is not given a value has none.
template <class T>
struct FrameAllocator {
  using value_type = T;
  FrameAllocator() = default;
  template <class U>
  explicit FrameAllocator(const FrameAllocator<U>&) {}
  [[nodiscard]] T* allocate(std::size_t n) { return static_cast<T*>(allocate_frame_memory(n * sizeof(T))); }
  void deallocate(T* memory, std::size_t) { std::free(memory); }
  template <class U>
  void construct(U* place) {
    ::new (static_cast<void*>(place)) U;
  }
  template <class U, class... Args>
  void construct(U* place, Args&&... args) {
    ::new (static_cast<void*>(place)) U(std::forward<Args>(args)...);
  }
  friend bool operator==(const FrameAllocator&, const FrameAllocator&) { return true; }
};

/// A rectangle of values, row by row.
template <class T>
class Grid {
 public:
  using Cells = std::vector<T, FrameAllocator<T>>;

  Grid() = default;
  Grid(int width, int height, T value = T{})
      : width_(width), height_(height), cells_(cells_of(width, height), value) {}
  /// Values are to be set before they are read.
  [[nodiscard]] static Grid unset(int width, int height) {
    Grid grid;
    grid.width_ = width;
    grid.height_ = height;
    grid.cells_ = Cells(cells_of(width, height));
    return grid;
  }

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] bool empty() const { return cells_.empty(); }
  [[nodiscard]] std::size_t size() const { return cells_.size(); }
  [[nodiscard]] bool contains(int x, int y) const { return x >= 0 && y >= 0 && x < width_ && y < height_; }
  [[nodiscard]] T* row(int y) { return cells_.data() + offset(0, y); }
  [[nodiscard]] const T* row(int y) const { return cells_.data() + offset(0, y); }
  [[nodiscard]] T& at(int x, int y) { return cells_[offset(x, y)]; }
  [[nodiscard]] const T& at(int x, int y) const { return cells_[offset(x, y)]; }
  [[nodiscard]] Cells& cells() { return cells_; }
  [[nodiscard]] const Cells& cells() const { return cells_; }

 private:
  [[nodiscard]] static std::size_t cells_of(int width, int height) {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
  [[nodiscard]] std::size_t offset(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
  }

  int width_ = 0;
  int height_ = 0;
  Cells cells_;
};

using Plane = Grid<float>;

/// One image as the camera or a file gave it, in its own units (ADU). A pixel without a value is NaN.
struct Frame {
  Plane pixels;
  /// Distance of neighbouring values; 0 when they are continuous. The least noise there can be follows from
  /// it.
  float step = 0;
  /// When its exposure began, on any scale of seconds; nothing when the file does not say.
  std::optional<double> time_s;
  std::optional<double> exposure_s;
  std::optional<double> gain;           ///< the camera's setting, in its own unit
  std::optional<double> temperature_k;  ///< of the sensor
  /// Pixels from here on are saturated; without it the detector looks for a plateau.
  std::optional<float> saturation_adu;
};

/// A frame's time as UTC, to the microsecond; nothing where there is none, or none of 1970 to 2106.
[[nodiscard]] std::optional<UtcTime> utc_of(const std::optional<double>& seconds_since_1970);

/// While it lives, its thread refuses frames of more pixels too: where memory is capped. One at a time a
/// thread.
class FramePixelsLimit {
 public:
  explicit FramePixelsLimit(std::int64_t pixels);
  ~FramePixelsLimit();
  FramePixelsLimit(const FramePixelsLimit&) = delete;
  FramePixelsLimit& operator=(const FramePixelsLimit&) = delete;
};

/// @return why a frame of this size is not taken
[[nodiscard]] std::optional<Refusal> refuse_size(std::int64_t width, std::int64_t height);

}  // namespace srfs::image
