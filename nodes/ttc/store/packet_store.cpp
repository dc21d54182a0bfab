// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/store/packet_store.hpp"

#include <algorithm>
#include <cerrno>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/crc32c.hpp"
#include "base/text.hpp"

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

std::optional<std::uint32_t> segment_number(const std::filesystem::path& path) {
  const std::string stem = path.stem().string();
  return path.extension() == ".seg" && stem.size() == 8 ? to_number<std::uint32_t>(stem, 16) : std::nullopt;
}

void sync_folder(const std::filesystem::path& folder) {
  const Fd fd(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (fd) (void)fsync(fd.get());
}

}  // namespace

void PacketStore::Segment::count(TaiTime t, std::uint32_t sequence) {
  ++records;
  end_sequence = std::max(end_sequence, sequence + 1);
  oldest = oldest ? std::min(*oldest, t) : t;
  newest = newest ? std::max(*newest, t) : t;
}

std::filesystem::path PacketStore::path_of(std::uint32_t number) const {
  return config_.folder / fmt::format("{:08x}.seg", number);
}

FileError PacketStore::failure(const char* what, const std::filesystem::path& path, int error) const {
  return FileError{fmt::format("{}: cannot {}: {}", path.string(), what, errno_text(error))};
}

Result<void, FileError> PacketStore::open() {
  std::error_code ec;
  std::filesystem::create_directories(config_.folder, ec);
  std::vector<std::uint32_t> numbers;
  for (auto it = std::filesystem::directory_iterator(config_.folder, ec);
       !ec && it != std::filesystem::directory_iterator(); it.increment(ec)) {
    if (const auto number = segment_number(it->path())) numbers.push_back(*number);
  }
  if (ec) return Err(failure("list", config_.folder, ec.value()));
  std::sort(numbers.begin(), numbers.end());
  segments_.clear();
  cached_number_.reset();
  file_.reset();
  for (const std::uint32_t number : numbers) {
    if (recover(number, number == numbers.back())) continue;
    ++counters_.unreadable;
    // Counted as full, so that nothing is appended to it.
    segments_[number] = Segment{};
    segments_[number].octets = config_.segment_octets;
    segments_[number].unreadable = true;
  }
  opened_ = true;
  gone_ = false;
  if (!recovered_sequence_) recovered_sequence_ = next_sequence_;
  return {};
}

Result<void, FileError> PacketStore::recover(std::uint32_t number, bool last) {
  // A file may be longer than a segment when one commit was large; twice is never written.
  auto content = read_file(path_of(number), 2 * config_.segment_octets + config_.pending_octets);
  if (!content) return Err(content.error());
  const OctetView data = as_octets(*content);
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
      if (truncate(path_of(number).c_str(), static_cast<off_t>(offset)) != 0) {
        return Err(failure("cut the tail of", path_of(number), errno));
      }
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
  if (packet.empty() || packet.size() > max_stored_packet_octets ||
      pending_.size() + packet.size() + record_overhead_octets > config_.pending_octets) {
    ++counters_.refused;
    return;
  }
  const std::size_t coming = segment_header_octets + pending_.size() + packet.size() + record_overhead_octets;
  full_ = bounded_ && octets() + coming > config_.quota_octets;
  if (full_) {
    ++counters_.full;
    return;
  }
  pending_index_.count(stamp.tai, next_sequence_);
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
  if (pending_.empty() && !unsynced_) return {};
  auto written = pending_.empty() ? start_segment() : write_pending();
  if (written && fdatasync(file_.get()) != 0)
    written = Err(failure("sync", path_of(segments_.rbegin()->first), errno));
  if (!written) {
    ++counters_.write_failures;
    file_.reset();  // reopened at the next try; a disk that came back read-only or elsewhere is noticed
  }
  failing_ = !written;
  unsynced_ = unsynced_ && !written;
  return written;
}

Result<void, FileError> PacketStore::start_segment() {
  struct stat info {};
  if (file_ && fstat(file_.get(), &info) == 0 && info.st_nlink == 0) {
    gone_ = true;  // it was removed: what is written there is lost
    return Err(failure("write", path_of(segments_.rbegin()->first), ENOENT));
  }
  if (!segments_.empty() && !file_) {
    const std::uint32_t number = segments_.rbegin()->first;
    if (segments_.rbegin()->second.octets + pending_.size() <= config_.segment_octets &&
        segments_.rbegin()->second.octets >= segment_header_octets) {
      file_ = Fd(::open(path_of(number).c_str(), O_WRONLY | O_CLOEXEC));
      if (!file_) {
        gone_ = errno == ENOENT;
        return Err(failure("open", path_of(number), errno));
      }
      return {};
    }
  }
  if (file_ && segments_.rbegin()->second.octets + pending_.size() <= config_.segment_octets) return {};
  // The whole segment is counted from its start, so the quota holds while it fills.
  keep_quota(std::max(config_.segment_octets, segment_header_octets + pending_.size()));
  const std::uint32_t number = segments_.empty() ? 0 : segments_.rbegin()->first + 1;
  file_ = Fd(::open(path_of(number).c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
  if (!file_) {
    gone_ = errno == ENOENT;
    return Err(failure("create", path_of(number), errno));
  }
  const Octets header = segment_header(number);
  if (pwrite(file_.get(), header.data(), header.size(), 0) != static_cast<ssize_t>(header.size())) {
    const int error = errno;
    file_.reset();
    unlink(path_of(number).c_str());
    return Err(failure("write", path_of(number), error));
  }
  sync_folder(config_.folder);
  segments_[number].octets = segment_header_octets;
  counters_.written_octets += header.size();
  return {};
}

Result<void, FileError> PacketStore::write_pending() {
  if (auto started = start_segment(); !started) return started;
  auto& [number, segment] = *segments_.rbegin();
  std::size_t done = 0;
  while (done < pending_.size()) {
    const ssize_t n = pwrite(file_.get(), pending_.data() + done, pending_.size() - done,
                             static_cast<off_t>(segment.octets + done));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      const int error = n == 0 ? ENOSPC : errno;
      // half a record must not stay
      [[maybe_unused]] const int ignored = ftruncate(file_.get(), static_cast<off_t>(segment.octets));
      return Err(failure("write", path_of(number), error));
    }
    done += static_cast<std::size_t>(n);
  }
  segment.octets += pending_.size();
  segment.records += pending_index_.records;
  segment.end_sequence = std::max(segment.end_sequence, pending_index_.end_sequence);
  if (pending_index_.oldest) {
    segment.oldest =
        segment.oldest ? std::min(*segment.oldest, *pending_index_.oldest) : pending_index_.oldest;
    segment.newest =
        segment.newest ? std::max(*segment.newest, *pending_index_.newest) : pending_index_.newest;
  }
  counters_.stored += pending_index_.records;
  counters_.written_octets += pending_.size();
  unsynced_ = true;
  if (cached_number_ == number) cached_number_.reset();
  pending_.clear();
  pending_index_ = {};
  return {};
}

void PacketStore::keep_quota(std::size_t coming_octets) {
  if (bounded_) return;  // append() takes nothing beyond it
  std::size_t total = coming_octets + octets();
  while (!segments_.empty() && total > config_.quota_octets) {
    const auto oldest = segments_.begin();
    total -= oldest->second.octets;
    if (segments_.size() == 1) break;  // its number must stay known: numbers only go up
    counters_.overwritten += oldest->second.records;
    delete_segment(oldest->first);
  }
}

void PacketStore::delete_segment(std::uint32_t number) {
  (void)unlink(path_of(number).c_str());
  if (cached_number_ == number) cached_number_.reset();
  segments_.erase(number);
}

const Octets* PacketStore::content_of(std::uint32_t number) {
  if (cached_number_ != number) {
    const auto content = read_file(path_of(number), 2 * config_.segment_octets + config_.pending_octets);
    if (!content) return nullptr;
    const OctetView octets = as_octets(*content);
    cached_.assign(octets.begin(), octets.end());
    cached_number_ = number;
  }
  return &cached_;
}

RetrievedPackets PacketStore::read(const RetrievalRange& range, RetrievalCursor cursor,
                                   std::size_t limit_octets) {
  RetrievedPackets out;
  if (opened_ && !pending_.empty() && !write_pending()) ++counters_.write_failures;
  const std::uint32_t end_sequence = cursor.end_sequence.value_or(next_sequence_);
  out.next = {.end_sequence = end_sequence, .begin_sequence = cursor.begin_sequence};
  out.next_sequence = cursor.begin_sequence;
  std::size_t octets = 0;
  auto segment = segments_.lower_bound(cursor.segment);
  std::size_t offset = segment != segments_.end() && segment->first == cursor.segment ? cursor.offset : 0;
  for (; segment != segments_.end(); ++segment, offset = 0) {
    const auto& index = segment->second;
    if (!index.unreadable && (!index.oldest || *index.oldest > range.to || *index.newest < range.from ||
                              index.end_sequence <= cursor.begin_sequence))
      continue;
    const Octets* data = content_of(segment->first);
    if (data == nullptr) {
      ++counters_.unreadable;
      out.damaged = true;
      std::error_code ec;
      gone_ = gone_ || !std::filesystem::exists(path_of(segment->first), ec);
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
      const bool wanted = record->stamp.tai >= range.from && record->stamp.tai <= range.to &&
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
