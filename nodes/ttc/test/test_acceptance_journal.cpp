// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/command/acceptance_journal.hpp"

#include <map>
#include <random>
#include <set>

#include <gtest/gtest.h>

#include "nodes/ttc/test/simulated_medium.hpp"
#include "tests/build_kind.hpp"

namespace srfs {
namespace {

using testing_support::PowerLoss;
using testing_support::SimulatedMedium;

constexpr milliseconds window{60'000};

MonotonicTime at(int ms) {
  return MonotonicTime(milliseconds(ms));
}

LinkState link_of(std::uint64_t counter) {
  LinkState link;
  link.generation = counter;
  link.channels.push_back({.vc = 0, .farm = {.vr = static_cast<std::uint8_t>(counter)}});
  link.associations.push_back({.spi = 1, .counter = counter});
  return link;
}

/// A telecommand in a BD frame of a secured channel.
UplinkedPacket uplinked(std::uint16_t sequence, std::uint64_t counter, std::size_t data_octets = 0) {
  wire::TcPacket packet;
  packet.apid = 17;
  packet.sequence_count = static_cast<std::uint16_t>(sequence & 0x3FFF);
  packet.service = 8;
  packet.subtype = 1;
  packet.application = Octets(2 + data_octets, 1);
  return {.frame = {.vc = 0, .spi = 1, .counter = counter},
          .packet = wire::make_tc_packet(packet),
          .link = link_of(counter)};
}

Telecommand telecommand_of(const UplinkedPacket& packet, MonotonicTime expiry = at(1)) {
  static const mission::Command command = [] {
    mission::Command c;
    c.node = "payload_eps";
    return c;
  }();
  return {.origin = {.request = wire::peek_request_id(packet.packet).value(),
                     .apid = 17,
                     .ack_flags = wire::ack::all},
          .command = &command,
          .expiry = expiry};
}

/// One of several successive processes that use a journal on a simulated medium.
class Process {
 public:
  Process(JournalMedium& medium, const std::string& boot, std::size_t fill_octets = 8192)
      : log_(medium), journal_(boot, window, fill_octets) {
    auto found = log_.load();
    damaged_ = found.damaged_octets;
    for (const JournalRecord& record : found.records) {
      if (!journal_.apply(record)) damaged_ += 1;
    }
    journal_.begin({}, 1, at(0));
  }
  AcceptanceJournal& journal() { return journal_; }
  [[nodiscard]] std::size_t damaged() const { return damaged_; }

  std::uint64_t accept(const UplinkedPacket& packet, int expiry_ms = 10'000) {
    const std::uint64_t id = journal_.accept(telecommand_of(packet, at(expiry_ms)), packet, at(0));
    stage(id, Stage::acceptance);
    return id;
  }
  void stage(std::uint64_t id, Stage stage, bool success = true, std::uint16_t code = 0) {
    journal_.on_stage(
        {.id = id, .stage = stage, .success = success, .failure_code = code, .step = 0, .data = {}});
  }
  bool write(bool sync) {
    bool ok = true;
    while (ok && (journal_.wants_write() || (sync && journal_.wants_sync()))) {
      const JournalBatch batch = journal_.take_batch(sync);
      ok = batch.snapshot ? log_.snapshot(*batch.snapshot).has_value()
                          : log_.append(batch.records, batch.sync).has_value();
      journal_.on_written(batch, ok, log_.used_octets());
    }
    return ok;
  }
  [[nodiscard]] const AcceptedTelecommand* find(std::uint64_t id) const {
    for (const AcceptedTelecommand* t : journal_.known()) {
      if (t->origin.id == id) return t;
    }
    return nullptr;
  }

 private:
  JournalLog log_;
  AcceptanceJournal journal_;
  std::size_t damaged_ = 0;
};

std::vector<int> subtypes(ReportQueue& report_queue) {
  std::vector<int> found;
  for (const Report& report : report_queue.take()) found.push_back(report.subtype);
  return found;
}

/// As an earlier version wrote them: it must find its way in what this one writes, and the reverse.
TEST(AcceptanceJournal, KeepsTheOctetsOfARecordOnDisk) {
  AcceptanceJournal journal("boot", window);
  journal.begin({}, 1, at(0));
  journal.on_written(journal.take_batch(true), true, 0);  // the snapshot of the start
  UplinkedPacket packet = uplinked(2, 102, 2);
  packet.frame.type = wire::TcFrameType::ad;
  packet.frame.sequence = 9;
  const std::uint64_t id = journal.accept(telecommand_of(packet, at(5002)), packet, at(2), 4);
  journal.on_taken(id);
  journal.on_stage({.id = id, .stage = Stage::start, .success = false, .failure_code = 33, .data = {1, 2}});
  const JournalBatch batch = journal.take_batch(true);
  ASSERT_EQ(batch.records.size(), 3U);
  EXPECT_EQ(to_hex(batch.records[0].payload),
            "000000000000000100000000000000011811c00200110f0000000b00000000000000040900010000000000000066"
            "00000000001e8480000000012a2476800b7061796c6f61645f657073b46c9bae001100111811c002000a2f080100"
            "00010101011c460000000000000066000000000000000001000066000000000100010000000000000066");
  EXPECT_EQ(to_hex(batch.records[1].payload), "000000000000000101000000000000000000");
  EXPECT_EQ(to_hex(batch.records[2].payload), "000000000000000100000000000000020300002100020102");
}

TEST(AcceptanceJournal, GivesTheNextProcessWhatHasNotEndedWithItsIdAndProgress) {
  SimulatedMedium medium(1);
  std::uint64_t open = 0;
  std::uint64_t ended = 0;
  {
    Process first(medium, "boot");
    open = first.accept(uplinked(1, 1), 5000);
    ended = first.accept(uplinked(2, 2));
    first.journal().on_taken(open);
    first.stage(open, Stage::start);
    first.stage(ended, Stage::completion, false, 33);
    ASSERT_TRUE(first.write(true));
  }
  Process second(medium, "boot");

  EXPECT_EQ(second.journal().open(), 1U);
  EXPECT_EQ(second.journal().counters().restored, 1U);
  const AcceptedTelecommand* t = second.find(open);
  ASSERT_NE(t, nullptr);
  EXPECT_EQ(t->packet, uplinked(1, 1).packet);
  EXPECT_EQ(t->target, "payload_eps");
  EXPECT_EQ(t->expiry, at(5000));
  EXPECT_TRUE(t->progress.taken && t->progress.started && t->restored && !t->progress.other_boot);
  ASSERT_NE(second.find(ended), nullptr);
  EXPECT_EQ(second.find(ended)->end,
            (StageReached{.stage = Stage::completion, .success = false, .failure_code = 33}));
  EXPECT_EQ(second.journal().link(), link_of(2));
  EXPECT_GT(second.journal().next_id(), ended);
}

TEST(AcceptanceJournal, AnotherBootVoidsTheExpiry) {
  SimulatedMedium medium(1);
  std::uint64_t id = 0;
  {
    Process first(medium, "boot a");
    id = first.accept(uplinked(1, 1));
    first.write(true);
  }
  Process(medium, "boot b").write(true);
  Process third(medium, "boot b");
  ASSERT_NE(third.find(id), nullptr);
  EXPECT_TRUE(third.find(id)->progress.other_boot) << "also when a process of this boot has written it again";
}

TEST(AcceptanceJournal, RecognisesARepeatByCounterByNumberAndByPacket) {
  SimulatedMedium medium(1);
  Process process(medium, "boot");
  UplinkedPacket sequenced = uplinked(1, 5);
  sequenced.frame.type = wire::TcFrameType::ad;
  sequenced.frame.sequence = 9;
  process.accept(sequenced);
  process.accept(uplinked(2, 6));
  AcceptanceJournal& journal = process.journal();

  EXPECT_NE(journal.find_repeated_frame(uplinked(2, 6)), nullptr) << "same SPI and IV";
  UplinkedPacket again = sequenced;
  again.frame.counter = 7;
  EXPECT_NE(journal.find_repeated_frame(again), nullptr) << "same N(S), secured anew";
  again.frame.sequence = 10;
  EXPECT_EQ(journal.find_repeated_frame(again), nullptr);
  UplinkedPacket other = uplinked(3, 8);
  other.frame.type = wire::TcFrameType::ad;
  other.frame.sequence = 9;
  EXPECT_EQ(journal.find_repeated_frame(other), nullptr) << "the number came round: another packet";

  EXPECT_NE(journal.find_repeated_packet(uplinked(2, 100), at(59'999)), nullptr);
  EXPECT_EQ(journal.find_repeated_packet(uplinked(2, 100), at(60'000)), nullptr);
  EXPECT_EQ(journal.find_repeated_packet(uplinked(4, 100), at(1)), nullptr);
  UplinkedPacket open = uplinked(2, 0);
  open.frame.spi.reset();
  EXPECT_EQ(journal.find_repeated_packet(open, at(1)), nullptr) << "anybody may send there";
  EXPECT_EQ(journal.counters().repeats, 3U);
}

TEST(AcceptanceJournal, OnAnOpenChannelAPacketIsARepeatWithinASecondOfTheLastOne) {
  SimulatedMedium medium(1);
  Process process(medium, "boot");
  AcceptanceJournal& journal = process.journal();
  UplinkedPacket open = uplinked(1, 0);
  open.frame.spi.reset();
  const std::uint64_t id = process.accept(open);

  for (int ms = 900; ms <= 9000; ms += 900) {
    const AcceptedTelecommand* known = journal.find_repeated_packet(open, at(ms));
    ASSERT_NE(known, nullptr) << ms;
    EXPECT_EQ(known->origin.id, id);
  }
  EXPECT_EQ(journal.find_repeated_packet(open, at(10'000)), nullptr) << "sent again a second later";
  UplinkedPacket other_channel = open;
  other_channel.frame.vc = 1;
  EXPECT_EQ(journal.find_repeated_packet(other_channel, at(9001)), nullptr);
  EXPECT_EQ(journal.find_repeated_packet(uplinked(1, 5), at(9001)), nullptr) << "with a key";

  UplinkedPacket released = uplinked(2, 0);
  released.frame.spi.reset();
  journal.accept(telecommand_of(released, at(10'000)), released, at(0), 7);
  EXPECT_EQ(journal.find_repeated_packet(released, at(1)), nullptr) << "the schedule released it";
}

TEST(AcceptanceJournal, TellsAgainHowFarATelecommandGotAndNothingBeforeItWasSaid) {
  SimulatedMedium medium(1);
  Process process(medium, "boot");
  ReportQueue report_queue;
  const UplinkedPacket packet = uplinked(1, 1);
  AcceptanceJournal& journal = process.journal();
  const std::uint64_t id = journal.accept(telecommand_of(packet), packet, at(0));
  AcceptanceJournal::tell_again(*process.find(id), 0, report_queue);
  EXPECT_TRUE(subtypes(report_queue).empty()) << "it is not on disk yet";

  process.stage(id, Stage::acceptance);
  process.stage(id, Stage::start);
  AcceptanceJournal::tell_again(*process.find(id), 0, report_queue);
  EXPECT_EQ(subtypes(report_queue), (std::vector<int>{1, 3}));

  process.stage(id, Stage::completion);
  AcceptanceJournal::tell_again(*process.find(id), 0, report_queue);
  EXPECT_EQ(subtypes(report_queue), (std::vector<int>{1, 3})) << "the end waits for the disk";
  journal.on_end_said(id);
  AcceptanceJournal::tell_again(*process.find(id), 0, report_queue);
  EXPECT_EQ(subtypes(report_queue), (std::vector<int>{1, 3, 7}));
}

TEST(AcceptanceJournal, AnswersATelecommandThatIsRepeatedFasterOnceASecondAndStoresNoneOfThat) {
  SimulatedMedium medium(1);
  Process process(medium, "boot");
  ReportQueue report_queue;
  AcceptanceJournal& journal = process.journal();
  const std::uint64_t id = process.accept(uplinked(1, 1));
  const std::uint64_t other = process.accept(uplinked(2, 2));
  ASSERT_TRUE(process.write(true));

  std::size_t answers = 0;
  for (int ms = 0; ms < 3000; ms += 2) {
    journal.answer_repeat(*journal.find_repeated_frame(uplinked(1, 1)), at(ms), report_queue);
    for (const Report& report : report_queue.take()) {
      ++answers;
      EXPECT_FALSE(report.stored);
    }
  }
  EXPECT_EQ(answers, 3U);
  EXPECT_EQ(journal.counters().unanswered, 1497U);
  EXPECT_FALSE(journal.wants_write()) << "nothing of it is recorded";
  journal.answer_repeat(*process.find(other), at(2999), report_queue);
  EXPECT_EQ(report_queue.take().size(), 1U) << "each telecommand has its own second";
  EXPECT_FALSE(process.find(id)->end);
}

TEST(AcceptanceJournal, AfterARestartOnlyWhatWasNotToldIsToldAgain) {
  SimulatedMedium medium(1);
  std::uint64_t told = 0;
  std::uint64_t not_told = 0;
  {
    Process first(medium, "boot");
    told = first.accept(uplinked(1, 1));
    not_told = first.accept(uplinked(2, 2));
    first.stage(told, Stage::completion);
    first.journal().on_told(first.journal().serial());
    first.stage(not_told, Stage::completion);
    first.write(true);
  }
  Process second(medium, "boot");
  ReportQueue report_queue;
  AcceptanceJournal::tell_again(*second.find(told), second.journal().told(), report_queue);
  EXPECT_TRUE(subtypes(report_queue).empty());
  AcceptanceJournal::tell_again(*second.find(not_told), second.journal().told(), report_queue);
  EXPECT_EQ(subtypes(report_queue), std::vector<int>{7}) << "its acceptance was told";
}

RefusedTelecommand refused_of(const UplinkedPacket& packet, std::uint16_t code) {
  return {.origin = telecommand_of(packet).origin,
          .end = {.stage = Stage::acceptance, .success = false, .failure_code = code, .data = {9}}};
}

TEST(AcceptanceJournal, ARefusalIsToldByTheNextProcessUnlessItWasTold) {
  SimulatedMedium medium(1);
  {
    Process first(medium, "boot");
    ASSERT_TRUE(first.write(true));
    AcceptanceJournal& journal = first.journal();
    const RefusedTelecommand told = refused_of(uplinked(1, 1), 6);
    const RefusedTelecommand untold = refused_of(uplinked(2, 2), 7);
    journal.on_refusal_said(journal.refuse(told.origin, told.end, link_of(1)));
    EXPECT_EQ(journal.said(), journal.serial());
    journal.on_told(journal.said());
    EXPECT_TRUE(journal.refused().empty());
    journal.refuse(untold.origin, untold.end, link_of(2));
    EXPECT_EQ(journal.said(), journal.serial() - 1) << "it waits for the disk";
    ASSERT_TRUE(first.write(true));
  }
  for (int i = 0; i < 2; ++i) {  // first from changes, then from the second process' snapshot
    Process next(medium, "boot");
    EXPECT_EQ(next.journal().link(), link_of(2));
    EXPECT_EQ(next.journal().open(), 0U);
    ReportQueue report_queue;
    next.journal().tell_refused_again(report_queue);
    const auto reports = report_queue.take();
    ASSERT_EQ(reports.size(), 1U);
    EXPECT_EQ(reports[0].subtype, 2);
    EXPECT_EQ(reports[0].apid, 17);
    const Octets packet = uplinked(2, 2).packet;
    EXPECT_EQ(reports[0].data, (Octets{packet[0], packet[1], packet[2], packet[3], 0, 7, 9}));
    EXPECT_TRUE(reports[0].stored) << "it may not be in the packet store";
    ASSERT_TRUE(next.write(true));
  }
}

TEST(AcceptanceJournal, KeepsTheNewestRefusalsAndCountsTheOthers) {
  SimulatedMedium medium(1);
  Process process(medium, "boot");
  constexpr unsigned more = 3;
  for (unsigned i = 0; i < AcceptanceJournal::max_refused + more; ++i) {
    const RefusedTelecommand r = refused_of(uplinked(static_cast<std::uint16_t>(i), i + 1), 6);
    process.journal().refuse(r.origin, r.end, link_of(i + 1));
  }
  EXPECT_EQ(process.journal().refused().size(), AcceptanceJournal::max_refused);
  EXPECT_EQ(process.journal().refused().front().serial, more + 1);
  EXPECT_EQ(process.journal().counters().forgotten, more);
  ASSERT_TRUE(process.write(true));
  EXPECT_EQ(Process(medium, "boot").journal().refused().size(), AcceptanceJournal::max_refused);
}

TEST(AcceptanceJournal, WhatWaitsForTheDiskIsNotCountedAsTold) {
  SimulatedMedium medium(1);
  Process process(medium, "boot");
  AcceptanceJournal& journal = process.journal();
  const UplinkedPacket packet = uplinked(1, 1);
  const std::uint64_t id = journal.accept(telecommand_of(packet), packet, at(0));
  EXPECT_EQ(journal.said(), 0U);
  process.stage(id, Stage::acceptance);
  EXPECT_EQ(journal.said(), journal.serial());
  process.stage(id, Stage::completion);
  EXPECT_LT(journal.said(), journal.serial());
  journal.on_end_said(id);
  EXPECT_EQ(journal.said(), journal.serial());

  const std::uint64_t unasked = process.accept(uplinked(2, 2));
  journal.on_stage({.id = unasked, .stage = Stage::completion, .data = {}, .silent = true});
  EXPECT_EQ(journal.said(), journal.serial()) << "nobody wanted to know";
}

TEST(AcceptanceJournal, WhatWasRefusedAfterAllDoesNotComeBack) {
  SimulatedMedium medium(1);
  {
    Process first(medium, "boot");
    ASSERT_TRUE(first.write(true));
    const UplinkedPacket packet = uplinked(1, 1);
    const std::uint64_t id = first.journal().accept(telecommand_of(packet), packet, at(0));
    ASSERT_TRUE(first.write(true));
    first.stage(id, Stage::acceptance, false, 11);
    first.write(true);
  }
  Process second(medium, "boot");
  EXPECT_EQ(second.journal().open(), 0U);
  ASSERT_EQ(second.journal().refused().size(), 1U) << "its 1,2 may not have left";
  EXPECT_EQ(second.journal().refused()[0].end.failure_code, 11);
}

TEST(AcceptanceJournal, RefusesBeyondItsBoundAndForgetsTheOldestEndedFirst) {
  SimulatedMedium medium(1);
  Process process(medium, "boot", AcceptanceJournal::usual_fill_octets);
  std::vector<std::uint64_t> ids;
  for (std::size_t i = 0; i < AcceptanceJournal::max_open; ++i) {
    ASSERT_TRUE(process.journal().has_room());
    ids.push_back(process.accept(uplinked(static_cast<std::uint16_t>(i), i + 1, 900)));
  }
  EXPECT_FALSE(process.journal().has_room());
  ASSERT_TRUE(process.write(true)) << "the largest state fits its segment";

  for (const std::uint64_t id : ids) process.stage(id, Stage::completion);
  for (std::size_t i = 0; i < 10; ++i)
    process.stage(process.accept(uplinked(static_cast<std::uint16_t>(i), 1000 + i)), Stage::completion);
  EXPECT_EQ(process.journal().counters().forgotten, 10U);
  EXPECT_EQ(process.find(ids[9]), nullptr);
  EXPECT_NE(process.find(ids[10]), nullptr);
  ASSERT_TRUE(process.write(true));
  Process next(medium, "boot");
  EXPECT_EQ(next.journal().known().size(), AcceptanceJournal::max_ended);
}

TEST(AcceptanceJournal, AHangingDiskCostsOneSnapshotAndNoUnboundedQueue) {
  SimulatedMedium medium(1);
  std::vector<std::uint64_t> ids;
  {
    Process process(medium, "boot", AcceptanceJournal::usual_fill_octets);
    ASSERT_TRUE(process.write(true));
    for (std::uint16_t i = 0; i < 200; ++i) ids.push_back(process.accept(uplinked(i, i + 1U, 900)));
    ASSERT_TRUE(process.write(true));
    EXPECT_EQ(process.journal().counters().snapshots, 2U);
  }
  EXPECT_EQ(Process(medium, "boot").journal().open(), ids.size());
}

TEST(AcceptanceJournal, OneDamagedPlaceCostsItsOwnRecordOnlyAndNeverACounter) {
  for (std::size_t offset = 0; offset < 2500; offset += 7) {
    SimulatedMedium medium(1);
    std::vector<std::uint64_t> ids;
    {
      Process first(medium, "boot");
      first.write(true);
      for (std::uint16_t i = 1; i <= 20; ++i) {
        ids.push_back(first.accept(uplinked(i, i)));
        first.write(true);
      }
    }
    if (offset >= medium.read(0).size()) break;
    medium.flip(0, offset);
    Process second(medium, "boot");
    EXPECT_GE(second.journal().open(), 19U) << offset;
    EXPECT_GE(second.journal().link().associations.at(0).counter, 19U) << offset;
    EXPECT_GE(second.journal().next_id(), ids[18]) << offset;
  }
}

/// The test's own account of a process' actions.
struct Model {
  std::map<std::uint64_t, UplinkedPacket> accepted;  ///< by id
  std::set<std::uint64_t> durable;                   ///< report 1,1 was sent
  std::set<std::uint64_t> ended;
  std::set<std::uint64_t> ended_durably;
  std::set<std::uint64_t> refused;  ///< must not return once the refusal is durable
  std::set<std::uint64_t> refused_durably;
  std::uint64_t counter = 0;
  std::uint64_t durable_counter = 0;
};

void check(const Process& after, AcceptanceJournal& journal, const Model& model) {
  for (const std::uint64_t id : model.durable) {
    const AcceptedTelecommand* t = after.find(id);
    const bool may_be_forgotten = model.ended.contains(id);
    ASSERT_TRUE(t != nullptr || may_be_forgotten) << "accepted telecommand " << id << " is lost";
    ASSERT_TRUE(!model.ended_durably.contains(id) || t == nullptr || t->end) << id << " comes again";
  }
  for (const AcceptedTelecommand* t : journal.known()) {
    ASSERT_TRUE(model.accepted.contains(t->origin.id)) << "nobody sent " << t->origin.id;
    const UplinkedPacket& sent = model.accepted.at(t->origin.id);
    ASSERT_TRUE(t->end ? model.ended.contains(t->origin.id) : t->packet == sent.packet) << t->origin.id;
    ASSERT_EQ(t->frame.counter, sent.frame.counter);
    ASSERT_FALSE(model.refused_durably.contains(t->origin.id)) << "a refused one comes back";
    ASSERT_LT(t->origin.id, journal.next_id());
  }
  if (model.durable_counter > 0) {
    ASSERT_FALSE(journal.link().associations.empty());
    ASSERT_GE(journal.link().associations.at(0).counter, model.durable_counter)
        << "old frames would be taken";
  }
}

/// One step of a mission; everything but the medium's behaviour follows from the seed.
void step(Process& process, Model& model, std::mt19937_64& random) {
  AcceptanceJournal& journal = process.journal();
  std::vector<std::uint64_t> open;
  for (const AcceptedTelecommand* t : journal.known()) {
    if (!t->end) open.push_back(t->origin.id);
  }
  const auto pick = [&] { return open[random() % open.size()]; };
  std::vector<std::uint64_t> waiting;
  switch (random() % 4) {
    case 0:
    case 1:
      for (std::uint64_t n = 1 + random() % 3; n > 0 && journal.has_room(); --n) {
        ++model.counter;
        const UplinkedPacket packet =
            uplinked(static_cast<std::uint16_t>(model.counter), model.counter, random() % 200);
        // The id is known before the call can end in a power loss.
        model.accepted[journal.next_id()] = packet;
        const std::uint64_t id = journal.accept(telecommand_of(packet, at(1000)), packet, at(0));
        ASSERT_FALSE(model.durable.contains(id)) << "an id is given twice";
        waiting.push_back(id);
      }
      process.write(true);
      for (const std::uint64_t id : waiting) {
        if (random() % 8 == 0) {
          model.refused.insert(id);
          process.stage(id, Stage::acceptance, false, 11);
        } else {
          model.durable.insert(id);
          process.stage(id, Stage::acceptance);
        }
      }
      model.durable_counter = model.counter;
      return;
    case 2:
      if (open.empty()) return;
      if (const std::uint64_t id = pick(); model.durable.contains(id)) {
        model.ended.insert(id);
        process.stage(id, Stage::start);
        process.stage(id, Stage::completion, random() % 2 == 0, 33);
        process.write(random() % 2 == 0);
      }
      return;
    default:
      journal.on_told(journal.serial());
      process.write(true);
      model.ended_durably = model.ended;
      model.refused_durably = model.refused;
  }
}

TEST(AcceptanceJournalProperties, NothingAcceptedIsLostAndNothingComesTwiceWhereverThePowerIsLost) {
  std::uint64_t losses = 0;
  constexpr unsigned stride = testing_support::slow ? 3 : 1;
  for (std::uint64_t lose_at = 0; lose_at < 240; lose_at += stride) {
    SCOPED_TRACE(testing::Message() << "power lost in call " << lose_at);
    SimulatedMedium medium(lose_at);
    std::mt19937_64 random(lose_at / 8);  // several outcomes for the unsynced octets at each point
    Model model;
    medium.lose_at = lose_at;
    for (int boot = 0; boot < 3; ++boot) {
      Process process(medium, "boot " + std::to_string(boot), 4096);
      ASSERT_NO_FATAL_FAILURE(check(process, process.journal(), model));
      // A telecommand found here counts as durable, even if the previous process refused it or had not made
      // it durable.
      for (const AcceptedTelecommand* t : process.journal().known()) {
        model.durable.insert(t->origin.id);
        model.refused.erase(t->origin.id);
        if (!t->end) model.ended.erase(t->origin.id);
      }
      try {
        process.write(true);
        for (int i = 0; i < 80; ++i) ASSERT_NO_FATAL_FAILURE(step(process, model, random));
      } catch (const PowerLoss&) {
        ++losses;
      }
      medium.lose_at = medium.calls + random() % 60;
    }
    medium.lose_at = UINT64_MAX;
    Process last(medium, "last");
    ASSERT_NO_FATAL_FAILURE(check(last, last.journal(), model));
  }
  EXPECT_GT(losses, testing_support::slow ? 160U : 500U);
}

}  // namespace
}  // namespace srfs
