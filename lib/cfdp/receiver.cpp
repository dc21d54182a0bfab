// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "cfdp/receiver.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "cfdp/safe_name.hpp"

namespace srfs::cfdp {

using wire::CfdpAck;
using wire::CfdpEof;
using wire::CfdpFileData;
using wire::CfdpFileStatus;
using wire::CfdpFinished;
using wire::CfdpKeepAlive;
using wire::CfdpMetadata;
using wire::CfdpNak;
using wire::CfdpPrompt;

Receiver::Receiver(Context& context, const CfdpHeader& header, MonotonicTime now)
    : context_(&context),
      gaps_(context.settings.gaps_max, context.settings.nak_delay, context.settings.nak_interval),
      heard_at_(now),
      sender_heard_at_(now),
      metadata_ask_at_(now + context.settings.nak_delay),
      nak_round_at_(now) {
  state_.header = header;
}

std::optional<Receiver> Receiver::restore(Context& context, ReceiveState state, MonotonicTime now) {
  Receiver r(context, state.header, now);
  if (!r.gaps_.restore(state.gaps_end, state.gaps, now)) return std::nullopt;
  r.state_ = std::move(state);
  r.state_.gaps.clear();
  r.rested_since_heard_ = r.state_.rest == Rest::by_fault;
  r.finished_due_ = r.state_.stage == Stage::finished;
  if (r.finished_due_) return r;

  std::uint8_t octet = 0;
  const auto temporary = context.files.read_temporary(r.id(), 0, {&octet, 1});
  r.temporary_made_ = temporary.has_value();
  if (r.temporary_made_) {
    (void)r.begin_check_if_complete();  // it died after the last piece was recorded, and before the check was
  } else if (r.state_.stage == Stage::checking) {
    r.check_named_file_ = true;
  } else {
    r.start_over(now);
  }
  return r;
}

TransactionId Receiver::id() const {
  return {.source = state_.header.source_entity, .sequence = state_.header.sequence_number};
}

Report Receiver::report() const {
  Report report{
      .id = id(),
      .role = Role::receiving,
      .source_file = {},
      .destination_file = {},
      .file_octets = {},
      .progress_octets = gaps_.end() - gaps_.missing_octets(),
      .missing_octets = gaps_.missing_octets(),
      .waits_for_peer = state_.stage == Stage::finished,
      .rest = state_.rest,
      .operation = 0,
      .cancelled = state_.stage == Stage::finished && state_.outcome.condition != CfdpCondition::no_error};
  if (state_.file) {
    report.source_file = state_.file->source_file;
    report.destination_file = state_.file->destination_file;
    if (state_.file->octets > 0) report.file_octets = state_.file->octets;
  }
  if (state_.eof) report.file_octets = state_.eof->octets;
  return report;
}

ReceiveState Receiver::durable_state() {
  ReceiveState state = state_;
  state.gaps_end = gaps_.end();
  if (dirty_ && !context_->files.sync_temporary(id())) {
    // What the disk has of it is not known: after a crash everything is asked for again.
    if (state.gaps_end > 0) state.gaps.push_back({.start = 0, .end = state.gaps_end});
    if (state.stage == Stage::checking) state.stage = Stage::receiving;
    return state;
  }
  dirty_ = false;
  octets_unsaved_ = 0;
  for (const GapList::Gap& gap : gaps_.gaps()) state.gaps.push_back(gap.segment);
  return state;
}

std::uint64_t Receiver::stored_octets() const {
  return owns_temporary() ? gaps_.end() - gaps_.missing_octets() : 0;
}

std::uint64_t Receiver::octets_max() const {
  return std::min<std::uint64_t>(context_->settings.file_octets_max,
                                 state_.header.large_file ? std::numeric_limits<std::uint64_t>::max()
                                                          : std::numeric_limits<std::uint32_t>::max());
}

// ---- what the peer says -------------------------------------------------------------------------------

void Receiver::on_pdu(const CfdpBody& body, MonotonicTime now) {
  if (ended_) return;
  heard_at_ = now;
  sender_heard_at_ = now;
  rested_since_heard_ = false;
  heard_since_nak_ = true;
  if (state_.rest == Rest::by_fault) resume(now);
  if (const auto* data = std::get_if<CfdpFileData>(&body)) {
    on_file_data(*data, now);
  } else if (const auto* metadata = std::get_if<CfdpMetadata>(&body)) {
    on_metadata(*metadata, now);
  } else if (const auto* eof = std::get_if<CfdpEof>(&body)) {
    on_eof(*eof, now);
  } else if (const auto* ack = std::get_if<CfdpAck>(&body)) {
    on_ack(*ack);
  } else if (const auto* prompt = std::get_if<CfdpPrompt>(&body)) {
    on_prompt(*prompt, now);
  } else {
    ++context_->counters.unexpected;
  }
}

void Receiver::on_metadata(const CfdpMetadata& metadata, MonotonicTime now) {
  if (state_.file || state_.stage != Stage::receiving) return;  // a repeat
  state_.file = {.source_file = metadata.source_file,
                 .destination_file = context_->settings.safe_names ? safe_name(metadata.destination_file)
                                                                   : metadata.destination_file,
                 .octets = metadata.file_size,
                 .checksum_type = metadata.checksum_type,
                 .sha256 = sha256_of(metadata)};
  context_->report({.kind = EventKind::metadata_received, .id = id(), .role = Role::receiving});
  if (const auto fit = context_->files.check_destination(state_.file->destination_file); !fit) {
    return fault(CfdpCondition::filestore_rejection, now, fit.error());
  }
  const bool too_large =
      metadata.file_size > octets_max() || metadata.file_size > context_->settings.receiving_octets_max;
  if (too_large) return fault(CfdpCondition::filestore_rejection, now, FileFault::no_space);
  if (const auto room = context_->files.check_room(metadata.file_size); !room) {
    return fault(CfdpCondition::filestore_rejection, now, room.error());
  }
  if (!wire::CfdpChecksum::of_type(metadata.checksum_type)) {
    fault(CfdpCondition::unsupported_checksum_type, now);
    if (state_.stage != Stage::receiving || ended_) return;
    state_.file->checksum_type = static_cast<std::uint8_t>(wire::CfdpChecksumType::null);  // ignored
  }
  if (!temporary_made_) {
    if (const auto made = context_->files.create_temporary(id()); !made) {
      return fault(CfdpCondition::filestore_rejection, now, made.error());
    }
    temporary_made_ = true;
  }
  context_->save_checkpoint();
  begin_check_when_complete();
}

void Receiver::on_file_data(const CfdpFileData& data, MonotonicTime now) {
  if (state_.stage != Stage::receiving) {
    ++context_->counters.duplicate_data;
    return;
  }
  const CfdpSegment segment{.start = data.offset, .end = data.offset + data.data.size()};
  if (segment.end > octets_max() || (state_.eof && segment.end > state_.eof->octets)) {
    return fault(CfdpCondition::file_size_error, now);
  }
  switch (gaps_.judge(segment)) {
    case GapList::Taken::duplicate:
      ++context_->counters.duplicate_data;
      return;
    case GapList::Taken::refused:
      ++context_->counters.dropped_data;
      return;
    case GapList::Taken::new_octets:
      return store(data, now);
  }
}

void Receiver::store(const CfdpFileData& data, MonotonicTime now) {
  if (context_->receiving_octets() + data.data.size() > context_->settings.receiving_octets_max) {
    ++context_->counters.dropped_data;
    return fault(CfdpCondition::filestore_rejection, now, FileFault::no_space);
  }
  FileResult<void> written;
  if (!temporary_made_) {
    written = context_->files.create_temporary(id());
    temporary_made_ = written.has_value();
  }
  if (written) written = context_->files.write_temporary(id(), data.offset, data.data);
  if (!written) {
    ++context_->counters.dropped_data;
    return fault(CfdpCondition::filestore_rejection, now, written.error());
  }
  dirty_ = true;
  gaps_.fill({.start = data.offset, .end = data.offset + data.data.size()}, now);
  nak_rounds_ = 0;
  nak_round_at_ = now;
  octets_unsaved_ += data.data.size();
  begin_check_when_complete();
  if (octets_unsaved_ >= context_->settings.checkpoint_octets) context_->save_checkpoint();
}

void Receiver::on_eof(const CfdpEof& eof, MonotonicTime now) {
  if (eof.condition != CfdpCondition::no_error) {
    // Cancelled by the sender. The entity acknowledges, also when this is repeated.
    if (owns_temporary()) context_->files.discard_temporary(id());
    return end(state_.stage == Stage::finished ? state_.outcome
                                               : Outcome{.condition = eof.condition,
                                                         .incomplete = true,
                                                         .file_status = CfdpFileStatus::discarded});
  }
  ack_due_ = true;
  if (state_.stage == Stage::finished) finished_due_ = true;
  if (state_.stage != Stage::receiving) return;
  if (state_.eof) {
    if (*state_.eof != ReceiveState::End{.checksum = eof.checksum, .octets = eof.file_size}) {
      fault(CfdpCondition::file_size_error, now);
    }
    return;
  }
  if (eof.file_size < gaps_.end() || eof.file_size > octets_max()) {
    return fault(CfdpCondition::file_size_error, now);
  }
  state_.eof = {.checksum = eof.checksum, .octets = eof.file_size};
  gaps_.set_file_size(eof.file_size, now);
  metadata_ask_at_ = std::min(metadata_ask_at_, now);
  nak_rounds_ = 0;
  nak_round_at_ = now;
  context_->save_checkpoint();
  begin_check_when_complete();
}

void Receiver::on_ack(const CfdpAck& ack) {
  if (!ack.of_finished || state_.stage != Stage::finished) {
    ++context_->counters.unexpected;
    return;
  }
  end(state_.outcome);
}

void Receiver::on_prompt(const CfdpPrompt& prompt, MonotonicTime now) {
  if (state_.stage == Stage::finished) {
    finished_due_ = true;
  } else if (prompt.keep_alive) {
    keep_alive_due_ = true;
  } else {
    gaps_.ask_all(now);
    metadata_ask_at_ = now;
    nak_forced_ = true;
  }
}

// ---- the file -----------------------------------------------------------------------------------------

bool Receiver::begin_check_if_complete() {
  if (state_.stage != Stage::receiving || !state_.file || !state_.eof || !gaps_.complete()) return false;
  state_.stage = Stage::checking;
  return true;
}

void Receiver::begin_check_when_complete() {
  if (begin_check_if_complete()) context_->save_checkpoint();
}

void Receiver::check(MonotonicTime now) {
  if (!digest_) {
    if (!temporary_made_ && !check_named_file_) {  // an empty file of which no octet came
      if (const auto made = context_->files.create_temporary(id()); !made) {
        return fault(CfdpCondition::filestore_rejection, now, made.error());
      }
      temporary_made_ = true;
    }
    digest_.emplace(wire::CfdpChecksum::of_type(state_.file->checksum_type)
                        .value_or(wire::CfdpChecksum(wire::CfdpChecksumType::null)));
  }
  Octets chunk(
      std::min<std::uint64_t>(context_->settings.work_octets, state_.eof->octets - digest_->octets()));
  const auto read = check_named_file_
                        ? context_->files.read(state_.file->destination_file, digest_->octets(), chunk)
                        : context_->files.read_temporary(id(), digest_->octets(), chunk);
  if (!read || *read < chunk.size()) {
    digest_.reset();
    if (check_named_file_) return start_over(now);
    return fault(CfdpCondition::filestore_rejection, now, read ? FileFault::io : read.error());
  }
  digest_->update(chunk);
  if (digest_->octets() == state_.eof->octets) judge_digest(now);
}

void Receiver::judge_digest(MonotonicTime now) {
  const bool same = digest_->checksum() == state_.eof->checksum &&
                    (!state_.file->sha256 || digest_->finish() == *state_.file->sha256);
  digest_.reset();
  if (check_named_file_) {
    const auto stamp = context_->files.stamp(state_.file->destination_file);
    if (!same || !stamp || stamp->octets != state_.eof->octets) return start_over(now);
    return finish({});
  }
  if (!same && !checksum_ignored_) {
    fault(CfdpCondition::file_checksum_failure, now);
    if (!checksum_ignored_) return;
  }
  commit(now);
}

void Receiver::commit(MonotonicTime now) {
  const auto committed = context_->files.commit(id(), state_.eof->octets, state_.file->destination_file);
  if (!committed) return fault(CfdpCondition::filestore_rejection, now, committed.error());
  dirty_ = false;
  finish({.condition = checksum_ignored_ ? CfdpCondition::file_checksum_failure : CfdpCondition::no_error});
}

void Receiver::start_over(MonotonicTime now) {
  state_.stage = Stage::receiving;
  check_named_file_ = false;
  temporary_made_ = false;
  dirty_ = false;
  gaps_.reset(gaps_.end(), now);
  (void)begin_check_if_complete();  // an empty file
}

void Receiver::finish(const Outcome& outcome) {
  state_.stage = Stage::finished;
  state_.outcome = outcome;
  finished_due_ = true;
  attempts_ = 0;
  deadline_.reset();
  // Finished must not be said and then forgotten.
  context_->save_checkpoint();
}

void Receiver::end(const Outcome& outcome) {
  ended_ = outcome;
}

// ---- time ---------------------------------------------------------------------------------------------

void Receiver::advance(MonotonicTime now) {
  if (ended_ || state_.rest != Rest::none) return;
  switch (state_.stage) {
    case Stage::receiving:
      return advance_receiving(now);
    case Stage::checking:
      return check(now);
    case Stage::finished:
      if (!deadline_ || now < *deadline_) return;
      deadline_.reset();
      finished_due_ = attempts_ < context_->settings.ack_limit;
      if (!finished_due_) fault(CfdpCondition::positive_ack_limit, now);
  }
}

void Receiver::advance_receiving(MonotonicTime now) {
  if (now >= heard_at_ + context_->settings.inactivity_interval) {
    return fault(CfdpCondition::inactivity, now);
  }
  if (!state_.eof || now < nak_round_at_ + context_->settings.nak_interval) return;
  nak_round_at_ = now;
  if (++nak_rounds_ > context_->settings.nak_limit) fault(CfdpCondition::nak_limit, now);
}

void Receiver::restart_timers(MonotonicTime now) {
  heard_at_ = now;
  nak_round_at_ = now;
  nak_rounds_ = 0;
  if (deadline_) deadline_ = now + context_->settings.ack_interval;
}

bool Receiver::metadata_to_ask(MonotonicTime now) const {
  return !state_.file && now >= metadata_ask_at_ && may_repeat();
}

std::optional<MonotonicTime> Receiver::nak_due() const {
  auto due = gaps_.next_due(may_repeat());
  if (!state_.file && may_repeat() && (!due || metadata_ask_at_ < *due)) due = metadata_ask_at_;
  if (due) due = std::max(*due, nak_not_before_);
  return due;
}

std::optional<MonotonicTime> Receiver::next_due(MonotonicTime now) const {
  if (ended_) return now;
  if (state_.rest == Rest::by_request) return std::nullopt;
  if (ack_due_ || keep_alive_due_) return now;
  if (state_.rest != Rest::none) return std::nullopt;
  if (state_.stage == Stage::checking || finished_due_ || nak_forced_) return now;
  if (state_.stage == Stage::finished) return deadline_;
  auto due = heard_at_ + context_->settings.inactivity_interval;
  if (state_.eof) due = std::min(due, nak_round_at_ + context_->settings.nak_interval);
  if (const auto nak = nak_due()) due = std::min(due, *nak);
  return due;
}

// ---- what goes out ------------------------------------------------------------------------------------

std::optional<Outgoing> Receiver::next_pdu(std::size_t octets_max, MonotonicTime now) {
  if (ended_ || state_.rest == Rest::by_request) return std::nullopt;
  if (ack_due_) {
    ack_due_ = false;
    return Outgoing{.header = state_.header, .body = CfdpAck{}};
  }
  if (keep_alive_due_) {
    keep_alive_due_ = false;
    return Outgoing{.header = state_.header, .body = CfdpKeepAlive{.progress = gaps_.end()}};
  }
  if (state_.rest != Rest::none) return std::nullopt;
  if (state_.stage == Stage::receiving) return nak(octets_max, now);
  nak_forced_ = false;
  if (state_.stage != Stage::finished || !finished_due_) return std::nullopt;
  finished_due_ = false;
  ++attempts_;
  deadline_ = now + context_->settings.ack_interval;
  CfdpFinished finished{.condition = state_.outcome.condition,
                        .incomplete = state_.outcome.incomplete,
                        .file_status = state_.outcome.file_status};
  if (finished.condition != CfdpCondition::no_error) {
    finished.fault_location = state_.header.destination_entity;
  }
  return Outgoing{.header = state_.header, .body = finished};
}

std::optional<Outgoing> Receiver::nak(std::size_t octets_max, MonotonicTime now) {
  if (now < nak_not_before_ && !nak_forced_) return std::nullopt;
  const std::size_t room = wire::cfdp_nak_segments_max(state_.header, octets_max);
  const bool ask_metadata = metadata_to_ask(now);
  CfdpNak nak;
  nak.segments = gaps_.take_due(room - (ask_metadata ? 1 : 0), may_repeat(), now);
  if (nak.segments.empty() && !ask_metadata && !nak_forced_) return std::nullopt;
  // The scope is what this PDU speaks of: between its first and its last segment nothing else is missing
  // that is due.
  nak.scope = nak.segments.empty()
                  ? CfdpSegment{.start = 0, .end = gaps_.end()}
                  : CfdpSegment{.start = nak.segments.front().start, .end = nak.segments.back().end};
  if (ask_metadata) {
    nak.scope.start = 0;
    nak.segments.insert(nak.segments.begin(), CfdpSegment{});
    metadata_ask_at_ = now + context_->settings.nak_interval;
  }
  nak_forced_ = false;
  nak_not_before_ = now + context_->settings.nak_spacing;
  heard_since_nak_ = false;
  return Outgoing{.header = state_.header, .body = std::move(nak)};
}

// ---- faults -------------------------------------------------------------------------------------------

void Receiver::fault(CfdpCondition condition, MonotonicTime now, std::optional<FileFault> why) {
  FaultHandler handler = context_->settings.fault_handlers.of(condition);
  // There is no going on without a place for the file.
  if (condition == CfdpCondition::filestore_rejection && handler == FaultHandler::ignore) {
    handler = FaultHandler::cancel;
  }
  // Only the acknowledgement of Finished is missing, and the history still answers a sender that asks for
  // Finished again: what rested here would repeat it after every contact, for ever.
  if (state_.stage == Stage::finished && handler != FaultHandler::ignore) handler = FaultHandler::abandon;
  context_->report({.kind = EventKind::fault,
                    .id = id(),
                    .role = Role::receiving,
                    .outcome = {.condition = condition},
                    .handler = handler,
                    .file_fault = why});
  switch (handler) {
    case FaultHandler::cancel:
      return cancel(condition, now);
    case FaultHandler::suspend:
      return suspend(Rest::by_fault);
    case FaultHandler::ignore:
      checksum_ignored_ = checksum_ignored_ || condition == CfdpCondition::file_checksum_failure;
      attempts_ = 0;
      if (state_.stage == Stage::finished) finished_due_ = true;
      restart_timers(now);
      return;
    case FaultHandler::abandon:
      return end_in_silence(condition);
  }
}

void Receiver::end_in_silence(CfdpCondition condition) {
  if (owns_temporary()) context_->files.discard_temporary(id());
  end(state_.stage == Stage::finished
          ? state_.outcome
          : Outcome{.condition = condition, .incomplete = true, .file_status = CfdpFileStatus::discarded});
}

std::optional<MonotonicTime> Receiver::in_vain_since() const {
  const bool waits = !ended_ && state_.stage == Stage::receiving && state_.rest != Rest::by_request;
  if (!waits || !rested_since_heard_ || stored_octets() > 0) return std::nullopt;
  return sender_heard_at_;
}

void Receiver::abandon() {
  context_->report({.kind = EventKind::fault,
                    .id = id(),
                    .role = Role::receiving,
                    .outcome = {.condition = CfdpCondition::inactivity},
                    .handler = FaultHandler::abandon});
  end_in_silence(CfdpCondition::inactivity);
}

void Receiver::cancel(CfdpCondition condition, MonotonicTime) {
  if (ended_) return;
  if (state_.stage == Stage::finished) return end(state_.outcome);  // only its acknowledgement is missing
  context_->files.discard_temporary(id());
  temporary_made_ = false;
  dirty_ = false;
  digest_.reset();
  state_.rest = Rest::none;
  const bool rejected = condition == CfdpCondition::filestore_rejection;
  finish({.condition = condition,
          .incomplete = !(state_.eof && gaps_.complete()),
          .file_status = rejected ? CfdpFileStatus::rejected : CfdpFileStatus::discarded});
}

void Receiver::suspend(Rest rest) {
  if (ended_ || state_.rest == Rest::by_request) return;
  state_.rest = rest;
  rested_since_heard_ = rested_since_heard_ || rest == Rest::by_fault;
  context_->report({.kind = EventKind::suspended, .id = id(), .role = Role::receiving});
  context_->save_checkpoint();
}

void Receiver::resume(MonotonicTime now) {
  if (ended_ || state_.rest == Rest::none) return;
  state_.rest = Rest::none;
  attempts_ = 0;
  deadline_.reset();
  finished_due_ = state_.stage == Stage::finished;
  nak_forced_ = state_.stage == Stage::receiving;  // a sender that has forgotten the file says so
  heard_since_nak_ = true;
  metadata_ask_at_ = now + context_->settings.nak_delay;
  nak_not_before_ = now;
  gaps_.ask_all(now);
  restart_timers(now);
  context_->report({.kind = EventKind::resumed, .id = id(), .role = Role::receiving});
  context_->save_checkpoint();
}

}  // namespace srfs::cfdp
