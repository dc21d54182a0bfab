// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/screen/line_editor.hpp"

#include <random>

#include <gtest/gtest.h>

namespace srfs::ground::screen {
namespace {

void type(LineEditor& editor, std::string_view text) {
  for (const char32_t character : characters_of(text)) editor.take({Key::character, character});
}

TEST(LineEditor, EditsWhereTheCursorIs) {
  LineEditor editor;
  type(editor, "tc eps");
  editor.take({Key::left});
  editor.take({Key::backspace});
  type(editor, "X");
  EXPECT_EQ(editor.text(), "tc eXs");
  EXPECT_EQ(editor.before_cursor(), "tc eX");
  editor.take({Key::home});
  editor.take({Key::remove});
  EXPECT_EQ(editor.text(), "c eXs");
  editor.take({Key::end});
  editor.take({Key::erase_word});
  EXPECT_EQ(editor.text(), "c ");
  editor.take({Key::erase_line});
  EXPECT_EQ(editor.text(), "");
  editor.take({Key::backspace});
  editor.take({Key::left});
  editor.take({Key::remove});
  EXPECT_EQ(editor.text(), "");
}

TEST(LineEditor, RecallsOlderLinesAndKeepsTheOneThatWasBegun) {
  LineEditor editor;
  for (const char* line : {"ping", "ping", "  ", "clcw"}) {
    type(editor, line);
    EXPECT_EQ(editor.take_line(), line);
  }
  EXPECT_EQ(editor.history(), (std::vector<std::string>{"ping", "clcw"})) << "no repetition, no empty line";
  type(editor, "ne");
  editor.take({Key::up});
  EXPECT_EQ(editor.text(), "clcw");
  editor.take({Key::up});
  editor.take({Key::up});
  EXPECT_EQ(editor.text(), "ping") << "the oldest";
  editor.take({Key::down});
  editor.take({Key::down});
  editor.take({Key::down});
  EXPECT_EQ(editor.text(), "ne");
}

TEST(LineEditor, KeepsNoMoreThanItsBounds) {
  LineEditor editor;
  type(editor, std::string(LineEditor::line_max + 10, 'x'));
  EXPECT_EQ(editor.text().size(), LineEditor::line_max);
  for (std::size_t i = 0; i < LineEditor::history_max + 5; ++i) {
    editor.clear();
    type(editor, std::to_string(i));
    static_cast<void>(editor.take_line());
  }
  EXPECT_EQ(editor.history().size(), LineEditor::history_max);
  EXPECT_EQ(editor.history().front(), "5");
  editor.set_history(std::vector<std::string>(LineEditor::history_max + 5, "x"));
  EXPECT_EQ(editor.history().size(), LineEditor::history_max);
}

TEST(LineEditor, TakesNoControlCharacterAndAnyOther) {
  LineEditor editor;
  for (const char32_t control : {U'\x1b', U'\x07', U'\x7f', U'\x9b'}) editor.take({Key::character, control});
  type(editor, "Größe 温度 🛰");
  EXPECT_EQ(editor.text(), "Größe 温度 🛰");
  editor.take({Key::backspace});
  EXPECT_EQ(editor.text(), "Größe 温度 ");
  EXPECT_EQ(utf8_of(characters_of("a\xff\xc3")), "a??") << "what is no UTF-8";
}

TEST(LineEditor, StaysWithinItsLineWhateverKeysCome) {
  std::mt19937 random(1);
  LineEditor editor;
  for (int i = 0; i < 20'000; ++i) {
    const auto key = static_cast<Key>(random() % (static_cast<unsigned>(Key::none) + 1));
    if (random() % 50 == 0) static_cast<void>(editor.take_line());
    editor.take({key, static_cast<char32_t>(U'a' + random() % 26)});
    ASSERT_TRUE(editor.text().starts_with(editor.before_cursor()));
  }
}

}  // namespace
}  // namespace srfs::ground::screen
