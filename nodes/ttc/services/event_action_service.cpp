// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/event_action_service.hpp"

#include <algorithm>

#include "base/crc32c.hpp"
#include "base/saturate.hpp"

namespace srfs {
namespace {

// Requests and reports of service 19 (ECSS-E-ST-70-41C 8.19.2).
enum Subtype : std::uint8_t {
  add_definitions = 1,
  delete_definitions = 2,
  delete_all = 3,
  enable = 4,
  disable = 5,
  report_status_request = 6,
  status_report = 7,
  enable_function = 8,
  disable_function = 9,
  report_definitions_request = 10,
  definition_report = 11,
  restore_factory_set = 0,  ///< a function of service 8
};

constexpr std::size_t report_head_octets = 64;  ///< of a packet of 19,11, before the telecommand
constexpr milliseconds room_retry_period{50};   ///< what may be released and found no room

ActionKey read_key(OctetReader& reader) {
  ActionKey key;
  key.apid = reader.u16();
  key.event = reader.u16();
  return key;
}

std::vector<ActionKey> keys_of(OctetView arguments) {
  OctetReader reader(arguments);
  std::vector<ActionKey> keys(reader.u16());
  for (ActionKey& key : keys) key = read_key(reader);
  return keys;
}

/// @return the packet that stands next, empty if it is not whole
Octets read_packet(OctetReader& reader) {
  Octets packet;
  const bool whole = mission::detail::take_packet(reader, packet, UINT16_MAX);
  return whole ? packet : Octets{};
}

mission::EventActionUnusableEvent unusable(const ActionKey& key, std::uint16_t code) {
  mission::EventActionUnusableEvent event;
  event.event = key.event;
  event.apid = key.apid;
  event.code = code;
  return event;
}

}  // namespace

bool may_raise(std::uint16_t apid, const mission::Event& event) {
  const bool of_ttc = event.name.starts_with("monitor.") || event.name.starts_with("event_action.");
  return !of_ttc || apid == mission::apid::ttc;
}

// ---- rate

void ReleaseRate::take(MonotonicTime now) {
  const MonotonicTime begin = taken_.empty() ? now : std::max(now, taken_.back());
  taken_.push_back(begin + period_);
  if (taken_.size() > burst_) taken_.pop_front();
}

MonotonicTime ReleaseRate::ready_at(MonotonicTime now) const {
  return taken_.size() < burst_ ? now : std::max(now, taken_.front());
}

// ---- table on disk

void EventActionService::load(const FoundTable& found, RequestCheck check) {
  check_ = std::move(check);
  if (!read(found)) set_table(factory_set());
  check_again();
}

bool EventActionService::read_table(OctetReader& in) {
  ActionTable table;
  const std::uint8_t flags = in.u8();
  for (std::size_t count = in.u16(); count > 0; --count) {
    const bool enabled = in.u8() != 0;
    const ActionKey key = read_key(in);
    Octets packet = read_packet(in);
    if (!in.ok() || packet.empty()) return false;
    table[key] = {.packet = std::move(packet), .enabled = enabled};
  }
  if (!in.ok() || in.remaining() != 0 || table.size() > max_actions) return false;
  factory_ = (flags & factory_flag) != 0;
  enabled_ = (flags & function_flag) != 0;
  set_table(factory_ ? factory_set() : std::move(table));
  return true;
}

void EventActionService::check_again() {
  std::set<ActionKey> forbidden;
  for (const auto& [key, action] : table_) {
    const auto code = action.enabled ? check_(action.packet) : std::nullopt;
    if (!code) continue;
    forbidden.insert(key);
    if (!forbidden_.contains(key)) unusable_.push_back(unusable(key, *code));
  }
  forbidden_ = std::move(forbidden);
}

void EventActionService::write_table(OctetWriter& out) const {
  out.u8(static_cast<std::uint8_t>((enabled_ ? function_flag : 0) | (factory_ ? factory_flag : 0)));
  const ActionTable none;
  const ActionTable& table = factory_ ? none : table_;
  out.u16(static_cast<std::uint16_t>(table.size()));
  for (const auto& [key, action] : table) {
    out.u8(action.enabled ? 1 : 0);
    out.u16(key.apid);
    out.u16(key.event);
    out.bytes(action.packet);
  }
}

/// What the rules forbid is left out and said: a satellite without one of its actions is better than none.
ActionTable EventActionService::factory_set() {
  ActionTable table;
  for (const auto& arguments : dictionary_.event_actions()) {
    const auto encoded = dictionary_.encode(mission::EventActionAdd::name, arguments);
    if (!encoded) continue;  // the dictionary has checked it
    OctetReader in(encoded->data);
    in.u16();
    const ActionKey key = read_key(in);
    Octets packet = read_packet(in);
    if (const auto code = check_(packet)) {
      unusable_.push_back(unusable(key, *code));
    } else {
      table[key] = {.packet = std::move(packet), .enabled = true};
    }
  }
  return table;
}

void EventActionService::set_table(ActionTable table) {
  table_ = std::move(table);
  std::erase_if(waiting_, [this](const Waiting& waiting) {
    const auto found = table_.find(waiting.key);
    return found == table_.end() || !found->second.enabled;
  });
  std::erase_if(released_, [this](const auto& entry) { return !table_.contains(entry.first); });
}

// ---- requests

bool EventActionService::provides(const mission::Command& command) const {
  return command.service == service_type || command.name == mission::EventActionRestore::name;
}

void EventActionService::execute(const Telecommand& telecommand, MonotonicTime /*now*/) {
  const mission::Command& command = *telecommand.command;
  const std::uint8_t subtype =
      command.is_function() ? std::uint8_t{Subtype::restore_factory_set} : command.subtype;
  if (subtype == Subtype::report_status_request) return report_status(telecommand.origin);
  if (subtype == Subtype::report_definitions_request) return report_definitions(telecommand);
  if (const auto failure = change(subtype, telecommand.arguments)) return fail(telecommand.origin, *failure);
  on_changed(telecommand.origin);
}

std::optional<EventActionService::Failure> EventActionService::change(std::uint8_t subtype,
                                                                      OctetView arguments) {
  switch (subtype) {
    case Subtype::enable_function:
      enabled_ = true;
      return std::nullopt;
    case Subtype::disable_function:
      enabled_ = false;
      waiting_.clear();
      return std::nullopt;
    case Subtype::delete_all:
      enabled_ = false;
      factory_ = false;
      set_table({});
      return std::nullopt;
    case Subtype::restore_factory_set:
      enabled_ = true;
      factory_ = true;
      set_table(factory_set());
      return std::nullopt;
    case Subtype::add_definitions:
      return add(arguments);
    default:
      return change_named(subtype, arguments);
  }
}

std::optional<EventActionService::Failure> EventActionService::add(OctetView arguments) {
  OctetReader reader(arguments);
  ActionTable table = table_;
  for (unsigned count = reader.u16(); count > 0; --count) {
    const ActionKey key = read_key(reader);
    Octets packet = read_packet(reader);
    const mission::Event* event = dictionary_.event(key.event);
    const bool raised = key.apid == 0 || (dictionary_.apid(key.apid) != nullptr && event != nullptr &&
                                          may_raise(key.apid, *event));
    if (!raised) return Failure{mission::failure::unknown_identifier, key.event};
    const auto known = table.find(key);
    if (known != table.end() && known->second.enabled)
      return Failure{mission::failure::still_enabled, key.event};
    if (const auto code = check_(packet)) return Failure{mission::failure::no_action, *code};
    table[key] = {.packet = std::move(packet), .enabled = false};
  }
  std::size_t octets = 0;
  for (const auto& [key, action] : table) octets += action.packet.size();
  if (table.size() > max_actions || octets > max_octets) return Failure{mission::failure::table_full, {}};
  factory_ = false;
  set_table(std::move(table));
  return std::nullopt;
}

std::optional<EventActionService::Failure> EventActionService::change_named(std::uint8_t subtype,
                                                                            OctetView arguments) {
  ActionTable table = table_;
  for (const ActionKey& key : keys_of(arguments)) {
    const auto found = table.find(key);
    if (found == table.end()) return Failure{mission::failure::unknown_identifier, key.event};
    if (subtype != Subtype::delete_definitions) {
      found->second.enabled = subtype == Subtype::enable;
    } else if (found->second.enabled) {
      return Failure{mission::failure::still_enabled, key.event};
    } else {
      table.erase(found);
    }
  }
  factory_ = false;
  set_table(std::move(table));
  return std::nullopt;
}

void EventActionService::fail(const TelecommandOrigin& origin, const Failure& failure) {
  report_queue().failure(origin, Stage::start, failure.code,
                         failure.parameter ? octets_of_u16(*failure.parameter) : Octets{});
}

// ---- reports

void EventActionService::report_status(const TelecommandOrigin& origin) {
  report_queue().success(origin, Stage::start);
  for (const auto& [key, action] : table_) {
    const auto known = released_.find(key);
    mission::EventActionStatus report;
    report.actions = 1;
    report.of_apid = key.apid;
    report.event = key.event;
    report.status = action.enabled ? mission::FunctionStatus::enabled : mission::FunctionStatus::disabled;
    report.released = known == released_.end() ? 0 : known->second.count;
    put(origin, Subtype::status_report, report.encoded());
  }
  report_queue().success(origin, Stage::completion);
}

void EventActionService::report_definitions(const Telecommand& telecommand) {
  if (listing_) return fail(telecommand.origin, {mission::failure::busy, {}});
  std::vector<ActionKey> keys = keys_of(telecommand.arguments);
  for (const ActionKey& key : keys) {
    if (!table_.contains(key))
      return fail(telecommand.origin, {mission::failure::unknown_identifier, key.event});
  }
  if (keys.empty()) {
    for (const auto& [key, action] : table_) keys.push_back(key);
  }
  report_queue().success(telecommand.origin, Stage::start);
  listing_ = {.origin = telecommand.origin, .expiry = telecommand.expiry, .keys = std::move(keys), .next = 0};
}

void EventActionService::go_on(std::size_t room_octets, MonotonicTime now) {
  if (!listing_) return;
  for (; listing_->next < listing_->keys.size(); ++listing_->next) {
    const ActionKey& key = listing_->keys[listing_->next];
    const auto found = table_.find(key);
    if (found == table_.end()) continue;  // deleted meanwhile
    const EventAction& action = found->second;
    const std::size_t octets = report_head_octets + action.packet.size();
    if (room_octets < room_kept_octets + octets) {
      if (now < listing_->expiry) return;
      report_queue().failure(listing_->origin, Stage::completion, mission::failure::interrupted);
      return listing_.reset();
    }
    room_octets -= octets;
    mission::EventActionDefinition report;
    report.actions = 1;
    report.of_apid = key.apid;
    report.event = key.event;
    report.status = action.enabled ? mission::FunctionStatus::enabled : mission::FunctionStatus::disabled;
    report.request = action.packet;
    put(listing_->origin, Subtype::definition_report, report.encoded());
  }
  report_queue().success(listing_->origin, Stage::completion);
  listing_.reset();
}

void EventActionService::put(const TelecommandOrigin& origin, std::uint8_t subtype, Octets data) {
  report_queue().put(Report{.apid = origin.apid,
                            .service = service_type,
                            .subtype = subtype,
                            .destination_id = origin.source_id,
                            .data = std::move(data),
                            .stored = false});
}

// ---- release

void EventActionService::on_event(std::uint16_t apid, std::uint16_t event, MonotonicTime now) {
  for (const ActionKey key : {ActionKey{apid, event}, ActionKey{0, event}}) {
    const auto found = table_.find(key);
    if (found == table_.end()) continue;
    if (!enabled_ || !found->second.enabled) {
      ++counters_.passive;
      continue;
    }
    const bool waits = std::any_of(waiting_.begin(), waiting_.end(),
                                   [&](const Waiting& waiting) { return waiting.key == key; });
    if (waits) {
      ++counters_.merged;
    } else {
      waiting_.push_back({.key = key, .raised_by = apid, .since = now});
    }
  }
}

void EventActionService::on_known_release(const AcceptedTelecommand& known) {
  const MonotonicTime at = known.accepted_at;
  // Of another boot all have the time of the restart: more than there was room for count as one burst.
  const auto count = [at](ReleaseRate& rate) {
    if (rate.ready_at(at) <= at) rate.take(at);
  };
  count(total_);
  // The journal forgets the packet of one that ended, but not its request id and CRC.
  for (const auto& [key, action] : table_) {
    const Octets own = request_of(action.packet, known.origin.request.packet_sequence_control);
    const bool same = wire::peek_request_id(own) == known.origin.request &&
                      own.size() == known.packet_octets && crc32c(own) == known.packet_crc;
    if (same) count(released_[key].rate);
  }
}

std::vector<mission::EventActionDroppedEvent> EventActionService::drop_overdue(MonotonicTime now) {
  std::vector<mission::EventActionDroppedEvent> dropped;
  std::erase_if(waiting_, [&](const Waiting& waiting) {
    if (waiting.telecommand != 0 || now - waiting.since < nanoseconds(longest_wait)) return false;
    ++counters_.dropped;
    mission::EventActionDroppedEvent event;
    event.event = waiting.key.event;
    event.apid = waiting.raised_by;
    event.waited_s = as_u32(static_cast<std::uint64_t>((now - waiting.since) / seconds(1)));
    dropped.push_back(event);
    return true;
  });
  return dropped;
}

std::vector<EventActionService::Due> EventActionService::due(MonotonicTime now) {
  std::vector<Due> due;
  for (Waiting& waiting : waiting_) {
    if (waiting.telecommand != 0) continue;
    const bool held = released_[waiting.key].rate.ready_at(now) > now || !may_release(now);
    if (!held) {
      due.push_back({waiting.key, waiting.raised_by, table_.at(waiting.key).packet});
    } else if (!std::exchange(waiting.said, true)) {
      ++counters_.delayed;
      mission::EventActionDelayedEvent event;
      event.event = waiting.key.event;
      event.apid = waiting.raised_by;
      delayed_.push_back(event);
    }
  }
  return due;
}

void EventActionService::on_accepted(const ActionKey& key, std::uint64_t telecommand, MonotonicTime now) {
  count_rates(key, now);
  for (Waiting& waiting : waiting_) {
    if (waiting.key == key) waiting.telecommand = telecommand;
  }
}

std::optional<EventActionService::Due> EventActionService::on_passed(std::uint64_t telecommand, bool runs) {
  const auto found = std::find_if(waiting_.begin(), waiting_.end(),
                                  [&](const Waiting& waiting) { return waiting.telecommand == telecommand; });
  if (found == waiting_.end()) return std::nullopt;
  if (!runs) {
    ++counters_.refused;
    found->telecommand = 0;
    return std::nullopt;
  }
  const Due released{found->key, found->raised_by, {}};
  ++counters_.released;
  ++released_[found->key].count;
  waiting_.erase(found);
  return released;
}

void EventActionService::on_refused(const ActionKey& key, MonotonicTime now) {
  ++counters_.refused;
  count_rates(key, now);
  std::erase_if(waiting_, [&](const Waiting& waiting) { return waiting.key == key; });
}

void EventActionService::on_forbidden(const ActionKey& key, std::uint16_t code, MonotonicTime now) {
  if (forbidden_.insert(key).second) unusable_.push_back(unusable(key, code));
  on_refused(key, now);
}

void EventActionService::count_rates(const ActionKey& key, MonotonicTime now) {
  released_[key].rate.take(now);
  total_.take(now);
}

Octets EventActionService::request_of(OctetView packet, std::uint16_t sequence) {
  auto request = wire::parse_tc_packet(packet).value_or(wire::TcPacket{});
  request.source_id = on_board_source;
  request.sequence_count = sequence & 0x3FFF;
  request.ack_flags = wire::ack::all;
  return wire::make_tc_packet(request);
}

std::optional<MonotonicTime> EventActionService::next_due(MonotonicTime now) const {
  std::optional<MonotonicTime> next;
  for (const Waiting& waiting : waiting_) {
    if (waiting.telecommand != 0) continue;  // the gate has a deadline
    const auto known = released_.find(waiting.key);
    const MonotonicTime own = known == released_.end() ? now : known->second.rate.ready_at(now);
    const MonotonicTime ready = std::max({own, total_.ready_at(now), now + room_retry_period});
    const MonotonicTime at = std::min(ready, std::max(now, waiting.since + longest_wait));
    if (!next || at < *next) next = at;
  }
  return next;
}

void EventActionService::fill(mission::TtcMonitoringHousekeeping& h) const {
  h.event_action = enabled_ ? mission::FunctionStatus::enabled : mission::FunctionStatus::disabled;
  h.actions = static_cast<std::uint16_t>(table_.size());
  h.actions_enabled = static_cast<std::uint16_t>(
      std::count_if(table_.begin(), table_.end(), [](const auto& entry) { return entry.second.enabled; }));
  h.actions_waiting = static_cast<std::uint16_t>(waiting_.size());
  h.action_generation = factory_ ? 0 : as_u32(generation());
  h.released = counters_.released;
  h.merged = counters_.merged;
  h.delayed = counters_.delayed;
  h.dropped = counters_.dropped;
  h.refused = counters_.refused;
  h.passive = counters_.passive;
}

}  // namespace srfs
