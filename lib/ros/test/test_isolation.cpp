// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "ros/isolation.hpp"

namespace srfs::ros {
namespace {

const SuiteIdentity timing{"sim", "timing", 7};

GuidPrefix prefix(std::uint8_t last) {
  return {1, 15, 0, 0, 0, 0, 0, 0, 0, 0, 0, last};
}

Octets text(const std::string& s) {
  return {s.begin(), s.end()};
}

TEST(SuiteIdentity, StandsInUserDataBehindTheEnclaveThatRos2Wants) {
  const std::string expected("enclave=/;srfs=sim/timing/7;\0", 29);
  EXPECT_EQ(participant_user_data(timing), text(expected));
  EXPECT_EQ(participant_user_data(std::nullopt), text(std::string("enclave=/;\0", 11)));
}

TEST(SuiteIdentity, IsFoundAgain) {
  EXPECT_EQ(find_identity(participant_user_data(timing)), timing);
  EXPECT_FALSE(find_identity(participant_user_data(std::nullopt)));
}

TEST(SuiteIdentity, NamesCannotEndThePairOrAddAnother) {
  const auto found = find_identity(participant_user_data(SuiteIdentity{"a;b/c", "", 1}));
  ASSERT_TRUE(found);
  EXPECT_EQ(found->deployment, "a_b_c");
  EXPECT_EQ(found->node, "_") << "an empty value would make ROS 2 refuse all pairs";
}

TEST(SuiteIdentity, DamagedPairsAreNone) {
  for (const char* damaged :
       {"", "srfs=sim/timing/7;", "enclave=/;srfs=", "enclave=/;srfs=sim;", "enclave=/;srfs=sim/7;",
        "enclave=/;srfs=sim/timing/x;", "enclave=/;srfs=sim/timing/;",
        "enclave=/;srfs=sim/timing/99999999999;", "enclave=/;srfs=sim/timing/7"}) {
    EXPECT_FALSE(find_identity(text(damaged))) << damaged;
  }
}

TEST(KnownParticipants, ThoseOfTheSameDeploymentAreOursAllOthersForeign) {
  KnownParticipants known(timing);
  known.discovered(prefix(1), participant_user_data(SuiteIdentity{"sim", "ttc", 3}), "/", "127.0.0.1");
  known.discovered(prefix(2), participant_user_data(SuiteIdentity{"sim_open", "ttc", 3}), "/", "127.0.0.1");
  known.discovered(prefix(3), participant_user_data(std::nullopt), "/", "10.0.0.7");
  known.discovered(prefix(4), {}, "rti", "127.0.0.1");
  EXPECT_FALSE(known.is_foreign(prefix(1)));
  EXPECT_TRUE(known.is_foreign(prefix(2)));
  EXPECT_TRUE(known.is_foreign(prefix(3)));
  EXPECT_TRUE(known.is_foreign(prefix(4)));
  EXPECT_TRUE(known.is_foreign(prefix(9))) << "never discovered";
  EXPECT_EQ(known.describe(prefix(3)), "'/' at 10.0.0.7 (010f00000000000000000003)");
  EXPECT_EQ(known.describe(prefix(9)), "unknown (010f00000000000000000009)");
}

TEST(KnownParticipants, MembersAreTheOtherNodesThatAreHere) {
  KnownParticipants known(timing);
  known.discovered(prefix(1), participant_user_data(timing), "/", "this process");
  known.discovered(prefix(2), participant_user_data(SuiteIdentity{"sim", "ttc", 3}), "/", "127.0.0.1");
  known.discovered(prefix(3), participant_user_data(SuiteIdentity{"other", "ttc", 3}), "/", "127.0.0.1");
  known.discovered(prefix(4), participant_user_data(std::nullopt), "/", "127.0.0.1");
  ASSERT_EQ(known.members().size(), 1U);
  EXPECT_EQ(known.members()[0].prefix, prefix(2));
  EXPECT_EQ(known.members()[0].identity, (SuiteIdentity{"sim", "ttc", 3}));
  known.gone(prefix(2));
  EXPECT_TRUE(known.members().empty());
}

TEST(KnownParticipants, WhoHasGoneIsStillKnownBecauseItsSamplesMayWait) {
  KnownParticipants known(timing);
  known.discovered(prefix(1), participant_user_data(timing), "/", "");
  known.gone(prefix(1));
  EXPECT_FALSE(known.is_foreign(prefix(1)));
}

TEST(KnownParticipants, AProcessOfNoSuiteCallsNobodyForeign) {
  const KnownParticipants known(std::nullopt);
  EXPECT_FALSE(known.is_foreign(prefix(1)));
}

TEST(KnownParticipants, AThousandRestartsAndStrangersNeverMakeALivingNodeForeign) {
  KnownParticipants known(timing);
  const auto other = [](int i) {
    GuidPrefix p = prefix(0);
    p[4] = static_cast<std::uint8_t>(i);
    p[5] = static_cast<std::uint8_t>(i >> 8);
    p[6] = 1;
    return p;
  };
  for (std::uint8_t i = 0; i < 20; ++i)
    known.discovered(prefix(i), participant_user_data(SuiteIdentity{"sim", "node", i}), "/", "");
  for (int i = 0; i < 1000; ++i) {
    known.discovered(other(i), participant_user_data(timing), "/", "");
    EXPECT_FALSE(known.is_foreign(other(i)));
    known.gone(other(i));
  }
  for (int i = 2000; i < 3000; ++i) known.discovered(other(i), {}, "", "");
  for (std::uint8_t i = 0; i < 20; ++i) EXPECT_FALSE(known.is_foreign(prefix(i))) << int{i};
}

}  // namespace
}  // namespace srfs::ros
