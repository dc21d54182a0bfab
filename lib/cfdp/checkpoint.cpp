// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "cfdp/checkpoint.hpp"

#include <cassert>

#include "base/text.hpp"
#include "wire/cfdp_checksum.hpp"

namespace srfs::cfdp {
namespace {

constexpr std::uint32_t magic = 0x53464350;  // "SFCP"
constexpr std::uint8_t version = 2;
constexpr std::size_t octets_limit = 64U << 20;
constexpr std::size_t crc_octets = 4;

std::uint32_t crc(OctetView octets) {
  wire::CfdpChecksum sum(wire::CfdpChecksumType::crc32c);
  sum.update(octets);
  return sum.value();
}

// ---- writing ------------------------------------------------------------------------------------------

void put_text(OctetWriter& out, const std::string& text) {
  assert(text.size() <= wire::cfdp_name_octets_max);
  out.u8(static_cast<std::uint8_t>(text.size()));
  out.bytes(as_octets(text));
}

template <class Enum>
void put_enum(OctetWriter& out, Enum value) {
  out.u8(static_cast<std::uint8_t>(value));
}

void put_header(OctetWriter& out, const CfdpHeader& h) {
  out.u8(static_cast<std::uint8_t>((h.crc ? 1U : 0U) | (h.large_file ? 2U : 0U)));
  out.u8(h.entity_id_octets);
  out.u8(h.sequence_number_octets);
  out.u64(h.source_entity);
  out.u64(h.sequence_number);
  out.u64(h.destination_entity);
}

void put_outcome(OctetWriter& out, const Outcome& o) {
  put_enum(out, o.condition);
  out.u8(o.incomplete ? 1 : 0);
  put_enum(out, o.file_status);
}

void put_sender(OctetWriter& out, const SendState& s) {
  put_header(out, s.header);
  put_text(out, s.source_file);
  put_text(out, s.destination_file);
  put_enum(out, s.checksum_type);
  out.u8(s.prepared ? 1 : 0);
  out.u64(s.stamp.octets);
  out.u64(s.stamp.inode);
  out.u64(static_cast<std::uint64_t>(s.stamp.modified_ns));
  out.u32(s.checksum);
  out.bytes(s.sha256);
  out.u64(s.reserved);
  out.u8(s.eof_acknowledged ? 1 : 0);
  put_enum(out, s.cancelled);
  put_enum(out, s.rest);
  out.u64(s.operation);
}

void put_receiver(OctetWriter& out, const ReceiveState& r) {
  put_header(out, r.header);
  out.u8(static_cast<std::uint8_t>((r.file ? 1U : 0U) | (r.file && r.file->sha256 ? 2U : 0U) |
                                   (r.eof ? 4U : 0U)));
  if (r.file) {
    put_text(out, r.file->source_file);
    put_text(out, r.file->destination_file);
    out.u64(r.file->octets);
    out.u8(r.file->checksum_type);
    if (r.file->sha256) out.bytes(*r.file->sha256);
  }
  if (r.eof) {
    out.u32(r.eof->checksum);
    out.u64(r.eof->octets);
  }
  out.u64(r.gaps_end);
  out.u32(static_cast<std::uint32_t>(r.gaps.size()));
  for (const CfdpSegment& gap : r.gaps) {
    out.u64(gap.start);
    out.u64(gap.end);
  }
  put_enum(out, r.stage);
  put_outcome(out, r.outcome);
  put_enum(out, r.rest);
}

// ---- reading ------------------------------------------------------------------------------------------

/// Reads with checks: after an impossible value ok() is false.
class Reader {
 public:
  explicit Reader(OctetView octets) : in_(octets) {}

  std::uint8_t u8() { return in_.u8(); }
  std::uint32_t u32() { return in_.u32(); }
  std::uint64_t u64() { return in_.u64(); }
  bool flag() { return up_to(1) != 0; }
  std::uint8_t up_to(std::uint8_t most) {
    const std::uint8_t value = in_.u8();
    require(value <= most);
    return value;
  }
  template <class Enum>
  Enum enumerated(Enum last) {
    return static_cast<Enum>(up_to(static_cast<std::uint8_t>(last)));
  }
  std::uint32_t count(std::size_t item_octets) {
    const std::uint32_t n = in_.u32();
    require(n <= in_.remaining() / item_octets);
    return ok() ? n : 0;
  }
  std::string text() {
    const OctetView octets = in_.bytes(in_.u8());
    return {octets.begin(), octets.end()};
  }
  Sha256::Digest sha256() {
    Sha256::Digest hash{};
    const OctetView octets = in_.bytes(hash.size());
    std::copy(octets.begin(), octets.end(), hash.begin());
    return hash;
  }
  std::uint8_t id_octets() {
    const std::uint8_t n = in_.u8();
    require(n == 1 || n == 2 || n == 4 || n == 8);
    return n;
  }
  void require(bool condition) { possible_ = possible_ && condition; }
  [[nodiscard]] bool ok() const { return possible_ && in_.ok(); }
  [[nodiscard]] std::size_t remaining() const { return in_.remaining(); }

 private:
  OctetReader in_;
  bool possible_ = true;
};

bool fits(std::uint64_t value, std::uint8_t octets) {
  return octets >= 8 || value >> (8U * octets) == 0;
}

CfdpHeader read_header(Reader& in) {
  CfdpHeader h;
  const std::uint8_t flags = in.up_to(3);
  h.crc = (flags & 1U) != 0;
  h.large_file = (flags & 2U) != 0;
  h.entity_id_octets = in.id_octets();
  h.sequence_number_octets = in.id_octets();
  h.source_entity = in.u64();
  h.sequence_number = in.u64();
  h.destination_entity = in.u64();
  in.require(fits(h.source_entity, h.entity_id_octets) && fits(h.destination_entity, h.entity_id_octets) &&
             fits(h.sequence_number, h.sequence_number_octets));
  return h;
}

Outcome read_outcome(Reader& in) {
  Outcome o;
  o.condition = in.enumerated(CfdpCondition::cancel_request);
  o.incomplete = in.flag();
  o.file_status = in.enumerated(wire::CfdpFileStatus::unreported);
  return o;
}

SendState read_sender(Reader& in) {
  SendState s;
  s.header = read_header(in);
  s.source_file = in.text();
  s.destination_file = in.text();
  const std::uint8_t type = in.u8();
  in.require(wire::CfdpChecksum::of_type(type).has_value());
  s.checksum_type = static_cast<wire::CfdpChecksumType>(type);
  s.prepared = in.flag();
  s.stamp.octets = in.u64();
  s.stamp.inode = in.u64();
  s.stamp.modified_ns = static_cast<std::int64_t>(in.u64());
  s.checksum = in.u32();
  s.sha256 = in.sha256();
  s.reserved = in.u64();
  s.eof_acknowledged = in.flag();
  s.cancelled = in.enumerated(CfdpCondition::cancel_request);
  s.rest = in.enumerated(Rest::by_fault);
  s.operation = in.u64();
  in.require(s.reserved <= s.stamp.octets &&
             (s.header.large_file || s.stamp.octets <= UINT32_MAX || !s.prepared));
  return s;
}

ReceiveState read_receiver(Reader& in) {
  ReceiveState r;
  r.header = read_header(in);
  const std::uint8_t has = in.up_to(7);
  if ((has & 1U) != 0) {
    r.file = ReceiveState::FileInfo{};
    r.file->source_file = in.text();
    r.file->destination_file = in.text();
    r.file->octets = in.u64();
    r.file->checksum_type = in.up_to(15);
    if ((has & 2U) != 0) r.file->sha256 = in.sha256();
  }
  if ((has & 4U) != 0) {
    r.eof = ReceiveState::End{};
    r.eof->checksum = in.u32();
    r.eof->octets = in.u64();
  }
  r.gaps_end = in.u64();
  const std::uint32_t gaps = in.count(16);
  for (std::uint32_t i = 0; i < gaps; ++i) {
    const std::uint64_t start = in.u64();
    r.gaps.push_back({.start = start, .end = in.u64()});
  }
  r.stage = in.enumerated(ReceiveState::Stage::finished);
  r.outcome = read_outcome(in);
  r.rest = in.enumerated(Rest::by_fault);
  if (r.stage == ReceiveState::Stage::checking) in.require(r.file && r.eof && r.gaps.empty());
  if (r.eof && r.stage != ReceiveState::Stage::finished) in.require(r.gaps_end == r.eof->octets);
  in.require(r.header.large_file || r.gaps_end <= UINT32_MAX);
  return r;
}

}  // namespace

std::string_view to_string(CheckpointError error) {
  switch (error) {
    case CheckpointError::not_a_checkpoint:
      return "not a CFDP checkpoint";
    case CheckpointError::other_version:
      return "of another version";
    case CheckpointError::damaged:
      return "damaged (CRC)";
    case CheckpointError::malformed:
      return "malformed";
    case CheckpointError::other_entity:
      return "of another entity";
  }
  return "?";
}

Octets encode_checkpoint(const Checkpoint& checkpoint) {
  OctetWriter out(octets_limit);
  out.u32(magic);
  out.u8(version);
  out.u64(checkpoint.entity);
  out.u64(checkpoint.next_sequence);
  out.u32(static_cast<std::uint32_t>(checkpoint.senders.size()));
  for (const SendState& s : checkpoint.senders) put_sender(out, s);
  out.u32(static_cast<std::uint32_t>(checkpoint.receivers.size()));
  for (const ReceiveState& r : checkpoint.receivers) put_receiver(out, r);
  out.u32(static_cast<std::uint32_t>(checkpoint.history.size()));
  for (const Ended& e : checkpoint.history) {
    out.u64(e.id.source);
    out.u64(e.id.sequence);
    put_outcome(out, e.outcome);
  }
  out.u32(crc(out.view()));
  assert(out.ok());
  return out.take();
}

Result<Checkpoint, CheckpointError> decode_checkpoint(OctetView octets) {
  if (octets.size() < 5 + crc_octets) return Err(CheckpointError::not_a_checkpoint);
  OctetReader front(octets);
  if (front.u32() != magic) return Err(CheckpointError::not_a_checkpoint);
  if (front.u8() != version) return Err(CheckpointError::other_version);
  const OctetView contents = octets.first(octets.size() - crc_octets);
  if (OctetReader(octets.last(crc_octets)).u32() != crc(contents)) return Err(CheckpointError::damaged);

  Reader in(contents.subspan(5));
  Checkpoint c;
  c.entity = in.u64();
  c.next_sequence = in.u64();
  // The counts are checked against the least octets an item has.
  for (std::uint32_t n = in.count(108); n > 0 && in.ok(); --n) c.senders.push_back(read_sender(in));
  for (std::uint32_t n = in.count(45); n > 0 && in.ok(); --n) c.receivers.push_back(read_receiver(in));
  for (std::uint32_t n = in.count(19); n > 0 && in.ok(); --n) {
    Ended e;
    e.id.source = in.u64();
    e.id.sequence = in.u64();
    e.outcome = read_outcome(in);
    c.history.push_back(e);
  }
  if (!in.ok() || in.remaining() > 0) return Err(CheckpointError::malformed);
  return c;
}

}  // namespace srfs::cfdp
