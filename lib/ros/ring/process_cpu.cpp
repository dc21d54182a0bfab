#include "ros/ring/process_cpu.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>

#include <fmt/format.h>
#include <unistd.h>

#include "base/file.hpp"

namespace srfs::ros {
namespace {

constexpr std::size_t most_threads = 16;      ///< of the middleware; it has six
constexpr std::size_t most_processes = 4096;  ///< of a survey
constexpr seconds between_searches{1};
constexpr std::size_t longest_stat = 1024;

/// Calls @p visit with the number of each entry of the folder that is one.
template <class Visit>
void for_each_number(const std::string& folder, Visit&& visit) {
  std::error_code ec;
  for (auto entry = std::filesystem::directory_iterator(folder, ec);
       !ec && entry != std::filesystem::directory_iterator(); entry.increment(ec)) {
    const std::string name = entry->path().filename();
    pid_t number = 0;
    const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
    if (error == std::errc() && end == name.data() + name.size() && !visit(number)) return;
  }
}

/// Name and CPU time of a text of /proc/PID/stat.
std::optional<CpuSurvey::Process> parse_stat(std::string_view text) {
  constexpr int user_time = 14;  // fields as proc(5) numbers them
  const auto name_begin = text.find('(');
  const auto name_end = text.rfind(')');
  if (name_begin == std::string_view::npos || name_end == std::string_view::npos || name_end < name_begin)
    return std::nullopt;
  CpuSurvey::Process process;
  process.name = text.substr(name_begin + 1, name_end - name_begin - 1);
  text.remove_prefix(name_end + 1);
  int field = 2;
  std::uint64_t ticks = 0;
  while (field < user_time + 1) {
    text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
    const auto word = text.substr(0, text.find(' '));
    text.remove_prefix(word.size());
    if (word.empty()) return std::nullopt;
    if (++field < user_time) continue;
    std::uint64_t value = 0;
    std::from_chars(word.data(), word.data() + word.size(), value);
    ticks += value;
  }
  process.used = ticks * nanoseconds(seconds(1)) / sysconf(_SC_CLK_TCK);
  return process;
}

}  // namespace

std::optional<ProcessCpu> ProcessCpu::open(pid_t pid) {
  auto first = ThreadCpuFiles::open(pid, pid);
  if (!first) return std::nullopt;
  return ProcessCpu(pid, std::move(*first));
}

bool ProcessCpu::read_thread(Thread& thread, MonotonicTime now, nanoseconds* ran) {
  const auto cpu = thread.files.read();
  if (!cpu) return false;
  const bool runnable = thread.wait.equals_last(*cpu) && thread.files.state() == 'R';
  thread.wait.on_reading(*cpu, runnable, now);
  if (ran != nullptr) *ran = cpu->ran;
  return true;
}

std::optional<CpuTotals> ProcessCpu::read(bool doubt, MonotonicTime now) {
  CpuTotals totals;
  if (!read_thread(first_, now, &totals.ran)) return std::nullopt;
  totals.waited = first_.wait.total();
  if (doubt) {
    if (middleware_.empty() || now - found_ >= between_searches) {
      found_ = now;
      find_threads();
    }
    for (auto entry = middleware_.begin(); entry != middleware_.end();) {
      const bool lives = read_thread(entry->second, now, nullptr);
      most_waited_ = std::max(most_waited_, entry->second.wait.total());
      entry = lives ? std::next(entry) : middleware_.erase(entry);
    }
  }
  totals.any_waited = totals.waited + most_waited_;
  return totals;
}

void ProcessCpu::find_threads() {
  const std::string tasks = fmt::format("/proc/{}/task", pid_);
  const auto name_of = [&](pid_t tid) {
    return read_file(fmt::format("{}/{}/comm", tasks, tid), longest_stat).value_or("");
  };
  const std::string own = name_of(pid_);
  for_each_number(tasks, [&](pid_t tid) {
    if (tid == pid_ || middleware_.contains(tid) || name_of(tid) != own) return true;
    if (auto files = ThreadCpuFiles::open(pid_, tid)) middleware_.emplace(tid, Thread{std::move(*files), {}});
    return middleware_.size() < most_threads;
  });
}

CpuSurvey CpuSurvey::take(MonotonicTime now) {
  CpuSurvey survey;
  survey.at = now;
  for_each_number("/proc", [&](pid_t pid) {
    const auto text = read_file(fmt::format("/proc/{}/stat", pid), longest_stat);
    if (!text) return true;  // it has ended
    if (auto process = parse_stat(*text)) survey.processes.emplace(pid, std::move(*process));
    return survey.processes.size() < most_processes;
  });
  return survey;
}

std::vector<CpuConsumer> largest_consumers(const CpuSurvey& before, const CpuSurvey& after, unsigned cpus,
                                           std::size_t most) {
  constexpr double least_share = 0.01;
  const double all = static_cast<double>((after.at - before.at).count()) * std::max(cpus, 1U);
  std::vector<CpuConsumer> consumers;
  for (const auto& [pid, process] : after.processes) {
    const auto then = before.processes.find(pid);
    const bool same = then != before.processes.end() && then->second.used <= process.used;
    const nanoseconds used = process.used - (same ? then->second.used : nanoseconds(0));
    const double share = all > 0 ? static_cast<double>(used.count()) / all : 0;
    if (share >= least_share) consumers.push_back({pid, process.name, std::min(share, 1.0)});
  }
  std::sort(consumers.begin(), consumers.end(),
            [](const auto& a, const auto& b) { return a.share > b.share; });
  if (consumers.size() > most) consumers.resize(most);
  return consumers;
}

std::string to_text(const std::vector<CpuConsumer>& consumers) {
  std::string text;
  for (const CpuConsumer& c : consumers)
    text += fmt::format("{}{} (pid {}) {:.0f} %", text.empty() ? "" : ", ", c.name, c.pid, 100 * c.share);
  return text.empty() ? "nobody" : text;
}

std::optional<double> parse_pressure(std::string_view text) {
  constexpr std::string_view key = "some avg10=";
  if (!text.starts_with(key)) return std::nullopt;
  text.remove_prefix(key.size());
  double percent = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), percent);
  if (error != std::errc() || !(percent >= 0 && percent <= 100)) return std::nullopt;
  return percent / 100;
}

std::optional<double> cpu_pressure() {
  const auto text = read_file("/proc/pressure/cpu", longest_stat);
  return text ? parse_pressure(*text) : std::nullopt;
}

}  // namespace srfs::ros
