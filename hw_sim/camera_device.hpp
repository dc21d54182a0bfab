// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include <nlohmann/json_fwd.hpp>

#include "base/fd.hpp"
#include "base/result.hpp"
#include "hw/camera/sim_camera_protocol.hpp"
#include "hw_sim/sky_camera.hpp"

namespace srfs::sim {

/// What the camera does wrong.
enum class CameraMisbehaviour : std::uint8_t {
  none,
  absent,     ///< unplugged: no socket, until `none`
  silent,     ///< no frame comes
  cut_short,  ///< the last pixels are missing
  torn,       ///< the lower half is another frame's
  repeated,   ///< the frame before once more
};
[[nodiscard]] std::optional<CameraMisbehaviour> camera_misbehaviour(const std::string& name);

/// The simulated camera at its socket (hw/camera/sim_camera_protocol.hpp), on a thread of its own,
/// behind the loop's: a frame takes longer to render than the bus may wait. One client; a new one takes its
/// place. Removes its socket file when destroyed.
class CameraDevice {
 public:
  /// Error: ready to print.
  [[nodiscard]] static Result<std::unique_ptr<CameraDevice>, std::string> create(
      const std::filesystem::path& socket, const SkyCameraSettings& settings);
  ~CameraDevice();
  CameraDevice(const CameraDevice&) = delete;
  CameraDevice& operator=(const CameraDevice&) = delete;

  // From any thread:
  /// The satellite's attitude at @p at, and how warm the camera is.
  void set_pose(const CameraPose& pose, MonotonicTime at, double temperature_k);
  /// Without power it is absent, as if unplugged.
  void set_power(bool on);
  /// @param frames so many frames; `absent` lasts until it is ended
  void misbehave(CameraMisbehaviour how, int frames);
  /// An object crosses the middle of the next frame.
  void pass_next();
  /// With its lens covered, from the next frame on.
  void set_covered(bool covered);
  /// What is on the frame exposed last; null before the first.
  [[nodiscard]] nlohmann::json truth() const;
  [[nodiscard]] nlohmann::json counters() const;

 private:
  struct Exposure {
    std::uint32_t number;
    MonotonicTime begin;
    CameraPose pose;
    double begin_s;
    double temperature_k;
    hw::sim_camera::SettingsRequest settings;
  };
  struct Figures {
    std::uint64_t exposures = 0;
    std::uint64_t given_up = 0;  ///< by the client, or it went
    std::uint64_t frames = 0;    ///< sent
    std::uint64_t misbehaved = 0;
    std::uint64_t malformed = 0;  ///< requests
    nanoseconds longest_render{0};
  };

  CameraDevice(std::filesystem::path socket, const SkyCameraSettings& settings, Fd listener, Fd wake);
  void run();
  void turn();
  void follow_absence();
  void read_request();
  void begin(std::uint32_t number, MonotonicTime at);
  void finish();
  void send_frame(const Exposure& exposure, const SkyPicture& picture, CameraMisbehaviour how);
  [[nodiscard]] bool send(const hw::sim_camera::Reply& reply);
  [[nodiscard]] CameraMisbehaviour next_misbehaviour();
  /// Its session stands for the hardware and goes before all nodes, which must not wait for a picture: a
  /// pause after each longest_hold of work.
  void let_others_run();

  const std::filesystem::path path_;
  const SkyCameraSettings settings_;
  const MonotonicTime start_;

  // The thread's own.
  Fd listener_;
  Fd client_;
  std::unique_ptr<SkyCamera> camera_;  ///< from the first exposure on: it takes 0.2 s to make
  hw::sim_camera::SettingsRequest asked_{100'000, 0};
  std::optional<Exposure> exposure_;
  std::uint32_t sequence_ = 0;
  Octets last_pixels_;
  MonotonicTime resumed_;  ///< after the last pause
  hw::sim_camera::FrameHead last_head_;

  Fd wake_;                   // an event for the thread
  mutable std::mutex mutex_;  // guards the rest
  bool stop_ = false;
  CameraPose pose_;
  MonotonicTime pose_at_;
  double temperature_k_ = 293;
  bool has_power_ = true;
  CameraMisbehaviour how_ = CameraMisbehaviour::none;
  int misbehaving_frames_ = 0;
  bool pass_next_ = false;
  bool covered_ = false;
  std::optional<SkyTruth> truth_;
  std::uint32_t truth_sequence_ = 0;
  Figures figures_;

  std::thread thread_;
};

}  // namespace srfs::sim
