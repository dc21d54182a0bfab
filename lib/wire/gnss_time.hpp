// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "base/octets.hpp"
#include "base/time.hpp"

namespace srfs::wire {

/// A time of day of the GNSS receiver, in whichever message it came. It belongs to the pulse before it.
struct GnssTime {
  bool fix_valid = false;  ///< RMC: status and mode; UBX: all three validity bits; ZDA has none: false
  /// nullopt where the receiver does not know. UBX: rounded to the second when less than 5 ms off it.
  std::optional<UtcTime> utc;
  friend bool operator==(const GnssTime&, const GnssTime&) = default;
};

/// Satellites count weeks modulo 1024, so a receiver whose firmware guesses the era wrongly is off by a
/// multiple of 1024 weeks (19.6 years). The date of the same week and second in the 1024 weeks from
/// @p not_before on. nullopt before GPS week 1: what a receiver says that has not heard a date.
[[nodiscard]] std::optional<UtcTime> in_era_of(UtcTime named, UtcTime not_before);

/// Cuts the octets of a receiver's line, NMEA 0183 and UBX in any mixture, into messages and takes the times
/// of RMC, ZDA and NAV-TIMEUTC. After any fault it goes on at the next octet that can begin a message, those
/// of a broken UBX frame included. Memory: one message. Not thread-safe.
class GnssTimeStream {
 public:
  struct Counters {
    std::uint64_t times = 0;         ///< handed out
    std::uint64_t others = 0;        ///< sound messages of other kinds
    std::uint64_t bad_checksum = 0;  ///< of either protocol
    std::uint64_t malformed = 0;     ///< sound checksum, no sense; or not a sentence at all
    std::uint64_t leap_seconds = 0;  ///< second 60
    std::uint64_t cut_short = 0;     ///< another message or an unprintable octet before the line end
    std::uint64_t too_long = 0;  ///< a sentence above nmea_sentence_characters_max, a UBX length above 1024
    std::uint64_t noise_octets = 0;  ///< between messages
    [[nodiscard]] std::uint64_t rejected() const { return bad_checksum + malformed + cut_short + too_long; }
  };

  GnssTimeStream();
  /// @return the times of the messages that end in @p octets, in order
  [[nodiscard]] std::vector<GnssTime> push(OctetView octets);
  /// Forgets a message begun: the line was interrupted.
  void discard_partial();
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  [[nodiscard]] std::size_t examine(std::vector<GnssTime>& times);
  [[nodiscard]] std::size_t examine_nmea(std::vector<GnssTime>& times);
  [[nodiscard]] std::size_t examine_ubx(std::vector<GnssTime>& times);
  void take_sentence(std::string_view sentence, std::vector<GnssTime>& times);
  void take_frame(std::uint8_t message_class, std::uint8_t id, OctetView payload,
                  std::vector<GnssTime>& times);

  Octets held_;  // from the first octet of a possible message on; at most one message
  Counters counters_;
};

}  // namespace srfs::wire
