// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cerrno>

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>

#include "base/fd.hpp"
#include "hw/camera/camera_backends.hpp"
#include "hw/camera/sim_camera_protocol.hpp"
#include "hw/sim/seqpacket.hpp"

namespace srfs::hw {
namespace {

constexpr milliseconds answer_timeout{400};
constexpr int bits_max = 16;

/// hw_sim's camera at the other end of a local socket.
class SimCamera : public Camera {
 public:
  explicit SimCamera(std::filesystem::path path)
      : path_(std::move(path)), buffer_(sim_camera::message_octets) {}

  Result<std::string, CameraFault> open() override {
    close();
    auto connected = connect_seqpacket(path_);
    if (!connected) return Err(CameraFault{CameraFault::Kind::absent, connected.error()});
    socket_ = std::move(*connected);
    const auto reply = ask_settings({});
    if (!reply) return Err(reply.error());
    if (reply->bits < 1 || reply->bits > bits_max || image::refuse_size(reply->width, reply->height))
      return lost(fmt::format("the simulator reports impossible frames: {} x {}, {} bits", reply->width,
                              reply->height, reply->bits));
    frame_.emplace(reply->width, reply->height, reply->bits);
    return fmt::format("simulated sky, {} x {}, {} bits", reply->width, reply->height, reply->bits);
  }

  void close() override {
    socket_.reset();
    frame_.reset();
    settings_.reset();
  }

  Result<void, CameraFault> prepare(const CameraSettings& settings) override {
    if (!frame_) return lost("closed");
    if (settings_ == settings_of(settings)) {
      std::uint8_t octet = 0;
      if (::recv(socket_.get(), &octet, 1, MSG_PEEK | MSG_DONTWAIT) == 0) return lost("unplugged");
      return {};
    }
    const auto reply = ask_settings(settings);
    if (!reply) return Err(reply.error());
    if (!reply->accepted) {
      return Err(CameraFault{
          CameraFault::Kind::bad_setting,
          fmt::format("exposure {} us, gain {} dB", settings.exposure.count(), settings.gain_db)});
    }
    settings_ = settings_of(settings);
    return {};
  }

  Result<void, CameraFault> begin() override {
    if (!frame_) return lost("closed");
    frame_->expect(++number_);
    return send(sim_camera::BeginRequest{number_});
  }

  Result<std::optional<CameraFrame>, CameraFault> take(nanoseconds patience) override {
    if (!frame_) return lost("closed");
    const MonotonicTime until = monotonic_now() + patience;
    while (true) {
      const auto reply = receive(until);
      if (!reply) return Err(reply.error());
      if (!*reply) return std::optional<CameraFrame>{};
      auto taken = frame_->on_reply(**reply);
      if (!taken) return Err(CameraFault{CameraFault::Kind::unsound, std::move(taken.error())});
      if (*taken) return std::move(*taken);
    }
  }

  void abandon() override {
    if (frame_) static_cast<void>(send(sim_camera::AbandonRequest{}));
  }

 private:
  using Settings = std::pair<std::uint32_t, float>;
  static Settings settings_of(const CameraSettings& settings) {
    return {static_cast<std::uint32_t>(settings.exposure.count()), static_cast<float>(settings.gain_db)};
  }

  tl::unexpected<CameraFault> lost(std::string reason) {
    close();
    return Err(CameraFault{CameraFault::Kind::absent, std::move(reason)});
  }

  Result<void, CameraFault> send(const sim_camera::Request& request) {
    const Octets message = sim_camera::encode(request);
    if (::send(socket_.get(), message.data(), message.size(), MSG_NOSIGNAL) < 0)
      return lost("write: " + errno_text(errno));
    return {};
  }

  /// One message. @return nothing when none came until then
  Result<std::optional<sim_camera::Reply>, CameraFault> receive(MonotonicTime until) {
    const nanoseconds left = std::max<nanoseconds>(until - monotonic_now(), nanoseconds(0));
    const timespec wait{.tv_sec = left.count() / 1'000'000'000, .tv_nsec = left.count() % 1'000'000'000};
    pollfd waiting{.fd = socket_.get(), .events = POLLIN, .revents = 0};
    const int ready = ::ppoll(&waiting, 1, &wait, nullptr);
    if (ready < 0 && errno != EINTR) return lost("poll: " + errno_text(errno));
    if (ready <= 0) return std::optional<sim_camera::Reply>{};
    const ssize_t n = ::recv(socket_.get(), buffer_.data(), buffer_.size(), MSG_TRUNC);
    if (n < 0 && (errno == EAGAIN || errno == EINTR)) return std::optional<sim_camera::Reply>{};
    if (n <= 0) return lost("the simulator closed the connection");
    if (static_cast<std::size_t>(n) > buffer_.size()) return lost("message too long");
    auto reply = sim_camera::decode_reply(OctetView(buffer_.data(), static_cast<std::size_t>(n)));
    if (!reply) return lost("malformed message");
    return reply;
  }

  /// Skips what is left of frames that are not awaited any more.
  Result<sim_camera::SettingsReply, CameraFault> ask_settings(const CameraSettings& settings) {
    const auto [exposure_us, gain_db] = settings_of(settings);
    if (const auto sent = send(sim_camera::SettingsRequest{exposure_us, gain_db}); !sent)
      return Err(sent.error());
    const MonotonicTime until = monotonic_now() + answer_timeout;
    while (monotonic_now() < until) {
      const auto reply = receive(until);
      if (!reply) return Err(reply.error());
      if (!*reply) continue;
      if (const auto* answer = std::get_if<sim_camera::SettingsReply>(&**reply)) return *answer;
    }
    return lost("no answer");
  }

  std::filesystem::path path_;
  Octets buffer_;
  Fd socket_;
  std::optional<sim_camera::FrameAssembler> frame_;
  std::optional<Settings> settings_;
  std::uint32_t number_ = 0;
};

}  // namespace

std::unique_ptr<Camera> make_sim_camera(const std::filesystem::path& socket) {
  return std::make_unique<SimCamera>(socket);
}

}  // namespace srfs::hw
