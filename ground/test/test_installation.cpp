// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/installation.hpp"
#include "tests/mission_dictionary.hpp"

#include <gmock/gmock.h>

#include <mission/structures.hpp>

namespace srfs::ground {
namespace {

using testing_support::dictionary;

const std::string file = "payload_eps_7.pkg";

TelemetryReport received(std::uint8_t service, std::uint8_t subtype, const Octets& data, std::uint8_t vc) {
  ReceivedPacket packet;
  packet.vc = vc;
  packet.packet.apid = mission::apid::maintenance;
  packet.packet.service = service;
  packet.packet.subtype = subtype;
  packet.packet.source = data;
  return decode_telemetry(dictionary(), packet);
}

template <class Event>
TelemetryReport told(const Event& event, std::uint8_t vc = tm_channel::live) {
  OctetWriter out;
  out.u16(Event::event_id);
  event.encode(out);
  return received(5, 1, out.take(), vc);
}

TelemetryReport status(mission::UpdateStep step, const std::string& name = file,
                       std::uint8_t vc = tm_channel::live) {
  mission::UpdateStatusHousekeeping status;
  status.file = name;
  status.step = step;
  OctetWriter out;
  out.u16(mission::structure::update_status);
  status.encode(out);
  return received(3, 25, out.take(), vc);
}

mission::UpdateInstalledEvent installed(const std::string& name) {
  mission::UpdateInstalledEvent event;
  event.file = name;
  event.node = "payload_eps";
  return event;
}

TEST(Installation, IsOrderedAndAskedAboutByTelecommandsOfTheDictionary) {
  for (const bool activate : {true, false}) {
    const TelecommandText order = install_telecommand(file, activate);
    EXPECT_TRUE(dictionary().encode(order.name, order.arguments));
  }
  EXPECT_TRUE(dictionary().encode(installation_question().name, installation_question().arguments));
}

TEST(Installation, EndsWithAnEventAboutItsFile) {
  EXPECT_EQ(installation_end(told(installed(file)), file), InstallationEnd::installed);
  EXPECT_EQ(installation_end(told(installed("other_7.pkg")), file), std::nullopt);

  mission::UpdateCandidateEvent candidate;
  candidate.file = file;
  EXPECT_EQ(installation_end(told(candidate), file), InstallationEnd::candidate);

  mission::UpdateFailedEvent failed;
  failed.file = file;
  EXPECT_EQ(installation_end(told(failed), file), InstallationEnd::failed);

  mission::UpdateStepEvent step;
  step.file = file;
  step.step = mission::UpdateStep::build;
  EXPECT_EQ(installation_end(told(step), file), std::nullopt);
  EXPECT_TRUE(is_about_installation(told(step), file));
}

TEST(Installation, EndsWithAStatusWhenTheEventWasLost) {
  using mission::UpdateStep;
  EXPECT_EQ(installation_end(status(UpdateStep::installed), file), InstallationEnd::installed);
  EXPECT_EQ(installation_end(status(UpdateStep::candidate), file), InstallationEnd::candidate);
  EXPECT_EQ(installation_end(status(UpdateStep::failed), file), InstallationEnd::failed);
  EXPECT_EQ(installation_end(status(UpdateStep::cancelled), file), InstallationEnd::failed);
  for (const UpdateStep step :
       {UpdateStep::verify, UpdateStep::build, UpdateStep::self_test, UpdateStep::store, UpdateStep::swap})
    EXPECT_EQ(installation_end(status(step), file), std::nullopt);
  EXPECT_EQ(installation_end(status(UpdateStep::installed, "other_7.pkg"), file), std::nullopt);
}

TEST(Installation, IsNotEndedByWhatIsPlayedBack) {
  EXPECT_EQ(installation_end(told(installed(file), tm_channel::playback), file), std::nullopt);
  EXPECT_EQ(installation_end(status(mission::UpdateStep::failed, file, tm_channel::playback), file),
            std::nullopt);
}

}  // namespace
}  // namespace srfs::ground
