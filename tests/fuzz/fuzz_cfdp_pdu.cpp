// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// CFDP PDUs from the line: an accepted PDU stays the same when it is encoded and decoded again.
#include <cstdlib>

#include "wire/cfdp_pdu.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace srfs;
  using namespace srfs::wire;
  const auto pdu = decode_cfdp_pdu({data, size});
  if (!pdu) return 0;
  // The octets may differ: the decoder drops ignored flags, filestore responses and the length of a fault
  // location.
  const auto* finished = std::get_if<CfdpFinished>(&pdu->body);
  const auto* eof = std::get_if<CfdpEof>(&pdu->body);
  const auto location = finished != nullptr ? finished->fault_location
                        : eof != nullptr    ? eof->fault_location
                                            : std::nullopt;
  const std::size_t id_bits = pdu->header.entity_id_octets * 8U;
  if (location && id_bits < 64 && *location >> id_bits != 0) return 0;
  const Octets again = encode_cfdp_pdu(pdu->header, pdu->body);
  const auto second = decode_cfdp_pdu(again);
  if (!second || second->header != pdu->header) std::abort();
  if (encode_cfdp_pdu(second->header, second->body) != again) std::abort();
  return 0;
}
