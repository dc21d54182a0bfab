// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/store/packet_retrieval.hpp"

#include <algorithm>
#include <cassert>

#include <mission/structures.hpp>

namespace srfs {

static_assert(mission::StorageRetrieve::max_groups == PacketRetrieval::max_periods);

void PacketRetrieval::execute(const Telecommand& telecommand, MonotonicTime /*now*/) {
  OctetReader reader(telecommand.arguments);
  const unsigned count = reader.u16();
  if (telecommand.command->subtype == abort_retrieval) {
    for (unsigned i = 0; i < count; ++i) abort(reader.u16(), mission::failure::aborted);
    report_queue_.done(telecommand.origin);
    return;
  }
  std::vector<StorePeriod> periods;
  for (unsigned i = 0; i < count; ++i) {  // at most max_groups of the dictionary
    StorePeriod period;
    period.store = reader.u16();
    period.range.from = read_cuc(reader);
    period.range.to = read_cuc(reader);
    if (period.range.to < period.range.from) {
      report_queue_.failure(telecommand.origin, Stage::start, mission::failure::bad_time_range);
      return;
    }
    periods.push_back(period);
  }
  if (!request(telecommand.origin, std::move(periods)))
    report_queue_.failure(telecommand.origin, Stage::start, mission::failure::busy);
}

bool PacketRetrieval::request(const TelecommandOrigin& origin, std::vector<StorePeriod> periods) {
  assert(!periods.empty() && periods.size() <= max_periods);
  if (requests_.size() == max_requests) return false;
  requests_.push_back(Request{.origin = origin, .periods = {periods.begin(), periods.end()}});
  return true;
}

void PacketRetrieval::abort(std::uint16_t store, std::uint16_t code) {
  const auto names_store = [&](const Request& request) { return names(request, store); };
  const bool running_ends = !requests_.empty() && names_store(requests_.front());
  for (const Request& request : requests_) {
    if (names_store(request)) report_queue_.failure(request.origin, Stage::completion, code);
  }
  std::erase_if(requests_, names_store);
  if (running_ends) end_period();
}

bool PacketRetrieval::names(const Request& request, std::uint16_t store) {
  return std::any_of(request.periods.begin(), request.periods.end(),
                     [&](const StorePeriod& period) { return period.store == store; });
}

bool PacketRetrieval::names(std::uint16_t store) const {
  return std::any_of(requests_.begin(), requests_.end(),
                     [&](const Request& request) { return names(request, store); });
}

void PacketRetrieval::fail(std::uint64_t request) {
  if (request != number_ || requests_.empty()) return;
  ++incomplete_;
  report_queue_.failure(requests_.front().origin, Stage::completion, mission::failure::store_unreadable);
  requests_.pop_front();
  end_period();
}

std::optional<PacketRetrieval::Batch> PacketRetrieval::next_batch(std::size_t room_octets) {
  if (requests_.empty() || reading_ || read_all_ || room_octets < room_for_batch) return std::nullopt;
  reading_ = true;
  return Batch{.period = requests_.front().periods.front(), .cursor = cursor_, .request = number_};
}

std::vector<Octets> PacketRetrieval::on_batch(std::uint64_t request, RetrievedPackets batch) {
  if (request != number_ || requests_.empty()) return {};
  if (!requests_.front().started) {
    requests_.front().started = true;
    report_queue_.success(requests_.front().origin, Stage::start);
  }
  requests_.front().damaged = requests_.front().damaged || batch.damaged;
  reading_ = false;
  cursor_ = batch.next;
  read_all_ = batch.finished;
  running_.packets += static_cast<std::uint32_t>(batch.packets.size());
  for (const Octets& packet : batch.packets) running_.octets += packet.size();
  return std::move(batch.packets);
}

void PacketRetrieval::on_playback(bool playback_empty) {
  if (requests_.empty() || !read_all_ || !playback_empty) return;
  Request& request = requests_.front();
  running_.store = request.periods.front().store;
  done_.push_back(running_);
  request.periods.pop_front();
  if (request.periods.empty()) {
    if (request.damaged) {
      ++incomplete_;
      report_queue_.failure(request.origin, Stage::completion, mission::failure::store_unreadable);
    } else {
      report_queue_.success(request.origin, Stage::completion);
    }
    requests_.pop_front();
  }
  end_period();
}

void PacketRetrieval::end_period() {
  cursor_ = {};
  running_ = {};
  reading_ = false;
  read_all_ = false;
  ++number_;
}

}  // namespace srfs
