// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/bus_arbiter.hpp"

#include <algorithm>
#include <cassert>
#include <utility>

#include "wire/can_bits.hpp"
#include "wire/can_data_frame.hpp"

namespace srfs::sim {
namespace {

// An error in the middle of a frame: error flag (up to 12 superposed), delimiter 8, intermission 3.
constexpr unsigned error_frame_bits = 12 + 8 + 3;

constexpr BusClient babbler = 0;  // no client's number

std::uint32_t arbitration_of(const BusFrame& frame) {
  return wire::arbitration_value(frame.id, frame.extended, frame.remote);
}

bool is_valid(const BusFrame& frame) {
  return frame.size <= 8 && frame.id < (frame.extended ? 1U << 29U : 1U << 11U);
}

}  // namespace

unsigned bits_on_wire(const BusFrame& frame) {
  return wire::can_bits_on_wire({.id = frame.id,
                                 .extended = frame.extended,
                                 .remote = frame.remote,
                                 .size = frame.size,
                                 .data = frame.data});
}

BusArbiter::BusArbiter(std::uint32_t bit_rate, std::size_t queue_capacity, std::uint64_t seed)
    : bit_rate_(bit_rate), queue_capacity_(queue_capacity), random_(seed) {
  assert(bit_rate >= 10'000 && bit_rate <= 1'000'000);
  assert(queue_capacity > 0);
}

BusStation BusArbiter::add_station() {
  const BusStation station = next_station_++;
  stations_[station];
  return station;
}

BusClient BusArbiter::add_client(std::optional<BusStation> station) {
  const BusClient client = next_client_++;
  queues_[client];
  const BusStation of = station ? *station : add_station();
  stations_of_[client] = of;
  if (!station) stations_.at(of).goes_with_client = true;
  return client;
}

void BusArbiter::remove_client(BusClient client) {
  const auto queue = queues_.find(client);
  if (queue == queues_.end()) return;
  counters_.discarded += queue->second.size();
  queues_.erase(queue);
  const BusStation station = station_of(client);
  stations_of_.erase(client);
  if (stations_.at(station).goes_with_client) stations_.erase(station);
}

Submission BusArbiter::submit(BusClient client, const BusFrame& frame, MonotonicTime now) {
  const auto queue = queues_.find(client);
  assert(queue != queues_.end());
  if (!is_valid(frame)) {
    ++counters_.refused_invalid;
    return Submission::invalid;
  }
  if (controller(station_of(client)).state() == ErrorState::bus_off) {
    ++counters_.refused_bus_off;
    return Submission::bus_off;
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
  while (true) {
    restart_stations(on_wire_ ? std::min(now, on_wire_->end) : now);
    if (!on_wire_ && babble_ && babble_at_ <= now) start_next(babble_at_);
    if (!on_wire_ || on_wire_->end > now) return std::nullopt;
    const OnWire done = *std::exchange(on_wire_, std::nullopt);
    counters_.busy += done.end - done.start;
    const auto delivery = finish(done);
    if (!on_wire_) start_next(done.end);
    if (delivery) return delivery;
  }
}

std::optional<BusDelivery> BusArbiter::finish(const OnWire& done) {
  if (done.destroyed) {
    ++counters_.lost_in_bus_off;
    return std::nullopt;
  }
  if (done.error) {
    on_error(done);
    return std::nullopt;
  }
  on_success(done.client);
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
    delivery.frame.data[bit / 8] = static_cast<std::uint8_t>(delivery.frame.data[bit / 8] ^ 1U << (bit % 8));
    delivery.corrupted = true;
    ++counters_.corrupted;
  }
  ++(muted ? counters_.muted : delivery.lost ? counters_.lost : counters_.delivered);
  return delivery;
}

void BusArbiter::on_error(const OnWire& done) {
  ++counters_.error_frames;
  const auto sender = stations_of_.find(done.client);
  for (auto& [station, state] : stations_) {
    const bool transmitting = sender != stations_of_.end() && sender->second == station;
    if (state.errors.state() == ErrorState::bus_off) continue;
    report(station, ControllerReport::Kind::error, transmitting);
    change_errors(station, [transmitting](FaultConfinement& errors) {
      transmitting ? errors.on_transmit_error() : errors.on_receive_error();
    });
  }
  const auto queue = queues_.find(done.client);
  if (queue == queues_.end()) {
    if (done.client != babbler) ++counters_.discarded;
    return;
  }
  // The controller tries again; it takes part in the next arbitration.
  queue->second.push_front(done.waiting);
  if (controller(sender->second).state() == ErrorState::bus_off) enter_bus_off(sender->second, done.end);
}

void BusArbiter::on_success(BusClient sender_client) {
  const auto sender = stations_of_.find(sender_client);
  for (auto& [station, state] : stations_) {
    const bool transmitting = sender != stations_of_.end() && sender->second == station;
    if (state.errors.state() == ErrorState::bus_off) continue;
    change_errors(station, [transmitting](FaultConfinement& errors) {
      transmitting ? errors.on_transmitted() : errors.on_received();
    });
  }
}

template <class Change>
void BusArbiter::change_errors(BusStation station, Change change) {
  FaultConfinement& errors = stations_.at(station).errors;
  const ErrorState before = errors.state();
  change(errors);
  // Bus-off is reported with its consequences.
  if (errors.state() != before && errors.state() != ErrorState::bus_off)
    report(station, ControllerReport::Kind::state);
}

void BusArbiter::report(BusStation station, ControllerReport::Kind kind, bool was_transmitting) {
  constexpr std::size_t most_reports = 256;
  if (reports_.size() == most_reports) return;
  const FaultConfinement& errors = controller(station);
  reports_.push_back({.station = station,
                      .kind = kind,
                      .state = errors.state(),
                      .transmit_errors = errors.transmit_errors(),
                      .receive_errors = errors.receive_errors(),
                      .was_transmitting = was_transmitting});
}

void BusArbiter::force_bus_off(BusStation station, MonotonicTime now) {
  if (controller(station).state() == ErrorState::bus_off) return;
  stations_.at(station).errors.force_bus_off();
  if (on_wire_) {
    const auto sender = stations_of_.find(on_wire_->client);
    if (sender != stations_of_.end() && sender->second == station) on_wire_->destroyed = true;
  }
  enter_bus_off(station, now);
}

void BusArbiter::enter_bus_off(BusStation station, MonotonicTime now) {
  ++counters_.bus_off;
  for (auto& [client, queue] : queues_) {
    if (station_of(client) != station) continue;
    counters_.lost_in_bus_off += queue.size();
    queue.clear();
  }
  report(station, ControllerReport::Kind::bus_off);
  if (automatic_restart_) request_restart(station, now + *automatic_restart_);
}

void BusArbiter::request_restart(BusStation station, MonotonicTime now) {
  Station& state = stations_.at(station);
  if (state.errors.state() != ErrorState::bus_off) return;
  const MonotonicTime at =
      now + nanoseconds(std::int64_t{1'000'000'000} * FaultConfinement::recovery_bits / bit_rate_);
  state.restart_at = std::min(at, state.restart_at.value_or(at));
}

void BusArbiter::restart_stations(MonotonicTime now) {
  for (auto& [station, state] : stations_) {
    if (!state.restart_at || *state.restart_at > now) continue;
    state.restart_at.reset();
    state.errors.restart();
    ++counters_.restarts;
    report(station, ControllerReport::Kind::restarted);
  }
}

std::size_t BusArbiter::withdraw(BusClient client) {
  auto& queue = queues_.at(client);
  counters_.withdrawn += queue.size();
  queue.clear();
  return on_wire_ && on_wire_->client == client && !on_wire_->destroyed ? 1 : 0;
}

void BusArbiter::set_babble(std::optional<Babble> babble, MonotonicTime now) {
  babble_ = std::move(babble);
  babble_at_ = now;
}

std::optional<MonotonicTime> BusArbiter::next_deadline() const {
  std::optional<MonotonicTime> next;
  const auto also = [&next](MonotonicTime at) {
    if (!next || at < *next) next = at;
  };
  if (on_wire_) also(on_wire_->end);
  if (!on_wire_ && babble_) also(babble_at_);
  for (const auto& [station, state] : stations_) {
    if (state.restart_at) also(*state.restart_at);
  }
  return next;
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
  const auto rank = [](const Waiting& w) { return std::pair(arbitration_of(w.frame), w.order); };
  for (auto candidate = queues_.begin(); candidate != queues_.end(); ++candidate) {
    if (candidate->second.empty()) continue;
    if (winner == queues_.end() || rank(candidate->second.front()) < rank(winner->second.front()))
      winner = candidate;
  }
  BusClient client = babbler;
  Waiting waiting;
  const bool babbles = babble_ && babble_at_ <= earliest;
  if (winner != queues_.end() &&
      !(babbles && arbitration_of(babble_->frame) < arbitration_of(winner->second.front().frame))) {
    client = winner->first;
    waiting = winner->second.front();
    winner->second.pop_front();
  } else if (babbles) {
    waiting.frame = babble_->frame;
  } else {
    return;
  }
  nanoseconds duration = time_on_wire(waiting.frame);
  const bool error = draw(faults_.bit_error_probability);
  if (error)
    duration = duration / 2 + nanoseconds(std::int64_t{1'000'000'000} * error_frame_bits / bit_rate_);
  const MonotonicTime start = earliest + faults_.extra_delay;
  on_wire_ = OnWire{.client = client,
                    .waiting = waiting,
                    .start = start,
                    .end = start + duration,
                    .error = error,
                    .destroyed = false};
  if (client == babbler) {
    ++counters_.babbled;
    babble_at_ = on_wire_->end + babble_->pause;
  }
}

bool BusArbiter::draw(double probability) {
  if (probability <= 0) return false;
  return std::uniform_real_distribution<double>(0, 1)(random_) < probability;
}

}  // namespace srfs::sim
