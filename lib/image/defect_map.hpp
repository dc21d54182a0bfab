// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "image/clean_frame.hpp"

namespace srfs::image {

/// The middle of what surrounds a pixel; nothing where too little of it has a value.
[[nodiscard]] std::optional<float> middle_around(const Plane& pixels, int x, int y);

/// A pixel that is not as its neighbours.
struct Defect {
  enum class Kind : std::uint8_t { hot, dark };
  int x;
  int y;
  Kind kind;
  double level_adu;  ///< beside its neighbours, mean of the frames that show it
  int frames;        ///< that show it
};

/// Pixels that are brighter than the optics could make them, or darker than their neighbours, in frame after
/// frame.
class DefectCount {
 public:
  DefectCount(int width, int height) : hot_(width, height), dark_(width, height), sum_(width, height) {}

  void add(const Frame& frame, const CleanFrame& clean);
  /// @param share  of the frames that have to show a defect
  /// @return the strongest first, at most @p most
  [[nodiscard]] std::vector<Defect> defects(double share, std::size_t most) const;

  [[nodiscard]] int width() const { return hot_.width(); }
  [[nodiscard]] int height() const { return hot_.height(); }
  [[nodiscard]] int frames() const { return frames_; }

 private:
  Grid<std::uint16_t> hot_;  ///< frames in which a pixel was so
  Grid<std::uint16_t> dark_;
  Plane sum_;  ///< ADU beside the neighbours, of those frames
  int frames_ = 0;
};

}  // namespace srfs::image
