// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "base/time.hpp"
#include "cfdp/transfer_folders.hpp"
#include "suite/deployment.hpp"
#include "tests/temporary_folder.hpp"
#include "wire/cadu.hpp"
#include "wire/cfdp_pdu.hpp"
#include "wire/cltu.hpp"
#include "wire/farm1.hpp"
#include "wire/pus.hpp"
#include "wire/sdls.hpp"
#include "wire/space_packet.hpp"
#include "wire/tc_frame.hpp"
#include "wire/tm_frame.hpp"

namespace srfs::ground {

inline constexpr std::string_view test_key =
    "000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f";

inline constexpr std::string_view ad_test_key =
    "202122232425262728292a2b2c2d2e2f303132333435363738393a3b3c3d3e3f";

inline suite::LinkSettings secured_link() {
  suite::LinkSettings link;
  link.channels.push_back({0, suite::ChannelSecurity::sdls, 1, "keys/tc_uplink.key"});
  return link;
}

/// As `sim` has it: a second association, for AD frames, and strict.
inline suite::LinkSettings strict_link() {
  suite::LinkSettings link = secured_link();
  link.channels.push_back({0, suite::ChannelSecurity::sdls, 2, "keys/tc_uplink_ad.key"});
  link.tc_strict = true;
  return link;
}

inline constexpr std::string_view tm_test_key =
    "404142434445464748494a4b4c4d4e4f505152535455565758595a5b5c5d5e5f";

/// As `sim` has it: strict, and the frames of telemetry are sealed.
inline suite::LinkSettings sealed_link() {
  suite::LinkSettings link = strict_link();
  link.tm_security = suite::TelemetrySecurity{.spi = 16, .key_file = "keys/tm_downlink.key"};
  return link;
}

/// The spacecraft's end of the link, as seen from the ground: decodes telecommands and frames telemetry.
/// Input and output are octets.
class FakeSpacecraft {
 public:
  explicit FakeSpacecraft(const suite::LinkSettings& link)
      : link_(link),
        key_(*wire::SdlsKey::from_hex(test_key)),
        ad_key_(*wire::SdlsKey::from_hex(ad_test_key)),
        cltus_({.randomized = link.tc_randomizer}),
        frames_({.spacecraft_id = static_cast<std::uint16_t>(link.spacecraft_id),
                 .frame_octets = static_cast<std::size_t>(link.tm_frame_length)},
                seal_of(link)) {}

  /// Returns the telecommands in the uplink octets and appends file PDUs to `pdus`. Only fresh, authentic
  /// telecommands that FARM-1 accepts count.
  std::vector<wire::TcPacket> receive(OctetView octets) {
    std::vector<wire::TcPacket> packets;
    if (deaf) return packets;
    for (const auto& frame : cltus_.push(octets, MonotonicTime{})) {
      const auto decoded = wire::decode_tc_frame(frame, static_cast<std::uint16_t>(link_.spacecraft_id));
      if (!decoded) continue;
      if (decoded->type == wire::TcFrameType::ad && lose_ad_frames > 0) {
        --lose_ad_frames;
        continue;
      }
      const wire::SdlsHeader header =
          link_.tc_strict
              ? wire::SdlsHeader(wire::encode_tc_header(decoded->type, decoded->spacecraft_id, decoded->vc,
                                                        decoded->sequence, decoded->data.size()))
              : wire::SdlsHeader(decoded->vc);
      if (decoded->type == wire::TcFrameType::bc) {
        wire::TcFrame command = *decoded;
        if (link_.tc_strict) {
          auto opened = wire::sdls_open(key_, 1, header, decoded->data);
          if (!opened || !wire::is_fresh(std::max(last_counter, last_ad_counter), opened->counter)) continue;
          last_counter = opened->counter;
          command.data = std::move(opened->packet);
        }
        farm = wire::farm_receive(farm, command, true).state;
        continue;
      }
      const bool second = wire::sdls_claimed_spi(decoded->data) == 2;  // the association for AD frames
      if (second && decoded->type != wire::TcFrameType::ad) continue;
      auto& counter = second ? last_ad_counter : last_counter;
      const auto opened = wire::sdls_open(second ? ad_key_ : key_, second ? 2 : 1, header, decoded->data);
      const auto last = link_.tc_strict ? std::max(last_counter, last_ad_counter) : counter;
      if (!opened || !wire::is_fresh(last, opened->counter)) continue;
      const auto outcome = wire::farm_receive(farm, *decoded, true);
      farm = outcome.state;
      if (outcome.verdict == wire::FarmVerdict::discard) continue;
      counter = opened->counter;
      last_sender = opened->sender;
      if (const auto pdu = cfdp::pdu_in_packet(opened->packet)) {
        pdus.emplace_back(pdu->begin(), pdu->end());
      } else if (auto packet = wire::parse_tc_packet(opened->packet)) {
        packets.push_back(*packet);
      }
    }
    return packets;
  }

  /// One report as downlink octets, filled up with idle packets.
  Octets send(std::uint16_t apid, std::uint8_t service, std::uint8_t subtype, Octets source,
              std::uint8_t vc = 0) {
    const wire::TmPacket packet{.apid = apid,
                                .sequence_count = sequence_++,
                                .time_reference = 1,
                                .service = service,
                                .subtype = subtype,
                                .time = to_tai(*from_iso8601("2026-11-21T08:00:00Z")),
                                .source = std::move(source)};
    return send_packet(vc, wire::make_tm_packet(packet));
  }
  /// A file PDU as downlink octets.
  Octets send_pdu(OctetView pdu) {
    return send_packet(2, wire::encode_space_packet({.type = wire::PacketType::telemetry,
                                                     .apid = wire::cfdp_apid,
                                                     .sequence_count = file_sequence_++},
                                                    pdu));
  }
  /// A verification report for @p packet.
  Octets verify(const wire::TcPacket& packet, std::uint8_t subtype, OctetView more = {}) {
    const auto request = wire::request_id(packet);
    OctetWriter source;
    source.u16(request.packet_identification);
    source.u16(request.packet_sequence_control);
    source.bytes(more);
    return send(packet.apid, 1, subtype, source.take());
  }
  /// The report of one of `structures`, as downlink octets; nullopt: it is none of them.
  std::optional<Octets> report_of(std::uint16_t structure) {
    const auto content = structures.find(structure);
    if (content == structures.end()) return std::nullopt;
    OctetWriter source;
    source.u16(structure);
    source.bytes(content->second);
    return send(1, 3, 25, source.take());
  }
  Octets idle() { return wire::encode_cadu(frames_.build_idle(clcw(), next_number()), format()); }

  std::vector<Octets> pdus;
  std::optional<std::uint64_t> last_counter;
  std::optional<std::uint64_t> last_ad_counter;
  std::uint32_t last_sender = 0;
  wire::FarmState farm;
  int lose_ad_frames = 0;                      ///< number of AD frames to lose on the uplink
  bool deaf = false;                           ///< no telecommand comes through
  bool reports = true;                         ///< send the reports that telecommands order
  std::map<std::uint16_t, Octets> structures;  ///< what is sent when it is asked for
  std::uint64_t frame_number = 2;  ///< of the next sealed frame; even: says nothing about the time

 private:
  Octets send_packet(std::uint8_t vc, const Octets& packet) {
    Octets line;
    if (!frames_.queue_packet(vc, packet)) return line;
    while (frames_.queued_octets(vc) > 0) {
      const Octets cadu = wire::encode_cadu(frames_.build(vc, clcw(), next_number()), format());
      line.insert(line.end(), cadu.begin(), cadu.end());
    }
    return line;
  }
  static std::optional<wire::TmSeal> seal_of(const suite::LinkSettings& link) {
    if (!link.tm_security) return std::nullopt;
    return wire::TmSeal{
        .spi = static_cast<std::uint16_t>(link.tm_security->spi),
        .authenticator = wire::TmAuthenticator::create(*wire::SdlsKey::from_hex(tm_test_key))};
  }
  [[nodiscard]] std::uint64_t next_number() { return std::exchange(frame_number, frame_number + 2); }
  [[nodiscard]] std::uint32_t clcw() const { return wire::encode_clcw(wire::make_clcw(farm, 0)); }
  [[nodiscard]] wire::CaduFormat format() const {
    return {.frame_octets = static_cast<std::size_t>(link_.tm_frame_length),
            .reed_solomon = link_.tm_reed_solomon,
            .interleave = static_cast<unsigned>(link_.tm_interleave),
            .randomize = link_.tm_randomizer};
  }
  suite::LinkSettings link_;
  wire::SdlsKey key_;
  wire::SdlsKey ad_key_;
  wire::CltuDecoder cltus_;
  wire::TmFrameBuilder frames_;
  std::uint16_t sequence_ = 0;
  std::uint16_t file_sequence_ = 0;
};

/// A folder for the duration of the test, with the test key at the deployment's path.
class VarFolder {
 public:
  VarFolder();
  [[nodiscard]] const std::filesystem::path& path() const { return folder_.path(); }
  /// VAR/keys/NAME.key, of its owner alone.
  void write_key(const std::string& name, const std::string& text) const;

 private:
  testing_support::TemporaryFolder folder_;
};

}  // namespace srfs::ground
