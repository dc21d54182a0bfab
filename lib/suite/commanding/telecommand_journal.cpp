// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/commanding/telecommand_journal.hpp"

#include <algorithm>
#include <cassert>

#include <mission/structures.hpp>

#include "base/text.hpp"
#include "wire/crc16.hpp"

namespace srfs {
namespace {

constexpr std::uint32_t magic = 0x53544A31;  // "STJ1"
[[maybe_unused]] constexpr std::size_t longest_arguments = 512;

// Flags of an ended telecommand.
constexpr std::uint8_t succeeded = 1;
constexpr std::uint8_t reported = 2;
constexpr std::uint8_t earlier_boot = 4;

void encode_report(OctetWriter& out, const StageReport& report, std::uint8_t flags) {
  out.u64(report.id);
  out.u8(static_cast<std::uint8_t>(report.stage));
  out.u8(static_cast<std::uint8_t>((report.success ? succeeded : 0) | flags));
  out.u16(report.failure);
}

/// @return and its flags
std::pair<StageReport, std::uint8_t> decode_report(OctetReader& in) {
  StageReport report;
  report.id = in.u64();
  report.stage = static_cast<Stage>(in.u8());
  const std::uint8_t flags = in.u8();
  report.success = (flags & succeeded) != 0;
  report.failure = in.u16();
  return {report, flags};
}

}  // namespace

Octets TelecommandJournal::encode() const {
  OctetWriter out;
  out.u32(magic);
  out.u8(static_cast<std::uint8_t>(boot_id_.size()));
  out.bytes(as_octets(boot_id_));
  out.u8(static_cast<std::uint8_t>(pending_.size()));
  for (const Pending& p : pending_) {
    out.u64(p.telecommand.id);
    out.u16(p.telecommand.function);
    out.u8(static_cast<std::uint8_t>(p.telecommand.repeat));
    out.u8(p.started ? 1 : 0);
    out.u64(static_cast<std::uint64_t>(p.telecommand.expiry.ns()));
    out.u16(static_cast<std::uint16_t>(p.telecommand.arguments.size()));
    out.bytes(p.telecommand.arguments);
  }
  out.u8(static_cast<std::uint8_t>(known_.size()));
  for (const auto& [report, of_this_boot] : known_) {
    const int flags = (waits_for_disk(report.id) ? 0 : reported) | (of_this_boot ? 0 : earlier_boot);
    encode_report(out, report, static_cast<std::uint8_t>(flags));
  }
  out.u16(wire::crc16(out.view()));
  assert(out.ok());
  return out.take();
}

Result<void, JournalError> TelecommandJournal::restore(OctetView content) {
  OctetReader in(content);
  if (in.u32() != magic) return Err(JournalError::not_a_journal);
  if (wire::crc16(content) != 0) return Err(JournalError::damaged);

  const OctetView boot = in.bytes(in.u8());
  const bool same_boot = std::equal(boot.begin(), boot.end(), boot_id_.begin(), boot_id_.end());
  std::deque<Pending> pending;
  for (std::size_t n = in.u8(); n > 0 && in.ok(); --n) {
    Pending p;
    p.telecommand.id = in.u64();
    p.telecommand.function = in.u16();
    const std::uint8_t repeat = in.u8();
    if (repeat < 1 || repeat > 3) return Err(JournalError::damaged);
    p.telecommand.repeat = static_cast<RepeatClass>(repeat);
    p.started = in.u8() != 0;
    p.telecommand.expiry = MonotonicTime(nanoseconds(static_cast<std::int64_t>(in.u64())));
    const OctetView arguments = in.bytes(in.u16());
    p.telecommand.arguments.assign(arguments.begin(), arguments.end());
    p.accepted = true;
    p.restored = true;
    pending.push_back(std::move(p));
  }
  std::deque<Known> known;
  std::vector<StageReport> unreported;
  for (std::size_t n = in.u8(); n > 0 && in.ok(); --n) {
    const auto [report, flags] = decode_report(in);
    const bool is_stage = report.stage == Stage::acceptance || report.stage == Stage::start ||
                          report.stage == Stage::completion;
    if (!is_stage) return Err(JournalError::damaged);
    known.push_back({report, same_boot && (flags & earlier_boot) == 0});
    if ((flags & reported) == 0) unreported.push_back(report);
  }
  if (!in.ok() || in.remaining() != 2 || pending.size() > capacity || known.size() > known_capacity) {
    return Err(JournalError::damaged);
  }

  known_ = std::move(known);
  // Ids of another boot mean nothing here: their proofs are worthless, and the clock that ids are taken from
  // may have been lost.
  forgotten_ = 0;
  if (known_.size() == known_capacity && known_.front().of_this_boot)
    forgotten_ = std::min_element(known_.begin(), known_.end(), [](const auto& a, const auto& b) {
                   return a.report.id < b.report.id;
                 })->report.id;
  // The process may have ended between the record of an end and its report.
  ready_ = std::move(unreported);
  pending_.clear();
  ++revision_;
  for (Pending& p : pending) {
    const std::uint64_t id = p.telecommand.id;
    if (p.started) {
      remember({id, Stage::completion, false, mission::failure::interrupted}, same_boot);
    } else if (!same_boot) {
      remember(too_late(p), false);
    } else {
      pending_.push_back(std::move(p));
    }
  }
  return {};
}

bool TelecommandJournal::repeat_reports(std::uint64_t id) {
  for (const Pending& p : pending_) {
    if (p.telecommand.id != id) continue;
    if (p.accepted) ready_.push_back({.id = id});
    ++counters_.repeated;
    return true;
  }
  for (const auto& [report, of_this_boot] : known_) {
    if (report.id != id) continue;
    if (!waits_for_disk(id)) {
      // A sender that asks again has missed the acceptance too.
      ready_.push_back({.id = id});
      ready_.push_back(report);
    }
    ++counters_.repeated;
    return true;
  }
  for (const StageReport& report : refused_) {
    if (report.id != id) continue;
    ready_.push_back(report);
    ++counters_.repeated;
    return true;
  }
  return false;
}

bool TelecommandJournal::waits_for_disk(std::uint64_t id) const {
  return std::any_of(waiting_.begin(), waiting_.end(), [id](const Waiting& w) { return w.report.id == id; });
}

TelecommandJournal::Arrival TelecommandJournal::add(StoredTelecommand telecommand) {
  assert(telecommand.arguments.size() <= longest_arguments);
  if (repeat_reports(telecommand.id)) return Arrival::known;
  ++counters_.arrived;
  if (telecommand.id <= forgotten_) {
    refuse(telecommand.id, mission::failure::interrupted);
    return Arrival::too_old;
  }
  if (pending_.size() == capacity) {
    refuse(telecommand.id, mission::failure::queue_full);
    return Arrival::full;
  }
  Pending p;
  p.telecommand = std::move(telecommand);
  p.stored_with = ++revision_;
  pending_.push_back(std::move(p));
  return Arrival::stored;
}

void TelecommandJournal::refuse(std::uint64_t id, FailureCode why) {
  ++counters_.refused;
  if (refused_.size() == refused_capacity) refused_.pop_front();
  refused_.push_back({id, Stage::acceptance, false, why});
  ready_.push_back(refused_.back());
}

StageReport TelecommandJournal::too_late(const Pending& pending) {
  const std::uint64_t id = pending.telecommand.id;
  if (pending.restored && pending.telecommand.repeat != RepeatClass::at_most_once)
    return {id, Stage::completion, false, mission::failure::interrupted};
  ++counters_.expired;
  return {id, Stage::start, false, mission::failure::expired};
}

const StoredTelecommand* TelecommandJournal::next(MonotonicTime now) {
  // One that this process began in time goes on.
  while (!pending_.empty() && pending_.front().accepted && pending_.front().attempts == 0 &&
         pending_.front().telecommand.has_expired(now)) {
    end_front(too_late(pending_.front()));
  }
  // Not accepted yet: it keeps its place, and so do those behind it.
  if (pending_.empty() || !pending_.front().accepted) return nullptr;
  return &pending_.front().telecommand;
}

void TelecommandJournal::mark_started() {
  assert(!pending_.empty());
  Pending& front = pending_.front();
  if (front.started) return;
  front.started = true;
  front.started_with = ++revision_;
}

bool TelecommandJournal::start_is_durable() const {
  return !pending_.empty() && pending_.front().started && pending_.front().started_with <= durable_;
}

void TelecommandJournal::unmark_started() {
  if (pending_.empty() || !pending_.front().started || pending_.front().attempts > 0) return;
  pending_.front().started = false;
  ++revision_;
}

void TelecommandJournal::begin() {
  assert(!pending_.empty());
  Pending& front = pending_.front();
  assert(front.telecommand.repeat != RepeatClass::at_most_once || start_is_durable());
  ++front.attempts;
  if (!front.start_reported) ready_.push_back({.id = front.telecommand.id, .stage = Stage::start});
  front.start_reported = true;
}

bool TelecommandJournal::attempt_failed(FailureCode why) {
  assert(!pending_.empty());
  const Pending& front = pending_.front();
  if (front.telecommand.repeat == RepeatClass::at_most_once) {
    finish(mission::failure::interrupted);
    return false;
  }
  if (front.attempts < attempts_allowed) return true;
  finish(why);
  return false;
}

void TelecommandJournal::on_ids_lost() {
  interrupt_restored();
  // Of its own, this process has sent none but the first.
  if (pending_.empty() || pending_.front().telecommand.repeat != RepeatClass::by_id) return;
  if (pending_.front().attempts > 0) finish(mission::failure::interrupted);
}

void TelecommandJournal::interrupt_restored() {
  std::erase_if(pending_, [this](const Pending& p) {
    if (!p.restored || p.telecommand.repeat != RepeatClass::by_id) return false;
    ++revision_;
    remember({p.telecommand.id, Stage::completion, false, mission::failure::interrupted});
    return true;
  });
}

void TelecommandJournal::finish(FailureCode outcome) {
  assert(!pending_.empty());
  end_front({pending_.front().telecommand.id, Stage::completion, outcome == mission::failure::none, outcome});
}

void TelecommandJournal::end_front(const StageReport& report) {
  pending_.pop_front();
  ++revision_;
  remember(report);
}

void TelecommandJournal::remember(const StageReport& report, bool of_this_boot) {
  ++(report.success ? counters_.completed : counters_.failed);
  known_.push_back({report, of_this_boot});
  if (known_.size() > known_capacity) {
    if (known_.front().of_this_boot) forgotten_ = std::max(forgotten_, known_.front().report.id);
    known_.pop_front();
  }
  waiting_.push_back({report, revision_});
}

void TelecommandJournal::on_written(std::uint64_t revision, bool ok) {
  if (!ok) {
    ++counters_.failed_writes;
    // An end is reported all the same: the act was done, and silence would be worse than a possible repeat.
    for (const Waiting& w : waiting_) ready_.push_back(w.report);
    waiting_.clear();
    drop_unaccepted();
    return;
  }
  durable_ = std::max(durable_, revision);
  for (Pending& p : pending_) {
    if (p.accepted || p.stored_with > durable_) continue;
    p.accepted = true;
    ready_.push_back({.id = p.telecommand.id});
  }
  while (!waiting_.empty() && waiting_.front().revision <= durable_) {
    ready_.push_back(waiting_.front().report);
    waiting_.pop_front();
  }
}

void TelecommandJournal::drop_unaccepted() {
  const auto dropped = std::erase_if(pending_, [this](const Pending& p) {
    if (!p.accepted) refuse(p.telecommand.id, mission::failure::storage_unavailable);
    return !p.accepted;
  });
  // A write that failed late (the sync of the folder) may have left them on disk: they must not come back
  // from there.
  if (dropped > 0) ++revision_;
}

std::vector<StageReport> TelecommandJournal::take_reports() {
  return std::exchange(ready_, {});
}

bool TelecommandJournal::storing() const {
  return std::any_of(pending_.begin(), pending_.end(), [](const Pending& p) { return !p.accepted; });
}

}  // namespace srfs
