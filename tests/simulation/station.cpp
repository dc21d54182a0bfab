// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/station.hpp"

#include <fmt/format.h>

#include <mission/structures.hpp>

#include "base/text.hpp"

namespace srfs::simulation {
namespace {

using Kind = ground::AdSignal::Kind;

constexpr std::uint8_t verification_service = 1;
constexpr std::uint8_t event_service = 5;
constexpr std::uint16_t spi_bd = 1;
constexpr nanoseconds repeat_time = seconds(30);  ///< well within ttc's window of repeats
constexpr nanoseconds forgotten_after = seconds(3600);
constexpr std::size_t most_recent = 8;
/// What is due is released or dropped so much later at the latest: ttc's schedule_late_max, and the reports.
constexpr nanoseconds released_after = seconds(60) + seconds(30);
constexpr nanoseconds right_time = seconds(1);
constexpr nanoseconds told_after = seconds(60);
constexpr nanoseconds latest_tick = seconds(5);

struct Choice {
  const char* name;
  std::vector<std::string> arguments;
  unsigned weight;
};

/// What the operator sends. Refused are the power cycle of the EPS, which was not armed, and what is spoiled.
const std::vector<Choice>& choices() {
  static const std::vector<Choice> all{
      {"eps.switch_load", {"load=2", "state=on"}, 6},
      {"eps.switch_load", {"load=2", "state=off"}, 6},
      {"eps.set_charge_limit", {"limit=0.9"}, 3},
      // Mistakes: what the satellite does not survive unless it helps itself.
      {"eps.switch_load", {"load=3", "state=on"}, 4},
      {"eps.switch_load", {"load=0", "state=off"}, 1},
      {"eps.switch_load", {"load=1", "state=off"}, 1},
      {"eps.set_charge_limit", {"limit=0"}, 1},
      {"adcs.set_mode", {"mode=idle"}, 1},
      {"adcs.set_mode", {"mode=detumble"}, 1},
      {"thermal.set_heater", {"heater=0", "mode=off"}, 1},
      {"thermal.set_heater", {"heater=1", "mode=on"}, 1},
      {"thermal.set_setpoint", {"heater=0", "setpoint_k=250"}, 1},
      {"adcs.set_wheel_speed", {"wheel=0", "speed_rad_s=10"}, 6},
      {"adcs.set_target_quaternion", {}, 3},
      {"thermal.set_setpoint", {"heater=0", "setpoint_k=290"}, 6},
      {"adcs.reset_peripheral", {}, 3},
      {"thermal.reset_peripheral", {}, 3},
      {"adcs.power_cycle_peripheral", {"off_ms=200"}, 2},
      {"thermal.power_cycle_peripheral", {"off_ms=500"}, 2},
      {"eps.power_cycle_peripheral", {"off_ms=200"}, 1},
      {"ttc.ping", {}, 4},
      {"ttc.set_mode", {"mode=nominal"}, 2},
      {"ttc.set_mode", {"mode=safe"}, 1},
      {"ttc.set_mode", {"mode=low_power"}, 1},
      {"ttc.set_mode", {"mode=commissioning"}, 1},
      {"ttc.set_mode", {"mode=pass"}, 1},
      {"ttc.disarm", {}, 1},
      {"storage.status", {}, 1},
      {"storage.resume_open", {"store=events"}, 1},
      {"storage.suspend_open", {"store=events"}, 1},
      {"schedule.summary_filter", {}, 1},
      {"schedule.enable", {}, 4},
      {"schedule.disable", {}, 1},
      {"schedule.shift_filter", {"offset_s=5"}, 1},
  };
  return all;
}

const char* text_of(mission::RepeatClass repeat) {
  switch (repeat) {
    case mission::RepeatClass::idempotent:
      return "idempotent";
    case mission::RepeatClass::by_id:
      return "by_id";
    case mission::RepeatClass::at_most_once:
      return "at_most_once";
  }
  return "?";
}

const Choice& any_choice(Random& random) {
  unsigned total = 0;
  for (const Choice& choice : choices()) total += choice.weight;
  auto at = static_cast<unsigned>(random.below(total));
  for (const Choice& choice : choices()) {
    if (at < choice.weight) return choice;
    at -= choice.weight;
  }
  return choices().back();
}

}  // namespace

// ---------------------------------------------------------------- the record

CommandRecord::CommandRecord(Kernel& kernel, const suite::LinkSettings& link, const sim::TrueTime& truth,
                             StoreLedger& stores)
    : kernel_(kernel), truth_(truth), stores_(stores), receiver_(link) {}

CommandRecord::Key CommandRecord::key_of(const wire::RequestId& request) {
  return Key{request.packet_identification} << 16U | request.packet_sequence_control;
}

std::string CommandRecord::describe(const Life& life) {
  return fmt::format(
      "{} ({}): sent {:.3f} s, delivered {}, ids {}, accepted {}, refused {}, completed {}, failed {}, "
      "executed {}, unstored {}",
      life.command->name, text_of(life.command->repeat_class), static_cast<double>(life.sent.ns()) / 1e9,
      life.delivered, life.ids.size(), life.accepted, life.refused, life.completed, life.failed.value_or(0),
      life.executed, life.unstored);
}

void CommandRecord::on_sent(const wire::RequestId& request, const mission::Command& command) {
  lives_[key_of(request)] = Life{.command = &command, .sent = kernel_.now(), .ids = {}};
  ++counters_.sent;
}

void CommandRecord::on_scheduled(const wire::RequestId& request, const mission::Command& command,
                                 const wire::RequestId& insertion, UtcTime release) {
  on_sent(request, command);
  Life& life = lives_[key_of(request)];
  life.insertion = key_of(insertion);
  life.release = release;
  note_schedule(key_of(request), ScheduleState::sent);
  life.unstored = kernel_.now() < reset_until_;
}

void CommandRecord::on_schedule_reset() {
  reset_until_ = kernel_.now() + 2 * repeat_time;
  for (auto& [key, life] : lives_) life.unstored = life.unstored || life.insertion;
}

void CommandRecord::on_time(UtcTime utc, bool valid) {
  const nanoseconds off = utc - truth_.utc(kernel_.now());
  const bool right = valid && off < right_time && off > -right_time;
  if (!right) time_since_.reset();
  if (right && !time_since_) time_since_ = kernel_.now();
  time_at_ = kernel_.now();
}

bool CommandRecord::has_right_time() const {
  return time_since_ && kernel_.now() - time_at_ < latest_tick;
}

void CommandRecord::on_delivered(const wire::RequestId& request) {
  const auto found = lives_.find(key_of(request));
  if (found == lives_.end()) return;
  found->second.delivered = true;
  ++counters_.delivered;
}

void CommandRecord::on_published(const Telecommand& telecommand) {
  const auto found = lives_.find(key_of(telecommand.origin.request));
  if (found == lives_.end()) return;
  Life& life = found->second;
  life.ids.insert(telecommand.origin.id);
  by_id_[telecommand.origin.id & 0xFFFFFFFFU] = found->first;
  kernel_.trace(Lane::ttc, Lane::ttc, "publishes telecommand", telecommand.origin.id, found->first);
  life.published = kernel_.now();
  if (life.insertion) {
    note_schedule(found->first, ScheduleState::released);
    ++counters_.released;
    if (has_right_time() && truth_.utc(kernel_.now()) < life.release - right_time)
      throw Violation{"L4c", "a scheduled telecommand is released before its time: " + describe(life)};
  }
  if (life.ids.size() > 1 && !life.unstored)
    throw Violation{"L4a", "a repeated packet became another telecommand: " + describe(life)};
}

void CommandRecord::check_not_executed(const Life& life) {
  namespace failure = mission::failure;
  static const std::set<std::uint16_t> certain{failure::queue_full,      failure::storage_unavailable,
                                               failure::expired,         failure::node_unavailable,
                                               failure::node_not_active, failure::peripheral_off};
  if (life.failed && certain.contains(*life.failed) && life.executed > 0 && !life.unstored)
    throw Violation{"L4", "it was executed and is reported as not executed: " + describe(life)};
}

void CommandRecord::on_executed(std::uint32_t telecommand_id) {
  kernel_.trace(Lane::bus, Lane::bus, "executes telecommand", telecommand_id);
  const auto id = by_id_.find(telecommand_id);
  if (id == by_id_.end()) return;
  const auto found = lives_.find(id->second);
  if (found == lives_.end()) return;
  Life& life = found->second;
  ++counters_.executed;
  ++life.executed;
  check_not_executed(life);
  if (life.executed > 1 && life.command->repeat_class != mission::RepeatClass::idempotent)
    throw Violation{"L4", "executed twice: " + describe(life)};
}

/// Also what ended just now: its end was said without waiting for the disk.
void CommandRecord::on_storage_lost() {
  if (kernel_.now() - last_lost_ < milliseconds(50)) return;
  last_lost_ = kernel_.now();
  for (auto& [key, life] : lives_)
    life.unstored = life.unstored || !life.ended || kernel_.now() - *life.ended < seconds(3);
}

void CommandRecord::on_cadu(const Octets& cadu) {
  for (const ground::ReceivedPacket& received : receiver_.push(cadu)) {
    if (received.vc == ground::tm_channel::playback) stores_.on_played_back(received.raw);
    if (received.vc != ground::tm_channel::live) continue;
    if (received.packet.service == verification_service) on_report(received.packet);
    if (received.packet.service == event_service) on_event(received.packet);
    if (received.packet.service == mission::housekeeping_report.first) on_housekeeping(received.packet);
  }
  for (const std::uint32_t word : receiver_.take_control_words()) note_farm(word);
  (void)receiver_.take_file_pdus();
  if (listener_) listener_(cadu);
}

void CommandRecord::note_farm(std::uint32_t control_word) {
  const auto clcw = wire::decode_clcw(control_word);
  if (!clcw) return;
  const auto mode = clcw->lockout ? wire::FarmMode::lockout
                    : clcw->wait  ? wire::FarmMode::wait
                                  : wire::FarmMode::open;
  kernel_.coverage().note(StateTable::farm, 0, static_cast<std::uint8_t>(mode));
}

void CommandRecord::note_schedule(Key key, ScheduleState state) {
  kernel_.coverage().note(StateTable::schedule, key, static_cast<std::uint8_t>(state));
}

void CommandRecord::on_event(const wire::TmPacket& packet) {
  OctetReader in(packet.source);
  if (in.u16() != mission::ScheduleActivityDroppedEvent::event_id) return;
  const auto event = mission::ScheduleActivityDroppedEvent::decode(in);
  if (!event) return;
  for (auto& [key, life] : lives_) {
    if (!life.insertion || ((key >> 16U) & 0x7FFU) != event->apid || (key & 0x3FFFU) != event->sequence)
      continue;
    counters_.dropped += life.dropped ? 0 : 1;
    life.dropped = true;
    note_schedule(key, ScheduleState::dropped);
  }
}

void CommandRecord::on_housekeeping(const wire::TmPacket& packet) {
  OctetReader in(packet.source);
  if (in.u16() != mission::HealthHousekeeping::structure_id) return;
  if (const auto health = mission::HealthHousekeeping::decode(in)) told_change_ = health->change;
}

void CommandRecord::on_mode(std::uint32_t change) {
  if (mode_change_ != change) mode_since_ = kernel_.now();
  mode_change_ = change;
}

void CommandRecord::check_mode() const {
  if (mode_change_ && kernel_.now() - mode_since_ > told_after && told_change_ != mode_change_)
    throw Violation{"L7b", fmt::format("the ground was not told the mode: change {}", *mode_change_)};
}

void CommandRecord::on_report(const wire::TmPacket& packet) {
  OctetReader in(packet.source);
  const std::uint16_t identification = in.u16();
  const wire::RequestId request{identification, in.u16()};
  const auto found = lives_.find(key_of(request));
  if (found == lives_.end()) return;
  Life& life = found->second;
  kernel_.trace(Lane::ttc, Lane::ground, "report 1,n", packet.subtype, found->first);
  if (life.insertion && packet.subtype == 1) note_schedule(found->first, ScheduleState::released);
  if (life.insertion && (packet.subtype == 2 || packet.subtype == 10)) {
    const std::uint16_t code = OctetReader(in).u16();
    const bool dropped = code == mission::failure::schedule_disabled || code == mission::failure::expired;
    note_schedule(found->first, dropped ? ScheduleState::dropped : ScheduleState::refused);
  }
  if (packet.subtype == 7) {
    for (const auto& [key, other] : lives_) {
      if (other.insertion == found->first && !other.accepted && !other.refused && other.ids.empty() &&
          !other.dropped)
        note_schedule(key, ScheduleState::in_schedule);
    }
  }
  if (packet.subtype != 1 && packet.subtype != 3 && packet.subtype != 5 && !life.ended)
    life.ended = kernel_.now();
  switch (packet.subtype) {
    case 1:
      counters_.accepted += life.accepted ? 0 : 1;
      life.accepted = true;
      break;
    case 2:
    case 10:
      counters_.refused += life.refused ? 0 : 1;
      life.refused = true;
      break;
    case 7:
      counters_.completed += life.completed ? 0 : 1;
      if (!life.completed && life.command->name == mission::StorageRetrieve::name && !life.unstored)
        stores_.on_retrieval_completed();
      life.completed = true;
      break;
    case 4:
    case 8:
      counters_.failed += life.failed ? 0 : 1;
      life.failed = in.u16();
      break;
    default:
      break;
  }
  check_not_executed(life);
  if (life.completed && life.failed && !life.unstored)
    throw Violation{"L4a", "it has two ends: " + describe(life)};
  if (life.completed && life.command->peripheral_function && life.executed == 0)
    throw Violation{"S10", "completed and never executed: " + describe(life)};
}

CommandRecord::Answer CommandRecord::answer(const wire::RequestId& request) const {
  const auto found = lives_.find(key_of(request));
  if (found == lives_.end()) return Answer::none;
  const Life& life = found->second;
  return life.completed ? Answer::completed
         : life.failed  ? Answer::failed
         : life.refused ? Answer::refused
                        : Answer::none;
}

/// What is in the schedule is released, or is reported as dropped.
void CommandRecord::check_schedule(const Life& life) const {
  const auto insertion = lives_.find(*life.insertion);
  const bool is_inserted =
      insertion != lives_.end() && insertion->second.completed && !insertion->second.unstored;
  // Shifted ones are due later.
  const bool is_over = has_right_time() && kernel_.now() - *time_since_ > released_after &&
                       truth_.utc(kernel_.now()) - life.release > released_after + seconds(60);
  if (is_inserted && is_over && !life.accepted && !life.refused && !life.dropped && life.ids.empty())
    throw Violation{"L4c",
                    "a scheduled telecommand is neither released nor reported as dropped: " + describe(life)};
}

void CommandRecord::check_ends(MonotonicTime sent_before) {
  for (const auto& [key, life] : lives_) {
    if (life.sent >= sent_before || life.unstored) continue;
    if (life.delivered && !life.accepted && !life.refused)
      throw Violation{"L4b",
                      "a frame was acknowledged, and nothing is known of its telecommand: " + describe(life)};
    if (life.insertion) check_schedule(life);
    if (life.published > sent_before) continue;  // by the schedule
    if (life.accepted && !life.completed && !life.failed && !life.refused)
      throw Violation{"L4", "it was accepted and has no end: " + describe(life)};
  }
  std::erase_if(lives_,
                [this](const auto& entry) { return entry.second.sent + forgotten_after < kernel_.now(); });
  std::erase_if(by_id_, [this](const auto& entry) { return !lives_.contains(entry.second); });
}

// ---------------------------------------------------------------- the ground

Station::Station(Kernel& kernel, const mission::Dictionary& dictionary, const suite::LinkSettings& link,
                 const wire::SdlsKey& key, CommandRecord& record, FileRecord& files,
                 const sim::TrueTime& truth, std::function<void(const Octets&)> to_spacecraft)
    : kernel_(kernel),
      dictionary_(dictionary),
      truth_(truth),
      operator_(kernel.random("operator")),
      files_operator_(kernel.random("operator of files")),
      list_operator_(kernel.random("operator of lists")),
      noise_(kernel.random("line")),
      channel_{.spacecraft_id = static_cast<std::uint16_t>(link.spacecraft_id),
               .vc = 0,
               .randomize = link.tc_randomizer,
               .whole_header = link.tc_strict},
      key_(key),
      record_(record),
      to_spacecraft_(std::move(to_spacecraft)),
      downlink_(link),
      commanding_(dictionary),
      ad_(0, {}),
      ad_timer_(
          kernel,
          [&kernel](nanoseconds delay, Kernel::Event event) { kernel.later(delay, std::move(event)); },
          [this] {
            ad_.on_time(kernel_.now());
            handle_ad();
          }),
      file_record_(files),
      files_(kernel, files, wire::sdls_packet_octets_max, [this](const Octets& packet) {
        auto cltu = frame(wire::TcFrameType::bd, 0, packet);
        return cltu ? uplink(std::move(*cltu)) : kernel_.now() + seconds(1);
      }) {
  record_.set_listener([this](const Octets& cadu) { on_cadu(cadu); });
  kernel_.later(seconds(3), [this] { work(); });
  kernel_.later(seconds(4), [this] { work_on_files(); });
  kernel_.later(seconds(30), [this] { send_list(); });
}

/// In a calm the operator makes sure that the spacecraft hears the ground, also behind a cut that lasts into
/// it: what rests goes on.
void Station::set_operator(bool works) {
  works_ = works;
  if (works) return;
  for (const nanoseconds delay : {seconds(2), seconds(40), seconds(100), seconds(160), seconds(205)})
    kernel_.later(delay, [this] {
      files_.on_contact();
      send_bd(make("ttc.ping", {}, false));
    });
}

/// On the ground and on board files come into the outboxes.
void Station::work_on_files() {
  kernel_.later(files_operator_.between(seconds(2), seconds(60)), [this] { work_on_files(); });
  if (!works_) return;
  if (files_operator_.one_in(2)) {
    files_.put(files_operator_);
  } else {
    (void)file_record_.put(FileRecord::End::board, files_operator_);
  }
  if (files_operator_.one_in(10)) files_.restart();
  if (files_operator_.one_in(4)) files_.on_contact();
}

void Station::work() {
  kernel_.later(operator_.between(milliseconds(200), seconds(12)), [this] { work(); });
  for (const ground::StageReport& late : commanding_.on_time(kernel_.now()))
    kernel_.trace(Lane::ground, Lane::ground, "nothing heard of", late.request.packet_sequence_control);
  if (!works_) return;
  const bool repeats = operator_.one_in(4);
  if (repeats && !recent_.empty()) return send_bd(recent_[operator_.below(recent_.size())]);
  if (operator_.one_in(20)) ad_.stop(kernel_.now());
  note_ad();
  if (operator_.one_in(6)) ad_.start(kernel_.now());
  note_ad();
  if (operator_.one_in(40)) ad_.unlock(kernel_.now());
  note_ad();
  if (operator_.one_in(60)) ad_.set_vr(static_cast<std::uint8_t>(operator_.below(256)), kernel_.now());
  note_ad();
  send_something();
  handle_ad();
}

/// An operator sends a list of telecommands at once, half of them by the AD service if it is on: while the
/// disk is slow, ttc has no room for all of them.
void Station::send_list() {
  kernel_.later(list_operator_.between(seconds(20), seconds(120)), [this] { send_list(); });
  if (!works_) return;
  for (auto left = 10 + list_operator_.below(50); left > 0; --left) {
    const Choice& choice = any_choice(list_operator_);
    if (choice.name == std::string_view(mission::TtcSetMode::name)) continue;  // a mode is to last
    const Queued telecommand = make(choice.name, choice.arguments, false);
    record_.on_sent(telecommand.request, *telecommand.command);
    const bool by_ad = ad_.phase() == ground::AdPhase::on && list_operator_.one_in(2);
    if (!by_ad) {
      send_bd(telecommand);
    } else if (ad_.request(next_tag_, telecommand.packet, kernel_.now())) {
      by_ad_.emplace(next_tag_++, telecommand);
    }
  }
  handle_ad();
}

wire::RequestId Station::order(std::string_view name, const std::vector<std::string>& arguments) {
  const Queued telecommand = make(name, arguments, false);
  record_.on_sent(telecommand.request, *telecommand.command);
  if (name == mission::ScheduleReset::name) record_.on_schedule_reset();
  send_bd(telecommand);
  return telecommand.request;
}

Station::Queued Station::make(std::string_view name, const std::vector<std::string>& arguments,
                              bool spoiled) {
  const auto encoded = dictionary_.encode(name, arguments);
  if (!encoded)
    throw Violation{"L8", "the dictionary refuses " + std::string(name) + ": " + encoded.error().message};
  wire::TcPacket packet{.apid = encoded->command->apid,
                        .sequence_count = sequence_[encoded->command->apid],
                        .service = encoded->command->service,
                        .subtype = encoded->command->subtype,
                        .application = encoded->data};
  sequence_[packet.apid] = static_cast<std::uint16_t>((packet.sequence_count + 1) & 0x3FFF);
  if (spoiled) packet.application.push_back(7);
  return {wire::request_id(packet), encoded->command, wire::make_tc_packet(packet)};
}

void Station::send_something() {
  if (operator_.one_in(6)) return send_scheduled();
  if (operator_.one_in(30)) return send_retrieval();
  if (operator_.one_in(80)) {
    record_.on_schedule_reset();
    return send_bd(make(mission::ScheduleReset::name, {}, false));
  }
  const Choice& choice = any_choice(operator_);
  const Queued telecommand = make(choice.name, choice.arguments, operator_.one_in(30));
  record_.on_sent(telecommand.request, *telecommand.command);
  send(telecommand);
}

/// Something is to be released up to three minutes later.
void Station::send_scheduled() {
  constexpr int decimals = 9;
  const Choice& choice = any_choice(operator_);
  const Queued later = make(choice.name, choice.arguments, false);
  const UtcTime release = utc() + operator_.between(seconds(1), seconds(operator_.one_in(4) ? 180 : 30));
  const Queued insertion = make(
      mission::ScheduleInsert::name,
      {"release=" + to_iso8601(release, decimals), "request=" + to_hex(later.packet)}, operator_.one_in(30));
  record_.on_sent(insertion.request, *insertion.command);
  record_.on_scheduled(later.request, *later.command, insertion.request, release);
  send(insertion);
}

void Station::send_retrieval() {
  constexpr int decimals = 9;
  const auto& stores = dictionary_.stores();
  const UtcTime to = utc() - operator_.between(nanoseconds(0), seconds(600));
  const UtcTime from = to - operator_.between(seconds(1), seconds(40));
  const Queued telecommand = make(mission::StorageRetrieve::name,
                                  {"store=" + stores[operator_.below(stores.size())].name,
                                   "from=" + to_iso8601(from, decimals), "to=" + to_iso8601(to, decimals)},
                                  false);
  record_.on_sent(telecommand.request, *telecommand.command);
  send(telecommand);
}

void Station::send(const Queued& telecommand) {
  kernel_.trace(Lane::ground, Lane::ttc, telecommand.command->name.c_str(),
                telecommand.request.packet_identification, telecommand.request.packet_sequence_control);
  const auto phase = ad_.phase();
  if (phase == ground::AdPhase::on && !operator_.one_in(4)) {
    if (ad_.request(next_tag_, telecommand.packet, kernel_.now())) by_ad_.emplace(next_tag_++, telecommand);
    return;
  }
  send_bd(telecommand);
  recent_.push_back(telecommand);
  kernel_.later(repeat_time, [this, request = telecommand.request] {
    std::erase_if(recent_, [&](const Queued& q) { return q.request == request; });
  });
  if (recent_.size() > most_recent) recent_.erase(recent_.begin());
}

void Station::send_bd(const Queued& telecommand) {
  auto cltu = frame(wire::TcFrameType::bd, 0, telecommand.packet);
  if (!cltu) return;
  (void)commanding_.sent(telecommand.request, *telecommand.command,
                         telecommand.command->timeout + milliseconds(2000), next_tag_++, kernel_.now());
  kernel_.trace(Lane::ground, Lane::ttc, "BD frame", telecommand.request.packet_identification,
                telecommand.request.packet_sequence_control);
  uplink(std::move(*cltu));
}

/// Follows the clock, as those of srfs-ground do.
std::uint64_t Station::next_counter() {
  return counter_ = std::max(counter_ + 1, clock_counter(utc()));
}

std::optional<Octets> Station::frame(wire::TcFrameType type, std::uint8_t sequence, OctetView packet) {
  const wire::SdlsSeal seal{key_, spi_bd, next_counter()};
  auto cltu = wire::make_uplink_cltu(channel_, type, sequence, &seal, packet);
  return cltu ? std::optional(std::move(*cltu)) : std::nullopt;
}

std::optional<Octets> Station::control_frame(wire::ControlCommand command) {
  if (!channel_.whole_header) return wire::make_control_cltu(channel_, command);
  auto cltu = wire::make_secured_control_cltu(channel_, command, {key_, spi_bd, next_counter()});
  return cltu ? std::optional(std::move(*cltu)) : std::nullopt;
}

bool Station::passes_line(Octets& octets, Random& random) {
  if (line_.cut || random.below(1000) < line_.lost_per_1000) return false;
  if (random.below(1000) < line_.spoiled_per_1000) {
    std::uint8_t& octet = octets[random.below(octets.size())];
    octet = static_cast<std::uint8_t>(octet ^ (1U << random.below(8)));
  }
  return true;
}

MonotonicTime Station::uplink(Octets cltu) {
  constexpr std::int64_t octet_ns = 10'000'000'000 / 921'600;
  up_free_ =
      std::max(up_free_, kernel_.now()) + nanoseconds(octet_ns * static_cast<std::int64_t>(cltu.size()));
  if (passes_line(cltu, noise_))
    kernel_.at(up_free_, [this, cltu = std::move(cltu)] { to_spacecraft_(cltu); });
  return up_free_;
}

void Station::on_cadu(const Octets& cadu) {
  constexpr std::int64_t octet_ns = 10'000'000'000 / 921'600;
  down_free_ =
      std::max(down_free_, kernel_.now()) + nanoseconds(octet_ns * static_cast<std::int64_t>(cadu.size()));
  Octets octets = cadu;
  if (!passes_line(octets, noise_)) return;
  kernel_.at(down_free_, [this, octets = std::move(octets)] {
    const auto packets = downlink_.push(octets);
    for (const std::uint32_t word : downlink_.take_control_words()) ad_.on_control_word(word, kernel_.now());
    const auto pdus = downlink_.take_file_pdus();
    for (const Octets& pdu : pdus) files_.on_pdu(pdu);
    if (!pdus.empty()) files_.move();
    handle_ad();
    for (const ground::ReceivedPacket& received : packets)
      (void)commanding_.on_packet(received.packet, kernel_.now());
  });
}

void Station::note_ad() {
  kernel_.coverage().note(StateTable::ad, 0, static_cast<std::uint8_t>(ad_.phase()));
  kernel_.coverage().note(StateTable::fop, 0, static_cast<std::uint8_t>(ad_.report().state));
}

void Station::handle_ad() {
  note_ad();
  while (const auto signal = ad_.next_signal()) {
    const auto telecommand = by_ad_.find(signal->tag);
    if (signal->kind == Kind::transmit_ad || signal->kind == Kind::transmit_bc) {
      auto cltu = signal->kind == Kind::transmit_bc
                      ? control_frame(signal->control)
                      : frame(wire::TcFrameType::ad, signal->sequence, signal->packet);
      kernel_.trace(Lane::ground, Lane::ttc, signal->kind == Kind::transmit_bc ? "BC frame" : "AD frame",
                    signal->sequence, signal->repeated ? 1 : 0);
      const bool written = cltu.has_value();
      if (written) uplink(std::move(*cltu));
      ad_.on_transmitted(signal->kind, written, kernel_.now());
      continue;
    }
    if (telecommand == by_ad_.end()) continue;
    if (signal->kind == Kind::delivered) record_.on_delivered(telecommand->second.request);
    if (signal->kind != Kind::changed) by_ad_.erase(telecommand);
  }
  note_ad();
  ad_timer_.arm(ad_.deadline());
}

}  // namespace srfs::simulation
