// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "cfdp/transfer_folders.hpp"

#include <gmock/gmock.h>

#include <fstream>

#include "lib/cfdp/test/simulated_link.hpp"
#include "temporary_folder.hpp"

namespace srfs::cfdp {
namespace {

using testing::IsEmpty;

/// Two postboxes on real folders, joined by a link without loss.
class TransferFoldersTest : public testing::Test {
 protected:
  struct End {
    std::filesystem::path folder;
    std::unique_ptr<TransferFolders> box;
    std::vector<News> news;
  };
  void open(End& end, std::uint64_t own) {
    Settings settings{.own_entity = own, .peer_entity = own == ground ? satellite : ground};
    settings.safe_names = own == ground;
    auto opened = TransferFolders::open(end.folder / "files", end.folder / "checkpoint", settings, 1, now_);
    ASSERT_TRUE(opened) << opened.error().message;
    end.box = std::move(*opened);
  }
  void SetUp() override {
    for (const auto& [end, name] : {std::pair(&below_, "ground"), std::pair(&above_, "satellite")}) {
      end->folder = folder_.path() / name;
      std::filesystem::create_directories(end->folder);
    }
    open(below_, ground);
    open(above_, satellite);
  }
  void put(End& end, const std::string& name, const Octets& octets) {
    std::ofstream file(end.folder / "files/outbox" / name, std::ios::binary);
    file.write(reinterpret_cast<const char*>(octets.data()), static_cast<std::streamsize>(octets.size()));
  }
  static Octets content(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  /// Exchanges PDUs until neither side has one, at most @p pdus.
  void carry(std::size_t pdus = 100'000) {
    for (bool any = true; any && pdus > 0;) {
      any = false;
      for (const auto& [from, to] : {std::pair(&below_, &above_), std::pair(&above_, &below_)}) {
        auto result = take_turn(
            *from->box, {.received = {}, .room_octets = 1000, .pdu_octets_max = 1000, .overhead_octets = 0},
            now_);
        from->news.insert(from->news.end(), result.news.begin(), result.news.end());
        any = any || !result.pdus.empty() || (result.next_due && *result.next_due <= now_);
        for (const Octets& pdu : result.pdus) {
          to->box->on_pdu(pdu, now_);
          if (pdus-- == 1) return;
        }
      }
    }
  }
  static std::vector<std::string> finished(const End& end) {
    std::vector<std::string> names;
    for (const News& n : end.news) {
      if (n.event.kind == EventKind::finished && n.event.outcome == Outcome{})
        names.push_back(n.file.destination_file);
    }
    return names;
  }

  testing_support::TemporaryFolder folder_;
  MonotonicTime now_{seconds(100)};
  End below_;
  End above_;
};

TEST_F(TransferFoldersTest, WhatComesIsCalledInTheSafeAlphabetWhereThatIsAskedFor) {
  const std::string rude = "-a\x1b[2J b";
  put(above_, rude, random_file(50, 1));
  put(below_, "two words", random_file(60, 2));
  above_.box->scan();
  below_.box->scan();
  carry();
  EXPECT_THAT(finished(below_), testing::Contains("%2Da%1B%5B2J%20b"));
  EXPECT_EQ(content(below_.folder / "files/%2Da%1B%5B2J%20b"), random_file(50, 1));
  EXPECT_FALSE(std::filesystem::exists(below_.folder / "files" / rude));
  EXPECT_EQ(content(above_.folder / "files/two words"), random_file(60, 2)) << "an operator names it";
}

TEST_F(TransferFoldersTest, WhatLiesInTheOutboxArrivesInOrderAndLeavesIt) {
  put(above_, "2_cutout", random_file(5000, 2));
  put(above_, "1_tracklet", random_file(300, 1));
  put(above_, ".half_written", random_file(10, 3));
  above_.box->scan();
  carry();
  EXPECT_THAT(finished(above_), testing::ElementsAre("1_tracklet", "2_cutout"));
  EXPECT_THAT(finished(below_), testing::ElementsAre("1_tracklet", "2_cutout"));
  EXPECT_EQ(content(below_.folder / "files/2_cutout"), random_file(5000, 2));
  EXPECT_FALSE(std::filesystem::exists(above_.folder / "files/outbox/1_tracklet"));
  EXPECT_FALSE(std::filesystem::exists(above_.folder / "files/outbox/2_cutout"));
  EXPECT_TRUE(std::filesystem::exists(above_.folder / "files/outbox/.half_written"));
}

TEST_F(TransferFoldersTest, AFileUnderWayIsNotPutTwice) {
  put(above_, "a", random_file(5000, 1));
  above_.box->scan();
  above_.box->scan();
  EXPECT_EQ(above_.box->entity().transactions().size(), 1U);
}

TEST_F(TransferFoldersTest, BothEndsStartAgainInTheMiddleAndTheFileArrives) {
  put(above_, "a", random_file(60'000, 1));
  above_.box->scan();
  for (int i = 0; i < 4; ++i) {
    carry(13);
    End& end = i % 2 == 0 ? above_ : below_;
    end.box.reset();
    open(end, i % 2 == 0 ? satellite : ground);
    end.box->scan();
    EXPECT_LE(above_.box->entity().transactions().size(), 1U);
    now_ += seconds(6);
  }
  for (int i = 0; i < 20 && finished(below_).empty(); ++i) {
    carry();
    now_ += seconds(6);
  }
  carry();
  EXPECT_EQ(content(below_.folder / "files/a"), random_file(60'000, 1));
  EXPECT_THAT(std::filesystem::directory_iterator(above_.folder / "files/outbox"),
              testing::Eq(std::filesystem::directory_iterator()));
}

TEST_F(TransferFoldersTest, AFileThePeerRefusesIsMovedAsideAndNotSentForEver) {
  std::filesystem::create_directory(below_.folder / "files/a");  // no file can take this name
  put(above_, "a", random_file(100, 1));
  above_.box->scan();
  carry();
  above_.box->scan();
  EXPECT_THAT(above_.box->entity().transactions(), IsEmpty());
  EXPECT_EQ(content(above_.folder / "files/unsent/a"), random_file(100, 1));
  ASSERT_FALSE(above_.news.empty());
  EXPECT_EQ(above_.news.back().event.outcome.condition, CfdpCondition::filestore_rejection);
}

TEST_F(TransferFoldersTest, NoMoreFilesThanTheBoundAreUnderWayAndAllArrive) {
  constexpr std::size_t files = TransferFolders::sending_max + 3;
  for (std::size_t i = 0; i < files; ++i) put(above_, "file" + std::to_string(i), random_file(100, 1));
  above_.box->scan();
  EXPECT_EQ(above_.box->entity().transactions().size(), TransferFolders::sending_max);
  carry();
  above_.box->scan();
  carry();
  EXPECT_EQ(finished(below_).size(), files);
}

TEST_F(TransferFoldersTest, WhatRestsSinceNobodyAnsweredGoesOnAtContact) {
  put(above_, "a", random_file(100, 1));
  above_.box->scan();
  for (int i = 0; i < 20; ++i) {  // no peer receives the PDUs
    while (above_.box->next_pdu(1000, now_)) {
    }
    now_ += seconds(6);
    above_.box->entity().advance(now_);
  }
  ASSERT_EQ(above_.box->entity().transactions().front().rest, Rest::by_fault);
  above_.box->on_contact(now_);
  carry();
  for (int i = 0; i < 3; ++i) {
    now_ += seconds(6);
    carry();
  }
  EXPECT_THAT(finished(below_), testing::ElementsAre("a"));
}

TEST_F(TransferFoldersTest, ContactsDoNotWakeAFinishedThatTheGroundNeverAcknowledges) {
  put(below_, "a", random_file(100, 1));
  below_.box->scan();
  while (const auto pdu = below_.box->next_pdu(1000, now_)) above_.box->on_pdu(*pdu, now_);
  std::size_t pdus = 0;
  for (int i = 0; i < 1000; ++i) {  // a ground that uplinks continuously but has lost its files
    above_.box->on_contact(now_);
    while (above_.box->next_pdu(1000, now_)) ++pdus;
    for (News& news : above_.box->take_news()) above_.news.push_back(std::move(news));
    now_ += seconds(6);
  }
  EXPECT_EQ(pdus, 1 + Settings{}.ack_limit);  // ACK of EOF, Finished
  EXPECT_THAT(finished(above_), testing::ElementsAre("a"));
}

TEST_F(TransferFoldersTest,
       FilesThatAreAnnouncedAndNeverComeDoNotBlockOthersThoughContactsAndRestartsWakeThem) {
  for (std::uint64_t i = 0; i < Settings{}.receiving_max; ++i) {
    const CfdpHeader announced{
        .source_entity = ground, .sequence_number = 500 + i, .destination_entity = satellite};
    above_.box->on_pdu(wire::encode_cfdp_pdu(announced, wire::CfdpMetadata{.file_size = 1000,
                                                                           .source_file = "a",
                                                                           .destination_file = "b",
                                                                           .options = {}}),
                       now_);
  }
  now_ += Settings{}.inactivity_interval;
  above_.box->entity().advance(now_);
  above_.box.reset();
  open(above_, satellite);
  now_ += seconds(1);
  above_.box->on_contact(now_);  // like ttc for each uplinked packet, before it decodes the packet
  put(below_, "new", random_file(3000, 1));
  below_.box->scan();
  carry();
  EXPECT_THAT(finished(above_), testing::Contains("new"));
  EXPECT_EQ(above_.box->entity().counts().displaced, 1U);
}

TEST_F(TransferFoldersTest, AnyFileCanBeSentUnderANumberThatOutlivesARestartAndStaysWhereItIs) {
  std::filesystem::create_directory(above_.folder / "files/images");
  put(above_, "../images/a", random_file(3000, 1));
  ASSERT_TRUE(above_.box->send("images/a", "b", 17));
  EXPECT_EQ(above_.box->send("missing", "c", 18).error(), PutError::file_refused);
  above_.box.reset();
  open(above_, satellite);
  EXPECT_EQ(above_.box->entity().transactions().front().operation, 17U);
  carry();
  EXPECT_THAT(finished(below_), testing::ElementsAre("b"));
  EXPECT_THAT(finished(above_), testing::ElementsAre("b"));
  EXPECT_TRUE(std::filesystem::exists(above_.folder / "files/images/a"));
}

TEST_F(TransferFoldersTest, OtherPacketsCarryNoPdu) {
  EXPECT_FALSE(is_pdu_packet(Octets{0x17, 0xFC, 0, 0, 0, 0, 1}));
  EXPECT_TRUE(is_pdu_packet(Octets{0x17, 0xFD, 0xC0, 0, 0, 0, 1}));
  EXPECT_FALSE(is_pdu_packet(Octets{0x17, 0xFD}));
  EXPECT_FALSE(pdu_in_packet(Octets{0x17, 0xFD, 0xC0, 0, 0, 1, 1}));
  EXPECT_TRUE(pdu_in_packet(Octets{0x17, 0xFD, 0xC0, 0, 0, 0, 1}));
}

}  // namespace
}  // namespace srfs::cfdp
