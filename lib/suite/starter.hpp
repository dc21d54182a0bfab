// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>

#include "base/fd.hpp"
#include "base/result.hpp"
#include "suite/confinement.hpp"
#include "suite/ring/fault.hpp"

namespace srfs::suite {

/// A node is confined (confinement.hpp), so it cannot start another one as that needs to be. Each node has a
/// starter beside it: a process of the installation with the privileges of the node's own starter, which ends
/// with the node. It carries out what the node's half of the ring decides (Restarter). Until it is needed it
/// is the few kilobytes of `srfs-starter`; the first request makes it `srfs serve-starter`. There is no
/// launcher that all depend on.

/// Where a node finds its starter: a descriptor (SOCK_SEQPACKET).
inline constexpr const char* starter_variable = "SRFS_STARTER_FD";
inline constexpr int starter_fd = 3;

/// A node's side. restart() from one thread, the others from any.
class StarterClient {
 public:
  /// That of this process; nullopt: it was started without one.
  [[nodiscard]] static std::optional<StarterClient> of_this_process();
  explicit StarterClient(Fd socket) : socket_(std::move(socket)) {}

  /// As Restarter::restart. Blocks for 5 s at most. Error: the starter is gone.
  [[nodiscard]] Result<RestartOutcome, std::string> restart(const Accusation& accusation);
  /// As Restarter's. Never block; what finds no room is lost.
  void recovered(const std::string& subject, std::uint32_t incarnation, MonotonicTime active);
  void commit(const std::string& subject, std::uint32_t version);

 private:
  Fd socket_;
  std::uint32_t number_ = 0;
};

/// The starter of node @p observer: serves until the node has ended. A foreign node is believed only what
/// this process finds true itself: a process that is gone, or whose heartbeat page stands still.
/// @return exit code
int serve_starter(Fd socket, const std::filesystem::path& deployment, const VarPaths& var,
                  const std::string& observer, Trust trust);

/// Whether a foreign node's accusation may be carried out. It changes `decided` to what the page has to show.
/// @return why not; empty: it may
[[nodiscard]] std::string doubt_of_foreign(Accusation& accusation, nanoseconds period, MonotonicTime now);

}  // namespace srfs::suite
