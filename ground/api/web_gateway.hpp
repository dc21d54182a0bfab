// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/child_process.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "ground/archive/archive.hpp"
#include "msgs/mission/dictionary.hpp"

namespace srfs::ground::api {

struct WebOptions {
  std::string address = "127.0.0.1:8190";  ///< [ADDRESS:]PORT
  std::filesystem::path certificate;       ///< PEM; empty: HTTP, on loopback alone
  std::filesystem::path key;
  std::filesystem::path root;  ///< of the page; empty: that of the installation
};
/// Why they cannot be served; nullopt: they can. Ready to print.
[[nodiscard]] std::optional<std::string> wrong_options(const WebOptions& options);

/// `srfs-ground web`: the HTTP API of a server that runs, until SIGINT or SIGTERM. The error is ready to
/// print.
[[nodiscard]] Result<void, std::string> run_web_gateway(const mission::Dictionary& dictionary,
                                                        const std::filesystem::path& state_dir,
                                                        const ArchivePlace& archive,
                                                        const WebOptions& options);

/// The program of the gateway beside its server: it is started again when it ends, and ends with the server.
/// Never blocks but for the end.
class WebKeeper {
 public:
  static constexpr seconds restart_pause{1};  ///< doubled, up to the most, when it ends soon again
  static constexpr seconds restart_pause_most{60};
  static constexpr std::size_t line_octets_max = 1024;
  using Log = std::function<void(const std::string&)>;

  /// @param command  program and arguments
  WebKeeper(std::vector<std::string> command, Log log) : command_(std::move(command)), log_(std::move(log)) {}
  /// Asks it to end, and kills it when it does not.
  ~WebKeeper();
  WebKeeper(const WebKeeper&) = delete;
  WebKeeper& operator=(const WebKeeper&) = delete;

  void on_time(MonotonicTime now);

 private:
  void pass_output();
  std::vector<std::string> command_;
  Log log_;
  std::optional<ChildProcess> child_;
  MonotonicTime started_;
  MonotonicTime next_start_;
  seconds pause_ = restart_pause;
  std::string line_;
};

}  // namespace srfs::ground::api
