// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "nodes/ttc/link/frame_numbers.hpp"
#include "nodes/ttc/link/line_pacer.hpp"
#include "wire/cadu.hpp"
#include "wire/tm_frame.hpp"

namespace srfs {

/// TM virtual channels of the downlink.
enum class DownlinkChannel : std::uint8_t { live = 0, playback = 1, files = 2 };
inline constexpr std::size_t downlink_channels = 3;

struct DownlinkConfig {
  std::uint16_t spacecraft_id = 0;
  wire::CaduFormat cadu;  ///< its frame_octets is the length of the TM frames
  std::uint32_t baud = 921600;
  std::size_t live_queue_octets = 64U << 10;
  std::size_t playback_queue_octets = 64U << 10;
  std::size_t files_queue_octets = 32U << 10;
  milliseconds flush_after{50};  ///< longest wait of a packet that does not fill a frame
  /// The same while another channel has whole frames to send, in CADUs of the line: a frame half empty costs
  /// that one its share. At most a second.
  unsigned flush_after_cadus = 32;
  wire::TmFrameCounts first_counts{};
  FrameNumbers numbers{};   ///< of sealed frames
  bool continuous = false;  ///< the line is never silent: what is there goes at once, else an idle frame
  unsigned live_frames_per_other = 7;  ///< minimum share of the others: one frame after so many live ones
};

struct DownlinkCounters {
  std::uint64_t frames = 0;  ///< idle frames included
  std::uint64_t idle_frames = 0;
  std::array<std::uint64_t, downlink_channels> packets{};  ///< framed, per channel
  std::array<std::uint64_t, downlink_channels>
      dropped{};  ///< the channel's queue was full: the newest packet is refused
};

/// Which frame goes down next. Live telemetry first; playback and files have a minimum share and take turns
/// over it and over what live telemetry leaves; a frame that is not full
/// leaves after flush_after (later when others could use the line meanwhile), or at once for an urgent
/// packet. Hands a CADU out only when the line has nearly nothing left to send, so what is urgent waits for
/// one CADU at most.
class DownlinkScheduler {
 public:
  /// @param config its CADU format is valid and the frame long enough (wire::tm_frame_octets_min)
  /// @param seal  of all frames; nullopt: they have no security
  explicit DownlinkScheduler(DownlinkConfig config, std::optional<wire::TmSeal> seal = std::nullopt);

  /// @param urgent leave with the next frame @return false: queue full, the packet is dropped and counted
  bool push(DownlinkChannel channel, Octets packet, bool urgent, MonotonicTime now);
  /// The ground waits for a control word: a frame goes within flush_after, an idle one if there is nothing to
  /// say.
  void want_control_word(MonotonicTime now);

  /// The next CADU, if one is due and the line has room for it. It counts as written to the line.
  /// @param clcw gives the control word of the moment. @param utc  of the moment; nullopt: not valid
  [[nodiscard]] std::optional<Octets> next(MonotonicTime now, const std::function<std::uint32_t()>& clcw,
                                           std::optional<UtcTime> utc = std::nullopt);
  /// When next() may have something without another push; nullopt: only another push can change it.
  [[nodiscard]] std::optional<MonotonicTime> next_due(MonotonicTime now) const;

  [[nodiscard]] std::size_t room_octets(DownlinkChannel channel) const;
  /// Of all packets that were ever taken.
  [[nodiscard]] std::uint64_t pushed_octets(DownlinkChannel channel) const {
    return channels_[static_cast<std::size_t>(channel)].pushed_octets;
  }
  /// Of them, those that are in frames.
  [[nodiscard]] std::uint64_t framed_octets(DownlinkChannel channel) const {
    return pushed_octets(channel) - frames_.queued_octets(vc(channel));
  }
  [[nodiscard]] bool empty(DownlinkChannel channel) const;
  /// Octets of packets in a frame.
  [[nodiscard]] std::size_t field_octets() const { return frames_.field_octets(); }
  /// Of the frame in which the next packet begins, when no frame leaves half empty before it: octets already
  /// taken.
  [[nodiscard]] std::size_t begun_octets(DownlinkChannel channel) const {
    return frames_.queued_octets(vc(channel)) % field_octets();
  }
  [[nodiscard]] DownlinkCounters counters() const;
  /// Of the next frames.
  [[nodiscard]] wire::TmFrameCounts frame_counts() const { return frames_.counts(); }
  [[nodiscard]] bool sealed() const { return sealed_; }
  [[nodiscard]] FrameNumbers& numbers() { return config_.numbers; }
  [[nodiscard]] const FrameNumbers& numbers() const { return config_.numbers; }
  /// Frames of the live channel.
  [[nodiscard]] std::uint64_t live_frames() const {
    return frames_.counters(vc(DownlinkChannel::live)).frames;
  }

 private:
  struct Channel {
    std::uint64_t pushed_octets = 0;
    std::uint64_t urgent_end = 0;  ///< pushed_octets after the newest urgent packet
    MonotonicTime waits_since;     ///< for company in a frame
    std::size_t capacity = 0;
    std::uint64_t dropped = 0;
  };
  [[nodiscard]] static std::uint8_t vc(DownlinkChannel channel) { return static_cast<std::uint8_t>(channel); }
  [[nodiscard]] MonotonicTime ready_at(DownlinkChannel channel) const;
  [[nodiscard]] bool fills_a_frame(DownlinkChannel channel) const;
  [[nodiscard]] std::optional<DownlinkChannel> choose(MonotonicTime now);
  /// Anything rather than an idle frame.
  [[nodiscard]] std::optional<DownlinkChannel> first_with_packets() const;

  DownlinkConfig config_;
  bool sealed_;
  nanoseconds flush_beside_others_;
  wire::TmFrameBuilder frames_;
  LinePacer pacer_;
  std::array<Channel, downlink_channels> channels_;
  std::optional<MonotonicTime> control_word_by_;
  unsigned live_in_a_row_ = 0;  ///< live frames while another channel was ready
  bool files_next_ = false;     ///< when playback is ready too
  std::uint64_t frames_made_ = 0;
  std::uint64_t idle_frames_ = 0;
};

}  // namespace srfs
