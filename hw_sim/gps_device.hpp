#pragma once

#include <functional>
#include <memory>
#include <string>

#include "hw_sim/event_loop.hpp"
#include "hw_sim/gps_receiver.hpp"
#include "hw_sim/pty.hpp"
#include "hw_sim/seqpacket_server.hpp"

namespace srfs::sim {

struct GpsDeviceCounters {
  std::uint64_t pulses = 0;
  std::uint64_t suppressed_pulses = 0;
  std::uint64_t sentences = 0;         ///< pairs of RMC and ZDA
  std::uint64_t unread_sentences = 0;  ///< thrown away because nobody read those before
};

/// Gives a GpsReceiver its pulse socket and its serial port. Thin adapter.
class GpsDevice {
 public:
  using Where = std::function<GpsPosition()>;

  GpsDevice(EventLoop& loop, const GpsSettings& settings, std::unique_ptr<SeqpacketServer> pulse_socket,
            Pty port, Where where, MonotonicTime now);
  ~GpsDevice();
  GpsDevice(const GpsDevice&) = delete;
  GpsDevice& operator=(const GpsDevice&) = delete;

  [[nodiscard]] GpsReceiver& receiver() { return receiver_; }
  [[nodiscard]] UtcTime true_utc(MonotonicTime now) const { return true_time(now).utc(now); }
  [[nodiscard]] const GpsDeviceCounters& counters() const { return counters_; }
  void release_exclusive_hold() { port_.release_exclusive_hold(); }

 private:
  [[nodiscard]] TrueTime true_time(MonotonicTime now) const;
  void schedule_pulse(MonotonicTime now);
  void on_pulse(MonotonicTime now);
  void on_sentences();

  EventLoop& loop_;
  GpsReceiver receiver_;
  TrueTime start_;
  std::unique_ptr<SeqpacketServer> pulse_socket_;
  Pty port_;
  Where where_;
  EventLoop::Timer pulse_timer_;
  EventLoop::Timer sentence_timer_;
  GpsPulse next_;
  UtcTime sentence_utc_;
  GpsDeviceCounters counters_;
};

}  // namespace srfs::sim
