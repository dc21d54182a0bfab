// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <poll.h>
#include <pwd.h>
#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "base/child_process.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::testing_support {

/// A PostgreSQL of this test program, in a temporary folder and at a UNIX socket there. It ends with the
/// program, however that ends. (tests/system/postgresql.py does the same for the system tests.)
class PostgresqlCluster {
 public:
  /// Where its programs are; empty: it is not installed.
  static std::filesystem::path programs() {
    std::error_code error;
    std::filesystem::path newest;
    for (const auto& version : std::filesystem::directory_iterator("/usr/lib/postgresql", error)) {
      if (std::filesystem::exists(version.path() / "bin/initdb")) newest = version.path() / "bin";
    }
    return newest;
  }

  PostgresqlCluster() {
    // PostgreSQL refuses to run as root; its folder is then the user's that the package has made.
    const passwd* const user = ::geteuid() == 0 ? ::getpwnam("postgres") : nullptr;
    if (::geteuid() == 0 && user == nullptr) throw std::runtime_error("there is no user postgres");
    std::filesystem::permissions(folder_.path(), std::filesystem::perms(0711));
    std::filesystem::create_directory(home());
    if (user != nullptr) {
      if (::chown(home().c_str(), user->pw_uid, user->pw_gid) != 0)
        throw std::runtime_error("no folder for the user postgres");
      as_user_ = {"--reuid=postgres", "--regid=postgres", "--clear-groups"};
    }
    auto made =
        start_program({(programs() / "initdb").string(), "--auth=trust", "--username=srfs", "--no-sync",
                       "--encoding=UTF8", "--locale=C", "--pgdata", (home() / "data").string()});
    while (true) {
      std::string unused(4096, '\0');
      if (::read(made.output(), unused.data(), unused.size()) == 0) break;
      pollfd output{made.output(), POLLIN, 0};
      ::poll(&output, 1, 1000);
    }
    std::optional<ChildProcess::End> end;
    while (!(end = made.take_end())) ::usleep(1000);
    if (end->exit_code != 0) throw std::runtime_error("initdb: " + to_text(*end));
    start();
  }

  PostgresqlCluster(const PostgresqlCluster&) = delete;
  PostgresqlCluster& operator=(const PostgresqlCluster&) = delete;
  ~PostgresqlCluster() {
    if (server_) stop(SIGQUIT);
  }

  /// Returns when it takes connections.
  void start() {
    server_.emplace(start_program({(programs() / "postgres").string(), "-D", (home() / "data").string(), "-k",
                                   home().string(), "-c", "listen_addresses=", "-c", "fsync=off", "-c",
                                   "log_min_messages=panic", "-c", "autovacuum=off"}));
    const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (!is_ready()) {
      if (server_->take_end() || std::chrono::steady_clock::now() > until)
        throw std::runtime_error("PostgreSQL does not start");
      ::usleep(10'000);
    }
  }
  /// @param signal_number  SIGINT: ends its connections; SIGQUIT: at once, as a crash
  void stop(int signal_number) {
    ::kill(server_->process().pid(), signal_number);
    while (!server_->take_end()) ::usleep(1000);
    server_.reset();
  }
  [[nodiscard]] pid_t pid() const { return server_->process().pid(); }

  [[nodiscard]] std::string address() const { return "postgresql://srfs@/postgres?host=" + home().string(); }

 private:
  [[nodiscard]] std::filesystem::path home() const { return folder_.path() / "postgresql"; }
  [[nodiscard]] ChildProcess start_program(const std::vector<std::string>& program) const {
    std::vector<std::string> command{"/usr/bin/setpriv"};
    command.insert(command.end(), as_user_.begin(), as_user_.end());
    command.insert(command.end(), {"--pdeathsig", "QUIT"});
    command.insert(command.end(), program.begin(), program.end());
    auto started = ChildProcess::start(command);
    if (!started) throw std::runtime_error(started.error());
    return std::move(*started);
  }
  [[nodiscard]] bool is_ready() const {
    std::ifstream file(home() / "data/postmaster.pid");
    std::string line;
    for (int number = 0; number < 8; ++number) std::getline(file, line);
    return line.starts_with("ready");
  }

  TemporaryFolder folder_;
  std::vector<std::string> as_user_;
  std::optional<ChildProcess> server_;
};

}  // namespace srfs::testing_support
