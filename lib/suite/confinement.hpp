// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <linux/filter.h>
#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/fd.hpp"
#include "suite/deployment.hpp"
#include "suite/instance.hpp"

namespace srfs::suite {

/// How far a node is trusted.
enum class Trust : std::uint8_t {
  whole,    ///< maintenance, whose build lane and changes of versions start others: all that its starter may
  own,      ///< a program of the installation, or one that commanding needs
  foreign,  ///< an added node, and an uplinked version that commanding does not need
};
[[nodiscard]] const char* to_text(Trust trust);
/// @param version  of the program; 0: golden
[[nodiscard]] Trust trust_in(const Deployment& deployment, const NodeEntry& node, std::uint32_t version);

/// Bits of capabilities(7) that the node needs; Confinement adds what a machine that is not prepared needs.
/// Others are never regained.
[[nodiscard]] std::uint64_t capabilities_of(const Deployment& deployment, const NodeEntry& node, Trust trust);

/// What a node's process may do, made before it is forked and taken on before its program is executed: the
/// program need not be trusted to confine itself. Three layers, each by itself; root and ordinary users have
/// them alike, capabilities aside.
class Confinement {
 public:
  struct Place {
    const Deployment& deployment;
    const VarPaths& var;
    const NodeEntry& node;
    std::filesystem::path program;
    std::filesystem::path bin_folder;
  };
  Confinement() = default;  ///< none
  [[nodiscard]] static Confinement make(const Place& place, Trust trust);

  /// Confines the calling process, for good. Async-signal-safe. @return nullptr, or the step that failed:
  /// errno says why
  [[nodiscard]] const char* enter() const;
  [[nodiscard]] Trust trust() const { return trust_; }
  /// For people: the layers that this kernel does not have; empty: none is missing.
  [[nodiscard]] const std::string& missing() const { return missing_; }

 private:
  void allow_files(const Place& place);
  void make_filter(const Place& place);

  Trust trust_ = Trust::whole;
  std::uint64_t capabilities_ = ~0ULL;
  Fd files_;                         ///< a ruleset of Landlock
  std::vector<sock_filter> filter_;  ///< a program of seccomp
  std::string missing_;
};

/// The calling thread, and those it makes, keep these capabilities alone. For a process of one thread.
void keep_capabilities(std::uint64_t wanted);

/// What a process has, by /proc/PID/status.
struct RealPrivileges {
  uid_t user = 0;
  std::uint64_t capabilities = 0;  ///< effective and permitted
  bool no_new_privileges = false;
  bool filtered = false;  ///< seccomp
};
/// @param status  the text of /proc/PID/status
[[nodiscard]] RealPrivileges privileges_from(const std::string& status);
/// "CAP_SYS_TIME CAP_NET_ADMIN", "none", "all"
[[nodiscard]] std::string capability_names(std::uint64_t capabilities);

}  // namespace srfs::suite
