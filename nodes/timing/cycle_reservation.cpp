// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/timing/cycle_reservation.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include <fmt/format.h>

#include "base/octets.hpp"
#include "base/text.hpp"
#include "wire/crc16.hpp"

namespace srfs {
namespace {}  // namespace

std::string encode_timing_record(const TimingRecord& record) {
  std::string body = fmt::format(
      "srfs-timing 1\ncycle_ceiling {}\nutc_ns {}\nutc_valid {}\nmonotonic_ns {}\nboot_id {}\nerror_ns {}\n",
      record.cycle_ceiling, record.utc.ns(), record.utc_valid ? 1 : 0, record.at.ns(), record.boot_id,
      record.error.count());
  if (record.drift_ppm) body += fmt::format("drift_ppb {}\n", std::lround(*record.drift_ppm * 1e3));
  return body + fmt::format("crc {:04x}\n", wire::crc16(as_octets(body)));
}

namespace {

/// Lines that the first records did not have, and others that a later version may add.
void read_quality(std::istream& lines, TimingRecord& record) {
  std::string key;
  std::int64_t value = 0;
  while (lines >> key >> value) {
    if (key == "error_ns") record.error = nanoseconds(std::max<std::int64_t>(0, value));
    if (key == "drift_ppb") record.drift_ppm = static_cast<double>(value) * 1e-3;
  }
}

}  // namespace

Result<TimingRecord, TimingRecordError> decode_timing_record(const std::string& text) {
  const std::size_t crc_line = text.rfind("crc ");
  if (!text.starts_with("srfs-timing 1\n") || crc_line == std::string::npos)
    return Err(TimingRecordError::not_a_record);
  if (text.substr(crc_line) !=
      fmt::format("crc {:04x}\n", wire::crc16(as_octets(std::string_view(text).substr(0, crc_line))))) {
    return Err(TimingRecordError::damaged);
  }
  std::istringstream lines(text.substr(0, crc_line));
  std::string magic;
  std::string key;
  int version = 0;
  int valid = 0;
  std::int64_t utc_ns = 0;
  TimingRecord record;
  std::int64_t monotonic_ns = 0;
  lines >> magic >> version >> key >> record.cycle_ceiling >> key >> utc_ns >> key >> valid >> key >>
      monotonic_ns >> key >> record.boot_id;
  if (!lines) return Err(TimingRecordError::not_a_record);
  read_quality(lines, record);
  record.utc = UtcTime(nanoseconds(utc_ns));
  record.utc_valid = valid != 0;
  record.at = MonotonicTime(nanoseconds(monotonic_ns));
  return record;
}

CarriedTime carry_on(const TimingRecord& record, const std::string& boot_id, MonotonicTime now) {
  constexpr double measured_drift_ppm = 1;
  constexpr double unmeasured_drift_ppm = 50;
  constexpr nanoseconds oldest = std::chrono::minutes(10);  // a bad crystal is 60 ms off by then
  const nanoseconds age = now - record.at;
  if (record.boot_id != boot_id || age < nanoseconds(0))
    return {.utc = record.utc, .valid = false, .error = nanoseconds(0), .drift_ppm = std::nullopt};
  const auto age_ns = static_cast<double>(age.count());
  const double uncertain_ppm = record.drift_ppm ? measured_drift_ppm : unmeasured_drift_ppm;
  return {.utc = record.utc + age - nanoseconds(std::llround(age_ns * record.drift_ppm.value_or(0) * 1e-6)),
          .valid = record.utc_valid && age <= oldest,
          .error = record.error + nanoseconds(std::llround(age_ns * uncertain_ppm * 1e-6)),
          .drift_ppm = record.drift_ppm};
}

ReservationActions CycleReservation::reserve(MissionCycle next) {
  if (writing_ || next + margin < stored_) return {};
  writing_ = true;
  return {SaveCycles{next + step}};
}

ReservationActions CycleReservation::renew() {
  if (writing_) return {};
  writing_ = true;
  return {SaveCycles{stored_}};
}

void CycleReservation::on_written(MissionCycle ceiling, bool ok) {
  writing_ = false;
  if (ok) {
    stored_ = ceiling;
  } else {
    ++failed_writes_;
  }
}

void CycleReservation::on_published(MissionCycle cycle) {
  if (cycle >= stored_) ++unreserved_;
}

}  // namespace srfs
