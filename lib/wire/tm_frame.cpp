// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/tm_frame.hpp"

#include <algorithm>
#include <cassert>

#include "wire/crc16.hpp"

namespace srfs::wire {
namespace {

constexpr std::uint8_t idle_octet = 0x55;
constexpr unsigned ocf_flag = 1;
constexpr unsigned segment_length_unsegmented = 0x1800;
constexpr unsigned first_header_mask = 0x07FF;

}  // namespace

std::string_view to_string(TmFrameError error) {
  switch (error) {
    case TmFrameError::wrong_length:
      return "not the frame length of the link";
    case TmFrameError::bad_fecf:
      return "frame error control is wrong";
    case TmFrameError::bad_version:
      return "frame version is not 0";
    case TmFrameError::wrong_spacecraft:
      return "from another spacecraft";
    case TmFrameError::no_ocf:
      return "no operational control field";
    case TmFrameError::bad_data_status:
      return "data field status of another kind of link";
    case TmFrameError::bad_header_pointer:
      return "first header pointer outside the frame";
  }
  return "?";
}

Octets encode_tm_frame(const TmFrame& frame) {
  assert(frame.spacecraft_id <= 0x3FF && frame.vc < tm_vc_count && frame.first_header <= first_header_mask);
  assert(frame.data.size() + tm_frame_overhead_octets >= tm_frame_octets_min);
  assert(frame.data.size() + tm_frame_overhead_octets <= tm_frame_octets_max);
  OctetWriter out(tm_frame_octets_max);
  out.u16(static_cast<std::uint16_t>(static_cast<unsigned>(frame.spacecraft_id) << 4 |
                                     static_cast<unsigned>(frame.vc) << 1 | ocf_flag));
  out.u8(frame.master_count);
  out.u8(frame.vc_count);
  out.u16(static_cast<std::uint16_t>(segment_length_unsegmented | frame.first_header));
  out.bytes(frame.data);
  out.u32(frame.ocf);
  out.u16(crc16(out.view()));
  return out.take();
}

Result<TmFrame, TmFrameError> decode_tm_frame(OctetView octets, std::uint16_t spacecraft_id,
                                              std::size_t frame_octets) {
  using Error = TmFrameError;
  assert(frame_octets >= tm_frame_octets_min && frame_octets <= tm_frame_octets_max);
  if (octets.size() != frame_octets) return Err(Error::wrong_length);
  if (crc16(octets) != 0) return Err(Error::bad_fecf);
  OctetReader in(octets.first(octets.size() - tm_fecf_octets));
  const unsigned identification = in.u16();
  if (identification >> 14 != 0) return Err(Error::bad_version);
  TmFrame frame;
  frame.spacecraft_id = static_cast<std::uint16_t>(identification >> 4 & 0x3FF);
  if (frame.spacecraft_id != spacecraft_id) return Err(Error::wrong_spacecraft);
  if ((identification & ocf_flag) == 0) return Err(Error::no_ocf);
  frame.vc = static_cast<std::uint8_t>(identification >> 1 & 7);
  frame.master_count = in.u8();
  frame.vc_count = in.u8();
  const unsigned status = in.u16();
  if ((status & ~first_header_mask) != segment_length_unsegmented) return Err(Error::bad_data_status);
  frame.first_header = static_cast<std::uint16_t>(status & first_header_mask);
  const OctetView data = in.bytes(in.remaining() - tm_ocf_octets);
  if (frame.first_header < only_idle_data && frame.first_header >= data.size()) {
    return Err(Error::bad_header_pointer);
  }
  frame.data.assign(data.begin(), data.end());
  frame.ocf = in.u32();
  return frame;
}

TmFrameBuilder::TmFrameBuilder(Config config, std::optional<TmSeal> seal)
    : config_(config),
      seal_(std::move(seal)),
      field_octets_(config.frame_octets - tm_frame_overhead_octets - (seal_ ? tm_sdls_overhead_octets : 0)) {
  assert(!seal_ || config.frame_octets >= tm_frame_octets_min + tm_sdls_overhead_octets);
  assert(config.frame_octets >= tm_frame_octets_min && config.frame_octets <= tm_frame_octets_max);
  master_count_ = config.first.master;
  for (std::size_t vc = 0; vc < channels_.size(); ++vc) channels_[vc].frame_count = config.first.vc[vc];
}

TmFrameCounts TmFrameBuilder::counts() const {
  TmFrameCounts counts{.master = master_count_};
  for (std::size_t vc = 0; vc < channels_.size(); ++vc) counts.vc[vc] = channels_[vc].frame_count;
  return counts;
}

bool TmFrameBuilder::queue_packet(std::uint8_t vc, Octets packet) {
  assert(vc < tm_idle_vc && decode_space_packet(packet).has_value());
  Channel& channel = channels_[vc];
  if (packet.size() > free_octets(vc)) {
    ++channel.counters.refused_packets;
    return false;
  }
  channel.queued_octets += packet.size();
  channel.packets.push_back(std::move(packet));
  return true;
}

std::size_t TmFrameBuilder::queued_octets(std::uint8_t vc) const {
  return channels_[vc].queued_octets;
}

std::size_t TmFrameBuilder::free_octets(std::uint8_t vc) const {
  return config_.queue_octets_max - channels_[vc].queued_octets;
}

void TmFrameBuilder::start_packet(Channel& channel, std::size_t room) const {
  channel.carried = 0;
  channel.current_is_idle = channel.packets.empty();
  if (channel.current_is_idle) {
    // Less room than an idle packet needs: it goes on in the next frame.
    channel.current = make_idle_packet(std::max(room, idle_packet_octets_min), idle_octet);
    ++channel.counters.idle_packets;
    return;
  }
  channel.current = std::move(channel.packets.front());
  channel.packets.pop_front();
  ++channel.counters.packets;
}

Octets TmFrameBuilder::build(std::uint8_t vc, std::uint32_t ocf, std::uint64_t number) {
  assert(vc < tm_idle_vc);
  Channel& channel = channels_[vc];
  TmFrame frame{.vc = vc, .ocf = ocf, .data = {}};
  frame.data.reserve(field_octets_);
  while (frame.data.size() < field_octets_) {
    const std::size_t room = field_octets_ - frame.data.size();
    if (channel.carried == channel.current.size()) {
      if (frame.first_header == no_packet_starts) {
        frame.first_header = static_cast<std::uint16_t>(frame.data.size());
      }
      start_packet(channel, room);
    }
    const OctetView rest = OctetView(channel.current).subspan(channel.carried);
    const OctetView piece = rest.first(std::min(rest.size(), room));
    frame.data.insert(frame.data.end(), piece.begin(), piece.end());
    channel.carried += piece.size();
    if (!channel.current_is_idle) channel.queued_octets -= piece.size();
  }
  return finish(channel, std::move(frame), number);
}

Octets TmFrameBuilder::build_idle(std::uint32_t ocf, std::uint64_t number) {
  TmFrame frame{.vc = tm_idle_vc, .first_header = only_idle_data, .ocf = ocf, .data = {}};
  frame.data.assign(field_octets_, idle_octet);
  return finish(channels_[tm_idle_vc], std::move(frame), number);
}

Octets TmFrameBuilder::finish(Channel& channel, TmFrame frame, std::uint64_t number) {
  frame.spacecraft_id = config_.spacecraft_id;
  frame.master_count = master_count_++;
  frame.vc_count = channel.frame_count++;
  ++channel.counters.frames;
  return seal_ ? encode_tm_frame(frame, *seal_, number) : encode_tm_frame(frame);
}

Result<TmFrame, TmFrameError> TmFrameDecoder::read(OctetView octets) {
  auto frame = decode_tm_frame(octets, spacecraft_id_, frame_octets_);
  if (!frame) ++counters_.refused[static_cast<std::size_t>(frame.error())];
  return frame;
}

void TmFrameDecoder::take(const TmFrame& frame) {
  ++counters_.frames;
  if (last_master_count_) {
    counters_.lost += static_cast<std::uint8_t>(frame.master_count - *last_master_count_ - 1);
  }
  last_master_count_ = frame.master_count;
}

Result<TmFrame, TmFrameError> TmFrameDecoder::decode(OctetView octets) {
  auto frame = read(octets);
  if (frame) take(*frame);
  return frame;
}

std::vector<Octets> TmPacketReassembly::push(const TmFrame& frame) {
  std::vector<Octets> packets;
  ++counters_.frames;
  if (last_count_) {
    const auto lost = static_cast<std::uint8_t>(frame.vc_count - *last_count_ - 1);
    counters_.lost_frames += lost;
    if (lost != 0) lose_synchronisation();
  }
  last_count_ = frame.vc_count;
  if (frame.first_header == only_idle_data) {
    ++counters_.idle_frames;
    return packets;
  }

  const OctetView data(frame.data);
  if (frame.first_header == no_packet_starts) {
    if (synchronised_ && !consume(data, NewPackets::forbidden, packets)) {
      ++counters_.header_mismatches;
      lose_synchronisation();
    }
    return packets;
  }
  const std::size_t first_header = std::min<std::size_t>(frame.first_header, data.size());
  if (synchronised_) {
    const bool agrees = consume(data.first(first_header), NewPackets::forbidden, packets) && partial_.empty();
    if (!agrees) {
      ++counters_.header_mismatches;
      lose_synchronisation();
    }
  }
  synchronised_ = true;
  if (!consume(data.subspan(first_header), NewPackets::allowed, packets)) lose_synchronisation();
  return packets;
}

/// @return false if the octets cannot be the packets they should be
bool TmPacketReassembly::consume(OctetView data, NewPackets rule, std::vector<Octets>& packets) {
  while (!data.empty()) {
    if (partial_.empty() && rule == NewPackets::forbidden) return false;
    const bool has_header = partial_.size() >= packet_header_octets;
    const std::size_t wanted =
        (has_header ? packet_octets(partial_) : packet_header_octets) - partial_.size();
    const OctetView piece = data.first(std::min(wanted, data.size()));
    partial_.insert(partial_.end(), piece.begin(), piece.end());
    data = data.subspan(piece.size());
    if (partial_.size() < packet_header_octets) continue;
    if (!has_header && (partial_[0] >> 5 != 0 || packet_octets(partial_) > longest_packet_)) {
      ++counters_.bad_packets;
      return false;
    }
    if (partial_.size() == packet_octets(partial_)) finish_packet(packets);
  }
  return true;
}

void TmPacketReassembly::finish_packet(std::vector<Octets>& packets) {
  const unsigned apid = (static_cast<unsigned>(partial_[0]) << 8 | partial_[1]) & idle_apid;
  if (apid == idle_apid) {
    ++counters_.idle_packets;
    partial_.clear();
    return;
  }
  ++counters_.packets;
  packets.push_back(std::move(partial_));
  partial_ = {};
}

void TmPacketReassembly::lose_synchronisation() {
  if (!partial_.empty()) ++counters_.cut_packets;
  partial_.clear();
  synchronised_ = false;
}

}  // namespace srfs::wire
