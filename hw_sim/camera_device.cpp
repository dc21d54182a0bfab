// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/camera_device.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/background.hpp"
#include "base/crc32c.hpp"
#include "base/log.hpp"
#include "hw/sim/seqpacket.hpp"

namespace srfs::sim {
namespace {

using namespace hw::sim_camera;

constexpr std::size_t request_octets = 64;
// Of one piece. Counted in turns: one in which this thread was stopped or had no CPU counts once, too.
constexpr int patience_turns = 10;
constexpr milliseconds patience_turn{100};
constexpr double gain_max_db = 48;
constexpr std::uint32_t exposure_max_us = 60'000'000;
constexpr std::size_t truth_stars_max = 100;

Result<Fd, std::string> listen_at(const std::filesystem::path& path) {
  const auto address = hw::unix_address(path);
  if (!address) return Err(address.error());
  Fd listener(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  ::unlink(path.c_str());
  ::fchmod(listener.get(), S_IRUSR | S_IWUSR);  // before bind: what the name gets
  if (!listener ||
      ::bind(listener.get(), reinterpret_cast<const sockaddr*>(&*address), sizeof *address) != 0 ||
      ::listen(listener.get(), 4) != 0)
    return Err(fmt::format("{}: cannot listen: {}", path.string(), errno_text(errno)));
  return listener;
}

OctetView octets_of(const image::Grid<std::uint16_t>& pixels) {
  return {reinterpret_cast<const std::uint8_t*>(pixels.cells().data()),
          pixels.size() * sizeof(std::uint16_t)};
}

}  // namespace

std::optional<CameraMisbehaviour> camera_misbehaviour(const std::string& name) {
  using enum CameraMisbehaviour;
  constexpr std::array names{std::pair("none", none),     std::pair("absent", absent),
                             std::pair("silent", silent), std::pair("short", cut_short),
                             std::pair("torn", torn),     std::pair("repeated", repeated)};
  for (const auto& [known, how] : names) {
    if (name == known) return how;
  }
  return std::nullopt;
}

Result<std::unique_ptr<CameraDevice>, std::string> CameraDevice::create(const std::filesystem::path& socket,
                                                                        const SkyCameraSettings& settings) {
  auto listener = listen_at(socket);
  if (!listener) return Err(listener.error());
  Fd wake(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  if (!wake) return Err("eventfd: " + errno_text(errno));
  return std::unique_ptr<CameraDevice>(
      new CameraDevice(socket, settings, std::move(*listener), std::move(wake)));
}

CameraDevice::CameraDevice(std::filesystem::path socket, const SkyCameraSettings& settings, Fd listener,
                           Fd wake)
    : path_(std::move(socket)),
      settings_(settings),
      start_(monotonic_now()),
      listener_(std::move(listener)),
      wake_(std::move(wake)),
      thread_([this] { run(); }) {}

CameraDevice::~CameraDevice() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  ::eventfd_write(wake_.get(), 1);
  thread_.join();
  ::unlink(path_.c_str());
}

void CameraDevice::set_pose(const CameraPose& pose, MonotonicTime at, double temperature_k) {
  const std::lock_guard lock(mutex_);
  pose_ = pose;
  pose_at_ = at;
  temperature_k_ = temperature_k;
}

void CameraDevice::set_power(bool on) {
  {
    const std::lock_guard lock(mutex_);
    if (std::exchange(has_power_, on) == on) return;
  }
  ::eventfd_write(wake_.get(), 1);
}

void CameraDevice::misbehave(CameraMisbehaviour how, int frames) {
  {
    const std::lock_guard lock(mutex_);
    how_ = how;
    misbehaving_frames_ = frames;
  }
  ::eventfd_write(wake_.get(), 1);
}

void CameraDevice::pass_next() {
  const std::lock_guard lock(mutex_);
  pass_next_ = true;
}

void CameraDevice::set_covered(bool covered) {
  const std::lock_guard lock(mutex_);
  covered_ = covered;
}

nlohmann::json CameraDevice::truth() const {
  const std::lock_guard lock(mutex_);
  if (!truth_) return nullptr;
  nlohmann::json out{{"sequence", truth_sequence_},
                     {"ra_deg", truth_->ra_deg},
                     {"dec_deg", truth_->dec_deg},
                     {"roll_deg", truth_->roll_deg},
                     {"scale_arcsec_px", truth_->scale_arcsec_px},
                     {"star_count", truth_->stars.size()},
                     {"stars", nlohmann::json::array()},
                     {"streaks", nlohmann::json::array()}};
  for (std::size_t i = 0; i < std::min(truth_->stars.size(), truth_stars_max); ++i) {
    const auto& star = truth_->stars[i];
    out["stars"].push_back({{"x", star.x}, {"y", star.y}, {"flux_e", star.flux_e}});
  }
  for (const auto& s : truth_->streaks) {
    out["streaks"].push_back({{"x1", s.x1}, {"y1", s.y1}, {"x2", s.x2}, {"y2", s.y2}, {"flux_e", s.flux_e}});
  }
  return out;
}

nlohmann::json CameraDevice::counters() const {
  const std::lock_guard lock(mutex_);
  return {{"exposures", figures_.exposures}, {"given_up", figures_.given_up},
          {"frames", figures_.frames},       {"misbehaved", figures_.misbehaved},
          {"malformed", figures_.malformed}, {"longest_render_us", figures_.longest_render.count() / 1000}};
}

void CameraDevice::run() {
  // Of this thread. SCHED_IDLE would keep locks from the thread that stands for the hardware.
  [[maybe_unused]] const int ignored = ::nice(background_niceness);
  set_turn(shortest_turn);
  while (true) {
    {
      const std::lock_guard lock(mutex_);
      if (stop_) return;
    }
    turn();
  }
}

void CameraDevice::turn() {
  follow_absence();
  std::optional<nanoseconds> left;
  if (exposure_) {
    const MonotonicTime end = exposure_->begin + microseconds(exposure_->settings.exposure_us);
    left = std::max<nanoseconds>(end - monotonic_now(), nanoseconds(0));
  }
  // A descriptor below zero is passed over.
  std::array<pollfd, 3> waiting{pollfd{wake_.get(), POLLIN, 0}, pollfd{listener_.get(), POLLIN, 0},
                                pollfd{client_.get(), POLLIN, 0}};
  timespec wait{};
  if (left) wait = {.tv_sec = left->count() / 1'000'000'000, .tv_nsec = left->count() % 1'000'000'000};
  const int ready = ::ppoll(waiting.data(), waiting.size(), left ? &wait : nullptr, nullptr);
  const MonotonicTime now = monotonic_now();
  if (ready > 0 && waiting[0].revents != 0) {
    eventfd_t ignored = 0;
    ::eventfd_read(wake_.get(), &ignored);
  }
  if (ready > 0 && waiting[2].revents != 0) read_request();
  if (ready > 0 && waiting[1].revents != 0) {
    Fd client(::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    if (client) {
      client_ = std::move(client);
      exposure_.reset();
    }
  }
  if (exposure_ && now >= exposure_->begin + microseconds(exposure_->settings.exposure_us)) finish();
}

void CameraDevice::follow_absence() {
  bool absent = false;
  {
    const std::lock_guard lock(mutex_);
    absent = how_ == CameraMisbehaviour::absent || !has_power_;
  }
  if (absent == !listener_) return;
  if (absent) {
    ::unlink(path_.c_str());
    listener_.reset();
    client_.reset();
    exposure_.reset();
    return;
  }
  auto listener = listen_at(path_);
  if (listener) {
    listener_ = std::move(*listener);
  } else {
    log::error("camera: {}", listener.error());
    misbehave(CameraMisbehaviour::absent, 0);
  }
}

void CameraDevice::read_request() {
  std::array<std::uint8_t, request_octets> buffer{};
  const ssize_t n = ::recv(client_.get(), buffer.data(), buffer.size(), MSG_DONTWAIT | MSG_TRUNC);
  const MonotonicTime now = monotonic_now();
  if (n < 0 && (errno == EAGAIN || errno == EINTR)) return;
  const auto request = n > 0 && static_cast<std::size_t>(n) <= buffer.size()
                           ? decode_request(OctetView(buffer.data(), static_cast<std::size_t>(n)))
                           : std::nullopt;
  if (!request) {
    const std::lock_guard lock(mutex_);
    figures_.malformed += n > 0 ? 1 : 0;
    figures_.given_up += exposure_ ? 1 : 0;
    client_.reset();
    exposure_.reset();
    return;
  }
  if (const auto* asked = std::get_if<SettingsRequest>(&*request)) {
    const bool possible = asked->exposure_us >= 1 && asked->exposure_us <= exposure_max_us &&
                          asked->gain_db >= 0 && static_cast<double>(asked->gain_db) <= gain_max_db;
    if (possible) asked_ = *asked;
    static_cast<void>(send(SettingsReply{possible, static_cast<std::uint16_t>(settings_.width),
                                         static_cast<std::uint16_t>(settings_.height),
                                         static_cast<std::uint8_t>(settings_.bits)}));
    return;
  }
  if (exposure_) {
    const std::lock_guard lock(mutex_);
    ++figures_.given_up;
  }
  exposure_.reset();
  if (const auto* wanted = std::get_if<BeginRequest>(&*request)) begin(wanted->number, now);
}

void CameraDevice::begin(std::uint32_t number, MonotonicTime at) {
  const std::lock_guard lock(mutex_);
  ++figures_.exposures;
  Exposure exposure{number,         at,    pose_, std::chrono::duration<double>(at - start_).count(),
                    temperature_k_, asked_};
  if (settings_.pointing) {
    exposure.pose = pose_of(*settings_.pointing, exposure.begin_s);
  } else {
    const double since = std::chrono::duration<double>(at - pose_at_).count();
    exposure.pose.attitude = pose_.after(std::clamp(since, 0.0, 1.0));
  }
  exposure_ = exposure;
}

CameraMisbehaviour CameraDevice::next_misbehaviour() {
  const std::lock_guard lock(mutex_);
  if (how_ == CameraMisbehaviour::none || how_ == CameraMisbehaviour::absent) return CameraMisbehaviour::none;
  const CameraMisbehaviour how = how_;
  if (--misbehaving_frames_ <= 0) how_ = CameraMisbehaviour::none;
  ++figures_.misbehaved;
  return how;
}

void CameraDevice::finish() {
  const Exposure exposure = *exposure_;
  exposure_.reset();
  if (!camera_) camera_ = std::make_unique<SkyCamera>(settings_, [this] { let_others_run(); });
  {
    const std::lock_guard lock(mutex_);
    if (std::exchange(pass_next_, false)) camera_->pass_next();
    camera_->set_covered(covered_);
  }
  const MonotonicTime began = monotonic_now();
  const SkyPicture picture =
      camera_->expose(exposure.pose, exposure.begin_s, exposure.settings.exposure_us / 1e6,
                      static_cast<double>(exposure.settings.gain_db));
  const nanoseconds took = monotonic_now() - began;
  ++sequence_;
  {
    const std::lock_guard lock(mutex_);
    truth_ = picture.truth;
    truth_sequence_ = sequence_;
    figures_.longest_render = std::max(figures_.longest_render, took);
  }
  send_frame(exposure, picture, next_misbehaviour());
}

void CameraDevice::send_frame(const Exposure& exposure, const SkyPicture& picture, CameraMisbehaviour how) {
  if (how == CameraMisbehaviour::silent) return;
  FrameHead head;
  head.sequence = sequence_;
  head.begin_ns = static_cast<std::uint64_t>(exposure.begin.ns());
  head.exposure_us = exposure.settings.exposure_us;
  head.gain_db = exposure.settings.gain_db;
  head.temperature_k = static_cast<float>(exposure.temperature_k);
  head.width = static_cast<std::uint16_t>(settings_.width);
  head.height = static_cast<std::uint16_t>(settings_.height);
  head.bits = static_cast<std::uint8_t>(settings_.bits);
  const bool repeated = how == CameraMisbehaviour::repeated && !last_pixels_.empty();
  if (repeated) {
    head.sequence = last_head_.sequence;
    head.crc = last_head_.crc;
  } else {
    last_pixels_.clear();
    const OctetView pixels = octets_of(picture.pixels);
    for (std::size_t at = 0; at < pixels.size(); at += piece_octets) {
      let_others_run();
      const OctetView piece = pixels.subspan(at, std::min(piece_octets, pixels.size() - at));
      head.crc = crc32c(piece, head.crc);
      last_pixels_.insert(last_pixels_.end(), piece.begin(), piece.end());
    }
  }
  if (how == CameraMisbehaviour::torn) {
    const auto half = static_cast<std::ptrdiff_t>(last_pixels_.size() / 2);
    std::rotate(last_pixels_.begin() + half, last_pixels_.end() - std::min<std::ptrdiff_t>(half, 64),
                last_pixels_.end());
  }
  last_head_ = head;
  head.number = exposure.number;
  if (!send(head)) return;
  const std::size_t sent =
      how == CameraMisbehaviour::cut_short ? last_pixels_.size() * 3 / 4 : last_pixels_.size();
  for (std::size_t at = 0; at < sent; at += piece_octets) {
    let_others_run();
    const OctetView piece = OctetView(last_pixels_).subspan(at, std::min(piece_octets, sent - at));
    if (!send(FramePiece{exposure.number, static_cast<std::uint32_t>(at), piece})) return;
  }
  if (!send(FrameEnd{exposure.number})) return;
  const std::lock_guard lock(mutex_);
  ++figures_.frames;
}

/// A client that takes nothing for a second is left.
void CameraDevice::let_others_run() {
  constexpr microseconds longest_hold{200};
  constexpr timespec pause{.tv_sec = 0, .tv_nsec = 50'000};
  if (monotonic_now() - resumed_ < longest_hold) return;
  ::nanosleep(&pause, nullptr);
  resumed_ = monotonic_now();
}

bool CameraDevice::send(const Reply& reply) {
  const Octets message = encode(reply);
  for (int turn = 0; client_ && turn <= patience_turns; ++turn) {
    if (::send(client_.get(), message.data(), message.size(), MSG_DONTWAIT | MSG_NOSIGNAL) >= 0) return true;
    if (errno != EAGAIN && errno != EINTR) break;
    pollfd room{client_.get(), POLLOUT, 0};
    if (::poll(&room, 1, static_cast<int>(patience_turn.count())) < 0 && errno != EINTR) break;
  }
  client_.reset();
  return false;
}

}  // namespace srfs::sim
