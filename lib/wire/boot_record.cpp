// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/boot_record.hpp"

#include <sstream>
#include <string_view>

#include <fmt/format.h>

#include "base/octets.hpp"
#include "base/text.hpp"
#include "wire/crc16.hpp"

namespace srfs::wire {
namespace {

constexpr std::string_view magic = "srfs-boot 1\n";

}  // namespace

std::string encode_boot_record(const BootRecord& record) {
  const std::string body = fmt::format(
      "{}count {}\nboot_id {}\nreset_cause {}\nhealthy {}\nhealthy_since_ns {}\nunhealthy_boots {}\nwithheld "
      "{}\n"
      "ended {}\nrevision {}\n",
      magic, record.count, record.boot_id, record.reset_cause, record.healthy ? 1 : 0,
      record.healthy_since.ns(), record.unhealthy_boots, record.withheld ? 1 : 0, record.ended ? 1 : 0,
      record.revision);
  return body + fmt::format("crc {:04x}\n", crc16(as_octets(body)));
}

Result<BootRecord, BootRecordError> decode_boot_record(const std::string& text) {
  const std::size_t crc_line = text.rfind("crc ");
  if (!text.starts_with(magic) || crc_line == std::string::npos) return Err(BootRecordError::not_a_record);
  if (text.substr(crc_line) !=
      fmt::format("crc {:04x}\n", crc16(as_octets(std::string_view(text).substr(0, crc_line)))))
    return Err(BootRecordError::damaged);
  std::istringstream lines(text.substr(magic.size(), crc_line - magic.size()));
  std::string key;
  unsigned cause = 0;
  int healthy = 0;
  int withheld = 0;
  int ended = 0;
  std::int64_t healthy_since_ns = 0;
  BootRecord record;
  lines >> key >> record.count >> key >> record.boot_id >> key >> cause >> key >> healthy >> key >>
      healthy_since_ns >> key >> record.unhealthy_boots >> key >> withheld >> key >> ended >> key >>
      record.revision;
  if (!lines || cause > 255) return Err(BootRecordError::not_a_record);
  record.reset_cause = static_cast<std::uint8_t>(cause);
  record.healthy = healthy != 0;
  record.healthy_since = UtcTime(nanoseconds(healthy_since_ns));
  record.withheld = withheld != 0;
  record.ended = ended != 0;
  return record;
}

}  // namespace srfs::wire
