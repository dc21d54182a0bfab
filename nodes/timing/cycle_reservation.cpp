#include "nodes/timing/cycle_reservation.hpp"

#include <charconv>
#include <sstream>

#include <fmt/format.h>

#include "base/octets.hpp"
#include "wire/crc16.hpp"

namespace srfs {
namespace {

std::uint16_t checksum(std::string_view text) {
  return wire::crc16(OctetView(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
}

}  // namespace

std::string encode_timing_record(const TimingRecord& record) {
  const std::string body = fmt::format(
      "srfs-timing 1\ncycle_ceiling {}\nutc_ns {}\nutc_valid {}\nmonotonic_ns {}\nboot_id {}\n",
      record.cycle_ceiling, record.utc.ns(), record.utc_valid ? 1 : 0, record.at.ns(), record.boot_id);
  return body + fmt::format("crc {:04x}\n", checksum(body));
}

Result<TimingRecord, TimingRecordError> decode_timing_record(const std::string& text) {
  const std::size_t crc_line = text.rfind("crc ");
  if (!text.starts_with("srfs-timing 1\n") || crc_line == std::string::npos)
    return Err(TimingRecordError::not_a_record);
  if (text.substr(crc_line) !=
      fmt::format("crc {:04x}\n", checksum(std::string_view(text).substr(0, crc_line)))) {
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
  record.utc = UtcTime(nanoseconds(utc_ns));
  record.utc_valid = valid != 0;
  record.at = MonotonicTime(nanoseconds(monotonic_ns));
  return record;
}

CarriedTime carry_on(const TimingRecord& record, const std::string& boot_id, MonotonicTime now) {
  constexpr nanoseconds oldest = std::chrono::minutes(10);  // a bad crystal is 60 ms off by then
  const nanoseconds age = now - record.at;
  if (record.boot_id != boot_id || age < nanoseconds(0)) return {record.utc, false};
  return {record.utc + age, record.utc_valid && age <= oldest};
}

std::optional<MissionCycle> CycleReservation::wanted(MissionCycle next) {
  if (writing_ || next + margin < stored_) return std::nullopt;
  writing_ = true;
  return next + step;
}

std::optional<MissionCycle> CycleReservation::renewed() {
  if (writing_) return std::nullopt;
  writing_ = true;
  return stored_;
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
