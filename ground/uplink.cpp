#include "ground/uplink.hpp"

#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/file.hpp"

namespace srfs::ground {
namespace {

constexpr std::uint16_t sequence_modulus = 0x4000;

/// Hexadecimal digits, a newline behind them allowed.
Result<wire::SdlsKey, std::string> read_key(const std::filesystem::path& file) {
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

}  // namespace

Result<UplinkState, std::string> UplinkState::open(const std::filesystem::path& file, UtcTime now) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) {
    return UplinkState(file, static_cast<std::uint64_t>(now.ns() / 1'000'000));
  }
  const auto text = read_file(file, 65536);
  if (!text) return Err(text.error().message);
  const auto json = nlohmann::json::parse(*text, nullptr, false);
  const auto counter =
      json.is_object() ? json.value("next_security_counter", nlohmann::json()) : nlohmann::json();
  if (!counter.is_number_unsigned()) {
    return Err(
        fmt::format("{}: not a state of the ground tool; if it is lost, remove it (a new security counter "
                    "starts above the old)",
                    file.string()));
  }
  UplinkState state(file, counter.get<std::uint64_t>());
  const auto counts = json.value("next_sequence_counts", nlohmann::json::object());
  for (const auto& process : counts.items()) {
    if (!process.value().is_number_unsigned() ||
        process.key().find_first_not_of("0123456789") != std::string::npos)
      continue;
    const auto apid = static_cast<std::uint16_t>(std::stoul(process.key().substr(0, 4)));
    state.next_sequence_[apid] =
        static_cast<std::uint16_t>(process.value().get<unsigned>() % sequence_modulus);
  }
  return state;
}

Result<void, std::string> UplinkState::save(std::uint64_t next_counter, const SequenceCounts& next_sequence) {
  nlohmann::json json;
  const std::uint64_t saved = std::max(next_counter, saved_counter_);
  json["next_security_counter"] = saved;
  for (const auto& [process, count] : next_sequence)
    json["next_sequence_counts"][fmt::format("{}", process)] = count;
  const auto written = write_file_atomically(file_, json.dump(2) + "\n");
  if (!written) return Err(written.error().message);
  saved_counter_ = saved;
  return {};
}

Result<UplinkState::Reserved, std::string> UplinkState::reserve(std::uint16_t apid) {
  const Reserved reserved{next_counter_, next_sequence_[apid]};
  auto next = next_sequence_;
  next[apid] = static_cast<std::uint16_t>((reserved.sequence_count + 1) % sequence_modulus);
  if (const auto saved = save(reserved.counter + 1, next); !saved) return Err(saved.error());
  next_counter_ = reserved.counter + 1;
  next_sequence_ = std::move(next);
  return reserved;
}

Result<std::uint16_t, std::string> UplinkState::reserve_sequence_count(std::uint16_t apid) {
  const std::uint16_t count = next_sequence_[apid];
  auto next = next_sequence_;
  next[apid] = static_cast<std::uint16_t>((count + 1) % sequence_modulus);
  if (const auto saved = save(next_counter_, next); !saved) return Err(saved.error());
  next_sequence_ = std::move(next);
  return count;
}

Result<std::uint64_t, std::string> UplinkState::reserve_counter() {
  if (const auto saved = save(next_counter_ + 1, next_sequence_); !saved) return Err(saved.error());
  return next_counter_++;
}

Result<std::uint64_t, std::string> UplinkState::reserve_counter_ahead() {
  if (next_counter_ >= saved_counter_) {
    if (const auto saved = save(next_counter_ + counters_ahead, next_sequence_); !saved)
      return Err(saved.error());
  }
  return next_counter_++;
}

Result<void, std::string> UplinkState::raise(std::uint64_t counter) {
  if (counter < next_counter_ || counter == UINT64_MAX) return {};
  next_counter_ = counter + 1;
  return save(next_counter_, next_sequence_);
}

Result<Uplink, std::string> Uplink::open(const ros::LinkSettings& link, const std::filesystem::path& var_dir,
                                         const std::filesystem::path& state_dir, UtcTime now) {
  if (link.channels.empty())
    return Err(std::string("the deployment has no telecommand channel (link.tc_channels)"));
  const auto secured = std::find_if(link.channels.begin(), link.channels.end(),
                                    [](const auto& c) { return c.security == ros::ChannelSecurity::sdls; });
  const auto& chosen = secured == link.channels.end() ? link.channels.front() : *secured;
  auto state = UplinkState::open(state_dir / "uplink.json", now);
  if (!state) return Err(state.error());
  Uplink uplink({static_cast<std::uint16_t>(link.spacecraft_id),
                 static_cast<std::uint8_t>(chosen.virtual_channel), link.tc_randomizer},
                std::move(*state));
  for (const auto& entry : link.channels) {
    if (entry.security != ros::ChannelSecurity::sdls || entry.virtual_channel != chosen.virtual_channel)
      continue;
    auto key = read_key(var_dir / entry.key_file);
    if (!key) return Err(key.error());
    (uplink.bd_ ? uplink.ad_ : uplink.bd_) =
        Association{std::move(*key), static_cast<std::uint16_t>(entry.spi)};
  }
  return uplink;
}

wire::TcPacket Uplink::packet_of(const mission::EncodedCommand& command, std::uint16_t sequence_count) const {
  return {.apid = command.command->apid,
          .sequence_count = sequence_count,
          .service = command.command->service,
          .subtype = command.command->subtype,
          .application = command.data};
}

Result<OutgoingTelecommand, std::string> Uplink::make(const mission::EncodedCommand& command) {
  const auto reserved = state_.reserve(command.command->apid);
  if (!reserved) return Err(reserved.error());
  const wire::TcPacket packet = packet_of(command, reserved->sequence_count);
  std::optional<wire::SdlsSeal> seal;
  if (bd_) seal.emplace(wire::SdlsSeal{bd_->key, bd_->spi, reserved->counter});
  auto cltu = wire::make_uplink_cltu(channel_, wire::TcFrameType::bd, 0, seal ? &*seal : nullptr,
                                     wire::make_tc_packet(packet));
  if (!cltu) return Err(fmt::format("{}: {}", command.command->name, wire::to_string(cltu.error())));
  ++sent_;
  return OutgoingTelecommand{wire::request_id(packet), bd_ ? std::optional(reserved->counter) : std::nullopt,
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
  std::optional<wire::SdlsSeal> seal;
  if (bd_) {
    const auto counter = state_.reserve_counter();
    if (!counter) return Err(counter.error());
    seal.emplace(wire::SdlsSeal{ad_association().key, ad_association().spi, *counter});
  }
  auto cltu =
      wire::make_uplink_cltu(channel_, wire::TcFrameType::ad, sequence, seal ? &*seal : nullptr, packet);
  if (!cltu) return Err(std::string(wire::to_string(cltu.error())));
  return std::move(*cltu);
}

std::size_t Uplink::packet_octets_max() const {
  return bd_ ? wire::sdls_packet_octets_max : wire::tc_data_octets_max - 1;
}

Result<Octets, std::string> Uplink::make_file_cltu(OctetView packet) {
  std::optional<wire::SdlsSeal> seal;
  if (bd_) {
    const auto counter = state_.reserve_counter_ahead();
    if (!counter) return Err(counter.error());
    seal.emplace(wire::SdlsSeal{bd_->key, bd_->spi, *counter});
  }
  auto cltu = wire::make_uplink_cltu(channel_, wire::TcFrameType::bd, 0, seal ? &*seal : nullptr, packet);
  if (!cltu) return Err(std::string(wire::to_string(cltu.error())));
  return std::move(*cltu);
}

Octets Uplink::make_bc_cltu(wire::ControlCommand command) const {
  return wire::make_control_cltu(channel_, command);
}

void Uplink::on_spacecraft_counter(std::uint16_t spi, std::uint64_t counter) {
  const bool ours = bd_ && (spi == bd_->spi || spi == ad_association().spi);
  // Not on disk is no loss yet: the next telecommand writes it, and the beacon says it again.
  if (ours) (void)state_.raise(counter);
}

}  // namespace srfs::ground
