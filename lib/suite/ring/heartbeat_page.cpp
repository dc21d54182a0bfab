// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/ring/heartbeat_page.hpp"

#include <dirent.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <filesystem>

#include <fmt/format.h>

#include "base/private_file.hpp"

namespace srfs::suite {

struct HeartbeatPage::Layout {
  static constexpr std::uint64_t magic_value = 0x32474E4952534653;  // "SFSRING2"
  std::atomic<std::uint64_t> magic;
  std::atomic<std::uint64_t> process;  ///< pid, then incarnation in the upper half
  std::atomic<std::int64_t> last_turn_ns;
  std::atomic<std::uint64_t> turns;
  std::atomic<std::uint64_t> lifecycle;    ///< state, then the desired one in the upper half
  std::atomic<std::uint64_t> end;          ///< EndKind, then the value in the upper half
  std::atomic<std::uint64_t> descriptors;  ///< an older version's page ends before
};

namespace {

std::filesystem::path page_file(const VarPaths& var, const std::string& node) {
  return var.memory() / (node + ".heartbeat");
}

void* map(int fd, std::size_t size, int protection) {
  void* memory = mmap(nullptr, size, protection, MAP_SHARED, fd, 0);
  return memory == MAP_FAILED ? nullptr : memory;
}

}  // namespace

void HeartbeatPage::Unmap::operator()(Layout* page) const {
  munmap(page, sizeof(Layout));
}

Result<HeartbeatPage, std::string> HeartbeatPage::create(const VarPaths& var, const std::string& node,
                                                         std::uint32_t incarnation) {
  static_assert(std::atomic<std::uint64_t>::is_always_lock_free);
  const auto path = page_file(var, node);
  const auto failed = [&](int error) { return Err(fmt::format("{}: {}", path.string(), errno_text(error))); };
  const auto fd = open_private(path, O_RDWR | O_CREAT, var.owner());
  if (!fd) return Err(fd.error().message);
  // A store into a page without memory behind it would be a SIGBUS.
  if (const int error = posix_fallocate(fd->get(), 0, sizeof(Layout)); error != 0) return failed(error);
  auto* page = static_cast<Layout*>(map(fd->get(), sizeof(Layout), PROT_READ | PROT_WRITE));
  if (page == nullptr) return failed(errno);
  page->magic = 0;  // readers see no mixture of the predecessor's and ours
  page->process = static_cast<std::uint32_t>(getpid()) | static_cast<std::uint64_t>(incarnation) << 32U;
  page->last_turn_ns = monotonic_now().ns();
  page->turns = 0;
  page->lifecycle = 0;
  page->end = 0;
  page->descriptors = 0;
  page->magic = Layout::magic_value;
  return HeartbeatPage(page);
}

std::optional<HeartbeatPage::Reading> HeartbeatPage::read(const VarPaths& var, const std::string& node) {
  const auto fd = open_private(page_file(var, node), O_RDONLY, var.owner());
  if (!fd) return std::nullopt;
  // A copy by read(2): a file that is too short answers less instead of a SIGBUS.
  std::array<std::uint64_t, sizeof(Layout) / sizeof(std::uint64_t)> words{};
  constexpr ssize_t shortest = sizeof words - sizeof words[0];
  if (pread(fd->get(), words.data(), sizeof words, 0) < shortest || words[0] != Layout::magic_value) {
    return std::nullopt;
  }
  Reading reading;
  reading.pid = static_cast<pid_t>(words[1] & UINT32_MAX);
  reading.incarnation = static_cast<std::uint32_t>(words[1] >> 32U);
  reading.last_turn = MonotonicTime(nanoseconds(static_cast<std::int64_t>(words[2])));
  reading.turns = words[3];
  reading.state = static_cast<std::uint32_t>(words[4] & UINT32_MAX);
  reading.desired = static_cast<std::uint32_t>(words[4] >> 32U);
  reading.end = static_cast<EndKind>(words[5] & UINT32_MAX);
  reading.end_value = static_cast<std::uint32_t>(words[5] >> 32U);
  reading.descriptors = words[6];
  return reading;
}

void HeartbeatPage::beat(MonotonicTime now) {
  page_->last_turn_ns.store(now.ns(), std::memory_order_relaxed);
  page_->turns.store(page_->turns.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
}

void HeartbeatPage::lifecycle(std::uint32_t state, std::uint32_t desired, MonotonicTime now) {
  page_->last_turn_ns.store(now.ns(), std::memory_order_relaxed);
  page_->lifecycle.store(state | static_cast<std::uint64_t>(desired) << 32U);
}

void HeartbeatPage::descriptors(std::uint64_t count) {
  page_->descriptors.store(count, std::memory_order_relaxed);
}

void HeartbeatPage::end(EndKind kind, std::uint32_t value) {
  page_->end.store(static_cast<std::uint64_t>(kind) | static_cast<std::uint64_t>(value) << 32U);
}

std::uint64_t count_descriptors(pid_t pid) {
  std::array<char, 64> path{};
  fmt::format_to_n(path.data(), path.size() - 1, "/proc/{}/fd", pid);
  struct stat status {};
  // Since Linux 6.2 the folder's size is their number.
  if (stat(path.data(), &status) == 0 && status.st_size > 0)
    return static_cast<std::uint64_t>(status.st_size);
  DIR* folder = opendir(path.data());
  if (folder == nullptr) return 0;  // another user's, or one with other privileges
  std::uint64_t count = 0;
  while (const dirent* entry = readdir(folder)) count += entry->d_name[0] != '.' ? 1 : 0;
  closedir(folder);
  return count;
}

}  // namespace srfs::suite
