#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/result.hpp"

/// Detection of stars and space debris in frames. Pure: no files, no DDS, no clock.
/// Pixel (0, 0) is the centre of the first pixel of the first row; x goes along the row.
namespace srfs::image {

/// Why a frame, file, method or parameter is refused: ready to print.
struct Refusal {
  std::string reason;
};

/// Larger frames are refused: 100 MP take 2 GB while being worked on.
inline constexpr std::int64_t frame_pixels_max = 100'000'000;

/// A rectangle of values, row by row.
template <class T>
class Grid {
 public:
  Grid() = default;
  Grid(int width, int height, T value = T{})
      : width_(width),
        height_(height),
        cells_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), value) {}

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] bool empty() const { return cells_.empty(); }
  [[nodiscard]] std::size_t size() const { return cells_.size(); }
  [[nodiscard]] bool contains(int x, int y) const { return x >= 0 && y >= 0 && x < width_ && y < height_; }
  [[nodiscard]] T* row(int y) { return cells_.data() + offset(0, y); }
  [[nodiscard]] const T* row(int y) const { return cells_.data() + offset(0, y); }
  [[nodiscard]] T& at(int x, int y) { return cells_[offset(x, y)]; }
  [[nodiscard]] const T& at(int x, int y) const { return cells_[offset(x, y)]; }
  [[nodiscard]] std::vector<T>& cells() { return cells_; }
  [[nodiscard]] const std::vector<T>& cells() const { return cells_; }

 private:
  [[nodiscard]] std::size_t offset(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
  }

  int width_ = 0;
  int height_ = 0;
  std::vector<T> cells_;
};

using Plane = Grid<float>;

/// One image as the camera or a file gave it, in its own units (ADU). A pixel without a value is NaN.
struct Frame {
  Plane pixels;
  /// Distance of neighbouring values; 0 when they are continuous. The least noise there can be follows from
  /// it.
  float step = 0;
  /// Pixels from here on are saturated; without it the detector looks for a plateau.
  std::optional<float> saturation_adu;
};

/// @return why a frame of this size is not taken
[[nodiscard]] std::optional<Refusal> refuse_size(std::int64_t width, std::int64_t height);

}  // namespace srfs::image
