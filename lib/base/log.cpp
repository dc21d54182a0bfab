#include "base/log.hpp"

#include <algorithm>
#include <atomic>
#include <mutex>

#include <unistd.h>

#include "base/time.hpp"

namespace srfs::log {
namespace {

// Leaked on purpose: threads of the middleware may log while static objects are destroyed.
struct State {
  std::string name = "srfs";
  std::atomic<Severity> lowest{Severity::info};
  std::mutex sink_mutex;
  std::function<void(Severity, std::string_view)> sink;
};

State& state() {
  static State& instance = *new State;
  return instance;
}

const char* label(Severity severity) {
  switch (severity) {
    case Severity::debug:
      return "DEBUG";
    case Severity::info:
      return "INFO ";
    case Severity::warn:
      return "WARN ";
    case Severity::error:
      return "ERROR";
    case Severity::fatal:
      return "FATAL";
  }
  return "?    ";
}

}  // namespace

void set_name(std::string name) {
  state().name = std::move(name);
}

void set_level(Severity lowest) {
  state().lowest = lowest;
}

Severity level() {
  return state().lowest.load(std::memory_order_relaxed);
}

void set_sink(std::function<void(Severity, std::string_view)> sink) {
  const std::lock_guard lock(state().sink_mutex);
  state().sink = std::move(sink);
}

void write(Severity severity, std::string_view text) {
  constexpr std::size_t longest = 2000;  // a longer line is cut, so that one write(2) carries it
  const std::string line = fmt::format("{} {} [{}] {}\n", to_iso8601(system_utc_now()), label(severity),
                                       state().name, text.substr(0, longest));
  [[maybe_unused]] const ssize_t ignored = ::write(STDERR_FILENO, line.data(), line.size());
  const std::lock_guard lock(state().sink_mutex);
  if (state().sink) state().sink(severity, text);
}

}  // namespace srfs::log
