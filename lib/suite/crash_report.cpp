// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/crash_report.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstring>
#include <string_view>

#include <execinfo.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.hpp"
#include "suite/ring/heartbeat_page.hpp"

namespace srfs::suite {
namespace {

constexpr int most_frames = 48;
constexpr std::size_t most_reports = 5;
constexpr off_t log_octets = 64 << 10;
constexpr std::string_view report_extension = ".report";
constexpr std::array fatal_signals{SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};
constexpr const char* backtrace_begin = "*** fatal signal ";
constexpr const char* backtrace_end = "*** end of backtrace\n";

HeartbeatPage* own_page = nullptr;
std::atomic<int> handling = 0;
alignas(16) std::array<char, 64 << 10> handler_stack;

void say(const char* text) {
  [[maybe_unused]] const ssize_t ignored = write(STDERR_FILENO, text, strlen(text));
}

void say_number(unsigned number) {
  std::array<char, 12> digits{};
  auto* first = digits.data() + digits.size() - 1;
  do {
    *--first = static_cast<char>('0' + number % 10);
    number /= 10;
  } while (number != 0);
  say(first);
}

const char* name_of(int number) {
  switch (number) {
    case SIGSEGV:
      return "11 (SIGSEGV)";
    case SIGBUS:
      return "7 (SIGBUS)";
    case SIGFPE:
      return "8 (SIGFPE)";
    case SIGILL:
      return "4 (SIGILL)";
    default:
      return "6 (SIGABRT)";
  }
}

// Async-signal-safe, but for backtrace(), which is once its library is loaded and unless the unwinder's own
// data is what broke; a second fault in here ends the process by the default action.
void on_fatal_signal(int number) {
  signal(number, SIG_DFL);  // raised again below, or by a fault in here
  if (handling.exchange(1) == 0) {
    alarm(1);  // if this hangs, too
    if (own_page != nullptr) own_page->end(EndKind::signal, static_cast<std::uint32_t>(number));
    std::array<char, 17> thread{};
    prctl(PR_GET_NAME, thread.data(), 0, 0, 0);
    say("\n");
    say(backtrace_begin);
    say(name_of(number));
    say(" in thread ");
    say(thread.data());
    say(" of pid ");
    say_number(static_cast<unsigned>(getpid()));
    say("\n");
    std::array<void*, most_frames> frames{};
    backtrace_symbols_fd(frames.data(), backtrace(frames.data(), most_frames), STDERR_FILENO);
    say(backtrace_end);
  }
  raise(number);
}

std::string last_octets(const LogEnd& end) {
  std::string text(static_cast<std::size_t>(std::min(end.size, log_octets)), '\0');
  const ssize_t n =
      end.log ? pread(end.log.get(), text.data(), text.size(), end.size - static_cast<off_t>(text.size()))
              : 0;
  text.resize(static_cast<std::size_t>(std::max<ssize_t>(n, 0)));
  return text;
}

std::string backtrace_of(pid_t pid, const std::string& log) {
  const std::size_t by = log.rfind(fmt::format(" of pid {}\n", pid));
  const std::size_t begin = by == std::string::npos ? by : log.rfind(backtrace_begin, by);
  if (begin == std::string::npos) return "none\n";
  const std::size_t end = log.find(backtrace_end, begin);
  return log.substr(begin, end == std::string::npos ? end : end - begin);
}

}  // namespace

void install_crash_handler(HeartbeatPage& page) {
  own_page = &page;
  void* frame = nullptr;
  backtrace(&frame, 1);  // loads its library now: a handler must not
  const stack_t own{handler_stack.data(), 0, handler_stack.size()};
  stack_t before{};
  if (sigaltstack(nullptr, &before) == 0 && (before.ss_flags & SS_DISABLE) != 0) sigaltstack(&own, nullptr);
  for (const int number : fatal_signals) {
    struct sigaction action {};
    if (sigaction(number, nullptr, &action) != 0 || action.sa_handler != SIG_DFL) continue;
    action = {};
    action.sa_handler = on_fatal_signal;
    action.sa_flags = SA_ONSTACK | SA_NODEFER;
    sigfillset(&action.sa_mask);  // the last words are not interrupted
    for (const int other : fatal_signals) sigdelset(&action.sa_mask, other);
    sigaction(number, &action, nullptr);
  }
}

LogEnd remember_log_end(const VarPaths& var, const std::string& node) {
  LogEnd end{Fd(open(var.log(node).c_str(), O_RDONLY | O_CLOEXEC)), 0};
  struct stat status {};
  if (end.log && fstat(end.log.get(), &status) == 0) end.size = status.st_size;
  return end;
}

Result<std::filesystem::path, std::string> write_crash_report(const VarPaths& var,
                                                              const EndedProcess& process,
                                                              const std::string& header,
                                                              const LogEnd& log_end) {
  const std::string log = last_octets(log_end);
  const auto folder = var.state(process.node) / "reports";
  const auto file = folder / fmt::format("{}{}", process.incarnation, report_extension);
  const auto written =
      write_file_atomically(file, fmt::format("{}\n--- backtrace\n{}\n--- the last {} octets of its log\n{}",
                                              header, backtrace_of(process.pid, log), log.size(), log));
  if (!written) return Err(written.error().message);
  const auto reports = find_crash_reports(var, process.node);
  std::error_code ec;
  for (std::size_t i = 0; i + most_reports < reports.size(); ++i)
    std::filesystem::remove(reports[i].file, ec);
  return file;
}

void sort_by_age(std::vector<CrashReport>& reports) {
  std::sort(reports.begin(), reports.end(),
            [](const CrashReport& a, const CrashReport& b) { return a.incarnation < b.incarnation; });
  if (reports.empty() || reports.front().incarnation != 0) return;
  if (reports.front().written > reports.back().written)
    std::rotate(reports.begin(), reports.begin() + 1, reports.end());
}

std::vector<CrashReport> find_crash_reports(const VarPaths& var, const std::string& node) {
  std::vector<CrashReport> reports;
  std::error_code ec;
  for (std::filesystem::directory_iterator it(var.state(node) / "reports", ec), end; !ec && it != end;
       it.increment(ec)) {
    const std::string name = it->path().filename().string();
    std::uint32_t incarnation = 0;
    const auto [rest, error] = std::from_chars(name.data(), name.data() + name.size(), incarnation);
    if (error != std::errc() || std::string_view(rest) != report_extension) continue;
    std::error_code gone;  // meanwhile, by another death
    const auto written = it->last_write_time(gone);
    if (!gone) reports.push_back({incarnation, it->path(), written});
  }
  sort_by_age(reports);
  return reports;
}

}  // namespace srfs::suite
