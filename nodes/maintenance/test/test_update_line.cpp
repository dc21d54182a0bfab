// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/update_line.hpp"

#include <gtest/gtest.h>

namespace srfs {
namespace {

using update::UpdateStep;

update::Update eps_update(UpdateStep step) {
  update::Update u;
  u.file = "packages/eps.pkg";
  u.node = "payload_eps";
  u.step = step;
  u.version = 3;
  u.probation = seconds(300);
  return u;
}
template <class Event>
Event decoded(const UpdateNews& news) {
  EXPECT_EQ(news.event.id, Event::event_id);
  EXPECT_EQ(news.event.severity, static_cast<std::uint8_t>(Event::severity));
  OctetReader in(news.event.data);
  return Event::decode(in).value_or(Event{});
}

TEST(UpdateLine, EachStepIsAnEventAndALineOfTheLog) {
  const UpdateNews news = news_of(eps_update(UpdateStep::build));
  EXPECT_FALSE(news.is_bad);
  EXPECT_EQ(news.line, "update of payload_eps from packages/eps.pkg: build");
  EXPECT_EQ(decoded<mission::UpdateStepEvent>(news).step, UpdateStep::build);
}

TEST(UpdateLine, AnInstalledProgramSaysItsProbationAndOutageIfThatIsKnown) {
  update::Update u = eps_update(UpdateStep::installed);
  u.outage = milliseconds(412);
  const auto event = decoded<mission::UpdateInstalledEvent>(news_of(u));
  EXPECT_EQ(event.node, "payload_eps");
  EXPECT_EQ(event.version, 3U);
  EXPECT_EQ(event.probation_s, 300U);
  EXPECT_EQ(event.outage_ms, 412U);
  EXPECT_EQ(news_of(u).line, "payload_eps runs version 3 from packages/eps.pkg, outage 412 ms");
  u.outage.reset();
  EXPECT_EQ(decoded<mission::UpdateInstalledEvent>(news_of(u)).outage_ms, UINT32_MAX);
}

TEST(UpdateLine, ACandidateWaitsForATelecommand) {
  const UpdateNews news = news_of(eps_update(UpdateStep::candidate));
  EXPECT_FALSE(news.is_bad);
  EXPECT_EQ(decoded<mission::UpdateCandidateEvent>(news).version, 3U);
}

TEST(UpdateLine, AFailureSaysWhereAndWhyAsFarAsThereIsRoom) {
  for (const UpdateStep step : {UpdateStep::failed, UpdateStep::cancelled}) {
    update::Update u = eps_update(step);
    u.ended_in = UpdateStep::self_test;
    u.reason = std::string(300, 'r');
    const UpdateNews news = news_of(u);
    EXPECT_TRUE(news.is_bad);
    EXPECT_NE(news.line.find("in self_test: r"), std::string::npos) << news.line;
    const auto event = decoded<mission::UpdateFailedEvent>(news);
    EXPECT_EQ(event.step, UpdateStep::self_test);
    EXPECT_EQ(event.reason, std::string(120, 'r'));
  }
}

TEST(UpdateLine, TheStatusCutsWhatIsTooLongAndStillEncodes) {
  update::Update u = eps_update(UpdateStep::failed);
  u.file = std::string(100, 'f');
  u.node = std::string(100, 'n');
  u.reason = std::string(100, 'r');
  u.starts = 300;
  u.build = milliseconds(-5);
  const auto status = mission::UpdateStatusHousekeeping::decode(to_mission(u).encoded());
  ASSERT_TRUE(status);
  EXPECT_EQ(status->file, std::string(60, 'f'));
  EXPECT_EQ(status->node, std::string(32, 'n'));
  EXPECT_EQ(status->reason, std::string(60, 'r'));
  EXPECT_EQ(status->starts, 255U);
  EXPECT_EQ(status->build_ms, 0U);
  EXPECT_EQ(status->outage_ms, UINT32_MAX) << "not known";
}

}  // namespace
}  // namespace srfs
