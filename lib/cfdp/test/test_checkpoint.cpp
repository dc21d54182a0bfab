// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "cfdp/checkpoint.hpp"
#include "wire/cfdp_checksum.hpp"

namespace srfs::cfdp {
namespace {

Checkpoint full() {
  Checkpoint c;
  c.entity = 2;
  c.next_sequence = 65;
  SendState s;
  s.header = {.crc = true, .source_entity = 2, .sequence_number = 5, .destination_entity = 1};
  s.source_file = "images/one.fits";
  s.destination_file = "one.fits";
  s.checksum_type = wire::CfdpChecksumType::crc32c;
  s.prepared = true;
  s.stamp = {.octets = 100'000, .inode = 9, .modified_ns = -5};
  s.checksum = 0xCAFE;
  s.sha256.fill(7);
  s.reserved = 16'384;
  s.rest = Rest::by_request;
  s.operation = 0x0102030405060708;
  c.senders.push_back(s);
  ReceiveState r;
  r.header = {.large_file = true,
              .sequence_number_octets = 8,
              .source_entity = 1,
              .sequence_number = 1ULL << 40,
              .destination_entity = 2};
  r.gaps_end = 5000;
  r.gaps = {{0, 10}, {100, 900}};
  c.receivers.push_back(r);
  r.file = {.source_file = "a",
            .destination_file = "b",
            .octets = 5000,
            .checksum_type = 0,
            .sha256 = Sha256::Digest{1, 2, 3}};
  r.eof = {.checksum = 1, .octets = 5000};
  c.receivers.push_back(r);
  r.file->sha256.reset();
  r.gaps.clear();
  r.stage = ReceiveState::Stage::finished;
  r.outcome = {.condition = CfdpCondition::filestore_rejection,
               .incomplete = true,
               .file_status = wire::CfdpFileStatus::rejected};
  c.receivers.push_back(r);
  c.history = {{.id = {1, 3}, .outcome = {}}, {.id = {2, 4}, .outcome = r.outcome}};
  return c;
}

TEST(Checkpoints, ComeBackAsTheyWere) {
  EXPECT_EQ(decode_checkpoint(encode_checkpoint(full())).value(), full());
  EXPECT_EQ(decode_checkpoint(encode_checkpoint({})).value(), Checkpoint{});
}

TEST(Checkpoints, EveryCutAndEveryFlippedBitIsNoticed) {
  const Octets whole = encode_checkpoint(full());
  for (std::size_t n = 0; n < whole.size(); ++n)
    EXPECT_FALSE(decode_checkpoint(OctetView(whole).first(n))) << n;
  for (std::size_t bit = 0; bit < 8 * whole.size(); ++bit) {
    Octets damaged = whole;
    damaged[bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
    EXPECT_FALSE(decode_checkpoint(damaged)) << bit;
  }
}

TEST(Checkpoints, ImpossibleContentsAreRefusedAlsoWithARightCrc) {
  Checkpoint checking = full();
  checking.receivers[0].stage = ReceiveState::Stage::checking;  // without metadata
  EXPECT_EQ(decode_checkpoint(encode_checkpoint(checking)).error(), CheckpointError::malformed);
  Checkpoint reserved = full();
  reserved.senders[0].reserved = 100'001;
  EXPECT_EQ(decode_checkpoint(encode_checkpoint(reserved)).error(), CheckpointError::malformed);
  Checkpoint wide = full();
  wide.receivers[1].header.sequence_number_octets = 4;
  EXPECT_EQ(decode_checkpoint(encode_checkpoint(wide)).error(), CheckpointError::malformed);
}

}  // namespace
}  // namespace srfs::cfdp
