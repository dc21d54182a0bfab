// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/ring/fault_ledger.hpp"

#include <algorithm>

#include <fcntl.h>
#include <poll.h>
#include <sys/file.h>

#include "base/file.hpp"
#include "base/private_file.hpp"
#include "suite/ring/fault_file.hpp"

namespace srfs::suite {
namespace {

void read_content(const std::filesystem::path& file, FaultLedger::Content& content) {
  const auto text = read_file(file, 2 * FaultLedger::largest_file);
  if (!text) return;
  for (std::size_t at = 0; at < text->size();) {
    const std::size_t end = std::min(text->find('\n', at), text->size());
    const std::string_view line = std::string_view(*text).substr(at, end - at);
    at = end + 1;
    if (line.empty()) continue;
    if (auto record = decode_fault(line)) {
      content.records.push_back(std::move(*record));
    } else {
      ++content.damaged;
    }
  }
}

Fd lock_ledger(const VarPaths& var) {
  Fd fd;
  if (auto opened = open_private(var.memory() / "faults.lock", O_RDWR | O_CREAT, var.owner()))
    fd = std::move(*opened);
  // A writer that was stopped while it held the lock must not silence the others.
  for (int i = 0; fd && flock(fd.get(), LOCK_EX | LOCK_NB) != 0 && i < 100; ++i) poll(nullptr, 0, 2);
  return fd;
}

}  // namespace

Result<std::uint64_t, std::string> FaultLedger::append(FaultRecord record) const {
  const Fd lock = lock_ledger(var_);
  return append_fault(file(), std::move(record));
}

FaultLedger::Content FaultLedger::read() const {
  Content content;
  read_content(file().string() + ".1", content);
  read_content(file(), content);
  return content;
}

}  // namespace srfs::suite
