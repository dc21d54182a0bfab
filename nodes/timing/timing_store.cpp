// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/timing/timing_store.hpp"

#include <utility>

#include "base/log.hpp"

namespace srfs {
namespace {

constexpr StateCodec<TimingRecord> codec{
    .encode = [](const TimingRecord& record) { return encode_timing_record(record); },
    .decode = [](std::string_view text) -> std::optional<TimingRecord> {
      auto record = decode_timing_record(std::string(text));
      return record ? std::optional(std::move(*record)) : std::nullopt;
    },
    .is_newer =
        [](const TimingRecord& record, const TimingRecord& than) {
          return std::pair(record.cycle_ceiling, record.utc) > std::pair(than.cycle_ceiling, than.utc);
        },
};

}  // namespace

TimingStore::TimingStore(const std::filesystem::path& folder)
    : file_(folder / "cycle_a", folder / "cycle_b", codec, StateFile<TimingRecord>::Writes::in_turn) {}

TimingRecord TimingStore::load() {
  const auto found = file_.load();
  TimingRecord newest = found.state.value_or(TimingRecord{});
  if (!found.damaged.empty()) {
    log::error("the cycle number jumps to stay ahead of what is damaged");
    newest.cycle_ceiling += 2 * CycleReservation::step;
  }
  return newest;
}

Result<void, FileError> TimingStore::save(const TimingRecord& record) {
  const auto stored = file_.store(record);
  if (!stored.durable()) return Err(FileError{stored.problem});
  if (!stored.problem.empty()) log::error("{}", stored.problem);
  return {};
}

}  // namespace srfs
