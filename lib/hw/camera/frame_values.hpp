// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "hw/camera/camera.hpp"

namespace srfs::hw {

/// A picture of any units as a camera of 16 bits would have given it: whole values from 0 to 65535 stay,
/// continuous, negative and larger ones are spread over 0 to 65535; pixels without a value become the least.
/// Pure.
[[nodiscard]] CameraFrame to_camera_frame(const image::Frame& picture);

}  // namespace srfs::hw
