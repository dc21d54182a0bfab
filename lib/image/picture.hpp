// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "image/frame.hpp"

namespace srfs::image {

/// A small picture of a frame for people: the mean of the pixels under each of its own, bright parts
/// compressed (asinh), the sky dark grey. Pixels without a value count as sky.
/// @param width  px of the picture, at most the frame's
[[nodiscard]] Grid<std::uint8_t> thumbnail(const Plane& pixels, int width);

struct Rectangle {
  int x, y;  ///< first pixel
  int width, height;
};

/// The part of a rectangle that lies within a frame; nothing where none does.
[[nodiscard]] std::optional<Rectangle> within(const Rectangle& wanted, int frame_width, int frame_height);

/// @pre within the frame
[[nodiscard]] Plane cut_out(const Plane& pixels, const Rectangle& rectangle);

}  // namespace srfs::image
