// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "ground/ad_service.hpp"
#include "ground/latest_values.hpp"
#include "msgs/mission/dictionary.hpp"

namespace srfs::ground::screen {

/// What a text means; the terminal has colours or other attributes for it. Never the only sign.
enum class Tone : std::uint8_t { plain, dim, strong, good, yellow, red, bar };

/// Cells of a row, from a column on. The text has no control characters, and fits into the screen.
struct Span {
  int column = 0;
  std::string text;
  Tone tone = Tone::plain;
};
struct Frame {
  std::vector<std::vector<Span>> rows;
  int cursor_row = 0;
  int cursor_column = 0;
};

struct Size {
  int rows = 24;
  int columns = 80;
  bool utf8 = true;  ///< else what is not ASCII becomes '?'
};
inline constexpr Size smallest{12, 40};

/// One line of what happened.
struct Happening {
  UtcTime time;
  std::string text;  ///< safe for a terminal
  Tone tone = Tone::plain;
  std::string of;  ///< a telecommand or file: its newest line alone is kept; empty: nothing of the kind
};

/// The groups of values that can be shown: "limits", the subsystems of the dictionary, "all".
class Views {
 public:
  explicit Views(const mission::Dictionary& dictionary);
  [[nodiscard]] const std::vector<std::string>& names() const { return names_; }
  /// The rows of one of them.
  [[nodiscard]] std::vector<LatestValues::Row> rows(std::size_t view, const LatestValues& latest) const;

 private:
  std::vector<std::string> names_;
  std::map<std::string, std::string> subsystem_of_;  ///< by structure
};

/// All that the screen shows.
struct ScreenState {
  static constexpr std::size_t happenings_max = 200;
  UtcTime now;
  std::string title;
  LatestValues latest;
  bool server_there = true;
  UtcTime server_lost;  ///< since when, if it is not there
  bool line_open = false;
  bool locked = false;
  std::optional<UtcTime> newest;  ///< when the newest live packet came
  CopReport cop;
  std::string keys;  ///< since they were changed; empty: they were not
  std::uint64_t telecommands_sent = 0;
  std::string archive_problem;
  std::deque<Happening> events;  ///< the newest last
  std::deque<Happening> news;    ///< telecommands, answers, refusals; likewise
  std::size_t view = 0;
  std::size_t scroll = 0;  ///< first row of values
  std::string prompt = "> ";
  std::string line;           ///< as it is typed
  std::string before_cursor;  ///< of the line
  std::string hint;

  /// Bounded: the oldest goes, and what was known of the same.
  static void add(std::deque<Happening>& list, Happening happening);
};

/// The screen. Pure: the same state and size, the same cells.
[[nodiscard]] Frame draw(const ScreenState& state, const Views& views, Size size);

/// How many rows of values a screen of this size shows.
[[nodiscard]] int value_rows(Size size);

/// Columns that a character takes: 0 of combining ones, 2 of wide ones.
[[nodiscard]] int columns_of(char32_t character);
[[nodiscard]] int columns_of(std::u32string_view text);

}  // namespace srfs::ground::screen
