// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "hw/camera/camera.hpp"

namespace srfs {

/// Finds frames that are not what was exposed: of another size, from before, or the same once more. Pure.
class FrameCheck {
 public:
  /// @param begun when the exposure was asked for
  /// @return what is wrong with it
  [[nodiscard]] std::optional<std::string> judge(const hw::CameraFrame& frame, MonotonicTime begun);
  /// Another camera, or the same one opened again.
  void forget() { last_.reset(); }

 private:
  struct Last {
    int width;
    int height;
    std::uint32_t sequence;
    std::uint32_t crc;
  };
  std::optional<Last> last_;
};

}  // namespace srfs
