// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/busy_machine.hpp"

#include <algorithm>
#include <cstdlib>

#include <fmt/format.h>
#include <poll.h>
#include <sched.h>

namespace srfs::tool {
namespace {

constexpr milliseconds distance{1000};

int usable_cpus() {
  cpu_set_t cpus;
  return sched_getaffinity(0, sizeof cpus, &cpus) == 0 ? std::max(CPU_COUNT(&cpus), 1) : 1;
}

}  // namespace

MachineLoad look_at_machine() {
  MachineLoad load;
  load.cpus = usable_cpus();
  const ProcessTable before = read_process_table();
  const MonotonicTime begin = monotonic_now();
  poll(nullptr, 0, static_cast<int>(distance.count()));
  load.users = largest_cpu_users(before, read_process_table(), monotonic_now() - begin);
  double average = 0;
  if (getloadavg(&average, 1) == 1) load.load_average = average;
  load.pressure = cpu_pressure();
  return load;
}

std::vector<std::string> advice_on(const MachineLoad& load) {
  std::vector<std::string> lines;
  const std::string cpus = load.cpus == 1 ? "one CPU" : fmt::format("{} CPUs", load.cpus);
  double used = 0;
  for (const CpuUser& user : load.users) used += user.cpus;
  // The pressure also of a machine whose CPUs are not all for these programs: a container's quota, pinned
  // CPUs.
  const bool busy = load.load_average.value_or(0) > load.cpus || used > 0.8 * load.cpus ||
                    load.pressure.value_or(0) >= busy_cpu_pressure;
  std::string state = busy ? "the machine is busy" : "the machine is not busy";
  if (load.load_average) state += fmt::format(": load average {:.1f} on {}", *load.load_average, cpus);
  if (load.pressure)
    state += fmt::format("; programs waited for a CPU in {:.0f} % of the last 10 s", 100 * *load.pressure);
  lines.push_back(state);
  if (!load.users.empty())
    lines.push_back("the largest users of the CPUs (100 %: one CPU): " + to_text(load.users));
  lines.emplace_back(
      busy ? "close some of these programs, or wait and try again: `srfs up` starts only what is missing"
           : "look into the logs of the nodes that are late; `srfs up` starts only what is missing");
  return lines;
}

}  // namespace srfs::tool
