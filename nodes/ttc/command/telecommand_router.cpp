// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/command/telecommand_router.hpp"

#include <algorithm>

#include <fmt/format.h>

#include <mission/structures.hpp>

#include "base/config.hpp"
#include "wire/cuc.hpp"

namespace srfs {
namespace {

// Services of ECSS-E-ST-70-41C that ttc itself provides.
constexpr std::uint8_t housekeeping_service = 3;
constexpr std::uint8_t event_service = 5;
constexpr std::uint8_t function_service = 8;
constexpr std::uint8_t storage_service = 15;
constexpr std::uint8_t parameter_service = 20;
constexpr std::uint8_t file_service = 23;
constexpr std::uint8_t perform_function = 1;
constexpr std::string_view set_mode_command = "ttc.set_mode";

std::uint16_t code_of(const mission::Dictionary& dictionary, std::string_view name) {
  for (const mission::FailureCode& code : dictionary.failure_codes()) {
    if (code.name == name) return code.code;
  }
  throw ConfigError(fmt::format("mission dictionary: failure code '{}' is missing", name));
}

Octets as_u16(std::uint16_t value) {
  return {static_cast<std::uint8_t>(value >> 8), static_cast<std::uint8_t>(value)};
}

static_assert(mission::StorageRetrieve::max_groups == PacketRetrieval::max_periods);

TaiTime read_time(OctetReader& reader) {
  // The dictionary has checked it; anything else would be a bug there.
  return wire::decode_cuc(reader.bytes(wire::cuc_octets)).value_or(TaiTime{});
}

}  // namespace

FailureCodes::FailureCodes(const mission::Dictionary& dictionary)
    : unknown_apid(code_of(dictionary, "unknown_apid")),
      bad_length(code_of(dictionary, "bad_length")),
      bad_checksum(code_of(dictionary, "bad_checksum")),
      unknown_service(code_of(dictionary, "unknown_service")),
      unknown_subtype(code_of(dictionary, "unknown_subtype")),
      bad_argument(code_of(dictionary, "bad_argument")),
      unknown_function(code_of(dictionary, "unknown_function")),
      wrong_mode(code_of(dictionary, "wrong_mode")),
      queue_full(code_of(dictionary, "queue_full")),
      storage_unavailable(code_of(dictionary, "storage_unavailable")),
      unknown_identifier(code_of(dictionary, "unknown_identifier")),
      bad_arguments_length(code_of(dictionary, "bad_arguments_length")),
      node_unavailable(code_of(dictionary, "node_unavailable")),
      busy(code_of(dictionary, "busy")),
      bad_time_range(code_of(dictionary, "bad_time_range")),
      store_unreadable(code_of(dictionary, "store_unreadable")),
      aborted(code_of(dictionary, "aborted")),
      interrupted(code_of(dictionary, "interrupted")),
      completion_unknown(code_of(dictionary, "completion_unknown")),
      not_armed(code_of(dictionary, "not_armed")),
      not_hazardous(code_of(dictionary, "not_hazardous")) {}

TelecommandRouter::TelecommandRouter(Parts parts, std::string own_node)
    : parts_(parts), own_node_(std::move(own_node)) {
  const mission::ApplicationProcess* own = parts_.dictionary.apid_of_node(own_node_);
  if (own == nullptr) throw ConfigError(fmt::format("mission dictionary: node '{}' has no APID", own_node_));
  own_apid_ = own->apid;
}

TelecommandOrigin TelecommandRouter::origin_of(const wire::TcPacket& packet) const {
  TelecommandOrigin origin{.request = wire::request_id(packet),
                           .apid = packet.apid,
                           .ack_flags = packet.ack_flags,
                           .source_id = packet.source_id};
  // Only ttc can answer for an application process that does not exist.
  if (parts_.dictionary.apid(origin.apid) == nullptr) origin.apid = own_apid_;
  return origin;
}

JudgedTelecommand TelecommandRouter::judge(OctetView packet, MonotonicTime now, bool room) {
  const auto parsed = wire::parse_tc_packet(packet);
  if (!parsed) return judge_malformed(packet, parsed.error());
  JudgedTelecommand judged;
  judged.origin = origin_of(*parsed);
  auto request = check(*parsed, room, now);
  if (!request) {
    judged.refusal = request.error();
    return judged;
  }
  judged.command = request->command;
  judged.arguments = std::move(request->arguments);
  judged.expiry = now + judged.command->timeout;
  if (judged.command->hazardous) parts_.hazards.disarm(mission::DisarmReason::fired);  // once
  if (judged.command->node != own_node_) ++waiting_[judged.command->node];
  if (const auto mode = mode_of(*judged.command, judged.arguments)) modes_to_come_.push_back(*mode);
  return judged;
}

void TelecommandRouter::carry_out(const JudgedTelecommand& judged, bool durable, MonotonicTime now) {
  if (judged.command == nullptr) {
    refuse(judged.origin, judged.refusal);
    return;
  }
  const mission::Command& command = *judged.command;
  if (command.node != own_node_) --waiting_[command.node];
  if (mode_of(command, judged.arguments)) modes_to_come_.erase(modes_to_come_.begin());
  if (!durable && !command.recovery) {
    refuse(judged.origin, Refusal{parts_.codes.storage_unavailable, {}});
    return;
  }
  if (!durable) unstored_runs_.push_back(judged.origin.id);
  parts_.report_queue.success(judged.origin, Stage::acceptance);
  const Request request{
      .origin = judged.origin, .command = &command, .arguments = judged.arguments, .now = now};
  const auto mode = static_cast<std::uint8_t>(parts_.mode.mode());
  if (!command.allowed_in(mode)) {  // a mode change that it counted on did not come
    parts_.report_queue.failure(judged.origin, Stage::start, parts_.codes.wrong_mode, Octets{mode});
  } else if (command.node == own_node_) {
    execute(request, now);
  } else {
    forward(request, judged.expiry, now);
  }
}

void TelecommandRouter::restore(const RestoredTelecommand& restored, MonotonicTime now) {
  const auto parsed = wire::parse_tc_packet(restored.packet);
  const auto found = parsed ? find_command(*parsed) : Err(Refusal{});
  if (!found) {  // the dictionary of now does not have it
    parts_.report_queue.failure(restored.origin, Stage::completion, parts_.codes.interrupted);
    return;
  }
  const mission::Command& command = **found;
  if (command.service == ScheduleService::service_type && parts_.schedule.has_applied(restored.origin.id)) {
    if (!restored.progress.started) parts_.report_queue.success(restored.origin, Stage::start);
    parts_.report_queue.success(restored.origin, Stage::completion);
    return;
  }
  const Request request{.origin = restored.origin,
                        .command = &command,
                        .arguments = arguments_of(*parsed, command),
                        .now = now,
                        .repeated = true};
  if (command.node != own_node_) {
    parts_.forwarder.restore(restored.origin, forwarded(request, restored.expiry), restored.progress, now);
    return;
  }
  if (ImagingScheduler::takes(command) && !restored.progress.other_boot) {
    parts_.imaging.restore(restored.origin, command, request.arguments, restored.progress.started,
                           restored.progress.last_step, now);
    return;
  }
  const bool again = command.repeat_class == mission::RepeatClass::idempotent &&
                     !restored.progress.other_boot && now < restored.expiry &&
                     command.allowed_in(static_cast<std::uint8_t>(parts_.mode.mode()));
  if (again) {
    execute(request, now);
  } else {
    parts_.report_queue.failure(restored.origin, Stage::completion, parts_.codes.interrupted);
  }
}

Result<const mission::Command*, Refusal> TelecommandRouter::find_command(const wire::TcPacket& packet) const {
  const mission::Dictionary& dictionary = parts_.dictionary;
  if (dictionary.apid(packet.apid) == nullptr)
    return Err(Refusal{parts_.codes.unknown_apid, {}, Stage::routing});
  if (packet.service == function_service && packet.subtype == perform_function) {
    OctetReader reader(packet.application);
    const std::uint16_t function_id = reader.u16();
    if (!reader.ok()) return Err(Refusal{parts_.codes.bad_arguments_length, {}});
    const mission::Command* function = dictionary.function(packet.apid, function_id);
    if (function == nullptr) return Err(Refusal{parts_.codes.unknown_function, as_u16(function_id)});
    return function;
  }
  const mission::Command* request = dictionary.request(packet.apid, packet.service, packet.subtype);
  if (request != nullptr) return request;
  // Every application process can be asked whether it is alive; ttc asks its node.
  if (packet.service == ConnectionTester::service_type && packet.subtype == ConnectionTester::are_you_alive)
    return dictionary.request(own_apid_, packet.service, packet.subtype);
  const bool service_known =
      packet.service == function_service || dictionary.has_service(packet.apid, packet.service);
  return Err(Refusal{service_known ? parts_.codes.unknown_subtype : parts_.codes.unknown_service, {}});
}

Octets TelecommandRouter::arguments_of(const wire::TcPacket& packet, const mission::Command& command) {
  OctetView arguments(packet.application);
  if (command.is_function()) arguments = arguments.subspan(2);
  return {arguments.begin(), arguments.end()};
}

std::optional<Mode> TelecommandRouter::mode_of(const mission::Command& command, OctetView arguments) {
  if (command.name != set_mode_command || arguments.empty()) return std::nullopt;
  return arguments.front() == static_cast<std::uint8_t>(Mode::nominal) ? Mode::nominal : Mode::safe;
}

std::size_t TelecommandRouter::waiting_for(const std::string& node) const {
  const auto found = waiting_.find(node);
  return found == waiting_.end() ? 0 : found->second;
}

Result<TelecommandRouter::Request, Refusal> TelecommandRouter::check(const wire::TcPacket& packet, bool room,
                                                                     MonotonicTime now) const {
  const auto command = find_command(packet);
  if (!command) return Err(command.error());
  const mission::Command& found = **command;
  const Mode to_come = modes_to_come_.empty() ? parts_.mode.mode() : modes_to_come_.back();
  const auto mode = static_cast<std::uint8_t>(to_come);
  if (!found.allowed_in(mode)) return Err(Refusal{parts_.codes.wrong_mode, {mode}});

  Octets arguments = arguments_of(packet, found);
  if (const auto checked = parts_.dictionary.check_arguments(found, arguments); !checked) {
    const std::uint8_t position = checked.error().parameter;
    if (position == 0) return Err(Refusal{parts_.codes.bad_arguments_length, {}});
    return Err(Refusal{parts_.codes.bad_argument, {position}});
  }
  if (auto refusal = refuse_insertion(found, arguments)) return Err(std::move(*refusal));
  if (found.hazardous && !parts_.hazards.is_armed(hazard_name(packet), now))
    return Err(Refusal{parts_.codes.not_armed, {}});
  const bool taken =
      room && (found.node == own_node_ || parts_.forwarder.has_room(found.node, waiting_for(found.node)));
  if (!taken) return Err(Refusal{parts_.codes.queue_full, {}});
  return Request{.origin = {}, .command = &found, .arguments = std::move(arguments), .now = now};
}

std::optional<Refusal> TelecommandRouter::refuse_insertion(const mission::Command& command,
                                                           OctetView arguments) const {
  if (command.is_function() || command.service != mission::ScheduleInsert::service ||
      command.subtype != mission::ScheduleInsert::subtype)
    return std::nullopt;
  auto error = parts_.schedule.check_insertion(arguments,
                                               [this](OctetView packet) { return check_scheduled(packet); });
  if (!error) return std::nullopt;
  return Refusal{error->code, std::move(error->parameter)};
}

/// What never changes between insertion and release; mode and room are checked at the release.
std::optional<ScheduleService::RequestError> TelecommandRouter::check_scheduled(OctetView packet) const {
  const auto parsed = wire::parse_tc_packet(packet);
  if (!parsed) return {{judge_malformed(packet, parsed.error()).refusal.code, std::uint8_t{0}}};
  const auto command = find_command(*parsed);
  if (!command) return {{command.error().code, std::uint8_t{0}}};
  const auto checked = parts_.dictionary.check_arguments(**command, arguments_of(*parsed, **command));
  if (checked) return std::nullopt;
  const std::uint8_t position = checked.error().parameter;
  return {{position == 0 ? parts_.codes.bad_arguments_length : parts_.codes.bad_argument, position}};
}

void TelecommandRouter::refuse(const TelecommandOrigin& origin, const Refusal& refusal) {
  parts_.report_queue.failure(origin, refusal.stage, refusal.code, refusal.parameter);
  if (rejected_.size() == max_rejected) rejected_.erase(rejected_.begin());
  rejected_.push_back(RejectedTelecommand{
      .apid = static_cast<std::uint16_t>(origin.request.packet_identification & 0x7FF),
      .sequence_count = static_cast<std::uint16_t>(origin.request.packet_sequence_control & 0x3FFF),
      .code = refusal.code});
}

JudgedTelecommand TelecommandRouter::judge_malformed(OctetView packet, wire::TcPacketError error) const {
  JudgedTelecommand judged;
  judged.origin.request = wire::peek_request_id(packet).value_or(wire::RequestId{});
  judged.origin.apid = own_apid_;
  judged.refusal.code = parts_.codes.bad_length;
  if (error == wire::TcPacketError::bad_checksum) judged.refusal.code = parts_.codes.bad_checksum;
  if (error == wire::TcPacketError::idle_packet)
    judged.refusal = {parts_.codes.unknown_apid, {}, Stage::routing};
  if (error == wire::TcPacketError::bad_pus_version || error == wire::TcPacketError::no_secondary_header) {
    judged.refusal.code = parts_.codes.unknown_service;
  }
  return judged;
}

ForwardedCommand TelecommandRouter::forwarded(const Request& request, MonotonicTime expiry) {
  const mission::Command& command = *request.command;
  return ForwardedCommand{.id = request.origin.id,
                          .target = command.node,
                          .apid = command.apid,
                          .function_id = command.function_id,
                          .repeat_class = static_cast<std::uint8_t>(command.repeat_class),
                          .expiry = expiry,
                          .arguments = request.arguments};
}

void TelecommandRouter::forward(const Request& request, MonotonicTime expiry, MonotonicTime now) {
  if (!parts_.forwarder.submit(request.origin, forwarded(request, expiry), now))
    parts_.report_queue.failure(request.origin, Stage::start, parts_.codes.queue_full);
}

void TelecommandRouter::execute(const Request& request, MonotonicTime now) {
  const mission::Command& command = *request.command;
  switch (command.service) {
    case ConnectionTester::service_type:
      execute_test(request);
      return;
    case housekeeping_service:
      execute_housekeeping(request);
      return;
    case event_service:
      execute_events(request);
      return;
    case storage_service:
      execute_storage(request);
      return;
    case ScheduleService::service_type:
      parts_.schedule.execute(request.origin, command.subtype, request.arguments);
      return;
    case TimeReporter::service_type:
      parts_.time_reports.set_rate(request.arguments.front());
      complete(request.origin);
      return;
    case parameter_service:
      parts_.parameters.submit(request.origin, command, request.arguments, now);
      return;
    case file_service:
      parts_.files.submit(request.origin, command, request.arguments, request.repeated, now);
      return;
    case function_service:
      if (ImagingScheduler::takes(command)) {
        parts_.imaging.submit(request.origin, command, request.arguments, request.repeated, now);
        return;
      }
      if (command.name == set_mode_command) {
        set_mode(request);
        return;
      }
      if (command.name == mission::TtcArm::name) {
        arm(request);
        return;
      }
      if (command.name == mission::TtcSelectKeys::name) {
        select_keys(request);
        return;
      }
      if (command.name == mission::TtcTransmitterOff::name) {
        const auto off = mission::TtcTransmitterOff::decode(request.arguments);
        switch_transmitter(request, seconds(off ? off->duration_s : 0));
        return;
      }
      if (command.name == mission::TtcTransmitterOn::name) {
        switch_transmitter(request, seconds(0));
        return;
      }
      if (command.name == mission::TtcDisarm::name) {
        parts_.hazards.disarm(mission::DisarmReason::commanded);
        complete(request.origin);
        return;
      }
      break;
    default:
      break;
  }
  // In the dictionary, but this version of ttc does not do it.
  parts_.report_queue.failure(request.origin, Stage::start, parts_.codes.unknown_function,
                              as_u16(command.function_id));
}

void TelecommandRouter::complete(const TelecommandOrigin& origin) {
  parts_.report_queue.success(origin, Stage::start);
  parts_.report_queue.success(origin, Stage::completion);
}

void TelecommandRouter::execute_test(const Request& request) {
  const std::uint8_t subtype = request.command->subtype;
  const std::uint16_t apid = subtype == ConnectionTester::test_connection
                                 ? OctetReader(request.arguments).u16()
                                 : request.origin.apid;
  const mission::ApplicationProcess* process = parts_.dictionary.apid(apid);
  if (process == nullptr) {
    parts_.report_queue.failure(request.origin, Stage::start, parts_.codes.unknown_identifier, as_u16(apid));
    return;
  }
  parts_.connections.submit(request.origin, subtype, apid, process->node, process->node == own_node_);
}

void TelecommandRouter::execute_housekeeping(const Request& request) {
  constexpr std::uint8_t enable = 5;
  constexpr std::uint8_t disable = 6;
  constexpr std::uint8_t one_shot = 27;
  constexpr std::uint8_t set_interval = 31;
  OctetReader reader(request.arguments);
  const unsigned count = reader.u16();
  for (unsigned i = 0; i < count; ++i) {
    const std::uint16_t structure = reader.u16();
    Result<void, HousekeepingError> done;
    switch (request.command->subtype) {
      case enable:
      case disable:
        done = parts_.housekeeping.set_enabled(structure, request.command->subtype == enable);
        break;
      case set_interval:
        done = parts_.housekeeping.set_interval(structure, milliseconds(reader.u32()));
        break;
      case one_shot:
        if (auto report = parts_.housekeeping.one_shot(structure)) {
          report->destination_id = request.origin.source_id;
          parts_.report_queue.put(std::move(*report));
        } else {
          done = Err(report.error());
        }
        break;
      default:
        break;
    }
    if (!done) {
      parts_.report_queue.failure(request.origin, Stage::start, parts_.codes.unknown_identifier,
                                  as_u16(structure));
      return;
    }
  }
  complete(request.origin);
}

void TelecommandRouter::execute_events(const Request& request) {
  constexpr std::uint8_t enable = 5;
  OctetReader reader(request.arguments);
  const unsigned count = reader.u16();
  for (unsigned i = 0; i < count; ++i) {
    const std::uint16_t event = reader.u16();
    if (!parts_.events.set_enabled(event, request.command->subtype == enable)) {
      parts_.report_queue.failure(request.origin, Stage::start, parts_.codes.unknown_identifier,
                                  as_u16(event));
      return;
    }
  }
  complete(request.origin);
}

void TelecommandRouter::execute_storage(const Request& request) {
  constexpr std::uint8_t abort = 17;
  if (StoreControl::handles(request.command->subtype)) {
    parts_.stores.execute(request.origin, request.command->subtype, request.arguments);
    return;
  }
  OctetReader reader(request.arguments);
  const unsigned count = reader.u16();
  if (request.command->subtype == abort) {
    for (unsigned i = 0; i < count; ++i) parts_.retrieval.abort(reader.u16(), parts_.codes.aborted);
    complete(request.origin);
    return;
  }
  std::vector<StorePeriod> periods;
  for (unsigned i = 0; i < count; ++i) {  // at most max_groups of the dictionary
    StorePeriod period;
    period.store = reader.u16();
    period.range.from = read_time(reader);
    period.range.to = read_time(reader);
    if (period.range.to < period.range.from) {
      parts_.report_queue.failure(request.origin, Stage::start, parts_.codes.bad_time_range);
      return;
    }
    periods.push_back(period);
  }
  if (!parts_.retrieval.request(request.origin, std::move(periods))) {
    parts_.report_queue.failure(request.origin, Stage::start, parts_.codes.busy);
  }
}

void TelecommandRouter::set_mode(const Request& request) {
  if (mode_change_) {  // the one before was not taken yet
    parts_.report_queue.failure(request.origin, Stage::start, parts_.codes.busy);
    return;
  }
  parts_.report_queue.success(request.origin, Stage::start);
  OctetReader reader(request.arguments);
  const Mode mode = reader.u8() == static_cast<std::uint8_t>(Mode::nominal) ? Mode::nominal : Mode::safe;
  if (mode != parts_.mode.mode()) parts_.hazards.disarm(mission::DisarmReason::mode_changed);
  mode_change_ = ModeChange{
      .origin = request.origin, .mode = mode, .stored_text = parts_.mode.change(mode, "commanded")};
}

std::optional<Refusal> TelecommandRouter::why_not_armed(const mission::TtcArm& arm) const {
  // Which of the functions is in the digest.
  const auto is_meant = [&](const mission::Command& command) {
    return command.hazardous && command.apid == arm.of_apid && command.service == arm.of_service &&
           command.subtype == arm.of_subtype;
  };
  const auto mode = static_cast<std::uint8_t>(parts_.mode.mode());
  std::optional<Refusal> why = Refusal{parts_.codes.not_hazardous, {}};
  for (const mission::Command& command : parts_.dictionary.commands()) {
    if (!is_meant(command)) continue;
    if (command.allowed_in(mode)) return std::nullopt;
    why = Refusal{parts_.codes.wrong_mode, {mode}};
  }
  return why;
}

void TelecommandRouter::arm(const Request& request) {
  const auto arm = mission::TtcArm::decode(request.arguments);
  const auto refusal = arm ? why_not_armed(*arm) : Refusal{parts_.codes.bad_arguments_length, {}};
  if (refusal) {
    parts_.report_queue.failure(request.origin, Stage::start, refusal->code, refusal->parameter);
    return;
  }
  parts_.hazards.arm(
      {.apid = arm->of_apid, .service = arm->of_service, .subtype = arm->of_subtype, .digest = arm->digest},
      request.now);
  complete(request.origin);
}

void TelecommandRouter::select_keys(const Request& request) {
  const auto select = mission::TtcSelectKeys::decode(request.arguments);
  const auto set = select && select->set == mission::KeySet::b ? KeySet::b : KeySet::a;
  const auto vc = select ? select->vc : std::uint8_t{0};
  const auto& available = parts_.key_sets;
  const bool has_it = std::find(available.begin(), available.end(), std::pair(vc, set)) != available.end();
  if (!select || !has_it) {
    parts_.report_queue.failure(request.origin, Stage::start, parts_.codes.unknown_identifier, as_u16(vc));
  } else if (key_change_) {  // the one before was not taken yet
    parts_.report_queue.failure(request.origin, Stage::start, parts_.codes.busy);
  } else {
    parts_.report_queue.success(request.origin, Stage::start);
    key_change_ = KeyChange{.origin = request.origin, .vc = vc, .set = set};
  }
}

void TelecommandRouter::switch_transmitter(const Request& request, seconds off) {
  if (transmitter_change_) {  // the one before was not taken yet
    parts_.report_queue.failure(request.origin, Stage::start, parts_.codes.busy);
    return;
  }
  parts_.report_queue.success(request.origin, Stage::start);
  if (off > seconds(0)) {
    parts_.transmitter.switch_off(off, request.now);
  } else {
    parts_.transmitter.switch_on();
  }
  transmitter_change_ = TransmitterChange{
      .origin = request.origin, .off = off, .stored_text = parts_.transmitter.stored_text()};
}

void TelecommandRouter::transmitter_stored(const TransmitterChange& change, bool success) {
  if (success) {
    parts_.report_queue.success(change.origin, Stage::completion);
  } else {  // it holds until a restart
    parts_.report_queue.failure(change.origin, Stage::completion, parts_.codes.storage_unavailable);
  }
}

void TelecommandRouter::key_change_stored(const KeyChange& change, bool success) {
  if (success) {
    parts_.report_queue.success(change.origin, Stage::completion);
  } else {
    parts_.report_queue.failure(change.origin, Stage::completion, parts_.codes.storage_unavailable);
  }
}

void TelecommandRouter::mode_stored(const ModeChange& change, bool success) {
  if (success) {
    parts_.report_queue.success(change.origin, Stage::completion);
  } else {
    parts_.report_queue.failure(change.origin, Stage::completion, parts_.codes.storage_unavailable);
  }
}

}  // namespace srfs
