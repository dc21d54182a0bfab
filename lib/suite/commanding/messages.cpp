// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/commanding/messages.hpp"

#include "base/file.hpp"
#include "base/log.hpp"
#include "base/process.hpp"
#include "base/text.hpp"
#include "suite/state_files.hpp"

namespace srfs {
namespace {

constexpr std::size_t largest_journal = 1U << 20U;

}  // namespace

StoredTelecommand from_message(const srfs_msgs::msg::Telecommand& message) {
  StoredTelecommand telecommand;
  telecommand.id = message.id;
  telecommand.function = message.function_id;
  const bool known_class = message.repeat_class >= 1 && message.repeat_class <= 3;
  telecommand.repeat =
      known_class ? static_cast<RepeatClass>(message.repeat_class) : RepeatClass::at_most_once;
  telecommand.expiry = MonotonicTime(nanoseconds(static_cast<std::int64_t>(message.expiry_ns)));
  telecommand.arguments = message.arguments;
  return telecommand;
}

srfs_msgs::msg::TelecommandReport to_message(const StageReport& report, const std::string& node,
                                             std::uint32_t incarnation, MonotonicTime now) {
  srfs_msgs::msg::TelecommandReport m;
  m.id = report.id;
  m.node = node;
  m.node_incarnation = incarnation;
  m.stage = static_cast<std::uint8_t>(report.stage);
  m.success = report.success;
  m.failure_code = report.failure;
  m.monotonic_ns = static_cast<std::uint64_t>(now.ns());
  return m;
}

TelecommandJournal read_journal(const std::filesystem::path& file) {
  TelecommandJournal journal(kernel_boot_id().value_or("unknown"));
  if (!std::filesystem::exists(file)) return journal;
  const auto content = read_file(file, largest_journal);
  const bool usable = content && journal.restore(as_octets(*content));
  if (!usable) {
    suite::set_aside_unreadable(file);
    log::error("stored telecommands and known ids are lost");
  } else if (journal.pending() > 0) {
    log::info("resuming {} stored telecommands", journal.pending());
  }
  return journal;
}

}  // namespace srfs
