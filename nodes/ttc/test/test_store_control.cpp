// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/store/store_control.hpp"
#include "tests/mission_dictionary.hpp"

#include <gtest/gtest.h>

#include <mission/structures.hpp>

namespace srfs {
namespace {

constexpr std::uint16_t housekeeping = 1;
constexpr std::uint16_t events = 2;
constexpr std::uint16_t verification = 3;

class StoreControlTest : public testing::Test {
 protected:
  static TelecommandOrigin origin() { return {.apid = 1, .ack_flags = 0xF, .source_id = 7}; }

  void tell(std::uint16_t store, std::uint32_t next_sequence) {
    control_.on_status(store, {.octets = 1U << 20,
                               .quota_octets = 4U << 20,
                               .records = next_sequence,
                               .next_sequence = next_sequence,
                               .recovered_sequence = next_sequence});
  }
  void execute(std::uint8_t subtype, OctetView arguments) {
    const mission::Command& command =
        *dictionary_.request(mission::apid::ttc, PacketRetrieval::service_type, subtype);
    ASSERT_TRUE(control_.provides(command));
    control_.execute(
        {.origin = origin(), .command = &command, .arguments = {arguments.begin(), arguments.end()}}, {});
  }
  template <class Command>
  void command(const std::vector<std::uint16_t>& stores) {
    OctetWriter arguments;
    arguments.u16(static_cast<std::uint16_t>(stores.size()));
    for (const std::uint16_t store : stores) arguments.u16(store);
    execute(Command::subtype, arguments.view());
  }
  void begin_at(TaiTime from, std::uint16_t store) {
    mission::StorageSetOpenStart group{.from = from, .store = store};
    execute(group.subtype, mission::StorageSetOpenStart::encoded(group, {group}));
  }
  /// The reports since the last call, each as "service.subtype".
  std::vector<std::string> reports() {
    std::vector<std::string> out;
    for (const Report& report : report_queue_.take()) {
      out.push_back(std::to_string(report.service) + "." + std::to_string(report.subtype));
      last_ = report;
    }
    return out;
  }
  static RetrievedPackets packets(std::size_t count, bool finished, std::uint32_t behind) {
    RetrievedPackets out{.packets = std::vector<Octets>(count, Octets(10, 1)), .finished = finished};
    out.next.end_sequence = behind;
    out.next_sequence = behind;
    return out;
  }

  static constexpr std::size_t room = PacketRetrieval::room_for_batch;
  const mission::Dictionary& dictionary_ = testing_support::dictionary();
  ReportQueue report_queue_;
  PacketRetrieval retrieval_{report_queue_};
  StoreControl control_{dictionary_, "", report_queue_, retrieval_};
  Report last_;
};

TEST_F(StoreControlTest, AStoreThatIsDisabledTakesNoPacketAndCountsIt) {
  command<mission::StorageDisable>({events});
  EXPECT_EQ(reports(), (std::vector<std::string>{"1.3"}));
  const auto change = control_.take_change();
  ASSERT_TRUE(change);
  control_.change_stored(*change, true);
  EXPECT_EQ(reports(), (std::vector<std::string>{"1.7"}));
  EXPECT_FALSE(control_.take_packet(events));
  EXPECT_TRUE(control_.take_packet(housekeeping));

  execute(mission::StorageStatus::subtype, {});
  const auto sent = report_queue_.take();
  ASSERT_EQ(sent.size(), 5U);  // three stores, 1,3 and 1,7
  const auto status = mission::PacketStoreStatus::decode(sent[1].data);
  ASSERT_TRUE(status);
  EXPECT_EQ(status->store, events);
  EXPECT_EQ(status->storage, mission::StorageSwitch::disabled);
  EXPECT_EQ(status->refused, 1U);
  EXPECT_EQ(sent[1].destination_id, 7);

  command<mission::StorageEnable>({});  // all
  EXPECT_TRUE(control_.take_packet(events));
}

TEST_F(StoreControlTest, WhatCouldNotBeStoredFailsAndHoldsAllTheSame) {
  command<mission::StorageDisable>({events});
  const auto change = control_.take_change();
  ASSERT_TRUE(change);
  control_.change_stored(*change, false);
  EXPECT_EQ(reports(), (std::vector<std::string>{"1.3", "1.8"}));
  EXPECT_FALSE(control_.take_packet(events));
}

TEST_F(StoreControlTest, SeveralCommandsBecomeDurableInOneWriteAndEachIsCompleted) {
  command<mission::StorageDisable>({events});
  command<mission::StorageMakeBounded>({housekeeping});
  const auto change = control_.take_change();
  ASSERT_TRUE(change);
  EXPECT_EQ(change->origins.size(), 2U);
  EXPECT_FALSE(control_.take_change());
  control_.change_stored(*change, true);
  EXPECT_EQ(reports(), (std::vector<std::string>{"1.3", "1.3", "1.7", "1.7"}));
}

TEST_F(StoreControlTest, AllOfItLastsOverARestart) {
  command<mission::StorageDisable>({events});
  command<mission::StorageMakeBounded>({housekeeping});
  begin_at(TaiTime(seconds(100)), verification);
  command<mission::StorageResumeOpen>({verification});
  tell(verification, 20);
  const auto batch = control_.next_batch(room);
  ASSERT_TRUE(batch);
  (void)control_.on_batch(batch->request, packets(20, true, 20));
  control_.on_pushed(2000);
  control_.on_left(2000);
  EXPECT_TRUE(control_.take_progress());
  EXPECT_FALSE(control_.take_progress());

  StoreControl again(dictionary_, control_.stored_text(), report_queue_, retrieval_);
  EXPECT_FALSE(again.take_packet(events));
  EXPECT_EQ(again.bounded(), (std::vector<std::uint16_t>{housekeeping}));
  again.on_status(verification, {.records = 25, .next_sequence = 25, .recovered_sequence = 20});
  const auto next = again.next_batch(room);
  ASSERT_TRUE(next);
  EXPECT_EQ(next->period.store, verification);
  EXPECT_EQ(next->period.range.from, TaiTime(seconds(100)));
  EXPECT_EQ(next->cursor.begin_sequence, 20U);
}

TEST_F(StoreControlTest, ADamagedFileMeansThatNothingWasSet) {
  command<mission::StorageDisable>({events});
  std::string text = control_.stored_text();
  text[2] = text[2] == '0' ? '1' : '0';
  StoreControl again(dictionary_, text, report_queue_, retrieval_);
  EXPECT_TRUE(again.take_packet(events));
}

TEST_F(StoreControlTest, OpenRetrievalSendsWhatIsThereThenWhatComes) {
  tell(events, 5);
  EXPECT_FALSE(control_.next_batch(room)) << "suspended";
  command<mission::StorageResumeOpen>({events});
  EXPECT_FALSE(control_.next_batch(room - 1)) << "no room";
  auto batch = control_.next_batch(room);
  ASSERT_TRUE(batch);
  EXPECT_EQ(batch->cursor.begin_sequence, 0U);
  EXPECT_FALSE(control_.next_batch(room)) << "one at a time";

  EXPECT_EQ(control_.on_batch(batch->request, packets(3, false, 3)).size(), 3U);
  batch = control_.next_batch(room);
  ASSERT_TRUE(batch);
  EXPECT_EQ(control_.on_batch(batch->request, packets(2, true, 5)).size(), 2U);
  EXPECT_FALSE(control_.next_batch(room)) << "nothing new";

  tell(events, 6);
  batch = control_.next_batch(room);
  ASSERT_TRUE(batch);
  EXPECT_EQ(batch->cursor.begin_sequence, 5U);
  EXPECT_FALSE(batch->cursor.end_sequence);
}

TEST_F(StoreControlTest, WhatHasNotLeftTheChannelIsSentAgainAfterARestart) {
  command<mission::StorageResumeOpen>({events});
  tell(events, 5);
  const auto batch = control_.next_batch(room);
  ASSERT_TRUE(batch);
  (void)control_.on_batch(batch->request, packets(5, true, 5));
  control_.on_pushed(500);
  control_.on_left(499);

  StoreControl again(dictionary_, control_.stored_text(), report_queue_, retrieval_);
  again.on_status(events, {.records = 5, .next_sequence = 5, .recovered_sequence = 5});
  const auto next = again.next_batch(room);
  ASSERT_TRUE(next);
  EXPECT_EQ(next->cursor.begin_sequence, 0U);
}

TEST_F(StoreControlTest, ItsPlaceFollowsTheChannelAlsoWhileThatIsNeverEmpty) {
  command<mission::StorageResumeOpen>({events});
  tell(events, 1000);
  for (std::uint32_t i = 1; i <= 10; ++i) {
    const auto batch = control_.next_batch(room);
    ASSERT_TRUE(batch);
    (void)control_.on_batch(batch->request, packets(40, false, 40 * i));
    control_.on_pushed(4000 * i);
    control_.on_left(4000 * i - 8000 + (i == 1 ? 4000 : 0));
  }

  StoreControl again(dictionary_, control_.stored_text(), report_queue_, retrieval_);
  again.on_status(events, {.records = 1000, .next_sequence = 1000, .recovered_sequence = 1000});
  const auto next = again.next_batch(room);
  ASSERT_TRUE(next);
  EXPECT_EQ(next->cursor.begin_sequence, 320U);
}

TEST_F(StoreControlTest, SuspendedItKeepsItsPlaceAndDropsWhatIsStillBeingRead) {
  command<mission::StorageResumeOpen>({events});
  tell(events, 9);
  auto batch = control_.next_batch(room);
  (void)control_.on_batch(batch->request, packets(4, false, 4));
  batch = control_.next_batch(room);
  ASSERT_TRUE(batch);
  command<mission::StorageSuspendOpen>({events});
  EXPECT_TRUE(control_.on_batch(batch->request, packets(5, true, 9)).empty());
  EXPECT_FALSE(control_.next_batch(room));

  command<mission::StorageResumeOpen>({events});
  batch = control_.next_batch(room);
  ASSERT_TRUE(batch);
  EXPECT_EQ(batch->cursor.begin_sequence, 4U);
}

TEST_F(StoreControlTest, ItsStartIsMovedOnlyWhileItIsSuspended) {
  command<mission::StorageResumeOpen>({events});
  (void)reports();
  begin_at(TaiTime(seconds(50)), events);
  EXPECT_EQ(reports(), (std::vector<std::string>{"1.4"}));
  command<mission::StorageSuspendOpen>({events});
  (void)reports();
  begin_at(TaiTime(seconds(50)), events);
  EXPECT_EQ(reports(), (std::vector<std::string>{"1.3"}));
}

TEST_F(StoreControlTest, StoresTakeTurnsAndAPeriodGoesBefore) {
  command<mission::StorageResumeOpen>({});
  for (const std::uint16_t store : {housekeeping, events, verification}) tell(store, 100);
  std::vector<std::uint16_t> order;
  for (int i = 0; i < 6; ++i) {
    const auto batch = control_.next_batch(room);
    ASSERT_TRUE(batch);
    order.push_back(batch->period.store);
    (void)control_.on_batch(batch->request, packets(1, false, static_cast<std::uint32_t>(i) + 1));
  }
  EXPECT_EQ(order, (std::vector<std::uint16_t>{1, 2, 3, 1, 2, 3}));

  ASSERT_TRUE(retrieval_.request(origin(), {{.store = events, .range = {}}}));
  EXPECT_FALSE(control_.next_batch(room));
  execute(mission::StorageStatus::subtype, {});
  const auto sent = report_queue_.take();
  const auto status = mission::PacketStoreStatus::decode(sent.at(sent.size() - 4).data);
  ASSERT_TRUE(status);
  EXPECT_EQ(status->store, events);
  EXPECT_EQ(status->period_retrieval, mission::PeriodRetrieval::under_way);
}

TEST_F(StoreControlTest, AStoreThatCannotBeReadIsTriedAgainLater) {
  command<mission::StorageResumeOpen>({events});
  tell(events, 5);
  const auto batch = control_.next_batch(room);
  ASSERT_TRUE(batch);
  EXPECT_TRUE(control_.on_batch(batch->request, std::nullopt).empty());
  EXPECT_FALSE(control_.next_batch(room));
  tell(events, 5);
  EXPECT_TRUE(control_.next_batch(room));
}

TEST_F(StoreControlTest, AStoreThatLostItsEndIsFollowedFromWhereItEndedAtTheStart) {
  command<mission::StorageResumeOpen>({events});
  tell(events, 50);
  auto batch = control_.next_batch(room);
  (void)control_.on_batch(batch->request, packets(50, true, 50));
  control_.on_pushed(500);
  control_.on_left(500);

  StoreControl again(dictionary_, control_.stored_text(), report_queue_, retrieval_);
  // 40 of 50 records are left, and 15 new ones have arrived.
  again.on_status(events, {.records = 55, .next_sequence = 55, .recovered_sequence = 40});
  batch = again.next_batch(room);
  ASSERT_TRUE(batch);
  EXPECT_EQ(batch->cursor.begin_sequence, 40U);
}

TEST_F(StoreControlTest, SaysOnceThatABoundedStoreIsFull) {
  PacketStoreStatus full{.full = true};
  EXPECT_FALSE(control_.on_status(events, full)) << "not bounded";
  command<mission::StorageMakeBounded>({events});
  EXPECT_TRUE(control_.on_status(events, full));
  EXPECT_FALSE(control_.on_status(events, full));
  command<mission::StorageMakeCircular>({events});
  EXPECT_FALSE(control_.on_status(events, {}));
  command<mission::StorageMakeBounded>({events});
  EXPECT_TRUE(control_.on_status(events, full));
}

TEST_F(StoreControlTest, TheSummaryTellsTimesAndFilling) {
  command<mission::StorageResumeOpen>({events});
  PacketStoreStatus status{.octets = 1000, .quota_octets = 4000, .records = 10, .next_sequence = 10};
  status.oldest = TaiTime(seconds(5));
  status.newest = TaiTime(seconds(9));
  control_.on_status(events, status);
  const auto batch = control_.next_batch(room);
  (void)control_.on_batch(batch->request, packets(4, false, 4));
  control_.on_pushed(400);
  control_.on_left(400);
  (void)report_queue_.take();

  command<mission::StorageSummary>({events});
  const auto sent = report_queue_.take();
  ASSERT_EQ(sent.size(), 3U);
  const auto summary = mission::PacketStoreSummary::decode(sent[0].data);
  ASSERT_TRUE(summary);
  EXPECT_EQ(summary->oldest, TaiTime(seconds(5)));
  EXPECT_EQ(summary->newest, TaiTime(seconds(9)));
  EXPECT_EQ(summary->filled, 25);
  EXPECT_EQ(summary->filled_open, 15);
}

}  // namespace
}  // namespace srfs
