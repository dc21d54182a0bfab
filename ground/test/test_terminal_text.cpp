// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mission/structures.hpp>

#include "ground/files.hpp"
#include "ground/remote.hpp"
#include "ground/schedule.hpp"
#include "ground/telemetry.hpp"
#include "ground/terminal_text.hpp"
#include "tests/mission_dictionary.hpp"

namespace srfs::ground {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using testing_support::dictionary;

/// Clears the screen, sets the title, and continues on a new line.
const std::string rude = "a\x1b[2J\x1b]0;owned\x07\r\nok";

bool steers(const std::string& lines) {
  for (const char c : lines) {
    if ((c >= 0 && c < ' ' && c != '\n') || c == 0x7f) return true;
  }
  return lines.find("\xc2\x9b") != std::string::npos;
}

TelemetryReport decoded(std::uint8_t service, std::uint8_t subtype, Octets source, std::uint16_t apid = 1) {
  return decode_telemetry(dictionary(), {0,
                                         {.apid = apid,
                                          .time_reference = 1,
                                          .service = service,
                                          .subtype = subtype,
                                          .source = std::move(source)}});
}

template <class Content>
Octets with_id(std::uint16_t id, const Content& content) {
  OctetWriter out;
  out.u16(id);
  content.encode(out);
  return out.take();
}

TEST(TerminalText, LeavesWhatIsPlainAndEscapesWhatSteersATerminal) {
  EXPECT_EQ(for_terminal("image_001 (2).png"), "image_001 (2).png");
  EXPECT_EQ(for_terminal("Größe 星 \xf0\x9f\x9b\xb0"), "Größe 星 \xf0\x9f\x9b\xb0");
  EXPECT_EQ(for_terminal(rude), R"(a\x1b[2J\x1b]0;owned\x07\x0d\x0aok)");
  EXPECT_EQ(for_terminal("\x7f\t"), R"(\x7f\x09)");
  EXPECT_EQ(for_terminal("\xc2\x9b[2J"), R"(\u009b[2J)")
      << "a control sequence begins with one character of C1";
  EXPECT_EQ(for_terminal("gnp\xe2\x80\xaetxt"), R"(gnp\u202etxt)") << "written from right to left";
  EXPECT_EQ(for_terminal(R"(a\x1b)"), R"(a\\x1b)") << "not to be mixed up with an escape";
}

TEST(TerminalText, WritesWhatIsNoUtf8AsOctets) {
  EXPECT_EQ(for_terminal("\xff"), R"(\xff)");
  EXPECT_EQ(for_terminal("\x9b[2J"), R"(\x9b[2J)");
  EXPECT_EQ(for_terminal("\xc0\x9b"), R"(\xc0\x9b)") << "overlong";
  EXPECT_EQ(for_terminal("\xe0\x80\x9b"), R"(\xe0\x80\x9b)");
  EXPECT_EQ(for_terminal("\xed\xa0\x80"), R"(\xed\xa0\x80)") << "half a surrogate pair";
  EXPECT_EQ(for_terminal("\xe2\x80"), R"(\xe2\x80)") << "cut";
  EXPECT_EQ(for_terminal("\xf4\x90\x80\x80"), R"(\xf4\x90\x80\x80)") << "beyond Unicode";
}

TEST(TerminalText, NothingThatCameDownSteersTheTerminal) {
  mission::Beacon beacon;
  beacon.mode_reason = rude.substr(0, 20);
  EXPECT_FALSE(steers(to_lines(decoded(3, 25, with_id(mission::structure::beacon, beacon)), false)));
  const mission::TtcModeChangedEvent event{mission::MissionMode::safe, rude};
  const auto event_lines = to_lines(decoded(5, 1, with_id(event.event_id, event)), false);
  EXPECT_FALSE(steers(event_lines));
  EXPECT_THAT(event_lines, HasSubstr(R"(mode safe: a\x1b[2J)"));
  EXPECT_EQ(std::count(event_lines.begin(), event_lines.end(), '\n'), 1)
      << "no line that was not written here";

  mission::RepositorySummary object;
  object.objects = 1;
  object.object = mission::FileObject::file;
  object.object_name = rude;
  EXPECT_FALSE(steers(answer_lines(decoded(23, 13, object.encoded()))));
  mission::FileAttributes attributes;
  attributes.file = rude;
  attributes.repository = rude;
  EXPECT_FALSE(steers(answer_lines(decoded(23, 4, attributes.encoded()))));
  mission::FileCopyStatus copy;
  copy.operations = 1;
  copy.file = rude;
  EXPECT_FALSE(steers(answer_lines(decoded(23, 23, copy.encoded()))));
  mission::ParameterGenerationHousekeeping kept;
  kept.origin = kept.content = rude;
  EXPECT_FALSE(steers(answer_lines(
      decoded(3, 25, with_id(mission::ParameterGenerationHousekeeping::structure_id, kept), 48))));

  cfdp::Report file;
  file.destination_file = rude;
  EXPECT_FALSE(steers(to_line(file)));
  EXPECT_FALSE(steers(to_line(cfdp::News{.event = {}, .file = file})));
}

TEST(TerminalText, AScheduledCommandSteersNothing) {
  ScheduleReport report;
  report.activities.push_back({});
  report.activities.back().command = "file.delete file=" + rude;
  EXPECT_FALSE(steers(to_lines(report)));
}

TEST(TerminalText, TheNamesForTheNextTelecommandStayAsTheyAre) {
  mission::RepositorySummary object;
  object.objects = 1;
  object.object_name = "a\x1b";
  object.left = 3;
  const auto next =
      next_page({.name = "file.list", .arguments = {"repository="}}, {decoded(23, 13, object.encoded())});
  ASSERT_TRUE(next);
  EXPECT_EQ(next->arguments.back(), "after=a\x1b");
}

TEST(ValidUtf8, PutsAReplacementForEachOctetThatIsNoTextAndForZero) {
  EXPECT_EQ(valid_utf8("Grün \\ \t"), "Grün \\ \t");
  EXPECT_EQ(valid_utf8(std::string("a\0\xC3(\xF0\x9F", 6)), "a\uFFFD\uFFFD(\uFFFD\uFFFD");
}

}  // namespace
}  // namespace srfs::ground
