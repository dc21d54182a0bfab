// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "cfdp/entity.hpp"

#include <algorithm>
#include <cassert>
#include <numeric>

namespace srfs::cfdp {
namespace {

using wire::CfdpAck;
using wire::CfdpEof;
using wire::CfdpFinished;
using wire::CfdpNak;
using wire::CfdpTransactionStatus;

}  // namespace

std::string_view to_string(PutError error) {
  switch (error) {
    case PutError::no_room:
      return "too many transactions";
    case PutError::name_too_long:
      return "file name is empty or longer than 255 octets";
    case PutError::file_refused:
      return "file cannot be read";
    case PutError::file_too_large:
      return "file is too large";
  }
  return "?";
}

Entity::Entity(const Settings& settings_, FileStore& files_, std::uint64_t first_sequence)
    : Context(settings_, files_), next_sequence_(first_sequence) {
  senders_.reserve(settings.transactions_max);
  receivers_.reserve(settings.transactions_max);
}

Result<void, CheckpointError> Entity::restore(OctetView checkpoint, MonotonicTime now) {
  assert(senders_.empty() && receivers_.empty());
  Result<Checkpoint, CheckpointError> state;
  if (!checkpoint.empty()) {
    state = decode_checkpoint(checkpoint);
    if (state && state->entity != settings.own_entity) state = Err(CheckpointError::other_entity);
  } else {
    state->next_sequence = next_sequence_;
  }
  std::vector<TransactionId> received;
  if (state) {
    for (const ReceiveState& r : state->receivers) {
      received.push_back({.source = r.header.source_entity, .sequence = r.header.sequence_number});
    }
  }
  files.discard_temporaries_except(received);
  if (!state) return Err(state.error());
  // While the disk failed numbers beyond those of the checkpoint may have been used: the peer would take a
  // new file for one that it has. So the checkpoint is not ahead of what was used, and the first number is.
  next_sequence_ = std::max(next_sequence_, state->next_sequence);
  for (const Ended& e : state->history) {
    if (history_.size() == settings.history_max) history_.pop_front();
    history_.push_back(e);
  }
  for (SendState& s : state->senders) {
    if (has_room()) senders_.push_back(std::make_unique<Sender>(context(), std::move(s)));
  }
  bool check_begins = false;
  for (ReceiveState& r : state->receivers) {
    if (!has_room()) break;
    const bool was_receiving = r.stage == ReceiveState::Stage::receiving;
    // One whose gaps are too many for the settings of today is as good as unknown: its sender begins anew.
    auto restored = Receiver::restore(*this, std::move(r), now);
    if (!restored) continue;
    check_begins = check_begins || (was_receiving && restored->is_checking());
    receivers_.push_back(std::make_unique<Receiver>(std::move(*restored)));
  }
  if (check_begins) save_checkpoint();  // before the file gets its name
  return {};
}

// ---- orders -------------------------------------------------------------------------------------------

Result<TransactionId, PutError> Entity::put(std::string_view source_file, std::string_view destination_file,
                                            std::uint64_t operation) {
  for (const std::string_view name : {source_file, destination_file}) {
    if (name.empty() || name.size() > wire::cfdp_name_octets_max) return Err(PutError::name_too_long);
  }
  if (!has_room()) return Err(PutError::no_room);
  const auto stamp = files.stamp(source_file);
  if (!stamp) return Err(PutError::file_refused);
  if (stamp->octets > settings.file_octets_max) return Err(PutError::file_too_large);

  SendState state;
  state.header = {.crc = settings.crc,
                  .entity_id_octets = settings.entity_id_octets,
                  .sequence_number_octets = settings.sequence_number_octets,
                  .source_entity = settings.own_entity,
                  .destination_entity = settings.peer_entity};
  const std::uint64_t numbers = settings.sequence_number_octets >= 8
                                    ? UINT64_MAX
                                    : (std::uint64_t{1} << 8 * settings.sequence_number_octets) - 1;
  state.header.sequence_number = next_sequence_++ & numbers;
  state.source_file = source_file;
  state.destination_file = destination_file;
  state.checksum_type = settings.checksum;
  state.operation = operation;
  senders_.push_back(std::make_unique<Sender>(context(), std::move(state)));
  const TransactionId id = senders_.back()->id();
  report({.kind = EventKind::started, .id = id});
  save_checkpoint();
  return id;
}

bool Entity::cancel(TransactionId id, MonotonicTime now) {
  if (Sender* s = sender(id)) {
    s->cancel(CfdpCondition::cancel_request);
  } else if (Receiver* r = receiver(id)) {
    r->cancel(CfdpCondition::cancel_request, now);
  } else {
    return false;
  }
  settle();
  return true;
}

bool Entity::suspend(TransactionId id) {
  if (Sender* s = sender(id)) {
    s->suspend(Rest::by_request);
  } else if (Receiver* r = receiver(id)) {
    r->suspend(Rest::by_request);
  } else {
    return false;
  }
  return true;
}

bool Entity::resume(TransactionId id, MonotonicTime now) {
  if (Sender* s = sender(id)) {
    s->resume();
  } else if (Receiver* r = receiver(id)) {
    r->resume(now);
  } else {
    return false;
  }
  return true;
}

void Entity::set_link(bool available, MonotonicTime now) {
  if (available && !link_available_) {
    for (const auto& s : senders_) s->restart_timers(now);
    for (const auto& r : receivers_) r->restart_timers(now);
  }
  link_available_ = available;
}

// ---- what the link brings -----------------------------------------------------------------------------

void Entity::on_pdu(OctetView octets, MonotonicTime now) {
  const auto pdu = wire::decode_cfdp_pdu(octets);
  if (!pdu) {
    ++counters.malformed[static_cast<std::size_t>(pdu.error())];
    return;
  }
  ++counters.pdus_received;
  if (pdu->header.unacknowledged) {
    ++counters.class_1;
    return;
  }
  const bool is_own = wire::is_toward_sender(pdu->body);
  const std::uint64_t source = is_own ? settings.own_entity : settings.peer_entity;
  const std::uint64_t destination = is_own ? settings.peer_entity : settings.own_entity;
  if (pdu->header.source_entity != source || pdu->header.destination_entity != destination) {
    ++counters.not_for_us;
    return;
  }
  if (is_own) {
    to_sender(*pdu, now);
  } else {
    to_receiver(*pdu, now);
  }
}

void Entity::to_sender(const wire::CfdpPdu& pdu, MonotonicTime now) {
  const TransactionId id{.source = pdu.header.source_entity, .sequence = pdu.header.sequence_number};
  Sender* const s = sender(id);
  const auto* finished = std::get_if<CfdpFinished>(&pdu.body);
  auto status = CfdpTransactionStatus::terminated;
  if (s != nullptr) {
    s->on_pdu(pdu.body, now);
    if (!s->outcome()) return;
    settle();  // on disk before the peer may forget it
  } else if (ended(id) != nullptr) {
    ++counters.late;
  } else {
    ++counters.no_transaction;
    status = CfdpTransactionStatus::unrecognized;
  }
  // Its receiver waits for a file that nobody sends any more, or that has another number now.
  if (s == nullptr && std::holds_alternative<CfdpNak>(pdu.body))
    reply(pdu.header,
          CfdpEof{.condition = CfdpCondition::cancel_request, .fault_location = settings.own_entity});
  if (finished == nullptr) return;
  reply(pdu.header, CfdpAck{.of_finished = true, .condition = finished->condition, .status = status});
}

void Entity::to_receiver(const wire::CfdpPdu& pdu, MonotonicTime now) {
  const TransactionId id{.source = pdu.header.source_entity, .sequence = pdu.header.sequence_number};
  Receiver* const r = receiver(id);
  if (r == nullptr) return to_unknown_receiver(pdu, now);
  r->on_pdu(pdu.body, now);
  const auto* eof = std::get_if<CfdpEof>(&pdu.body);
  if (eof != nullptr && eof->condition != CfdpCondition::no_error) {
    reply(pdu.header, CfdpAck{.condition = eof->condition, .status = CfdpTransactionStatus::terminated});
  }
  settle();
}

void Entity::to_unknown_receiver(const wire::CfdpPdu& pdu, MonotonicTime now) {
  const TransactionId id{.source = pdu.header.source_entity, .sequence = pdu.header.sequence_number};
  const auto* eof = std::get_if<CfdpEof>(&pdu.body);
  if (const Ended* const before = ended(id)) {
    ++counters.late;
    if (eof == nullptr) return;
    reply(pdu.header, CfdpAck{.condition = eof->condition, .status = CfdpTransactionStatus::terminated});
    if (eof->condition != CfdpCondition::no_error) return;
    // The sender did not record how it ended.
    reply(pdu.header, CfdpFinished{.condition = before->outcome.condition,
                                   .incomplete = before->outcome.incomplete,
                                   .file_status = before->outcome.file_status});
    return;
  }
  const bool cancels = eof != nullptr && eof->condition != CfdpCondition::no_error;
  if (cancels || std::holds_alternative<CfdpAck>(pdu.body) ||
      std::holds_alternative<wire::CfdpPrompt>(pdu.body)) {
    ++counters.no_transaction;
    if (!cancels) return;
    reply(pdu.header, CfdpAck{.condition = eof->condition, .status = CfdpTransactionStatus::unrecognized});
    return;
  }
  if (!has_room_to_receive()) make_room_to_receive();
  if (!has_room_to_receive()) {
    ++counters.no_room;
    return;
  }
  receivers_.push_back(std::make_unique<Receiver>(context(), pdu.header, now));
  report({.kind = EventKind::started, .id = id, .role = Role::receiving});
  receivers_.back()->on_pdu(pdu.body, now);
  settle();
}

// ---- what goes out ------------------------------------------------------------------------------------

void Entity::advance(MonotonicTime now) {
  if (!link_available_) return;
  for (const auto& s : senders_) s->advance(now);
  for (const auto& r : receivers_) r->advance(now);
  settle();
}

std::optional<Octets> Entity::next_pdu(std::size_t octets_max, MonotonicTime now, const FrameFill& frame) {
  assert(octets_max >= pdu_octets_min);
  if (!link_available_) return std::nullopt;
  advance(now);
  const auto out = next_outgoing(octets_max, frame, now);
  std::optional<Octets> octets;
  if (out) {
    octets = wire::encode_cfdp_pdu(out->header, out->body);
    assert(octets->size() <= octets_max);
    ++counters.pdus_sent;
  }
  settle();
  return octets;
}

std::optional<Outgoing> Entity::next_outgoing(std::size_t octets_max, const FrameFill& frame,
                                              MonotonicTime now) {
  if (!replies_.empty()) {
    Outgoing out = std::move(replies_.front());
    replies_.pop_front();
    return out;
  }
  for (const auto& r : receivers_) {
    if (auto out = r->next_pdu(octets_max, now)) return out;
  }
  for (const auto& s : senders_) {
    if (auto out = s->next_pdu(octets_max, frame, now)) return out;
  }
  return std::nullopt;
}

std::optional<MonotonicTime> Entity::next_due(MonotonicTime now) const {
  if (!link_available_) return std::nullopt;
  if (!replies_.empty()) return now;
  std::optional<MonotonicTime> first;
  const auto consider = [&](std::optional<MonotonicTime> due) {
    if (due && (!first || *due < *first)) first = due;
  };
  for (const auto& s : senders_) consider(s->next_due(now));
  for (const auto& r : receivers_) consider(r->next_due(now));
  return first;
}

void Entity::reply(const CfdpHeader& header, const CfdpBody& body) {
  if (replies_.size() == settings.replies_max) {
    ++counters.dropped_replies;
    return;
  }
  replies_.push_back({.header = header, .body = body});
}

// ---- ends, and what is remembered ---------------------------------------------------------------------

void Entity::settle() {
  std::size_t removed = 0;
  for (std::size_t i = 0; i < senders_.size();) {
    if (!senders_[i]->outcome()) {
      ++i;
      continue;
    }
    remember(senders_[i]->id(), Role::sending, *senders_[i]->outcome());
    senders_.erase(senders_.begin() + static_cast<std::ptrdiff_t>(i));
    ++removed;
  }
  for (std::size_t i = 0; i < receivers_.size();) {
    if (!receivers_[i]->ended()) {
      ++i;
      continue;
    }
    remember(receivers_[i]->id(), Role::receiving, *receivers_[i]->ended());
    receivers_.erase(receivers_.begin() + static_cast<std::ptrdiff_t>(i));
    ++removed;
  }
  if (removed > 0) save_checkpoint();
}

void Entity::remember(TransactionId id, Role role, const Outcome& outcome) {
  if (history_.size() == settings.history_max) history_.pop_front();
  history_.push_back({.id = id, .outcome = outcome});
  report({.kind = EventKind::finished, .id = id, .role = role, .outcome = outcome});
}

void Entity::report(const Event& event) {
  if (events_.size() == settings.events_max) {
    events_.pop_front();
    ++counters.dropped_events;
  }
  events_.push_back(event);
}

void Entity::save_checkpoint() {
  Checkpoint checkpoint;
  checkpoint.entity = settings.own_entity;
  checkpoint.next_sequence = next_sequence_;
  for (const auto& s : senders_) checkpoint.senders.push_back(s->state());
  for (const auto& r : receivers_) checkpoint.receivers.push_back(r->durable_state());
  checkpoint.history.assign(history_.begin(), history_.end());
  if (files.save_checkpoint(encode_checkpoint(checkpoint))) {
    ++counters.checkpoints;
    return;
  }
  ++counters.checkpoint_failures;
  const bool said = !events_.empty() && events_.back().kind == EventKind::checkpoint_failed;
  if (!said) report({.kind = EventKind::checkpoint_failed});
}

std::uint64_t Entity::receiving_octets() const {
  return std::accumulate(receivers_.begin(), receivers_.end(), std::uint64_t{0},
                         [](std::uint64_t sum, const auto& r) { return sum + r->stored_octets(); });
}

std::vector<Event> Entity::take_events() {
  std::vector<Event> events(events_.begin(), events_.end());
  events_.clear();
  return events;
}

std::vector<Report> Entity::transactions() const {
  std::vector<Report> reports;
  for (const auto& s : senders_) reports.push_back(s->report());
  for (const auto& r : receivers_) reports.push_back(r->report());
  return reports;
}

std::optional<Outcome> Entity::outcome_of(TransactionId id) const {
  const Ended* const e = ended(id);
  return e == nullptr ? std::nullopt : std::optional(e->outcome);
}

const Ended* Entity::ended(TransactionId id) const {
  const auto found =
      std::find_if(history_.begin(), history_.end(), [&](const Ended& e) { return e.id == id; });
  return found == history_.end() ? nullptr : &*found;
}

Sender* Entity::sender(TransactionId id) {
  for (const auto& s : senders_) {
    if (s->id() == id) return s.get();
  }
  return nullptr;
}

Receiver* Entity::receiver(TransactionId id) {
  for (const auto& r : receivers_) {
    if (r->id() == id) return r.get();
  }
  return nullptr;
}

bool Entity::has_room() const {
  return senders_.size() + receivers_.size() < settings.transactions_max;
}

bool Entity::has_room_to_receive() const {
  return has_room() && receivers_.size() < settings.receiving_max;
}

void Entity::make_room_to_receive() {
  Receiver* oldest = nullptr;
  for (const auto& r : receivers_) {
    const auto since = r->in_vain_since();
    if (since && (oldest == nullptr || *since < *oldest->in_vain_since())) oldest = r.get();
  }
  if (oldest == nullptr) return;
  ++counters.displaced;
  oldest->abandon();
  settle();
}

}  // namespace srfs::cfdp
