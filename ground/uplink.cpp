// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/uplink.hpp"

#include <algorithm>
#include <array>
#include <cerrno>

#include <fmt/format.h>
#include <sys/stat.h>
#include <nlohmann/json.hpp>

#include "base/fd.hpp"
#include "base/file.hpp"
#include "base/random_octets.hpp"
#include "base/text.hpp"
#include "ground/key_change.hpp"
#include "wire/sdls_procedures.hpp"

namespace srfs::ground {
namespace {

constexpr std::uint16_t sequence_modulus = 0x4000;
constexpr milliseconds clock_slack{60'000};  ///< of files and telecommands, sent at once, and of small steps

/// Which files there are: each write makes new ones. Empty: none.
std::string identity_of(const std::filesystem::path& session_keys) {
  std::string identity;
  for (const char* copy : {".0", ".1"}) {
    struct stat info {};
    if (stat((session_keys.string() + copy).c_str(), &info) != 0) continue;
    identity += fmt::format("{}:{}:{}.{} ", copy, info.st_ino, info.st_mtim.tv_sec, info.st_mtim.tv_nsec);
  }
  return identity;
}

}  // namespace

Result<wire::SdlsKey, std::string> read_link_key(const std::filesystem::path& file) {
  struct stat info {};
  if (stat(file.c_str(), &info) == 0 && (info.st_mode & 077U) != 0) {
    return Err(fmt::format("{}: others may read this key (mode {:04o}): chmod 600, or replace it if they did",
                           file.string(), info.st_mode & 07777U));
  }
  auto text = read_file(file, 4096);
  if (!text) return Err(text.error().message + " (the simulated spacecraft makes a test key when it starts)");
  while (!text->empty() && (text->back() == '\n' || text->back() == ' ')) text->pop_back();
  auto key = wire::SdlsKey::from_hex(*text);
  std::fill(text->begin(), text->end(), '\0');
  if (!key)
    return Err(fmt::format("{}: expected a link key of {} hexadecimal digits", file.string(),
                           2 * wire::sdls_key_octets));
  return std::move(*key);
}

std::string_view to_text(suite::AssociationSet set) {
  switch (set) {
    case suite::AssociationSet::a:
      return "a";
    case suite::AssociationSet::b:
      return "b";
    case suite::AssociationSet::contingency:
      return "contingency";
  }
  return "?";
}

std::optional<suite::AssociationSet> key_set_of(std::string_view text) {
  for (const auto set :
       {suite::AssociationSet::a, suite::AssociationSet::b, suite::AssociationSet::contingency}) {
    if (text == to_text(set)) return set;
  }
  return std::nullopt;
}

namespace {

/// {"17": 4, ...}: entries with a number as key and another one below @p limit as value; others are left out.
std::map<std::uint16_t, std::uint64_t> numbers_of(const nlohmann::json& json, std::uint64_t limit) {
  std::map<std::uint16_t, std::uint64_t> numbers;
  if (!json.is_object()) return numbers;
  for (const auto& [key, value] : json.items()) {
    const auto number = to_number<std::uint16_t>(key);
    if (number && value.is_number_unsigned() && value.get<std::uint64_t>() < limit)
      numbers[*number] = value.get<std::uint64_t>();
  }
  return numbers;
}

}  // namespace

void UplinkState::on_time(UtcTime now) {
  const auto counted = static_cast<std::uint64_t>(std::max<std::int64_t>(now.ns() / 1'000'000, 0));
  clock_floor_ = std::max(clock_floor_, counted);
}

Result<UplinkState, std::string> UplinkState::open(const std::filesystem::path& file, UtcTime now,
                                                   bool one_order) {
  UplinkState state(file);
  state.one_order_ = one_order;
  state.on_time(now);
  state.first_counter_ = state.clock_floor_;
  std::error_code error;
  if (!std::filesystem::exists(file, error)) return state;
  const auto text = read_file(file, 65536);
  if (!text) return Err(text.error().message);
  const auto json = nlohmann::json::parse(*text, nullptr, false);
  const auto member = [&json](const char* name) {
    return json.is_object() && json.contains(name) ? json[name] : nlohmann::json();
  };
  if (!member("next_security_counter").is_number_unsigned()) {
    return Err(
        fmt::format("{}: not a state file of the ground tool; if its content is lost, remove it (a new "
                    "security counter starts above the old)",
                    file.string()));
  }
  // The highest of all; before there was one for each association, the only one.
  const auto highest = member("next_security_counter").get<std::uint64_t>();
  state.first_counter_ = std::max(highest, state.clock_floor_);
  for (const auto& [spi, next] : numbers_of(member("next_security_counters"), UINT64_MAX)) {
    const std::uint64_t first = std::max(next, state.clock_floor_);
    state.counters_[spi] = {.next = first, .saved = next, .known = next, .first = first};
  }
  const milliseconds ahead(state.first_counter_ - state.clock_floor_);
  if (ahead > clock_slack) state.ahead_of_clock_ = std::chrono::duration_cast<seconds>(ahead);
  for (const auto& [apid, next] : numbers_of(member("next_sequence_counts"), sequence_modulus))
    state.next_sequence_[apid] = static_cast<std::uint16_t>(next);
  if (const auto set = member("keys"); set.is_string())
    state.key_set_ = key_set_of(set.get<std::string>()).value_or(state.key_set_);
  return state;
}

UplinkState::Counter& UplinkState::counter(std::uint16_t spi) {
  const Counter begun{
      .next = first_counter_, .saved = first_counter_, .known = first_counter_, .first = first_counter_};
  Counter& found = counters_.try_emplace(spi, begun).first->second;
  found.next = std::max(found.next, clock_floor_);
  for (const auto& [other, counter] : counters_) {
    if (one_order_) found.next = std::max(found.next, counter.next);
  }
  return found;
}

bool UplinkState::is_foreign(std::uint16_t spi, std::uint64_t value) const {
  const auto found = counters_.find(spi);
  if (found == counters_.end()) return value >= first_counter_;
  const Counter& c = found->second;
  return value >= c.next || (value >= c.known && value < c.first);
}

bool UplinkState::is_believable(std::uint16_t spi, std::uint64_t value) const {
  const auto ahead = static_cast<std::uint64_t>(believable_ahead.count());
  const std::uint64_t next = next_counter(spi);
  // Of the clock, not of the last counter: forged beacons must not add up.
  if (one_order_) return value < next || value <= clock_floor_ + ahead;
  const std::uint64_t from = std::max(next, clock_floor_);
  return value <= from || value - from <= ahead;
}

std::uint64_t UplinkState::next_counter(std::uint16_t spi) const {
  const auto found = counters_.find(spi);
  return found == counters_.end() ? first_counter_ : found->second.next;
}

/// What stands in the file is what may be used: on an error the caller takes back what it raised.
Result<void, std::string> UplinkState::save() {
  nlohmann::json json;
  std::uint64_t highest = first_counter_;
  for (const auto& [spi, counter] : counters_) {
    json["next_security_counters"][fmt::format("{}", spi)] = counter.saved;
    highest = std::max(highest, counter.saved);
  }
  json["next_security_counter"] = highest;
  for (const auto& [process, count] : next_sequence_)
    json["next_sequence_counts"][fmt::format("{}", process)] = count;
  json["keys"] = to_text(key_set_);
  const auto written = write_file_atomically(file_, json.dump(2) + "\n");
  if (!written) return Err(written.error().message);
  return {};
}

Result<std::uint16_t, std::string> UplinkState::reserve_sequence_count(std::uint16_t apid) {
  const std::uint16_t count = next_sequence_[apid];
  next_sequence_[apid] = static_cast<std::uint16_t>((count + 1) % sequence_modulus);
  if (const auto saved = save(); !saved) {
    next_sequence_[apid] = count;
    return Err(saved.error());
  }
  return count;
}

Result<std::uint64_t, std::string> UplinkState::reserve_counter(std::uint16_t spi) {
  Counter& c = counter(spi);
  const std::uint64_t before = c.saved;
  c.saved = std::max(c.saved, c.next + 1);
  if (const auto saved = save(); !saved) {
    c.saved = before;
    return Err(saved.error());
  }
  return c.next++;
}

Result<UplinkState::Reserved, std::string> UplinkState::reserve(std::uint16_t apid, std::uint16_t spi) {
  const std::uint16_t count = next_sequence_[apid];
  next_sequence_[apid] = static_cast<std::uint16_t>((count + 1) % sequence_modulus);
  const auto reserved = reserve_counter(spi);  // writes both
  if (!reserved) {
    next_sequence_[apid] = count;
    return Err(reserved.error());
  }
  return Reserved{count, *reserved};
}

Result<std::uint64_t, std::string> UplinkState::reserve_counter_ahead(std::uint16_t spi) {
  Counter& c = counter(spi);
  if (c.next >= c.saved) {
    const std::uint64_t before = c.saved;
    c.saved = c.next + counters_ahead;
    if (const auto saved = save(); !saved) {
      c.saved = before;
      return Err(saved.error());
    }
  }
  return c.next++;
}

Result<void, std::string> UplinkState::raise(std::uint16_t spi, std::uint64_t value) {
  Counter& c = counter(spi);
  if (value < c.next || value == UINT64_MAX) return {};
  c.next = value + 1;
  c.saved = std::max(c.saved, c.next);
  return save();
}

Result<void, std::string> UplinkState::set_key_set(suite::AssociationSet set) {
  if (key_set_ == set) return {};
  key_set_ = set;
  return save();
}

Result<Uplink, std::string> Uplink::open(const suite::LinkSettings& link,
                                         const std::filesystem::path& var_dir,
                                         const std::filesystem::path& state_dir, UtcTime now,
                                         std::optional<suite::AssociationSet> forced, std::uint8_t station) {
  if (link.channels.empty())
    return Err(std::string("the deployment has no telecommand channel (link.tc_channels)"));
  const auto secured = std::find_if(link.channels.begin(), link.channels.end(),
                                    [](const auto& c) { return c.security == suite::ChannelSecurity::sdls; });
  const auto& chosen = secured == link.channels.end() ? link.channels.front() : *secured;
  auto state = UplinkState::open(state_dir / "uplink.json", now, link.tc_strict);
  if (!state) return Err(state.error());
  std::array<std::uint8_t, 3> drawn{};
  if (!fill_random(drawn))
    return Err(fmt::format("no random number for the initialisation vectors: {}", errno_text(errno)));
  Uplink uplink({static_cast<std::uint16_t>(link.spacecraft_id),
                 static_cast<std::uint8_t>(chosen.virtual_channel), link.tc_randomizer, link.tc_strict},
                std::move(*state));
  if (link.tc_strict) uplink.sender_ = static_cast<std::uint32_t>(station) << 24 | OctetReader(drawn).u24();
  if (uplink.sender_ == wire::answering_sender) --uplink.sender_;
  uplink.secured_ = secured != link.channels.end();
  uplink.forced_ = forced.has_value();
  uplink.set_ = forced.value_or(uplink.state_.key_set());
  uplink.session_keys_ = session_keys_of(state_dir);
  uplink.session_keys_seen_ = identity_of(uplink.session_keys_);
  wire::SessionKeys session_keys;
  if (const auto ring = KeyRing::open(state_dir, false); ring) {
    session_keys = ring->keys();
  } else if (uplink.set_ != suite::AssociationSet::contingency) {
    return Err(ring.error());
  }
  for (const auto& entry : link.channels) {
    const auto same_set = [&entry](const auto& other) {
      return other.security == suite::ChannelSecurity::sdls && other.set == entry.set &&
             other.virtual_channel == entry.virtual_channel;
    };
    if (entry.security != suite::ChannelSecurity::sdls || entry.virtual_channel != chosen.virtual_channel)
      continue;
    const auto used = session_keys.use_of(static_cast<std::uint16_t>(entry.spi));
    const auto* replaced = used ? session_keys.find(used->current) : nullptr;
    auto key = replaced != nullptr ? Result<wire::SdlsKey, std::string>(replaced->octets.key())
                                   : read_link_key(var_dir / entry.key_file);
    if (!key && entry.set != uplink.set_) continue;
    if (!key) return Err(key.error());
    const auto first = std::find_if(link.channels.begin(), link.channels.end(), same_set);
    const bool alone = std::count_if(link.channels.begin(), link.channels.end(), same_set) == 1;
    uplink.associations_.push_back({.key = std::move(*key),
                                    .spi = static_cast<std::uint16_t>(entry.spi),
                                    .set = entry.set,
                                    .for_bd = alone || first->spi == entry.spi,
                                    .for_ad = alone || first->spi != entry.spi});
  }
  if (uplink.secured_ && !uplink.has(uplink.set_))
    return Err(fmt::format("the deployment has no keys '{}' for this channel (link.tc_channels)",
                           to_text(uplink.set_)));
  return uplink;
}

void Uplink::follow_session_keys() {
  std::string found = identity_of(session_keys_);
  if (found == session_keys_seen_) return;
  session_keys_seen_ = std::move(found);
  // Damaged ones are logged, and the keys in use stay.
  if (const auto state = wire::session_key_file(session_keys_).load().state) use(*state);
}

void Uplink::use(const wire::SessionKeys& keys) {
  for (Association& association : associations_) {
    const auto used = keys.use_of(association.spi);
    if (const auto* current = used ? keys.find(used->current) : nullptr; current != nullptr)
      association.key = current->octets.key();
  }
}

bool Uplink::has(suite::AssociationSet set) const {
  return std::any_of(associations_.begin(), associations_.end(),
                     [set](const auto& a) { return a.set == set; });
}

const Uplink::Association* Uplink::association(wire::TcFrameType type, suite::AssociationSet set) const {
  const auto found = std::find_if(associations_.begin(), associations_.end(), [&](const auto& a) {
    return a.set == set && (type == wire::TcFrameType::ad ? a.for_ad : a.for_bd);
  });
  return found == associations_.end() ? nullptr : &*found;
}

Result<bool, std::string> Uplink::select(suite::AssociationSet set) {
  if (!has(set))
    return Err(fmt::format("the spacecraft uses keys '{}', which are missing here", to_text(set)));
  const auto saved = state_.set_key_set(set);
  const bool changed = !forced_ && set != set_;
  if (!forced_) set_ = set;
  if (!saved) return Err(saved.error());
  return changed;
}

std::optional<suite::AssociationSet> Uplink::set_of(std::uint16_t spi) const {
  for (const Association& association : associations_) {
    if (association.spi == spi) return association.set;
  }
  return std::nullopt;
}

wire::TcPacket Uplink::packet_of(const mission::EncodedCommand& command, std::uint16_t sequence_count) const {
  return {.apid = command.command->apid,
          .sequence_count = sequence_count,
          .service = command.command->service,
          .subtype = command.command->subtype,
          .application = command.data};
}

Result<OutgoingTelecommand, std::string> Uplink::make(const mission::EncodedCommand& command,
                                                      std::optional<suite::AssociationSet> set) {
  if (set && secured_ && !has(*set)) return Err(fmt::format("the keys '{}' are missing here", to_text(*set)));
  const Association* const used = association(wire::TcFrameType::bd, set.value_or(set_));
  std::optional<wire::SdlsSeal> seal;
  std::uint16_t sequence_count = 0;
  if (used != nullptr) {
    const auto reserved = state_.reserve(command.command->apid, used->spi);
    if (!reserved) return Err(reserved.error());
    seal.emplace(seal_of(*used, reserved->counter));
    sequence_count = reserved->sequence_count;
  } else {
    const auto count = state_.reserve_sequence_count(command.command->apid);
    if (!count) return Err(count.error());
    sequence_count = *count;
  }
  const wire::TcPacket packet = packet_of(command, sequence_count);
  auto cltu = wire::make_uplink_cltu(channel_, wire::TcFrameType::bd, 0, seal ? &*seal : nullptr,
                                     wire::make_tc_packet(packet));
  if (!cltu) return Err(fmt::format("{}: {}", command.command->name, wire::to_string(cltu.error())));
  ++sent_;
  return OutgoingTelecommand{wire::request_id(packet), seal ? std::optional(seal->counter) : std::nullopt,
                             std::move(*cltu)};
}

Result<TelecommandPacket, std::string> Uplink::make_packet(const mission::EncodedCommand& command) {
  const auto count = state_.reserve_sequence_count(command.command->apid);
  if (!count) return Err(count.error());
  const wire::TcPacket packet = packet_of(command, *count);
  TelecommandPacket made{wire::request_id(packet), wire::make_tc_packet(packet)};
  if (made.packet.size() > packet_octets_max())
    return Err(fmt::format("{}: {}", command.command->name, wire::to_string(wire::TcUplinkError::too_long)));
  ++sent_;
  return made;
}

Result<Octets, std::string> Uplink::make_ad_cltu(std::uint8_t sequence, OctetView packet) {
  const Association* const used = association(wire::TcFrameType::ad, set_);
  std::optional<wire::SdlsSeal> seal;
  if (used != nullptr) {
    const auto counter = state_.reserve_counter(used->spi);
    if (!counter) return Err(counter.error());
    seal.emplace(seal_of(*used, *counter));
  }
  auto cltu =
      wire::make_uplink_cltu(channel_, wire::TcFrameType::ad, sequence, seal ? &*seal : nullptr, packet);
  if (!cltu) return Err(std::string(wire::to_string(cltu.error())));
  return std::move(*cltu);
}

std::size_t Uplink::packet_octets_max() const {
  return secured_ ? wire::sdls_packet_octets_max : wire::tc_data_octets_max - 1;
}

Result<Octets, std::string> Uplink::make_file_cltu(OctetView packet) {
  const Association* const used = association(wire::TcFrameType::bd, set_);
  std::optional<wire::SdlsSeal> seal;
  if (used != nullptr) {
    const auto counter = state_.reserve_counter_ahead(used->spi);
    if (!counter) return Err(counter.error());
    seal.emplace(seal_of(*used, *counter));
  }
  auto cltu = wire::make_uplink_cltu(channel_, wire::TcFrameType::bd, 0, seal ? &*seal : nullptr, packet);
  if (!cltu) return Err(std::string(wire::to_string(cltu.error())));
  return std::move(*cltu);
}

Result<Octets, std::string> Uplink::make_bc_cltu(wire::ControlCommand command) {
  const Association* const used = association(wire::TcFrameType::bc, set_);
  if (used == nullptr || !channel_.whole_header) return wire::make_control_cltu(channel_, command);
  const auto counter = state_.reserve_counter(used->spi);
  if (!counter) return Err(counter.error());
  auto cltu = wire::make_secured_control_cltu(channel_, command, seal_of(*used, *counter));
  if (!cltu) return Err(std::string(wire::to_string(cltu.error())));
  return std::move(*cltu);
}

std::optional<std::string> Uplink::on_spacecraft_counter(std::uint16_t spi, std::uint64_t counter) {
  if (!set_of(spi)) return std::nullopt;
  if (!state_.is_believable(spi, counter)) {
    if (!unbelievable_told_.insert(spi).second) return std::nullopt;
    return fmt::format(
        "a beacon has security counter {} of association {}, more than 30 days ahead of this clock: not "
        "followed, beacons are not authentic. If the spacecraft does refuse telecommands as replayed, give "
        "--counters-from",
        counter, spi);
  }
  const bool foreign = state_.is_foreign(spi, counter) && foreign_told_.insert(spi).second;
  // Not on disk is no loss yet: the next telecommand writes it, and the beacon says it again.
  (void)state_.raise(spi, counter);
  if (!foreign) return std::nullopt;
  return fmt::format(
      "the spacecraft has accepted security counter {} of association {}, which was not sent with {}: that "
      "is an older copy, or another ground station commands. Counters continue above it, at {}; sequence "
      "counts may repeat",
      counter, spi, state_.file().string(), state_.next_counter(spi));
}

std::string Uplink::warning() const {
  const auto ahead = state_.ahead_of_clock();
  if (!secured_ || !ahead) return "";
  return fmt::format(
      "the security counters of {} are {} s ahead of this computer's clock: they continue from there, but an "
      "older copy of the file would reuse counters. If the clock is behind, set it",
      state_.file().string(), *ahead / seconds(1));
}

}  // namespace srfs::ground
