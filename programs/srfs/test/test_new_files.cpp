// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/new_files.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>

namespace srfs::tool {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const std::string mission_folder = SRFS_SOURCE_DIR "/mission";

mission::Fragment fragment(const std::string& node, const NewNumbers& numbers) {
  return {node,
          fmt::format(
              "subsystem: {0}\napids:\n  - {{ name: {0}, apid: {1}, node: {0}, description: d }}\n"
              "events:\n  - {{ name: {0}.seen, id: {2}, severity: info, text: t }}\n"
              "commands:\n  - {{ name: x{0}.go, node: {0}, function: 1, description: d, repeat: by_id }}\n",
              node, numbers.apid, numbers.event)};
}

TEST(NewName, IsLowerCaseWordsJoinedByUnderscores) {
  EXPECT_EQ(refusal_of_new_name("star_tracker"), "");
  EXPECT_EQ(refusal_of_new_name("gps2"), "");
  for (const char* bad : {"", "Star", "star-tracker", "_star", "star_", "star__tracker", "2star",
                          "star tracker", "../star", "st\xC3\xA4r"})
    EXPECT_NE(refusal_of_new_name(bad), "") << bad;
  EXPECT_NE(refusal_of_new_name(std::string(longest_new_name + 1, 'a')), "");
}

TEST(NewName, IsNoWordOfTheLanguageAndNoneOfTheFiles) {
  for (const char* bad : {"class", "namespace", "xor", "bitand", "nullptr", "constexpr", "co_await",
                          "char8_t", "linux", "test", "build", "main", "srfs"})
    EXPECT_THAT(refusal_of_new_name(bad), HasSubstr("reserved")) << bad;
}

TEST(DeclaresType, SeesEachKindOfTypeInTheNamespacesOfNewClasses) {
  const std::string header =
      "namespace srfs {\nnamespace detail {\nclass Hidden {};\n}  // namespace detail\n"
      "class [[nodiscard]] Frame {\n  struct Inner {};\n};\nstruct Stage;\nenum class Mode : int { a };\n"
      "using Octets = int;\n}  // namespace srfs\nnamespace srfs::sim {\nclass Model;\n}  // namespace "
      "srfs::sim\n"
      "namespace srfs::hw {\nclass Camera;\n}  // namespace srfs::hw\n";
  for (const char* type : {"Frame", "Stage", "Mode", "Octets", "Model"})
    EXPECT_TRUE(declares_type(header, type, TypeScope::srfs)) << type;
  for (const char* type : {"Hidden", "Inner", "Camera", "Fram", "Frames", "Sta"})
    EXPECT_FALSE(declares_type(header, type, TypeScope::srfs)) << type;
}

TEST(DeclaresType, SeesThoseInsideOfClassesWhenAllCount) {
  const std::string text = "class @Name@ {\n  using Commands = CommandSet<>;\n};";
  EXPECT_TRUE(declares_type(text, "Commands", TypeScope::any));
  EXPECT_FALSE(declares_type(text, "Commands", TypeScope::srfs));
  EXPECT_FALSE(declares_type(text, "CommandSet", TypeScope::any));
}

TEST(Camel, IsTheNameOfTheGeneratedStruct) {
  EXPECT_EQ(camel("eps.switch_load"), "EpsSwitchLoad");
  EXPECT_EQ(camel("gps2"), "Gps2");
}

TEST(NewNumbers, AreFreeInTheDictionaryAndInItsFragments) {
  const auto first = free_numbers(mission::Dictionary::load(mission_folder));
  ASSERT_TRUE(first);
  const auto second = free_numbers(mission::Dictionary::load(mission_folder, {fragment("one", *first)}));
  ASSERT_TRUE(second);

  EXPECT_EQ(first->structure, 1000 + first->apid);
  EXPECT_EQ(first->event, 100 * first->apid + 1);
  EXPECT_GT(second->apid, first->apid);
  const auto both =
      mission::Dictionary::load(mission_folder, {fragment("one", *first), fragment("two", *second)});
  EXPECT_EQ(both.apid_of_node("two")->apid, second->apid);
}

TEST(NewNumbers, AnEventInTheMiddleOfItsRangeMakesAnApidTaken) {
  const auto first = free_numbers(mission::Dictionary::load(mission_folder));
  NewNumbers other = *first;
  other.apid = 2000;
  other.event = static_cast<std::uint16_t>(first->event + 5);

  const auto second = free_numbers(mission::Dictionary::load(mission_folder, {fragment("one", other)}));

  EXPECT_GT(second->apid, first->apid);
}

TEST(Filled, ReplacesEachPlaceholderAndNothingElse) {
  const Placeholders values{{"name", "star"}, {"Name", "Star"}};
  EXPECT_EQ(filled("@name@/@Name@.hpp", values).value(), "star/Star.hpp");
  EXPECT_EQ(filled("a@example.org, @ @@name@", values).value(), "a@example.org, @ @star");
  EXPECT_EQ(filled("@other@", values).error(), "other");
}

struct WithCommand : ::testing::Test {
  CommandedFolder folder{
      .dictionary =
          "subsystem: x\n\ncommands:\n  - name: x.go\n    function: 1\n\nevents:\n  - { name: x.seen }\n",
      .header = {"x.hpp",
                 "class X {\n  using Commands = CommandSet<mission::XGo>;\n"
                 "  FailureCode execute(const mission::XGo& command);\n  int a_;\n};\n"},
      .source = {"x.cpp", "namespace srfs {\n}  // namespace srfs\n"},
      .test = {"test_x.cpp", "namespace {\n}  // namespace\n}  // namespace srfs\n"}};
  CommandTexts texts{.name = "stop",
                     .structure = "XStop",
                     .dictionary = "  - name: x.stop\n",
                     .declaration = "  DECLARATION\n",
                     .member = "  MEMBER\n",
                     .definition = "DEFINITION\n",
                     .test = "TEST\n"};
};

TEST_F(WithCommand, PutsEachPartBehindWhatIsThere) {
  const auto changed = with_command(folder, texts);

  ASSERT_TRUE(changed) << changed.error();
  EXPECT_EQ(changed->dictionary,
            "subsystem: x\n\ncommands:\n  - name: x.go\n    function: 1\n  - name: x.stop\n\nevents:\n"
            "  - { name: x.seen }\n");
  EXPECT_EQ(changed->header.text,
            "class X {\n  using Commands = CommandSet<mission::XGo, mission::XStop>;\n"
            "  FailureCode execute(const mission::XGo& command);\n  DECLARATION\n  int a_;\n  MEMBER\n};\n");
  EXPECT_EQ(changed->source.text, "namespace srfs {\nDEFINITION\n}  // namespace srfs\n");
  EXPECT_EQ(changed->test.text, "namespace {\nTEST\n}  // namespace\n}  // namespace srfs\n");
}

TEST_F(WithCommand, MakesTheListOfCommandsWhenThereIsNone) {
  folder.dictionary = "subsystem: x\nevents: []\n";
  EXPECT_EQ(with_command(folder, texts)->dictionary,
            "subsystem: x\nevents: []\n\ncommands:\n  - name: x.stop\n");
  folder.dictionary = "subsystem: x\ncommands:\n  - name: x.go";
  EXPECT_EQ(with_command(folder, texts)->dictionary,
            "subsystem: x\ncommands:\n  - name: x.go\n  - name: x.stop\n");
}

TEST_F(WithCommand, NamesTheFileThatHasNoPlaceForIt) {
  auto other = folder;
  other.header.text = "class X {};\n";
  EXPECT_THAT(with_command(other, texts).error(), HasSubstr("x.hpp"));
  other = folder;
  other.source.text = "";
  EXPECT_THAT(with_command(other, texts).error(), HasSubstr("x.cpp"));
  other = folder;
  other.test.text = "";
  EXPECT_THAT(with_command(other, texts).error(), HasSubstr("test_x.cpp"));
}

TEST_F(WithCommand, RefusesANameThatIsAFunctionOfTheClass) {
  texts.name = "execute";
  EXPECT_THAT(with_command(folder, texts).error(), HasSubstr("another name"));
}

TEST_F(WithCommand, RefusesANameWhoseMemberTheClassHas) {
  texts.name = "a";  // int a_
  EXPECT_THAT(with_command(folder, texts).error(), HasSubstr("member 'a_'"));
  texts.name = "_a";
  EXPECT_TRUE(with_command(folder, texts)) << "a part of a word is another word";
}

struct WithPeripheralCommand : ::testing::Test {
  CommandedPayload folder{
      .dictionary = "subsystem: x\ncommands:\n  - name: x.go\n",
      .profile = {"x_profile.cpp",
                  "  switch (function) {\n    case 1:\n    default:\n      return 0;\n  }\n"},
      .model = {"x_model.cpp",
                "class M {\n    switch (function) {\n      default:\n        return 0;\n    }\n\n private:\n"
                "  int a_;\n};\n"},
      .test = {"test_x.cpp", "namespace {\n}  // namespace\n}  // namespace srfs\n"}};
  PeripheralCommandTexts texts{.name = "stop",
                               .dictionary = "  - name: x.stop\n",
                               .profile_case = "    case 2:\n",
                               .model_case = "      case 3:\n",
                               .handler = "  HANDLER\n",
                               .member = "  MEMBER\n",
                               .test = "TEST\n"};
};

TEST_F(WithPeripheralCommand, PutsEachPartWhereItsKindIs) {
  const auto changed = with_peripheral_command(folder, texts);

  ASSERT_TRUE(changed) << changed.error();
  EXPECT_EQ(changed->dictionary, "subsystem: x\ncommands:\n  - name: x.go\n  - name: x.stop\n");
  EXPECT_EQ(changed->profile.text,
            "  switch (function) {\n    case 1:\n    case 2:\n    default:\n      return 0;\n  }\n");
  EXPECT_EQ(changed->model.text,
            "class M {\n    switch (function) {\n      case 3:\n      default:\n        return 0;\n    }\n\n"
            " private:\n  HANDLER\n  int a_;\n  MEMBER\n};\n");
  EXPECT_EQ(changed->test.text, "namespace {\nTEST\n}  // namespace\n}  // namespace srfs\n");
}

TEST_F(WithPeripheralCommand, LeavesOtherClassesOfTheModelAlone) {
  const std::string other = "class Frames {\n private:\n  int what_;\n};\n";
  folder.model.text = other + folder.model.text;
  EXPECT_TRUE(with_peripheral_command(folder, texts)->model.text.starts_with(other));
}

TEST_F(WithPeripheralCommand, NamesTheFileThatHasNoPlaceForIt) {
  auto other = folder;
  other.profile.text = "  if (function == 1) return 0;\n";
  EXPECT_THAT(with_peripheral_command(other, texts).error(),
              AllOf(HasSubstr("x_profile.cpp"), HasSubstr("switch (function)")));
  other = folder;
  other.model.text = "  if (function == 1) return 0;\n";
  EXPECT_THAT(with_peripheral_command(other, texts).error(), HasSubstr("x_model.cpp"));
  other.model.text = "struct M {\n  switch (function) {\n  default:\n  }\n};\n";
  EXPECT_THAT(with_peripheral_command(other, texts).error(), HasSubstr("private"));
  other = folder;
  other.test.text = "";
  EXPECT_THAT(with_peripheral_command(other, texts).error(), HasSubstr("test_x.cpp"));
}

TEST_F(WithPeripheralCommand, RefusesANameWhoseMemberTheModelHas) {
  texts.name = "a";
  EXPECT_THAT(with_peripheral_command(folder, texts).error(), HasSubstr("member 'a_'"));
}

struct WithPayload : ::testing::Test {
  MissionFolder mission{
      .build = {"CMakeLists.txt", "project(x)\nsrfs_add_simulator(hw_sim MODELS)\n"},
      .dictionary = {"mission.yaml", "subsystem: x\npayloads: []  # in slot order\ninclude: []\n"},
      .deployment = {"sim.yaml",
                     "deployment: x\nslots:  # plan\n\nring: {}\n\nnodes:\n  - { name: ttc }\n\n"
                     "simulation: {}\n"}};
};

TEST_F(WithPayload, IsTheLastInEachList) {
  const auto one = with_payload(mission, "payload_a", {.can_address = 0x21, .power_line = 0});
  ASSERT_TRUE(one) << one.error();
  const auto two = with_payload(*one, "payload_b", {.can_address = 0x22, .power_line = 1});
  ASSERT_TRUE(two) << two.error();

  EXPECT_EQ(two->build.text,
            "project(x)\nadd_subdirectory(payload_a)\nadd_subdirectory(payload_b)\n"
            "srfs_add_simulator(hw_sim MODELS payload_a payload_b)\n");
  EXPECT_EQ(two->dictionary.text,
            "subsystem: x\npayloads: [payload_a, payload_b]  # in slot order\n"
            "include: [payload_a/dictionary.yaml, payload_b/dictionary.yaml]\n");
  EXPECT_EQ(two->deployment.text,
            "deployment: x\nslots:  # plan\n"
            "  - { payload: payload_a, allotted_ms: 60, overrun_ms: 20, reset_ms: 40 }\n"
            "  - { payload: payload_b, allotted_ms: 60, overrun_ms: 20, reset_ms: 40 }\n\nring: {}\n\n"
            "nodes:\n  - { name: ttc }\n"
            "  - name: payload_a\n    executable: payload_a_node\n    peripheral: { can_address: 0x21, "
            "power_line: 0 }\n"
            "    memory_limit_mib: 256\n"
            "  - name: payload_b\n    executable: payload_b_node\n    peripheral: { can_address: 0x22, "
            "power_line: 1 }\n"
            "    memory_limit_mib: 256\n\nsimulation: {}\n");
}

TEST_F(WithPayload, NamesTheFileThatHasNoPlaceForIt) {
  auto other = mission;
  other.build.text = "project(x)\n";
  EXPECT_THAT(with_payload(other, "payload_a", {}).error(), HasSubstr("CMakeLists.txt"));
  other = mission;
  other.dictionary.text = "subsystem: x\npayloads: []\n";
  EXPECT_THAT(with_payload(other, "payload_a", {}).error(), HasSubstr("mission.yaml: no 'include"));
}

TEST(FreePlace, IsTheLowestAddressAndLineThatNoPeripheralHas) {
  EXPECT_EQ(free_place({})->can_address, 0x21);
  const auto place =
      free_place({{.can_address = 0x21, .power_line = 1}, {.can_address = 0x22, .power_line = 0}});
  EXPECT_EQ(place->can_address, 0x23);
  EXPECT_EQ(place->power_line, 2);
  std::vector<PeripheralPlace> all;
  for (int line = 0; line < 8; ++line) all.push_back({.can_address = 0x40 + line, .power_line = line});
  EXPECT_THAT(free_place(all).error(), HasSubstr("taken"));
}

TEST(FreeFunction, IsTheLowestThatTheNodeDoesNotHave) {
  const auto dictionary =
      mission::Dictionary::load(mission_folder, {fragment("one", {.apid = 99, .event = 9901})});
  EXPECT_EQ(free_function(dictionary, "one"), 2);
  EXPECT_EQ(prefix_of(dictionary, "one"), "xone");
  EXPECT_EQ(prefix_of(dictionary, "no_such_node"), "no_such_node");
}

TEST(FreePeripheralFunction, IsTheLowestThatThePeripheralDoesNotHave) {
  const auto dictionary = mission::Dictionary::load(mission_folder);
  const std::uint8_t free = free_peripheral_function(dictionary, "payload_eps");
  for (const mission::Command& command : dictionary.commands()) {
    EXPECT_FALSE(command.node == "payload_eps" && command.peripheral_function == free) << command.name;
  }
  EXPECT_GT(free, 1);
  EXPECT_EQ(free_peripheral_function(dictionary, "no_such_node"), 1);
}

}  // namespace
}  // namespace srfs::tool
