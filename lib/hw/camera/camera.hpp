// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "base/result.hpp"
#include "base/time.hpp"
#include "hw/hw_error.hpp"
#include "image/frame.hpp"

namespace srfs::hw {

struct CameraSettings {
  microseconds exposure{100'000};
  double gain_db = 0;
};

/// One frame as the camera gave it. Values are right-justified: 12 bits are 0 to 4095.
struct CameraFrame {
  image::Grid<std::uint16_t> pixels;
  int bits = 16;                                ///< of a pixel
  std::uint32_t sequence = 0;                   ///< the camera's count of frames
  MonotonicTime begin;                          ///< of the exposure
  CameraSettings settings;                      ///< in force
  std::optional<double> temperature_k;          ///< of the sensor
  std::optional<std::uint16_t> saturation_adu;  ///< this value and above are saturated
  bool may_repeat = false;                      ///< a replay: the same picture twice is no fault
};

struct CameraFault {
  enum class Kind : std::uint8_t {
    absent,       ///< no camera, or it went: close(), open() again
    bad_setting,  ///< it cannot do this exposure or gain
    unsound,      ///< a frame came short or torn: another one may be better
  };
  Kind kind = Kind::absent;
  std::string reason;  ///< for people
};

/// One camera. Every call may block for the time it documents, so all belong to one worker thread; not
/// thread-safe. Closed at first. Order: open, prepare, begin, take until there is a frame or a fault.
class Camera {
 public:
  virtual ~Camera() = default;

  /// Up to 1 s. @return what it is, for people
  [[nodiscard]] virtual Result<std::string, CameraFault> open() = 0;
  /// Gives everything back. Up to 100 ms; no effect when closed.
  virtual void close() = 0;
  /// Before each frame: its exposure and gain, and whatever can be done before the exposure. Up to 500 ms, a
  /// replayed picture as long as it takes to decode.
  [[nodiscard]] virtual Result<void, CameraFault> prepare(const CameraSettings& settings) = 0;
  /// The exposure of the next frame begins now, or as soon as the camera can: the frame states when. At most
  /// 5 ms.
  [[nodiscard]] virtual Result<void, CameraFault> begin() = 0;
  /// The frame begun. Waits for it for up to @p patience. @return nothing when it is not there yet
  [[nodiscard]] virtual Result<std::optional<CameraFrame>, CameraFault> take(nanoseconds patience) = 0;
  /// Forgets the frame begun; none is wanted for now. Up to 100 ms.
  virtual void abandon() = 0;
};

/// "v4l2:/dev/video0" (options: those of V4l2Options, camera_backends.hpp), "sim:run/camera.sock" (the sky of
/// hw_sim) or "dir:FOLDER" (replay of FITS files). Relative paths are relative to @p var_dir.
/// @return the camera, closed; an error when the URI can never work
[[nodiscard]] Result<std::unique_ptr<Camera>, HwError> open_camera(std::string_view uri,
                                                                   const std::filesystem::path& var_dir);

}  // namespace srfs::hw
