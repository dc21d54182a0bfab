// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/screen/completion.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ground/command_line.hpp"

namespace srfs::ground::screen {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

const mission::Dictionary& dictionary() {
  static const auto loaded = mission::Dictionary::load(mission::Dictionary::default_folder());
  return loaded;
}

Completion after(const std::string& line) {
  return complete(line, dictionary(), {"limits", "eps", "all"});
}

TEST(Completion, IsOfVerbsTelecommandsArgumentsAndValues) {
  EXPECT_THAT(after("re").candidates, ElementsAre("resume", "retrieve"));
  EXPECT_EQ(after("ret").text, "retrieve ");
  EXPECT_THAT(after("tc eps.sw").candidates, ElementsAre("eps.switch_load"));
  EXPECT_EQ(after("tc eps.sw").text, "eps.switch_load ");
  EXPECT_EQ(after("tc eps.sw").begin, 3U);
  EXPECT_THAT(after("tc eps.switch_load ").candidates, ElementsAre("load=", "state="));
  EXPECT_THAT(after("tc eps.switch_load load=2 ").candidates, ElementsAre("state="));
  EXPECT_EQ(after("tc eps.switch_load load=2 st").text, "state=");
  EXPECT_THAT(after("tc eps.switch_load load=2 state=").candidates, Contains("state=on"));
  EXPECT_THAT(after("tc eps.switch_load --").candidates, ElementsAre("--at", "--timeout"));
  EXPECT_THAT(after("tc housekeeping.one_shot structure=heal").candidates, ElementsAre("structure=health"));
  EXPECT_THAT(after("view ").candidates, ElementsAre("all", "eps", "limits"));
}

TEST(Completion, OfWhatNobodyKnowsIsEmpty) {
  for (const char* line : {"xyz", "tc nothing.here ", "tc eps.switch_load nothing=", "view eps ", "quit now"})
    EXPECT_THAT(after(line).candidates, IsEmpty()) << line;
  EXPECT_EQ(after("xyz").text, "xyz") << "the word stays";
}

TEST(Completion, OfAWholeWordBeginsWithIt) {
  for (const auto& command : dictionary().commands()) {
    const auto found = after("tc " + command.name.substr(0, command.name.size() - 1));
    EXPECT_THAT(found.candidates, Contains(command.name));
    EXPECT_TRUE(found.text.starts_with(command.name.substr(0, command.name.size() - 1)));
  }
}

TEST(CommandLine, IsReadAsWrittenOrRefused) {
  using Kind = CommandLine::Kind;
  const auto telecommand =
      parse_command_line("tc eps.switch_load load=2 state=on --timeout 5 --at +30s --wait");
  ASSERT_TRUE(telecommand) << telecommand.error();
  EXPECT_EQ(telecommand->kind, Kind::telecommand);
  EXPECT_EQ(telecommand->telecommand.name, "eps.switch_load");
  EXPECT_THAT(telecommand->telecommand.arguments, ElementsAre("load=2", "state=on"));
  EXPECT_EQ(telecommand->timeout, seconds(5));
  EXPECT_EQ(telecommand->at->after, seconds(30));
  EXPECT_EQ(parse_command_line("arm a.b x=1")->kind, Kind::arming);
  EXPECT_EQ(parse_command_line("ping")->telecommand.name, "ttc.ping");
  EXPECT_EQ(parse_command_line("ad off")->kind, Kind::ad_off);
  EXPECT_EQ(parse_command_line("setvr 7")->vr, 7);
  EXPECT_EQ(parse_command_line("put /tmp/a.bin")->name, "a.bin");
  EXPECT_EQ(parse_command_line("cancel 1:17")->transfer, (cfdp::TransactionId{1, 17}));
  EXPECT_THAT(parse_command_line("retrieve A B")->telecommand.arguments,
              ElementsAre("store=housekeeping", "from=A", "to=B"));
  for (const char* nothing : {"", "   ", "# a comment"})
    EXPECT_EQ(parse_command_line(nothing)->kind, Kind::nothing);
  for (const char* wrong :
       {"tc", "arm", "ping now", "ad", "ad maybe", "setvr 256", "setvr x", "put", "cancel 1", "retrieve A",
        "quit now", "xyz", "tc a.b --at yesterday", "tc a.b --timeout x"})
    EXPECT_FALSE(parse_command_line(wrong)) << wrong;
}

}  // namespace
}  // namespace srfs::ground::screen
