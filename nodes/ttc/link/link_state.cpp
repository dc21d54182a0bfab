// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/link/link_state.hpp"

#include <algorithm>
#include <cassert>

#include "base/crc32c.hpp"

namespace srfs {
namespace {

constexpr std::uint32_t link_state_magic = 0x5352'4C53;  // "SRLS"
constexpr std::uint16_t link_state_version = 2;
constexpr std::uint16_t version_without_telecommand_id = 1;

}  // namespace

std::uint64_t clock_counter(UtcTime now) {
  const auto counted = std::chrono::duration_cast<milliseconds>(now.since_epoch());
  return static_cast<std::uint64_t>(std::max<milliseconds::rep>(counted.count(), 0));
}

std::uint64_t lost_counter_floor(UtcTime now) {
  return clock_counter(now - lost_counter_tolerance);
}

void write_link_state(OctetWriter& writer, const LinkState& state) {
  assert(state.channels.size() <= max_link_channels && state.associations.size() <= max_link_associations);
  writer.u64(state.generation);
  writer.u64(state.next_telecommand_id);
  writer.u8(static_cast<std::uint8_t>(state.channels.size()));
  for (const LinkState::Channel& channel : state.channels) {
    writer.u8(channel.vc);
    writer.u8(static_cast<std::uint8_t>(channel.farm.mode));
    writer.u8(channel.farm.vr);
    writer.u8(channel.farm.lockout ? 1 : 0);
    writer.u8(channel.farm.wait ? 1 : 0);
    writer.u8(channel.farm.retransmit ? 1 : 0);
    writer.u8(channel.farm.farm_b_counter);
  }
  writer.u8(static_cast<std::uint8_t>(state.associations.size()));
  for (const LinkState::Association& association : state.associations) {
    writer.u16(association.spi);
    writer.u64(association.counter);
  }
}

std::optional<LinkState> read_link_state(OctetReader& reader, bool with_telecommand_id) {
  LinkState state;
  state.generation = reader.u64();
  if (with_telecommand_id) state.next_telecommand_id = reader.u64();
  const std::size_t channels = reader.u8();
  if (channels > max_link_channels) return std::nullopt;
  for (std::size_t i = 0; i < channels; ++i) {
    LinkState::Channel channel;
    channel.vc = reader.u8();
    const std::uint8_t mode = reader.u8();
    if (mode > static_cast<std::uint8_t>(wire::FarmMode::lockout)) return std::nullopt;
    channel.farm.mode = static_cast<wire::FarmMode>(mode);
    channel.farm.vr = reader.u8();
    channel.farm.lockout = reader.u8() != 0;
    channel.farm.wait = reader.u8() != 0;
    channel.farm.retransmit = reader.u8() != 0;
    channel.farm.farm_b_counter = reader.u8();
    state.channels.push_back(channel);
  }
  const std::size_t associations = reader.u8();
  if (associations > max_link_associations) return std::nullopt;
  for (std::size_t i = 0; i < associations; ++i) {
    LinkState::Association association;
    association.spi = reader.u16();
    association.counter = reader.u64();
    state.associations.push_back(association);
  }
  if (!reader.ok()) return std::nullopt;
  return state;
}

Octets encode_link_state(const LinkState& state) {
  OctetWriter writer(link_state_octets);
  writer.u32(link_state_magic);
  writer.u16(link_state_version);
  write_link_state(writer, state);
  while (writer.size() < link_state_octets - 4) writer.u8(0);
  writer.u32(crc32c(writer.view()));
  assert(writer.ok());
  return writer.take();
}

std::optional<LinkState> decode_link_state(OctetView octets) {
  if (octets.size() != link_state_octets) return std::nullopt;
  OctetReader check(octets.last(4));
  if (check.u32() != crc32c(octets.first(link_state_octets - 4))) return std::nullopt;
  OctetReader reader(octets);
  if (reader.u32() != link_state_magic) return std::nullopt;
  const std::uint16_t version = reader.u16();
  if (version != link_state_version && version != version_without_telecommand_id) return std::nullopt;
  return read_link_state(reader, version != version_without_telecommand_id);
}

}  // namespace srfs
