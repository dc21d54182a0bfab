// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/rescue/link_store.hpp"

#include <algorithm>

#include "base/file.hpp"
#include "base/log.hpp"
#include "base/process.hpp"

namespace srfs::rescue {
namespace {

constexpr milliseconds no_repeat_window{0};
constexpr std::uint64_t reserved_ids = 256;  // as ttc reserves them

}  // namespace

LinkStore::LinkStore(std::filesystem::path folder)
    : folder_(std::move(folder)),
      journal_file_(folder_ / "telecommands"),
      journal_log_(journal_file_),
      link_file_(folder_ / "link_state"),
      journal_(kernel_boot_id().value_or("unknown"), no_repeat_window) {}

LinkState LinkStore::load(MonotonicTime now) {
  const JournalLog::Found found = journal_log_.load();
  for (const JournalRecord& record : found.records) (void)journal_.apply(record);
  const LinkStateFile::Found copy = link_file_.load();
  journal_.begin(copy.state, copy.state.next_telecommand_id, now);
  const bool nothing = !journal_.has_state() && journal_.link().generation == 0;
  if (nothing) {
    // ttc asks whether the counters want a floor; once this process has written some it could not know.
    const bool lost = found.existed || copy.existed;
    const std::filesystem::path marker = folder_ / "counters_lost";
    std::error_code ec;
    if (lost) log::error("the counters of the uplink are lost: any is taken until ttc knows the time");
    if (!std::filesystem::exists(marker, ec)) {
      if (const auto written = write_file_atomically(marker, lost ? "" : "first start\n"); !written)
        log::error("{}", written.error().message);
    }
  }
  return journal_.link();
}

bool LinkStore::write_journal(const LinkState& link) {
  journal_.on_link(link);
  const JournalBatch batch = journal_.take_batch(true);
  const auto written = batch.snapshot ? journal_log_.snapshot(*batch.snapshot)
                                      : journal_log_.append(batch.records, batch.sync);
  journal_.on_written(batch, written.has_value(), journal_log_.used_octets());
  if (!written) log::error("{}", written.error().message);
  return written.has_value();
}

bool LinkStore::store(const LinkState& link) {
  const bool in_journal = write_journal(link);
  LinkState copy = link;
  copy.next_telecommand_id = std::max(link.next_telecommand_id, journal_.next_id() + reserved_ids);
  const auto copied = link_file_.store(copy);
  if (!copied) log::error("{}", copied.error().message);
  return in_journal || copied.has_value();
}

std::string LinkStore::carry_counters_over() {
  LinkState link = load(monotonic_now());
  if (link.generation == 0) return "";  // there are none
  link.next_telecommand_id = std::max(link.next_telecommand_id, journal_.next_id() + reserved_ids);
  for (int copy = 0; copy < 2; ++copy) {
    ++link.generation;
    if (const auto stored = link_file_.store(link); !stored) return stored.error().message;
  }
  return "";
}

}  // namespace srfs::rescue
