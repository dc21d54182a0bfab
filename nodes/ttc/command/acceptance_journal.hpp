// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "nodes/ttc/command/journal_log.hpp"
#include "nodes/ttc/command/telecommand.hpp"
#include "nodes/ttc/link/link_state.hpp"
#include "nodes/ttc/link/uplink_chain.hpp"
#include "nodes/ttc/report/report_queue.hpp"
#include "nodes/ttc/services/time_schedule.hpp"

namespace srfs {

/// An accepted telecommand and what is known of it.
struct AcceptedTelecommand {
  TelecommandOrigin origin = {};  ///< with its id
  UplinkFrame frame = {};
  MonotonicTime accepted_at = {};  ///< of another boot: when it was restored
  MonotonicTime expiry = {};
  std::string target = {};     ///< node that executes it
  std::uint64_t activity = 0;  ///< of the schedule, which released it; 0: it came in a frame
  std::uint32_t packet_crc = 0;
  std::uint16_t packet_octets = 0;
  Octets packet = {};  ///< kept until the end
  TelecommandProgress progress = {};
  bool restored = false;  ///< accepted by an earlier process
  bool reported = false;  ///< 1,1 was reported
  bool end_said = false;  ///< its end was reported, or its report was not wanted
  std::optional<StageReached> end = {};
  // Serials of what must be reported to the ground.
  std::uint64_t accepted_serial = 0;
  std::uint64_t started_serial = 0;
  std::uint64_t ended_serial = 0;
  std::optional<MonotonicTime> told_again_at = {};  ///< a repeat was answered
  std::optional<MonotonicTime> repeated_at = {};    ///< on a channel without security
};

/// A telecommand that was refused, as it was or is to be reported.
struct RefusedTelecommand {
  TelecommandOrigin origin;
  StageReached end{.success = false};
  std::uint64_t serial = 0;
  bool said = false;
};

/// What is to be written: a whole state, or changes to the one before.
struct JournalBatch {
  std::optional<Octets> snapshot;
  std::vector<JournalRecord> records;
  bool sync = false;
  std::uint64_t revision = 0;  ///< the journal's when this is written
  LinkState link;              ///< the journal's when this is written
};

struct AcceptanceJournalCounters {
  std::uint64_t accepted = 0;
  std::uint64_t restored = 0;    ///< not ended when the process before did
  std::uint64_t repeats = 0;     ///< telecommands that were known: reported again, not executed
  std::uint64_t unanswered = 0;  ///< of them, those that came within repeat_answer_period
  std::uint64_t refused = 0;
  std::uint64_t forgotten = 0;  ///< ended ones whose outcome had to make room
  std::uint64_t written_octets = 0;
  std::uint64_t syncs = 0;
  std::uint64_t snapshots = 0;
  std::uint64_t failed_writes = 0;
};

/// The accepted telecommands, from 1,1 until their end is reported to the ground, and the link state that
/// must be kept with them. One record holds the packet, its id, the SDLS counters and the FARM states, so
/// that one sync makes a telecommand and its anti-replay state durable. Recognises repeats and keeps their
/// outcome. The time-based schedule is part of it: one record removes an activity and accepts its request. A
/// refusal is a record like an acceptance, and is kept until it is reported to the ground.
///
/// Pure: apply() takes what was found on disk, take_batch() gives what must be written, on_written() reports
/// the result. Open telecommands are never forgotten (has_room() refuses first); of the ended ones the newest
/// max_ended are kept, of unreported refusals the newest max_refused.
class AcceptanceJournal {
 public:
  static constexpr std::size_t max_open = 256;
  static constexpr std::size_t max_ended = 256;
  static constexpr std::size_t max_refused = 256;
  static constexpr std::size_t max_end_data = 64;
  /// A telecommand that is repeated faster is reported again only once in this period. On a channel without
  /// security, where a repeat needs no key, the same packet is a repeat within this time of the last one.
  static constexpr milliseconds repeat_answer_period{1000};
  /// Changes not written yet; more (the disk hangs) are replaced by one snapshot.
  static constexpr std::size_t max_pending_octets = 64U << 10;
  /// A segment that is fuller is followed by the next one.
  static constexpr std::size_t usual_fill_octets = 384U << 10;

  /// @param boot_id       of this boot: monotonic times of another boot mean nothing
  /// @param repeat_window in which the same packet on a secured channel is a repeat
  AcceptanceJournal(std::string boot_id, milliseconds repeat_window,
                    std::size_t fill_octets = usual_fill_octets)
      : boot_id_(std::move(boot_id)), repeat_window_(repeat_window), fill_octets_(fill_octets) {}

  void set_repeat_window(milliseconds window) { repeat_window_ = window; }

  // ---- start: apply() in the order of the records, then begin() once

  /// @return false: not a record of this version (counted by the caller as damage)
  bool apply(const JournalRecord& record);
  /// @param older  the second home of the link state; of the two the newer one holds
  /// @param first_id floor of the next id
  void begin(const LinkState& older, std::uint64_t first_id, MonotonicTime now);
  [[nodiscard]] const LinkState& link() const { return link_; }
  [[nodiscard]] std::uint64_t next_id() const { return next_id_; }
  /// In the order of their acceptance.
  [[nodiscard]] std::vector<const AcceptedTelecommand*> known() const;
  /// A whole state was found: this is no first start.
  [[nodiscard]] bool has_state() const { return has_state_; }

  // ---- telecommands

  [[nodiscard]] bool has_room() const { return open_ < max_open; }
  /// @param uplinked  its packet, with the link state that has the counters of its frame. @param activity
  /// whose request it is; it leaves the schedule. @return its id
  std::uint64_t accept(const Telecommand& telecommand, const UplinkedPacket& uplinked, MonotonicTime now,
                       std::uint64_t activity = 0);
  /// It was refused. @param link holds the counters of its frame. @return its serial
  std::uint64_t refuse(const TelecommandOrigin& origin, const StageReached& end, const LinkState& link);
  /// Those that the ground may not know of, in the order of their refusal.
  [[nodiscard]] const std::deque<RefusedTelecommand>& refused() const { return refused_; }
  /// The link state changed without a telecommand. It is written, and synced with what comes next.
  void on_link(const LinkState& link);
  void on_taken(std::uint64_t id);
  /// What was reported of it. A failed acceptance: it was refused after all and must not come back from the
  /// disk.
  void on_stage(const StageReached& stage);

  /// The accepted telecommand that is repeated by a frame the link refused: same association and counter, or
  /// same N(S) and packet on its channel.
  [[nodiscard]] const AcceptedTelecommand* find_repeated_frame(const UplinkedPacket& uplinked);
  /// The accepted telecommand that is repeated by a packet in a new frame.
  [[nodiscard]] const AcceptedTelecommand* find_repeated_packet(const UplinkedPacket& uplinked,
                                                                MonotonicTime now);
  /// Reports again how far a repeated telecommand got: at once, but not twice in repeat_answer_period.
  void answer_repeat(const AcceptedTelecommand& telecommand, MonotonicTime now, ReportQueue& report_queue);

  // ---- schedule

  [[nodiscard]] const TimeSchedule& schedule() const { return schedule_; }
  /// @return the revision that has the change on disk
  std::uint64_t change_schedule(const ScheduleChange& change);

  // ---- what was reported to the ground

  /// Rises with each acceptance, refusal, start and end.
  [[nodiscard]] std::uint64_t serial() const { return serial_; }
  /// Up to this serial everything was reported; later reports may still wait for the disk.
  [[nodiscard]] std::uint64_t said() const;
  void on_refusal_said(std::uint64_t serial);
  void on_end_said(std::uint64_t id);
  /// Up to this serial everything was sent and stored; what came later is reported again after a restart.
  void on_told(std::uint64_t serial);
  [[nodiscard]] std::uint64_t told() const { return told_; }
  /// Reports again how far @p telecommand got, but only what came after serial @p told.
  /// @param stored these reports may not be in the packet store yet
  static void tell_again(const AcceptedTelecommand& telecommand, std::uint64_t told,
                         ReportQueue& report_queue, bool stored = true);
  /// Reports again the refusals of an earlier process that the ground may not know of.
  void tell_refused_again(ReportQueue& report_queue);

  // ---- writing: one batch at a time

  /// Rises with each change that must be on disk before a telecommand is executed.
  [[nodiscard]] std::uint64_t revision() const { return revision_; }
  [[nodiscard]] bool wants_write() const { return !writing_ && (snapshot_wanted_ || !pending_.empty()); }
  [[nodiscard]] bool wants_sync() const { return unsynced_; }
  /// Everything up to now is written, synced or not: a kill of the process loses none of it.
  [[nodiscard]] bool is_written() const { return !writing_ && !snapshot_wanted_ && pending_.empty(); }
  [[nodiscard]] JournalBatch take_batch(bool sync);
  /// @param used_octets of the segment. After a failure the next batch is a snapshot.
  void on_written(const JournalBatch& batch, bool success, std::size_t used_octets);

  [[nodiscard]] std::size_t open() const { return open_; }
  [[nodiscard]] const AcceptanceJournalCounters& counters() const { return counters_; }

 private:
  using Entries = std::map<std::uint64_t, AcceptedTelecommand>;
  void add(std::uint8_t kind, OctetWriter&& payload);
  /// @param id of the accepted telecommand that was refused after all; 0: it was not accepted
  void add_refusal(std::uint64_t id, RefusedTelecommand refused);
  void keep_refused(RefusedTelecommand refused);
  void leave_schedule(std::uint64_t activity);
  void end(AcceptedTelecommand& entry, StageReached end);
  void forget_oldest();
  [[nodiscard]] Octets encode_snapshot() const;
  bool apply_snapshot(OctetReader& reader);
  bool apply_change(std::uint8_t kind, OctetReader& reader);
  AcceptedTelecommand* find(std::uint64_t id);

  std::string boot_id_;
  milliseconds repeat_window_;
  std::size_t fill_octets_;
  Entries entries_;                  ///< by id
  std::deque<std::uint64_t> ended_;  ///< oldest first
  std::deque<RefusedTelecommand> refused_;
  std::size_t open_ = 0;
  LinkState link_;
  TimeSchedule schedule_;
  std::uint64_t next_id_ = 1;
  std::uint64_t serial_ = 0;
  std::uint64_t told_ = 0;
  std::uint64_t revision_ = 0;
  bool applied_same_boot_ = false;  ///< of the records applied last
  bool has_state_ = false;
  std::vector<JournalRecord> pending_;
  std::size_t pending_octets_ = 0;
  bool snapshot_wanted_ = true;  ///< each process begins a segment: damage does not stay
  bool writing_ = false;
  bool unsynced_ = false;
  AcceptanceJournalCounters counters_;
};

}  // namespace srfs
