// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "base/result.hpp"
#include "base/time.hpp"

namespace srfs::wire {

/// NMEA 0183 allows 82 characters with '$' and CR LF; receivers with many decimals exceed it a little.
inline constexpr std::size_t nmea_sentence_characters_max = 120;

enum class NmeaSentence : std::uint8_t { rmc, zda };

/// The time a sentence names. It belongs to the pulse before the sentence.
struct NmeaTime {
  NmeaSentence sentence = NmeaSentence::rmc;
  /// RMC: status A, and mode (where given) autonomous or differential or better. ZDA carries no status:
  /// always false, take the RMC's word.
  bool fix_valid = false;
  /// Date and time; nullopt where the receiver left them empty because it does not know.
  std::optional<UtcTime> utc;
  friend bool operator==(const NmeaTime&, const NmeaTime&) = default;
};

enum class NmeaError : std::uint8_t {
  bad_frame,        ///< no '$' in front, no '*hh' at the end, or a character that is not printable ASCII
  bad_checksum,     ///< XOR of the characters between '$' and '*'
  other_sentence,   ///< neither RMC nor ZDA; nothing wrong with it
  bad_field_count,  ///< RMC has 11 to 13 fields, ZDA 6
  bad_status,       ///< RMC status other than A or V, or an unknown mode
  bad_time,         ///< not hhmmss[.f...] of a real second
  bad_date,         ///< not a date of the calendar
  leap_second,      ///< second 60: POSIX time cannot name it, the next sentence can
};
[[nodiscard]] std::string_view to_string(NmeaError error);

/// Reads one sentence of any talker (GP, GN, GA, ...): "$GNRMC,...*5A", without line end. RMC names years
/// by two digits: 1980 to 2079.
[[nodiscard]] Result<NmeaTime, NmeaError> parse_nmea(std::string_view sentence);

/// XOR of the characters: what stands behind the '*'.
[[nodiscard]] std::uint8_t nmea_checksum(std::string_view between_dollar_and_star);

}  // namespace srfs::wire
