// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/process_cpu.hpp"

#include <algorithm>

#include "base/process.hpp"

namespace srfs::tool {

void ProcessCpu::read(MonotonicTime now) {
  for_each_thread(pid_, [&](pid_t tid) {
    if (threads_.contains(tid)) return true;
    auto files = ThreadCpuFiles::open(pid_, tid);
    const auto first = files ? files->read() : std::nullopt;
    if (!first) return true;
    const ThreadCpu before = from_ == From::first_reading ? *first : ThreadCpu{};
    Thread thread{std::move(*files), {}, before, {}};
    thread.wait.on_reading(before, false, now);
    threads_.emplace(tid, std::move(thread));
    return true;
  });
  for (auto& [tid, thread] : threads_) {
    const auto cpu = thread.files.read();
    if (!cpu) continue;  // it has ended
    const bool runnable = thread.wait.equals_last(*cpu) && thread.files.state() == 'R';
    thread.wait.on_reading(*cpu, runnable, now);
    thread.ran = cpu->ran - thread.before.ran;
  }
}

nanoseconds ProcessCpu::ran() const {
  nanoseconds sum{0};
  for (const auto& [tid, thread] : threads_) sum += thread.ran;
  return sum;
}

nanoseconds ProcessCpu::waited() const {
  nanoseconds longest{0};
  for (const auto& [tid, thread] : threads_) longest = std::max(longest, thread.wait.total());
  return longest;
}

}  // namespace srfs::tool
