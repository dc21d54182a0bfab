// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/process.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <filesystem>
#include <sstream>
#include <string>

#include <fcntl.h>
#include <poll.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "base/file.hpp"
#include "base/text.hpp"

namespace srfs {

std::optional<Process> Process::open(pid_t pid) {
  if (pid <= 0) return std::nullopt;
  Fd fd(static_cast<int>(syscall(SYS_pidfd_open, pid, 0)));  // close-on-exec by itself
  if (!fd) return std::nullopt;
  return Process(pid, std::move(fd));
}

int Process::signal(int number) const {
  return syscall(SYS_pidfd_send_signal, fd_.get(), number, nullptr, 0) == 0 ? 0 : errno;
}

bool Process::wait_for_exit(nanoseconds patience) const {
  const MonotonicTime deadline = monotonic_now() + patience;
  pollfd entry{fd_.get(), POLLIN, 0};
  while (true) {
    const nanoseconds left = std::max(deadline - monotonic_now(), nanoseconds(0));
    const timespec wait{static_cast<time_t>(left.count() / 1'000'000'000),
                        static_cast<long>(left.count() % 1'000'000'000)};
    const int n = ppoll(&entry, 1, &wait, nullptr);
    if (n >= 0 || errno != EINTR) return n == 1;
  }
}

namespace {

/// /proc/PID/stat from its third field on; empty: there is no such process.
std::string stat_fields(pid_t pid) {
  const auto stat = read_file("/proc/" + std::to_string(pid) + "/stat", 4096);
  if (!stat) return {};
  const std::size_t name_end = stat->rfind(") ");  // the name may hold anything, brackets and blanks too
  return name_end == std::string::npos ? std::string() : stat->substr(name_end + 2);
}

}  // namespace

std::optional<std::string> kernel_boot_id() {
  constexpr std::size_t octets = 36;  // a line end follows
  const auto text = read_file("/proc/sys/kernel/random/boot_id", 64);
  if (!text) return std::nullopt;
  return text->substr(0, octets);
}

std::optional<char> process_state(pid_t pid) {
  const std::string fields = stat_fields(pid);
  return fields.empty() ? std::nullopt : std::optional(fields[0]);
}

std::optional<std::uint64_t> process_start_ticks(pid_t pid) {
  std::istringstream in(stat_fields(pid));
  std::string skipped;
  for (int field = 3; field < 22; ++field) in >> skipped;  // proc(5): starttime is the 22nd
  std::uint64_t ticks = 0;
  return in >> ticks ? std::optional(ticks) : std::nullopt;
}

int set_session_niceness(int nice, pid_t pid) {
  std::array<char, 40> path{"/proc/self/autogroup"};
  if (pid != 0) {
    constexpr std::string_view folder = "/proc/", name = "/autogroup";
    char* at = std::copy(folder.begin(), folder.end(), path.begin());
    at = std::to_chars(at, path.data() + path.size(), pid).ptr;
    *std::copy(name.begin(), name.end(), at) = '\0';
  }
  const int file = ::open(path.data(), O_WRONLY | O_CLOEXEC);
  if (file < 0) return errno == ENOENT ? 0 : errno;
  std::array<char, 8> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), nice).ptr;
  const auto length = static_cast<std::size_t>(end - text.data());
  const int error = ::write(file, text.data(), length) < 0 ? errno : 0;
  ::close(file);
  return error;
}

void for_each_thread(pid_t pid, const std::function<bool(pid_t tid)>& visit) {
  std::error_code ec;
  for (auto entry = std::filesystem::directory_iterator("/proc/" + std::to_string(pid) + "/task", ec);
       !ec && entry != std::filesystem::directory_iterator(); entry.increment(ec)) {
    const auto tid = to_number<pid_t>(entry->path().filename().string());
    if (tid && !visit(*tid)) return;
  }
}

std::optional<int> session_niceness(pid_t pid) {
  // "/autogroup-12 nice 10"
  constexpr std::string_view key = " nice ";
  const auto text = read_file("/proc/" + std::to_string(pid) + "/autogroup", 128);
  const auto at = text ? text->find(key) : std::string::npos;
  if (at == std::string::npos) return std::nullopt;
  int niceness = 0;
  const char* const begin = text->data() + at + key.size();
  if (std::from_chars(begin, text->data() + text->size(), niceness).ec != std::errc()) return std::nullopt;
  return niceness;
}

}  // namespace srfs
