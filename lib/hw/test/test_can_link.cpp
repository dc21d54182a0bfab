// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The rtnetlink messages, octet by octet, as a little-endian kernel reads them.

#include <bit>
#include <cerrno>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hw/linux/can_link.hpp"

namespace srfs::hw {
namespace {

using ::testing::ElementsAreArray;

static_assert(std::endian::native == std::endian::little);

constexpr int interface = 7;
constexpr std::uint32_t sequence = 0x01020304;

TEST(CanLinkMessage, AsksForOneInterface) {
  EXPECT_THAT(encode_link_query(interface, sequence),
              ElementsAreArray(Octets{32, 0, 0, 0, 18, 0, 1, 0,     // length, RTM_GETLINK, request
                                      4,  3, 2, 1, 0,  0, 0, 0,     // sequence, port
                                      0,  0, 0, 0, 7,  0, 0, 0,     // family, type, index
                                      0,  0, 0, 0, 0,  0, 0, 0}));  // flags, change
}

TEST(CanLinkMessage, RestartsTheController) {
  EXPECT_THAT(
      encode_can_restart(interface, sequence),
      ElementsAreArray(Octets{56, 0, 0,  0, 16,  0,   5,   0,  // length, RTM_NEWLINK, request and acknowledge
                              4,  3, 2,  1, 0,   0,   0,   0,  //
                              0,  0, 0,  0, 7,   0,   0,   0,  //
                              0,  0, 0,  0, 0,   0,   0,   0,  //
                              24, 0, 18, 0,                    // IFLA_LINKINFO
                              7,  0, 1,  0, 'c', 'a', 'n', 0,  // IFLA_INFO_KIND, padded
                              12, 0, 2,  0,                    // IFLA_INFO_DATA
                              8,  0, 7,  0, 1,   0,   0,   0}));  // IFLA_CAN_RESTART
}

TEST(CanLinkMessage, SetsTheInterfaceUpAndDownAndTouchesNoOtherFlag) {
  const Octets up = encode_link_up(interface, true, sequence);
  ASSERT_EQ(up.size(), 32U);
  EXPECT_THAT(Octets(up.begin() + 24, up.end()), ElementsAreArray(Octets{1, 0, 0, 0, 1, 0, 0, 0}));
  const Octets down = encode_link_up(interface, false, sequence);
  EXPECT_THAT(Octets(down.begin() + 24, down.end()), ElementsAreArray(Octets{0, 0, 0, 0, 1, 0, 0, 0}));
}

/// RTM_NEWLINK for a bus-off controller, as Linux 6.1 writes it. All unrelated attributes but one are left
/// out.
Octets answer() {
  return {144, 0, 0, 0, 16, 0, 0, 0, 4, 3, 2, 1, 0, 0, 0, 0,      // header
          0, 0, 24, 1, 7, 0, 0, 0, 1, 0, 1, 0, 0, 0, 0, 0,        // ifinfomsg
          9, 0, 3, 0, 'c', 'a', 'n', '0', 0, 0, 0, 0,             // IFLA_IFNAME
          100, 0, 18, 0,                                          // IFLA_LINKINFO
          8, 0, 1, 0, 'c', 'a', 'n', 0,                           // IFLA_INFO_KIND
          88, 0, 2, 128,                                          // IFLA_INFO_DATA, marked as nested
          36, 0, 1, 0, 0x20, 0xA1, 7, 0, 0, 0, 0, 0, 0, 0, 0, 0,  // IFLA_CAN_BITTIMING, 500 kbit/s
          0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 8, 0, 4, 0, 3, 0, 0,
          0,                             // IFLA_CAN_STATE: bus-off
          8, 0, 6, 0, 0, 0, 0, 0,        // IFLA_CAN_RESTART_MS
          8, 0, 8, 0, 0xF8, 0, 0x7F, 0,  // IFLA_CAN_BERR_COUNTER
          // Further attributes from the kernel, unknown to the decoder.
          12, 0, 3, 0, 0, 0, 0, 0, 0, 0, 0, 0, 12, 0, 5, 0, 0, 0, 0, 0, 0, 0, 0, 0};
}

TEST(CanLinkMessage, TellsStateRestartTimeBitRateAndErrorCounters) {
  const auto link = decode_link(answer(), sequence);
  ASSERT_TRUE(link) << link.error();
  EXPECT_EQ(link->state, CanBusState::bus_off);
  EXPECT_EQ(link->restart_ms, 0U);
  EXPECT_EQ(link->bit_rate, 500'000U);
  EXPECT_EQ(link->transmit_errors, 0xF8);
  EXPECT_EQ(link->receive_errors, 0x7F);
}

TEST(CanLinkMessage, OfAVirtualInterfaceTellsNothingOfAController) {
  const Octets raw{60,  0,   0,   0,   16, 0, 0, 0, 4,  3, 2, 1, 0,  0, 0,  0, 0, 0, 24, 1,
                   7,   0,   0,   0,   1,  0, 1, 0, 0,  0, 0, 0, 28, 0, 18, 0, 9, 0, 1,  0,
                   'v', 'c', 'a', 'n', 0,  0, 0, 0, 12, 0, 2, 0, 8,  0, 4,  0, 3, 0, 0,  0};
  const auto link = decode_link(raw, sequence);
  ASSERT_TRUE(link);
  EXPECT_FALSE(link->state);
  EXPECT_FALSE(link->restart_ms);
  EXPECT_FALSE(link->carrier);

  for (const std::uint8_t carrier : {std::uint8_t{0}, std::uint8_t{1}}) {
    Octets with = raw;
    with[0] = 68;
    const Octets attribute{5, 0, 33, 0, carrier, 0, 0, 0};  // IFLA_CARRIER
    with.insert(with.begin() + 32, attribute.begin(), attribute.end());
    EXPECT_EQ(decode_link(with, sequence).value().carrier, carrier == 1);
  }
}

TEST(CanLinkMessage, GivesTheKernelsErrorNumber) {
  Octets refused{36,   0,    0,  0, 2, 0, 0,  0, 4, 3, 2, 1, 0, 0, 0, 0, 0xFF, 0xFF,
                 0xFF, 0xFF, 32, 0, 0, 0, 16, 0, 5, 0, 4, 3, 2, 1, 0, 0, 0,    0};
  EXPECT_EQ(decode_acknowledgement(refused, sequence).error(), EPERM);
  EXPECT_EQ(decode_link(refused, sequence).error(), EPERM);
  refused[16] = refused[17] = refused[18] = refused[19] = 0;
  EXPECT_TRUE(decode_acknowledgement(refused, sequence));
  EXPECT_EQ(decode_link(refused, sequence).error(), EBADMSG) << "an acknowledgement is no interface";
}

TEST(CanLinkMessage, BelievesNoAnswerToAnotherQuestionAndNoneThatIsCutOff) {
  EXPECT_EQ(decode_link(answer(), sequence + 1).error(), EBADMSG);
  const Octets whole = answer();
  for (std::size_t n = 0; n < whole.size(); ++n)
    EXPECT_FALSE(decode_link(OctetView(whole).first(n), sequence)) << n;
}

TEST(CanLinkMessage, SurvivesAttributesWithImpossibleLengths) {
  const Octets good = answer();
  for (std::size_t at = 32; at < good.size(); ++at) {
    for (const std::uint8_t value : Octets{0, 1, 3, 5, 255}) {
      Octets bad = good;
      bad[at] = value;
      (void)decode_link(bad, sequence);  // the sanitizer build checks the bounds
    }
  }
}

}  // namespace
}  // namespace srfs::hw
