// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/added_nodes.hpp"

#include <gtest/gtest.h>

namespace srfs {
namespace {

class AddedNodesOfTtc : public testing::Test {
 protected:
  using Names = std::vector<std::string>;
  using Ids = std::vector<std::uint16_t>;
  static constexpr const char* impact = "payload_impact";
  static constexpr std::uint16_t impact_structure = 1019;

  static mission::Fragment fragment() {
    const auto text =
        read_file(std::string(SRFS_SOURCE_DIR) + "/examples/payload_impact/dictionary.yaml", 32'768);
    return {impact, text.value_or("")};
  }
  static Ids events_of(AddedNodes& added) {
    Ids ids;
    for (const RaiseEvent& event : added.take_events()) ids.push_back(event.event_id);
    return ids;
  }
  static std::unique_ptr<TtcCore> make_core(const AddedNodes& added) {
    return std::make_unique<TtcCore>(
        TtcCore::Setup{.dictionary = added.dictionary(),
                       .node = "ttc",
                       .journal = AcceptanceJournal("boot", seconds(60)),
                       .uplink = {},
                       .downlink = {},
                       .mode = ModeManager(StoredModeState::first_start, "", MissionMode::safe),
                       .transmitter = TransmitterSwitch("boot", "", {}),
                       .command_loss = CommandLossTimer("boot", "", seconds(259'200), {}),
                       .stores = "",
                       .keys = {},
                       .boot = {},
                       .clock = SpacecraftClock(UtcTime(seconds(1'795'000'000)), {})});
  }
};

TEST_F(AddedNodesOfTtc, ReportsWhoJoinedAndWhoLeft) {
  AddedNodes added({.revision = 1, .names = {impact}, .fragments = {fragment()}});
  const auto at_start = added.follow({impact}, false);
  EXPECT_EQ(at_start.joined, Names{impact});
  EXPECT_TRUE(added.take_events().empty()) << "it was there at the start";

  const auto with_other = added.follow({impact, "other"}, true);
  EXPECT_EQ(with_other.joined, Names{"other"});
  EXPECT_EQ(events_of(added), Ids{mission::event::suite_node_joined});

  const auto alone = added.follow({"other"}, true);
  EXPECT_EQ(alone.left, Names{impact});
  EXPECT_EQ(events_of(added), Ids{mission::event::suite_node_left});
}

TEST_F(AddedNodesOfTtc, ANodeThatGetsItsApplicationProcessJoinsAnew) {
  AddedNodes added({});
  const auto core = make_core(added);
  static_cast<void>(added.follow({impact}, true));
  added.on_loaded(AddedNodes::load({fragment()}), 1, *core, {});
  const auto changes = added.follow({impact}, true);
  EXPECT_EQ(changes.left, Names{impact});
  EXPECT_EQ(changes.joined, Names{impact});
  EXPECT_EQ(added.housekeeping(1, {})->node_apid[0], 19);
}

TEST_F(AddedNodesOfTtc, AFragmentBringsItsStructuresAndTakesThemAwayAgain) {
  AddedNodes added({});
  const auto core = make_core(added);
  core->add_reports();
  EXPECT_FALSE(core->housekeeping().plan(impact_structure));
  EXPECT_TRUE(added.wants_load(1));
  added.on_load_begun();
  EXPECT_FALSE(added.wants_load(2)) << "one at a time";
  added.on_loaded(AddedNodes::load({fragment()}), 1, *core, {});
  EXPECT_FALSE(added.wants_load(1));
  EXPECT_TRUE(core->housekeeping().plan(impact_structure));
  EXPECT_TRUE(core->events().knows(mission::event::ttc_retrieval_done));

  added.on_loaded(AddedNodes::load({}), 2, *core, {});
  EXPECT_FALSE(core->housekeeping().plan(impact_structure));
}

TEST_F(AddedNodesOfTtc, AFragmentThatDoesNotFitIsReportedAndTheDictionaryGoesOnWithoutIt) {
  AddedNodes added({.revision = 1, .names = {impact}, .fragments = {{impact, "no dictionary"}}});
  EXPECT_NE(added.dictionary().command("ttc.ping"), nullptr);
  added.report_refused();
  added.report_refused();
  EXPECT_EQ(events_of(added), Ids{mission::event::suite_fragment_refused}) << "once";
}

TEST_F(AddedNodesOfTtc, AStateIsForgottenWithItsProcess) {
  AddedNodes added({});
  EXPECT_FALSE(added.housekeeping(0, {})) << "there are none";
  static_cast<void>(added.follow({impact}, false));
  const auto state = [&] { return added.housekeeping(1, {})->node_state[0]; };
  EXPECT_EQ(state(), mission::LifecycleState::absent);
  added.on_facts(impact, {true, 3, ""});
  EXPECT_EQ(state(), mission::LifecycleState::transition);
  EXPECT_EQ(added.nodes_to_ask(), Names{impact});
  added.on_lifecycle(impact, 3);
  EXPECT_EQ(state(), mission::LifecycleState::active);
  EXPECT_TRUE(added.nodes_to_ask().empty());

  added.on_facts(impact, {false, 3, ""});
  added.on_facts(impact, {true, 4, ""});
  EXPECT_EQ(state(), mission::LifecycleState::transition);
  EXPECT_EQ(added.housekeeping(1, {})->node_restarts[0], 4);
}

TEST_F(AddedNodesOfTtc, AChangeWaitsWhileTooManyReplacedDictionariesAreKept) {
  AddedNodes added({});
  const auto core = make_core(added);
  std::uint32_t revision = 1;
  for (; added.wants_load(revision); ++revision) added.on_loaded(AddedNodes::load({}), revision, *core, {});
  EXPECT_EQ(revision, 9U);
  static_cast<void>(added.housekeeping(revision, MonotonicTime(std::chrono::hours(1))));
  EXPECT_TRUE(added.wants_load(revision)) << "nothing points into them any more";
}

}  // namespace
}  // namespace srfs
