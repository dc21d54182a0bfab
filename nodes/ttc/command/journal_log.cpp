// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/command/journal_log.hpp"

#include <algorithm>
#include <cassert>

#include "base/crc32c.hpp"

namespace srfs {
namespace {

constexpr std::uint16_t record_magic = 0x544A;  // "TJ"
constexpr std::size_t header_octets = journal_record_overhead - 4;

void append_journal_record(Octets& out, const JournalRecord& record, std::uint32_t generation,
                           std::uint32_t index) {
  OctetWriter writer(record.payload.size() + journal_record_overhead);
  writer.u16(record_magic);
  writer.u8(record.kind);
  writer.u24(static_cast<std::uint32_t>(record.payload.size()));
  writer.u32(generation);
  writer.u32(index);
  writer.bytes(record.payload);
  writer.u32(crc32c(writer.view()));
  assert(writer.ok());
  const OctetView octets = writer.view();
  out.insert(out.end(), octets.begin(), octets.end());
}

struct ScannedRecord {
  std::size_t begin = 0;
  std::size_t end = 0;
  std::uint32_t generation = 0;
  std::uint32_t index = 0;
  std::uint8_t kind = 0;
  OctetView payload{};
};

std::optional<ScannedRecord> record_at(OctetView octets, std::size_t offset) {
  OctetReader reader(octets.subspan(offset));
  if (reader.u16() != record_magic) return std::nullopt;
  ScannedRecord record{.begin = offset};
  record.kind = reader.u8();
  const std::size_t length = reader.u24();
  record.generation = reader.u32();
  record.index = reader.u32();
  record.payload = reader.bytes(length);
  if (reader.u32() !=
      crc32c(octets.subspan(offset, std::min(header_octets + length, octets.size() - offset))))
    return std::nullopt;
  if (!reader.ok() || record.generation == 0) return std::nullopt;
  record.end = offset + length + journal_record_overhead;
  return record;
}

std::vector<ScannedRecord> all_records(OctetView octets) {
  std::vector<ScannedRecord> found;
  std::size_t offset = 0;
  while (offset + journal_record_overhead <= octets.size()) {
    const bool candidate = octets[offset] == record_magic >> 8 && octets[offset + 1] == (record_magic & 0xFF);
    const auto record = candidate ? record_at(octets, offset) : std::nullopt;
    if (record) found.push_back(*record);
    offset = record ? record->end : offset + 1;
  }
  return found;
}

}  // namespace

JournalSegment scan_journal_segment(OctetView octets) {
  const std::vector<ScannedRecord> all = all_records(octets);
  JournalSegment segment;
  for (const ScannedRecord& record : all)
    segment.generation = std::max(segment.generation, record.generation);
  for (const ScannedRecord& record : all) {
    // Another generation, or an index that does not rise: left from an older use.
    if (record.generation != segment.generation || record.index < segment.next_index) continue;
    segment.damaged_octets += record.begin - segment.end;
    segment.end = record.end;
    segment.next_index = record.index + 1;
    segment.whole = segment.whole || (record.index == 0 && record.kind == journal_snapshot_kind);
    segment.records.push_back(
        JournalRecord{.kind = record.kind, .payload = {record.payload.begin(), record.payload.end()}});
  }
  return segment;
}

JournalLog::Found JournalLog::load() {
  Found found;
  std::array<JournalSegment, JournalMedium::segments> segments;
  for (unsigned i = 0; i < JournalMedium::segments; ++i) {
    const Octets octets = medium_.read(i);
    found.existed = found.existed || std::any_of(octets.begin(), octets.end(), [](auto o) { return o != 0; });
    segments[i] = scan_journal_segment(octets);
  }
  const unsigned newest = segments[1].generation > segments[0].generation ? 1 : 0;
  JournalSegment& last = segments[newest];
  JournalSegment& before = segments[1 - newest];
  // What the segment before lacks is in the last one's snapshot, if that is whole.
  found.damaged_octets = last.damaged_octets + (last.whole ? 0 : before.damaged_octets);
  for (JournalRecord& record : before.records) found.records.push_back(std::move(record));
  for (JournalRecord& record : last.records) found.records.push_back(std::move(record));
  // The next snapshot must not go to the only whole one.
  current_ = last.whole || !before.whole ? newest : 1 - newest;
  generation_ = last.generation;
  next_index_ = 0;
  end_ = last.end;
  return found;
}

Result<void, FileError> JournalLog::append(const std::vector<JournalRecord>& records, bool sync) {
  assert(next_index_ > 0);
  Octets octets;
  std::uint32_t index = next_index_;
  for (const JournalRecord& record : records) append_journal_record(octets, record, generation_, index++);
  if (end_ + octets.size() > journal_segment_octets) return Err(FileError{"the journal's segment is full"});
  if (!octets.empty()) {
    if (auto written = medium_.write(current_, end_, octets); !written) return written;
    end_ += octets.size();
    next_index_ = index;
  }
  return sync ? medium_.sync(current_) : Result<void, FileError>{};
}

Result<void, FileError> JournalLog::snapshot(const Octets& state) {
  const unsigned other = 1 - current_;
  Octets octets;
  // A try that failed may be found by the next process: each has a generation of its own.
  append_journal_record(octets, {.kind = journal_snapshot_kind, .payload = state}, ++generation_, 0);
  if (octets.size() > journal_segment_octets) return Err(FileError{"the journal's state does not fit"});
  if (auto written = medium_.write(other, 0, octets); !written) return written;
  if (auto synced = medium_.sync(other); !synced) return synced;
  current_ = other;
  end_ = octets.size();
  next_index_ = 1;
  return {};
}

}  // namespace srfs
