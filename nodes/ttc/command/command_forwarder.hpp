// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <mission/structures.hpp>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "nodes/ttc/command/telecommand.hpp"
#include "nodes/ttc/report/report_queue.hpp"

namespace srfs {

struct ForwardingCounters {
  std::uint64_t submitted = 0;
  std::uint64_t refused = 0;    ///< a queue bound was reached
  std::uint64_t published = 0;  ///< repetitions included
  std::uint64_t completed = 0;
  std::uint64_t failed = 0;
  std::uint64_t expired = 0;            ///< of failed: not taken, or no completion report
  std::uint64_t duplicate_reports = 0;  ///< a stage already reported
  std::uint64_t stray_reports = 0;      ///< about a command that is not under way, or not from its target
};

/// Telecommand ids a written link state sets aside: more than can be given out before the next one is on disk
/// (twice the persistence gate).
inline constexpr std::uint64_t reserved_telecommand_ids = 256;

/// The first id after a start. Never one that was given out before, as far as that is known.
/// @param stored from the link state, 0: lost or none. @param known by this process, 0: none.
/// @param utc of the machine: sixteen ids a second since 2020 are far more than the link carries, so this
/// goes up even if the state is lost or the disk failed for long
[[nodiscard]] std::uint64_t first_telecommand_id(std::uint64_t stored, std::uint64_t known, UtcTime utc);

enum class ForwardError : std::uint8_t { queue_full };

/// Brings telecommands to their nodes: publishes them until the node has accepted each, at most so many
/// unacknowledged a node, and turns the nodes' reports into PUS 1 reports of the original request. An
/// accepted one is published now and then too: its node knows the id and reports again how far it got, so a
/// report that was lost with a process comes all the same. Bounds are per node; a node that is silent costs
/// only its own commands.
class CommandForwarder {
 public:
  static constexpr std::size_t max_unacknowledged = 8;
  static constexpr std::size_t max_queued = 32;
  static constexpr std::size_t max_executing = 64;  ///< accepted by the node, not completed
  static constexpr milliseconds republish_period{500};
  static constexpr milliseconds ask_period{2000};  ///< of an accepted one
  static constexpr seconds completion_grace{30};   ///< after the expiry

  /// @param report_queue takes the verification reports; outlives this
  explicit CommandForwarder(ReportQueue& report_queue) : report_queue_(report_queue) {}

  /// Takes an accepted telecommand.
  Result<void, ForwardError> submit(Telecommand telecommand, MonotonicTime now);
  /// Goes on with one of an earlier process, in the order of the ids and whatever the bounds: they held when
  /// it was accepted. Its node is given time to report the outcome, also past its expiry.
  void restore(Telecommand telecommand, const TelecommandProgress& progress, MonotonicTime now);
  /// Whether submit() for @p target would be taken after @p reserved others.
  [[nodiscard]] bool has_room(const std::string& target, std::size_t reserved = 0) const;
  /// @param from  the node that reports it on /telecommand_report; only the target of the command is believed
  void on_report(const std::string& from, const StageReached& report, MonotonicTime now);
  /// Publishes again what is due, ends what expired.
  void on_time(MonotonicTime now);
  [[nodiscard]] std::optional<MonotonicTime> next_due() const;

  /// To be published on /telecommand now, in order. The id is unique for ever and counts up; payloads
  /// distinguish telecommands by its low 32 bits.
  [[nodiscard]] std::vector<Telecommand> take_publications() { return std::exchange(publications_, {}); }

  /// An event for each command that expired since the last call; at most those that were under way.
  [[nodiscard]] std::vector<mission::TtcTelecommandExpiredEvent> take_expired() {
    return std::exchange(expired_, {});
  }

  /// Ids of commands that their node has accepted since the last call.
  [[nodiscard]] std::vector<std::uint64_t> take_taken() { return std::exchange(taken_, {}); }

  /// When the last one under way has ended at the latest, done or given up; nullopt: there is none.
  [[nodiscard]] std::optional<MonotonicTime> latest_end() const;
  /// Commands not completed, of all nodes.
  [[nodiscard]] std::size_t under_way() const;
  [[nodiscard]] const ForwardingCounters& counters() const { return counters_; }

 private:
  struct Entry {
    Telecommand telecommand;
    TelecommandProgress progress = {};
    MonotonicTime publish_next;
    MonotonicTime give_up;  ///< not taken, or then not ended until then: it failed

    /// Also if its node takes it in the last instant.
    [[nodiscard]] MonotonicTime latest_end() const {
      return std::max(give_up, telecommand.expiry + completion_grace);
    }
    [[nodiscard]] std::uint64_t id() const { return telecommand.origin.id; }
    [[nodiscard]] const std::string& target() const { return telecommand.command->node; }
  };
  struct Node {
    std::deque<Entry> queued;
    std::deque<Entry> unacknowledged;
    std::deque<Entry> executing;
  };
  void publish(Entry& entry, MonotonicTime now);
  void take(Node& node, Entry entry, MonotonicTime now);
  void fill(Node& node, MonotonicTime now);
  void end_expired(Node& node, MonotonicTime now);
  void expire(const Entry& entry, Stage stage, std::uint16_t code);
  void fail(const Entry& entry, Stage stage, std::uint16_t code, OctetView data);
  /// @return whether the command is over
  bool apply(Entry& entry, const StageReached& report);
  void report_start(Entry& entry);

  ReportQueue& report_queue_;
  std::map<std::string, Node> nodes_;
  std::vector<Telecommand> publications_;
  std::vector<mission::TtcTelecommandExpiredEvent> expired_;
  std::vector<std::uint64_t> taken_;
  ForwardingCounters counters_;
};

}  // namespace srfs
