// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/store/packet_store.hpp"

#include <algorithm>

#include "base/crc32c.hpp"

namespace srfs {
namespace {

constexpr std::uint64_t segment_magic = 0x5352'4653'5345'4731;  // "SRFSSEG1"
constexpr std::size_t segment_header_octets = 16;

Octets segment_header(std::uint32_t number) {
  OctetWriter writer(segment_header_octets);
  writer.u64(segment_magic);
  writer.u32(number);
  writer.u32(crc32c(writer.view()));
  return writer.take();
}

}  // namespace

void PacketStore::Segment::count(TaiTime t, std::uint32_t sequence) {
  ++records;
  end_sequence = std::max(end_sequence, sequence + 1);
  oldest = oldest ? std::min(*oldest, t) : t;
  newest = newest ? std::max(*newest, t) : t;
}

void PacketStore::Segment::add(const Segment& later) {
  records += later.records;
  end_sequence = std::max(end_sequence, later.end_sequence);
  if (!later.oldest) return;
  oldest = oldest ? std::min(*oldest, *later.oldest) : later.oldest;
  newest = newest ? std::max(*newest, *later.newest) : later.newest;
}

/// A file may be longer than a segment when one commit was large; twice is never written.
std::size_t PacketStore::longest_file() const {
  return 2 * config_.segment_octets + config_.pending_octets;
}

/// Before the files are read anew. What is in a file that has vanished is lost with it.
Result<void, FileError> PacketStore::sync_what_is_left() {
  if (unsynced_octets_.empty()) return {};
  const auto there = files_->is_open() ? files_->check_open() : files_->open(segments_.rbegin()->first);
  if (there) return sync();
  if (!there.error().is_missing) return Err(FileError{there.error().message});
  unsynced_octets_.clear();
  unsynced_index_ = {};
  return {};
}

Result<void, FileError> PacketStore::open() {
  if (auto left = sync_what_is_left(); !left) return left;
  const auto numbers = files_->list();
  if (!numbers) return Err(FileError{numbers.error().message});
  segments_.clear();
  cached_number_.reset();
  files_->close();
  for (const std::uint32_t number : *numbers) {
    if (recover(number, number == numbers->back())) continue;
    ++counters_.unreadable;
    // Counted as full, so that nothing is appended to it.
    segments_[number] = Segment{};
    segments_[number].octets = config_.segment_octets;
    segments_[number].unreadable = true;
  }
  synced_ = segments_.empty() ? Segment{} : segments_.rbegin()->second;
  opened_ = true;
  gone_ = false;
  if (!recovered_sequence_) recovered_sequence_ = next_sequence_;
  return {};
}

Result<void, FileError> PacketStore::recover(std::uint32_t number, bool last) {
  const auto content = files_->read(number, longest_file());
  if (!content) return Err(FileError{content.error().message});
  const OctetView data(*content);
  Segment segment;
  std::size_t offset = std::min(segment_header_octets, data.size());
  while (offset < data.size()) {
    const auto record = decode_record(data.subspan(offset));
    if (record) {
      segment.count(record->stamp.tai, record->sequence);
      next_sequence_ = std::max(next_sequence_, record->sequence + 1);
      offset += record->octets();
      continue;
    }
    const std::size_t next = find_record(data, offset + 1);
    if (next == data.size() && record.error() == RecordError::incomplete && last) {
      if (const auto cut = files_->cut(number, offset); !cut) return Err(FileError{cut.error().message});
      counters_.cut_octets += data.size() - offset;
      break;
    }
    ++counters_.damaged;
    counters_.damaged_octets += next - offset;
    offset = next;
  }
  segment.octets = offset;
  segments_[number] = segment;
  return {};
}

void PacketStore::set_bounded(bool bounded) {
  bounded_ = bounded;
  full_ = full_ && bounded;
}

std::size_t PacketStore::octets() const {
  std::size_t total = 0;
  for (const auto& [number, segment] : segments_) total += segment.octets;
  return total;
}

void PacketStore::append(const RecordStamp& stamp, OctetView packet) {
  const std::size_t waiting = unsynced_octets_.size() + pending_.size();
  if (packet.empty() || packet.size() > max_stored_packet_octets ||
      waiting + packet.size() + record_overhead_octets > config_.pending_octets) {
    ++counters_.refused;
    return;
  }
  const std::size_t coming = segment_header_octets + pending_.size() + packet.size() + record_overhead_octets;
  full_ = bounded_ && octets() + coming > config_.quota_octets;
  if (full_) {
    ++counters_.full;
    return;
  }
  pending_index_.count(kept_time(stamp.tai), next_sequence_);
  append_record(pending_, next_sequence_++, stamp, packet);
}

Result<void, FileError> PacketStore::commit() {
  if (!opened_ || gone_) {
    if (auto opened = open(); !opened) {
      failing_ = true;
      ++counters_.write_failures;
      return opened;
    }
  }
  if (pending_.empty() && unsynced_octets_.empty()) return {};
  auto written = pending_.empty() ? start_segment() : write_pending();
  if (written) written = sync();
  if (!written) {
    ++counters_.write_failures;
    files_->close();  // reopened at the next try; a disk that came back read-only or elsewhere is noticed
  }
  failing_ = !written;
  return written;
}

/// Of the open file, which is the last segment. After an error its unsynced records are pending again, and
/// the segment ends before them; where that fails, too, they may be there twice.
Result<void, FileError> PacketStore::sync() {
  const auto synced = files_->sync();
  auto& [number, segment] = *segments_.rbegin();
  if (synced) {
    synced_ = segment;
  } else {
    files_->close();
    static_cast<void>(files_->cut(number, synced_.octets));
    segment = synced_;
    pending_.insert(pending_.begin(), unsynced_octets_.begin(), unsynced_octets_.end());
    pending_index_.add(unsynced_index_);
    counters_.stored -= unsynced_index_.records;
  }
  unsynced_octets_.clear();
  unsynced_index_ = {};
  if (!synced) return Err(FileError{synced.error().message});
  return {};
}

Result<void, FileError> PacketStore::start_segment() {
  const auto failed = [this](const SegmentError& error) {
    gone_ = gone_ || error.is_missing;
    return Err(FileError{error.message});
  };
  if (const auto open = files_->check_open(); !open) return failed(open.error());
  const bool fits =
      !segments_.empty() && segments_.rbegin()->second.octets + pending_.size() <= config_.segment_octets;
  if (files_->is_open() && fits) return {};
  if (fits && segments_.rbegin()->second.octets >= segment_header_octets) {
    const auto opened = files_->open(segments_.rbegin()->first);
    return opened ? Result<void, FileError>() : failed(opened.error());
  }
  // What a retrieval had written is not synced yet, and the next sync is that of the new file.
  if (!unsynced_octets_.empty()) {
    if (!files_->is_open()) {
      if (const auto opened = files_->open(segments_.rbegin()->first); !opened) return failed(opened.error());
    }
    if (const auto synced = sync(); !synced) return synced;
  }
  // The whole segment is counted from its start, so the quota holds while it fills.
  const auto kept = keep_quota(std::max(config_.segment_octets, segment_header_octets + pending_.size()));
  if (!kept) return failed(kept.error());
  // One whose header did not reach the disk is begun again.
  const bool again = !segments_.empty() && segments_.rbegin()->second.octets == 0;
  const std::uint32_t number = segments_.empty() ? 0 : segments_.rbegin()->first + (again ? 0U : 1U);
  const Octets header = segment_header(number);
  if (const auto created = files_->create(number, header); !created) return failed(created.error());
  segments_[number].octets = segment_header_octets;
  synced_ = {};
  counters_.written_octets += header.size();
  return {};
}

Result<void, FileError> PacketStore::write_pending() {
  if (auto started = start_segment(); !started) return started;
  auto& [number, segment] = *segments_.rbegin();
  if (const auto written = files_->write(segment.octets, pending_); !written)
    return Err(FileError{written.error().message});
  segment.octets += pending_.size();
  segment.add(pending_index_);
  counters_.stored += pending_index_.records;
  counters_.written_octets += pending_.size();
  unsynced_octets_.insert(unsynced_octets_.end(), pending_.begin(), pending_.end());
  unsynced_index_.add(pending_index_);
  if (cached_number_ == number) cached_number_.reset();
  pending_.clear();
  pending_index_ = {};
  return {};
}

/// A segment that cannot be deleted stays counted: the next commit tries again.
Result<void, SegmentError> PacketStore::keep_quota(std::size_t coming_octets) {
  if (bounded_) return {};  // append() takes nothing beyond it
  // The last one stays: its number must be known, numbers only go up.
  while (segments_.size() > 1 && coming_octets + octets() > config_.quota_octets) {
    const auto& [number, segment] = *segments_.begin();
    const auto removed = files_->remove(number);
    if (!removed && !removed.error().is_missing) return removed;
    counters_.overwritten += segment.records;
    if (cached_number_ == number) cached_number_.reset();
    segments_.erase(segments_.begin());
  }
  return {};
}

const Octets* PacketStore::content_of(std::uint32_t number) {
  if (cached_number_ != number) {
    auto content = files_->read(number, longest_file());
    if (!content) return nullptr;
    cached_ = std::move(*content);
    cached_number_ = number;
  }
  return &cached_;
}

RetrievedPackets PacketStore::read(const RetrievalRange& range, RetrievalCursor cursor,
                                   std::size_t limit_octets) {
  RetrievedPackets out;
  // A packet's own time is finer than what its record keeps, and rounded to the nearest 2^-24 s.
  constexpr nanoseconds rounding{30};
  const TaiTime from = kept_time(std::max(range.from, TaiTime(rounding)) - rounding);
  if (opened_ && !pending_.empty() && !write_pending()) ++counters_.write_failures;
  const std::uint32_t end_sequence = cursor.end_sequence.value_or(next_sequence_);
  out.next = {.end_sequence = end_sequence, .begin_sequence = cursor.begin_sequence};
  out.next_sequence = cursor.begin_sequence;
  std::size_t octets = 0;
  auto segment = segments_.lower_bound(cursor.segment);
  std::size_t offset = segment != segments_.end() && segment->first == cursor.segment ? cursor.offset : 0;
  for (; segment != segments_.end(); ++segment, offset = 0) {
    const auto& index = segment->second;
    if (!index.unreadable && (!index.oldest || *index.oldest > range.to || *index.newest < from ||
                              index.end_sequence <= cursor.begin_sequence))
      continue;
    const Octets* data = content_of(segment->first);
    if (data == nullptr) {
      ++counters_.unreadable;
      out.damaged = true;
      gone_ = gone_ || !files_->exists(segment->first);
      continue;
    }
    offset = std::max(offset, segment_header_octets);
    while (offset < data->size()) {
      const auto record = decode_record(OctetView(*data).subspan(offset));
      if (!record) {
        ++counters_.unreadable;
        offset = find_record(*data, offset + 1);
        continue;
      }
      const bool wanted = record->stamp.tai >= from && record->stamp.tai <= range.to &&
                          record->sequence >= cursor.begin_sequence && record->sequence < end_sequence;
      if (wanted && octets + record->packet.size() > limit_octets && !out.packets.empty()) {
        out.next.segment = segment->first;
        out.next.offset = offset;
        return out;
      }
      offset += record->octets();
      if (record->sequence < end_sequence)
        out.next_sequence = std::max(out.next_sequence, record->sequence + 1);
      if (!wanted) continue;
      out.packets.emplace_back(record->packet.begin(), record->packet.end());
      octets += record->packet.size();
    }
  }
  out.finished = true;
  cached_number_.reset();
  Octets().swap(cached_);  // a mebibyte is not kept for the next retrieval
  return out;
}

PacketStoreStatus PacketStore::status() const {
  PacketStoreStatus status;
  status.quota_octets = config_.quota_octets;
  status.segments = segments_.size();
  status.failing = failing_ || !opened_;
  status.full = full_;
  status.next_sequence = next_sequence_;
  status.recovered_sequence = recovered_sequence_.value_or(0);
  status.counters = counters_;
  for (const auto& [number, segment] : segments_) {
    status.octets += segment.octets;
    status.records += segment.records;
    if (segment.oldest)
      status.oldest = status.oldest ? std::min(*status.oldest, *segment.oldest) : segment.oldest;
    if (segment.newest)
      status.newest = status.newest ? std::max(*status.newest, *segment.newest) : segment.newest;
  }
  return status;
}

}  // namespace srfs
