// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// A process for tests of the ring's restarter: instance lock, incarnation, heartbeat page, crash handler, and
// one thread that makes turns. VAR/run/NAME.behaviour, read at the start, and signals select its faults:
//   "exit N"   ends before it takes its lock        SIGUSR1  hangs: no turns, deaf to SIGTERM
//   "slow"     takes it when VAR/run/go exists       SIGUSR2  writes through a null pointer
//   "stubborn" ignores SIGTERM and keeps turning     SIGHUP   throws an exception that is not caught

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>

#include <sys/prctl.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include "base/file.hpp"
#include "suite/crash_report.hpp"
#include "suite/instance.hpp"
#include "suite/ring/heartbeat_page.hpp"

namespace {

[[noreturn]] void hang_in_a_callback() {
  std::fputs("hangs\n", stderr);
  while (true) pause();
}

}  // namespace

int main(int argc, char** argv) {
  using namespace srfs;
  CLI::App app;
  std::string name;
  std::string deployment;
  std::string var;
  app.add_option("--name", name);
  app.add_option("--deployment", deployment);
  app.add_option("--var", var);
  CLI11_PARSE(app, argc, argv);

  sigset_t set;
  sigemptyset(&set);
  for (const int number : {SIGTERM, SIGUSR1, SIGUSR2, SIGHUP}) sigaddset(&set, number);
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  const suite::VarPaths paths{var};
  const std::string behaviour = read_file(paths.run() / (name + ".behaviour"), 64).value_or("");
  if (behaviour.starts_with("exit ")) return std::atoi(behaviour.c_str() + 5);
  if (behaviour == "slow") std::fputs("slow\n", stderr);
  while (behaviour == "slow" && !std::filesystem::exists(paths.run() / "go")) usleep(2000);
  auto lock = suite::InstanceLock::take(paths, name);
  if (!lock) return 3;
  const std::uint32_t incarnation = suite::next_incarnation(paths, name).number;
  auto page = suite::HeartbeatPage::create(paths, name, incarnation);
  if (page) suite::install_crash_handler(*page);
  std::fprintf(stderr, "incarnation %u turns\n", incarnation);
  lock->publish(incarnation, "probe");
  volatile int* nowhere = nullptr;
  while (true) {
    if (page) page->beat(monotonic_now());
    const timespec turn{0, 5'000'000};
    switch (sigtimedwait(&set, nullptr, &turn)) {
      case SIGTERM:
        if (behaviour == "stubborn") break;
        if (page) page->end(suite::EndKind::exit, 0);
        return 0;
      case SIGUSR1:
        hang_in_a_callback();
      case SIGUSR2:
        *nowhere = 1;
        break;
      case SIGHUP:
        throw std::runtime_error("nobody catches this");
      default:
        break;
    }
  }
}
