// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>

#include "base/fd.hpp"
#include "hw/camera/camera_backends.hpp"
#include "hw/camera/pixel_format.hpp"

namespace srfs::hw {
namespace {

constexpr std::uint32_t buffers_wanted = 4;
constexpr std::size_t formats_most = 256;  // of a device; the kernel's virtual camera has 70
constexpr std::uint32_t frame_octets_max = 2U * static_cast<std::uint32_t>(image::frame_pixels_max);

int request(int fd, unsigned long code, void* argument) {
  int result = 0;
  do {
    result = ::ioctl(fd, code, argument);
  } while (result < 0 && errno == EINTR);
  return result;
}

/// A driver's buffer, mapped here.
class Mapping {
 public:
  Mapping(int fd, std::size_t length, std::int64_t offset)
      : length_(length), start_(::mmap(nullptr, length, PROT_READ, MAP_SHARED, fd, offset)) {}
  Mapping(Mapping&& other) noexcept
      : length_(other.length_), start_(std::exchange(other.start_, MAP_FAILED)) {}
  Mapping& operator=(Mapping&&) = delete;
  Mapping(const Mapping&) = delete;
  Mapping& operator=(const Mapping&) = delete;
  ~Mapping() {
    if (start_ != MAP_FAILED) ::munmap(start_, length_);
  }
  [[nodiscard]] bool valid() const { return start_ != MAP_FAILED; }
  [[nodiscard]] OctetView octets(std::size_t begin, std::size_t end) const {
    const std::size_t until = std::min(end, length_);
    const std::size_t from = std::min(begin, until);
    return {static_cast<const std::uint8_t*>(start_) + from, until - from};
  }

 private:
  std::size_t length_;
  void* start_;
};

/// A frame's buffer outside the driver; goes back to it.
struct Dequeued {
  v4l2_buffer buffer{};
  std::array<v4l2_plane, 1> planes{};
};

/// A V4L2 capture device by mmap streaming, of one plane (both APIs). It streams from prepare() to abandon():
/// the exposure taken is the first one that starts after begin(), up to one frame's time late, which the
/// frame says. The exposure's begin is the driver's stamp of its start, or of its end less the exposure.
class V4l2Camera : public Camera {
 public:
  V4l2Camera(std::filesystem::path device, const V4l2Options& options)
      : path_(std::move(device)), options_(options) {}
  ~V4l2Camera() override { close(); }
  V4l2Camera(const V4l2Camera&) = delete;
  V4l2Camera& operator=(const V4l2Camera&) = delete;

  Result<std::string, CameraFault> open() override {
    close();
    device_ = Fd(::open(path_.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
    if (!device_) return lost(fmt::format("{}: {}", path_.string(), errno_text(errno)));
    v4l2_capability capability{};
    if (request(device_.get(), VIDIOC_QUERYCAP, &capability) != 0) return failed("query");
    const std::uint32_t can = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? capability.device_caps
                                                                                    : capability.capabilities;
    planes_ = (can & V4L2_CAP_VIDEO_CAPTURE) == 0 && (can & V4L2_CAP_VIDEO_CAPTURE_MPLANE) != 0;
    if ((can & (V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_VIDEO_CAPTURE_MPLANE)) == 0 ||
        (can & V4L2_CAP_STREAMING) == 0)
      return lost(fmt::format("{}: not a streaming capture device", path_.string()));
    if (!options_.controls.empty()) {
      controls_ = Fd(::open(options_.controls.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
      if (!controls_) return lost(fmt::format("{}: {}", options_.controls.string(), errno_text(errno)));
    }
    if (const auto chosen = choose_format(); !chosen) return Err(chosen.error());
    return fmt::format("{}, {} x {}, {}", reinterpret_cast<const char*>(capability.card), width_, height_,
                       format_->name);
  }

  void close() override {
    stop();
    device_.reset();
    controls_.reset();
    format_ = nullptr;
    last_settings_.reset();
  }

  Result<void, CameraFault> prepare(const CameraSettings& settings) override {
    if (format_ == nullptr) return lost("closed");
    if (!last_settings_ || last_settings_->exposure != settings.exposure ||
        last_settings_->gain_db != settings.gain_db) {
      const auto set = apply(settings);
      if (!set) return Err(set.error());
      last_settings_ = settings;
    }
    return streaming_ ? Result<void, CameraFault>{} : start();
  }

  Result<void, CameraFault> begin() override {
    if (!streaming_) return lost("not streaming");
    begun_ = monotonic_now();
    return {};
  }

  Result<std::optional<CameraFrame>, CameraFault> take(nanoseconds patience) override {
    if (!streaming_ || !begun_) return lost("not streaming");
    const MonotonicTime until = monotonic_now() + patience;
    while (true) {
      const auto ready = wait_until(until);
      if (!ready) return Err(ready.error());
      if (!*ready) return std::optional<CameraFrame>{};
      Dequeued taken;
      if (!dequeue(taken)) {
        if (errno == EAGAIN) continue;
        return failed("dequeue");
      }
      auto frame = frame_of(taken);
      if (request(device_.get(), VIDIOC_QBUF, &taken.buffer) != 0) return failed("queue");
      if (!frame) return Err(frame.error());
      if (*frame) {
        begun_.reset();
        return frame;
      }
    }
  }

  void abandon() override { stop(); }

 private:
  [[nodiscard]] std::uint32_t type() const {
    return planes_ ? V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE : V4L2_BUF_TYPE_VIDEO_CAPTURE;
  }

  tl::unexpected<CameraFault> lost(std::string reason) {
    close();
    return Err(CameraFault{CameraFault::Kind::absent, std::move(reason)});
  }
  tl::unexpected<CameraFault> failed(const char* what) {
    return lost(fmt::format("{}: {}: {}", path_.string(), what, errno_text(errno)));
  }

  /// The best of the formats that both sides know.
  Result<void, CameraFault> choose_format() {
    std::vector<std::uint32_t> offered;
    v4l2_fmtdesc description{};
    description.type = type();
    for (; offered.size() < formats_most && request(device_.get(), VIDIOC_ENUM_FMT, &description) == 0;
         ++description.index)
      offered.push_back(description.pixelformat);
    for (const PixelFormat& format : pixel_formats()) {
      if (options_.format != nullptr && options_.format != &format) continue;
      if (std::find(offered.begin(), offered.end(), format.fourcc) == offered.end()) continue;
      if (set_format(format)) return {};
    }
    const std::string_view wanted =
        options_.format != nullptr ? options_.format->name : "monochrome or Bayer, in whole frames";
    return lost(fmt::format("{}: none of its {} formats is {}", path_.string(), offered.size(), wanted));
  }

  bool set_format(const PixelFormat& format) {
    v4l2_format wanted{};
    wanted.type = type();
    if (request(device_.get(), VIDIOC_G_FMT, &wanted) != 0) return false;
    if (planes_) {
      wanted.fmt.pix_mp.pixelformat = format.fourcc;
      wanted.fmt.pix_mp.num_planes = 1;
      wanted.fmt.pix_mp.field = V4L2_FIELD_NONE;
      if (options_.width != 0) wanted.fmt.pix_mp.width = options_.width;
      if (options_.height != 0) wanted.fmt.pix_mp.height = options_.height;
      wanted.fmt.pix_mp.plane_fmt[0] = {};
    } else {
      wanted.fmt.pix.pixelformat = format.fourcc;
      wanted.fmt.pix.field = V4L2_FIELD_NONE;
      if (options_.width != 0) wanted.fmt.pix.width = options_.width;
      if (options_.height != 0) wanted.fmt.pix.height = options_.height;
      wanted.fmt.pix.bytesperline = 0;
      wanted.fmt.pix.sizeimage = 0;
    }
    if (request(device_.get(), VIDIOC_S_FMT, &wanted) != 0) return false;
    const bool kept =
        planes_ ? wanted.fmt.pix_mp.pixelformat == format.fourcc && wanted.fmt.pix_mp.num_planes == 1
                : wanted.fmt.pix.pixelformat == format.fourcc;
    const std::uint32_t width = planes_ ? wanted.fmt.pix_mp.width : wanted.fmt.pix.width;
    const std::uint32_t height = planes_ ? wanted.fmt.pix_mp.height : wanted.fmt.pix.height;
    const std::uint32_t field = planes_ ? wanted.fmt.pix_mp.field : wanted.fmt.pix.field;
    const bool whole = field == V4L2_FIELD_NONE || field == V4L2_FIELD_ANY;  // no half pictures
    if (!kept || !whole || image::refuse_size(width, height)) return false;
    width_ = static_cast<int>(width);
    height_ = static_cast<int>(height);
    row_step_ = planes_ ? wanted.fmt.pix_mp.plane_fmt[0].bytesperline : wanted.fmt.pix.bytesperline;
    row_step_ = std::max(row_step_, row_octets(format, width_));
    format_ = &format;
    return true;
  }

  Result<void, CameraFault> apply(const CameraSettings& settings) {
    // Cameras without automatic exposure have no such control.
    static_cast<void>(set_control(V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL));
    static_cast<void>(set_control(V4L2_CID_AUTOGAIN, 0));
    if (const Set exposed = set_exposure(settings.exposure); exposed != Set::done)
      return bad_setting("exposure", exposed);
    Set gained = set_control(V4L2_CID_ANALOGUE_GAIN, settings.gain_db / options_.gain_step_db);
    if (gained == Set::no_control)
      gained = set_control(V4L2_CID_GAIN, settings.gain_db / options_.gain_step_db);
    if (gained == Set::no_control && settings.gain_db == 0) gained = Set::done;
    if (gained != Set::done) return bad_setting("gain", gained);
    return {};
  }

  enum class Set : std::uint8_t { done, no_control, out_of_range, refused };

  Set set_exposure(microseconds exposure) {
    if (options_.fixed_exposure > microseconds(0))
      return exposure == options_.fixed_exposure ? Set::done : Set::out_of_range;
    const auto exposure_us = static_cast<double>(exposure.count());
    return options_.line_us > 0 ? set_control(V4L2_CID_EXPOSURE, exposure_us / options_.line_us)
                                : set_control(V4L2_CID_EXPOSURE_ABSOLUTE, exposure_us / 100);
  }

  static tl::unexpected<CameraFault> bad_setting(const char* what, Set how) {
    const char* const why = how == Set::no_control     ? "has no control"
                            : how == Set::out_of_range ? "is out of the camera's range"
                                                       : "is refused by the driver";
    return Err(CameraFault{CameraFault::Kind::bad_setting, fmt::format("{} {}", what, why)});
  }

  Set set_control(std::uint32_t id, double value) {
    v4l2_queryctrl range{};
    range.id = id;
    const int fd = controls_ ? controls_.get() : device_.get();
    if (request(fd, VIDIOC_QUERYCTRL, &range) != 0 || (range.flags & V4L2_CTRL_FLAG_DISABLED) != 0)
      return Set::no_control;
    const double rounded = std::round(value);
    if (rounded < range.minimum || rounded > range.maximum) return Set::out_of_range;
    v4l2_control control{.id = id, .value = static_cast<std::int32_t>(rounded)};
    return request(fd, VIDIOC_S_CTRL, &control) == 0 ? Set::done : Set::refused;
  }

  Result<void, CameraFault> start() {
    v4l2_requestbuffers wanted{};
    wanted.count = buffers_wanted;
    wanted.type = type();
    wanted.memory = V4L2_MEMORY_MMAP;
    if (request(device_.get(), VIDIOC_REQBUFS, &wanted) != 0) return failed("request buffers");
    if (wanted.count == 0) return lost(fmt::format("{}: no buffers", path_.string()));
    for (std::uint32_t i = 0; i < std::min(wanted.count, VIDEO_MAX_FRAME + 0U); ++i) {
      Dequeued made;
      describe(made, i);
      if (request(device_.get(), VIDIOC_QUERYBUF, &made.buffer) != 0) return failed("query buffer");
      const std::size_t length = planes_ ? made.planes[0].length : made.buffer.length;
      const std::int64_t offset = planes_ ? made.planes[0].m.mem_offset : made.buffer.m.offset;
      if (length == 0 || length > frame_octets_max) return lost(fmt::format("buffers of {} octets", length));
      mappings_.emplace_back(device_.get(), length, offset);
      if (!mappings_.back().valid()) return failed("map");
      if (request(device_.get(), VIDIOC_QBUF, &made.buffer) != 0) return failed("queue");
    }
    int stream = static_cast<int>(type());
    if (request(device_.get(), VIDIOC_STREAMON, &stream) != 0) return failed("start the stream");
    streaming_ = true;
    sequence_base_ = last_sequence_ + 1;
    return {};
  }

  void stop() {
    if (device_ && streaming_) {
      int stream = static_cast<int>(type());
      request(device_.get(), VIDIOC_STREAMOFF, &stream);
    }
    const bool had_buffers = !mappings_.empty();
    mappings_.clear();
    if (device_ && had_buffers) {
      v4l2_requestbuffers none{};
      none.type = type();
      none.memory = V4L2_MEMORY_MMAP;
      request(device_.get(), VIDIOC_REQBUFS, &none);
    }
    streaming_ = false;
    begun_.reset();
  }

  void describe(Dequeued& buffer, std::uint32_t index) const {
    buffer.buffer = {};
    buffer.buffer.index = index;
    buffer.buffer.type = type();
    buffer.buffer.memory = V4L2_MEMORY_MMAP;
    if (!planes_) return;
    buffer.buffer.m.planes = buffer.planes.data();
    buffer.buffer.length = 1;
  }

  bool dequeue(Dequeued& taken) {
    describe(taken, 0);
    return request(device_.get(), VIDIOC_DQBUF, &taken.buffer) == 0;
  }

  /// @return whether a buffer can be taken
  Result<bool, CameraFault> wait_until(MonotonicTime until) {
    const nanoseconds left = std::max<nanoseconds>(until - monotonic_now(), nanoseconds(0));
    const timespec wait{.tv_sec = left.count() / 1'000'000'000, .tv_nsec = left.count() % 1'000'000'000};
    pollfd waiting{.fd = device_.get(), .events = POLLIN, .revents = 0};
    const int ready = ::ppoll(&waiting, 1, &wait, nullptr);
    if (ready < 0 && errno != EINTR) return failed("poll");
    if (ready > 0 && (waiting.revents & (POLLHUP | POLLNVAL)) != 0)
      return lost(fmt::format("{}: unplugged", path_.string()));
    if (ready > 0 && (waiting.revents & POLLERR) != 0)
      return lost(fmt::format("{}: the stream failed", path_.string()));
    return ready > 0;
  }

  /// @return nothing for a frame whose exposure began before begin()
  Result<std::optional<CameraFrame>, CameraFault> frame_of(const Dequeued& taken) {
    const v4l2_buffer& buffer = taken.buffer;
    if (buffer.index >= mappings_.size()) return lost("the driver returned an unknown buffer");
    const MonotonicTime begin = begin_of(buffer);
    if (begin < *begun_) return std::optional<CameraFrame>{};
    const auto unsound = [](std::string why) {
      return Err(CameraFault{CameraFault::Kind::unsound, std::move(why)});
    };
    if ((buffer.flags & V4L2_BUF_FLAG_ERROR) != 0) return unsound("torn: marked by the driver");
    const std::size_t begin_octet = planes_ ? taken.planes[0].data_offset : 0;
    const std::size_t used = planes_ ? taken.planes[0].bytesused : buffer.bytesused;
    CameraFrame frame;
    frame.pixels = image::Grid<std::uint16_t>::unset(width_, height_);
    if (!unpack_pixels(*format_, mappings_[buffer.index].octets(begin_octet, used), row_step_, frame.pixels))
      return unsound(fmt::format("short: {} octets", used));
    frame.bits = format_->bits;
    frame.saturation_adu = static_cast<std::uint16_t>((1U << format_->bits) - 1);
    // A driver begins at 0 with each stream.
    last_sequence_ = sequence_base_ + buffer.sequence;
    frame.sequence = last_sequence_;
    frame.begin = begin;
    frame.settings = last_settings_.value_or(CameraSettings{});
    return std::optional<CameraFrame>(std::move(frame));
  }

  [[nodiscard]] MonotonicTime begin_of(const v4l2_buffer& buffer) const {
    const nanoseconds exposure = last_settings_ ? nanoseconds(last_settings_->exposure) : nanoseconds(0);
    const MonotonicTime arrival = monotonic_now();
    if ((buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) != V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC)
      return arrival - exposure;
    // Some drivers reckon the end of a frame ahead of it.
    const MonotonicTime stamp = std::min(
        arrival, MonotonicTime(seconds(buffer.timestamp.tv_sec) + microseconds(buffer.timestamp.tv_usec)));
    const bool of_start = (buffer.flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
    return of_start ? stamp : stamp - exposure;
  }

  std::filesystem::path path_;
  V4l2Options options_;
  Fd device_;
  Fd controls_;  ///< none: the device has them
  bool planes_ = false;
  const PixelFormat* format_ = nullptr;  ///< none: closed
  int width_ = 0;
  int height_ = 0;
  std::size_t row_step_ = 0;
  std::vector<Mapping> mappings_;
  bool streaming_ = false;
  std::uint32_t sequence_base_ = 0;  ///< of the stream's frames
  std::uint32_t last_sequence_ = 0;
  std::optional<CameraSettings> last_settings_;
  std::optional<MonotonicTime> begun_;
};

}  // namespace

std::unique_ptr<Camera> make_v4l2_camera(const std::filesystem::path& device, const V4l2Options& options) {
  return std::make_unique<V4l2Camera>(device, options);
}

}  // namespace srfs::hw
