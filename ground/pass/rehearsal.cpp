// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/pass/rehearsal.hpp"

#include <array>
#include <csignal>
#include <utility>

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include "base/time.hpp"

namespace srfs::ground::pass {
namespace {

constexpr seconds ready_patience{120};
constexpr seconds up_patience{240};
constexpr seconds down_patience{60};
constexpr milliseconds turn{50};

/// Until a program ends. @param said  takes what it says
/// @return nullopt: it did not in time, or not before @p stop was readable (-1: never)
std::optional<ChildProcess::End> end_of(ChildProcess& child, nanoseconds patience, const Said& said,
                                        int stop) {
  const MonotonicTime deadline = monotonic_now() + patience;
  while (monotonic_now() < deadline && !is_stopped(stop)) {
    std::array<pollfd, 2> wait{{{child.output(), POLLIN, 0}, {stop, POLLIN, 0}}};
    static_cast<void>(::poll(wait.data(), wait.size(), static_cast<int>(turn.count())));
    std::array<char, 4096> chunk{};
    ssize_t got = 0;
    while ((got = ::read(child.output(), chunk.data(), chunk.size())) > 0)
      said({chunk.data(), static_cast<std::size_t>(got)});
    if (got == 0)
      static_cast<void>(::poll(nullptr, 0, static_cast<int>(turn.count())));  // it says nothing more
    if (auto end = child.take_end()) return end;
  }
  return std::nullopt;
}

/// The error is ready to print.
Result<void, std::string> run(const std::vector<std::string>& command, seconds patience, int stop) {
  constexpr std::size_t kept_max = 4096;
  std::string kept;
  const auto take = [&kept](std::string_view said) {
    if (kept.size() < kept_max) kept += said;
  };
  const auto end = run_program(command, patience, take, stop);
  if (!end) return Err(end.error());
  if (*end != 0) return Err(fmt::format("{}: exit code {}: {}", command.front(), *end, kept));
  return {};
}

/// The folders that a simulation needs; those of locks are its user's alone.
Result<void, std::string> make_folders(const std::filesystem::path& var) {
  std::error_code error;
  std::filesystem::create_directories(var / "run", error);
  if (!error) std::filesystem::permissions(var / "run", std::filesystem::perms::owner_all, error);
  if (!error) std::filesystem::create_directories(var / "log", error);
  if (error) return Err(fmt::format("{}: {}", var.string(), error.message()));
  return {};
}

}  // namespace

bool is_stopped(int stop) {
  pollfd look{stop, POLLIN, 0};
  return ::poll(&look, 1, 0) > 0;
}

Result<int, std::string> run_program(const std::vector<std::string>& command, nanoseconds patience,
                                     const Said& said, int stop) {
  auto child = ChildProcess::start(command);
  if (!child) return Err(child.error());
  const auto end = end_of(*child, patience, said, stop);
  if (!end && is_stopped(stop)) return Err(std::string("interrupted"));
  if (!end) return Err(fmt::format("{} did not end in time", command.front()));
  if (!end->exit_code) return Err(fmt::format("{}: {}", command.front(), to_text(*end)));
  return *end->exit_code;
}

std::vector<std::string> Rehearsal::command(const std::string& verb,
                                            const std::vector<std::string>& more) const {
  std::vector<std::string> words{(programs_ / "srfs").string(), verb};
  words.insert(words.end(), more.begin(), more.end());
  words.insert(words.end(), options_.begin(), options_.end());
  return words;
}

Result<Rehearsal, std::string> Rehearsal::start(const std::filesystem::path& programs,
                                                const std::string& deployment,
                                                const std::filesystem::path& var, int stop) {
  if (const auto made = make_folders(var); !made) return Err(made.error());
  std::vector<std::string> options{"--deployment", deployment, "--var", var.string()};
  // Its log goes into a file: a pipe that nobody reads would stop it.
  std::vector<std::string> command{"/bin/sh", "-c", "exec \"$@\" >> \"$0\" 2>&1",
                                   (var / "log/hw_sim.log").string(), (programs / "hw_sim").string()};
  command.insert(command.end(), options.begin(), options.end());
  auto hw_sim = ChildProcess::start(command);
  if (!hw_sim) return Err(hw_sim.error());
  Rehearsal rehearsal(programs, std::move(options), std::move(*hw_sim));
  const MonotonicTime deadline = monotonic_now() + ready_patience;
  std::error_code error;
  while (!std::filesystem::exists(var / "run/hw_sim.ready", error)) {
    const auto end = end_of(
        *rehearsal.hw_sim_, milliseconds(200), [](std::string_view) {}, stop);
    if (is_stopped(stop)) return Err(std::string("interrupted"));
    if (end)
      return Err(fmt::format("hw_sim: {}; its log: {}", to_text(*end), (var / "log/hw_sim.log").string()));
    if (monotonic_now() > deadline) return Err(std::string("hw_sim did not become ready"));
  }
  const seconds up_deadline = up_patience - seconds(30);
  const auto up =
      run(rehearsal.command("up", {"--deadline", std::to_string(up_deadline.count())}), up_patience, stop);
  if (!up) return Err(up.error());
  return rehearsal;
}

Rehearsal::~Rehearsal() {
  if (!hw_sim_) return;
  constexpr int never = -1;  // whoever interrupts the rehearsal wants this
  static_cast<void>(run(command("down", {}), down_patience, never));
  static_cast<void>(hw_sim_->process().signal(SIGTERM));
  static_cast<void>(end_of(
      *hw_sim_, seconds(10), [](std::string_view) {}, never));
}

}  // namespace srfs::ground::pass
