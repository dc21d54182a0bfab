// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/screen/line_editor.hpp"

#include <algorithm>
#include <string_view>

namespace srfs::ground::screen {
namespace {

constexpr char32_t largest = 0x10FFFF;

/// How many octets follow a first one; -1: it is none.
int following(unsigned char first) {
  if (first < 0x80) return 0;
  if (first >= 0xC2 && first < 0xE0) return 1;
  if (first >= 0xE0 && first < 0xF0) return 2;
  return first >= 0xF0 && first < 0xF5 ? 3 : -1;
}

}  // namespace

std::u32string characters_of(std::string_view text) {
  std::u32string characters;
  for (std::size_t i = 0; i < text.size();) {
    const auto first = static_cast<unsigned char>(text[i]);
    const int more = following(first);
    bool good = more >= 0 && i + static_cast<std::size_t>(more) < text.size();
    char32_t character = more == 0 ? first : more > 0 ? first & (0x3FU >> more) : 0;
    for (int k = 1; good && k <= more; ++k) {
      const auto next = static_cast<unsigned char>(text[i + static_cast<std::size_t>(k)]);
      good = (next & 0xC0U) == 0x80;
      character = (character << 6U) | (next & 0x3FU);
    }
    characters += good && character <= largest ? character : U'?';
    i += good ? static_cast<std::size_t>(more) + 1 : 1;
  }
  return characters;
}

std::string utf8_of(std::u32string_view characters) {
  std::string text;
  const auto add = [&text](char32_t octet) { text += static_cast<char>(octet); };
  for (const char32_t c : characters) {
    if (c < 0x80) {
      add(c);
      continue;
    }
    if (c >= 0x10000) {
      add(0xF0 | (c >> 18U));
      add(0x80 | ((c >> 12U) & 0x3FU));
    } else if (c >= 0x800) {
      add(0xE0 | (c >> 12U));
    }
    add(c >= 0x800 ? 0x80 | ((c >> 6U) & 0x3FU) : 0xC0 | (c >> 6U));
    add(0x80 | (c & 0x3FU));
  }
  return text;
}

std::string LineEditor::text() const {
  return utf8_of(line_);
}

std::string LineEditor::before_cursor() const {
  return utf8_of(std::u32string_view(line_).substr(0, cursor_));
}

void LineEditor::replace_before_cursor(std::size_t begin, const std::string& text) {
  const std::u32string before = characters_of(before_cursor().substr(0, begin) + text);
  const std::u32string after = line_.substr(cursor_);
  if (before.size() + after.size() > line_max) return;
  line_ = before + after;
  cursor_ = before.size();
}

void LineEditor::clear() {
  line_.clear();
  cursor_ = 0;
  recalled_ = history_.size();
}

std::string LineEditor::take_line() {
  std::string line = text();
  if (remember(history_, line) && history_.size() > history_max) history_.erase(history_.begin());
  clear();
  return line;
}

bool remember(std::vector<std::string>& lines, const std::string& line) {
  if (line.find_first_not_of(' ') == std::string::npos) return false;
  if (!lines.empty() && lines.back() == line) return false;
  lines.push_back(line);
  return true;
}

void LineEditor::set_history(std::vector<std::string> lines) {
  if (lines.size() > history_max)
    lines.erase(lines.begin(), lines.end() - static_cast<std::ptrdiff_t>(history_max));
  history_ = std::move(lines);
  recalled_ = history_.size();
}

void LineEditor::insert(char32_t character) {
  const bool control = character < 0x20 || (character >= 0x7F && character < 0xA0);
  if (control || line_.size() == line_max) return;
  line_.insert(cursor_++, 1, character);
}

void LineEditor::recall(std::size_t index) {
  if (index > history_.size()) return;
  if (recalled_ == history_.size()) new_line_ = line_;
  recalled_ = index;
  line_ = index == history_.size() ? new_line_ : characters_of(history_[index]);
  cursor_ = line_.size();
}

void LineEditor::erase_word() {
  std::size_t begin = cursor_;
  while (begin > 0 && line_[begin - 1] == U' ') --begin;
  while (begin > 0 && line_[begin - 1] != U' ') --begin;
  line_.erase(begin, cursor_ - begin);
  cursor_ = begin;
}

void LineEditor::take(const Input& input) {
  switch (input.key) {
    case Key::character:
      return insert(input.character);
    case Key::backspace:
      if (cursor_ > 0) line_.erase(--cursor_, 1);
      return;
    case Key::remove:
      if (cursor_ < line_.size()) line_.erase(cursor_, 1);
      return;
    case Key::left:
      cursor_ -= cursor_ > 0 ? 1 : 0;
      return;
    case Key::right:
      cursor_ = std::min(cursor_ + 1, line_.size());
      return;
    case Key::home:
      cursor_ = 0;
      return;
    case Key::end:
      cursor_ = line_.size();
      return;
    case Key::up:
      if (recalled_ > 0) recall(recalled_ - 1);
      return;
    case Key::down:
      return recall(recalled_ + 1);
    case Key::erase_word:
      return erase_word();
    case Key::erase_line:
      return clear();
    default:
      return;
  }
}

}  // namespace srfs::ground::screen
