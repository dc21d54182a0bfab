// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/remote.hpp"
#include "tests/mission_dictionary.hpp"

#include <gmock/gmock.h>

#include <mission/structures.hpp>

namespace srfs::ground {
namespace {

using testing_support::dictionary;

using testing::ElementsAre;
using testing::HasSubstr;

/// The telecommands as "name argument argument", one per line. The dictionary must accept each of them.
std::string asked(const std::string& action, const std::vector<std::string>& words = {}) {
  const auto request = remote_request(action, words, UtcTime(milliseconds(1234)));
  if (!request) return request.error();
  std::string text;
  for (const TelecommandText& telecommand : request->telecommands) {
    EXPECT_TRUE(dictionary().encode(telecommand.name, telecommand.arguments)) << telecommand.name;
    text += telecommand.name;
    for (const std::string& argument : telecommand.arguments) text += " " + argument;
    text += ";";
  }
  return text + (request->awaited_file.empty() ? "" : " awaits " + request->awaited_file);
}

TelemetryReport received(std::uint8_t service, std::uint8_t subtype, const Octets& data) {
  ReceivedPacket packet;
  packet.packet.apid = mission::apid::ttc;
  packet.packet.service = service;
  packet.packet.subtype = subtype;
  packet.packet.source = data;
  return decode_telemetry(dictionary(), packet);
}

TelemetryReport entry(const std::string& name, std::uint32_t left) {
  mission::RepositorySummary report;
  report.objects = 1;
  report.object = mission::FileObject::file;
  report.object_name = name;
  report.octets = 17;
  report.left = left;
  return received(23, 13, report.encoded());
}

TEST(RemoteFiles, EachActionIsATelecommand) {
  EXPECT_EQ(asked("ls"), "file.list repository=;");
  EXPECT_EQ(asked("ls", {"images/raw/"}), "file.list repository=images/raw;");
  EXPECT_EQ(asked("stat", {"images/raw/a", "b"}),
            "file.report repository=images/raw file=a;file.report repository= file=b;");
  EXPECT_EQ(asked("rm", {"a"}), "file.delete repository= file=a;");
  EXPECT_EQ(asked("mkdir", {"images/raw"}), "file.make_folder repository=images folder=raw;");
  EXPECT_EQ(asked("rmdir", {"images/"}), "file.remove_folder repository= folder=images;");
  EXPECT_EQ(asked("copies"), "file.report_copies;");
  EXPECT_EQ(asked("suspend", {"7", "all", "images/"}),
            "file.suspend operation=7;file.suspend_all repository=;file.suspend_all repository=images;");
  EXPECT_EQ(asked("get", {"images/a"}),
            "file.copy operation=1234 source_repository=images source_file=a target_repository=ground: "
            "target_file=a; awaits a");
  EXPECT_EQ(asked("get", {"a", "new/b"}),
            "file.copy operation=1234 source_repository= source_file=a target_repository=ground:new "
            "target_file=b; awaits new/b");
}

TEST(RemoteFiles, OtherWordsAreRefusedWithWhatIsExpected) {
  for (const auto& [action, words] :
       std::vector<std::pair<std::string, std::vector<std::string>>>{{"lss", {}},
                                                                     {"ls", {"a", "b"}},
                                                                     {"rm", {}},
                                                                     {"get", {}},
                                                                     {"get", {"a", "b", "c"}},
                                                                     {"suspend", {}},
                                                                     {"copies", {"x"}}}) {
    EXPECT_THAT(asked(action, words), HasSubstr("expected ls [FOLDER]")) << action;
  }
}

TEST(RemoteFiles, AListingGoesOnBehindTheLastNameUntilNothingIsLeft) {
  const TelecommandText first{.name = "file.list", .arguments = {"repository=images"}};
  const auto second = next_page(first, {entry("a", 2), entry("b", 1)});
  ASSERT_TRUE(second);
  EXPECT_THAT(second->arguments, ElementsAre("repository=images", "after=b"));
  EXPECT_TRUE(dictionary().encode(second->name, second->arguments));
  EXPECT_FALSE(next_page(*second, {entry("c", 0)}));
  EXPECT_FALSE(next_page(*second, {entry("b", 1)}))
      << "a spacecraft that repeats itself is not asked for ever";
  EXPECT_FALSE(next_page(first, {})) << "the answers were lost";
}

TEST(RemoteFiles, AnswersThatWereLostOnTheWayAreMissed) {
  const TelecommandText list{.name = "file.list", .arguments = {"repository="}};
  const auto of = [](std::uint32_t total, std::uint32_t left) {
    mission::RepositorySummary report;
    report.objects = 1;
    report.total = total;
    report.left = left;
    return received(23, 13, report.encoded());
  };
  EXPECT_TRUE(is_whole(list, {of(3, 2), of(3, 1), of(3, 0)}, std::nullopt));
  EXPECT_FALSE(is_whole(list, {of(3, 1), of(3, 0)}, std::nullopt)) << "the first";
  EXPECT_FALSE(is_whole(list, {of(3, 2), of(3, 0)}, std::nullopt)) << "one between";
  EXPECT_FALSE(is_whole(list, {}, std::nullopt));
  EXPECT_TRUE(is_whole(list, {of(9, 1), of(9, 0)}, 2));
  EXPECT_FALSE(is_whole(list, {of(9, 0)}, 2)) << "the first of the second page";
  EXPECT_TRUE(is_whole(list, {received(23, 13, mission::RepositorySummary{}.encoded())}, std::nullopt))
      << "empty";

  EXPECT_FALSE(is_whole({.name = "parameters.report", .arguments = {}}, {}, std::nullopt));
  EXPECT_FALSE(is_whole({.name = "file.report", .arguments = {}}, {}, std::nullopt));
  EXPECT_TRUE(is_whole({.name = "file.delete", .arguments = {}}, {}, std::nullopt)) << "it has no answers";
  mission::FileCopyStatus copy;
  copy.operations = 1;
  copy.left = 1;
  const TelecommandText copies{.name = "file.report_copies", .arguments = {}};
  EXPECT_FALSE(is_whole(copies, {received(23, 23, copy.encoded())}, std::nullopt));
  copy.left = 0;
  EXPECT_TRUE(is_whole(copies, {received(23, 23, copy.encoded())}, std::nullopt));
}

TEST(RemoteFiles, AnswersAreLines) {
  EXPECT_EQ(answer_lines(entry("a.fits", 0)), "file              17  a.fits\n");
  mission::FileAttributes attributes;
  attributes.repository = "images";
  attributes.file = "a";
  attributes.octets = 3;
  attributes.checksum = 0x61626300;
  attributes.sha256 = {0xba7816bf, 0x8f01cfea, 0x414140de, 0x5dae2223,
                       0xb00361a3, 0x96177a9c, 0xb410ff61, 0xf20015ad};
  const std::string lines = answer_lines(received(23, 4, attributes.encoded()));
  EXPECT_THAT(lines, HasSubstr("images/a\n"));
  EXPECT_THAT(lines, HasSubstr("0x61626300"));
  EXPECT_THAT(lines, HasSubstr("ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"));
  mission::FileCopyStatus copy;
  copy.operations = 1;
  copy.operation = 4294967351;
  copy.direction = mission::FileDirection::up;
  copy.state = mission::FileCopyState::suspended;
  copy.octets = UINT64_MAX;
  copy.progress = 950;
  copy.file = "b";
  EXPECT_EQ(answer_lines(received(23, 23, copy.encoded())),
            "4294967351           up   suspended         950 of ? octets  b\n");
  EXPECT_EQ(answer_lines(received(23, 23, mission::FileCopyStatus{}.encoded())), "no copy is in progress\n");
  EXPECT_EQ(answer_lines(received(20, 2, *from_hex("00010065012c"))), "timing.late_tick_ms = 300 ms\n");
}

TEST(RemoteFiles, AnAnswerThatDoesNotFitIsShownAsOctets) {
  for (const char* hex : {"", "0001", "0002006500010001", "0001ffff00", "000100650100ff"}) {
    const TelemetryReport report = received(20, 2, *from_hex(hex));
    EXPECT_EQ(report.kind, TelemetryKind::other) << hex;
    EXPECT_NE(report.text, "") << hex;
  }
  EXPECT_EQ(received(23, 4, {1, 2}).kind, TelemetryKind::other);
}

TEST(NodeParameterNames, AreOneANodeOrAll) {
  const auto names = [](const std::vector<std::string>& words) {
    std::vector<std::string> found;
    const auto parameters = parameters_named(dictionary(), words);
    if (!parameters) return std::vector<std::string>{parameters.error()};
    for (const auto* parameter : *parameters) found.push_back(parameter->name);
    return found;
  };
  EXPECT_THAT(names({"timing.leap_seconds"}), ElementsAre("timing.leap_seconds"));
  EXPECT_THAT(names({"timing"}), testing::Contains("timing.late_tick_ms"));
  EXPECT_EQ(names({}).size(), dictionary().parameters().size());
  EXPECT_THAT(names({"timing.x"}).front(), HasSubstr("no node parameter is called 'timing.x'"));
  for (const auto& parameter : dictionary().parameters())
    EXPECT_THAT(to_line(parameter), HasSubstr(parameter.field.description));
}

TEST(KeepingCommand, NamesTheNodeAndAtRestoreTheGeneration) {
  const auto text = [](const std::string& action, const std::vector<std::string>& words) {
    const auto command = keeping_command(action, words);
    if (!command) return command.error();
    EXPECT_TRUE(dictionary().encode(command->name, command->arguments)) << action;
    std::string line = command->name;
    for (const std::string& argument : command->arguments) line += " " + argument;
    return line;
  };
  EXPECT_EQ(text("keep", {"ttc"}), "parameters.keep node=ttc");
  EXPECT_EQ(text("confirm", {"ttc"}), "parameters.confirm node=ttc");
  EXPECT_EQ(text("history", {"ttc"}), "parameters.history node=ttc");
  EXPECT_EQ(text("reset", {"ttc"}), "parameters.factory_reset node=ttc");
  EXPECT_EQ(text("restore", {"ttc", "7"}), "parameters.restore node=ttc generation=7");
  EXPECT_EQ(text("restore", {"ttc"}), "expected param restore NODE GENERATION");
  EXPECT_EQ(text("keep", {}), "expected param keep NODE");
  EXPECT_EQ(text("reset", {"ttc", "timing"}), "expected param reset NODE");
}

}  // namespace
}  // namespace srfs::ground
