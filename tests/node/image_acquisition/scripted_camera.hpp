// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <functional>
#include <mutex>
#include <thread>

#include "hw/camera/camera.hpp"

namespace srfs::testing_support {

/// The result of the next exposure of a scripted camera.
enum class Shot : std::uint8_t { good, unsound, repeated, silent, unplugged };

/// Shared by the test and the camera, which runs on a worker thread.
class CameraScript {
 public:
  void plug_in(bool there) {
    const std::lock_guard lock(mutex_);
    there_ = there;
  }
  void next(std::initializer_list<Shot> shots) {
    const std::lock_guard lock(mutex_);
    shots_.insert(shots_.end(), shots);
  }
  bool is_there() const {
    const std::lock_guard lock(mutex_);
    return there_;
  }
  Shot take() {
    const std::lock_guard lock(mutex_);
    if (shots_.empty()) return Shot::good;
    const Shot shot = shots_.front();
    shots_.pop_front();
    if (shot == Shot::unplugged) there_ = false;
    return shot;
  }
  void count(const std::string& call) {
    const std::lock_guard lock(mutex_);
    calls_.push_back(call);
  }
  std::vector<std::string> calls() const {
    const std::lock_guard lock(mutex_);
    return calls_;
  }

 private:
  mutable std::mutex mutex_;
  bool there_ = true;
  std::deque<Shot> shots_;
  std::vector<std::string> calls_;
};

/// A camera of 64 x 48 pixels that follows its script.
class ScriptedCamera : public hw::Camera {
 public:
  explicit ScriptedCamera(std::shared_ptr<CameraScript> script) : script_(std::move(script)) {}

  Result<std::string, hw::CameraFault> open() override {
    if (!script_->is_there()) return absent();
    script_->count("open");
    open_ = true;
    return "scripted camera";
  }
  void close() override {
    if (open_) script_->count("close");
    open_ = false;
  }
  Result<void, hw::CameraFault> prepare(const hw::CameraSettings& settings) override {
    if (settings.gain_db > 50)
      return Err(hw::CameraFault{hw::CameraFault::Kind::bad_setting, "gain 50 dB at most"});
    settings_ = settings;
    return {};
  }
  Result<void, hw::CameraFault> begin() override {
    shot_ = script_->take();
    if (!open_ || shot_ == Shot::unplugged) return absent();
    begun_ = monotonic_now();
    return {};
  }
  Result<std::optional<hw::CameraFrame>, hw::CameraFault> take(nanoseconds patience) override {
    if (!open_ || !script_->is_there()) return absent();
    const MonotonicTime done = begun_ + settings_.exposure;
    const nanoseconds left = std::max<nanoseconds>(done - monotonic_now(), nanoseconds(0));
    if (shot_ == Shot::silent || left > patience) {
      std::this_thread::sleep_for(patience);
      return std::optional<hw::CameraFrame>{};
    }
    std::this_thread::sleep_for(left);
    if (shot_ == Shot::unsound)
      return Err(hw::CameraFault{hw::CameraFault::Kind::unsound, "short: 7 octets"});
    if (shot_ != Shot::repeated) ++sequence_;
    hw::CameraFrame frame;
    frame.pixels = image::Grid<std::uint16_t>(64, 48, std::uint16_t{100});
    frame.pixels.at(5, 7) = static_cast<std::uint16_t>(1000 + sequence_);
    frame.bits = 12;
    frame.sequence = sequence_;
    frame.begin = begun_;
    frame.settings = settings_;
    frame.saturation_adu = 4095;
    return std::optional<hw::CameraFrame>(std::move(frame));
  }
  void abandon() override { script_->count("abandon"); }

 private:
  tl::unexpected<hw::CameraFault> absent() {
    open_ = false;
    return Err(hw::CameraFault{hw::CameraFault::Kind::absent, "unplugged"});
  }
  std::shared_ptr<CameraScript> script_;
  bool open_ = false;
  hw::CameraSettings settings_;
  Shot shot_ = Shot::good;
  MonotonicTime begun_;
  std::uint32_t sequence_ = 0;
};

}  // namespace srfs::testing_support
