// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "cfdp/sender.hpp"

#include <algorithm>
#include <cassert>
#include <utility>

namespace srfs::cfdp {

using wire::CfdpAck;
using wire::CfdpEof;
using wire::CfdpFileStatus;
using wire::CfdpFinished;
using wire::CfdpKeepAlive;
using wire::CfdpMetadata;
using wire::CfdpNak;

Sender::Sender(Context& context, SendState state)
    : context_(context), state_(std::move(state)), retransmit_(context.settings.gaps_max) {
  data_.reserve(context.settings.file_data_octets);
  // Of a checkpoint: the metadata goes first again, so that the receiver knows that its sender is back.
  sent_ = state_.reserved;
  sent_before_ = sent_;
  eof_due_ = cancelling() || all_sent();
}

TransactionId Sender::id() const {
  return {.source = state_.header.source_entity, .sequence = state_.header.sequence_number};
}

Report Sender::report() const {
  Report report{.id = id(),
                .role = Role::sending,
                .source_file = state_.source_file,
                .destination_file = state_.destination_file,
                .file_octets = {},
                .progress_octets = sent_,
                .missing_octets = 0,
                .waits_for_peer = all_sent() && retransmit_.empty(),
                .rest = state_.rest,
                .operation = state_.operation,
                .cancelled = cancelling()};
  if (state_.prepared) report.file_octets = state_.stamp.octets;
  report.missing_octets = retransmit_.octets();
  return report;
}

// ---- the file -----------------------------------------------------------------------------------------

std::optional<CfdpCondition> Sender::file_changed(std::optional<FileFault>& why) {
  const auto stamp = context_.files.stamp(state_.source_file);
  if (!stamp) {
    why = stamp.error();
    return CfdpCondition::filestore_rejection;
  }
  if (stamp->octets != state_.stamp.octets) return CfdpCondition::file_size_error;
  if (*stamp != state_.stamp) return CfdpCondition::file_checksum_failure;
  return std::nullopt;
}

void Sender::prepare() {
  const auto refuse = [&](CfdpCondition condition, std::optional<FileFault> why) {
    context_.report({.kind = EventKind::fault,
                     .id = id(),
                     .outcome = {.condition = condition},
                     .handler = FaultHandler::cancel,
                     .file_fault = why});
    // Nothing has left yet, so there is no peer to notify.
    end({.condition = condition, .incomplete = true, .file_status = CfdpFileStatus::unreported});
  };
  if (!digest_) {
    const auto stamp = context_.files.stamp(state_.source_file);
    if (!stamp) return refuse(CfdpCondition::filestore_rejection, stamp.error());
    if (stamp->octets > context_.settings.file_octets_max) return refuse(CfdpCondition::file_size_error, {});
    state_.stamp = *stamp;
    digest_.emplace(wire::CfdpChecksum(state_.checksum_type));
  }
  Octets chunk(
      std::min<std::uint64_t>(context_.settings.work_octets, state_.stamp.octets - digest_->octets()));
  const auto read = context_.files.read(state_.source_file, digest_->octets(), chunk);
  if (!read) return refuse(CfdpCondition::filestore_rejection, read.error());
  digest_->update(OctetView(chunk).first(*read));
  if (*read < chunk.size()) return refuse(CfdpCondition::file_size_error, {});
  if (digest_->octets() < state_.stamp.octets) return;

  std::optional<FileFault> why;
  if (const auto changed = file_changed(why)) return refuse(*changed, why);
  state_.checksum = digest_->checksum();
  state_.sha256 = digest_->finish();
  digest_.reset();
  state_.prepared = true;
  state_.header.large_file = state_.stamp.octets > UINT32_MAX;
  eof_due_ = all_sent();
  context_.save_checkpoint();
}

// ---- what the peer says -------------------------------------------------------------------------------

void Sender::on_pdu(const CfdpBody& body, MonotonicTime now) {
  if (outcome_) return;
  if (!state_.prepared) {
    ++context_.counters.unexpected;
    return;
  }
  if (state_.rest == Rest::by_fault) resume();
  attempts_ = 0;
  if (const auto* ack = std::get_if<CfdpAck>(&body)) return on_ack(*ack, now);
  if (const auto* nak = std::get_if<CfdpNak>(&body)) {
    if (state_.eof_acknowledged && deadline_) deadline_ = now + context_.settings.inactivity_interval;
    return on_nak(*nak);
  }
  if (const auto* finished = std::get_if<CfdpFinished>(&body)) return on_finished(*finished);
  if (const auto* keep_alive = std::get_if<CfdpKeepAlive>(&body)) return on_keep_alive(*keep_alive);
  ++context_.counters.unexpected;
}

void Sender::on_ack(const CfdpAck& ack, MonotonicTime now) {
  if (ack.of_finished || ack.condition != state_.cancelled || !(all_sent() || cancelling())) {
    ++context_.counters.unexpected;
    return;
  }
  if (cancelling()) {
    return end(
        {.condition = state_.cancelled, .incomplete = true, .file_status = CfdpFileStatus::unreported});
  }
  eof_due_ = false;
  state_.eof_acknowledged = true;
  deadline_ = now + context_.settings.inactivity_interval;
}

void Sender::on_nak(const CfdpNak& nak) {
  if (cancelling()) return;
  reminders_ = 0;
  for (CfdpSegment segment : nak.segments) {
    if (segment.start == 0 && segment.end == 0) metadata_due_ = true;
    // What was not sent yet comes by itself.
    segment.end = std::min(segment.end, sent_);
    if (segment.start >= segment.end) continue;
    const std::uint64_t asked_for = retransmit_.octets();
    if (!retransmit_.add(segment)) ++context_.counters.dropped_segments;
    if (segment.start >= sent_before_) context_.frame_fit.on_lost(retransmit_.octets() - asked_for);
  }
}

void Sender::on_finished(const CfdpFinished& finished) {
  const bool success = finished.condition == CfdpCondition::no_error;
  if (success && !all_sent()) {
    ++context_.counters.unexpected;
    return;
  }
  end({.condition = finished.condition,
       .incomplete = finished.incomplete,
       .file_status = finished.file_status});
}

void Sender::on_keep_alive(const CfdpKeepAlive& keep_alive) {
  const std::uint64_t limit = context_.settings.keep_alive_limit_octets;
  if (limit > 0 && !cancelling() && keep_alive.progress + limit < sent_) {
    fault(CfdpCondition::keep_alive_limit);
  }
}

// ---- time ---------------------------------------------------------------------------------------------

void Sender::advance(MonotonicTime now) {
  if (outcome_ || state_.rest != Rest::none) return;
  if (!state_.prepared) return prepare();
  if (deadline_ && now >= *deadline_) on_deadline();
}

void Sender::on_deadline() {
  deadline_.reset();
  if (!state_.eof_acknowledged) {
    eof_due_ = attempts_ < context_.settings.ack_limit;
    if (!eof_due_) fault(CfdpCondition::positive_ack_limit);
    return;
  }
  // Another EOF makes the receiver say how far it is.
  eof_due_ = reminders_ < context_.settings.inactivity_limit;
  ++reminders_;
  if (!eof_due_) fault(CfdpCondition::inactivity);
}

void Sender::restart_timers(MonotonicTime now) {
  if (!deadline_) return;
  deadline_ = now + (state_.eof_acknowledged ? context_.settings.inactivity_interval
                                             : context_.settings.ack_interval);
}

std::optional<MonotonicTime> Sender::next_due(MonotonicTime now) const {
  if (outcome_) return now;
  if (state_.rest != Rest::none) return std::nullopt;
  if (!state_.prepared || has_output()) return now;
  return deadline_;
}

// ---- what goes out ------------------------------------------------------------------------------------

bool Sender::has_output() const {
  if (outcome_ || state_.rest != Rest::none || !state_.prepared) return false;
  if (cancelling()) return eof_due_;
  return metadata_due_ || !retransmit_.empty() || !all_sent() || eof_due_;
}

std::optional<Outgoing> Sender::next_pdu(std::size_t octets_max, const FrameFill& frame, MonotonicTime now) {
  if (!has_output()) return std::nullopt;
  if (cancelling()) return eof(now);
  if (metadata_due_) {
    metadata_due_ = false;
    return metadata();
  }
  if (!retransmit_.empty() || !all_sent()) return file_data(octets_max, frame, now);
  return eof(now);
}

Outgoing Sender::metadata() const {
  return {.header = state_.header,
          .body = CfdpMetadata{.checksum_type = static_cast<std::uint8_t>(state_.checksum_type),
                               .file_size = state_.stamp.octets,
                               .source_file = state_.source_file,
                               .destination_file = state_.destination_file,
                               .options = {sha256_option(state_.sha256)}}};
}

Outgoing Sender::eof(MonotonicTime now) {
  eof_due_ = false;
  ++attempts_;
  deadline_ = now + (state_.eof_acknowledged ? context_.settings.inactivity_interval
                                             : context_.settings.ack_interval);
  CfdpEof eof{.condition = state_.cancelled};
  if (cancelling()) {
    // Of what was sent so far. A cancelled file is not checked, so it is not read again for its checksum.
    eof.file_size = sent_;
    eof.fault_location = state_.header.source_entity;
  } else {
    eof.checksum = state_.checksum;
    eof.file_size = state_.stamp.octets;
  }
  return {.header = state_.header, .body = eof};
}

std::optional<Outgoing> Sender::file_data(std::size_t octets_max, const FrameFill& frame, MonotonicTime now) {
  const std::size_t overhead = wire::cfdp_file_data_overhead(state_.header);
  assert(octets_max > overhead);
  const std::uint64_t octets = context_.frame_fit.file_octets(
      frame, overhead, std::min(octets_max - overhead, context_.settings.file_data_octets));
  auto segment = retransmit_.take(octets);
  const bool is_new = !segment;
  if (is_new) {
    segment = CfdpSegment{.start = sent_, .end = std::min(sent_ + octets, state_.stamp.octets)};
  }

  std::optional<FileFault> why;
  auto problem = file_changed(why);
  data_.resize(segment->end - segment->start);
  if (!problem) {
    const auto read = context_.files.read(state_.source_file, segment->start, data_);
    if (!read) {
      problem = CfdpCondition::filestore_rejection;
      why = read.error();
    } else if (*read < data_.size()) {
      problem = CfdpCondition::file_size_error;
    }
  }
  if (problem) {
    fault(*problem, why);
    return next_pdu(octets_max, frame, now);  // the EOF of a cancellation, or nothing
  }
  if (is_new) {
    if (segment->end > state_.reserved) {
      state_.reserved = std::min(segment->end + context_.settings.reserve_octets, state_.stamp.octets);
      context_.save_checkpoint();
    }
    sent_ = segment->end;
    eof_due_ = all_sent();
  }
  if (segment->start >= sent_before_)
    context_.frame_fit.on_sent(frame, overhead + data_.size(), data_.size());
  return Outgoing{.header = state_.header,
                  .body = wire::CfdpFileData{.offset = segment->start, .data = data_}};
}

// ---- faults -------------------------------------------------------------------------------------------

void Sender::fault(CfdpCondition condition, std::optional<FileFault> why) {
  const bool is_of_file = condition == CfdpCondition::filestore_rejection ||
                          condition == CfdpCondition::file_size_error ||
                          condition == CfdpCondition::file_checksum_failure;
  FaultHandler handler = context_.settings.fault_handlers.of(condition);
  // There is no sending of a file that is not there any more.
  if (is_of_file && handler == FaultHandler::ignore) handler = FaultHandler::cancel;
  // The end of a cancellation that is not acknowledged.
  if (cancelling()) handler = FaultHandler::abandon;
  context_.report({.kind = EventKind::fault,
                   .id = id(),
                   .outcome = {.condition = condition},
                   .handler = handler,
                   .file_fault = why});
  switch (handler) {
    case FaultHandler::cancel:
      return cancel(condition);
    case FaultHandler::suspend:
      return suspend(Rest::by_fault);
    case FaultHandler::ignore:
      attempts_ = 0;
      reminders_ = 0;
      eof_due_ = all_sent();
      return;
    case FaultHandler::abandon:
      return end({.condition = cancelling() ? state_.cancelled : condition,
                  .incomplete = true,
                  .file_status = CfdpFileStatus::unreported});
  }
}

void Sender::cancel(CfdpCondition condition) {
  if (outcome_ || cancelling()) return;
  if (!state_.prepared) {
    return end({.condition = condition, .incomplete = true, .file_status = CfdpFileStatus::unreported});
  }
  state_.cancelled = condition;
  state_.rest = Rest::none;
  state_.eof_acknowledged = false;
  retransmit_.clear();
  attempts_ = 0;
  deadline_.reset();
  eof_due_ = true;
  context_.save_checkpoint();
}

void Sender::suspend(Rest rest) {
  if (outcome_ || state_.rest == Rest::by_request) return;
  state_.rest = rest;
  deadline_.reset();
  context_.report({.kind = EventKind::suspended, .id = id()});
  context_.save_checkpoint();
}

void Sender::resume() {
  if (outcome_ || state_.rest == Rest::none) return;
  state_.rest = Rest::none;
  attempts_ = 0;
  reminders_ = 0;
  eof_due_ = cancelling() || all_sent();
  context_.report({.kind = EventKind::resumed, .id = id()});
  context_.save_checkpoint();
}

void Sender::end(const Outcome& outcome) {
  outcome_ = outcome;
  deadline_.reset();
}

}  // namespace srfs::cfdp
