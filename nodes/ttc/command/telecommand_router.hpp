// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <mission/structures.hpp>

#include "base/result.hpp"
#include "msgs/mission/dictionary.hpp"
#include "nodes/ttc/command/acceptance_journal.hpp"
#include "nodes/ttc/command/command_forwarder.hpp"
#include "nodes/ttc/command/hazard_guard.hpp"
#include "nodes/ttc/command/telecommand_parser.hpp"
#include "nodes/ttc/report/report_queue.hpp"
#include "nodes/ttc/services/mode_manager.hpp"
#include "nodes/ttc/services/pus_service.hpp"

namespace srfs {

/// Decides what one telecommand packet causes: 1,2 with the reason, or 1,1 and then a service of ttc itself
/// or a command for another node. Between the decision (judge) and what it causes (carry_out) the telecommand
/// becomes durable; room in its node's queue is kept for it, and a mode change that waits counts as done for
/// those behind it. Everything it causes is in the report queue, the forwarder, the services, or taken from
/// here. Never blocks.
class TelecommandRouter {
 public:
  static constexpr std::size_t max_rejected = 16;

  /// What it works with; all outlive it.
  struct Parts {
    const mission::Dictionary& dictionary;
    const ModeManager& mode;
    HazardGuard& hazards;
    CommandForwarder& forwarder;
    ReportQueue& report_queue;
    std::vector<PusService*> services;  ///< of ttc itself: the first that provides a command executes it
  };

  /// @param own_node name of the node whose commands are executed here
  TelecommandRouter(Parts parts, std::string own_node);

  /// @param packet a space packet as it came up
  /// @param room whether an accepted one can be recorded; if not, it is refused (queue_full)
  [[nodiscard]] JudgedTelecommand judge(OctetView packet, MonotonicTime now, bool room = true);
  /// What of a packet never changes between its insertion into the schedule and its release; mode and room
  /// are checked then. @return the failure code and the argument it is about, 0: none
  [[nodiscard]] std::optional<std::pair<std::uint16_t, std::uint8_t>> check_scheduled(OctetView packet) const;
  /// 1,1 and what is asked for, or 1,2. Once for each that judge() gave, in that order; refused ones at any
  /// time. Without a record on disk only recovery commands run.
  void carry_out(JudgedTelecommand judged, MonotonicTime now);
  /// Goes on with an accepted telecommand of an earlier process. One of ttc itself whose service does not
  /// know what became of it is done again if it is idempotent and not expired; else it ends as interrupted.
  void restore(const AcceptedTelecommand& accepted, MonotonicTime now);

  /// An event for each telecommand refused since the last call, at most max_rejected (the newest).
  [[nodiscard]] std::vector<mission::TtcTelecommandRejectedEvent> take_rejected() {
    return std::exchange(rejected_, {});
  }
  /// Ids of recovery commands that ran without storage since the last call.
  [[nodiscard]] std::vector<std::uint64_t> take_unstored_runs() { return std::exchange(unstored_runs_, {}); }

 private:
  [[nodiscard]] std::optional<Refusal> why_refused(const Telecommand& telecommand, bool room,
                                                   MonotonicTime now) const;
  [[nodiscard]] PusService* service_of(const mission::Command& command) const;
  [[nodiscard]] std::size_t waiting_for(const std::string& node) const;
  void refuse(const TelecommandOrigin& origin, const Refusal& refusal);
  void execute(const Telecommand& telecommand, MonotonicTime now);

  Parts parts_;
  std::string own_node_;
  TelecommandParser parser_;
  std::vector<mission::TtcTelecommandRejectedEvent> rejected_;
  std::vector<std::uint64_t> unstored_runs_;
  std::map<std::string, std::size_t> waiting_;  ///< judged and not carried out, per node
  std::vector<MissionMode> modes_to_come_;      ///< of mode changes among them, in order
};

}  // namespace srfs
