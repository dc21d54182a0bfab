// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/timing/timing_store.hpp"

#include <utility>

#include "base/log.hpp"

namespace srfs {

std::filesystem::path TimingStore::file(int turn) const {
  return folder_ / (turn == 0 ? "cycle_a" : "cycle_b");
}

TimingRecord TimingStore::load() const {
  TimingRecord newest;
  bool damaged = false;
  for (const int turn : {0, 1}) {
    if (!std::filesystem::exists(file(turn))) continue;
    const auto text = read_file(file(turn), 4096);
    const auto record = text ? decode_timing_record(*text) : Err(TimingRecordError::damaged);
    if (!record) {
      damaged = true;
      log::error("{} is damaged, the cycle number jumps to stay ahead", file(turn).string());
    } else if (std::pair(record->cycle_ceiling, record->utc) >= std::pair(newest.cycle_ceiling, newest.utc)) {
      newest = *record;
    }
  }
  if (damaged) newest.cycle_ceiling += 2 * CycleReservation::step;
  return newest;
}

Result<void, FileError> TimingStore::save(const TimingRecord& record) {
  turn_ = 1 - turn_;
  return write_file_atomically(file(turn_), encode_timing_record(record));
}

}  // namespace srfs
