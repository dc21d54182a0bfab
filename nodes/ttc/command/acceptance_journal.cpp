// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/command/acceptance_journal.hpp"

#include <algorithm>
#include <cassert>
#include <utility>

#include "base/crc32c.hpp"
#include "base/text.hpp"

namespace srfs {
namespace {

constexpr std::uint8_t state_version = 3;
constexpr std::uint8_t version_without_refusals = 2;
constexpr std::uint8_t version_without_schedule = 1;

enum Kind : std::uint8_t {
  snapshot = journal_snapshot_kind,
  accepted = 1,
  link_changed = 2,
  progressed = 3,  ///< taken, started, a step
  ended = 4,
  withdrawn = 5,  ///< of earlier versions: refused after all, untold
  told = 6,
  schedule_changed = 7,
  refused = 8,
};

// Flags of an accepted telecommand.
constexpr std::uint8_t flag_sequenced = 1;
constexpr std::uint8_t flag_secured = 2;
constexpr std::uint8_t flag_other_boot = 4;
constexpr std::uint8_t flag_scheduled = 8;
// How far it got.
constexpr std::uint8_t flag_taken = 1;
constexpr std::uint8_t flag_started = 2;
constexpr std::uint8_t flag_ended = 4;

void write_text(OctetWriter& writer, const std::string& text) {
  writer.u8(static_cast<std::uint8_t>(text.size()));
  writer.bytes(as_octets(text));
}

std::string read_text(OctetReader& reader) {
  const OctetView octets = reader.bytes(reader.u8());
  return {octets.begin(), octets.end()};
}

bool is_sequenced(const UplinkFrame& frame) {
  return frame.type == wire::TcFrameType::ad;
}

void write_telecommand(OctetWriter& writer, const AcceptedTelecommand& t) {
  writer.u64(t.origin.id);
  writer.u64(t.accepted_serial);
  writer.u16(t.origin.request.packet_identification);
  writer.u16(t.origin.request.packet_sequence_control);
  writer.u16(t.origin.apid);
  writer.u8(t.origin.ack_flags);
  writer.u16(t.origin.source_id);
  writer.u8(t.frame.vc);
  writer.u8(static_cast<std::uint8_t>(
      (is_sequenced(t.frame) ? flag_sequenced : 0) | (t.frame.spi ? flag_secured : 0) |
      (t.progress.other_boot ? flag_other_boot : 0) | (t.activity != 0 ? flag_scheduled : 0)));
  if (t.activity != 0) writer.u64(t.activity);
  writer.u8(t.frame.sequence);
  writer.u16(t.frame.spi.value_or(0));
  writer.u64(t.frame.counter);
  writer.u64(static_cast<std::uint64_t>(t.accepted_at.ns()));
  writer.u64(static_cast<std::uint64_t>(t.expiry.ns()));
  write_text(writer, t.target);
  writer.u32(t.packet_crc);
  writer.u16(t.packet_octets);
  writer.u16(static_cast<std::uint16_t>(t.packet.size()));
  writer.bytes(t.packet);
}

AcceptedTelecommand read_telecommand(OctetReader& reader) {
  AcceptedTelecommand t;
  t.origin.id = reader.u64();
  t.accepted_serial = reader.u64();
  t.origin.request.packet_identification = reader.u16();
  t.origin.request.packet_sequence_control = reader.u16();
  t.origin.apid = reader.u16();
  t.origin.ack_flags = reader.u8();
  t.origin.source_id = reader.u16();
  t.frame.vc = reader.u8();
  const std::uint8_t flags = reader.u8();
  t.frame.type = (flags & flag_sequenced) != 0 ? wire::TcFrameType::ad : wire::TcFrameType::bd;
  t.progress.other_boot = (flags & flag_other_boot) != 0;
  if ((flags & flag_scheduled) != 0) t.activity = reader.u64();
  t.frame.sequence = reader.u8();
  const std::uint16_t spi = reader.u16();
  if ((flags & flag_secured) != 0) t.frame.spi = spi;
  t.frame.counter = reader.u64();
  t.accepted_at = MonotonicTime(nanoseconds(static_cast<std::int64_t>(reader.u64())));
  t.expiry = MonotonicTime(nanoseconds(static_cast<std::int64_t>(reader.u64())));
  t.target = read_text(reader);
  t.packet_crc = reader.u32();
  t.packet_octets = reader.u16();
  const OctetView packet = reader.bytes(reader.u16());
  t.packet.assign(packet.begin(), packet.end());
  t.restored = true;
  t.reported = true;
  t.end_said = true;
  return t;
}

void write_progress(OctetWriter& writer, const AcceptedTelecommand& t) {
  writer.u8(static_cast<std::uint8_t>((t.progress.taken ? flag_taken : 0) |
                                      (t.progress.started ? flag_started : 0) | (t.end ? flag_ended : 0)));
  writer.u8(t.progress.last_step);
  writer.u64(t.started_serial);
}

/// @return whether an end follows
bool read_progress(OctetReader& reader, AcceptedTelecommand& t) {
  const std::uint8_t flags = reader.u8();
  t.progress.taken = (flags & flag_taken) != 0;
  t.progress.started = (flags & flag_started) != 0;
  t.progress.last_step = reader.u8();
  t.started_serial = reader.u64();
  return (flags & flag_ended) != 0;
}

void write_end(OctetWriter& writer, std::uint64_t serial, const StageReached& end) {
  writer.u64(serial);
  writer.u8(static_cast<std::uint8_t>(end.stage));
  writer.u8(end.success ? 1 : 0);
  writer.u16(end.failure_code);
  writer.u8(end.step);
  writer.u8(static_cast<std::uint8_t>(end.data.size()));
  writer.bytes(end.data);
}

StageReached read_end(OctetReader& reader, std::uint64_t& serial) {
  serial = reader.u64();
  StageReached end;
  end.stage = static_cast<Stage>(reader.u8());
  end.success = reader.u8() != 0;
  end.failure_code = reader.u16();
  end.step = reader.u8();
  const OctetView data = reader.bytes(reader.u8());
  end.data.assign(data.begin(), data.end());
  return end;
}

Octets bounded_end_data(OctetView data) {
  const OctetView kept = data.first(std::min(data.size(), AcceptanceJournal::max_end_data));
  return {kept.begin(), kept.end()};
}

void write_refused(OctetWriter& writer, const RefusedTelecommand& r) {
  writer.u16(r.origin.request.packet_identification);
  writer.u16(r.origin.request.packet_sequence_control);
  writer.u16(r.origin.apid);
  writer.u16(r.origin.source_id);
  write_end(writer, r.serial, r.end);
}

RefusedTelecommand read_refused(OctetReader& reader) {
  RefusedTelecommand r;
  r.origin.request.packet_identification = reader.u16();
  r.origin.request.packet_sequence_control = reader.u16();
  r.origin.apid = reader.u16();
  r.origin.source_id = reader.u16();
  r.end = read_end(reader, r.serial);
  return r;
}

// What no version of this program writes is not taken over, whatever its checksum says.

bool is_sound(const StageReached& end) {
  return is_valid(end.stage) && end.stage != Stage::routing;
}

bool is_sound(const AcceptedTelecommand& t) {
  const bool has_id = t.origin.id != 0 && t.origin.id != UINT64_MAX;
  return has_id && (!t.end || is_sound(*t.end));
}

bool is_sound(const RefusedTelecommand& r) {
  return is_before_start(r.end.stage) && !r.end.success;
}

bool same_packet(const AcceptedTelecommand& t, OctetView packet) {
  const auto request = wire::peek_request_id(packet);
  return request == t.origin.request && packet.size() == t.packet_octets && crc32c(packet) == t.packet_crc;
}

}  // namespace

// ---- start

AcceptedTelecommand* AcceptanceJournal::find(std::uint64_t id) {
  const auto found = entries_.find(id);
  return found == entries_.end() ? nullptr : &found->second;
}

bool AcceptanceJournal::apply(const JournalRecord& record) {
  OctetReader reader(record.payload);
  return record.kind == Kind::snapshot ? apply_snapshot(reader) : apply_change(record.kind, reader);
}

bool AcceptanceJournal::apply_snapshot(OctetReader& reader) {
  const std::uint8_t version = reader.u8();
  if (version < version_without_schedule || version > state_version) return false;
  const bool same_boot = read_text(reader) == boot_id_;
  const std::uint64_t next_id = reader.u64();
  const std::uint64_t serial = reader.u64();
  const std::uint64_t told = reader.u64();
  auto link = read_link_state(reader);
  if (!link) return false;
  Entries entries;
  std::vector<std::uint64_t> ended;
  for (std::size_t n = reader.u16(); n > 0 && reader.ok(); --n) {
    AcceptedTelecommand t = read_telecommand(reader);
    if (read_progress(reader, t)) t.end = read_end(reader, t.ended_serial);
    t.progress.other_boot = t.progress.other_boot || !same_boot;
    if (t.end) ended.push_back(t.origin.id);
    if (!is_sound(t) || !entries.emplace(t.origin.id, std::move(t)).second) return false;
  }
  auto schedule = version == version_without_schedule ? TimeSchedule{} : TimeSchedule::read(reader);
  std::deque<RefusedTelecommand> refused;
  if (version > version_without_refusals) {
    for (std::size_t n = reader.u16(); n > 0 && reader.ok(); --n) {
      refused.push_back(read_refused(reader));
      if (!is_sound(refused.back())) return false;
    }
  }
  if (!schedule || !reader.ok() || reader.remaining() != 0 || refused.size() > max_refused) return false;
  if (entries.size() - ended.size() > max_open || ended.size() > max_ended) return false;
  std::sort(ended.begin(), ended.end(), [&](std::uint64_t a, std::uint64_t b) {
    return entries[a].ended_serial < entries[b].ended_serial;
  });
  entries_ = std::move(entries);
  schedule_ = std::move(*schedule);
  refused_ = std::move(refused);
  has_state_ = true;
  ended_.assign(ended.begin(), ended.end());
  open_ = entries_.size() - ended_.size();
  applied_same_boot_ = same_boot;
  next_id_ = std::max(next_id_, next_id);
  if (!entries_.empty()) next_id_ = std::max(next_id_, entries_.rbegin()->first + 1);
  serial_ = serial;
  told_ = told;
  // A counter never goes back, also not when an older segment is all there is.
  if (link->generation >= link_.generation) link_ = *link;
  return true;
}

bool AcceptanceJournal::apply_change(std::uint8_t kind, OctetReader& reader) {
  const auto newer = [this](const std::optional<LinkState>& link) {
    if (link && link->generation >= link_.generation) link_ = *link;
    return link.has_value();
  };
  if (kind == Kind::link_changed) return newer(read_link_state(reader));
  if (kind == Kind::told) {
    told_ = std::max(told_, reader.u64());
    return reader.ok();
  }
  if (kind == Kind::schedule_changed) {
    const auto change = read_schedule_change(reader);
    if (change) schedule_.apply(*change);
    return change.has_value();
  }
  if (kind == Kind::accepted) {
    AcceptedTelecommand t = read_telecommand(reader);
    if (!is_sound(t) || !newer(read_link_state(reader)) || entries_.contains(t.origin.id) || !has_room())
      return false;
    t.progress.other_boot = t.progress.other_boot || !applied_same_boot_;
    next_id_ = std::max(next_id_, t.origin.id + 1);
    serial_ = std::max(serial_, t.accepted_serial);
    leave_schedule(t.activity);
    entries_[t.origin.id] = std::move(t);
    ++open_;
    return true;
  }
  if (kind == Kind::refused) {
    const std::uint64_t id = reader.u64();
    RefusedTelecommand r = read_refused(reader);
    if (!is_sound(r) || !newer(read_link_state(reader))) return false;
    if (const AcceptedTelecommand* t = find(id); t != nullptr && !t->end) {
      entries_.erase(id);
      --open_;
    }
    serial_ = std::max(serial_, r.serial);
    keep_refused(std::move(r));
    return true;
  }
  AcceptedTelecommand* t = find(reader.u64());
  if (t == nullptr || t->end) return reader.ok();  // its acceptance was in a damaged place, or was forgotten
  if (kind == Kind::withdrawn) {
    entries_.erase(t->origin.id);
    --open_;
    return reader.ok();
  }
  if (kind == Kind::progressed) {
    read_progress(reader, *t);
    serial_ = std::max(serial_, t->started_serial);
    return reader.ok();
  }
  if (kind != Kind::ended) return false;
  StageReached end = read_end(reader, t->ended_serial);
  serial_ = std::max(serial_, t->ended_serial);
  if (!reader.ok() || !is_sound(end)) return false;
  this->end(*t, std::move(end));
  return true;
}

void AcceptanceJournal::begin(const LinkState& older, std::uint64_t first_id, MonotonicTime now) {
  if (older.generation > link_.generation) link_ = older;
  // Ids may have been given without a disk.
  next_id_ = std::max({next_id_, first_id, std::uint64_t{1}});
  for (auto& [id, t] : entries_) {
    if (!t.end) ++counters_.restored;
    if (t.progress.other_boot)
      t.accepted_at = now;  // the window for repeats begins anew: rather longer than missed
  }
  std::erase_if(refused_, [this](const RefusedTelecommand& r) { return r.serial <= told_; });
  counters_.forgotten = 0;
}

std::vector<const AcceptedTelecommand*> AcceptanceJournal::known() const {
  std::vector<const AcceptedTelecommand*> all;
  all.reserve(entries_.size());
  for (const auto& [id, t] : entries_) all.push_back(&t);
  return all;
}

// ---- telecommands

std::uint64_t AcceptanceJournal::accept(const Telecommand& telecommand, const UplinkedPacket& uplinked,
                                        MonotonicTime now, std::uint64_t activity) {
  assert(has_room() && telecommand.command->node.size() <= UINT8_MAX);
  AcceptedTelecommand t;
  t.origin = telecommand.origin;
  t.origin.id = next_id_++;
  t.frame = uplinked.frame;
  t.accepted_at = now;
  t.expiry = telecommand.expiry;
  t.target = telecommand.command->node;
  t.activity = activity;
  t.packet = uplinked.packet;
  t.packet_crc = crc32c(uplinked.packet);
  t.packet_octets = static_cast<std::uint16_t>(uplinked.packet.size());
  t.accepted_serial = ++serial_;
  link_ = uplinked.link;
  leave_schedule(activity);
  ++revision_;
  ++open_;
  ++counters_.accepted;
  OctetWriter writer;
  write_telecommand(writer, t);
  write_link_state(writer, link_);
  add(Kind::accepted, std::move(writer));
  return entries_.emplace(t.origin.id, std::move(t)).first->first;
}

void AcceptanceJournal::leave_schedule(std::uint64_t activity) {
  if (activity == 0) return;
  ScheduleChange change;
  change.removed.push_back(activity);
  schedule_.apply(change);
}

std::uint64_t AcceptanceJournal::change_schedule(const ScheduleChange& change) {
  schedule_.apply(change);
  OctetWriter writer;
  write_schedule_change(writer, change);
  add(Kind::schedule_changed, std::move(writer));
  return ++revision_;
}

std::uint64_t AcceptanceJournal::refuse(const TelecommandOrigin& origin, const StageReached& end,
                                        const LinkState& link) {
  link_ = link;
  add_refusal(0, {.origin = origin, .end = end});
  return serial_;
}

void AcceptanceJournal::add_refusal(std::uint64_t id, RefusedTelecommand refused) {
  refused.serial = ++serial_;
  refused.end.data = bounded_end_data(refused.end.data);
  ++revision_;
  ++counters_.refused;
  OctetWriter writer;
  writer.u64(id);
  write_refused(writer, refused);
  write_link_state(writer, link_);
  add(Kind::refused, std::move(writer));
  keep_refused(std::move(refused));
}

void AcceptanceJournal::keep_refused(RefusedTelecommand refused) {
  if (refused_.size() == max_refused) {
    refused_.pop_front();
    ++counters_.forgotten;
  }
  refused_.push_back(std::move(refused));
}

void AcceptanceJournal::on_link(const LinkState& link) {
  if (link.generation == link_.generation) return;
  link_ = link;
  // Of changes that are not written yet the newest says it all.
  if (!pending_.empty() && pending_.back().kind == Kind::link_changed) {
    pending_octets_ -= pending_.back().payload.size();
    pending_.pop_back();
  }
  OctetWriter writer;
  write_link_state(writer, link_);
  add(Kind::link_changed, std::move(writer));
}

void AcceptanceJournal::on_taken(std::uint64_t id) {
  AcceptedTelecommand* t = find(id);
  if (t == nullptr || t->progress.taken || t->end) return;
  t->progress.taken = true;
  OctetWriter writer;
  writer.u64(id);
  write_progress(writer, *t);
  add(Kind::progressed, std::move(writer));
}

void AcceptanceJournal::on_stage(const StageReached& stage) {
  AcceptedTelecommand* t = find(stage.id);
  if (t == nullptr || t->end) return;
  if (stage.stage == Stage::acceptance) {  // that it is here says that it was accepted
    t->reported = true;
    if (stage.success) return;
    RefusedTelecommand refused{.origin = t->origin, .end = stage, .said = true};
    entries_.erase(stage.id);
    --open_;
    add_refusal(stage.id, std::move(refused));
    return;
  }
  if (stage.is_end()) {
    t->ended_serial = ++serial_;
    t->end_said = stage.silent;
    ++revision_;
    StageReached how = stage;
    how.data = bounded_end_data(stage.data);
    OctetWriter writer;
    writer.u64(stage.id);
    write_end(writer, t->ended_serial, how);
    add(Kind::ended, std::move(writer));
    end(*t, std::move(how));
    return;
  }
  if (stage.stage == Stage::progress) t->progress.last_step = stage.step;
  if (!t->progress.started) t->started_serial = ++serial_;
  t->progress.started = true;
  OctetWriter writer;
  writer.u64(stage.id);
  write_progress(writer, *t);
  add(Kind::progressed, std::move(writer));
}

void AcceptanceJournal::end(AcceptedTelecommand& entry, StageReached end) {
  entry.end = std::move(end);
  entry.packet = {};
  --open_;
  ended_.push_back(entry.origin.id);
  forget_oldest();
}

void AcceptanceJournal::forget_oldest() {
  while (ended_.size() > max_ended) {
    entries_.erase(ended_.front());
    ended_.pop_front();
    ++counters_.forgotten;
  }
}

// ---- repeats

const AcceptedTelecommand* AcceptanceJournal::find_repeated_frame(const UplinkedPacket& uplinked) {
  const UplinkFrame& frame = uplinked.frame;
  for (auto entry = entries_.rbegin(); entry != entries_.rend(); ++entry) {
    const AcceptedTelecommand& t = entry->second;
    const bool same_counter = frame.spi && frame.spi == t.frame.spi && frame.counter == t.frame.counter;
    const bool same_sequence = is_sequenced(frame) && is_sequenced(t.frame) && t.frame.vc == frame.vc &&
                               t.frame.sequence == frame.sequence;
    if ((same_counter || same_sequence) && same_packet(t, uplinked.packet)) {
      ++counters_.repeats;
      return &t;
    }
  }
  return nullptr;
}

const AcceptedTelecommand* AcceptanceJournal::find_repeated_packet(const UplinkedPacket& uplinked,
                                                                   MonotonicTime now) {
  for (auto entry = entries_.rbegin(); entry != entries_.rend(); ++entry) {
    AcceptedTelecommand& t = entry->second;
    const bool from_schedule = t.activity != 0;  // it came in no frame
    if (from_schedule || t.frame.spi.has_value() != uplinked.frame.spi.has_value()) continue;
    const bool recent = t.frame.spi ? now - t.accepted_at < repeat_window_
                                    : t.frame.vc == uplinked.frame.vc &&
                                          now - t.repeated_at.value_or(t.accepted_at) < repeat_answer_period;
    if (!recent || !same_packet(t, uplinked.packet)) continue;
    if (!t.frame.spi) t.repeated_at = now;
    ++counters_.repeats;
    return &t;
  }
  return nullptr;
}

void AcceptanceJournal::answer_repeat(const AcceptedTelecommand& telecommand, MonotonicTime now,
                                      ReportQueue& report_queue) {
  AcceptedTelecommand* t = find(telecommand.origin.id);
  if (t == nullptr) return;
  if (t->told_again_at && now - *t->told_again_at < repeat_answer_period) {
    ++counters_.unanswered;
    return;
  }
  t->told_again_at = now;
  tell_again(*t, 0, report_queue, false);
}

// ---- what was reported to the ground

std::uint64_t AcceptanceJournal::said() const {
  std::uint64_t first_unsaid = serial_ + 1;
  for (const auto& [id, t] : entries_) {
    if (!t.reported) first_unsaid = std::min(first_unsaid, t.accepted_serial);
    if (t.end && !t.end_said) first_unsaid = std::min(first_unsaid, t.ended_serial);
  }
  for (const RefusedTelecommand& r : refused_) {
    if (!r.said) first_unsaid = std::min(first_unsaid, r.serial);
  }
  return first_unsaid - 1;
}

void AcceptanceJournal::on_refusal_said(std::uint64_t serial) {
  for (RefusedTelecommand& r : refused_) {
    if (r.serial == serial) r.said = true;
  }
}

void AcceptanceJournal::on_end_said(std::uint64_t id) {
  if (AcceptedTelecommand* t = find(id)) t->end_said = true;
}

// ---- writing

void AcceptanceJournal::on_told(std::uint64_t serial) {
  if (serial <= told_) return;
  told_ = serial;
  std::erase_if(refused_, [this](const RefusedTelecommand& r) { return r.serial <= told_; });
  OctetWriter writer;
  writer.u64(serial);
  add(Kind::told, std::move(writer));
}

void AcceptanceJournal::tell_again(const AcceptedTelecommand& telecommand, std::uint64_t told,
                                   ReportQueue& report_queue, bool stored) {
  if (!telecommand.reported) return;  // it will be, when it is durable
  const TelecommandOrigin& origin = telecommand.origin;
  if (telecommand.accepted_serial > told) report_queue.success_again(origin, Stage::acceptance, stored);
  if (telecommand.progress.started && telecommand.started_serial > told)
    report_queue.success_again(origin, Stage::start, stored);
  if (!telecommand.end || !telecommand.end_said || telecommand.ended_serial <= told) return;
  const StageReached& end = *telecommand.end;
  if (end.success) {
    report_queue.success_again(origin, end.stage, stored);
  } else {
    report_queue.failure_again(origin, end.stage, end.failure_code, end.data, end.step, stored);
  }
}

void AcceptanceJournal::tell_refused_again(ReportQueue& report_queue) {
  for (RefusedTelecommand& r : refused_) {
    report_queue.failure_again(r.origin, r.end.stage, r.end.failure_code, r.end.data, r.end.step, true);
    r.said = true;
  }
}

void AcceptanceJournal::add(std::uint8_t kind, OctetWriter&& payload) {
  assert(payload.ok());
  if (snapshot_wanted_) return;  // it will be in there
  pending_octets_ += payload.size();
  pending_.push_back(JournalRecord{.kind = kind, .payload = payload.take()});
  if (pending_octets_ <= max_pending_octets) return;
  pending_.clear();
  pending_octets_ = 0;
  snapshot_wanted_ = true;
}

Octets AcceptanceJournal::encode_snapshot() const {
  OctetWriter writer(journal_segment_octets);
  writer.u8(state_version);
  write_text(writer, boot_id_);
  writer.u64(next_id_);
  writer.u64(serial_);
  writer.u64(told_);
  write_link_state(writer, link_);
  writer.u16(static_cast<std::uint16_t>(entries_.size()));
  for (const auto& [id, t] : entries_) {
    write_telecommand(writer, t);
    write_progress(writer, t);
    if (t.end) write_end(writer, t.ended_serial, *t.end);
  }
  schedule_.write(writer);
  writer.u16(static_cast<std::uint16_t>(refused_.size()));
  for (const RefusedTelecommand& r : refused_) write_refused(writer, r);
  assert(writer.ok());
  return writer.take();
}

JournalBatch AcceptanceJournal::take_batch(bool sync) {
  assert(!writing_);
  writing_ = true;
  JournalBatch batch;
  batch.revision = revision_;
  batch.link = link_;
  if (snapshot_wanted_) {
    snapshot_wanted_ = false;
    batch.snapshot = encode_snapshot();
    batch.sync = true;
  } else {
    batch.records = std::exchange(pending_, {});
    batch.sync = sync;
  }
  pending_octets_ = 0;
  return batch;
}

void AcceptanceJournal::on_written(const JournalBatch& batch, bool success, std::size_t used_octets) {
  assert(writing_);
  writing_ = false;
  if (!success) {
    ++counters_.failed_writes;
    snapshot_wanted_ = true;
    pending_.clear();
    pending_octets_ = 0;
    return;
  }
  if (batch.snapshot) {
    counters_.written_octets += batch.snapshot->size() + journal_record_overhead;
    ++counters_.snapshots;
  }
  for (const JournalRecord& record : batch.records)
    counters_.written_octets += record.payload.size() + journal_record_overhead;
  unsynced_ = !batch.sync;
  if (batch.sync) ++counters_.syncs;
  // A state that fills a segment by itself is not written again and again.
  if (!batch.snapshot && used_octets > fill_octets_) {
    snapshot_wanted_ = true;
    pending_.clear();
    pending_octets_ = 0;
  }
}

}  // namespace srfs
