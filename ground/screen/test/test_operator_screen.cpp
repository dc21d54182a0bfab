// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/screen/operator_screen.hpp"

#include <algorithm>
#include <array>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ground/screen/line_editor.hpp"
#include "ground/terminal_text.hpp"

namespace srfs::ground::screen {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

const Views& views() {
  static const Views of_mission(mission::Dictionary::load(mission::Dictionary::default_folder()));
  return of_mission;
}

/// The rows as they are seen: later cells cover earlier ones.
std::vector<std::string> rows_of(const Frame& frame, int columns) {
  std::vector<std::string> rows;
  for (const auto& spans : frame.rows) {
    std::u32string row(static_cast<std::size_t>(columns), U' ');
    for (const Span& span : spans) {
      auto column = static_cast<std::size_t>(span.column);
      for (const char32_t character : characters_of(span.text)) {
        const auto width = static_cast<std::size_t>(columns_of(character));
        EXPECT_LE(column + width, static_cast<std::size_t>(columns)) << span.text;
        if (width > 0 && column < row.size()) row[column] = character;
        column += width;
      }
    }
    rows.push_back(utf8_of(row));
  }
  return rows;
}

TelemetryReport report_of(const std::string& name, std::vector<mission::DecodedField> fields,
                          TelemetryKind kind = TelemetryKind::housekeeping) {
  TelemetryReport report;
  report.kind = kind;
  report.name = name;
  report.fields = std::move(fields);
  return report;
}

mission::DecodedField field(const std::string& name, const std::string& text,
                            mission::LimitState limit = mission::LimitState::none) {
  return {.name = name, .value = std::uint64_t{0}, .text = text, .unit = "", .limit = limit};
}

ScreenState usual_state() {
  ScreenState state;
  state.now = *from_iso8601("2026-11-27T10:20:30Z");
  state.title = "spacecraft 42";
  state.line_open = state.locked = true;
  state.latest.take(report_of("health", {field("mode", "safe"), field("reason", "battery low")}),
                    state.now - seconds(5));
  return state;
}

std::string text_of(const ScreenState& of, Size size) {
  std::string text;
  for (const auto& row : rows_of(draw(of, views(), size), size.columns)) text += row + "\n";
  return text;
}

TEST(OperatorScreen, HasModeReasonLinkAndLimitsAtTheTop) {
  ScreenState of = usual_state();
  of.newest = of.now - seconds(2);
  of.latest.take(report_of("eps_power", {field("battery_v", "6.9", mission::LimitState::red)}), of.now);
  const auto rows = rows_of(draw(of, views(), {}), 80);
  ASSERT_EQ(rows.size(), 24U);
  EXPECT_THAT(rows[0], HasSubstr("spacecraft 42  mode safe: battery low"));
  EXPECT_THAT(rows[0], HasSubstr("10:20:30 UTC"));
  EXPECT_THAT(rows[1], HasSubstr("line open, newest packet 2 s ago  AD off"));
  EXPECT_THAT(rows[2], HasSubstr("1 OUT OF LIMITS  eps_power.battery_v 6.9 red"));
}

TEST(OperatorScreen, TellsOldNewsFromFreshOnes) {
  ScreenState of = usual_state();
  EXPECT_THAT(text_of(of, {}), Not(HasSubstr("OLD")));
  of.now = of.now + seconds(600);
  EXPECT_THAT(text_of(of, {}), HasSubstr("mode safe: battery low (OLD, 10 min ago)"));
  of.server_there = false;
  of.server_lost = of.now - seconds(12);
  EXPECT_THAT(text_of(of, {}), HasSubstr("NO SERVER since 12 s"));
  of.server_there = true;
  of.line_open = false;
  EXPECT_THAT(text_of(of, {}), HasSubstr("LINE CLOSED"));
}

TEST(OperatorScreen, TakesTheModeOfTheNewestPacket) {
  ScreenState of = usual_state();
  of.latest.take(report_of("beacon", {field("mode", "nominal"), field("mode_reason", "commanded")},
                           TelemetryKind::beacon),
                 of.now);
  EXPECT_THAT(text_of(of, {}), HasSubstr("mode nominal: commanded"));
}

TEST(OperatorScreen, ShowsTheValuesOfOneSubsystemAndScrollsThem) {
  ScreenState of = usual_state();
  std::vector<mission::DecodedField> fields;
  for (int i = 0; i < 30; ++i) fields.push_back(field("value_" + std::to_string(i), std::to_string(100 + i)));
  of.latest.take(report_of("payload_eps", fields), of.now);
  const auto& names = views().names();
  of.view = static_cast<std::size_t>(std::find(names.begin(), names.end(), "payload_eps") - names.begin());
  ASSERT_LT(of.view, names.size());
  EXPECT_THAT(text_of(of, {}), HasSubstr("[payload_eps]"));
  EXPECT_THAT(text_of(of, {}), HasSubstr("payload_eps.value_0 "));
  EXPECT_THAT(text_of(of, {}), Not(HasSubstr("health.mode")));
  of.scroll = 1000;
  EXPECT_THAT(text_of(of, {}), HasSubstr("payload_eps.value_29 "));
  of.view = 0;
  EXPECT_THAT(text_of(of, {}), HasSubstr("no value outside its limits"));
}

TEST(OperatorScreen, ShowsTheNewestLineOfATelecommandAlone) {
  ScreenState of = usual_state();
  ScreenState::add(of.news, {of.now, "a sent", Tone::plain, "a"});
  ScreenState::add(of.news, {of.now, "b sent", Tone::plain, "b"});
  ScreenState::add(of.news, {of.now, "a completed", Tone::good, "a"});
  ASSERT_EQ(of.news.size(), 2U);
  EXPECT_THAT(text_of(of, {}), HasSubstr("a completed"));
  EXPECT_THAT(text_of(of, {}), Not(HasSubstr("a sent")));
  for (std::size_t i = 0; i < 2 * ScreenState::happenings_max; ++i)
    ScreenState::add(of.news, {of.now, "x", Tone::plain, ""});
  EXPECT_EQ(of.news.size(), ScreenState::happenings_max);
}

TEST(OperatorScreen, KeepsTheCursorInSightOfALongLine) {
  ScreenState of = usual_state();
  of.line = of.before_cursor = std::string(300, 'x') + "END";
  const Frame frame = draw(of, views(), {});
  EXPECT_EQ(frame.cursor_row, 23);
  EXPECT_LT(frame.cursor_column, 80);
  EXPECT_THAT(rows_of(frame, 80)[23], HasSubstr("xEND"));
}

TEST(OperatorScreen, ShowsOnAnAsciiTerminalAsciiAlone) {
  ScreenState of = usual_state();
  ScreenState::add(of.events, {of.now, "Größe 温", Tone::plain, ""});
  EXPECT_THAT(text_of(of, {24, 80, true}), HasSubstr("Größe 温"));
  const std::string text = text_of(of, {24, 80, false});
  EXPECT_THAT(text, HasSubstr("Gr??e ?"));
  for (const char c : text) EXPECT_LT(static_cast<unsigned char>(c), 0x80U);
}

/// Whatever comes down, at any size: rows of the screen's width, nothing that steers a terminal.
TEST(OperatorScreen, StaysWithinItsCellsWhateverCameDown) {
  std::mt19937 random(7);
  const auto text = [&random] {
    std::string octets(random() % 120, ' ');
    for (char& c : octets) c = static_cast<char>(random());
    return random() % 2 == 0 ? octets : std::string("\x1b[2J\x1b]0;x\x07\xc2\x9b 温度 \u202e") + octets;
  };
  constexpr std::array limits{mission::LimitState::none, mission::LimitState::yellow,
                              mission::LimitState::red};
  for (int round = 0; round < 300; ++round) {
    ScreenState of = usual_state();
    for (const char* name : {"health", "eps_power", "timing"})
      of.latest.take(report_of(name, {field("mode", text()), field("reason", text()),
                                      field("c", text(), limits.at(random() % 3))}),
                     of.now - seconds(random() % 100'000));
    ScreenState::add(of.events, {of.now, for_terminal(text()), Tone::red, ""});
    ScreenState::add(of.news, {of.now, text(), Tone::plain, ""});
    of.line = of.before_cursor = text();
    of.hint = text();
    of.archive_problem = text();
    of.view = random() % views().names().size();
    of.scroll = random() % 40;
    const Size size{static_cast<int>(random() % 70), static_cast<int>(random() % 250), random() % 2 == 0};
    const Frame frame = draw(of, views(), size);
    ASSERT_EQ(frame.rows.size(), static_cast<std::size_t>(std::max(1, size.rows)));
    ASSERT_LT(frame.cursor_column, std::max(1, size.columns));
    for (const auto& row : frame.rows) {
      for (const Span& span : row) {
        const auto characters = characters_of(span.text);
        ASSERT_GE(span.column, 0);
        ASSERT_LE(span.column + columns_of(characters), std::max(1, size.columns));
        for (const char32_t c : characters)
          ASSERT_FALSE(c < 0x20 || (c >= 0x7F && c < 0xA0)) << static_cast<std::uint32_t>(c);
      }
    }
  }
}

}  // namespace
}  // namespace srfs::ground::screen
