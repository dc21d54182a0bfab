// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/nmea.hpp"

#include <algorithm>
#include <chrono>
#include <vector>

#include "base/octets.hpp"

namespace srfs::wire {
namespace {

constexpr std::size_t type_characters = 5;  // talker (2) and sentence (3)

using Fields = std::vector<std::string_view>;

Fields split(std::string_view text) {
  Fields fields;
  for (std::size_t start = 0;;) {
    const std::size_t comma = text.find(',', start);
    fields.push_back(text.substr(start, comma - start));
    if (comma == std::string_view::npos) return fields;
    start = comma + 1;
  }
}

/// All characters must be digits; nullopt otherwise or when empty. @param text at most 9 digits
std::optional<unsigned> number(std::string_view text) {
  if (text.empty() || text.size() > 9) return std::nullopt;
  unsigned value = 0;
  for (const char character : text) {
    if (character < '0' || character > '9') return std::nullopt;
    value = value * 10 + static_cast<unsigned>(character - '0');
  }
  return value;
}

/// hhmmss or hhmmss.f with 1 to 9 decimals, as time of day
Result<nanoseconds, NmeaError> time_of_day(std::string_view text) {
  if (text.size() < 6) return Err(NmeaError::bad_time);
  const auto hour = number(text.substr(0, 2));
  const auto minute = number(text.substr(2, 2));
  const auto second = number(text.substr(4, 2));
  if (!hour || !minute || !second) return Err(NmeaError::bad_time);
  if (*hour > 23 || *minute > 59 || *second > 60) return Err(NmeaError::bad_time);
  nanoseconds fraction{0};
  if (text.size() > 6) {
    const std::string_view decimals = text.substr(7);
    const auto value = number(decimals);
    if (text[6] != '.' || !value) return Err(NmeaError::bad_time);
    std::int64_t ns = *value;
    for (std::size_t i = decimals.size(); i < 9; ++i) ns *= 10;
    fraction = nanoseconds(ns);
  }
  if (*second == 60) return Err(NmeaError::leap_second);
  return std::chrono::hours(*hour) + std::chrono::minutes(*minute) + seconds(*second) + fraction;
}

Result<UtcTime, NmeaError> moment(std::optional<unsigned> day, std::optional<unsigned> month,
                                  std::optional<unsigned> year, std::string_view time) {
  const auto of_day = time_of_day(time);
  if (!of_day) return Err(of_day.error());
  if (!day || !month || !year) return Err(NmeaError::bad_date);
  const std::chrono::year_month_day date{std::chrono::year(static_cast<int>(*year)),
                                         std::chrono::month(*month), std::chrono::day(*day)};
  // Later years do not fit into nanoseconds; earlier ones are no time a receiver can mean.
  if (!date.ok() || *year < 1980 || *year > 2199) return Err(NmeaError::bad_date);
  return UtcTime(std::chrono::sys_days(date).time_since_epoch() + *of_day);
}

/// $--RMC,time,status,lat,N,lon,E,speed,course,ddmmyy,variation,E[,mode[,navigational status]]
Result<NmeaTime, NmeaError> parse_rmc(const Fields& fields) {
  if (fields.size() < 1 + 11 || fields.size() > 1 + 13) return Err(NmeaError::bad_field_count);
  if (fields[2] != "A" && fields[2] != "V") return Err(NmeaError::bad_status);
  NmeaTime result{.sentence = NmeaSentence::rmc, .fix_valid = fields[2] == "A", .utc = std::nullopt};
  if (fields.size() > 12) {
    const std::string_view mode = fields[12];
    if (mode.size() != 1 || std::string_view("ADEFMNPRS").find(mode[0]) == std::string_view::npos) {
      return Err(NmeaError::bad_status);
    }
    // Estimated, manual, no fix and simulator say nothing about true time.
    if (std::string_view("EMNS").find(mode[0]) != std::string_view::npos) result.fix_valid = false;
  }
  const std::string_view date = fields[9];
  if (fields[1].empty() || date.empty()) {
    if (fields[2] == "A") return Err(fields[1].empty() ? NmeaError::bad_time : NmeaError::bad_date);
    return result;
  }
  if (date.size() != 6) return Err(NmeaError::bad_date);
  auto year = number(date.substr(4, 2));
  if (year) *year += *year < 80 ? 2000 : 1900;  // GPS began in 1980
  const auto utc = moment(number(date.substr(0, 2)), number(date.substr(2, 2)), year, fields[1]);
  if (!utc) return Err(utc.error());
  result.utc = *utc;
  return result;
}

/// $--ZDA,time,dd,mm,yyyy,zone hours,zone minutes
Result<NmeaTime, NmeaError> parse_zda(const Fields& fields) {
  if (fields.size() != 1 + 6) return Err(NmeaError::bad_field_count);
  NmeaTime result{.sentence = NmeaSentence::zda, .fix_valid = false, .utc = std::nullopt};
  if (fields[1].empty() && fields[2].empty() && fields[3].empty() && fields[4].empty()) return result;
  if (fields[2].size() != 2 || fields[3].size() != 2 || fields[4].size() != 4)
    return Err(NmeaError::bad_date);
  const auto utc = moment(number(fields[2]), number(fields[3]), number(fields[4]), fields[1]);
  if (!utc) return Err(utc.error());
  result.utc = *utc;
  return result;
}

std::optional<std::uint8_t> hex_octet(std::string_view text) {
  const auto octets = from_hex(text);
  if (!octets || octets->size() != 1) return std::nullopt;
  return octets->front();
}

}  // namespace

std::string_view to_string(NmeaError error) {
  switch (error) {
    case NmeaError::bad_frame:
      return "not a sentence";
    case NmeaError::bad_checksum:
      return "checksum is wrong";
    case NmeaError::other_sentence:
      return "neither RMC nor ZDA";
    case NmeaError::bad_field_count:
      return "wrong number of fields";
    case NmeaError::bad_status:
      return "unknown status or mode";
    case NmeaError::bad_time:
      return "not a time";
    case NmeaError::bad_date:
      return "not a date";
    case NmeaError::leap_second:
      return "leap second";
  }
  return "?";
}

std::uint8_t nmea_checksum(std::string_view between_dollar_and_star) {
  std::uint8_t sum = 0;
  for (const char character : between_dollar_and_star) sum ^= static_cast<std::uint8_t>(character);
  return sum;
}

Result<NmeaTime, NmeaError> parse_nmea(std::string_view sentence) {
  if (sentence.size() < 1 + type_characters + 3 || sentence.size() > nmea_sentence_characters_max) {
    return Err(NmeaError::bad_frame);
  }
  const bool printable =
      std::all_of(sentence.begin(), sentence.end(), [](char c) { return c >= ' ' && c <= '~'; });
  const std::size_t star = sentence.size() - 3;
  const auto expected = hex_octet(sentence.substr(star + 1));
  if (!printable || sentence[0] != '$' || sentence[star] != '*' || !expected)
    return Err(NmeaError::bad_frame);
  const std::string_view body = sentence.substr(1, star - 1);
  if (nmea_checksum(body) != *expected) return Err(NmeaError::bad_checksum);

  const Fields fields = split(body);
  if (fields[0].size() != type_characters) return Err(NmeaError::other_sentence);
  const std::string_view kind = fields[0].substr(2);
  if (kind == "RMC") return parse_rmc(fields);
  if (kind == "ZDA") return parse_zda(fields);
  return Err(NmeaError::other_sentence);
}

}  // namespace srfs::wire
