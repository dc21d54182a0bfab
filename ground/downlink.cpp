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

Downlink::Downlink(const suite::LinkSettings& link, std::optional<FrameVerifier> verifier,
                   UnverifiedFrames unverified)
    : synchroniser_({.frame_octets = static_cast<std::size_t>(link.tm_frame_length),
                     .reed_solomon = link.tm_reed_solomon,
                     .interleave = static_cast<unsigned>(link.tm_interleave),
                     .randomize = link.tm_randomizer}),
      decoder_(static_cast<std::uint16_t>(link.spacecraft_id),
               static_cast<std::size_t>(link.tm_frame_length)),
      authenticated_(link.tm_security.has_value()),
      verifier_(std::move(verifier)),
      unverified_(unverified) {}

std::optional<Authenticity> Downlink::judge(OctetView octets, wire::TmFrame& frame) {
  if (!authenticated_) return Authenticity::not_judged;
  if (verifier_ && verifier_->verify(octets, frame, utc_) == FrameVerdict::verified)
    return Authenticity::verified;
  if (!verifier_) ++keyless_frames_;
  if (unverified_ == UnverifiedFrames::dropped || !wire::tm_sdls_strip(frame)) return std::nullopt;
  return Authenticity::unverified;
}

std::vector<ReceivedPacket> Downlink::push(OctetView octets) {
  octets_ += octets.size();
  std::vector<ReceivedPacket> received;
  for (const auto& cadu : synchroniser_.push(octets)) {
    auto frame = decoder_.read(cadu.frame);
    if (!frame) continue;
    const auto authenticity = judge(cadu.frame, *frame);
    if (!authenticity) continue;
    const bool is_ours = *authenticity != Authenticity::unverified;
    if (is_ours) {
      decoder_.take(*frame);
      take_control_word(frame->ocf);
    }
    if (frame->vc == wire::tm_idle_vc) {
      if (is_ours) ++idle_frames_;
      continue;
    }
    auto& channel = (is_ours ? channels_ : unverified_channels_).at(frame->vc);
    for (const Octets& packet : channel.push(*frame)) take_packet(frame->vc, packet, *authenticity, received);
  }
  return received;
}

void Downlink::take_control_word(std::uint32_t word) {
  clcw_ = word;
  if (control_words_.size() == max_control_words) control_words_.erase(control_words_.begin());
  control_words_.push_back(word);
}

void Downlink::take_packet(std::uint8_t vc, const Octets& packet, Authenticity authenticity,
                           std::vector<ReceivedPacket>& received) {
  const bool is_ours = authenticity != Authenticity::unverified;
  if (vc == tm_channel::files) {
    if (is_ours) take_file_packet(packet);
    return;
  }
  auto telemetry = telemetry_in(packet);
  if (is_ours && telemetry) {
    ++packets_;
    packet_octets_ += packet.size();
  }
  if (is_ours && !telemetry) ++bad_packets_;
  if (telemetry)
    received.push_back(
        {.vc = vc, .packet = std::move(*telemetry), .raw = packet, .authenticity = authenticity});
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
  c.authenticated = authenticated_;
  c.forged_frames = keyless_frames_;
  if (verifier_) {
    const FrameVerifier::Counters& verdicts = verifier_->counters();
    c.bad_frames += verdicts.malformed;
    c.forged_frames += verdicts.forged;
    c.replayed_frames = verdicts.replayed;
    c.old_frames = verdicts.too_old;
  }
  for (const auto& channel : channels_)
    c.bad_packets += channel.counters().bad_packets + channel.counters().cut_packets;
  return c;
}

}  // namespace srfs::ground
