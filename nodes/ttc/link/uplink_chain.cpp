// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/link/uplink_chain.hpp"

#include <algorithm>
#include <cassert>

namespace srfs {

UplinkChain::UplinkChain(UplinkConfig config, const LinkState& stored)
    : config_(std::move(config)), decoder_(config_.cltu) {
  state_.generation = stored.generation;
  for (const UplinkChannel& channel : config_.channels) {
    const auto known = std::find_if(stored.channels.begin(), stored.channels.end(),
                                    [&](const LinkState::Channel& c) { return c.vc == channel.vc; });
    state_.channels.push_back(LinkState::Channel{
        .vc = channel.vc, .farm = known != stored.channels.end() ? known->farm : wire::FarmState{}});
    for (const UplinkAssociation& association : channel.associations) {
      const auto counter =
          std::find_if(stored.associations.begin(), stored.associations.end(),
                       [&](const LinkState::Association& a) { return a.spi == association.spi; });
      if (counter != stored.associations.end()) state_.associations.push_back(*counter);
    }
  }
  carry_along(stored);
  stored_ = state_;
  // Nothing else would end a wait that was on when the process ended.
  set_buffer_available(true);
}

void UplinkChain::carry_along(const LinkState& stored) {
  std::size_t associations = 0;  // those that have accepted nothing yet need their place too
  const auto configured = [&](std::uint16_t spi) {
    return std::any_of(config_.channels.begin(), config_.channels.end(), [&](const UplinkChannel& c) {
      return std::any_of(c.associations.begin(), c.associations.end(),
                         [&](const UplinkAssociation& a) { return a.spi == spi; });
    });
  };
  for (const UplinkChannel& channel : config_.channels) associations += channel.associations.size();
  for (const LinkState::Channel& channel : stored.channels) {
    if (channel_of(channel.vc) == nullptr && state_.channels.size() < max_link_channels)
      state_.channels.push_back(channel);
  }
  for (const LinkState::Association& association : stored.associations) {
    if (configured(association.spi) || associations >= max_link_associations) continue;
    state_.associations.push_back(association);
    ++associations;
  }
}

std::optional<std::pair<std::uint16_t, std::uint16_t>> associations_with_one_key(const UplinkConfig& config) {
  std::vector<const UplinkAssociation*> seen;
  for (const UplinkChannel& channel : config.channels) {
    for (const UplinkAssociation& association : channel.associations) {
      for (const UplinkAssociation* other : seen) {
        if (other->key.octets() == association.key.octets()) return std::pair(other->spi, association.spi);
      }
      seen.push_back(&association);
    }
  }
  return std::nullopt;
}

bool is_key_of(const UplinkConfig& config, const wire::SdlsKey& key) {
  return std::any_of(config.channels.begin(), config.channels.end(), [&](const UplinkChannel& channel) {
    return std::any_of(channel.associations.begin(), channel.associations.end(),
                       [&](const UplinkAssociation& a) { return a.key.octets() == key.octets(); });
  });
}

void use_session_keys(UplinkConfig& config, const wire::SessionKeys& keys) {
  const auto use = [&keys](UplinkAssociation& association) {
    const auto used = keys.use_of(association.spi);
    if (!used || !association.set) return;
    association.key_lost = used->current == wire::SessionKeys::lost_id;
    if (const auto* current = keys.find(used->current); current != nullptr)
      association.key = current->octets.key();
    if (const auto* next = used->next ? keys.find(*used->next) : nullptr; next != nullptr)
      association.next = UplinkAssociation::NextKey{.id = next->id, .key = next->octets.key()};
  };
  for (UplinkChannel& channel : config.channels) {
    for (UplinkAssociation& association : channel.associations) use(association);
  }
}

std::vector<std::uint16_t> rekeyable_associations(const UplinkConfig& config) {
  std::vector<std::uint16_t> spis;
  for (const UplinkChannel& channel : config.channels) {
    for (const UplinkAssociation& association : channel.associations) {
      if (association.set) spis.push_back(association.spi);
    }
  }
  return spis;
}

std::vector<UplinkedPacket> UplinkChain::push(OctetView octets, MonotonicTime now) {
  now_ = now;
  counters_.octets += octets.size();
  return on_frames(decoder_.push(octets, now));
}

std::vector<UplinkedPacket> UplinkChain::on_idle(MonotonicTime now) {
  now_ = now;
  return on_frames(decoder_.on_idle(now));
}

std::optional<MonotonicTime> UplinkChain::idle_deadline() const {
  if (!decoder_.in_cltu()) return std::nullopt;
  return decoder_.silence_deadline();
}

std::vector<UplinkedPacket> UplinkChain::on_frames(const std::vector<Octets>& frames) {
  std::vector<UplinkedPacket> packets;
  for (const Octets& frame : frames) {
    if (auto packet = on_frame(frame)) packets.push_back(std::move(*packet));
  }
  return packets;
}

std::optional<UplinkedPacket> UplinkChain::on_frame(OctetView octets) {
  const auto frame = wire::decode_tc_frame(octets, config_.spacecraft_id);
  if (!frame) {
    ++(frame.error() == wire::TcFrameError::wrong_spacecraft ? counters_.wrong_scid : counters_.wrong_header);
    return std::nullopt;
  }
  const UplinkChannel* channel = channel_of(frame->vc);
  if (channel == nullptr) {
    ++counters_.wrong_vc;
    return std::nullopt;
  }
  if (frame->type == wire::TcFrameType::bc) {
    on_control_frame(*channel, *frame);
    return std::nullopt;
  }
  return on_data_frame(*channel, *frame);
}

std::optional<UplinkedPacket> UplinkChain::on_data_frame(const UplinkChannel& channel,
                                                         const wire::TcFrame& frame) {
  UplinkedPacket packet{.frame = {.vc = channel.vc, .type = frame.type, .sequence = frame.sequence},
                        .packet = {}};
  std::optional<Opened> opened;
  if (!channel.associations.empty()) {
    opened = open_secured(channel, frame);
    if (!opened) return std::nullopt;
    packet.frame.spi = opened->spi;
    packet.frame.counter = opened->counter;
  }

  const wire::FarmOutcome outcome =
      wire::farm_receive(farm(channel.vc), frame, buffer_available_, config_.farm_window);
  set_farm(channel.vc, outcome.state);
  if (outcome.verdict != wire::FarmVerdict::accept_sequenced &&
      outcome.verdict != wire::FarmVerdict::accept_expedited) {
    acknowledge_flags();
    ++counters_.farm_discarded;
    if (opened) {
      packet.packet = std::move(opened->packet);
    } else if (const auto payload = wire::segment_payload(frame.data)) {
      packet.packet.assign(payload->begin(), payload->end());
    }
    keep_refused(std::move(packet));
    return std::nullopt;
  }
  ++state_.generation;
  flags_changed_ = false;
  if (opened) {
    on_accepted(*opened);
    if (opened->segment_header != wire::segment_header_unsegmented || opened->packet.empty()) {
      ++counters_.bad_segment;
      return std::nullopt;
    }
    packet.packet = std::move(opened->packet);
  } else {
    const auto payload = wire::segment_payload(frame.data);
    if (!payload) {
      ++counters_.bad_segment;
      return std::nullopt;
    }
    packet.packet.assign(payload->begin(), payload->end());
  }
  ++counters_.packets;
  packet.link = state_;
  return packet;
}

std::optional<UplinkChain::Opened> UplinkChain::open_with_keys_of(const UplinkAssociation& association,
                                                                  const wire::SdlsHeader& header,
                                                                  OctetView data) {
  if (!association.key_lost) {
    if (auto opened = wire::sdls_open(association.key, association.spi, header, data))
      return Opened{std::move(*opened), false};
  }
  if (!association.next) return std::nullopt;
  auto opened = wire::sdls_open(association.next->key, association.spi, header, data);
  if (!opened) return std::nullopt;
  return Opened{std::move(*opened), true};
}

std::optional<UplinkChain::Opened> UplinkChain::open_secured(const UplinkChannel& channel,
                                                             const wire::TcFrame& frame) {
  const auto refuse = [this] {
    ++counters_.not_authentic;
    return std::nullopt;
  };
  const auto spi = wire::sdls_claimed_spi(frame.data);
  const auto association =
      std::find_if(channel.associations.begin(), channel.associations.end(), [&](const UplinkAssociation& a) {
        const bool in_use = !a.set || a.set == channel.selected;
        return in_use && spi == a.spi && (frame.type == wire::TcFrameType::ad ? a.for_ad : a.for_bd);
      });
  if (association == channel.associations.end()) return refuse();
  const wire::SdlsHeader header =
      is_strict(channel) ? wire::SdlsHeader(wire::encode_tc_header(frame.type, frame.spacecraft_id, frame.vc,
                                                                   frame.sequence, frame.data.size()))
                         : wire::SdlsHeader(channel.vc);
  auto opened = open_with_keys_of(*association, header, frame.data);
  if (!opened) return refuse();
  const bool fresh = wire::is_fresh(last_counter(channel, *association), opened->counter);
  const bool out_of_range = is_strict(channel) ? opened->counter > max_strict_counter : opened->sender != 0;
  const auto oldest = is_strict(channel) ? age_.oldest(now_) : std::nullopt;
  const bool too_old = oldest && opened->counter < *oldest;
  if (fresh && !out_of_range && !too_old) return std::move(*opened);
  counters_.refused_counter = opened->counter;
  ++(out_of_range ? counters_.counter_out_of_range : !fresh ? counters_.replayed : counters_.too_old);
  if (!out_of_range && !fresh && frame.type != wire::TcFrameType::bc) {
    keep_refused({.frame = {.vc = channel.vc,
                            .type = frame.type,
                            .spi = opened->spi,
                            .counter = opened->counter,
                            .sequence = frame.sequence},
                  .packet = std::move(opened->packet)});
  }
  return std::nullopt;
}

std::optional<std::uint64_t> UplinkChain::last_counter(const UplinkChannel& channel,
                                                       const UplinkAssociation& association) const {
  if (!is_strict(channel)) return counter(association.spi);
  std::optional<std::uint64_t> highest;
  for (const UplinkAssociation& each : channel.associations) {
    const auto last = counter(each.spi);
    // A higher one is of a time when the link was not strict; no frame of then is authentic now.
    if (last && *last <= max_strict_counter) highest = std::max(highest, last);
  }
  return highest;
}

void UplinkChain::on_control_frame(const UplinkChannel& channel, const wire::TcFrame& frame) {
  if (is_strict(channel)) return on_secured_control_frame(channel, frame);
  const wire::FarmOutcome outcome =
      wire::farm_receive(farm(channel.vc), frame, buffer_available_, config_.farm_window);
  set_farm(channel.vc, outcome.state);
  acknowledge_flags();
  count_control(outcome.verdict);
}

void UplinkChain::on_secured_control_frame(const UplinkChannel& channel, const wire::TcFrame& frame) {
  auto opened = open_secured(channel, frame);
  if (!opened) return;
  wire::TcFrame command = frame;
  command.data = std::move(opened->packet);
  const wire::FarmOutcome outcome =
      wire::farm_receive(farm(channel.vc), command, buffer_available_, config_.farm_window);
  set_farm(channel.vc, outcome.state);
  ++state_.generation;
  flags_changed_ = false;
  on_accepted(*opened);
  count_control(outcome.verdict);
}

void UplinkChain::on_accepted(const Opened& opened) {
  set_counter(opened.spi, opened.counter);
  age_.on_accepted(opened.counter, now_);
  UplinkAssociation* const association = find(opened.spi);
  if (!opened.with_next || association == nullptr || !association->next) return;
  std::erase_if(confirmed_, [&](const KeyConfirmed& before) { return before.spi == opened.spi; });
  confirmed_.push_back({.spi = opened.spi, .key = association->next->id});
  association->key = std::move(association->next->key);
  association->key_lost = false;
  association->next.reset();
}

void UplinkChain::count_control(wire::FarmVerdict verdict) {
  ++(verdict == wire::FarmVerdict::control_executed ? counters_.control_commands
                                                    : counters_.bad_control_command);
}

bool UplinkChain::authenticates() const {
  return std::any_of(config_.channels.begin(), config_.channels.end(),
                     [](const UplinkChannel& channel) { return !channel.associations.empty(); });
}

bool UplinkChain::select(std::uint8_t vc, KeySet set) {
  for (UplinkChannel& channel : config_.channels) {
    if (channel.vc != vc) continue;
    const bool has_it = std::any_of(channel.associations.begin(), channel.associations.end(),
                                    [set](const UplinkAssociation& a) { return a.set == set; });
    if (has_it) channel.selected = set;
    return has_it;
  }
  return false;
}

UplinkAssociation* UplinkChain::find(std::uint16_t spi) {
  for (UplinkChannel& channel : config_.channels) {
    for (UplinkAssociation& association : channel.associations) {
      if (association.spi == spi) return &association;
    }
  }
  return nullptr;
}

bool UplinkChain::has_association(std::uint16_t spi) const {
  return std::any_of(config_.channels.begin(), config_.channels.end(), [spi](const UplinkChannel& channel) {
    return std::any_of(channel.associations.begin(), channel.associations.end(),
                       [spi](const UplinkAssociation& a) { return a.spi == spi; });
  });
}

bool UplinkChain::set_next_key(std::uint16_t spi, std::optional<UplinkAssociation::NextKey> next) {
  UplinkAssociation* const association = find(spi);
  if (association == nullptr) return false;
  association->next = std::move(next);
  return true;
}

bool UplinkChain::has_key(OctetView key) const {
  const auto same = [key](const wire::SdlsKey& other) {
    return std::equal(key.begin(), key.end(), other.octets().begin(), other.octets().end());
  };
  return std::any_of(config_.channels.begin(), config_.channels.end(), [&](const UplinkChannel& channel) {
    return std::any_of(
        channel.associations.begin(), channel.associations.end(),
        [&](const UplinkAssociation& a) { return same(a.key) || (a.next && same(a.next->key)); });
  });
}

UplinkChain::Associations UplinkChain::associations() const {
  Associations used;
  for (const UplinkChannel& channel : config_.channels) {
    if (channel.associations.empty()) continue;
    for (const UplinkAssociation& a : channel.associations) {
      if (!a.set) used.contingency = a.spi;
      if (a.set != channel.selected) continue;
      if (a.for_bd) used.bd = a.spi;
      if (a.for_ad) used.ad = a.spi;
    }
    break;
  }
  return used;
}

const UplinkChannel* UplinkChain::channel_of(std::uint8_t vc) const {
  const auto found = std::find_if(config_.channels.begin(), config_.channels.end(),
                                  [&](const UplinkChannel& channel) { return channel.vc == vc; });
  return found == config_.channels.end() ? nullptr : &*found;
}

LinkState::Channel& UplinkChain::channel_state(std::uint8_t vc) {
  const auto found = std::find_if(state_.channels.begin(), state_.channels.end(),
                                  [&](const LinkState::Channel& channel) { return channel.vc == vc; });
  assert(found != state_.channels.end());
  return *found;
}

const wire::FarmState& UplinkChain::farm(std::uint8_t vc) const {
  return const_cast<UplinkChain*>(this)
      ->channel_state(vc)
      .farm;  // NOLINT(cppcoreguidelines-pro-type-const-cast)
}

std::optional<std::uint64_t> UplinkChain::counter(std::uint16_t spi) const {
  for (const LinkState::Association& association : state_.associations) {
    if (association.spi == spi) return association.counter;
  }
  return std::nullopt;
}

std::optional<std::uint64_t> UplinkChain::newest_counter(std::uint16_t spi) const {
  for (const UplinkChannel& channel : config_.channels) {
    for (const UplinkAssociation& association : channel.associations) {
      if (association.spi == spi) return last_counter(channel, association);
    }
  }
  return std::nullopt;
}

void UplinkChain::set_farm(std::uint8_t vc, const wire::FarmState& farm) {
  LinkState::Channel& channel = channel_state(vc);
  if (channel.farm == farm) return;
  channel.farm = farm;
  flags_changed_ = true;
}

void UplinkChain::keep_flags() {
  if (!std::exchange(flags_changed_, false)) return;
  ++state_.generation;
}

void UplinkChain::acknowledge_flags() {
  if (stored_.generation >= state_.generation) stored_ = state_;
}

bool UplinkChain::on_stored(const LinkState& stored) {
  if (stored.generation <= stored_.generation) return false;
  stored_ = stored.generation >= state_.generation ? state_ : stored;
  return true;
}

void UplinkChain::set_counter(std::uint16_t spi, std::uint64_t counter) {
  for (LinkState::Association& association : state_.associations) {
    if (association.spi == spi) {
      association.counter = counter;
      return;
    }
  }
  state_.associations.push_back(LinkState::Association{.spi = spi, .counter = counter});
}

void UplinkChain::raise_counters(std::uint64_t floor) {
  for (const UplinkChannel& channel : config_.channels) {
    for (const UplinkAssociation& association : channel.associations)
      set_counter(association.spi, std::max(floor, counter(association.spi).value_or(0)));
  }
  ++state_.generation;
}

void UplinkChain::raise_counter(std::uint16_t spi, std::uint64_t floor) {
  set_counter(spi, std::max(floor, counter(spi).value_or(0)));
  ++state_.generation;
}

void UplinkChain::set_buffer_available(bool available) {
  const bool released = available && !buffer_available_;
  buffer_available_ = available;
  for (std::size_t i = 0; i < config_.channels.size(); ++i) {
    const LinkState::Channel& channel = state_.channels[i];
    if (available && (released || channel.farm.wait)) {
      set_farm(channel.vc, wire::farm_step(channel.farm, wire::FarmEvent::e10_buffer_released).state);
    }
  }
  acknowledge_flags();
}

std::uint32_t UplinkChain::next_clcw() {
  if (config_.channels.empty()) return 0;
  const std::size_t turn = clcw_turn_++ % config_.channels.size();
  wire::FarmState said = stored_.channels[turn].farm;
  if (state_.channels[turn].farm.wait) said.wait = said.retransmit = true;
  return wire::encode_clcw(wire::make_clcw(said, state_.channels[turn].vc));
}

void UplinkChain::keep_refused(UplinkedPacket packet) {
  if (refused_.size() == max_refused) refused_.erase(refused_.begin());
  refused_.push_back(std::move(packet));
}

}  // namespace srfs
