// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/real_time.hpp"

#include <alloca.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <thread>

#include <fmt/format.h>
#include <linux/capability.h>
#include <pwd.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "base/fd.hpp"
#include "base/log.hpp"

namespace srfs::suite {
namespace {

bool has_capability(unsigned capability) {
  __user_cap_header_struct header{.version = _LINUX_CAPABILITY_VERSION_3, .pid = 0};
  std::array<__user_cap_data_struct, 2> sets{};
  if (syscall(SYS_capget, &header, sets.data()) != 0) return false;
  return (sets[capability / 32].effective >> (capability % 32) & 1U) != 0;
}

std::string own_user() {
  const passwd* entry = getpwuid(geteuid());
  return entry != nullptr ? entry->pw_name : std::to_string(geteuid());
}

}  // namespace

std::string limit_command(const std::string& user, const std::string& item, const std::string& value) {
  return fmt::format("echo '{} - {} {}' >> /etc/security/limits.d/60-srfs.conf", user, item, value);
}

std::optional<std::string> refusal_to_lock(bool privileged, rlim_t limit, const std::string& user) {
  if (privileged || limit == RLIM_INFINITY) return std::nullopt;
  return fmt::format(
      "user {} may lock {} KiB, expected no limit (RLIMIT_MEMLOCK); as root: {} (from the next login on; in "
      "a systemd unit: LimitMEMLOCK=infinity)",
      user, limit >> 10U, limit_command(user, "memlock", "unlimited"));
}

Result<void, std::string> lock_memory() {
  rlimit limit{};
  getrlimit(RLIMIT_MEMLOCK, &limit);
  limit.rlim_cur = limit.rlim_max;
  setrlimit(RLIMIT_MEMLOCK, &limit);
  if (auto refusal = refusal_to_lock(has_capability(CAP_IPC_LOCK), limit.rlim_cur, own_user()))
    return Err(*std::move(refusal));
  if (mlockall(MCL_CURRENT) == 0 && mlockall(MCL_FUTURE | MCL_ONFAULT) == 0) return {};
  const int why = errno;
  munlockall();
  return Err("mlockall: " + errno_text(why));
}

[[gnu::noinline]] void touch_stack(std::size_t octets) {
  rlimit limit{};
  if (getrlimit(RLIMIT_STACK, &limit) != 0) return;
  octets = static_cast<std::size_t>(std::min<rlim_t>(octets, limit.rlim_cur / 2));
  if (octets == 0) return;
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  auto* const stack = static_cast<volatile char*>(alloca(octets));
  for (std::size_t at = octets; at > 0; at -= std::min(at, page)) stack[at - 1] = 0;  // it grows downwards
}

std::vector<std::string> missing_of(const Scheduling& wanted) {
  static constexpr std::array policies{SCHED_OTHER, SCHED_FIFO, SCHED_BATCH, SCHED_IDLE};
  std::vector<std::string> missing;
  sched_param parameter{};
  sched_getparam(0, &parameter);
  if (sched_getscheduler(0) != policies[static_cast<std::size_t>(wanted.policy)] ||
      parameter.sched_priority != wanted.priority)
    missing.emplace_back("scheduling policy and priority");
  errno = 0;
  if (const int nice = getpriority(PRIO_PROCESS, 0); errno == 0 && nice != wanted.nice)
    missing.push_back(fmt::format("nice {} (it is {})", wanted.nice, nice));
  cpu_set_t given;
  cpu_set_t cpus;
  CPU_ZERO(&given);
  CPU_ZERO(&cpus);
  for (const int cpu : wanted.cpus) CPU_SET(static_cast<unsigned>(cpu), &cpus);
  if (!wanted.cpus.empty() && sched_getaffinity(0, sizeof given, &given) == 0 &&
      CPU_EQUAL(&given, &cpus) == 0)
    missing.emplace_back("CPU set");
  return missing;
}

void bound_real_time(milliseconds longest) {
  rlimit limit{};
  if (getrlimit(RLIMIT_RTTIME, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return;
  const auto wanted = std::min(static_cast<rlim_t>(microseconds(longest).count()), limit.rlim_max);
  if (wanted == limit.rlim_cur) return;
  std::this_thread::sleep_for(microseconds(100));  // the kernel counts from the last pause of a thread
  limit.rlim_cur = wanted;
  setrlimit(RLIMIT_RTTIME, &limit);
}

void arrange_real_time(const NodeEntry& entry) {
  for (const std::string& what : missing_of(entry.scheduling))
    log::warn("running without the deployment's {}; `srfs doctor` shows the fix", what);
  if (entry.memory.lock) {
    if (const auto locked = lock_memory()) {
      log::info("memory is locked");
    } else {
      log::warn("memory is not locked: {}", locked.error());
    }
  }
  touch_stack(static_cast<std::size_t>(entry.memory.stack_kib) << 10U);
}

}  // namespace srfs::suite
