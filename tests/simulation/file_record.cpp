// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/file_record.hpp"

#include <fmt/format.h>

namespace srfs::simulation {
namespace {

const std::string outbox = "outbox/";

}  // namespace

FileRecord::FileRecord(Kernel& kernel)
    : kernel_(kernel),
      disks_{std::make_shared<cfdp::MemoryFileStore>(), std::make_shared<cfdp::MemoryFileStore>()} {}

std::string FileRecord::put(End from, Random& random) {
  const std::string name = fmt::format("{}{}", from == End::ground ? "up" : "down", counters_.put++);
  Octets content(200 + random.below(random.one_in(8) ? 30'000 : 4'000));
  for (std::uint8_t& octet : content) octet = static_cast<std::uint8_t>(random.next());
  disk(from)->add(outbox + name, content);
  files_[name] = File{.from = from, .content = std::move(content), .put = kernel_.now()};
  return name;
}

void FileRecord::compare(const std::string& name, const File& file) const {
  const Octets* const there = disk(file.from == End::ground ? End::board : End::ground)->content(name);
  if (there == nullptr || *there != file.content)
    throw Violation{"L11", fmt::format("a file is reported as arrived and is {} there: {} of {} octets",
                                       there == nullptr ? "not" : "another one", name, file.content.size())};
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
}

void FileRecord::check_ends(MonotonicTime put_before) {
  for (auto& [name, file] : files_) {
    // What its sender said last may have been lost with it.
    file.ended = file.ended || disk(file.from)->content(outbox + name) == nullptr;
    if (file.put < put_before && !file.ended)
      throw Violation{"L14", "a file waits long after the last fault: " + name};
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
