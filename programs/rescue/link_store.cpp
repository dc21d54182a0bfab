// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/rescue/link_store.hpp"

#include <algorithm>
#include <array>

#include "base/file.hpp"
#include "base/log.hpp"
#include "base/process.hpp"

namespace srfs::rescue {
namespace {

constexpr milliseconds no_repeat_window{0};
constexpr std::uint64_t reserved_ids = 256;  // as ttc reserves them

/// The segment whose loss would cost most.
unsigned newest_segment(JournalMedium& medium) {
  const auto rank = [&medium](unsigned segment) {
    const JournalSegment found = scan_journal_segment(medium.read(segment));
    return std::pair(found.whole, found.generation);
  };
  return rank(1) > rank(0) ? 1 : 0;
}

}  // namespace

LinkStore::Journal::Journal(const std::filesystem::path& path, const std::string& boot_id)
    : file(path), log(file), content(boot_id, no_repeat_window) {}

LinkStore::LinkStore(std::filesystem::path folder)
    : folder_(std::move(folder)), link_file_(folder_ / "link_state") {}

std::filesystem::path LinkStore::segment(unsigned number) const {
  return folder_ / ("telecommands." + std::to_string(number));
}

LinkState LinkStore::load(MonotonicTime now) {
  journal_.emplace(folder_ / "telecommands", kernel_boot_id().value_or("unknown"));
  AcceptanceJournal& journal = journal_->content;
  const JournalLog::Found found = journal_->log.load();
  for (const JournalRecord& record : found.records) (void)journal.apply(record);
  const LinkStateFile::Found copy = link_file_.load();
  journal.begin(copy.state, copy.state.next_telecommand_id, now);
  const bool nothing = !journal.has_state() && journal.link().generation == 0;
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
  return journal.link();
}

bool LinkStore::write_journal(const LinkState& link) {
  AcceptanceJournal& journal = journal_->content;
  journal.on_link(link);
  const JournalBatch batch = journal.take_batch(true);
  const auto written = batch.snapshot ? journal_->log.snapshot(*batch.snapshot)
                                      : journal_->log.append(batch.records, batch.sync);
  journal.on_written(batch, written.has_value(), journal_->log.used_octets());
  if (!written) log::error("{}", written.error().message);
  return written.has_value();
}

bool LinkStore::store(const LinkState& link) {
  const bool in_journal = write_journal(link);
  LinkState copy = link;
  copy.next_telecommand_id = std::max(link.next_telecommand_id, journal_->content.next_id() + reserved_ids);
  const auto copied = link_file_.store(copy);
  if (!copied) log::error("{}", copied.error().message);
  return in_journal || copied.has_value();
}

std::string LinkStore::copy_into_both(LinkState link) {
  link.next_telecommand_id = std::max(link.next_telecommand_id, journal_->content.next_id() + reserved_ids);
  // Under its own generation: the next frame's is higher, wherever it is written.
  for (int copy = 0; copy < 2; ++copy) {
    if (const auto stored = link_file_.store(link); !stored) return stored.error().message;
  }
  return "";
}

std::string LinkStore::set_journal_aside(
    const std::function<std::string(const std::filesystem::path&)>& move) {
  const LinkState link = journal_->content.link();
  if (link.generation != 0) {
    if (std::string problem = copy_into_both(link); !problem.empty()) return problem;
  }
  // One whole segment, so that the other one may go first. Where that cannot be written, what is newest now
  // goes last.
  if (journal_->content.has_state()) (void)write_journal(link);
  const unsigned newest = newest_segment(journal_->file);
  std::string problem;
  for (const unsigned number : std::array{1 - newest, newest}) {
    if (problem.empty()) problem = move(segment(number));
  }
  // What was open is not in its place any more.
  (void)load(monotonic_now());
  return problem;
}

}  // namespace srfs::rescue
