// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "hw/camera/camera_backends.hpp"
#include "image/file/frame_file.hpp"

namespace srfs::hw {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t pictures_max = 10'000;

/// The values of a 16-bit FITS file; those below zero become zero.
CameraFrame to_camera_frame(const image::Frame& picture) {
  const auto value = [](float v) { return static_cast<std::uint16_t>(std::clamp(v, 0.0F, 65535.0F)); };
  CameraFrame frame;
  frame.pixels = image::Grid<std::uint16_t>::unset(picture.pixels.width(), picture.pixels.height());
  std::uint16_t all = 0;
  for (std::size_t i = 0; i < picture.pixels.size(); ++i)
    all |= frame.pixels.cells()[i] = value(picture.pixels.cells()[i]);
  frame.bits = all <= 255 ? 8 : 16;
  if (picture.saturation_adu) frame.saturation_adu = value(*picture.saturation_adu);
  frame.may_repeat = true;
  return frame;
}

/// The pictures of a folder in the order of their names, from the start again after the last, as if taken
/// now. The next picture is decoded by prepare(), so that begin() is on time; take() waits for the exposure.
/// What cannot be read is an unsound frame, and passed over.
class FolderCamera : public Camera {
 public:
  explicit FolderCamera(fs::path folder) : folder_(std::move(folder)) {}

  Result<std::string, CameraFault> open() override {
    close();
    std::error_code failed;
    for (fs::directory_iterator at(folder_, failed), end; !failed && at != end; at.increment(failed)) {
      std::error_code unknown;
      if (!at->is_regular_file(unknown) || at->path().filename().string().starts_with('.')) continue;
      if (pictures_.size() == pictures_max) break;
      pictures_.push_back(at->path());
    }
    if (failed) return absent(fmt::format("{}: {}", folder_.string(), failed.message()));
    if (pictures_.empty()) return absent(fmt::format("{}: no pictures", folder_.string()));
    std::sort(pictures_.begin(), pictures_.end());
    next_ %= pictures_.size();
    return fmt::format("{} pictures of {}", pictures_.size(), folder_.string());
  }

  void close() override {
    pictures_.clear();
    ready_.reset();
    begun_.reset();
  }

  Result<void, CameraFault> prepare(const CameraSettings& settings) override {
    if (pictures_.empty()) return absent("closed");
    settings_ = settings;
    return decode();
  }

  Result<void, CameraFault> begin() override {
    if (pictures_.empty()) return absent("closed");
    begun_ = monotonic_now();
    return {};
  }

  Result<std::optional<CameraFrame>, CameraFault> take(nanoseconds patience) override {
    if (pictures_.empty() || !begun_) return absent("no exposure in progress");
    const MonotonicTime now = monotonic_now();
    const MonotonicTime done = *begun_ + settings_.exposure;
    if (done > now) std::this_thread::sleep_for(std::min<nanoseconds>(done - now, patience));
    if (done > now + patience) return std::optional<CameraFrame>{};
    const MonotonicTime begun = *begun_;
    begun_.reset();
    if (const auto decoded = decode(); !decoded) return Err(decoded.error());
    CameraFrame frame = *std::move(ready_);
    ready_.reset();
    frame.begin = begun;
    frame.settings = settings_;
    frame.sequence = ++sequence_;
    return std::optional<CameraFrame>(std::move(frame));
  }

  void abandon() override { begun_.reset(); }

 private:
  static tl::unexpected<CameraFault> absent(std::string reason) {
    return Err(CameraFault{CameraFault::Kind::absent, std::move(reason)});
  }

  Result<void, CameraFault> decode() {
    if (ready_) return {};
    const fs::path& picture = pictures_[next_];
    next_ = (next_ + 1) % pictures_.size();
    try {
      const auto frame = image::read_frame(picture);
      if (!frame) {
        return Err(CameraFault{CameraFault::Kind::unsound,
                               fmt::format("{}: {}", picture.filename().string(), frame.error().reason)});
      }
      ready_ = to_camera_frame(*frame);
    } catch (const std::bad_alloc&) {
      return Err(CameraFault{CameraFault::Kind::unsound,
                             fmt::format("{}: not enough memory", picture.filename().string())});
    }
    return {};
  }

  fs::path folder_;
  std::vector<fs::path> pictures_;
  std::size_t next_ = 0;
  std::optional<CameraFrame> ready_;
  std::optional<MonotonicTime> begun_;
  CameraSettings settings_;
  std::uint32_t sequence_ = 0;
};

}  // namespace

std::unique_ptr<Camera> make_folder_camera(const std::filesystem::path& folder) {
  return std::make_unique<FolderCamera>(folder);
}

}  // namespace srfs::hw
