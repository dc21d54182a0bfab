// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/file_record.hpp"

#include <fmt/format.h>

namespace srfs::simulation {
namespace {

const std::string outbox = "outbox/";

}  // namespace

std::vector<std::string> names_under_way(cfdp::TransferFolders& folders) {
  std::vector<std::string> names;
  for (const cfdp::Report& report : folders.entity().transactions()) names.push_back(report.destination_file);
  return names;
}

FileRecord::FileRecord(Kernel& kernel)
    : kernel_(kernel),
      disks_{std::make_shared<cfdp::MemoryFileStore>(), std::make_shared<cfdp::MemoryFileStore>()} {}

std::string FileRecord::put(End from, Random& random) {
  const std::string name = fmt::format("{}{}", from == End::ground ? "up" : "down", counters_.put++);
  Octets content(200 + random.below(random.one_in(8) ? 30'000 : 4'000));
  for (std::uint8_t& octet : content) octet = static_cast<std::uint8_t>(random.next());
  disk(from)->add(outbox + name, content);
  files_[name] =
      File{.from = from, .content = std::move(content), .put = kernel_.now(), .process = processes(from)};
  return name;
}

bool FileRecord::is_there(const std::string& name, const File& file) const {
  const Octets* const there = disk(file.from == End::ground ? End::board : End::ground)->content(name);
  return there != nullptr && *there == file.content;
}

void FileRecord::compare(const std::string& name, const File& file) const {
  if (!is_there(name, file))
    throw Violation{"L11", fmt::format("a file is reported as arrived and is not there, or is another one: "
                                       "{} of {} octets",
                                       name, file.content.size())};
}

void FileRecord::on_news(End at, const cfdp::News& news) {
  if (news.event.kind != cfdp::EventKind::finished) return;
  const auto found = files_.find(news.file.destination_file);
  if (found == files_.end()) return;
  const bool arrived =
      news.event.outcome.condition == wire::CfdpCondition::no_error && !news.event.outcome.incomplete;
  if (arrived) compare(found->first, found->second);
  if (news.event.role != cfdp::Role::sending || at != found->second.from) return;
  if (!found->second.ended) ++(arrived ? counters_.arrived : counters_.failed);
  found->second.ended = true;
  found->second.failed = !arrived;
}

/// What left the outbox is at the other end, or was kept, and that was said unless the process ended.
void FileRecord::settle(const std::string& name, File& file) const {
  const cfdp::MemoryFileStore& sender = *disk(file.from);
  if (sender.content(outbox + name) != nullptr) return;
  const bool is_kept = sender.content("unsent/" + name) != nullptr;
  if (file.failed && !is_kept && !is_there(name, file))
    throw Violation{"L14", "a file that was not sent is kept nowhere: " + name};
  if (file.ended) return;
  if (!is_kept && !is_there(name, file))
    throw Violation{"L14", "a file left the outbox, and is neither there nor kept as unsent: " + name};
  if (processes_.at(static_cast<std::size_t>(file.from)) == file.process)
    throw Violation{"L14", "a file left the outbox without a word: " + name};
  file.ended = true;
}

void FileRecord::check_ends(MonotonicTime put_before, const std::array<Names, 2>& under_way) {
  for (auto& [name, file] : files_) {
    settle(name, file);
    if (file.put < put_before && !file.ended)
      throw Violation{"L14", "a file waits long after the last fault: " + name};
  }
  for (const Names& names : under_way) {
    for (const std::string& name : names) {
      const auto found = files_.find(name);
      if (found == files_.end() || found->second.put < put_before)
        throw Violation{"L14", "a transfer has no end long after the last fault: " + name};
    }
  }
  for (const auto& [name, file] : files_) {
    if (!file.ended) continue;
    for (const auto& end : disks_) {
      end->files.erase(name);
      end->files.erase("unsent/" + name);
    }
  }
  std::erase_if(files_, [](const auto& entry) { return entry.second.ended; });
}

void FileRecord::set_failing(bool failing) {
  cfdp::MemoryFileStore& board = *disk(End::board);
  const auto fault = failing ? std::optional(cfdp::FileFault::no_space) : std::nullopt;
  board.write_fault = fault;
  board.commit_fault = fault;
  board.sync_fault = fault;
  board.checkpoint_fault = fault;
}

void FileRecord::lose_power() {
  disk(End::board)->lose_unsynced();
}

}  // namespace srfs::simulation
