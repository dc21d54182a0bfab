// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <arpa/inet.h>
#include <gtest/gtest.h>

#include "ground/bridge.hpp"
#include "wire/cltu.hpp"
#include "wire/tc_frame.hpp"

namespace srfs::ground {
namespace {

const Octets frame = wire::encode_tc_frame({.spacecraft_id = 0xAB, .vc = 1, .data = {0xC0, 1, 2, 3}});

TEST(BridgeUplink, CodesAFrameAndLeavesACltuAlone) {
  for (const bool randomize : {false, true}) {
    const Octets cltu = wire::encode_cltu(frame, randomize);
    EXPECT_EQ(uplink_octets(frame, randomize), cltu);
    EXPECT_EQ(uplink_octets(cltu, randomize), cltu);
  }
}

TEST(BridgeUplink, TakesTheLongestOfBoth) {
  const Octets longest =
      wire::encode_tc_frame({.spacecraft_id = 0xAB, .data = Octets(wire::tc_data_octets_max, 1)});
  const Octets cltu = wire::encode_cltu(longest, false);
  EXPECT_EQ(uplink_octets(longest, false), cltu);
  EXPECT_EQ(uplink_octets(cltu, false), cltu);
  Octets longer = cltu;
  longer.push_back(0x55);
  EXPECT_EQ(uplink_octets(longer, false).error(), DatagramError::too_long);
  longer = longest;
  longer.push_back(0);
  EXPECT_EQ(uplink_octets(longer, false).error(), DatagramError::too_long);
}

TEST(BridgeUplink, RefusesWhatIsNeither) {
  EXPECT_EQ(uplink_octets({}, false).error(), DatagramError::too_short);
  EXPECT_EQ(uplink_octets(OctetView(frame).first(7), false).error(), DatagramError::too_short);
  EXPECT_EQ(uplink_octets(OctetView(frame).first(frame.size() - 1), false).error(),
            DatagramError::not_a_frame);
  Octets wrong = frame;
  wrong[0] |= 0x40;
  EXPECT_EQ(uplink_octets(wrong, false).error(), DatagramError::not_a_frame);
  wrong = frame;
  wrong.back() ^= 1;
  EXPECT_EQ(uplink_octets(wrong, false).error(), DatagramError::bad_fecf);
}

TEST(BridgeAddress, IsLoopbackUnlessAHostIsNamed) {
  EXPECT_EQ(to_text(*parse_internet_address("10015")), "127.0.0.1:10015");
  EXPECT_EQ(to_text(*parse_internet_address("0.0.0.0:7")), "0.0.0.0:7");
  for (const std::string_view wrong :
       {"", ":", "localhost:5", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:5x", "::1:5"})
    EXPECT_FALSE(parse_internet_address(wrong)) << wrong;
}

}  // namespace
}  // namespace srfs::ground
