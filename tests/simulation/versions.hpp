// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "lib/update/test/memory_version_files.hpp"
#include "suite/ring/restart_policy.hpp"
#include "tests/simulation/disk.hpp"
#include "update/version_store.hpp"

namespace srfs::simulation {

/// A program as it is played: its name, and how long it lives. 0: it has no fault.
struct PlayedProgram {
  std::string name;
  milliseconds lives{0};
};
[[nodiscard]] std::string to_text(const PlayedProgram& program);

/// The versions of all nodes on the disk, and which one each process runs: what lib/suite's launcher and
/// node_versions do around update::VersionStore. Its functions check requirement C6d.
class Versions {
 public:
  Versions(Kernel& kernel, const Disk& disk, const std::vector<Host*>& hosts);

  [[nodiscard]] update::MemoryVersionFiles& disk(const Host& host) { return node(host).files; }
  /// What was set aside in this boot counts as failed.
  [[nodiscard]] update::VersionTable read(const Host& host) const;
  /// Settles what was set aside, and changes the store.
  using Change = std::function<Result<void, std::string>(update::VersionStore& store)>;
  [[nodiscard]] Result<void, std::string> change(const Host& host, const Change& change);

  /// A process of it is started: the best of its versions that is there. @return the version
  update::VersionNumber on_begin(const Host& host);
  /// It runs: a program with a fault ends, a version that lives through its probation is good.
  void on_running(Host& host);
  [[nodiscard]] update::VersionNumber running(const Host& host) const { return node(host).running; }
  /// Empty: golden.
  [[nodiscard]] std::string running_origin(const Host& host) const;
  [[nodiscard]] std::optional<suite::VersionTrial> trial_of(const Host& host) const;
  /// The version failed. Waits for no disk.
  void set_aside(Host& host, update::VersionNumber version, const std::string& reason);
  /// The suite starts after a reset of the computer.
  void count_suite_start(const Host& host);
  void lose_power();
  /// Long after the last fault: each node runs the program that its table names, none with a fault, and no
  /// package is stored twice.
  void check() const;
  [[nodiscard]] std::uint64_t fallbacks() const { return fallbacks_; }

 private:
  struct SetAside {
    std::uint64_t revision;
    update::VersionNumber version;
    std::string reason;
  };
  struct Node {
    std::string name;
    mutable update::MemoryVersionFiles files;  ///< a store that only reads has it as one that writes
    std::vector<SetAside> aside;               ///< on tmpfs
    update::VersionNumber running = update::golden;
    MonotonicTime since;
  };
  [[nodiscard]] Node& node(const Host& host) { return nodes_.at(static_cast<std::size_t>(host.lane())); }
  [[nodiscard]] const Node& node(const Host& host) const {
    return nodes_.at(static_cast<std::size_t>(host.lane()));
  }
  [[nodiscard]] static update::VersionTable read(const Node& node);
  [[nodiscard]] static std::optional<std::string> damage_of(const Node& node, const update::Version& version);
  [[nodiscard]] static milliseconds life_of(const Node& node);

  Kernel& kernel_;
  const Disk& disk_;
  std::deque<Node> nodes_;  ///< by lane
  std::uint64_t fallbacks_ = 0;
};

}  // namespace srfs::simulation
