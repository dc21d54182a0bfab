// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "ground/frame_verifier.hpp"
#include "suite/deployment.hpp"
#include "wire/cadu.hpp"
#include "wire/pus.hpp"
#include "wire/tm_frame.hpp"

namespace srfs::ground {

/// TM virtual channels of the link (DESIGN section 6).
namespace tm_channel {
inline constexpr std::uint8_t live = 0;
inline constexpr std::uint8_t playback = 1;
inline constexpr std::uint8_t files = 2;
}  // namespace tm_channel

/// Whether the frames of a packet were the spacecraft's.
enum class Authenticity : std::uint8_t {
  not_judged,  ///< the link has no authentication (link.tm.sdls)
  verified,
  unverified,  ///< shown because the operator wants to see it; nothing is done with it
};

struct ReceivedPacket {
  std::uint8_t vc = 0;
  wire::TmPacket packet;
  Octets raw = {};              ///< the Space Packet as it came
  std::int64_t archive_id = 0;  ///< its number in the archive; 0: none, or not recorded
  Authenticity authenticity = Authenticity::not_judged;
};

/// A Space Packet of the downlink as PUS telemetry; the time packet, which has no secondary header, as 9,2.
[[nodiscard]] std::optional<wire::TmPacket> telemetry_in(OctetView packet);

struct DownlinkCounters {
  std::uint64_t octets = 0;
  std::uint64_t frames = 0;  ///< good ones, idle frames included
  std::uint64_t idle_frames = 0;
  std::uint64_t bad_frames = 0;   ///< could not be corrected, or not a frame of this spacecraft
  std::uint64_t lost_frames = 0;  ///< missing by the master channel counter
  std::uint64_t corrected_octets = 0;
  std::uint64_t noise_octets = 0;
  std::uint64_t packets = 0;        ///< good ones
  std::uint64_t packet_octets = 0;  ///< in them, headers included
  std::uint64_t bad_packets = 0;    ///< cut, or neither a PUS telemetry packet nor a PDU of files
  // Of a link with authentication; `frames` are the verified ones then.
  bool authenticated = false;
  std::uint64_t forged_frames = 0;    ///< not authentic
  std::uint64_t replayed_frames = 0;  ///< authentic, with a number that was used
  std::uint64_t old_frames = 0;       ///< authentic and too old
};

/// Octets of the line to telemetry packets. Pure; memory: one CADU and one packet per channel. On a link with
/// authentication what a frame carries is used when the frame was verified, and only then: packets, PDUs of
/// files, control words. A packet is verified when all its frames are.
class Downlink {
 public:
  /// @param verifier  of a link with authentication; without one no frame of such a link is verified
  explicit Downlink(const suite::LinkSettings& link, std::optional<FrameVerifier> verifier = std::nullopt,
                    UnverifiedFrames unverified = UnverifiedFrames::dropped);

  /// Of this computer's clock: frames are judged by it. Before push().
  void on_time(UtcTime now) { utc_ = now; }

  /// @return the packets that end in these octets, in order of arrival
  [[nodiscard]] std::vector<ReceivedPacket> push(OctetView octets);
  /// The control words of the frames since the last call, at most max_control_words, in order of arrival.
  [[nodiscard]] std::vector<std::uint32_t> take_control_words() { return std::exchange(control_words_, {}); }
  static constexpr std::size_t max_control_words = 1024;
  /// The CFDP PDUs since the last call, in order; the oldest give way beyond max_file_pdus.
  [[nodiscard]] std::vector<Octets> take_file_pdus() { return std::exchange(file_pdus_, {}); }
  static constexpr std::size_t max_file_pdus = 1024;
  [[nodiscard]] DownlinkCounters counters() const;
  [[nodiscard]] bool locked() const { return synchroniser_.locked(); }
  /// The last control word of FARM-1, if a frame came.
  [[nodiscard]] std::optional<std::uint32_t> clcw() const { return clcw_; }
  /// nullptr: the link has no authentication, or there is no key.
  [[nodiscard]] const FrameVerifier* verifier() const { return verifier_ ? &*verifier_ : nullptr; }

 private:
  using Channels = std::array<wire::TmPacketReassembly, wire::tm_vc_count>;
  /// nullopt: it is dropped, and counted.
  [[nodiscard]] std::optional<Authenticity> judge(OctetView octets, wire::TmFrame& frame);
  void take_control_word(std::uint32_t word);
  void take_packet(std::uint8_t vc, const Octets& packet, Authenticity authenticity,
                   std::vector<ReceivedPacket>& received);
  void take_file_packet(OctetView packet);

  wire::CaduSynchroniser synchroniser_;
  wire::TmFrameDecoder decoder_;
  bool authenticated_;
  std::optional<FrameVerifier> verifier_;
  UnverifiedFrames unverified_;
  UtcTime utc_;
  Channels channels_;
  Channels unverified_channels_;  ///< apart: what is forged must not cut a packet that is not
  std::uint64_t keyless_frames_ = 0;
  std::optional<std::uint32_t> clcw_;
  std::vector<std::uint32_t> control_words_;
  std::vector<Octets> file_pdus_;
  std::uint64_t octets_ = 0;
  std::uint64_t idle_frames_ = 0;
  std::uint64_t packets_ = 0;
  std::uint64_t packet_octets_ = 0;
  std::uint64_t bad_packets_ = 0;
};

}  // namespace srfs::ground
