// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <variant>

#include "foreign_dissector.hpp"
#include "lib/cfdp/test/simulated_link.hpp"

namespace srfs::cfdp {
namespace {

using testing::ElementsAre;

TEST(CfdpByWireshark, ReadsATransferWithAGapAsItWasMeant) {
  if (!ForeignDissector::is_installed()) GTEST_SKIP() << "no tshark";
  ForeignDissector dissector("cfdp");
  SimulatedLink link;
  int data_pdus = 0;
  link.on_line = [&](std::uint64_t, OctetView pdu) {
    dissector.add(pdu);
    const auto decoded = wire::decode_cfdp_pdu(pdu);
    return !std::holds_alternative<wire::CfdpFileData>(decoded->body) || ++data_pdus != 2;
  };
  link.start();
  link.at(ground).files.add("image.fits", random_file(2500, 1));
  ASSERT_TRUE(link.entity(ground).put("image.fits", "got.fits"));
  ASSERT_TRUE(link.run(link.now + seconds(60)));

  const auto lines = dissector.dissected(
      "cfdp.srcid cfdp.transeqnum cfdp.dstid cfdp.direction cfdp.fdtype cfdp.offset cfdp.file_size "
      "cfdp.src_file_name cfdp.dst_file_name cfdp.nak_st_scope cfdp.nak_sp_scope cfdp.condition_code "
      "cfdp.delivery_code cfdp.file_status _ws.malformed");
  EXPECT_THAT(lines, ElementsAre("1 1 2 0 7 2500 image.fits got.fits",  // Metadata
                                 "1 1 2 0 0", "1 1 2 0 950", "1 1 2 0 1900",
                                 "1 1 2 0 4 2500 0",    // EOF
                                 "1 1 2 1 6 0",         // ACK of EOF
                                 "1 1 2 1 8 950 1900",  // NAK
                                 "1 1 2 0 950",         // the repetition
                                 "1 1 2 1 5 0 0 2",     // Finished
                                 "1 1 2 0 6 0"));       // ACK of Finished
}

}  // namespace
}  // namespace srfs::cfdp
