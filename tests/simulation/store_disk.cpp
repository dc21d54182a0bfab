// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/store_disk.hpp"

#include <algorithm>

#include "base/crc32c.hpp"
#include "nodes/ttc/store/store_record.hpp"

namespace srfs::simulation {
namespace {

constexpr std::size_t block = 512;

void put(Octets& file, std::size_t offset, OctetView octets) {
  if (file.size() < offset + octets.size()) file.resize(offset + octets.size());
  std::copy(octets.begin(), octets.end(), file.begin() + static_cast<std::ptrdiff_t>(offset));
}

void add_records(std::vector<StoredRecord>& to, OctetView data) {
  for (std::size_t at = find_record(data, 0); at < data.size(); at = find_record(data, at)) {
    const auto record = decode_record(data.subspan(at));
    to.push_back({record->sequence, record->stamp.tai, crc32c(record->packet)});
    at += record->octets();
  }
}

}  // namespace

bool SegmentDisk::may_change() {
  auto& left = state_.changes_left;
  if (state_.failing || left == 0U) return false;
  if (left) --*left;
  return true;
}

void SegmentDisk::lose_power() {
  for (auto& [number, file] : files_) {
    for (const Write& w : file.unsynced) {
      const OctetView octets(w.octets);
      switch (random_.below(4)) {
        case 0:
          break;
        case 1:
          put(file.durable, w.offset, octets);
          break;
        case 2:
          put(file.durable, w.offset, octets.first(random_.below(octets.size() + 1)));
          break;
        default:
          for (std::size_t at = 0; at < octets.size(); at += block) {
            if (random_.one_in(2))
              put(file.durable, w.offset + at, octets.subspan(at, std::min(block, octets.size() - at)));
          }
      }
    }
    file.unsynced.clear();
    file.now = file.durable;
  }
}

std::vector<StoredRecord> SegmentDisk::records() const {
  std::vector<StoredRecord> found;
  for (const auto& [number, file] : files_) add_records(found, file.now);
  return found;
}

std::size_t SegmentDisk::octets() const {
  std::size_t all = 0;
  for (const auto& [number, file] : files_) all += file.now.size();
  return all;
}

std::size_t SegmentDisk::longest_file() const {
  std::size_t longest = 0;
  for (const auto& [number, file] : files_) longest = std::max(longest, file.now.size());
  return longest;
}

Result<std::vector<std::uint32_t>, SegmentError> PlayedSegmentFiles::list() {
  std::vector<std::uint32_t> numbers;
  for (const auto& [number, file] : disk_.files_) numbers.push_back(number);
  return numbers;
}

Result<Octets, SegmentError> PlayedSegmentFiles::read(std::uint32_t number, std::size_t octets_max) {
  const auto found = disk_.files_.find(number);
  if (found == disk_.files_.end()) return Err(SegmentError{"no such file", true});
  if (found->second.now.size() > octets_max) return Err(SegmentError{"the file is too long"});
  return found->second.now;
}

Result<void, SegmentError> PlayedSegmentFiles::cut(std::uint32_t number, std::size_t octets) {
  if (!disk_.may_change()) return Err(SegmentError{"no space"});
  SegmentDisk::File& file = disk_.files_.at(number);
  file.now.resize(octets);
  file.durable = file.now;
  file.unsynced.clear();
  return {};
}

Result<void, SegmentError> PlayedSegmentFiles::remove(std::uint32_t number) {
  if (!disk_.may_change()) return Err(SegmentError{"read-only file system"});
  const auto found = disk_.files_.find(number);
  if (found == disk_.files_.end()) return Err(SegmentError{"no such file", true});
  SegmentDisk::Deletion deletion{found == disk_.files_.begin(), disk_.octets(), {}};
  add_records(deletion.records, found->second.now);
  disk_.deletions_.push_back(std::move(deletion));
  disk_.files_.erase(found);
  return {};
}

Result<void, SegmentError> PlayedSegmentFiles::create(std::uint32_t number, OctetView header) {
  if (!disk_.may_change()) return Err(SegmentError{"no space"});
  disk_.files_[number] = {};
  open_ = number;
  return write(0, header);
}

Result<void, SegmentError> PlayedSegmentFiles::open(std::uint32_t number) {
  open_.reset();
  if (!exists(number)) return Err(SegmentError{"no such file", true});
  open_ = number;
  return {};
}

Result<void, SegmentError> PlayedSegmentFiles::write(std::size_t offset, OctetView octets) {
  if (!disk_.may_change()) return Err(SegmentError{"no space"});
  SegmentDisk::File& file = disk_.files_.at(*open_);
  put(file.now, offset, octets);
  file.unsynced.push_back({offset, {octets.begin(), octets.end()}});
  return {};
}

Result<void, SegmentError> PlayedSegmentFiles::sync() {
  SegmentDisk::File& file = disk_.files_.at(*open_);
  const bool synced = disk_.may_change();
  if (synced) {
    for (const auto& [offset, octets] : file.unsynced) put(file.durable, offset, octets);
  }
  // After an error, too: the kernel reports it once, and never writes what it could not write.
  if (synced || disk_.state_.failing) file.unsynced.clear();
  if (!synced) return Err(SegmentError{"no space"});
  return {};
}

}  // namespace srfs::simulation
