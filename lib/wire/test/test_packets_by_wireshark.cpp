// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "foreign_dissector.hpp"
#include "wire/pus.hpp"

namespace srfs::wire {
namespace {

TEST(PacketsByWireshark, HaveTheHeadersTheyWereGiven) {
  if (!ForeignDissector::is_installed()) GTEST_SKIP() << "no tshark";
  ForeignDissector dissector("ccsds");
  dissector.add(make_tc_packet(
      {.apid = 0x7FE, .sequence_count = 0x3FFF, .service = 8, .subtype = 1, .application = Octets(20, 1)}));
  dissector.add(make_tm_packet(
      {.apid = 17, .sequence_count = 22, .service = 3, .subtype = 25, .source = Octets(300, 1)}));
  // The packets are long enough for the secondary header of the station for which the dissector was written.
  // Fields: version, type (1: telecommand), secondary header, APID, sequence flag (3: unsegmented), sequence
  // count, octets of the data field minus one.
  EXPECT_THAT(
      dissector.dissected(
          "ccsds.version ccsds.type ccsds.secheader ccsds.apid ccsds.seqflag ccsds.seqnum ccsds.length "
          "ccsds.length.error _ws.malformed"),
      testing::ElementsAre("0 1 1 2046 3 16383 26", "0 0 1 17 3 22 316"));
}

}  // namespace
}  // namespace srfs::wire
