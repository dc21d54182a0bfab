// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "base/octets.hpp"
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

struct ReceivedPacket {
  std::uint8_t vc = 0;
  wire::TmPacket packet;
  Octets raw = {};              ///< the Space Packet as it came
  std::int64_t archive_id = 0;  ///< its number in the archive; 0: none, or not recorded
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
};

/// Octets of the line to telemetry packets. Pure; memory: one CADU and one packet per channel.
class Downlink {
 public:
  explicit Downlink(const suite::LinkSettings& link);

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

 private:
  void take_file_packet(OctetView packet);

  wire::CaduSynchroniser synchroniser_;
  wire::TmFrameDecoder decoder_;
  std::array<wire::TmPacketReassembly, wire::tm_vc_count> channels_;
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
