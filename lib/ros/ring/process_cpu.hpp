#pragma once

#include <sys/types.h>

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/cpu_wait.hpp"
#include "base/time.hpp"

namespace srfs::ros {

/// What a node's process has had of the CPU, read from outside or by itself: its work thread (the first one),
/// and in doubt the threads of the middleware, which carry its program's name, too. Workers have names of
/// their own and do not count: what they wait for keeps no answer. One thread at a time.
class ProcessCpu {
 public:
  /// nullopt: no such process, or a kernel that does not tell.
  [[nodiscard]] static std::optional<ProcessCpu> open(pid_t pid);

  /// @param doubt  read the threads of the middleware, too: some 10 us more
  /// @return totals since the first call; nullopt: the process has ended
  [[nodiscard]] std::optional<CpuTotals> read(bool doubt, MonotonicTime now);
  /// Its work thread runs now, or waits for a CPU.
  [[nodiscard]] bool is_runnable() const { return first_.files.state() == 'R'; }

 private:
  struct Thread {
    ThreadCpuFiles files;
    CpuWait wait;
  };
  ProcessCpu(pid_t pid, ThreadCpuFiles first) : pid_(pid), first_{std::move(first), {}} {}
  static bool read_thread(Thread& thread, MonotonicTime now, nanoseconds* ran);
  void find_threads();

  pid_t pid_;
  Thread first_;
  std::map<pid_t, Thread> middleware_;
  MonotonicTime found_;
  nanoseconds most_waited_{0};
};

/// One process that used CPU time between two surveys.
struct CpuConsumer {
  pid_t pid = 0;
  std::string name;
  double share = 0;  ///< of all CPUs, 0 to 1
};

/// CPU time of all processes of this machine. Blocks as /proc does: some ms with a few hundred processes.
struct CpuSurvey {
  struct Process {
    std::string name;
    nanoseconds used;
  };
  MonotonicTime at;
  std::map<pid_t, Process> processes;

  [[nodiscard]] static CpuSurvey take(MonotonicTime now);
};

/// The largest first, at most @p most, none below one per cent. Pure.
[[nodiscard]] std::vector<CpuConsumer> largest_consumers(const CpuSurvey& before, const CpuSurvey& after,
                                                         unsigned cpus, std::size_t most = 4);
/// "stress-ng (pid 81) 45 %, ttc_node (pid 7) 3 %". Pure.
[[nodiscard]] std::string to_text(const std::vector<CpuConsumer>& consumers);

/// The share of the last 10 s in which some task of this machine waited for a CPU, 0 to 1
/// (/proc/pressure/cpu); nullopt: a kernel without pressure stall information. Blocks for a moment.
[[nodiscard]] std::optional<double> cpu_pressure();
/// Of the text of that file. Pure.
[[nodiscard]] std::optional<double> parse_pressure(std::string_view text);

}  // namespace srfs::ros
