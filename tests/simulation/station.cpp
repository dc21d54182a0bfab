// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/station.hpp"

#include <fmt/format.h>

namespace srfs::simulation {
namespace {

using Kind = ground::AdSignal::Kind;

constexpr std::uint8_t verification_service = 1;
constexpr std::uint16_t spi_bd = 1;
constexpr nanoseconds repeat_time = seconds(30);  ///< well within ttc's window of repeats
constexpr nanoseconds forgotten_after = seconds(3600);
constexpr std::size_t most_recent = 8;

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
      {"ttc.disarm", {}, 1},
      {"storage.status", {}, 1},
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

CommandRecord::CommandRecord(Kernel& kernel, const mission::Dictionary& /*dictionary*/,
                             const suite::LinkSettings& link)
    : kernel_(kernel), receiver_(link) {}

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
  if (life.ids.size() > 1 && !life.unstored)
    throw Violation{"L4a", "a repeated packet became another telecommand: " + describe(life)};
}

void CommandRecord::on_executed(std::uint32_t telecommand_id) {
  kernel_.trace(Lane::bus, Lane::bus, "executes telecommand", telecommand_id);
  const auto id = by_id_.find(telecommand_id);
  if (id == by_id_.end()) return;
  const auto found = lives_.find(id->second);
  if (found == lives_.end()) return;
  Life& life = found->second;
  ++counters_.executed;
  if (++life.executed > 1 && life.command->repeat_class != mission::RepeatClass::idempotent)
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
    if (received.vc == ground::tm_channel::live && received.packet.service == verification_service)
      on_report(received.packet);
  }
  (void)receiver_.take_control_words();
  (void)receiver_.take_file_pdus();
  if (listener_) listener_(cadu);
}

void CommandRecord::on_report(const wire::TmPacket& packet) {
  OctetReader in(packet.source);
  const std::uint16_t identification = in.u16();
  const wire::RequestId request{identification, in.u16()};
  const auto found = lives_.find(key_of(request));
  if (found == lives_.end()) return;
  Life& life = found->second;
  kernel_.trace(Lane::ttc, Lane::ground, "report 1,n", packet.subtype, found->first);
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
  if (life.completed && life.failed && !life.unstored)
    throw Violation{"L4a", "it has two ends: " + describe(life)};
  if (life.completed && life.command->peripheral_function && life.executed == 0)
    throw Violation{"S10", "completed and never executed: " + describe(life)};
}

void CommandRecord::check_ends(MonotonicTime sent_before) {
  for (const auto& [key, life] : lives_) {
    if (life.sent >= sent_before || life.unstored) continue;
    if (life.delivered && !life.accepted && !life.refused)
      throw Violation{"L4b",
                      "a frame was acknowledged, and nothing is known of its telecommand: " + describe(life)};
    if (life.accepted && !life.completed && !life.failed && !life.refused)
      throw Violation{"L4", "it was accepted and has no end: " + describe(life)};
  }
  std::erase_if(lives_,
                [this](const auto& entry) { return entry.second.sent + forgotten_after < kernel_.now(); });
  std::erase_if(by_id_, [this](const auto& entry) { return !lives_.contains(entry.second); });
}

// ---------------------------------------------------------------- the ground

Station::Station(Kernel& kernel, const mission::Dictionary& dictionary, const suite::LinkSettings& link,
                 const wire::SdlsKey& key, CommandRecord& record,
                 std::function<void(const Octets&)> to_spacecraft)
    : kernel_(kernel),
      dictionary_(dictionary),
      operator_(kernel.random("operator")),
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
      counter_(static_cast<std::uint64_t>(1'795'000'000) * 1000),
      ad_timer_(
          kernel,
          [&kernel](nanoseconds delay, Kernel::Event event) { kernel.later(delay, std::move(event)); },
          [this] {
            ad_.on_time(kernel_.now());
            handle_ad();
          }) {
  record_.set_listener([this](const Octets& cadu) { on_cadu(cadu); });
  kernel_.later(seconds(3), [this] { work(); });
}

void Station::work() {
  kernel_.later(operator_.between(milliseconds(200), seconds(12)), [this] { work(); });
  for (const ground::StageReport& late : commanding_.on_time(kernel_.now()))
    kernel_.trace(Lane::ground, Lane::ground, "nothing heard of", late.request.packet_sequence_control);
  if (!works_) return;
  const bool repeats = operator_.one_in(4);
  if (repeats && !recent_.empty()) return send_bd(recent_[operator_.below(recent_.size())]);
  if (operator_.one_in(20)) ad_.stop(kernel_.now());
  if (operator_.one_in(6)) ad_.start(kernel_.now());
  if (operator_.one_in(40)) ad_.unlock(kernel_.now());
  if (operator_.one_in(60)) ad_.set_vr(static_cast<std::uint8_t>(operator_.below(256)), kernel_.now());
  send_something();
  handle_ad();
}

void Station::send_something() {
  const Choice& choice = any_choice(operator_);
  const auto encoded = dictionary_.encode(choice.name, choice.arguments);
  if (!encoded)
    throw Violation{"L8",
                    "the dictionary refuses " + std::string(choice.name) + ": " + encoded.error().message};
  wire::TcPacket packet{.apid = encoded->command->apid,
                        .sequence_count = sequence_[encoded->command->apid],
                        .service = encoded->command->service,
                        .subtype = encoded->command->subtype,
                        .application = encoded->data};
  sequence_[packet.apid] = static_cast<std::uint16_t>((packet.sequence_count + 1) & 0x3FFF);
  if (operator_.one_in(30)) packet.application.push_back(7);
  const Queued telecommand{wire::request_id(packet), encoded->command, wire::make_tc_packet(packet)};
  record_.on_sent(telecommand.request, *telecommand.command);
  kernel_.trace(Lane::ground, Lane::ttc, choice.name, packet.apid, packet.sequence_count);
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

std::optional<Octets> Station::frame(wire::TcFrameType type, std::uint8_t sequence, OctetView packet) {
  const wire::SdlsSeal seal{key_, spi_bd, counter_++};
  auto cltu = wire::make_uplink_cltu(channel_, type, sequence, &seal, packet);
  return cltu ? std::optional(std::move(*cltu)) : std::nullopt;
}

std::optional<Octets> Station::control_frame(wire::ControlCommand command) {
  if (!channel_.whole_header) return wire::make_control_cltu(channel_, command);
  auto cltu = wire::make_secured_control_cltu(channel_, command, {key_, spi_bd, counter_++});
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

void Station::uplink(Octets cltu) {
  constexpr std::int64_t octet_ns = 10'000'000'000 / 921'600;
  up_free_ =
      std::max(up_free_, kernel_.now()) + nanoseconds(octet_ns * static_cast<std::int64_t>(cltu.size()));
  if (!passes_line(cltu, noise_)) return;
  kernel_.at(up_free_, [this, cltu = std::move(cltu)] { to_spacecraft_(cltu); });
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
    (void)downlink_.take_file_pdus();
    handle_ad();
    for (const ground::ReceivedPacket& received : packets)
      (void)commanding_.on_packet(received.packet, kernel_.now());
  });
}

void Station::handle_ad() {
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
  ad_timer_.arm(ad_.deadline());
}

}  // namespace srfs::simulation
