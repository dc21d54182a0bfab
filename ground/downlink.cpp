// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/downlink.hpp"

#include <numeric>

#include "cfdp/transfer_folders.hpp"
#include "wire/time_packet.hpp"

namespace srfs::ground {
namespace {

/// The time packet has no secondary header; what it is stands in its APID.
wire::TmPacket as_report(const wire::TimePacket& time) {
  return {.apid = wire::time_apid,
          .sequence_count = time.sequence_count,
          .service = 9,
          .subtype = 2,
          .time = time.time,
          .source = {time.rate}};
}

}  // namespace

std::optional<wire::TmPacket> telemetry_in(OctetView packet) {
  if (const auto time = wire::parse_time_packet(packet)) return as_report(*time);
  auto telemetry = wire::parse_tm_packet(packet);
  return telemetry ? std::optional(std::move(*telemetry)) : std::nullopt;
}

Downlink::Downlink(const suite::LinkSettings& link)
    : synchroniser_({.frame_octets = static_cast<std::size_t>(link.tm_frame_length),
                     .reed_solomon = link.tm_reed_solomon,
                     .interleave = static_cast<unsigned>(link.tm_interleave),
                     .randomize = link.tm_randomizer}),
      decoder_(static_cast<std::uint16_t>(link.spacecraft_id),
               static_cast<std::size_t>(link.tm_frame_length)) {}

std::vector<ReceivedPacket> Downlink::push(OctetView octets) {
  octets_ += octets.size();
  std::vector<ReceivedPacket> received;
  for (const auto& cadu : synchroniser_.push(octets)) {
    const auto frame = decoder_.decode(cadu.frame);
    if (!frame) continue;
    clcw_ = frame->ocf;
    if (control_words_.size() == max_control_words) control_words_.erase(control_words_.begin());
    control_words_.push_back(frame->ocf);
    if (frame->vc == wire::tm_idle_vc) {
      ++idle_frames_;
      continue;
    }
    for (const Octets& packet : channels_.at(frame->vc).push(*frame)) {
      if (frame->vc == tm_channel::files) {
        take_file_packet(packet);
        continue;
      }
      auto telemetry = telemetry_in(packet);
      if (!telemetry) {
        ++bad_packets_;
        continue;
      }
      ++packets_;
      packet_octets_ += packet.size();
      received.push_back({frame->vc, std::move(*telemetry), packet});
    }
  }
  return received;
}

void Downlink::take_file_packet(OctetView packet) {
  const auto pdu = cfdp::pdu_in_packet(packet);
  if (!pdu) {
    ++bad_packets_;
    return;
  }
  ++packets_;
  packet_octets_ += packet.size();
  if (file_pdus_.size() == max_file_pdus) file_pdus_.erase(file_pdus_.begin());
  file_pdus_.emplace_back(pdu->begin(), pdu->end());
}

DownlinkCounters Downlink::counters() const {
  const auto& cadu = synchroniser_.counters();
  const auto& frames = decoder_.counters();
  DownlinkCounters c;
  c.octets = octets_;
  c.frames = frames.frames;
  c.idle_frames = idle_frames_;
  c.bad_frames =
      cadu.rejected + std::accumulate(frames.refused.begin(), frames.refused.end(), std::uint64_t{0});
  c.lost_frames = frames.lost;
  c.corrected_octets = cadu.corrected_octets;
  c.noise_octets = cadu.noise_octets;
  c.packets = packets_;
  c.packet_octets = packet_octets_;
  c.bad_packets = bad_packets_;
  for (const auto& channel : channels_)
    c.bad_packets += channel.counters().bad_packets + channel.counters().cut_packets;
  return c;
}

}  // namespace srfs::ground
