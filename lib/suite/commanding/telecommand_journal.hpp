// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include <mission/structures.hpp>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"

namespace srfs {

using mission::RepeatClass;
using Stage = mission::VerificationStage;

/// Of mission::failure, or of an added node's own dictionary; 0: none.
using FailureCode = std::uint16_t;

/// A telecommand as it arrived.
struct StoredTelecommand {
  std::uint64_t id = 0;
  std::uint16_t function = 0;
  RepeatClass repeat = RepeatClass::by_id;
  MonotonicTime expiry;  ///< not started after this; zero: never expires
  Octets arguments;

  [[nodiscard]] bool has_expired(MonotonicTime now) const {
    return expiry != MonotonicTime() && now > expiry;
  }
};

/// One stage reached or missed.
struct StageReport {
  std::uint64_t id = 0;
  Stage stage = Stage::acceptance;
  bool success = true;
  FailureCode failure = mission::failure::none;
  friend bool operator==(const StageReport&, const StageReport&) = default;
};

enum class JournalError : std::uint8_t { not_a_journal, damaged };

/// The telecommands of one payload between their arrival and their end, and the ids of the last ended ones.
/// What it holds is meant to be on disk: every change raises revision(); the owner writes encode()
/// (coalescing at will) and reports it with on_written(). Stages that must survive a crash are reported only
/// then. Pure; one thread.
class TelecommandJournal {
 public:
  static constexpr std::size_t capacity = 16;  ///< pending at most; the next one is refused
  /// Ended ids remembered; the oldest is forgotten first. What is as old as one that was forgotten and is not
  /// known is a replay: ttc gives out ids that count up, and is never so many ahead of a node.
  static constexpr std::size_t known_capacity = 64;

  static constexpr std::size_t refused_capacity = 64;

  /// @param boot_id  of this boot: monotonic times of another boot mean nothing
  explicit TelecommandJournal(std::string boot_id) : boot_id_(std::move(boot_id)) {}

  /// Takes over what an earlier process of this node left. Begun at-most-once commands end as interrupted.
  /// With another boot id expiry can no longer be judged, and all others end too: at-most-once ones as
  /// expired, the others, which may have begun, as interrupted. Known ids are kept in any case. Ends that may
  /// not have been reported are reported again.
  Result<void, JournalError> restore(OctetView content);
  [[nodiscard]] Octets encode() const;

  /// True when the id is known, or was refused lately: it is reported again as far as it got.
  bool repeat_reports(std::uint64_t id);

  enum class Arrival : std::uint8_t { stored, known, full, too_old };
  /// Stores a new one; a known one is dropped (repeat_reports), a full journal refuses it. One that may have
  /// been known and is forgotten is refused as interrupted.
  Arrival add(StoredTelecommand telecommand);
  /// Reports a telecommand refused before it was stored. The last `refused_capacity` of this process stay
  /// refused: one that was on its way twice is not executed after its sender heard that it is not.
  void refuse(std::uint64_t id, FailureCode why);

  /// The next to execute, after those that expired before they began were ended (one that an earlier process
  /// may have begun: as interrupted); nullptr: none. Valid until the next change.
  [[nodiscard]] const StoredTelecommand* next(MonotonicTime now);
  /// Records that the next one begins, for at-most-once commands. It may be sent once start_is_durable().
  void mark_started();
  [[nodiscard]] bool start_is_durable() const;
  /// The next one was not sent after all; no effect once it began.
  void unmark_started();
  /// The next one is on its way to the peripheral: reports the start, the first time.
  void begin();
  /// The next one was not answered. @return true when it stays for another attempt (idempotent, by_id; at
  /// most three);
  ///         else it ended with @p why (at-most-once: interrupted)
  bool attempt_failed(FailureCode why);
  /// The peripheral lost the ids it knew (its power was cut): a by_id command that it may have executed, also
  /// any restored one, is not repeated, and ends as interrupted.
  void on_ids_lost();
  /// The same when that happened to an earlier process, and what the disk had then was older: any restored
  /// by_id command may have been executed, and ends as interrupted.
  void interrupt_restored();
  /// The next one ended.
  void finish(FailureCode outcome);

  /// Rises with each change that must reach the disk.
  [[nodiscard]] std::uint64_t revision() const { return revision_; }
  /// Everything is on disk.
  [[nodiscard]] bool is_durable() const { return durable_ == revision_; }
  /// Revision @p revision was written, or could not be: then what waited to be accepted is refused
  /// (storage_unavailable).
  void on_written(std::uint64_t revision, bool ok);

  /// Reports that may go out now, in order.
  [[nodiscard]] std::vector<StageReport> take_reports();
  /// A telecommand arrived and its acceptance is not on disk yet.
  [[nodiscard]] bool storing() const;
  [[nodiscard]] std::size_t pending() const { return pending_.size(); }

  struct Counters {
    std::uint32_t arrived = 0;
    std::uint32_t repeated = 0;
    std::uint32_t refused = 0;
    std::uint32_t expired = 0;
    std::uint32_t completed = 0;
    std::uint32_t failed = 0;
    std::uint32_t failed_writes = 0;
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  static constexpr int attempts_allowed = 3;

  struct Pending {
    StoredTelecommand telecommand;
    std::uint64_t stored_with = 0;   ///< revision that holds it
    bool accepted = false;           ///< that revision is on disk
    bool restored = false;           ///< by an earlier process, which may have sent it
    bool started = false;            ///< at-most-once: recorded as begun
    std::uint64_t started_with = 0;  ///< revision that records it
    bool start_reported = false;
    int attempts = 0;
  };
  struct Known {
    StageReport report;
    bool of_this_boot;
  };
  struct Waiting {
    StageReport report;
    std::uint64_t revision;  ///< goes out when this one is on disk
  };

  void end_front(const StageReport& report);
  /// Its expiry is past, or cannot be determined. Repeatable commands record no start, so an earlier process
  /// may have sent this one; "not started" is only likely.
  [[nodiscard]] StageReport too_late(const Pending& pending);
  void remember(const StageReport& report, bool of_this_boot = true);
  void drop_unaccepted();
  /// It ended, and its end is not on disk yet: not reported.
  [[nodiscard]] bool waits_for_disk(std::uint64_t id) const;

  std::string boot_id_;
  std::deque<Pending> pending_;
  std::deque<Known> known_;  // those of earlier boots in front
  std::deque<StageReport> refused_;
  std::deque<Waiting> waiting_;
  std::vector<StageReport> ready_;
  std::uint64_t revision_ = 0;
  std::uint64_t durable_ = 0;
  std::uint64_t forgotten_ = 0;  ///< highest id of this boot that ended and is not known any more
  Counters counters_;
};

}  // namespace srfs
