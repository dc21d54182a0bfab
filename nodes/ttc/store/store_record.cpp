// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/store/store_record.hpp"

#include <cassert>

#include "base/crc32c.hpp"

namespace srfs {
namespace {

constexpr std::uint16_t record_magic = 0x53B5;
constexpr std::size_t header_octets = 20;
constexpr std::uint32_t time_valid_bit = 0x8000'0000;

std::uint16_t kept_fraction(TaiTime tai) {
  const auto fraction = tai.since_epoch() - std::chrono::floor<seconds>(tai.since_epoch());
  return static_cast<std::uint16_t>((nanoseconds(fraction).count() << 16) / 1'000'000'000);
}

TaiTime time_of(std::uint32_t tai_s, std::uint16_t fraction) {
  return TaiTime(seconds(tai_s) + nanoseconds(std::int64_t{fraction} * 1'000'000'000 >> 16));
}

}  // namespace

std::size_t StoreRecord::octets() const {
  return packet.size() + record_overhead_octets;
}

TaiTime kept_time(TaiTime tai) {
  const std::int64_t tai_s = std::chrono::floor<seconds>(tai.since_epoch()).count();
  return time_of(static_cast<std::uint32_t>(tai_s), kept_fraction(tai));
}

void append_record(Octets& out, std::uint32_t sequence, const RecordStamp& stamp, OctetView packet) {
  assert(!packet.empty() && packet.size() <= max_stored_packet_octets);
  const std::int64_t tai_s = std::chrono::floor<seconds>(stamp.tai.since_epoch()).count();
  const auto centiseconds = static_cast<std::uint32_t>(stamp.monotonic.ns() / 10'000'000) & ~time_valid_bit;
  OctetWriter writer(packet.size() + record_overhead_octets);
  writer.u16(record_magic);
  writer.u16(static_cast<std::uint16_t>(packet.size()));
  writer.u32(sequence);
  writer.u32(static_cast<std::uint32_t>(tai_s));
  writer.u16(kept_fraction(stamp.tai));
  writer.u16(stamp.boot_id);
  writer.u32(centiseconds | (stamp.time_valid ? time_valid_bit : 0));
  writer.bytes(packet);
  writer.u32(crc32c(writer.view()));
  const OctetView record = writer.view();
  out.insert(out.end(), record.begin(), record.end());
}

Result<StoreRecord, RecordError> decode_record(OctetView data) {
  OctetReader reader(data);
  const std::uint16_t magic = reader.u16();
  const std::size_t length = reader.u16();
  if (!reader.ok()) return Err(RecordError::incomplete);
  if (magic != record_magic || length == 0 || length > max_stored_packet_octets)
    return Err(RecordError::damaged);
  if (data.size() < length + record_overhead_octets) return Err(RecordError::incomplete);

  StoreRecord record;
  record.sequence = reader.u32();
  const std::uint32_t tai_s = reader.u32();
  record.stamp.tai = time_of(tai_s, reader.u16());
  record.stamp.boot_id = reader.u16();
  const std::uint32_t monotonic = reader.u32();
  record.stamp.time_valid = (monotonic & time_valid_bit) != 0;
  record.stamp.monotonic = MonotonicTime(milliseconds(std::int64_t{monotonic & ~time_valid_bit} * 10));
  record.packet = reader.bytes(length);
  if (reader.u32() != crc32c(data.first(header_octets + length))) return Err(RecordError::damaged);
  return record;
}

std::size_t find_record(OctetView data, std::size_t offset) {
  for (; offset + record_overhead_octets < data.size(); ++offset) {
    if (data[offset] != record_magic >> 8 || data[offset + 1] != (record_magic & 0xFF)) continue;
    if (decode_record(data.subspan(offset))) return offset;
  }
  return data.size();
}

}  // namespace srfs
