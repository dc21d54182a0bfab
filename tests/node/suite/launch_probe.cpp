// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// A process for the launcher to start: holds its instance lock and waits. SIGUSR1: starts the node named in
// VAR/run/start_next, like the ring. SIGTERM: ends.

#include <csignal>

#include <CLI/CLI.hpp>

#include "base/file.hpp"
#include "suite/launcher.hpp"

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
  sigaddset(&set, SIGUSR1);
  sigaddset(&set, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  const suite::VarPaths paths{var};
  auto lock = suite::InstanceLock::take(paths, name);
  if (!lock) return 3;
  const suite::Deployment plan = suite::Deployment::load(deployment);
  lock->publish(1, "probe");  // from now on the test may send signals and read the open files
  while (true) {
    int signal = 0;
    sigwait(&set, &signal);
    if (signal == SIGTERM) return 0;
    const std::string next = read_file(paths.run() / "start_next", 64).value_or("");
    const suite::NodeEntry* node = plan.find(next);
    if (node == nullptr || !suite::launch({plan, paths, suite::suite_bin_folder(), "probe"}, *node)) return 4;
  }
}
