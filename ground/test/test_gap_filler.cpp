// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mission/structures.hpp>

#include "ground/archive/gap_filler.hpp"
#include "tests/mission_dictionary.hpp"

namespace srfs::ground {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using testing_support::dictionary;

const UtcTime start = *from_iso8601("2026-11-21T08:00:00Z");

StoredGap gap(std::int64_t id, int from_s, int to_s) {
  StoredGap stored;
  stored.id = id;
  stored.gap = {
      .apid = 2, .first = 1, .count = 3, .from = start + seconds(from_s), .to = start + seconds(to_s)};
  return stored;
}

class Filler : public ::testing::Test {
 protected:
  void live() {
    filler_.on_packet({.vc = tm_channel::live, .packet = {.apid = 2, .service = 3, .subtype = 25}}, now_);
  }
  /// Sends what next() orders. @return the store
  std::string order(const std::vector<StoredGap>& open) {
    const auto text = filler_.next(open, now_);
    if (!text) return "";
    filler_.on_sent(request_, *dictionary().command(text->name), now_);
    return text->arguments.front();
  }
  void report(std::uint8_t subtype) {
    OctetWriter source;
    source.u16(request_.packet_identification);
    source.u16(request_.packet_sequence_control);
    filler_.on_packet({.vc = tm_channel::live,
                       .packet = {.apid = 1, .service = 1, .subtype = subtype, .source = source.take()}},
                      now_);
  }
  /// The spacecraft plays a retrieval of so many packets, of which so many come.
  void play(std::uint16_t store, std::uint32_t sent, std::uint32_t come) {
    report(1);
    report(3);
    for (std::uint32_t i = 0; i < come; ++i)
      filler_.on_packet({.vc = tm_channel::playback, .packet = {.apid = 2, .service = 3, .subtype = 25}},
                        now_);
    report(7);
    OctetWriter event;
    event.u16(mission::event::ttc_retrieval_done);
    mission::TtcRetrievalDoneEvent{store, sent, 40}.encode(event);
    filler_.on_packet(
        {.vc = tm_channel::live, .packet = {.apid = 1, .service = 5, .subtype = 1, .source = event.take()}},
        now_);
  }
  const wire::RequestId request_{0x1801, 0xC001};
  MonotonicTime now_{seconds(100)};
  GapFiller filler_{dictionary()};
};

TEST_F(Filler, OrdersNothingWithoutContact) {
  EXPECT_FALSE(filler_.next({gap(1, 0, 9)}, now_));
  live();
  EXPECT_TRUE(filler_.next({gap(1, 0, 9)}, now_));
  now_ += GapFiller::contact;
  EXPECT_FALSE(filler_.next({gap(1, 0, 9)}, now_));
}

TEST_F(Filler, RetrievesEachStoreOverTheTimeOfAllGapsThatOverlap) {
  live();
  const auto text = filler_.next({gap(1, 0, 9), gap(2, 5, 20), gap(3, 100, 110)}, now_);
  ASSERT_TRUE(text);
  EXPECT_THAT(text->arguments, ElementsAre("store=housekeeping", "from=2026-11-21T07:59:58.000Z",
                                           "to=2026-11-21T08:00:22.000Z"));
  std::vector<std::string> stores;
  std::vector<std::int64_t> done;
  for (const auto& store : dictionary().stores()) {
    stores.push_back(order({gap(1, 0, 9), gap(2, 5, 20), gap(3, 100, 110)}));
    EXPECT_EQ(order({gap(1, 0, 9)}), "") << "one at a time";
    play(store.id, 2, 2);
    now_ += seconds(3);
    live();
    done = filler_.on_time(now_);
  }
  EXPECT_THAT(stores, ElementsAre("store=housekeeping", "store=events", "store=verification"));
  EXPECT_THAT(done, ElementsAre(1, 2));
}

TEST_F(Filler, TriesAgainLaterWhatDidNotComeWhole) {
  live();
  order({gap(1, 0, 9)});
  play(dictionary().stores().front().id, 5, 3);
  now_ += seconds(3);
  EXPECT_THAT(filler_.on_time(now_), IsEmpty());
  live();
  EXPECT_EQ(order({gap(1, 0, 9)}), "");
  now_ += GapFiller::rest;
  live();
  EXPECT_EQ(order({gap(1, 0, 9)}), "store=housekeeping") << "from the first store on";
}

TEST_F(Filler, TriesFirstWhatWasTriedLeastAndNothingForEver) {
  std::vector<StoredGap> open{gap(1, 0, 9), gap(2, 100, 110), gap(3, 200, 210), gap(4, 950, 960)};
  open[0].attempts = 3;
  open[1].attempts = GapFiller::attempts_max;
  std::vector<std::int64_t> ids;
  for (const StoredGap& stored : GapFiller::to_try(open, start + seconds(1000))) ids.push_back(stored.id);
  EXPECT_THAT(ids, ElementsAre(3, 1)) << "4 may still grow";
}

TEST_F(Filler, AsksNotForWhatIsFromBeforeTheClockWasSet) {
  std::vector<StoredGap> open{gap(1, 0, 9), gap(2, 100, 110), gap(3, 200, 210)};
  open[1].gap.from = UtcTime(seconds(5));
  open[1].gap.to = UtcTime(seconds(60));
  open[2].gap.from = UtcTime(seconds(60));  // the clock was set meanwhile
  std::vector<std::int64_t> ids;
  for (const StoredGap& stored : GapFiller::to_try(open, start + seconds(1000))) ids.push_back(stored.id);
  EXPECT_THAT(ids, ElementsAre(1, 3));
  EXPECT_TRUE(GapFiller::is_undated(open[1]));
}

TEST_F(Filler, GivesUpARetrievalThatTheSpacecraftDoesNotAnswer) {
  live();
  order({gap(1, 0, 9)});
  now_ += seconds(60);
  EXPECT_THAT(filler_.on_time(now_), IsEmpty());
  now_ += GapFiller::rest;
  live();
  EXPECT_NE(order({gap(1, 0, 9)}), "");
}

}  // namespace
}  // namespace srfs::ground
