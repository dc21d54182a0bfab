// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hw_sim/event_loop.hpp"
#include "hw_sim/gps_receiver.hpp"
#include "hw_sim/pty.hpp"
#include "hw_sim/seqpacket_server.hpp"

namespace srfs::sim {

struct GpsDeviceCounters {
  std::uint64_t pulses = 0;
  std::uint64_t suppressed_pulses = 0;
  std::uint64_t stray_pulses = 0;      ///< false ones, and another receiver's
  std::uint64_t sentences = 0;         ///< times of day, of all messages of a second
  std::uint64_t late_sentences = 0;    ///< not sent: this program was late with them
  std::uint64_t unread_sentences = 0;  ///< dropped because the earlier ones were not read
};

/// Gives a GpsReceiver its pulse socket and its serial port. Thin adapter.
class GpsDevice {
 public:
  using Where = std::function<GpsPosition()>;

  GpsDevice(EventLoop& loop, const GpsSettings& settings, std::unique_ptr<SeqpacketServer> pulse_socket,
            Pty port, std::filesystem::path port_link, Where where, MonotonicTime now);
  ~GpsDevice();
  GpsDevice(const GpsDevice&) = delete;
  GpsDevice& operator=(const GpsDevice&) = delete;

  /// From now on; Error: the serial line could not be plugged in again.
  [[nodiscard]] Result<void, std::string> disturb(const GpsDisturbance& disturbance);
  [[nodiscard]] const GpsReceiver& receiver() const { return receiver_; }
  [[nodiscard]] UtcTime true_utc(MonotonicTime now) const { return true_time().utc(now); }
  [[nodiscard]] const GpsDeviceCounters& counters() const { return counters_; }
  void release_exclusive_hold() {
    if (port_) port_->release_exclusive_hold();
  }

 private:
  [[nodiscard]] TrueTime true_time() const;
  void schedule_pulse(MonotonicTime now);
  void on_pulse(MonotonicTime now);
  void on_stray(MonotonicTime now);
  void on_script(MonotonicTime now);
  void send_edge(MonotonicTime edge, std::uint64_t counter);
  void on_sentences(MonotonicTime now);

  EventLoop& loop_;
  GpsReceiver receiver_;
  TrueTime start_;
  std::unique_ptr<SeqpacketServer> pulse_socket_;
  std::optional<Pty> port_;  ///< none: unplugged
  std::filesystem::path port_link_;
  Where where_;
  EventLoop::Timer pulse_timer_;
  EventLoop::Timer sentence_timer_;
  EventLoop::Timer stray_timer_;
  EventLoop::Timer script_timer_;
  std::vector<MonotonicTime> strays_;  ///< to come, at most two a second
  std::size_t script_done_ = 0;
  MonotonicTime started_;
  GpsPulse next_;
  UtcTime sentence_utc_;
  MonotonicTime sentence_at_;
  GpsDeviceCounters counters_;
};

}  // namespace srfs::sim
