#include "hw_sim/bus_arbiter.hpp"

#include <algorithm>
#include <bitset>
#include <cassert>
#include <utility>

namespace srfs::sim {
namespace {

constexpr unsigned tail_bits = 1 + 2 + 7 + 3;  // CRC delimiter, acknowledgement, end of frame, intermission
// An error in the middle of a frame: error flag (up to 12 superposed), delimiter 8, intermission 3.
constexpr unsigned error_frame_bits = 12 + 8 + 3;

/// Counts the bits from start of frame to CRC sequence, stuff bits included, and runs the CRC-15 of ISO
/// 11898-1 on the way.
class BitCounter {
 public:
  void put(std::uint32_t value, unsigned width) {
    for (unsigned i = width; i-- > 0;) bit((value >> i & 1U) != 0, true);
  }
  void put_crc() {
    const std::uint16_t crc = crc_;
    for (unsigned i = 15; i-- > 0;) bit((crc >> i & 1U) != 0, false);
  }
  [[nodiscard]] unsigned count() const { return count_; }

 private:
  void bit(bool value, bool in_crc) {
    if (in_crc) {
      const bool invert = value != ((crc_ >> 14U & 1U) != 0);
      crc_ = static_cast<std::uint16_t>(crc_ << 1U & 0x7FFFU);
      if (invert) crc_ ^= 0x4599U;
    }
    ++count_;
    run_ = value == last_ ? run_ + 1 : 1;
    last_ = value;
    if (run_ == 5) {  // a stuff bit of the other value follows, and counts as the first of the next run
      ++count_;
      last_ = !value;
      run_ = 1;
    }
  }
  std::uint16_t crc_ = 0;
  unsigned count_ = 0;
  unsigned run_ = 0;
  bool last_ = true;  // the bus is recessive before the start of frame
};

bool is_valid(const BusFrame& frame) {
  return frame.size <= 8 && frame.id < (frame.extended ? 1U << 29U : 1U << 11U);
}

}  // namespace

unsigned bits_on_wire(const BusFrame& frame) {
  BitCounter bits;
  bits.put(0, 1);  // start of frame
  if (frame.extended) {
    bits.put(frame.id >> 18U, 11);
    bits.put(0b11, 2);  // SRR, IDE
    bits.put(frame.id & 0x3FFFFU, 18);
    bits.put(frame.remote ? 1 : 0, 1);
    bits.put(0, 2);  // r1, r0
  } else {
    bits.put(frame.id, 11);
    bits.put(frame.remote ? 1 : 0, 1);
    bits.put(0, 2);  // IDE, r0
  }
  bits.put(frame.size, 4);
  if (!frame.remote) {
    for (std::size_t i = 0; i < frame.size; ++i) bits.put(frame.data[i], 8);
  }
  bits.put_crc();
  return bits.count() + tail_bits;
}

std::uint32_t arbitration_key(const BusFrame& frame) {
  const std::uint32_t rtr = frame.remote ? 1 : 0;
  // Base identifier, then RTR or SRR, then IDE, then (extended) the 18 low bits and RTR: 32 bits.
  if (!frame.extended) return frame.id << 21U | rtr << 20U;
  return (frame.id >> 18U) << 21U | 1U << 20U | 1U << 19U | (frame.id & 0x3FFFFU) << 1U | rtr;
}

BusArbiter::BusArbiter(std::uint32_t bit_rate, std::size_t queue_capacity, std::uint64_t seed)
    : bit_rate_(bit_rate), queue_capacity_(queue_capacity), random_(seed) {
  assert(bit_rate >= 10'000 && bit_rate <= 1'000'000);
  assert(queue_capacity > 0);
}

BusClient BusArbiter::add_client() {
  const BusClient client = next_client_++;
  queues_[client];
  return client;
}

void BusArbiter::remove_client(BusClient client) {
  const auto queue = queues_.find(client);
  if (queue == queues_.end()) return;
  counters_.discarded += queue->second.size();
  queues_.erase(queue);
}

Submission BusArbiter::submit(BusClient client, const BusFrame& frame, MonotonicTime now) {
  const auto queue = queues_.find(client);
  assert(queue != queues_.end());
  if (!is_valid(frame)) {
    ++counters_.refused_invalid;
    return Submission::invalid;
  }
  if (queue->second.size() == queue_capacity_) {
    ++counters_.refused_full;
    return Submission::queue_full;
  }
  ++counters_.submitted;
  queue->second.push_back({.frame = frame, .order = next_order_++});
  if (!on_wire_) start_next(now);
  return Submission::queued;
}

std::optional<BusDelivery> BusArbiter::advance(MonotonicTime now) {
  while (on_wire_ && on_wire_->end <= now) {
    const OnWire done = *std::exchange(on_wire_, std::nullopt);
    counters_.busy += done.end - done.start;
    if (done.error) {
      ++counters_.error_frames;
      const auto queue = queues_.find(done.client);
      if (queue == queues_.end()) {
        ++counters_.discarded;
      } else {
        queue->second.push_front(
            done.waiting);  // the controller tries again; it takes part in the next arbitration
      }
      start_next(done.end);
      continue;
    }
    const bool muted = faults_.muted.contains(static_cast<std::uint8_t>(done.waiting.frame.id));
    BusDelivery delivery{.sender = done.client,
                         .frame = done.waiting.frame,
                         .original = done.waiting.frame,
                         .lost = muted || draw(faults_.loss_probability),
                         .corrupted = false,
                         .start = done.start,
                         .end = done.end};
    if (delivery.frame.size > 0 && draw(faults_.corruption_probability)) {
      const std::uint64_t bit = random_() % (std::uint64_t{8} * delivery.frame.size);
      delivery.frame.data[bit / 8] =
          static_cast<std::uint8_t>(delivery.frame.data[bit / 8] ^ 1U << (bit % 8));
      delivery.corrupted = true;
      ++counters_.corrupted;
    }
    ++(muted ? counters_.muted : delivery.lost ? counters_.lost : counters_.delivered);
    start_next(done.end);
    return delivery;
  }
  return std::nullopt;
}

std::optional<MonotonicTime> BusArbiter::next_deadline() const {
  if (!on_wire_) return std::nullopt;
  return on_wire_->end;
}

std::size_t BusArbiter::waiting(BusClient client) const {
  const auto queue = queues_.find(client);
  return queue == queues_.end() ? 0 : queue->second.size();
}

nanoseconds BusArbiter::time_on_wire(const BusFrame& frame) const {
  return nanoseconds(std::int64_t{1'000'000'000} * bits_on_wire(frame) / bit_rate_);
}

void BusArbiter::start_next(MonotonicTime earliest) {
  auto winner = queues_.end();
  const auto rank = [](const Waiting& w) { return std::pair(arbitration_key(w.frame), w.order); };
  for (auto candidate = queues_.begin(); candidate != queues_.end(); ++candidate) {
    if (candidate->second.empty()) continue;
    if (winner == queues_.end() || rank(candidate->second.front()) < rank(winner->second.front()))
      winner = candidate;
  }
  if (winner == queues_.end()) return;
  const Waiting waiting = winner->second.front();
  winner->second.pop_front();
  nanoseconds duration = time_on_wire(waiting.frame);
  const bool error = draw(faults_.bit_error_probability);
  if (error)
    duration = duration / 2 + nanoseconds(std::int64_t{1'000'000'000} * error_frame_bits / bit_rate_);
  const MonotonicTime start = earliest + faults_.extra_delay;
  on_wire_ = OnWire{
      .client = winner->first, .waiting = waiting, .start = start, .end = start + duration, .error = error};
}

bool BusArbiter::draw(double probability) {
  if (probability <= 0) return false;
  return std::uniform_real_distribution<double>(0, 1)(random_) < probability;
}

}  // namespace srfs::sim
