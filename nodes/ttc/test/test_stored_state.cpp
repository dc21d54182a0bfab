// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/stored_state.hpp"

#include <gtest/gtest.h>

#include "tests/mission_dictionary.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

class StoredStates : public testing::Test {
 protected:
  /// A process starts: what it finds.
  TtcCore::Setup start() {
    const UtcTime utc_of_start(seconds(1'795'000'000));
    state_ = std::make_unique<StoredState>(folder_.path(), folder_.path() / "session");
    const bool ran = state_->ran_before(folder_.path() / "store");
    TtcCore::Setup setup{.dictionary = dictionary_,
                         .node = "ttc",
                         .journal = AcceptanceJournal("boot", seconds(60)),
                         .uplink = {},
                         .downlink = {},
                         .mode = state_->load_mode(MissionMode::nominal, ran),
                         .transmitter = state_->load_transmitter({}),
                         .command_loss = state_->load_command_loss(seconds(259'200), {}),
                         .stores = state_->load_stores(),
                         .keys = {},
                         .boot = {},
                         .clock = SpacecraftClock(utc_of_start, {})};
    state_->load_journal(setup, ran, 0, utc_of_start, {});
    return setup;
  }
  void lose(const char* name) { std::filesystem::remove(folder_.path() / name); }

  const testing_support::TemporaryFolder folder_;
  const mission::Dictionary& dictionary_ = testing_support::dictionary();
  std::unique_ptr<StoredState> state_;
};

TEST_F(StoredStates, AnOrderIntoRescueStandsInTheRecordOfTheStart) {
  const testing_support::TemporaryFolder state;
  const StoredState ttc(state.path() / "ttc", state.path() / "session");

  EXPECT_TRUE(ttc.write_rescue_entry());

  const auto record = suite::StepStore(state.path() / "boot").read();
  EXPECT_EQ(record.step, suite::BootStep::rescue);
  EXPECT_EQ(record.cause, suite::StepCause::commanded);
}

TEST_F(StoredStates, AFirstStartWantsAFloorUntilItIsForgotten) {
  const auto found = start();
  EXPECT_TRUE(found.first_start);
  EXPECT_EQ(found.floor, FloorWanted::first_start);
  EXPECT_EQ(found.mode.mode(), MissionMode::nominal) << "the deployment's";

  const auto after_a_kill = start();
  EXPECT_FALSE(after_a_kill.first_start) << "killed before, it has left a journal";
  EXPECT_EQ(after_a_kill.floor, FloorWanted::first_start);

  state_->forget_wanted_floor();
  EXPECT_EQ(start().floor, FloorWanted::no);
}

TEST_F(StoredStates, WithoutJournalAndCopyTheCountersAreLost) {
  static_cast<void>(start());
  state_->forget_wanted_floor();
  lose("telecommands.0");
  lose("telecommands.1");
  const auto next = start();
  EXPECT_FALSE(next.first_start);
  EXPECT_EQ(next.floor, FloorWanted::counters_lost);
  EXPECT_EQ(start().floor, FloorWanted::counters_lost) << "until they have a floor";
}

TEST_F(StoredStates, TheSecondHomeOfTheLinkStateHasTheCountersOfALostJournal) {
  static_cast<void>(start());
  state_->forget_wanted_floor();
  LinkState link;
  link.generation = 7;
  link.next_telecommand_id = 4711;
  state_->copy_link_state(link);
  lose("telecommands.0");
  lose("telecommands.1");
  const auto next = start();
  EXPECT_EQ(next.floor, FloorWanted::no);
  EXPECT_EQ(next.copied_generation, 7U);
  EXPECT_EQ(next.journal.link().generation, 7U);
  EXPECT_GE(next.journal.next_id(), 4711U);
}

TEST_F(StoredStates, AModeThatIsMissingIsSafe) {
  auto setup = start();
  ASSERT_TRUE(state_->write("mode", setup.mode.change(MissionMode::nominal, {.reason = "commanded"})));
  EXPECT_EQ(start().mode.mode(), MissionMode::nominal);
  LinkState link;
  link.generation = 1;
  state_->copy_link_state(link);
  lose("mode");
  EXPECT_EQ(start().mode.mode(), MissionMode::safe);
}

UplinkConfig secured_channel(bool contingency) {
  UplinkConfig config;
  config.channels.push_back({.vc = 0, .associations = {}});
  config.channels[0].associations.push_back({.spi = 1, .key = wire::SdlsKey({1}), .set = KeySet::a});
  if (contingency)
    config.channels[0].associations.push_back({.spi = 5, .key = wire::SdlsKey({5}), .set = std::nullopt});
  return config;
}

TEST_F(StoredStates, SessionKeysTakeThePlaceOfTheFiles) {
  static_cast<void>(start());
  UplinkConfig config = secured_channel(true);
  const wire::SdlsKey fresh({7});
  const auto keys = wire::SessionKeys{}.uploaded(128, fresh)->activated(128)->rekeyed(1, 128);
  ASSERT_TRUE(state_->write_session_keys(keys->confirmed(1, 128)));
  EXPECT_TRUE(state_->load_session_keys(config).lost.empty());
  EXPECT_EQ(config.channels[0].associations[0].key.octets(), fresh.octets());
  EXPECT_EQ(config.channels[0].associations[1].key.octets(), wire::SdlsKey({5}).octets());
}

TEST_F(StoredStates, AfterTheLossOfAllSessionKeysTheContingencyKeyIsTakenAlone) {
  static_cast<void>(start());
  ASSERT_TRUE(state_->write_session_keys(*wire::SessionKeys{}.uploaded(128, wire::SdlsKey({7}))));
  for (const char* copy : {"session_keys.0", "session_keys.1"})
    std::filesystem::resize_file(folder_.path() / "session" / copy, 9);
  UplinkConfig config = secured_channel(true);
  EXPECT_FALSE(state_->load_session_keys(config).lost.empty());
  EXPECT_TRUE(config.channels[0].associations[0].key_lost);
  EXPECT_FALSE(config.channels[0].associations[1].key_lost);

  UplinkConfig next_start = secured_channel(true);
  EXPECT_TRUE(state_->load_session_keys(next_start).lost.empty()) << "told once";
  EXPECT_TRUE(next_start.channels[0].associations[0].key_lost) << "and it stays so";
}

TEST_F(StoredStates, WithoutAContingencyKeyTheLossOfAllSessionKeysLocksNobodyOut) {
  static_cast<void>(start());
  ASSERT_TRUE(state_->write_session_keys(*wire::SessionKeys{}.uploaded(128, wire::SdlsKey({7}))));
  for (const char* copy : {"session_keys.0", "session_keys.1"})
    std::filesystem::resize_file(folder_.path() / "session" / copy, 9);
  UplinkConfig config = secured_channel(false);
  EXPECT_FALSE(state_->load_session_keys(config).lost.empty());
  EXPECT_FALSE(config.channels[0].associations[0].key_lost);
}

TEST_F(StoredStates, TakesTheOtherKeysWhereTheSelectedSetHasNone) {
  static_cast<void>(start());
  ASSERT_TRUE(state_->write_keys({.generation = 1, .sets = {{0, KeySet::b}}}));
  UplinkConfig config;
  config.channels.push_back({.vc = 0, .associations = {}});
  config.channels[0].associations.push_back({.spi = 1, .key = wire::SdlsKey({1}), .set = KeySet::a});
  config.channels[0].associations.push_back({.spi = 5, .key = wire::SdlsKey({5}), .set = std::nullopt});
  std::vector<TtcCore::KeyNews> news;
  EXPECT_EQ(state_->load_keys(config, news).sets.at(0), KeySet::b) << "as it is stored";
  EXPECT_EQ(config.channels[0].selected, KeySet::a);
  ASSERT_EQ(news.size(), 1U);
  EXPECT_EQ(news[0].set, KeySet::a);
}

}  // namespace
}  // namespace srfs
