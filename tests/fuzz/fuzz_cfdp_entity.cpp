// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// A CFDP entity with a hostile peer and a damaged disk. Input: octets of a checkpoint with a correct CRC,
// then records of an event (octet), length (u16) and a PDU. Checks bounds, and silence within the limits.

#include <cstdlib>

#include "cfdp/entity.hpp"
#include "lib/cfdp/test/memory_file_store.hpp"
#include "wire/cfdp_checksum.hpp"

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
  using namespace srfs;
  OctetReader in({input, size});
  cfdp::Settings settings;
  settings.own_entity = 2;
  settings.peer_entity = 1;
  settings.transactions_max = 3;
  settings.receiving_max = 2;
  settings.receiving_octets_max = 40'000;
  settings.gaps_max = 4;
  settings.replies_max = 4;
  settings.events_max = 8;
  settings.file_octets_max = 65536;
  cfdp::MemoryFileStore files;
  files.add("a", Octets(3000, 7));
  cfdp::Entity entity(settings, files, 1);
  MonotonicTime now{seconds(1)};

  const OctetView stored = in.bytes(std::min<std::size_t>(in.u16(), in.remaining()));
  Octets checkpoint(stored.begin(), stored.end());
  wire::CfdpChecksum crc(wire::CfdpChecksumType::crc32c);
  crc.update(checkpoint);
  OctetWriter tail;
  tail.u32(crc.value());
  checkpoint.insert(checkpoint.end(), tail.view().begin(), tail.view().end());
  (void)entity.restore(checkpoint, now);

  while (in.remaining() >= 3) {
    const std::uint8_t what = in.u8();
    const OctetView pdu = in.bytes(std::min<std::size_t>(in.u16(), in.remaining()));
    if ((what & 1U) != 0) (void)entity.put("a", "b");
    entity.on_pdu(pdu, now);
    for (const auto& t : entity.transactions()) {
      if ((what & 2U) != 0) entity.suspend(t.id);
      if ((what & 4U) != 0) entity.resume(t.id, now);
      if ((what & 8U) != 0) entity.cancel(t.id, now);
    }
    for (unsigned i = 0; i < what >> 5U; ++i) {
      const auto out = entity.next_pdu(cfdp::Entity::pdu_octets_min, now);
      if (!out) break;
      require(out->size() <= cfdp::Entity::pdu_octets_min && wire::decode_cfdp_pdu(*out).has_value());
    }
    now += milliseconds((what & 16U) != 0 ? 3000 : 1);
    require(entity.transactions().size() <= settings.transactions_max);
    require(files.temporaries() <= settings.transactions_max);
  }

  // Without answers from the peer, nothing is due after the limits.
  for (int i = 0; i < 5000; ++i) {
    const auto due = entity.next_due(now);
    if (!due) return 0;
    now = std::max(now, *due);
    (void)entity.next_pdu(cfdp::Entity::pdu_octets_min, now);
  }
  std::abort();
}
