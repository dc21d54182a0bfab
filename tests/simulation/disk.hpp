// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <map>
#include <optional>
#include <string>

#include "base/octets.hpp"
#include "tests/simulation/process.hpp"

namespace srfs::simulation {

[[nodiscard]] inline Octets octets_of_text(std::string_view text) {
  return {text.begin(), text.end()};
}

/// Small files that are replaced whole (write_file_atomically), each process' writes in the order of its
/// worker. Where a process or the power ends in the middle of a write, the file is the old or the new one.
class Disk {
 public:
  explicit Disk(Kernel& kernel) : kernel_(kernel), random_(kernel.random("disk")) {}

  using Done = std::function<void(bool stored)>;
  /// @param done  on the work thread of @p host, if it lives
  void write(Host& host, std::string file, Octets content, Done done);
  /// Where a process waits for it: while it is configured.
  [[nodiscard]] bool write_now(const std::string& file, Octets content);
  [[nodiscard]] std::optional<Octets> read(const std::string& file) const;
  void remove(const std::string& file) { files_.erase(file); }
  /// The process of @p host has ended, for whatever reason.
  void on_end(const Host& host);

  void set_slow(nanoseconds longest) { longest_ = longest; }
  void set_failing(bool failing) { failing_ = failing; }
  [[nodiscard]] bool failing() const { return failing_; }
  [[nodiscard]] nanoseconds write_time();

 private:
  struct Job {
    std::string file;
    Octets content;
    Done done;
  };
  void begin(Host& host);
  void finish(Host& host, pid_t pid);

  Kernel& kernel_;
  Random random_;
  nanoseconds longest_{0};
  bool failing_ = false;
  std::map<std::string, Octets> files_;
  std::array<std::deque<Job>, lane_count> jobs_;  ///< by host; the first is being written
};

}  // namespace srfs::simulation
