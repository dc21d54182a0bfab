// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lib/cfdp/test/simulated_link.hpp"

namespace srfs::cfdp {
namespace {

using testing::ElementsAre;
using testing::SizeIs;
using wire::CfdpFileStatus;

Octets text(std::string_view words) {
  return {words.begin(), words.end()};
}

/// The kind of a PDU, as text.
std::string name_of(const CfdpBody& body) {
  if (std::holds_alternative<wire::CfdpMetadata>(body)) return "metadata";
  if (std::holds_alternative<wire::CfdpFileData>(body)) return "data";
  if (std::holds_alternative<wire::CfdpEof>(body)) return "eof";
  if (std::holds_alternative<wire::CfdpFinished>(body)) return "finished";
  if (const auto* ack = std::get_if<wire::CfdpAck>(&body))
    return ack->of_finished ? "ack finished" : "ack eof";
  if (std::holds_alternative<wire::CfdpNak>(body)) return "nak";
  if (std::holds_alternative<wire::CfdpPrompt>(body)) return "prompt";
  return "keep alive";
}

/// A perfect link on which a test may drop selected PDUs.
class CfdpTransfer : public testing::Test {
 protected:
  SimulatedLink link_;
  std::vector<std::string> sent_;  // sender and kind, for example "1 metadata"
  std::vector<std::pair<std::uint64_t, Octets>> octets_;
  std::function<bool(std::uint64_t from, const std::string& kind)> passes_ = [](auto, const auto&) {
    return true;
  };

  CfdpTransfer() {
    link_.on_line = [this](std::uint64_t from, OctetView pdu) {
      const std::string kind = name_of(wire::decode_cfdp_pdu(pdu).value().body);
      sent_.push_back(std::to_string(from) + " " + kind);
      octets_.emplace_back(from, Octets(pdu.begin(), pdu.end()));
      return passes_(from, kind);
    };
  }
  Settings& settings(std::uint64_t end) { return link_.at(end).settings; }
  MemoryFileStore& files(std::uint64_t end) { return link_.at(end).files; }
  Entity& entity(std::uint64_t end) { return link_.entity(end); }
  /// From the ground to the satellite.
  TransactionId put(Octets file, const std::string& destination = "b") {
    link_.start();
    files(ground).add("a", std::move(file));
    return entity(ground).put("a", destination).value();
  }
  bool run(seconds at_most = seconds(3600)) { return link_.run(link_.now + at_most); }
  std::vector<CfdpCondition> faults(std::uint64_t end) {
    std::vector<CfdpCondition> conditions;
    for (const Event& e : link_.events_of(end, EventKind::fault)) conditions.push_back(e.outcome.condition);
    return conditions;
  }
  std::ptrdiff_t count(const std::string& line) { return std::count(sent_.begin(), sent_.end(), line); }
  Rest rest_of(std::uint64_t end) {
    const auto all = entity(end).transactions();
    return all.empty() ? Rest::none : all.front().rest;
  }
};

TEST_F(CfdpTransfer, OfASmallFileTakesMetadataDataEofAndTheThreeAnswers) {
  const auto id = put(text("123456789"));
  ASSERT_TRUE(run());
  EXPECT_THAT(sent_,
              ElementsAre("1 metadata", "1 data", "1 eof", "2 ack eof", "2 finished", "1 ack finished"));
  EXPECT_EQ(*files(satellite).content("b"), text("123456789"));
  EXPECT_EQ(entity(ground).outcome_of(id), Outcome{});
  EXPECT_EQ(entity(satellite).outcome_of(id), Outcome{});
  EXPECT_TRUE(link_.idle());
}

TEST_F(CfdpTransfer, OfAnEmptyFileMakesAnEmptyFile) {
  put({});
  ASSERT_TRUE(run());
  ASSERT_NE(files(satellite).content("b"), nullptr);
  EXPECT_TRUE(files(satellite).content("b")->empty());
}

TEST_F(CfdpTransfer, WorksWithEveryLengthOfIdsWithCrcAndWithEveryChecksum) {
  link_.start();
  for (const std::uint8_t octets : std::initializer_list<std::uint8_t>{1, 2, 4, 8}) {
    for (const auto checksum : {wire::CfdpChecksumType::modular, wire::CfdpChecksumType::crc32,
                                wire::CfdpChecksumType::crc32c, wire::CfdpChecksumType::null}) {
      Settings s = settings(ground);
      s.entity_id_octets = s.sequence_number_octets = octets;
      s.crc = octets == 2;
      s.checksum = checksum;
      link_.ends[0].entity =
          std::make_unique<Entity>(s, files(ground), 100 + octets + static_cast<std::uint64_t>(checksum) * 8);
      files(ground).add("a", random_file(5000, octets));
      ASSERT_TRUE(entity(ground).put("a", "b"));
      ASSERT_TRUE(run());
      EXPECT_EQ(*files(satellite).content("b"), *files(ground).content("a"));
      files(satellite).files.clear();
    }
  }
}

TEST_F(CfdpTransfer, SurvivesTheLossOfEachPduOnce) {
  for (const std::string lost :
       {"1 metadata", "1 data", "1 eof", "2 ack eof", "2 finished", "1 ack finished"}) {
    SimulatedLink link;
    bool done = false;
    link.on_line = [&](std::uint64_t from, OctetView pdu) {
      const bool hit =
          std::to_string(from) + " " + name_of(wire::decode_cfdp_pdu(pdu)->body) == lost && !done;
      done = done || hit;
      return !hit;
    };
    link.start();
    link.at(ground).files.add("a", random_file(3000, 1));
    const auto id = link.entity(ground).put("a", "b");
    ASSERT_TRUE(link.run(link.now + seconds(60))) << lost;
    ASSERT_TRUE(done) << lost;
    EXPECT_EQ(link.entity(ground).outcome_of(*id), Outcome{}) << lost;
    EXPECT_EQ(link.entity(satellite).outcome_of(*id), Outcome{}) << lost;
    EXPECT_EQ(*link.at(satellite).files.content("b"), random_file(3000, 1)) << lost;
  }
}

TEST_F(CfdpTransfer, IsNotDisturbedByPdusThatComeAgainAfterItsEnd) {
  const auto id = put(random_file(3000, 2));
  ASSERT_TRUE(run());
  const auto before = octets_;
  files(satellite).files.clear();
  for (const auto& [from, pdu] : before) entity(from == ground ? satellite : ground).on_pdu(pdu, link_.now);
  ASSERT_TRUE(run());
  EXPECT_TRUE(link_.idle());
  EXPECT_EQ(files(satellite).content("b"), nullptr);
  EXPECT_EQ(entity(satellite).outcome_of(id), Outcome{});
  EXPECT_GT(entity(satellite).counts().late, 0U);
  EXPECT_GT(entity(ground).counts().late, 0U);
}

TEST_F(CfdpTransfer, AnUnknownSenderIsToldThatItsFileIsFinishedForAll) {
  link_.start();
  const CfdpHeader header{.source_entity = ground, .sequence_number = 77, .destination_entity = satellite};
  entity(ground).on_pdu(wire::encode_cfdp_pdu(header, wire::CfdpFinished{}), link_.now);
  const auto pdu = entity(ground).next_pdu(980, link_.now);
  ASSERT_TRUE(pdu);
  const auto ack = std::get<wire::CfdpAck>(wire::decode_cfdp_pdu(*pdu)->body);
  EXPECT_TRUE(ack.of_finished);
  EXPECT_EQ(ack.status, wire::CfdpTransactionStatus::unrecognized);
  EXPECT_EQ(entity(ground).counts().no_transaction, 1U);
}

TEST_F(CfdpTransfer, RefusesWhatIsMalformedOfClass1OrForOthers) {
  link_.start();
  CfdpHeader header{.source_entity = ground, .sequence_number = 1, .destination_entity = satellite};
  const std::uint8_t octet[] = {1};
  const wire::CfdpFileData data{.offset = 0, .data = octet};
  Entity& e = entity(satellite);
  e.on_pdu(octet, link_.now);
  header.unacknowledged = true;
  e.on_pdu(wire::encode_cfdp_pdu(header, data), link_.now);
  header.unacknowledged = false;
  header.destination_entity = 3;
  e.on_pdu(wire::encode_cfdp_pdu(header, data), link_.now);
  header = {.source_entity = 4, .sequence_number = 1, .destination_entity = satellite};
  e.on_pdu(wire::encode_cfdp_pdu(header, data), link_.now);
  EXPECT_EQ(e.counts().malformed[static_cast<std::size_t>(wire::CfdpPduError::too_short)], 1U);
  EXPECT_EQ(e.counts().class_1, 1U);
  EXPECT_EQ(e.counts().not_for_us, 2U);
  EXPECT_TRUE(e.transactions().empty());
}

TEST_F(CfdpTransfer, RefusesMoreTransactionsThanItHasRoomFor) {
  settings(satellite).transactions_max = 2;
  settings(ground).transactions_max = 3;
  settings(satellite).fault_handlers.set(CfdpCondition::inactivity, FaultHandler::cancel);
  link_.start();
  for (const char* name : {"a", "b", "c", "d"}) files(ground).add(name, random_file(1000, 1));
  EXPECT_TRUE(entity(ground).put("a", "a"));
  EXPECT_TRUE(entity(ground).put("b", "b"));
  EXPECT_TRUE(entity(ground).put("c", "c"));
  EXPECT_EQ(entity(ground).put("d", "d").error(), PutError::no_room);
  ASSERT_TRUE(run());
  EXPECT_TRUE(link_.idle());
  EXPECT_EQ(files(satellite).files.size(), 3U);  // the third file had to wait
}

/// Acts as a hostile ground: sends the first PDUs of files that never follow.
void announce(Entity& entity, std::uint64_t first, std::uint64_t files, std::uint64_t octets,
              MonotonicTime now) {
  for (std::uint64_t i = first; i < first + files; ++i) {
    const CfdpHeader header{.source_entity = ground, .sequence_number = i, .destination_entity = satellite};
    entity.on_pdu(
        wire::encode_cfdp_pdu(header, wire::CfdpMetadata{.file_size = octets,
                                                         .source_file = "a",
                                                         .destination_file = "b" + std::to_string(i),
                                                         .options = {}}),
        now);
  }
}

TEST_F(CfdpTransfer, AnnouncedFilesLeaveRoomToSend) {
  link_.start();
  announce(entity(satellite), 500, 100, 1000, link_.now);
  EXPECT_THAT(entity(satellite).transactions(), SizeIs(settings(satellite).receiving_max));
  EXPECT_EQ(entity(satellite).counts().no_room, 100 - settings(satellite).receiving_max);
  files(satellite).add("a", random_file(3000, 1));
  for (std::size_t i = settings(satellite).receiving_max; i < settings(satellite).transactions_max; ++i)
    EXPECT_TRUE(entity(satellite).put("a", "down" + std::to_string(i)));
  EXPECT_EQ(entity(satellite).put("a", "one more").error(), PutError::no_room);
  (void)run(seconds(60));
  EXPECT_NE(files(ground).content("down8"), nullptr);
}

TEST_F(CfdpTransfer, ANewFileTakesThePlaceOfTheOneThatWasAwaitedInVainForLongest) {
  link_.start();
  const auto id_of = [](std::uint64_t sequence) {
    return TransactionId{.source = ground, .sequence = sequence};
  };
  announce(entity(satellite), 500, 8, 1000, link_.now);
  const CfdpHeader begun{.source_entity = ground, .sequence_number = 500, .destination_entity = satellite};
  const Octets data(1);
  entity(satellite).on_pdu(wire::encode_cfdp_pdu(begun, wire::CfdpFileData{.offset = 0, .data = data}),
                           link_.now);
  ASSERT_TRUE(entity(satellite).suspend(id_of(501)));
  link_.run_for(seconds(10));
  announce(entity(satellite), 502, 1, 1000, link_.now);  // heard again
  announce(entity(satellite), 600, 1, 1000, link_.now);
  EXPECT_EQ(entity(satellite).counts().no_room, 1U) << "nothing rests yet";

  link_.run_for(seconds(70));
  files(ground).add("a", random_file(3000, 1));
  const auto id = entity(ground).put("a", "b").value();
  link_.run_for(seconds(20));
  EXPECT_EQ(entity(satellite).outcome_of(id), Outcome{});
  ASSERT_TRUE(entity(ground).put("a", "c"));
  link_.run_for(seconds(20));
  EXPECT_NE(files(satellite).content("c"), nullptr) << "in the same place";
  const Counters& counts = entity(satellite).counts();
  EXPECT_EQ(counts.displaced, 1U);
  EXPECT_EQ(counts.no_room, 1U);
  const auto faults = link_.events_of(satellite, EventKind::fault);
  ASSERT_FALSE(faults.empty());
  EXPECT_EQ(faults.back().id, id_of(503));
  EXPECT_EQ(faults.back().handler, FaultHandler::abandon);
  EXPECT_TRUE(entity(satellite).outcome_of(id_of(503))->incomplete);

  // A transaction with data, or one suspended by request, keeps its place for ever.
  announce(entity(satellite), 700, 100, 1000, link_.now);
  std::set<std::uint64_t> left;
  for (const Report& report : entity(satellite).transactions()) left.insert(report.id.sequence);
  EXPECT_EQ(left, (std::set<std::uint64_t>{500, 501, 700, 701, 702, 703, 704, 705}));
  EXPECT_EQ(counts.no_room, 1U + 94U);
}

TEST_F(CfdpTransfer, AFileThatAnnouncesMoreThanTheQuotaIsRefusedAtOnce) {
  settings(satellite).receiving_octets_max = 2000;
  link_.start();
  announce(entity(satellite), 500, 1, 2001, link_.now);
  EXPECT_THAT(faults(satellite), ElementsAre(CfdpCondition::filestore_rejection));
  EXPECT_EQ(files(satellite).temporaries(), 0U);
}

TEST_F(CfdpTransfer, FilesThatComeShareAQuotaOfWhatIsThere) {
  settings(satellite).receiving_octets_max = 10'000;
  const auto first = put(random_file(9000, 1), "first");
  link_.run_for(milliseconds(350));
  const auto half = entity(satellite).transactions().front().progress_octets;
  ASSERT_TRUE(half > 2000 && half < 8000) << half;
  // An announced file takes no room: the first file still arrives.
  announce(entity(satellite), 500, 1, 9000, link_.now);
  ASSERT_TRUE(entity(satellite).transactions().size() == 2);
  (void)run(seconds(20));
  EXPECT_EQ(entity(satellite).outcome_of(first), Outcome{});
  // The first file's octets no longer count; those of the next file do.
  const CfdpHeader header{.source_entity = ground, .sequence_number = 500, .destination_entity = satellite};
  const Octets data(900);
  for (std::uint64_t i = 0; i < 9; ++i)
    entity(satellite).on_pdu(
        wire::encode_cfdp_pdu(header, wire::CfdpFileData{.offset = i * 900, .data = data}), link_.now);
  announce(entity(satellite), 501, 1, 9000, link_.now);
  const CfdpHeader other{.source_entity = ground, .sequence_number = 501, .destination_entity = satellite};
  for (std::uint64_t i = 0; i < 3; ++i)
    entity(satellite).on_pdu(
        wire::encode_cfdp_pdu(other, wire::CfdpFileData{.offset = i * 900, .data = data}), link_.now);
  const auto said = link_.events_of(satellite, EventKind::fault);
  ASSERT_THAT(said, SizeIs(1));
  EXPECT_EQ(said[0].id.sequence, 501U);
  EXPECT_EQ(said[0].file_fault, FileFault::no_space);
  EXPECT_EQ(files(satellite).temporaries(), 1U);
}

// ---- suspension and cancellation ----------------------------------------------------------------------

TEST_F(CfdpTransfer, RestsWhenSuspendedAlsoOverARestartAndGoesOnWhenResumed) {
  for (const std::uint64_t end : {ground, satellite}) {
    sent_.clear();
    const auto id = put(random_file(30'000, 3), "b" + std::to_string(end));
    link_.run_for(milliseconds(500));
    ASSERT_TRUE(entity(end).suspend(id));
    link_.kill(link_.at(end), milliseconds(5));
    link_.run_for(milliseconds(100));
    EXPECT_EQ(rest_of(end), Rest::by_request);
    (void)link_.run(link_.now + seconds(3600));
    EXPECT_EQ(rest_of(end), Rest::by_request);
    const auto silent = sent_.size();
    (void)link_.run(link_.now + seconds(3600));
    EXPECT_EQ(sent_.size(), silent);

    ASSERT_TRUE(entity(end).resume(id, link_.now));
    (void)entity(ground).resume(id, link_.now);  // the ground may be suspended by a fault
    ASSERT_TRUE(run());
    EXPECT_EQ(entity(ground).outcome_of(id), Outcome{});
    EXPECT_EQ(*files(satellite).content("b" + std::to_string(end)), random_file(30'000, 3));
  }
}

TEST_F(CfdpTransfer, WithoutLinkNothingGoesOutAndNoTimerRuns) {
  const auto id = put(random_file(30'000, 3));
  link_.run_for(milliseconds(500));
  for (auto& end : link_.ends) end.entity->set_link(false, link_.now);
  const auto sent = sent_.size();
  ASSERT_TRUE(run());  // nothing is due
  link_.now += seconds(50'000);
  EXPECT_EQ(sent_.size(), sent);
  for (auto& end : link_.ends) end.entity->set_link(true, link_.now);
  ASSERT_TRUE(run());
  EXPECT_EQ(entity(ground).outcome_of(id), Outcome{});
  EXPECT_TRUE(faults(ground).empty());
  EXPECT_TRUE(faults(satellite).empty());
}

TEST_F(CfdpTransfer, EndsAtBothEndsWhenEitherCancels) {
  for (const std::uint64_t end : {ground, satellite}) {
    const auto id = put(random_file(30'000, 3), "never");
    link_.run_for(milliseconds(500));
    ASSERT_TRUE(entity(end).cancel(id, link_.now));
    ASSERT_TRUE(run());
    EXPECT_TRUE(link_.idle());
    for (const std::uint64_t e : {ground, satellite}) {
      const auto outcome = entity(e).outcome_of(id);
      ASSERT_TRUE(outcome);
      EXPECT_EQ(outcome->condition, CfdpCondition::cancel_request);
      EXPECT_TRUE(outcome->incomplete);
    }
    EXPECT_EQ(files(satellite).content("never"), nullptr);
    EXPECT_EQ(files(satellite).temporaries(), 0U);
  }
  EXPECT_FALSE(entity(ground).cancel({.source = ground, .sequence = 999}, link_.now));
}

TEST_F(CfdpTransfer, ACancellationThatNobodyAcknowledgesEndsAtTheLimit) {
  const auto id = put(random_file(30'000, 3));
  link_.run_for(milliseconds(500));
  passes_ = [](std::uint64_t, const std::string& kind) { return kind != "eof"; };
  ASSERT_TRUE(entity(ground).cancel(id, link_.now));
  (void)run();
  EXPECT_EQ(count("1 eof"), static_cast<std::ptrdiff_t>(settings(ground).ack_limit));
  EXPECT_EQ(entity(ground).outcome_of(id)->condition, CfdpCondition::cancel_request);
}

// ---- limits and fault handlers ------------------------------------------------------------------------

TEST_F(CfdpTransfer, SuspendsAtTheAckLimitAndGoesOnWhenThePeerIsHeard) {
  bool cut = true;
  passes_ = [&](std::uint64_t from, const std::string&) { return !(cut && from == satellite); };
  const auto id = put(random_file(3000, 3));
  (void)run(seconds(300));
  EXPECT_EQ(count("1 eof"), static_cast<std::ptrdiff_t>(settings(ground).ack_limit));
  EXPECT_THAT(faults(ground), ElementsAre(CfdpCondition::positive_ack_limit));
  EXPECT_EQ(rest_of(ground), Rest::by_fault);

  cut = false;
  ASSERT_TRUE(entity(ground).resume(id, link_.now));  // the satellite still knows the outcome
  ASSERT_TRUE(run());
  EXPECT_EQ(entity(ground).outcome_of(id), Outcome{});
  EXPECT_EQ(entity(satellite).outcome_of(id), Outcome{});
}

TEST_F(CfdpTransfer, AFinishedThatNobodyAcknowledgesIsAbandonedAtItsLimitHoweverOftenThePeerIsHeard) {
  passes_ = [](std::uint64_t, const std::string& kind) { return kind != "ack finished"; };
  const auto id = put(random_file(3000, 3));
  for (int contact = 0; contact < 10; ++contact) {
    (void)run(seconds(600));
    (void)entity(satellite).resume(id, link_.now);  // as at every contact
  }
  EXPECT_EQ(count("2 finished"), static_cast<std::ptrdiff_t>(settings(satellite).ack_limit));
  const auto said = link_.events_of(satellite, EventKind::fault);
  ASSERT_THAT(said, SizeIs(1));
  EXPECT_EQ(said[0].outcome.condition, CfdpCondition::positive_ack_limit);
  EXPECT_EQ(said[0].handler, FaultHandler::abandon);
  EXPECT_EQ(entity(satellite).outcome_of(id), Outcome{});
  EXPECT_EQ(*files(satellite).content("b"), random_file(3000, 3));
  EXPECT_TRUE(entity(satellite).transactions().empty());
}

TEST_F(CfdpTransfer, TheFaultHandlerDecidesWhatALimitDoes) {
  const auto outcome_with = [](FaultHandler handler) {
    SimulatedLink link;
    link.at(ground).settings.fault_handlers.set(CfdpCondition::positive_ack_limit, handler);
    link.at(ground).settings.ack_limit = 2;
    link.on_line = [](std::uint64_t from, OctetView) { return from == ground; };  // no answer arrives
    link.start();
    link.at(ground).files.add("a", random_file(100, 1));
    const auto id = link.entity(ground).put("a", "b").value();
    (void)link.run(link.now + seconds(100));
    const auto faults = link.events_of(ground, EventKind::fault);
    EXPECT_FALSE(faults.empty());
    EXPECT_EQ(faults.front().handler, handler);
    return link.entity(ground).outcome_of(id);
  };
  EXPECT_EQ(outcome_with(FaultHandler::cancel)->condition, CfdpCondition::positive_ack_limit);
  EXPECT_EQ(outcome_with(FaultHandler::abandon)->condition, CfdpCondition::positive_ack_limit);
  EXPECT_FALSE(outcome_with(FaultHandler::suspend));
  EXPECT_FALSE(outcome_with(FaultHandler::ignore));
}

TEST_F(CfdpTransfer, ReportsTheNakLimitWhenWhatItAsksForDoesNotCome) {
  settings(satellite).inactivity_interval = settings(ground).inactivity_interval = seconds(3600);
  settings(satellite).nak_limit = 4;
  bool first = true;
  passes_ = [&](std::uint64_t, const std::string& kind) {
    const bool lost = kind == "data" && first;
    first = first && !lost;
    return !lost && !(kind == "nak");
  };
  put(random_file(3000, 3));
  (void)run(seconds(300));
  EXPECT_EQ(count("2 nak"), 5);  // the first and four repetitions
  EXPECT_THAT(faults(satellite), ElementsAre(CfdpCondition::nak_limit));
  EXPECT_EQ(rest_of(satellite), Rest::by_fault);
}

TEST_F(CfdpTransfer, ReportsInactivityWhenTheSenderFallsSilent) {
  put(random_file(30'000, 3));
  link_.run_for(milliseconds(500));
  passes_ = [](std::uint64_t, const std::string&) { return false; };
  (void)run(seconds(600));
  EXPECT_THAT(faults(satellite), ElementsAre(CfdpCondition::inactivity));
}

TEST_F(CfdpTransfer, RemindsAReceiverThatNeverFinishesAndThenReportsInactivity) {
  passes_ = [](std::uint64_t, const std::string& kind) { return kind != "finished"; };
  settings(satellite).ack_limit = 1;
  put(random_file(300, 3));
  (void)run(seconds(3600));
  EXPECT_EQ(count("1 eof"), 1 + static_cast<std::ptrdiff_t>(settings(ground).inactivity_limit));
  EXPECT_THAT(faults(ground), ElementsAre(CfdpCondition::inactivity));
}

// ---- files --------------------------------------------------------------------------------------------

TEST_F(CfdpTransfer, IsCancelledWhenTheFileChangesUnderTheSender) {
  const std::vector<std::pair<std::function<void(MemoryFileStore&)>, CfdpCondition>> changes = {
      {[](auto& f) { f.add("a", random_file(29'999, 4)); }, CfdpCondition::file_size_error},
      {[](auto& f) { f.add("a", random_file(30'000, 4)); }, CfdpCondition::file_checksum_failure},
      {[](auto& f) { f.files.erase("a"); }, CfdpCondition::filestore_rejection},
  };
  for (const auto& [change, condition] : changes) {
    const auto id = put(random_file(30'000, 3), "changed");
    link_.run_for(milliseconds(500));
    change(files(ground));
    link_.at(ground).events.clear();
    ASSERT_TRUE(run());
    EXPECT_THAT(faults(ground), ElementsAre(condition));  // the sender itself detects the fault
    EXPECT_EQ(entity(ground).outcome_of(id)->condition, condition);
    EXPECT_EQ(entity(satellite).outcome_of(id)->condition, condition);
    EXPECT_EQ(files(satellite).content("changed"), nullptr);
  }
}

TEST_F(CfdpTransfer, IsRefusedByTheReceiversDiskWithTheReason) {
  struct Case {
    const char* destination;
    std::function<void(MemoryFileStore&)> prepare;
    FileFault fault;
  };
  const std::vector<Case> cases = {
      {"../etc/passwd", [](auto&) {}, FileFault::bad_name},
      {"/etc/passwd", [](auto&) {}, FileFault::bad_name},
      {"b", [](auto& f) { f.room_fault = FileFault::no_space; }, FileFault::no_space},
      {"b", [](auto& f) { f.write_fault = FileFault::no_space; }, FileFault::no_space},
      {"b", [](auto& f) { f.commit_fault = FileFault::denied; }, FileFault::denied},
  };
  for (const Case& c : cases) {
    SimulatedLink link;
    link.start();
    c.prepare(link.at(satellite).files);
    link.at(ground).files.add("a", random_file(3000, 1));
    const auto id = link.entity(ground).put("a", c.destination).value();
    ASSERT_TRUE(link.run(link.now + seconds(600)));
    ASSERT_TRUE(link.idle());
    const auto outcome = link.entity(ground).outcome_of(id);
    ASSERT_TRUE(outcome);
    EXPECT_EQ(outcome->condition, CfdpCondition::filestore_rejection);
    EXPECT_EQ(outcome->file_status, CfdpFileStatus::rejected);
    const auto faults = link.events_of(satellite, EventKind::fault);
    ASSERT_THAT(faults, SizeIs(1));
    EXPECT_EQ(faults[0].file_fault, c.fault);
    EXPECT_EQ(link.at(satellite).files.temporaries(), 0U);
    EXPECT_TRUE(link.at(satellite).files.files.empty());
  }
}

TEST_F(CfdpTransfer, RefusesAFileThatIsTooLargeForTheReceiver) {
  settings(satellite).file_octets_max = 2000;
  const auto id = put(random_file(3000, 1));
  ASSERT_TRUE(run());
  EXPECT_EQ(entity(ground).outcome_of(id)->condition, CfdpCondition::filestore_rejection);
}

TEST_F(CfdpTransfer, FindsAFileWithTheRightChecksumAndTheWrongHash) {
  // Swapping two words leaves the modular checksum unchanged.
  Octets file = random_file(4000, 1);
  link_.start();
  files(ground).add("a", file);
  const auto id = entity(ground).put("a", "b").value();
  while (files(ground).checkpoint.empty() || entity(ground).transactions()[0].file_octets == std::nullopt) {
    entity(ground).advance(link_.now);
  }
  std::swap_ranges(file.begin(), file.begin() + 4, file.begin() + 8);
  files(ground).files["a"].octets = file;  // changed unnoticed: the time stamp is the same
  ASSERT_TRUE(run());
  EXPECT_EQ(entity(ground).outcome_of(id)->condition, CfdpCondition::file_checksum_failure);
  EXPECT_EQ(files(satellite).content("b"), nullptr);
}

TEST_F(CfdpTransfer, RefusesAChecksumTypeItDoesNotKnowUnlessToldToIgnoreThat) {
  for (const bool ignore : {false, true}) {
    SimulatedLink link;
    if (ignore) {
      link.at(satellite).settings.fault_handlers.set(CfdpCondition::unsupported_checksum_type,
                                                     FaultHandler::ignore);
    }
    link.start();
    Entity& e = link.entity(satellite);
    const CfdpHeader header{.source_entity = ground, .sequence_number = 1, .destination_entity = satellite};
    const Octets data = text("abcd");
    e.on_pdu(wire::encode_cfdp_pdu(
                 header,
                 wire::CfdpMetadata{
                     .checksum_type = 1, .file_size = 4, .source_file = "a", .destination_file = "b"}),
             link.now);
    e.on_pdu(wire::encode_cfdp_pdu(header, wire::CfdpFileData{.offset = 0, .data = data}), link.now);
    e.on_pdu(wire::encode_cfdp_pdu(header, wire::CfdpEof{.checksum = 0, .file_size = 4}), link.now);
    (void)link.run(link.now + seconds(1));
    EXPECT_EQ(link.at(satellite).files.content("b") != nullptr, ignore);
  }
}

TEST_F(CfdpTransfer, RefusesDataBehindTheEndOfTheFile) {
  const auto id = put(random_file(1000, 1));
  passes_ = [](std::uint64_t, const std::string& kind) { return kind != "metadata" && kind != "nak"; };
  link_.run_for(milliseconds(1000));
  const std::uint8_t octet[] = {1};
  const CfdpHeader header{
      .source_entity = id.source, .sequence_number = id.sequence, .destination_entity = satellite};
  entity(satellite).on_pdu(wire::encode_cfdp_pdu(header, wire::CfdpFileData{.offset = 1000, .data = octet}),
                           link_.now);
  passes_ = [](std::uint64_t, const std::string&) { return true; };
  ASSERT_TRUE(run());
  EXPECT_EQ(entity(ground).outcome_of(id)->condition, CfdpCondition::file_size_error);
}

TEST_F(CfdpTransfer, ArrivesWithFarTooFewGapsToRemember) {
  SimulatedLink link({.loss = 0.3, .jitter = milliseconds(200)}, 7);
  for (auto& end : link.ends) end.settings.gaps_max = 3;
  link.start();
  link.at(ground).files.add("a", random_file(100'000, 9));
  const auto id = link.entity(ground).put("a", "b").value();
  ASSERT_TRUE(link.run(link.now + seconds(3600)));
  EXPECT_EQ(link.entity(ground).outcome_of(id), Outcome{});
  EXPECT_GT(link.entity(satellite).counts().dropped_data, 0U);
  EXPECT_EQ(*link.at(satellite).files.content("b"), random_file(100'000, 9));
}

TEST_F(CfdpTransfer, ReadsAFileInPiecesWhateverItsSize) {
  settings(ground).work_octets = settings(satellite).work_octets = 4096;
  put(random_file(100'000, 9));
  ASSERT_TRUE(run());
  EXPECT_EQ(*files(satellite).content("b"), random_file(100'000, 9));
  EXPECT_LE(files(ground).largest_read, 4096U);
  EXPECT_LE(files(satellite).largest_read, 4096U);
}

TEST_F(CfdpTransfer, PutNamesWhatIsWrong) {
  link_.start();
  settings(ground).file_octets_max = 10;
  link_.ends[0].entity = std::make_unique<Entity>(settings(ground), files(ground), 1);
  files(ground).add("a", random_file(11, 1));
  EXPECT_EQ(entity(ground).put("a", "b").error(), PutError::file_too_large);
  EXPECT_EQ(entity(ground).put("missing", "b").error(), PutError::file_refused);
  EXPECT_EQ(entity(ground).put("../a", "b").error(), PutError::file_refused);
  EXPECT_EQ(entity(ground).put("a", "").error(), PutError::name_too_long);
  EXPECT_EQ(entity(ground).put("a", std::string(256, 'x')).error(), PutError::name_too_long);
}

// ---- state across a restart ---------------------------------------------------------------------------

TEST_F(CfdpTransfer, SequenceNumbersAreNeverUsedTwice) {
  link_.start();
  files(ground).add("a", random_file(10, 1));
  std::vector<std::uint64_t> used;
  for (int restart = 0; restart < 5; ++restart) {
    for (int n = 0; n < 3; ++n) used.push_back(entity(ground).put("a", "b").value().sequence);
    ASSERT_TRUE(run());
    link_.kill(link_.at(ground), milliseconds(1));
    ASSERT_TRUE(run());
  }
  std::sort(used.begin(), used.end());
  EXPECT_EQ(std::adjacent_find(used.begin(), used.end()), used.end());
}

TEST_F(CfdpTransfer, WorksWithoutCheckpointsAndSaysSo) {
  link_.start();
  for (auto& end : link_.ends) end.files.checkpoint_fault = FileFault::denied;
  files(satellite).add("image", random_file(50'000, 1));
  const auto id = entity(satellite).put("image", "image").value();
  ASSERT_TRUE(run());
  EXPECT_EQ(entity(satellite).outcome_of(id), Outcome{});
  EXPECT_FALSE(link_.events_of(satellite, EventKind::checkpoint_failed).empty());
  EXPECT_GT(entity(satellite).counts().checkpoint_failures, 0U);
}

TEST_F(CfdpTransfer, OctetsThatWereNotSyncedAreAskedForAgain) {
  files(satellite).sync_fault = FileFault::io;
  const auto id = put(random_file(60'000, 1));
  link_.run_for(milliseconds(2000));
  link_.kill(link_.at(satellite), milliseconds(1));
  files(satellite).sync_fault.reset();
  ASSERT_TRUE(run());
  EXPECT_EQ(entity(ground).outcome_of(id), Outcome{});
  EXPECT_EQ(*files(satellite).content("b"), random_file(60'000, 1));
}

TEST_F(CfdpTransfer, BeginsAgainWhenTheTemporaryFileIsGone) {
  const auto id = put(random_file(60'000, 1));
  link_.run_for(milliseconds(2000));
  link_.kill(link_.at(satellite), milliseconds(1));
  files(satellite).discard_temporary(id);
  ASSERT_TRUE(run());
  EXPECT_EQ(entity(ground).outcome_of(id), Outcome{});
  EXPECT_EQ(*files(satellite).content("b"), random_file(60'000, 1));
}

TEST_F(CfdpTransfer, AFileThatItsSenderForgotEndsWhereItRestsWhenThePeerIsHeardAgain) {
  link_.start();
  files(ground).checkpoint_fault = FileFault::denied;
  files(ground).add("a", random_file(60'000, 1));
  const auto id = entity(ground).put("a", "b").value();
  link_.run_for(milliseconds(2000));
  link_.kill(link_.at(ground), milliseconds(1));
  (void)link_.run(link_.now + seconds(3600));
  ASSERT_EQ(entity(satellite).transactions().size(), 1U);
  ASSERT_EQ(rest_of(satellite), Rest::by_fault);
  ASSERT_TRUE(entity(satellite).resume(id, link_.now));
  ASSERT_TRUE(run());
  EXPECT_TRUE(entity(satellite).transactions().empty());
  EXPECT_EQ(entity(satellite).outcome_of(id)->condition, CfdpCondition::cancel_request);
  EXPECT_EQ(files(satellite).temporaries(), 0U);
}

TEST_F(CfdpTransfer, AFileThatGotItsNameJustBeforeTheCrashIsRecognised) {
  const auto id = put(random_file(3000, 1));
  passes_ = [](std::uint64_t, const std::string& kind) { return kind != "eof"; };
  link_.run_for(milliseconds(1000));
  passes_ = [](std::uint64_t, const std::string&) { return true; };
  sent_.clear();
  // The satellite's next steps: record EOF (with a sync), record the check, set the name, record the name.
  files(satellite).calls_until_kill = 3;
  files(satellite).kill_after_effect = true;
  ASSERT_TRUE(run());
  ASSERT_FALSE(files(satellite).calls_until_kill);
  EXPECT_EQ(count("1 data"), 0);
  EXPECT_EQ(entity(ground).outcome_of(id), Outcome{});
  EXPECT_EQ(*files(satellite).content("b"), random_file(3000, 1));
}

TEST_F(CfdpTransfer, BeginsAgainWhenTheFileToBeCheckedIsGoneOrAnother) {
  for (const bool another : {false, true}) {
    const auto id = put(random_file(3000, 1));
    passes_ = [](std::uint64_t, const std::string& kind) { return kind != "eof"; };
    link_.run_for(milliseconds(1000));
    passes_ = [](std::uint64_t, const std::string&) { return true; };
    files(satellite).calls_until_kill = 3;
    files(satellite).kill_after_effect = false;  // dies before it sets the name
    while (files(satellite).calls_until_kill) link_.run_for(milliseconds(1));
    files(satellite).discard_temporary(id);
    files(satellite).files.clear();
    if (another) files(satellite).add("b", random_file(3001, 2));
    ASSERT_TRUE(run(seconds(600)));
    EXPECT_EQ(entity(ground).outcome_of(id), Outcome{});
    EXPECT_EQ(*files(satellite).content("b"), random_file(3000, 1));
  }
}

TEST_F(CfdpTransfer, TemporaryFilesOfNobodyAreRemovedAtTheStart) {
  const TransactionId nobody{.source = ground, .sequence = 99};
  ASSERT_TRUE(files(satellite).create_temporary(nobody));
  link_.start();
  EXPECT_EQ(files(satellite).temporaries(), 0U);
}

TEST_F(CfdpTransfer, ADamagedCheckpointMeansAFreshStart) {
  put(random_file(60'000, 1));
  link_.run_for(milliseconds(2000));
  Octets checkpoint = files(satellite).checkpoint;
  checkpoint[checkpoint.size() / 2] ^= 1;
  MemoryFileStore store;
  Entity fresh(settings(satellite), store, 1000);
  EXPECT_EQ(fresh.restore(checkpoint, link_.now).error(), CheckpointError::damaged);
  EXPECT_TRUE(fresh.transactions().empty());
  Entity other(settings(ground), store, 1000);
  EXPECT_EQ(other.restore(files(satellite).checkpoint, link_.now).error(), CheckpointError::other_entity);
}

// ---- prompts ------------------------------------------------------------------------------------------

TEST_F(CfdpTransfer, AnswersPromptsWithItsGapsAndItsProgress) {
  link_.start();
  Entity& e = entity(satellite);
  const CfdpHeader header{.source_entity = ground, .sequence_number = 1, .destination_entity = satellite};
  const Octets data(100);
  const auto give = [&](const CfdpBody& body) { e.on_pdu(wire::encode_cfdp_pdu(header, body), link_.now); };
  give(wire::CfdpMetadata{.file_size = 500, .source_file = "a", .destination_file = "b"});
  give(wire::CfdpFileData{.offset = 0, .data = data});
  give(wire::CfdpFileData{.offset = 300, .data = data});
  give(wire::CfdpPrompt{});
  auto pdu = e.next_pdu(980, link_.now);
  ASSERT_TRUE(pdu);
  EXPECT_THAT(std::get<wire::CfdpNak>(wire::decode_cfdp_pdu(*pdu)->body).segments,
              ElementsAre(CfdpSegment{100, 300}));
  give(wire::CfdpPrompt{.keep_alive = true});
  pdu = e.next_pdu(980, link_.now);
  ASSERT_TRUE(pdu);
  EXPECT_EQ(std::get<wire::CfdpKeepAlive>(wire::decode_cfdp_pdu(*pdu)->body).progress, 400U);
  EXPECT_FALSE(e.next_pdu(980, link_.now));
}

TEST_F(CfdpTransfer, AReceiverTooFarBehindIsAFaultWhenThatIsWatched) {
  settings(ground).keep_alive_limit_octets = 1000;
  const auto id = put(random_file(30'000, 3));
  link_.run_for(milliseconds(500));
  const CfdpHeader header{
      .source_entity = id.source, .sequence_number = id.sequence, .destination_entity = satellite};
  entity(ground).on_pdu(wire::encode_cfdp_pdu(header, wire::CfdpKeepAlive{.progress = 10}), link_.now);
  EXPECT_THAT(faults(ground), ElementsAre(CfdpCondition::keep_alive_limit));
}

TEST(CfdpRestart, NoNumberIsUsedTwiceAlsoWhereTheCheckpointIsOlderThanTheLastFile) {
  MemoryFileStore store;
  store.add("one", Octets(10));
  Entity before(Settings{}, store, 100);
  ASSERT_TRUE(before.put("one", "one"));
  const Octets checkpoint = store.checkpoint;

  Entity after(Settings{}, store, 5000);  // the disk failed meanwhile
  ASSERT_TRUE(after.restore(checkpoint, MonotonicTime(seconds(1))));
  const auto id = after.put("one", "again");
  ASSERT_TRUE(id);
  EXPECT_GE(id->sequence, 5000U);
}

TEST(CfdpRestart, NoNumberIsUsedTwiceWhereNoCheckpointIsWrittenOverSeveralRestarts) {
  MemoryFileStore store;
  store.add("one", Octets(10));
  std::set<std::uint64_t> used;
  for (std::uint64_t clock = 1000; clock < 1050; clock += 10) {
    Entity entity(Settings{}, store, clock);
    ASSERT_TRUE(entity.restore(store.checkpoint, MonotonicTime(seconds(1))));
    const auto id = entity.put("one", "one");
    ASSERT_TRUE(id);
    EXPECT_TRUE(used.insert(id->sequence).second) << id->sequence;
    store.checkpoint_fault = FileFault::no_space;  // from the second process on
  }
}

}  // namespace
}  // namespace srfs::cfdp
