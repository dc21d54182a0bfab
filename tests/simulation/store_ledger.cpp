// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/store_ledger.hpp"

#include <set>

#include <fmt/format.h>

#include "base/crc32c.hpp"

namespace srfs::simulation {

StoreLedger::StoreLedger(Kernel& kernel, const mission::Dictionary& dictionary, std::size_t segment_octets)
    : segment_octets_(segment_octets) {
  for (const mission::PacketStore& store : dictionary.stores())
    accounts_.emplace(store.id,
                      Account{.disk = SegmentDisk(kernel.random("packet store " + store.name), state_)});
}

void StoreLedger::on_open(const PacketStoresStatus& status) {
  for (const auto& [id, store] : status.stores) {
    Account& account = accounts_.at(id);
    account.next_sequence = store.next_sequence;
    account.quota_octets = store.quota_octets;
    // The process before ended behind them.
    (void)settle_deletions(account, store);
  }
  check();
}

void StoreLedger::on_end() {
  for (auto& [store, account] : accounts_) {
    account.pending.clear();
    account.appended = 0;
    account.overwritten = 0;
  }
  readings_ = {};
  read_.clear();
  played_back_.clear();
}

void StoreLedger::on_append(const StoreItem& item, const PacketStoresStatus& status) {
  const auto found = accounts_.find(item.store);
  if (found == accounts_.end()) return;
  Account& account = found->second;
  ++account.appended;
  for (const auto& [id, store] : status.stores) {
    if (id != item.store) continue;
    if (store.next_sequence != account.next_sequence)
      account.pending[store.next_sequence - 1] = crc32c(item.packet);
    account.next_sequence = store.next_sequence;
  }
}

void StoreLedger::on_commit(const PacketStoresStatus& status) {
  for (const auto& [id, store] : status.stores) settle(accounts_.at(id), store);
}

/// What is owed no more. @return its packets
std::uint64_t StoreLedger::settle_deletions(Account& account, const PacketStoreStatus& status) const {
  std::set<std::uint32_t> lost;
  for (const SegmentDisk::Deletion& deletion : account.disk.take_deletions()) {
    // It made room for a segment, or for all that waited.
    const std::size_t coming = std::max(segment_octets_, account.disk.longest_file());
    if (!deletion.was_oldest) throw Violation{"L6", "another segment than the oldest is deleted"};
    if (deletion.octets_before + coming <= status.quota_octets)
      throw Violation{"L6", fmt::format("a segment is deleted though there was room: {} of {} octets",
                                        deletion.octets_before, status.quota_octets)};
    for (const StoredRecord& record : deletion.records) lost.insert(record.sequence);
  }
  if (lost.empty()) return 0;
  // What was written and could not be synced may be there twice.
  for (const StoredRecord& record : account.disk.records()) lost.erase(record.sequence);
  for (const std::uint32_t sequence : lost) {
    account.owed.erase(sequence);
    account.pending.erase(sequence);
  }
  return lost.size();
}

void StoreLedger::note_overwritten(Account& account, const PacketStoreStatus& status) {
  const std::uint64_t deleted = settle_deletions(account, status);
  const std::uint64_t counted = status.counters.overwritten - account.overwritten;
  if (counted < deleted)
    throw Violation{"L6", fmt::format("packets were deleted and not counted: {} of {}", deleted, counted)};
  counters_.overwritten += deleted > 0 ? 1 : 0;
  account.overwritten = status.counters.overwritten;
}

void StoreLedger::settle(Account& account, const PacketStoreStatus& status) {
  note_overwritten(account, status);
  account.next_sequence = status.next_sequence;
  const auto& counted = status.counters;
  const std::uint64_t known = counted.stored + counted.refused + counted.full;
  const std::uint64_t waiting = status.failing ? account.pending.size() : 0;
  if (account.appended < known || account.appended > known + waiting)
    throw Violation{"L6",
                    fmt::format("packets are neither stored nor counted: {} given, {} stored, {} refused",
                                account.appended, counted.stored, counted.refused + counted.full)};
  if (status.failing) return;
  counters_.stored += account.pending.size();
  account.owed.merge(account.pending);
  account.pending.clear();
}

void StoreLedger::check() const {
  for (const auto& [store, account] : accounts_) {
    const auto there = account.disk.records();
    std::size_t at = 0;
    for (const auto& [sequence, checksum] : account.owed) {
      while (at < there.size() && there[at].sequence < sequence) ++at;
      if (at == there.size() || there[at].sequence != sequence || there[at].checksum != checksum)
        throw Violation{"L6", fmt::format("a packet that was synced is not there: store {}, sequence {}",
                                          store, sequence)};
    }
    if (account.quota_octets > 0 && account.disk.octets() > account.quota_octets)
      throw Violation{"L6", fmt::format("a store is beyond its quota: store {}, {} of {} octets", store,
                                        account.disk.octets(), account.quota_octets)};
  }
}

std::vector<std::uint32_t> StoreLedger::expected_of(std::uint16_t store, const RetrievalRange& range,
                                                    const RetrievalCursor& begun) const {
  std::vector<std::uint32_t> expected;
  for (const StoredRecord& record : accounts_.at(store).disk.records()) {
    if (record.at >= range.from && record.at <= range.to && record.sequence >= begun.begin_sequence &&
        record.sequence < *begun.end_sequence)
      expected.push_back(record.checksum);
  }
  return expected;
}

void StoreLedger::on_read(const ReadStore& read, const std::optional<RetrievedPackets>& packets,
                          const PacketStoresStatus& status) {
  for (const auto& [id, store] : status.stores) note_overwritten(accounts_.at(id), store);
  auto& reading = readings_.at(read.open_retrieval ? 1 : 0);
  if (!packets || packets->damaged) return reading.reset();
  const StorePeriod& period = read.batch.period;
  const auto account = accounts_.find(period.store);
  if (account == accounts_.end()) return reading.reset();
  if (!read.batch.cursor.end_sequence)
    reading = Reading{.overwritten = account->second.overwritten,
                      .begun = packets->next,
                      .expected = expected_of(period.store, period.range, packets->next),
                      .got = {}};
  if (!reading) return;
  for (const Octets& packet : packets->packets) reading->got.push_back(crc32c(packet));
  if (!packets->finished) return;
  const bool deleted = account->second.overwritten != reading->overwritten;
  // While the disk failed, packets of the period waited for it: what of them has reached it meanwhile is
  // read, too.
  const auto starts_with = [](const auto& whole, const auto& begin) {
    return whole.size() >= begin.size() && std::equal(begin.begin(), begin.end(), whole.begin());
  };
  const auto there_now = expected_of(period.store, period.range, reading->begun);
  const bool right = starts_with(reading->got, reading->expected) && starts_with(there_now, reading->got);
  if (!deleted && !right)
    throw Violation{"S8", fmt::format("a retrieval read other packets than the store has: {} instead of {}",
                                      reading->got.size(), reading->expected.size())};
  ++counters_.retrieved;
  if (!read.open_retrieval) read_.push_back(std::move(reading->got));
  reading.reset();
}

void StoreLedger::on_played_back(OctetView packet) {
  if (readings_[0] || !read_.empty()) ++played_back_[crc32c(packet)];
}

void StoreLedger::on_retrieval_completed() {
  if (read_.empty()) return;  // an earlier process read it
  for (const std::uint32_t checksum : read_.front()) {
    const auto found = played_back_.find(checksum);
    if (found == played_back_.end())
      throw Violation{"S8", "a retrieval is reported complete, and a packet of it was not sent"};
  }
  read_.pop_front();
  if (read_.empty() && !readings_[0]) played_back_.clear();
}

void StoreLedger::lose_power() {
  for (auto& [store, account] : accounts_) account.disk.lose_power();
}

}  // namespace srfs::simulation
