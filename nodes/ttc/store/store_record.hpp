// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"

namespace srfs {

/// When a packet was made, on all scales: the board has no battery clock, so TAI alone may be wrong.
struct RecordStamp {
  TaiTime tai;              ///< kept to 2^-16 s
  bool time_valid = false;  ///< whether the spacecraft time was valid then
  std::uint16_t boot_id = 0;
  MonotonicTime monotonic;  ///< kept to 10 ms, wraps after 248 days
};

/// One record of a packet store, as decoded. The packet points into the decoded octets; its APID is in its
/// own header.
struct StoreRecord {
  std::uint32_t sequence = 0;
  RecordStamp stamp;
  OctetView packet;
  [[nodiscard]] std::size_t octets() const;
};

/// What a record keeps of @p tai: no later than it, by less than 2^-16 s.
[[nodiscard]] TaiTime kept_time(TaiTime tai);

enum class RecordError : std::uint8_t {
  incomplete,  ///< the octets end before the record does
  damaged,     ///< no magic here, an impossible length, or a wrong CRC
};

inline constexpr std::size_t record_overhead_octets = 24;
inline constexpr std::size_t max_stored_packet_octets = 4096;

/// Appends one record: magic u16, packet length u16, sequence u32, TAI u32 s + u16 / 2^16 s, boot id u16,
/// time-valid bit + 31 bits monotonic centiseconds, packet, CRC-32C of all before. Big-endian.
/// @param packet 1 to max_stored_packet_octets (checked by the caller)
void append_record(Octets& out, std::uint32_t sequence, const RecordStamp& stamp, OctetView packet);

/// The record that starts at the first octet of @p data.
[[nodiscard]] Result<StoreRecord, RecordError> decode_record(OctetView data);

/// Offset of the first valid record at or after @p offset; data.size() if there is none.
[[nodiscard]] std::size_t find_record(OctetView data, std::size_t offset);

}  // namespace srfs
