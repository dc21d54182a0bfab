// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "ground/place.hpp"

namespace srfs::ground {
namespace {

TEST(Place, IsThatOfTheCommandLineFirst) {
  const PlaceHints hints{.port_argument = "/tmp/flight/rs422",
                         .port_environment = "/dev/ttyUSB0",
                         .var_environment = "/home/op/station",
                         .running = {"/tmp/other"}};
  EXPECT_EQ(place_of(hints), (Place{"/tmp/flight/rs422", "/tmp/flight"}));
  EXPECT_EQ(place_of({.port_argument = "rs422"}), (Place{"rs422", "."}));
}

TEST(Place, OfADeviceIsTheVarOfTheEnvironment) {
  EXPECT_EQ(place_of({.port_argument = "/dev/ttyUSB0", .var_environment = "/home/op/station"}),
            (Place{"/dev/ttyUSB0", "/home/op/station"}));
  EXPECT_EQ(place_of({.port_environment = "/dev/ttyUSB0", .var_environment = "/home/op/station"}),
            (Place{"/dev/ttyUSB0", "/home/op/station"}));
  EXPECT_EQ(place_of({.port_environment = "/tmp/a/rs422"}), (Place{"/tmp/a/rs422", "/tmp/a"}));
}

TEST(Place, OfAnAddressIsTheVarOfTheEnvironment) {
  EXPECT_EQ(place_of({.port_argument = "tcp:10.0.0.5:4001", .var_environment = "/home/op/station"}),
            (Place{"tcp:10.0.0.5:4001", "/home/op/station"}));
  EXPECT_EQ(place_of({.port_argument = "tcp:10.0.0.5:4001"}), (Place{"tcp:10.0.0.5:4001", "var"}));
  EXPECT_EQ(place_of({.port_environment = "udp:10.0.0.5:4001"}), (Place{"udp:10.0.0.5:4001", "var"}));
}

TEST(Place, IsTheVarOfTheEnvironmentThenTheOneHereThenTheOneThatRuns) {
  EXPECT_EQ(place_of({.var_environment = "/tmp/a", .var_here = true}), (Place{"/tmp/a/rs422", "/tmp/a"}));
  EXPECT_EQ(place_of({.var_here = true, .running = {"/tmp/b"}}), (Place{"var/rs422", "var"}));
  EXPECT_EQ(place_of({.running = {"/tmp/b"}}), (Place{"/tmp/b/rs422", "/tmp/b"}));
  EXPECT_EQ(place_of({.running = {"/tmp/b", "/tmp/c"}}), (Place{"var/rs422", "var"})) << "which of the two?";
  EXPECT_EQ(place_of({}), (Place{"var/rs422", "var"}));
}

TEST(Place, OfASimulationIsReadFromItsCommandLine) {
  EXPECT_EQ(simulated_var({"/opt/bin/hw_sim", "--deployment", "x", "--var", "/tmp/f"}), "/tmp/f");
  EXPECT_EQ(simulated_var({"hw_sim", "--var", "relative"}), std::nullopt);
  EXPECT_EQ(simulated_var({"hw_sim", "--var"}), std::nullopt);
  EXPECT_EQ(simulated_var({"ttc_node", "--var", "/tmp/f"}), std::nullopt);
  EXPECT_EQ(simulated_var({}), std::nullopt);
}

}  // namespace
}  // namespace srfs::ground
