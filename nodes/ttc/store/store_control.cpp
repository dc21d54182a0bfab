// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/store/store_control.hpp"

#include <algorithm>
#include <cassert>
#include <sstream>

#include <fmt/format.h>

#include <mission/structures.hpp>

#include "base/checked_text.hpp"
#include "base/saturate.hpp"

namespace srfs {
namespace {

// Requests of service 15 (ECSS-E-ST-70-41C 8.15.2).
enum Subtype : std::uint8_t {
  enable = 1,
  disable = 2,
  summary = 12,
  set_open_start_time = 14,
  resume_open = 15,
  suspend_open = 16,
  status_of_all = 18,
  make_circular = 26,
  make_bounded = 27,
};

std::uint8_t share_percent(std::uint64_t part, std::uint64_t whole) {
  return whole == 0 ? std::uint8_t{0}
                    : static_cast<std::uint8_t>(std::min<std::uint64_t>(100, part * 100 / whole));
}

}  // namespace

StoreControl::StoreControl(const mission::Dictionary& dictionary, std::string_view stored,
                           ReportQueue& report_queue, const PacketRetrieval& retrieval)
    : report_queue_(report_queue), retrieval_(retrieval) {
  for (const mission::PacketStore& store : dictionary.stores()) {
    Store& added = stores_.emplace_back();
    added.id = store.id;
  }
  load(stored);
}

void StoreControl::load(std::string_view stored) {
  std::istringstream in(without_check(stored).value_or(""));
  std::uint16_t id = 0;
  bool enabled = true;
  bool bounded = false;
  bool open = false;
  std::int64_t open_start_ns = 0;
  std::uint32_t sent = 0;
  while (in >> id >> enabled >> bounded >> open >> open_start_ns >> sent) {
    Store* store = find(id);
    if (store == nullptr) continue;  // of another dictionary
    store->enabled = enabled;
    store->bounded = bounded;
    store->open = open;
    store->open_start = TaiTime{nanoseconds(open_start_ns)};
    begin_at(*store, sent);
  }
}

std::string StoreControl::stored_text() const {
  std::string text;
  for (const Store& store : stores_) {
    text += fmt::format("{} {:d} {:d} {:d} {} {}\n", store.id, store.enabled, store.bounded, store.open,
                        store.open_start.ns(), store.sent);
  }
  return with_check(text);
}

StoreControl::Store* StoreControl::find(std::uint16_t id) {
  const auto found =
      std::find_if(stores_.begin(), stores_.end(), [id](const Store& store) { return store.id == id; });
  return found == stores_.end() ? nullptr : &*found;
}

std::vector<StoreControl::Store*> StoreControl::named(OctetReader& reader) {
  std::vector<Store*> found;
  const unsigned count = reader.u16();
  for (unsigned i = 0; i < count; ++i) {
    if (Store* store = find(reader.u16())) found.push_back(store);  // the dictionary knows no others
  }
  if (count == 0) {
    for (Store& store : stores_) found.push_back(&store);
  }
  return found;
}

void StoreControl::begin_at(Store& store, std::uint32_t sequence) {
  store.sent = sequence;
  store.read = sequence;
  store.cursor = {.begin_sequence = sequence};
  if (reading_ && reading_->store == store.id) reading_.reset();  // what comes of it is dropped
  std::erase_if(pushed_, [&](const Pushed& pushed) { return pushed.store == store.id; });
}

bool StoreControl::provides(const mission::Command& command) const {
  return command.service == PacketRetrieval::service_type && !retrieval_.provides(command);
}

void StoreControl::execute(const Telecommand& telecommand, MonotonicTime /*now*/) {
  const TelecommandOrigin& origin = telecommand.origin;
  const std::uint8_t subtype = telecommand.command->subtype;
  OctetReader reader(telecommand.arguments);
  switch (subtype) {
    case Subtype::summary:
      for (const Store* store : named(reader)) report_summary(origin, *store);
      break;
    case Subtype::status_of_all:
      for (const Store& store : stores_) report_status(origin, store);
      break;
    case Subtype::set_open_start_time:
      set_open_start(origin, reader);
      return;
    case Subtype::enable:
    case Subtype::disable:
    case Subtype::resume_open:
    case Subtype::suspend_open:
    case Subtype::make_circular:
    case Subtype::make_bounded:
      for (Store* store : named(reader)) {
        if (subtype == Subtype::enable || subtype == Subtype::disable) {
          store->enabled = subtype == Subtype::enable;
        } else if (subtype == Subtype::make_circular || subtype == Subtype::make_bounded) {
          store->bounded = subtype == Subtype::make_bounded;
        } else if (store->open != (subtype == Subtype::resume_open)) {
          store->open = !store->open;
          store->cursor = {.begin_sequence = store->read};  // what waits in the channel still leaves
          if (reading_ && reading_->store == store->id) reading_.reset();
        }
      }
      report_queue_.success(origin, Stage::start);
      set_.push_back(origin);
      return;
    default:  // in the dictionary, but this version of ttc does not do it
      report_queue_.failure(origin, Stage::start, mission::failure::unknown_subtype);
      return;
  }
  report_queue_.success(origin, Stage::start);
  report_queue_.success(origin, Stage::completion);
}

void StoreControl::set_open_start(const TelecommandOrigin& origin, OctetReader& reader) {
  const TaiTime from = read_cuc(reader);
  const std::vector<Store*> stores = named(reader);
  for (const Store* store : stores) {
    if (!store->open) continue;
    report_queue_.failure(origin, Stage::start, mission::failure::busy, octets_of_u16(store->id));
    return;
  }
  for (Store* store : stores) {
    store->open_start = from;
    begin_at(*store, 0);
  }
  report_queue_.success(origin, Stage::start);
  set_.push_back(origin);
}

void StoreControl::report_summary(const TelecommandOrigin& origin, const Store& store) {
  const PacketStoreStatus& status = store.status;
  const std::uint64_t unsent =
      status.next_sequence > store.sent
          ? std::min<std::uint64_t>(status.next_sequence - store.sent, status.records)
          : 0;
  mission::PacketStoreSummary report;
  report.stores = 1;
  report.store = store.id;
  report.oldest = status.oldest.value_or(TaiTime{});
  report.newest = status.newest.value_or(TaiTime{});
  report.open_start = store.open_start;
  report.filled = share_percent(status.octets, status.quota_octets);
  // Records are of much the same size.
  report.filled_open =
      share_percent(status.records == 0 ? 0 : status.octets * unsent / status.records, status.quota_octets);
  put(origin, mission::PacketStoreSummary::subtype, report.encoded());
}

void StoreControl::report_status(const TelecommandOrigin& origin, const Store& store) {
  mission::PacketStoreStatus report;
  report.stores = 1;
  report.store = store.id;
  report.storage = store.enabled ? mission::StorageSwitch::enabled : mission::StorageSwitch::disabled;
  report.open_retrieval =
      store.open ? mission::OpenRetrieval::in_progress : mission::OpenRetrieval::suspended;
  report.period_retrieval =
      retrieval_.names(store.id) ? mission::PeriodRetrieval::under_way : mission::PeriodRetrieval::idle;
  report.type = store.bounded ? mission::StoreType::bounded : mission::StoreType::circular;
  report.refused = as_u32(store.refused + store.status.counters.full);
  put(origin, mission::PacketStoreStatus::subtype, report.encoded());
}

void StoreControl::put(const TelecommandOrigin& origin, std::uint8_t subtype, Octets data) {
  report_queue_.put(Report{.apid = origin.apid,
                           .service = PacketRetrieval::service_type,
                           .subtype = subtype,
                           .destination_id = origin.source_id,
                           .data = std::move(data)});
}

bool StoreControl::take_packet(std::uint16_t store) {
  Store* found = find(store);
  if (found == nullptr || found->enabled) return true;
  ++found->refused;
  return false;
}

std::vector<std::uint16_t> StoreControl::bounded() const {
  std::vector<std::uint16_t> ids;
  for (const Store& store : stores_) {
    if (store.bounded) ids.push_back(store.id);
  }
  return ids;
}

bool StoreControl::on_status(std::uint16_t store, const PacketStoreStatus& status) {
  Store* found = find(store);
  if (found == nullptr) return false;
  found->status = status;
  found->unreadable = false;
  if (!found->known && !status.failing) {
    found->known = true;
    // Fewer records were there than had been sent: the end of the store was lost, or all of it.
    if (status.recovered_sequence < found->sent) begin_at(*found, status.recovered_sequence);
  }
  const bool full = found->bounded && status.full;
  const bool news = full && !found->full_told;
  found->full_told = full;
  return news;
}

std::optional<PacketRetrieval::Batch> StoreControl::next_batch(std::size_t room_octets) {
  if (reading_ || retrieval_.busy() || room_octets < PacketRetrieval::room_for_batch) return std::nullopt;
  for (std::size_t i = 0; i < stores_.size(); ++i) {
    const Store& store = stores_[(turn_ + i) % stores_.size()];
    if (!store.open || store.unreadable || store.read >= store.status.next_sequence) continue;
    turn_ = (turn_ + i + 1) % stores_.size();
    reading_ = Reading{.store = store.id, .request = ++requests_};
    return PacketRetrieval::Batch{
        .period = {.store = store.id, .range = {.from = store.open_start, .to = TaiTime{nanoseconds::max()}}},
        .cursor = store.cursor,
        .request = requests_};
  }
  return std::nullopt;
}

std::vector<Octets> StoreControl::on_batch(std::uint64_t request, std::optional<RetrievedPackets> batch) {
  if (!reading_ || reading_->request != request) return {};
  Store* store = find(reading_->store);
  assert(store != nullptr);
  reading_.reset();
  if (!batch) {
    store->unreadable = true;
    return {};
  }
  const std::uint32_t end = batch->next.end_sequence.value_or(store->read);
  if (batch->finished) {
    // Up to what there was when its reading began; the next batch goes on behind it.
    store->read = std::max(store->read, end);
    store->cursor = {.begin_sequence = store->read};
  } else {
    store->read = std::max(store->read, batch->next_sequence);
    store->cursor = batch->next;
  }
  to_push_ = store->id;
  return std::move(batch->packets);
}

void StoreControl::on_pushed(std::uint64_t pushed_octets) {
  if (!to_push_) return;
  const Store* store = find(*std::exchange(to_push_, std::nullopt));
  pushed_.push_back({.store = store->id, .read = store->read, .end_octets = pushed_octets});
}

void StoreControl::on_left(std::uint64_t left_octets) {
  while (!pushed_.empty() && pushed_.front().end_octets <= left_octets) {
    Store* store = find(pushed_.front().store);
    store->sent = std::max(store->sent, pushed_.front().read);
    progress_ = true;
    pushed_.pop_front();
  }
}

std::optional<StoreChange> StoreControl::take_change() {
  if (set_.empty()) return std::nullopt;
  return StoreChange{.origins = std::exchange(set_, {}), .stored_text = stored_text()};
}

void StoreControl::change_stored(const StoreChange& change, bool success) {
  for (const TelecommandOrigin& origin : change.origins) {
    if (success) {
      report_queue_.success(origin, Stage::completion);
    } else {  // it holds until a restart
      report_queue_.failure(origin, Stage::completion, mission::failure::storage_unavailable);
    }
  }
}

}  // namespace srfs
