// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace srfs::ground::screen {

enum class Key : std::uint8_t {
  character,
  enter,
  complete,
  backspace,
  remove,
  left,
  right,
  home,
  end,
  up,
  down,
  page_up,
  page_down,
  previous_view,
  next_view,
  erase_word,
  erase_line,
  interrupt,     ///< Ctrl C
  end_of_input,  ///< Ctrl D
  redraw,        ///< Ctrl L
  none,          ///< a key without a meaning here
};
struct Input {
  Key key = Key::none;
  char32_t character = 0;  ///< of Key::character
};

/// One line that is typed, with the lines before it. Pure. Bounds: line_max characters, more are dropped;
/// history_max lines, the oldest is forgotten.
class LineEditor {
 public:
  static constexpr std::size_t line_max = 2000;
  static constexpr std::size_t history_max = 500;

  /// A key that edits or recalls; others are ignored.
  void take(const Input& input);
  /// The line, UTF-8.
  [[nodiscard]] std::string text() const;
  /// Characters before the cursor.
  [[nodiscard]] std::string before_cursor() const;
  /// What follows the octet @p begin before the cursor is replaced.
  void replace_before_cursor(std::size_t begin, const std::string& text);
  void clear();
  /// The line, which becomes the newest of the history; the next one is empty.
  [[nodiscard]] std::string take_line();
  [[nodiscard]] const std::vector<std::string>& history() const { return history_; }
  void set_history(std::vector<std::string> lines);

 private:
  void insert(char32_t character);
  void recall(std::size_t index);
  void erase_word();

  std::u32string line_;
  std::size_t cursor_ = 0;
  std::vector<std::string> history_;
  std::size_t recalled_ = 0;  ///< in the history; its size: the new line
  std::u32string new_line_;   ///< while an older one is shown
};

/// Adds a line that was typed to those before it, unless it is blank or the same as the newest. @return
/// whether it was added
bool remember(std::vector<std::string>& lines, const std::string& line);

/// Characters of a text; what is no UTF-8 becomes '?'.
[[nodiscard]] std::u32string characters_of(std::string_view text);
[[nodiscard]] std::string utf8_of(std::u32string_view characters);

}  // namespace srfs::ground::screen
