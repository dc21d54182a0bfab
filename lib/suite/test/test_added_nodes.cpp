// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/added_nodes.hpp"

#include <cstdlib>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/file.hpp"
#include "msgs/mission/dictionary.hpp"
#include "suite/node_addition.hpp"
#include "suite/node_versions.hpp"
#include "suite/ring/membership.hpp"

namespace srfs::suite {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr const char* deployment_text =
    "deployment: t\n"
    "devices: {can: \"sim:can\"}\n"
    "ring: {members: [a, b, c]}\n"
    "slots:\n"
    "  - {payload: b, allotted_ms: 60, overrun_ms: 20, reset_ms: 40}\n"
    "  - {payload: c, allotted_ms: 60, overrun_ms: 20, reset_ms: 40}\n"
    "nodes:\n"
    "  - {name: a, executable: x}\n  - {name: b, executable: x}\n  - {name: c, executable: x}\n";

constexpr const char* after_b = "{slot: {after: b, allotted_ms: 30, overrun_ms: 10, reset_ms: 20}}";

const char* const fragment_text = R"(
apids: [{ name: extra, apid: 99, node: extra }]
structures:
  - { name: extra_values, id: 2099, node: extra, interval_ms: 1000, fields: [{ name: value, type: u8 }] }
)";

class AddedNodesTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (std::filesystem::temp_directory_path() / "srfs_added_XXXXXX").string();
    var_.root = mkdtemp(pattern.data());
    file_ = var_.root / "d.yaml";
    ASSERT_TRUE(write_file_atomically(file_, deployment_text));
  }
  void TearDown() override { std::filesystem::remove_all(var_.root); }

  [[nodiscard]] Deployment deployment() const { return Deployment::load(file_); }
  [[nodiscard]] Deployment with(std::vector<AddedNode> nodes) const {
    return with_added(deployment(), {1, std::move(nodes)}).deployment;
  }
  void store_program(const std::string& node) const {
    const auto program = var_.root / "program";
    ASSERT_TRUE(write_file_atomically(program, "#!/bin/sh\n"));
    const auto stored =
        change_versions(var_, node, [&](update::VersionStore& store) -> Result<void, std::string> {
          const auto number = store.add(program, "a test", {});
          if (!number) return Err(number.error());
          if (const auto used = store.use(*number, {}, ""); !used) return used;
          return store.commit(*number);
        });
    ASSERT_TRUE(stored) << stored.error();
  }
  Result<void, std::string> add(const AddedNode& node) const {
    return add_node(var_, deployment(), node, mission::Dictionary::default_folder());
  }
  [[nodiscard]] std::string refusal(const AddedNode& node) const {
    const auto added = add(node);
    return added ? "it was added" : added.error();
  }
  [[nodiscard]] AddedNodes list() const { return read_added_nodes(var_).added; }

  VarPaths var_;
  std::filesystem::path file_;
  const AddedNode extra_{"extra", "b", after_b, fragment_text};
};

TEST_F(AddedNodesTest, AreReadAsTheyWereWrittenAndNoDamageIsTakenForThem) {
  const AddedNodes added{
      7, {{"one", "a", "{}", "text: \"quoted\" \\ \t\x01\n\xC3\xA4", 3, "{after: b}"}, {"two", "", "", ""}}};
  const std::string text = to_text(added);
  const auto read = added_nodes_from_text(text);
  ASSERT_TRUE(read) << read.error();
  EXPECT_EQ(*read, added);
  for (std::size_t i = 0; i < text.size(); ++i) {
    std::string flipped = text;
    flipped[i] = static_cast<char>(flipped[i] ^ 4);
    EXPECT_FALSE(added_nodes_from_text(flipped)) << i;
    EXPECT_FALSE(added_nodes_from_text(text.substr(0, i))) << i;
  }
}

TEST_F(AddedNodesTest, StandInTheDeploymentWithEntrySlotAndDevices) {
  AddedNode node = extra_;
  node.flag = 3;
  node.description =
      "{\"memory_limit_mib\": 64, \"parameters\": {\"p\": 1}, \"devices\": {\"plate\": \"sim:x\"}, "
      "\"slot\": {\"after\": \"b\", \"allotted_ms\": 30, \"overrun_ms\": 10, \"reset_ms\": 20}}";
  const Deployment d = with({node});

  const NodeEntry* entry = d.find("extra");
  ASSERT_NE(entry, nullptr);
  EXPECT_TRUE(entry->added);
  EXPECT_EQ(entry->memory_limit_mib, 64);
  EXPECT_EQ(entry->worker_deadline, d.ring.worker_deadline);
  EXPECT_FALSE(d.find("a")->added);
  EXPECT_EQ(d.devices.at("plate"), "sim:x");
  ASSERT_THAT(d.buses.front().slots, SizeIs(4));
  EXPECT_EQ(d.buses.front().slots[2].payload, "") << "a position that nobody has";
  EXPECT_EQ(d.buses.front().slots[3].payload, "extra");
  EXPECT_THAT(turns_of(d.buses.front().slots), ElementsAre("b", "extra", "c"));
}

TEST_F(AddedNodesTest, BringThePlaceOfTheirPeripheralThatMayBeOnTheBusBefore) {
  const auto problem = [](const DeploymentReading& reading) {
    return reading.problems.empty() ? std::string() : reading.problems.front();
  };
  const AddedNode extra{"extra", "", "peripheral: {can_address: 0x14, power_line: 3}\n", ""};
  const std::string listed = "peripherals: [{payload: extra, can_address: 0x14, power_line: 3}]\n";
  const auto file_with = [&](const std::string& more) {
    EXPECT_TRUE(write_file_atomically(file_, deployment_text + more));
    return with_added(deployment(), {1, {extra}});
  };
  for (const std::string& more : {std::string(), listed}) {
    const DeploymentReading reading = file_with(more);
    EXPECT_EQ(problem(reading), "");
    EXPECT_EQ(reading.deployment.peripherals, (std::vector<Peripheral>{{"extra", 0x14, 3}}));
  }
  EXPECT_THAT(problem(file_with("peripherals: [{payload: extra, can_address: 0x15, power_line: 3}]\n")),
              HasSubstr("at CAN address 0x15, power line 3"));
  EXPECT_THAT(problem(file_with("peripherals: [{payload: other, can_address: 0x14, power_line: 2}]\n")),
              HasSubstr("CAN address 0x14 is that of other and of extra"));
  // On a further bus it would have its turns on the first one.
  const std::string two_buses =
      "deployment: t\ndevices: {can: x, can_b: y}\nbuses: [{name: can_b, switcher: b}]\n"
      "nodes: [{name: a, executable: x}, {name: b, executable: x}]\n"
      "peripherals: [{payload: extra, bus: can_b, can_address: 0x14, power_line: 3}]\n";
  EXPECT_TRUE(write_file_atomically(file_, two_buses));
  EXPECT_THAT(problem(with_added(deployment(), {1, {AddedNode{"extra", "", "", ""}}})),
              HasSubstr("is on the bus 'can'"));
}

TEST_F(AddedNodesTest, MayHaveTheirSlotApartFromTheirEntry) {
  AddedNode node{"extra", "", "name: extra\nexecutable: any\n", "", std::size_t{2}};
  node.slot = slot_text({"extra", milliseconds(30), milliseconds(10), milliseconds(20), "b"});
  const Deployment d = with({node});
  ASSERT_THAT(d.buses.front().slots, SizeIs(3));
  EXPECT_EQ(d.buses.front().slots[2].allotted, milliseconds(30));
  EXPECT_EQ(d.buses.front().slots[2].reset, milliseconds(20));
  EXPECT_THAT(turns_of(d.buses.front().slots), ElementsAre("b", "extra", "c"));
  EXPECT_EQ(d.find("extra")->executable, "");
  node.slot = "{payload: c, allotted_ms: 1, overrun_ms: 1, reset_ms: 1}";
  EXPECT_THAT(with_added(deployment(), {1, {node}}).problems, ElementsAre(HasSubstr("payload")));
}

TEST_F(AddedNodesTest, AreWhatTheirPackageSays) {
  update::Manifest manifest;
  manifest.node = "extra";
  manifest.kind = update::PackageKind::add;
  manifest.ring_after = "a";
  manifest.deployment = "{\"memory_limit_mib\": 64}";
  manifest.slot = update::SlotRequest{{}, milliseconds(30), milliseconds(0), milliseconds(20), "c"};
  AddedNode node = added_node_of(manifest, fragment_text);
  node.flag = 2;
  const Deployment d = with({node});
  EXPECT_EQ(d.find("extra")->memory_limit_mib, 64);
  EXPECT_THAT(turns_of(d.buses.front().slots), ElementsAre("b", "c", "extra"));
  EXPECT_EQ(node.ring_after, "a");
  EXPECT_EQ(node.dictionary, fragment_text);
}

TEST_F(AddedNodesTest, ThatDoNotFitAreLeftOutAndTheOthersStay) {
  AddedNode taken{"second", "", after_b, "", std::size_t{1}};
  const AddedNode same_name{"a", "", "{}", ""};
  const AddedNode bad_key{"third", "", "{colour: red}", ""};
  const AddedNode other_device{"fourth", "", "{devices: {can: \"sim:other\"}}", ""};
  const AddedNode fine{"fifth", "", "{}", ""};
  const auto reading = with_added(deployment(), {1, {taken, same_name, bad_key, other_device, fine}});

  EXPECT_THAT(reading.problems,
              ElementsAre(HasSubstr("flag 1 belongs to c"), HasSubstr("a node with this name"),
                          HasSubstr("colour"), HasSubstr("device 'can'")));
  EXPECT_THAT(reading.deployment.nodes, SizeIs(4));
  EXPECT_NE(reading.deployment.find("fifth"), nullptr);
  EXPECT_THAT(reading.deployment.buses.front().slots, SizeIs(2));
}

TEST_F(AddedNodesTest, AreMembersOfTheRingBehindWhoChecksThem) {
  const Deployment d =
      with_added(deployment(), {5, {{"x", "a", "{}", ""}, {"y", "", "{}", ""}, {"z", "gone", "{}", ""}}})
          .deployment;
  EXPECT_EQ(read_membership(var_, d).membership, (Membership{6, {"a", "x", "b", "c", "y", "z"}}));
  ASSERT_TRUE(write_membership(var_, {3, {"y", "c", "a"}}));
  EXPECT_EQ(read_membership(var_, d).membership, (Membership{8, {"y", "c", "a", "x", "z"}}))
      << "a place that is said stays";
}

TEST_F(AddedNodesTest, AreAddedOnceWithTheLowestFreeFlag) {
  store_program("extra");
  ASSERT_TRUE(add(extra_)) << refusal(extra_);
  EXPECT_EQ(list().revision, 1U);
  ASSERT_THAT(list().nodes, SizeIs(1));
  EXPECT_EQ(list().nodes[0].flag, 2U);

  EXPECT_TRUE(add(extra_)) << "exactly so already";
  EXPECT_EQ(list().revision, 1U);
  AddedNode other = extra_;
  other.ring_after = "c";
  EXPECT_THAT(refusal(other), HasSubstr("with different settings"));
}

TEST_F(AddedNodesTest, AreRefusedWithTheReasonAndNothingChanges) {
  EXPECT_THAT(refusal(extra_), HasSubstr("none of its versions is active"));
  store_program("extra");
  const auto changed = [&](auto change) {
    AddedNode node = extra_;
    change(node);
    return refusal(node);
  };
  EXPECT_THAT(changed([](AddedNode& n) { n.name = "Extra"; }), HasSubstr("name of 1-32 characters"));
  EXPECT_THAT(changed([](AddedNode& n) { n.name = "../extra"; }), HasSubstr("name of 1-32 characters"));
  EXPECT_THAT(changed([](AddedNode& n) { n.name = "a"; }), HasSubstr("a node with this name"));
  EXPECT_THAT(changed([](AddedNode& n) { n.ring_after = "nobody"; }), HasSubstr("no node 'nobody'"));
  EXPECT_THAT(changed([](AddedNode& n) { n.description = "{name: other}"; }), HasSubstr("name"));
  EXPECT_THAT(changed([](AddedNode& n) { n.description = "[]"; }), HasSubstr("mapping"));
  EXPECT_THAT(changed([](AddedNode& n) {
                n.description = "{slot: {after: a, allotted_ms: 1, overrun_ms: 1, reset_ms: 1}}";
              }),
              HasSubstr("'a' has no slot"));
  EXPECT_THAT(
      changed([](AddedNode& n) { n.description.resize(AddedNodes::description_octets_max + 1, ' '); }),
      HasSubstr("more than 4096 octets"));
  EXPECT_THAT(changed([](AddedNode& n) { n.dictionary = "apids: [{ name: extra, apid: 17, node: extra }]"; }),
              HasSubstr("APID 17 stands twice"));
  EXPECT_THAT(changed([](AddedNode& n) { n.dictionary = "apids: [{ name: other, apid: 99, node: other }]"; }),
              HasSubstr("describes other, not extra"));
  EXPECT_THAT(changed([](AddedNode& n) { n.dictionary = std::string("apids: \xFF"); }),
              testing::Not(IsEmpty()));
  EXPECT_EQ(list(), AddedNodes{});
  EXPECT_FALSE(std::filesystem::exists(added_nodes_file(var_)));

  const auto program = versions_folder(var_, "extra") / "extra.1";
  std::filesystem::permissions(program, std::filesystem::perms::owner_write,
                               std::filesystem::perm_options::add);
  ASSERT_TRUE(write_file_atomically(program, "#!/bin/bad\n"));
  EXPECT_THAT(refusal(extra_), HasSubstr("octets"));
}

TEST_F(AddedNodesTest, HaveABoundAndAFlagEach) {
  for (std::size_t i = 0; i <= AddedNodes::nodes_max; ++i) {
    const AddedNode node{"n" + std::to_string(i), "", "{slot: {allotted_ms: 1, overrun_ms: 1, reset_ms: 1}}",
                         ""};
    store_program(node.name);
    if (i < AddedNodes::nodes_max) {
      EXPECT_TRUE(add(node)) << i;
    } else {
      EXPECT_THAT(refusal(node), HasSubstr("8 nodes are added already"));
    }
  }
  ASSERT_TRUE(remove_node(var_, "n3"));
  ASSERT_TRUE(add({"n8", "", "{slot: {allotted_ms: 1, overrun_ms: 1, reset_ms: 1}}", ""}));
  EXPECT_EQ(list().find("n8")->flag, 5U) << "the place of n3";
  EXPECT_EQ(list().find("n7")->flag, 9U) << "the others keep theirs";
}

TEST_F(AddedNodesTest, AreRemovedWithTheirVersionsAndOthersCannotBe) {
  store_program("extra");
  ASSERT_TRUE(add(extra_));
  EXPECT_THAT(remove_node(var_, "a").error(), HasSubstr("not an added node"));
  ASSERT_TRUE(remove_node(var_, "extra"));
  EXPECT_EQ(list(), (AddedNodes{2, {}}));
  EXPECT_FALSE(std::filesystem::exists(versions_folder(var_, "extra")));
  EXPECT_FALSE(remove_node(var_, "extra"));
}

TEST_F(AddedNodesTest, OfADamagedFileAreNoneUntilOneIsAddedWhichSetsItAside) {
  ASSERT_TRUE(write_file_atomically(added_nodes_file(var_),
                                    "# Nodes that were added to the suite. Written by SRFS.\nrev"));
  const auto reading = load_deployment(file_, var_);
  EXPECT_THAT(reading.problems, ElementsAre(HasSubstr("cut off")));
  EXPECT_THAT(reading.deployment.nodes, SizeIs(3));
  EXPECT_FALSE(remove_node(var_, "extra"));
  store_program("extra");
  ASSERT_TRUE(add(extra_));
  EXPECT_THAT(load_deployment(file_, var_).problems, IsEmpty());
  EXPECT_TRUE(std::filesystem::exists(added_nodes_file(var_).string() + ".damaged"));
}

TEST_F(AddedNodesTest, ReachARunningProcessAndWhatItHasInHandStays) {
  LiveDeployment live(deployment(), var_);
  EXPECT_FALSE(live.refresh());
  const Deployment& before = live.current();
  store_program("extra");
  ASSERT_TRUE(add(extra_));
  EXPECT_EQ(&live.current(), &before) << "only refresh() changes it";
  ASSERT_TRUE(live.refresh());
  EXPECT_FALSE(live.refresh());
  const Deployment& after = live.current();
  EXPECT_NE(after.find("extra"), nullptr);
  EXPECT_EQ(before.find("extra"), nullptr);
  for (std::size_t i = 1; i < LiveDeployment::kept; ++i) {
    ASSERT_TRUE(i % 2 == 1 ? remove_node(var_, "extra") : (store_program("extra"), add(extra_)));
    ASSERT_TRUE(live.refresh());
    EXPECT_NE(after.find("extra"), nullptr) << i;
  }
  EXPECT_EQ(live.first().find("extra"), nullptr);
}

}  // namespace
}  // namespace srfs::suite
