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
  static constexpr milliseconds longest_restart{5000};
  explicit StarterClient(Fd socket, milliseconds patience = longest_restart)
      : socket_(std::move(socket)), patience_(patience) {}

  /// As Restarter::restart. Blocks for 5 s at most. Error: the starter is gone, or has left two requests in a
  /// row without an answer.
  [[nodiscard]] Result<RestartOutcome, std::string> restart(const Accusation& accusation);
  /// Does not block.
  [[nodiscard]] bool is_gone() const;
  /// To a request of this process: it was able to work once.
  [[nodiscard]] bool has_answered() const { return has_answered_; }
  /// As Restarter's. Never block; what finds no room is lost.
  void recovered(const std::string& subject, std::uint32_t incarnation, MonotonicTime active);
  void commit(const std::string& subject, std::uint32_t version);

 private:
  Fd socket_;
  milliseconds patience_;
  std::uint32_t number_ = 0;
  int unanswered_ = 0;  ///< in a row
  bool has_answered_ = false;
};

/// The starter of node @p observer: serves until the node has ended; what is asked by then is not done any
/// more. A foreign node is believed only what this process finds true itself: a process that is gone, or
/// whose heartbeat page stands still.
/// @return exit code
int serve_starter(Fd socket, const std::filesystem::path& deployment, const VarPaths& var,
                  const std::string& observer, Trust trust);

/// A heartbeat page that a starter has seen itself, more than once.
struct StillPage {
  pid_t pid = 0;          ///< whose it is
  MonotonicTime since;    ///< when it was first seen as it is
  nanoseconds lasted{0};  ///< since then, less what its process waited for a CPU
};
/// Whether a foreign node's accusation may be carried out. It changes `decided` to what the page has to show.
/// @param page  of the accused; nullopt: there is none
/// @param bound  for which a page has to stand still
/// @return why not; empty: it may
[[nodiscard]] std::string doubt_of_foreign(Accusation& accusation, const std::optional<StillPage>& page,
                                           nanoseconds bound);

}  // namespace srfs::suite
