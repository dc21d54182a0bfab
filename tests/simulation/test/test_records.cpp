// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Each check of the simulation can fail.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/simulation/file_record.hpp"
#include "tests/simulation/maintenance.hpp"
#include "tests/simulation/store_ledger.hpp"

namespace srfs::simulation {
namespace {

using testing::HasSubstr;

/// Runs @p check. @return the violation it throws; "" for none
template <class Check>
std::string violation_of(Check check) {
  try {
    check();
  } catch (const Violation& violation) {
    return violation.requirement + ": " + violation.text;
  }
  return "";
}

// ---------------------------------------------------------------- packet stores

struct SimulatedStores : testing::Test {
  static constexpr std::uint16_t id = 1;
  static constexpr std::size_t segment_octets = 2048;
  static StoreItem item(std::uint8_t number) {
    return {
        .store = id,
        .stamp = {.tai = TaiTime(seconds(1000 + number)), .time_valid = true, .boot_id = 1, .monotonic = {}},
        .packet = Octets(40, number)};
  }
  void open() {
    store.emplace(PacketStoreConfig{.folder = {}, .quota_octets = 8192, .segment_octets = segment_octets},
                  std::make_unique<PlayedSegmentFiles>(ledger.disk(id)));
    ASSERT_TRUE(store->open());
    ledger.on_open(status());
  }
  [[nodiscard]] PacketStoresStatus status() const {
    return {.stores = {{id, store->status()}}, .failure = {}};
  }
  void append(std::uint8_t number) {
    store->append(item(number).stamp, item(number).packet);
    ledger.on_append(item(number), status());
  }
  void commit() {
    (void)store->commit();
    ledger.on_commit(status());
  }
  static const mission::Dictionary& dictionary() {
    static const mission::Dictionary read = mission::Dictionary::load(mission::Dictionary::default_folder());
    return read;
  }
  Kernel kernel{1};
  StoreLedger ledger{kernel, dictionary(), segment_octets};
  std::optional<PacketStore> store;
};

TEST_F(SimulatedStores, WhatWasSyncedIsThereAfterAPowerCutAndWhatWasNotIsNotOwed) {
  open();
  for (std::uint8_t n = 0; n < 5; ++n) append(n);
  commit();
  for (std::uint8_t n = 5; n < 9; ++n) append(n);
  ledger.on_end();
  ledger.lose_power();
  open();
  EXPECT_EQ(violation_of([this] { ledger.check(); }), "");
  EXPECT_EQ(ledger.counters().stored, 5U);
  EXPECT_GE(store->next_sequence(), 5U);
}

TEST_F(SimulatedStores, ASyncedPacketThatIsGoneIsAViolation) {
  open();
  for (std::uint8_t n = 0; n < 5; ++n) append(n);
  commit();
  ASSERT_TRUE(PlayedSegmentFiles(ledger.disk(id)).remove(0));
  EXPECT_THAT(violation_of([this] { ledger.check(); }),
              HasSubstr("L6: a packet that was synced is not there"));
}

TEST_F(SimulatedStores, APacketThatIsNeitherStoredNorCountedIsAViolation) {
  open();
  append(1);
  ledger.on_append(item(2), status());
  EXPECT_THAT(violation_of([this] { commit(); }), HasSubstr("L6: packets are neither stored nor counted"));
}

TEST_F(SimulatedStores, SegmentsThatWereDeletedForTheQuotaAreNotOwed) {
  open();
  for (int n = 0; n < 400; ++n) {
    append(static_cast<std::uint8_t>(n));
    commit();
  }
  EXPECT_GT(ledger.counters().overwritten, 0U);
  EXPECT_EQ(violation_of([this] { ledger.check(); }), "");
}

TEST_F(SimulatedStores, ASegmentThatIsDeletedThoughThereIsRoomIsAViolation) {
  open();
  for (std::uint8_t n = 0; n < 60; ++n) append(n);
  commit();
  ASSERT_TRUE(PlayedSegmentFiles(ledger.disk(id)).remove(0));
  EXPECT_THAT(violation_of([this] { commit(); }),
              HasSubstr("L6: a segment is deleted though there was room"));
}

TEST_F(SimulatedStores, WhatIsDeletedAndNotCountedIsAViolation) {
  open();
  int n = 0;
  for (; ledger.counters().overwritten == 0; ++n) {
    append(static_cast<std::uint8_t>(n));
    commit();
  }
  const auto counted = store->status().counters.overwritten;
  for (; store->status().counters.overwritten == counted; ++n) {
    append(static_cast<std::uint8_t>(n));
    (void)store->commit();
  }
  auto uncounted = status();
  uncounted.stores[0].second.counters.overwritten = counted;
  EXPECT_THAT(violation_of([&] { ledger.on_commit(uncounted); }),
              HasSubstr("L6: packets were deleted and not counted"));
}

/// The disk refused to delete a segment: it stayed, uncounted, until the next start.
TEST_F(SimulatedStores, ASegmentThatCannotBeDeletedIsDeletedLaterAndTheQuotaHolds) {
  open();
  for (int n = 0; n < 400; ++n) {
    ledger.state().failing = n % 7 < 3;
    append(static_cast<std::uint8_t>(n));
    commit();
  }
  EXPECT_GT(ledger.counters().overwritten, 0U);
  EXPECT_EQ(violation_of([this] { ledger.check(); }), "");
}

/// A packet that is read back before its commit is written without a sync. The next commit may begin a
/// segment.
TEST_F(SimulatedStores, WhatARetrievalWroteIsSyncedAlsoWhereTheNextCommitBeginsASegment) {
  open();
  for (std::uint8_t n = 0; n < 30; ++n) append(n);
  const RetrievalRange all{.from = TaiTime(), .to = TaiTime(seconds(1) * 2'000'000'000)};
  EXPECT_EQ(store->read(all, {}, 1U << 16).packets.size(), 30U);
  for (std::uint8_t n = 30; n < 60; ++n) append(n);
  commit();
  ledger.on_end();
  ledger.lose_power();
  open();
  EXPECT_EQ(ledger.counters().stored, 60U);
}

TEST_F(SimulatedStores, ARetrievalThatLeavesAPacketOutIsAViolation) {
  open();
  for (std::uint8_t n = 0; n < 5; ++n) append(n);
  commit();
  const RetrievalRange all{.from = TaiTime(), .to = TaiTime(seconds(1) * 2'000'000'000)};
  const ReadStore read{.batch = {.period = {.store = id, .range = all}, .cursor = {}}, .items = {}};
  auto packets = store->read(all, {}, 1U << 16);
  packets.packets.pop_back();
  EXPECT_THAT(violation_of([&] { ledger.on_read(read, packets, status()); }),
              HasSubstr("S8: a retrieval read other packets than the store has"));
}

TEST_F(SimulatedStores, ARetrievalThatIsCompleteBeforeItsPacketsAreSentIsAViolation) {
  open();
  append(1);
  commit();
  const RetrievalRange all{.from = TaiTime(), .to = TaiTime(seconds(1) * 2'000'000'000)};
  const ReadStore read{.batch = {.period = {.store = id, .range = all}, .cursor = {}}, .items = {}};
  ledger.on_read(read, store->read(all, {}, 1U << 16), status());
  EXPECT_THAT(violation_of([&] { ledger.on_retrieval_completed(); }),
              HasSubstr("S8: a retrieval is reported complete"));
}

// ---------------------------------------------------------------- files

struct SimulatedFiles : testing::Test {
  [[nodiscard]] std::string violation(const FileRecord::Names& under_way = {}) {
    return violation_of([&] { record.check_ends(kernel.now(), {FileRecord::Names{}, under_way}); });
  }
  void report(FileRecord::End at, cfdp::Role role, bool arrived = true) {
    cfdp::News news;
    news.event.kind = cfdp::EventKind::finished;
    news.event.role = role;
    news.event.outcome.incomplete = !arrived;
    news.file.destination_file = name;
    record.on_news(at, news);
  }
  void arrive() { ground.add(name, *board.content("outbox/" + name)); }
  void SetUp() override { kernel.run_until(kernel.now() + seconds(1)); }
  Kernel kernel{1};
  FileRecord record{kernel};
  Random random{1, "test"};
  cfdp::MemoryFileStore& board = *record.disk(FileRecord::End::board);
  cfdp::MemoryFileStore& ground = *record.disk(FileRecord::End::ground);
  std::string name = record.put(FileRecord::End::board, random);
};

TEST_F(SimulatedFiles, OneThatWaitsForEverIsAViolation) {
  EXPECT_THAT(violation(), HasSubstr("L14: a file waits"));
}

TEST_F(SimulatedFiles, OneThatArrivesChangedIsAViolation) {
  arrive();
  ground.files.at(name).octets.back() ^= 1;
  EXPECT_THAT(violation_of([&] { report(FileRecord::End::ground, cfdp::Role::receiving); }),
              HasSubstr("L11: a file is reported as arrived and is not there, or is another one"));
}

TEST_F(SimulatedFiles, OneThatLeavesTheOutboxAndIsNowhereIsAViolation) {
  board.remove("outbox/" + name);
  record.on_process_end(FileRecord::End::board);
  EXPECT_THAT(violation(), HasSubstr("L14: a file left the outbox, and is neither there"));
}

TEST_F(SimulatedFiles, OneThatLeavesTheOutboxWithoutAWordIsAViolationUnlessTheProcessEnded) {
  arrive();
  board.remove("outbox/" + name);
  EXPECT_THAT(violation(), HasSubstr("L14: a file left the outbox without a word"));
  record.on_process_end(FileRecord::End::board);
  EXPECT_EQ(violation(), "");
}

TEST_F(SimulatedFiles, OneThatFailedIsKeptOrThatIsAViolation) {
  (void)board.rename("outbox/" + name, "unsent/" + name);
  report(FileRecord::End::board, cfdp::Role::sending, false);
  board.remove("unsent/" + name);
  EXPECT_THAT(violation(), HasSubstr("L14: a file that was not sent is kept nowhere"));
}

TEST_F(SimulatedFiles, ATransferThatHasNoEndIsAViolation) {
  arrive();
  board.remove("outbox/" + name);
  report(FileRecord::End::board, cfdp::Role::sending);
  EXPECT_THAT(violation({name}), HasSubstr("L14: a transfer has no end"));
}

// ---------------------------------------------------------------- packages and versions

TEST(SimulatedPackages, ARefusedOneThatIsBuiltAndAnAcceptedOneWithoutEndAreViolations) {
  Kernel kernel(1);
  PackageRecord record(kernel);
  const std::string refused = record.make(9);
  record.on_answer(refused, mission::failure::package_refused);
  EXPECT_THAT(violation_of([&] { record.on_build(refused); }), HasSubstr("F6: a package that was refused"));

  const std::string accepted = record.make(9);
  record.on_answer(accepted, mission::failure::none);
  EXPECT_EQ(violation_of([&] { record.check_ends(kernel.now()); }), "") << "it was accepted in the calm";
  EXPECT_THAT(violation_of([&] { record.check_ends(kernel.now() + seconds(1)); }), HasSubstr("no end of it"));
  update::Update update;
  update.file = accepted;
  update.step = update::UpdateStep::failed;
  record.on_report(update);
  EXPECT_EQ(violation_of([&] { record.check_ends(kernel.now() + seconds(1)); }), "");
}

TEST(SimulatedPackages, AProgramThatRunsThoughItsInstallationWasCancelledIsAViolation) {
  Kernel kernel(1);
  PackageRecord record(kernel);
  update::Update update;
  update.file = record.make(9);
  update.step = update::UpdateStep::cancelled;
  record.on_report(update);
  EXPECT_THAT(violation_of([&] { record.check_running(origin_of(update)); }),
              HasSubstr("F6: a program runs whose installation was reported as failed or cancelled"));
  EXPECT_EQ(violation_of([&] { record.check_running("another one"); }), "");
  EXPECT_THAT(violation_of([&] { record.check_stored(origin_of(update)); }),
              HasSubstr("F6: a program is stored whose installation was reported as cancelled"));
  record.on_use_ordered(origin_of(update));
  EXPECT_EQ(violation_of([&] { record.check_running(origin_of(update)); }), "");
}

TEST(SimulatedVersions, AProgramThatDiesGivesWayAndADamagedOneIsAViolation) {
  Kernel kernel(1);
  Disk disk(kernel);
  Host host(kernel, Lane::payload_eps, [](Host&) { return std::unique_ptr<Program>(); });
  std::vector<std::unique_ptr<Host>> others;
  std::vector<Host*> hosts;
  for (std::size_t i = 0; i < 9; ++i) {
    others.push_back(std::make_unique<Host>(kernel, static_cast<Lane>(i), [](Host&) { return nullptr; }));
    hosts.push_back(static_cast<Lane>(i) == Lane::payload_eps ? &host : others.back().get());
  }
  Versions versions(kernel, disk, hosts);
  versions.disk(host).elsewhere["job"] = to_text(PlayedProgram{"bad", milliseconds(500)});
  const auto install = [](update::VersionStore& store) -> Result<void, std::string> {
    const auto number = store.add("job", "package 1", UtcTime());
    return number ? store.use(*number, seconds(60), "") : Result<void, std::string>(Err(number.error()));
  };
  ASSERT_TRUE(versions.change(host, install));
  EXPECT_THAT(violation_of([&] { versions.check(); }), HasSubstr("C6d: a node runs another program"));
  EXPECT_EQ(versions.on_begin(host), 1U);
  EXPECT_THAT(violation_of([&] { versions.check(); }), HasSubstr("C6d: a program that dies is still in use"));
  ASSERT_TRUE(versions.trial_of(host));

  versions.set_aside(host, 1, "it died");
  EXPECT_THAT(violation_of([&] { versions.check(); }), HasSubstr("C6d: a program that dies is still in use"));
  EXPECT_EQ(versions.on_begin(host), update::golden);
  EXPECT_EQ(violation_of([&] { versions.check(); }), "");

  versions.disk(host).disk.inodes.begin()->second.now = "rotten";
  EXPECT_THAT(violation_of([&] { (void)versions.on_begin(host); }),
              HasSubstr("C6d: the table names a program that is not there whole"));
}

// ---------------------------------------------------------------- coverage

TEST(SimulationCoverage, CountsEachTransitionOfAnObjectAndListsThoseNeverSeen) {
  Coverage coverage;
  coverage.note(StateTable::farm, 0, 0);
  coverage.note(StateTable::farm, 0, 2);
  coverage.note(StateTable::farm, 0, 2);
  coverage.note(StateTable::farm, 0, 0);
  coverage.forget(StateTable::farm, 0);
  coverage.note(StateTable::farm, 0, 1);
  const std::string text = report(coverage.counts());
  EXPECT_THAT(text,
              testing::ContainsRegex("FARM-1 +2 of +5  never: open -> wait, wait -> open, wait -> lockout"));
}

}  // namespace
}  // namespace srfs::simulation
