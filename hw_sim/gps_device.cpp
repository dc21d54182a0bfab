#include "hw_sim/gps_device.hpp"

#include <array>
#include <bit>
#include <cstring>

namespace srfs::sim {

GpsDevice::GpsDevice(EventLoop& loop, const GpsSettings& settings,
                     std::unique_ptr<SeqpacketServer> pulse_socket, Pty port, Where where, MonotonicTime now)
    : loop_(loop),
      receiver_(settings),
      start_(now, settings.start.value_or(system_utc_now()), settings.drift_ppm),
      pulse_socket_(std::move(pulse_socket)),
      port_(std::move(port)),
      where_(std::move(where)),
      pulse_timer_(loop.add_timer([this](MonotonicTime t) { on_pulse(t); })),
      sentence_timer_(loop.add_timer([this](MonotonicTime) { on_sentences(); })) {
  schedule_pulse(now);
}

GpsDevice::~GpsDevice() {
  loop_.set_timer(pulse_timer_, std::nullopt);
  loop_.set_timer(sentence_timer_, std::nullopt);
}

TrueTime GpsDevice::true_time(MonotonicTime now) const {
  if (receiver_.settings().start) return start_;
  // The host's UTC is the truth and may be slewed or stepped: both clocks are read again, at nearly one
  // instant.
  static_cast<void>(now);
  return {monotonic_now(), system_utc_now(), 0};
}

void GpsDevice::schedule_pulse(MonotonicTime now) {
  next_ = receiver_.next_pulse(true_time(now), now);
  loop_.set_timer(pulse_timer_, next_.edge);
}

void GpsDevice::on_pulse(MonotonicTime now) {
  const GpsPulse pulse = next_;
  // Whether it comes out is decided now, so that a fault takes effect with the next edge.
  if (pulse.emitted && receiver_.fault() == GpsFault::none) {
    const std::array<std::uint64_t, 2> datagram{static_cast<std::uint64_t>(pulse.edge.ns()), pulse.counter};
    const auto octets = std::bit_cast<std::array<std::uint8_t, 16>>(datagram);
    pulse_socket_->send_to_all(octets);
    ++counters_.pulses;
  } else {
    ++counters_.suppressed_pulses;
  }
  if (pulse.utc.ns() % 1'000'000'000 == 0) {
    sentence_utc_ = pulse.utc;
    loop_.set_timer(sentence_timer_, pulse.edge + receiver_.settings().sentence_delay);
  }
  schedule_pulse(now);
}

void GpsDevice::on_sentences() {
  const std::string text = receiver_.sentences(sentence_utc_, where_());
  if (text.empty()) return;
  // A reader that left a whole second unread is not there; the next one shall not find old seconds.
  if (port_.unread() > 0) {
    port_.discard_unread();
    ++counters_.unread_sentences;
  }
  const auto* first = reinterpret_cast<const std::uint8_t*>(text.data());
  if (port_.write(OctetView(first, text.size())) == text.size()) ++counters_.sentences;
}

}  // namespace srfs::sim
