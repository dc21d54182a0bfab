// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/gps_device.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "base/log.hpp"

namespace srfs::sim {
namespace {

constexpr milliseconds latest_sentence{500};  // after its time

}  // namespace

GpsDevice::GpsDevice(EventLoop& loop, const GpsSettings& settings,
                     std::unique_ptr<SeqpacketServer> pulse_socket, Pty port, std::filesystem::path port_link,
                     Where where, MonotonicTime now)
    : loop_(loop),
      receiver_(settings),
      start_(now, settings.start.value_or(system_utc_now()), settings.drift_ppm, settings.wander_ppm,
             settings.wander_period),
      pulse_socket_(std::move(pulse_socket)),
      port_(std::move(port)),
      port_link_(std::move(port_link)),
      where_(std::move(where)),
      pulse_timer_(loop.add_timer([this](MonotonicTime t) { on_pulse(t); })),
      sentence_timer_(loop.add_timer([this](MonotonicTime t) { on_sentences(t); })),
      stray_timer_(loop.add_timer([this](MonotonicTime t) { on_stray(t); })),
      script_timer_(loop.add_timer([this](MonotonicTime t) { on_script(t); })),
      started_(now) {
  schedule_pulse(now);
  if (!settings.script.empty()) loop_.set_timer(script_timer_, now + settings.script.front().at);
}

GpsDevice::~GpsDevice() {
  loop_.set_timer(pulse_timer_, std::nullopt);
  loop_.set_timer(sentence_timer_, std::nullopt);
  loop_.set_timer(stray_timer_, std::nullopt);
  loop_.set_timer(script_timer_, std::nullopt);
}

Result<void, std::string> GpsDevice::disturb(const GpsDisturbance& disturbance) {
  receiver_.disturb(disturbance);
  if (disturbance.unplugged) {
    port_.reset();
  } else if (!port_) {
    auto port = Pty::create(port_link_);
    if (!port) return Err(port.error());
    port_.emplace(std::move(*port));
  }
  return {};
}

void GpsDevice::on_script(MonotonicTime now) {
  const auto& script = receiver_.settings().script;
  while (script_done_ < script.size() && started_ + script[script_done_].at <= now) {
    if (const auto done = disturb(script[script_done_].disturbance); !done)
      log::error("gps: {}", done.error());
    ++script_done_;
  }
  if (script_done_ < script.size()) loop_.set_timer(script_timer_, started_ + script[script_done_].at);
}

TrueTime GpsDevice::true_time() const {
  if (receiver_.settings().start) return start_;
  // The host's UTC is the truth and may be slewed or stepped: both clocks are read at nearly one instant, the
  // nearest of a few, since the process may be held up in between.
  std::optional<TrueTime> best;
  nanoseconds tightest = nanoseconds::max();
  for (int i = 0; i < 3; ++i) {
    const MonotonicTime before = monotonic_now();
    const UtcTime utc = system_utc_now();
    const MonotonicTime after = monotonic_now();
    if (after - before >= tightest) continue;
    tightest = after - before;
    best.emplace(before + tightest / 2, utc, 0);
  }
  return *best;
}

void GpsDevice::schedule_pulse(MonotonicTime now) {
  next_ = receiver_.next_pulse(true_time(), now);
  for (const auto& stray : next_.strays) {
    if (stray && *stray > now) strays_.push_back(*stray);
  }
  std::sort(strays_.begin(), strays_.end());
  if (!strays_.empty()) loop_.set_timer(stray_timer_, strays_.front());
  loop_.set_timer(pulse_timer_, next_.edge);
}

void GpsDevice::on_pulse(MonotonicTime now) {
  const GpsPulse pulse = next_;
  // Whether it comes out is decided now, so that a fault takes effect with the next edge.
  if (pulse.emitted && receiver_.fault() == GpsFault::none) {
    send_edge(pulse.edge, pulse.counter);
    ++counters_.pulses;
  } else {
    ++counters_.suppressed_pulses;
  }
  if (pulse.utc.ns() % 1'000'000'000 == 0) {
    sentence_utc_ = pulse.utc;
    sentence_at_ = pulse.edge + receiver_.settings().sentence_delay;
    loop_.set_timer(sentence_timer_, sentence_at_);
  }
  schedule_pulse(now);
}

void GpsDevice::send_edge(MonotonicTime edge, std::uint64_t counter) {
  const std::array<std::uint64_t, 2> datagram{static_cast<std::uint64_t>(edge.ns()), counter};
  pulse_socket_->send_to_all(std::bit_cast<std::array<std::uint8_t, 16>>(datagram));
}

void GpsDevice::on_stray(MonotonicTime now) {
  while (!strays_.empty() && strays_.front() <= now) {
    send_edge(strays_.front(), next_.counter);
    ++counters_.stray_pulses;
    strays_.erase(strays_.begin());
  }
  if (!strays_.empty()) loop_.set_timer(stray_timer_, strays_.front());
}

void GpsDevice::on_sentences(MonotonicTime now) {
  // A pulse carries the time of its edge; a sentence does not, and would be taken for the next pulse's.
  if (now - sentence_at_ > latest_sentence) {
    ++counters_.late_sentences;
    return;
  }
  const Octets message = receiver_.messages(sentence_utc_, where_());
  if (message.empty() || !port_) return;
  // A reader that left a whole second unread is not there; the next one shall not find old seconds.
  if (port_->unread() > 0) {
    port_->discard_unread();
    ++counters_.unread_sentences;
  }
  if (port_->write(message) == message.size()) ++counters_.sentences;
}

}  // namespace srfs::sim
