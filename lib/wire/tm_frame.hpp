// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string_view>
#include <vector>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "wire/space_packet.hpp"
#include "wire/tm_sdls.hpp"

namespace srfs::wire {

inline constexpr std::size_t tm_frame_header_octets = 6;
inline constexpr std::size_t tm_ocf_octets = 4;
inline constexpr std::size_t tm_fecf_octets = 2;
/// Everything in a frame that is not its data field. OCF and FECF are always there on this link.
inline constexpr std::size_t tm_frame_overhead_octets =
    tm_frame_header_octets + tm_ocf_octets + tm_fecf_octets;
/// Shortest frame this codec makes: room for an idle packet.
inline constexpr std::size_t tm_frame_octets_min = tm_frame_overhead_octets + idle_packet_octets_min;
/// The first header pointer has eleven bits, two values of which are taken.
inline constexpr std::size_t tm_frame_octets_max = 2048;
inline constexpr std::uint8_t tm_vc_count = 8;
/// Virtual channel of frames that only keep the link alive.
inline constexpr std::uint8_t tm_idle_vc = 7;
/// First header pointer: no packet starts in this frame (CCSDS 132.0-B-3, 4.1.2.7.6.4).
inline constexpr std::uint16_t no_packet_starts = 0x7FF;
/// First header pointer: only idle data in this frame (4.1.2.7.6.5).
inline constexpr std::uint16_t only_idle_data = 0x7FE;

/// One TM transfer frame without its FECF, which is made and tested on the way.
struct TmFrame {
  std::uint16_t spacecraft_id = 0;  ///< 0 to 0x3FF
  std::uint8_t vc = 0;              ///< 0 to 7
  std::uint8_t master_count = 0;    ///< modulo 256 over all channels
  std::uint8_t vc_count = 0;        ///< modulo 256 over this channel
  std::uint16_t first_header = no_packet_starts;
  std::uint32_t ocf = 0;  ///< operational control field: the CLCW
  Octets data = {};       ///< 7 octets or more
  friend bool operator==(const TmFrame&, const TmFrame&) = default;
};

enum class TmFrameError : std::uint8_t {
  wrong_length,        ///< not the octets agreed for this link
  bad_fecf,            ///< damaged
  bad_version,         ///< transfer frame version number is not 0
  wrong_spacecraft,    ///< from another spacecraft
  no_ocf,              ///< OCF flag is clear
  bad_data_status,     ///< secondary header, VCA data, reversed packets or a segment length other than 11
  bad_header_pointer,  ///< points behind the data field
};
inline constexpr std::size_t tm_frame_error_count = 7;
[[nodiscard]] std::string_view to_string(TmFrameError error);

/// Packs a frame with OCF and FECF (CCSDS 132.0-B-3, 4.1). Its length follows from the data field.
[[nodiscard]] Octets encode_tm_frame(const TmFrame& frame);
/// Reads exactly one frame of @p frame_octets.
[[nodiscard]] Result<TmFrame, TmFrameError> decode_tm_frame(OctetView octets, std::uint16_t spacecraft_id,
                                                            std::size_t frame_octets);

/// The frame counters of the next frames.
struct TmFrameCounts {
  std::uint8_t master = 0;
  std::array<std::uint8_t, tm_vc_count> vc{};
  friend bool operator==(const TmFrameCounts&, const TmFrameCounts&) = default;
};

/// Makes the frames of all virtual channels out of queued packets (CCSDS 132.0-B-3, 4.2). Packets of one
/// channel leave in order and span frames; what a frame has left over is filled with idle packets. Memory:
/// the queues' bound. Not thread-safe.
class TmFrameBuilder {
 public:
  struct Config {
    std::uint16_t spacecraft_id = 0;
    std::size_t frame_octets = 223;  ///< tm_frame_octets_min to tm_frame_octets_max
    std::size_t queue_octets_max =
        1 << 17;  ///< per channel; a packet that would exceed it is refused and counted
    TmFrameCounts first{};
  };
  struct Counters {
    std::uint64_t frames = 0;
    std::uint64_t packets = 0;  ///< taken from the queue into frames, idle packets not counted
    std::uint64_t idle_packets = 0;
    std::uint64_t refused_packets = 0;  ///< queue full
  };

  /// @param seal  nullopt: frames as in CCSDS 132.0-B. With one a frame has tm_sdls_overhead_octets less
  /// room, and frame_octets is tm_frame_octets_min and these at least
  explicit TmFrameBuilder(Config config, std::optional<TmSeal> seal = std::nullopt);

  /// @param vc      0 to 6
  /// @param packet  a whole Space Packet
  /// @return false: the channel's queue is full, the packet was dropped and counted
  [[nodiscard]] bool queue_packet(std::uint8_t vc, Octets packet);
  /// Octets of packets, begun or not, that no frame has carried yet. Idle packets do not count.
  [[nodiscard]] std::size_t queued_octets(std::uint8_t vc) const;
  /// Octets the queue of @p vc still takes.
  [[nodiscard]] std::size_t free_octets(std::uint8_t vc) const;

  /// Octets of packets in a frame.
  [[nodiscard]] std::size_t field_octets() const { return field_octets_; }

  /// The next frame of @p vc (0 to 6), from its queue and idle packets. @param ocf the CLCW of the moment
  /// @param number  of a sealed frame: higher than all before
  [[nodiscard]] Octets build(std::uint8_t vc, std::uint32_t ocf, std::uint64_t number = 0);
  /// A frame of the idle channel: no packets at all.
  [[nodiscard]] Octets build_idle(std::uint32_t ocf, std::uint64_t number = 0);

  [[nodiscard]] const Counters& counters(std::uint8_t vc) const { return channels_[vc].counters; }
  [[nodiscard]] TmFrameCounts counts() const;
  [[nodiscard]] const Config& config() const { return config_; }

 private:
  struct Channel {
    std::deque<Octets> packets;
    std::size_t queued_octets = 0;  // in packets, plus what is left of a current one that is not idle
    Octets current;                 // the packet being carried
    std::size_t carried = 0;        // octets of it already in frames
    bool current_is_idle = false;
    std::uint8_t frame_count = 0;
    Counters counters;
  };
  void start_packet(Channel& channel, std::size_t room) const;
  Octets finish(Channel& channel, TmFrame frame, std::uint64_t number);

  Config config_;
  std::optional<TmSeal> seal_;
  std::size_t field_octets_;
  std::array<Channel, tm_vc_count> channels_;
  std::uint8_t master_count_ = 0;
};

/// Decodes the frames of one spacecraft on the ground and watches the master channel counter.
class TmFrameDecoder {
 public:
  struct Counters {
    std::uint64_t frames = 0;  ///< decoded
    std::uint64_t lost = 0;    ///< missing by the master channel counter, modulo 256
    std::array<std::uint64_t, tm_frame_error_count> refused{};  ///< by TmFrameError
  };
  TmFrameDecoder(std::uint16_t spacecraft_id, std::size_t frame_octets)
      : spacecraft_id_(spacecraft_id), frame_octets_(frame_octets) {}

  [[nodiscard]] Result<TmFrame, TmFrameError> decode(OctetView octets);
  /// decode() in two steps, for frames that are verified in between: what is not authentic must not count as
  /// a frame, nor make others look lost.
  [[nodiscard]] Result<TmFrame, TmFrameError> read(OctetView octets);
  void take(const TmFrame& frame);
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  std::uint16_t spacecraft_id_;
  std::size_t frame_octets_;
  std::optional<std::uint8_t> last_master_count_;
  Counters counters_;
};

/// Puts the packets of one virtual channel together again. A missing frame, or a first header pointer that
/// contradicts the packet under way, drops that packet; work goes on at the next first header. Memory: one
/// packet. Not thread-safe.
class TmPacketReassembly {
 public:
  struct Counters {
    std::uint64_t frames = 0;
    std::uint64_t idle_frames = 0;        ///< frames of only idle data
    std::uint64_t lost_frames = 0;        ///< missing by the channel's frame counter, modulo 256
    std::uint64_t packets = 0;            ///< handed out
    std::uint64_t idle_packets = 0;       ///< dropped, as they should be
    std::uint64_t cut_packets = 0;        ///< begun but never completed
    std::uint64_t header_mismatches = 0;  ///< first header pointer is not where the packet under way ends
    std::uint64_t bad_packets = 0;        ///< wrong packet version or over the longest packet
  };
  /// @param longest_packet  octets, header included; a longer one is taken for loss of synchronisation
  explicit TmPacketReassembly(std::size_t longest_packet = packet_octets_max)
      : longest_packet_(longest_packet) {}

  /// @param frame  the next one of this channel, as received
  /// @return the packets that end in it, in order, without idle packets
  [[nodiscard]] std::vector<Octets> push(const TmFrame& frame);
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  enum class NewPackets { allowed, forbidden };
  bool consume(OctetView data, NewPackets rule, std::vector<Octets>& packets);
  void finish_packet(std::vector<Octets>& packets);
  void lose_synchronisation();

  std::size_t longest_packet_;
  std::optional<std::uint8_t> last_count_;
  bool synchronised_ = false;  // the next octet continues partial_ or starts a packet
  Octets partial_;
  Counters counters_;
};

}  // namespace srfs::wire
