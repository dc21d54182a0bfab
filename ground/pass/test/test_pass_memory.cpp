// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ground/pass/pass_memory.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::ground::pass {
namespace {

using What = LookedUp::What;

const UtcTime pass_begins = *from_iso8601("2026-11-27T08:00:00Z");
const UtcTime line_ordered = pass_begins + seconds(60);

/// An archive in which a server wrote from the beginning of a pass on.
class Memory : public ::testing::Test {
 protected:
  Memory() : dictionary_(mission::Dictionary::load(std::string(SRFS_SOURCE_DIR) + "/mission")) {}

  void receive(UtcTime time) {
    auto archive = open_archive(place(), ArchiveUse::write);
    ASSERT_TRUE(archive) << archive.error();
    wire::TmPacket packet;
    packet.apid = 2;
    packet.service = 17;
    packet.subtype = 2;
    packet.time = to_tai(time);
    const ReceivedPacket received{
        .vc = tm_channel::live, .packet = packet, .raw = wire::make_tm_packet(packet)};
    ASSERT_TRUE((*archive)->add(received, time));
    ASSERT_TRUE((*archive)->commit());
  }
  void record(const std::string& token) {
    auto archive = open_archive(place(), ArchiveUse::write);
    ASSERT_TRUE(archive) << archive.error();
    ASSERT_TRUE((*archive)->add(TelecommandEntry{.token = token,
                                                 .request = {0x1811, 0xC005},
                                                 .sent = line_ordered,
                                                 .who = "pass run",
                                                 .name = "eps.switch_load",
                                                 .arguments = {}}));
    ASSERT_TRUE((*archive)->commit());
  }
  [[nodiscard]] LookedUp look_up(const std::string& token) const {
    return PassMemory(dictionary_, place()).look_up(token, std::nullopt, line_ordered);
  }
  [[nodiscard]] ArchivePlace place() const { return ArchivePlace(folder_.path() / "archive.sqlite"); }

  testing_support::TemporaryFolder folder_;
  mission::Dictionary dictionary_;
};

TEST_F(Memory, KnowsWhatWasRecordedAndThatOthersWereNotSent) {
  receive(pass_begins);
  record("a");
  EXPECT_EQ(look_up("a").what, What::open);
  EXPECT_EQ(look_up("b").what, What::not_recorded);
}

TEST_F(Memory, CannotTellWithAnArchiveThatBeginsAfterTheOrder) {
  receive(line_ordered + seconds(600));
  const LookedUp found = look_up("a");
  EXPECT_EQ(found.what, What::cannot_tell);
  EXPECT_EQ(found.why, "the archive begins after it was ordered");
}

TEST_F(Memory, CannotTellWithoutAnArchive) {
  EXPECT_EQ(look_up("a").what, What::cannot_tell);
}

}  // namespace
}  // namespace srfs::ground::pass
