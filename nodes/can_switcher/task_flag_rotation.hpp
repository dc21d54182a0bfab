// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "base/action_queue.hpp"
#include "base/grant_id.hpp"
#include "base/time.hpp"

namespace srfs {

/// One payload's place in the plan.
struct Slot {
  std::string payload;      ///< empty: the place is free
  nanoseconds allotted{0};  ///< time the payload may plan with
  nanoseconds overrun{0};   ///< tolerated beyond it before the payload must reset its peripheral
  nanoseconds reset{0};     ///< time for that reset; then the lease ends
  [[nodiscard]] nanoseconds lease() const { return allotted + overrun + reset; }
  friend bool operator==(const Slot&, const Slot&) = default;
};

/// CPU use of the holder, as the kernel reports it, since its grant or since its recall: of its work thread
/// and of the middleware's threads, which may hold a lock that the work thread needs.
struct HolderCpu {
  nanoseconds waited{0};  ///< one of them: ready to run, without a CPU
  nanoseconds ran{0};     ///< the work thread
  bool runnable = false;  ///< now: one of them runs, or waits
  /// The process that plays a simulated bus: ready to run, without a CPU. The holder's frames do not leave.
  nanoseconds bus_waited{0};
};

// What the rotation decides; carried out by the adapter in the given order.

/// Publish the flag of this payload.
struct Grant {
  GrantId id;
  std::size_t slot = 0;  ///< index in the configured order
  std::string payload;
  MissionCycle cycle = 0;
  MonotonicTime received;  ///< the tick's receipt; for an early grant, that of the previous release
  MonotonicTime granted;
  MonotonicTime lease_end;  ///< never renewed
  nanoseconds allotted{0};
};
/// Send PeripheralReset to the holder.
struct OrderReset {
  GrantId id;
  std::string payload;
  nanoseconds held{0};
};
/// The lease ended without release. Kill the holder's process, wait until it is gone and none of its frames
/// waits to be sent, then call on_fenced(). Until then nothing is granted.
struct Fence {
  GrantId id;
  std::string payload;
  std::optional<std::uint32_t> process;  ///< holder's incarnation, if known: spare a later one
  std::optional<HolderCpu> cpu;          ///< on which it was judged
};

/// Publish a flag without holder under this id. The payload gives up its earlier grant and reports RELEASED
/// with this id. Until then nothing is granted.
struct Recall {
  GrantId id;
  std::string payload;
  MonotonicTime received;  ///< the tick's receipt; at a deadline, that one's time
};
/// Why the holder is not accused at the end of its lease, for the log. Once for each such end.
struct ReportDoubt {
  enum class Why : std::uint8_t {
    starved,  ///< it had no CPU to release the bus
    deaf,     ///< this process had no input
    held_up,  ///< this process was deaf or late itself, and asks first
  };
  Why why = Why::starved;
  std::string payload;
};

using RotationAction = std::variant<Grant, OrderReset, Fence, Recall, ReportDoubt>;
using RotationActions = ActionList<RotationAction, 2>;

/// A grant that was not monitored since: the switcher was killed, or unconfigured. Past its lease a holder
/// refuses to write. But a holder that was stopped between that check and the write still writes when it
/// continues.
struct InheritedGrant {
  std::string payload;
  /// Incarnation of the payload's running process; nullopt: it is gone. Its frames may still wait to be sent.
  std::optional<std::uint32_t> process;
};

/// What a payload reports on /can/bus_status.
struct BusReport {
  enum class Kind : std::uint8_t { taken = 1, released = 2, failed = 3 };
  Kind kind = Kind::taken;
  GrantId grant;
  std::string payload;
  std::uint32_t payload_incarnation = 0;
  bool unused = false;  ///< released without a single frame: the payload had nothing to send
};

enum class ReportVerdict : std::uint8_t {
  applied,
  greeting,   ///< grant {0,0}: the payload is there (or leaves) and holds nothing
  duplicate,  ///< says what is known already
  old_grant,
  foreign,  ///< unknown payload, another's grant, another process of the payload, or a grant never given
};

/// The flag rotation (paper section IV.A, Figs. 4-6; DESIGN section 5). At most one payload holds the bus,
/// ever. The next flag is given only after the holder released or was fenced. A holder that never took the
/// bus and never reported cannot have written; then the end of its lease is enough. Pure; one thread.
class TaskFlagRotation {
 public:
  /// @param slots        rotation order, at least one payload; the indices are the flags' positions
  /// @param incarnation  of this switcher process, higher than any before it
  /// @param now          nothing is granted before now + the longest lease: an earlier switcher may have
  /// granted until now
  /// @param inherited  as for inherit()
  TaskFlagRotation(std::vector<Slot> slots, std::uint32_t incarnation, MonotonicTime now,
                   const std::optional<InheritedGrant>& inherited = {});

  /// A tick that TickHoldover believed, or made.
  /// @param received  when the tick arrived, before now if it had to wait
  /// @return Grant or Recall; nothing: the holder keeps the bus (the paper's Fig. 14b), leases of an earlier
  /// switcher or the guard time after a fence may still run, suspended, or a tick from before resume()
  [[nodiscard]] RotationActions on_tick(MonotonicTime now, MissionCycle cycle, MonotonicTime received);
  /// What is due of OrderReset, Fence, Recall and ReportDoubt. Call it at next_deadline(); harmless at any
  /// other time.
  /// @param last_heard  last input of any kind from the network; a switcher that hears nothing blames no
  /// payload
  /// @param holder      nullopt: not known, so only the clock counts
  [[nodiscard]] RotationActions on_deadline(MonotonicTime now, MonotonicTime last_heard,
                                            const std::optional<HolderCpu>& holder = std::nullopt);
  [[nodiscard]] RotationActions on_deadline(MonotonicTime now) { return on_deadline(now, now); }
  ReportVerdict on_bus_status(const BusReport& report, MonotonicTime now);
  /// The next grant if the last report left a slot unused and early hand-over is on, else nothing. Serves the
  /// rest of the round until the next tick, every payload at most once a tick. Call it after each report.
  [[nodiscard]] RotationActions on_early_release(MonotonicTime now);
  /// The flag of this grant was not published because this process was too late. No payload can have taken
  /// the bus.
  void withdraw(GrantId id);
  /// The answer to Fence: the process is gone, and all its frames were sent or taken back. Until then the bus
  /// stays blocked, however long that takes: a live process may write, a non-empty queue may send.
  void on_fenced(GrantId id, MonotonicTime now);
  /// Another wait ended without this proof.
  void on_fence_unproven() { ++counters_.unproven_fences; }
  /// Takes over a grant that was not monitored since. From the next tick on it is recalled, under a new id; a
  /// holder that does not answer in time is fenced. If its process is gone, on_fenced() is awaited at once.
  void inherit(const InheritedGrant& granted, MonotonicTime now);
  /// No earlier grant is known, but frames may still wait to be sent: the suite was killed and started anew,
  /// or the record is gone. The bus stays blocked until on_fenced() of current().
  void await_empty_queue(MonotonicTime now);
  /// A grant is out that still awaits a report of its end: not released, not recalled, not fenced.
  [[nodiscard]] bool awaits_release() const {
    return phase_ == Phase::granted || phase_ == Phase::taken || phase_ == Phase::reset_ordered;
  }
  [[nodiscard]] bool awaits_fence() const { return phase_ == Phase::fencing; }

  /// When on_deadline() has something to do; nullopt: nothing before the next tick or report.
  [[nodiscard]] std::optional<MonotonicTime> next_deadline() const;

  /// An unused slot is passed on at once, not at the next tick. Initially off.
  void set_early_handover(bool on) { early_handover_ = on; }
  /// From the next grant on the rotation goes through these payloads in this order; a payload left out gets
  /// no slot. A running slot is finished. The flags keep their positions.
  /// @return false: the list is empty, has a payload twice or one outside the plan; nothing was changed
  bool set_order(const std::vector<std::string>& payloads);
  /// Payloads joined or left. From the next grant on the rotation goes through @p order, payloads of @p
  /// slots. It starts after the last holder, so that no payload loses a turn. A payload in both plans keeps
  /// its place. A running slot is finished, overrun or fenced by its old plan.
  /// @return false: the running slot's place changes, so the plan must wait for that slot's end: call again
  /// then
  bool set_plan(const std::vector<Slot>& slots, const std::vector<std::string>& order);
  /// Grants nothing until resume(); a running slot is finished or fenced as usual. A holder that was asked is
  /// asked again after resume(), with all patience.
  void suspend() {
    suspended_ = true;
    recalled_ = false;  // no recall is out now, so no answer is late
    if (phase_ != Phase::recalling) return;
    starved_end_.reset();
    starved_since_.reset();
  }
  /// @param now  ticks received before grant nothing: their slot is partly over, its flag would come late
  void resume(MonotonicTime now) {
    suspended_ = false;
    resumed_ = now;
  }

  /// How long a recalled payload may take to answer, from the first Recall on.
  void set_recall_time(nanoseconds time) { recall_time_ = time; }

  [[nodiscard]] const std::optional<Grant>& current() const { return current_; }
  /// The payload that may write now, as far as this process knows; for its successor.
  struct Holder {
    std::size_t slot = 0;
    std::uint32_t process = 0;  ///< 0: not known
  };
  [[nodiscard]] std::optional<Holder> holder() const;
  [[nodiscard]] const std::vector<Slot>& slots() const { return slots_; }
  /// The payloads in the order of their turns.
  [[nodiscard]] std::vector<std::string> turns() const;

  struct SlotCounters {
    std::uint32_t granted = 0;
    std::uint32_t released = 0;
    std::uint32_t failed = 0;     ///< released, but the peripheral did not do its part
    std::uint32_t not_taken = 0;  ///< lease ended without a report
    std::uint32_t overruns = 0;   ///< PeripheralReset ordered
    std::uint32_t fences = 0;
    std::uint32_t unused = 0;  ///< released without a frame; part of released
  };
  struct Counters {
    std::uint32_t ticks = 0;
    std::uint32_t blocked_ticks = 0;
    std::uint32_t waiting_ticks = 0;
    std::uint32_t idle_ticks = 0;  ///< suspended, or a tick from before resume()
    std::uint32_t duplicate_reports = 0;
    std::uint32_t old_reports = 0;
    std::uint32_t foreign_reports = 0;
    std::uint32_t early_grants = 0;     ///< passed on before the next tick
    std::uint32_t unproven_fences = 0;  ///< waits for a fenced holder's end that brought no proof
    std::uint32_t late_deadlines = 0;   ///< ends of leases handled so late that the holder was asked first
    std::uint32_t deaf_deadlines = 0;   ///< ends of leases at which this process had no input
    std::uint32_t withdrawn = 0;        ///< grants whose flag was not published
    std::uint32_t starved_holders = 0;  ///< ends of leases whose holder had no CPU to release the bus
  };
  [[nodiscard]] const SlotCounters& slot_counters(std::size_t slot) const { return slot_counters_[slot]; }
  [[nodiscard]] const Counters& counters() const { return counters_; }

  /// After a fence or a recall: frames that were handed to the controller are gone by then (16 frames at 500
  /// kbit/s).
  static constexpr nanoseconds guard_time = milliseconds(5);
  /// Later than this after the end of a lease this process was held up itself.
  static constexpr nanoseconds held_up_limit = milliseconds(50);
  static constexpr nanoseconds held_up_recall_time = milliseconds(500);
  /// A recall is repeated with each tick for so long, then with a pause.
  static constexpr nanoseconds recalled_often = seconds(1);
  static constexpr nanoseconds recall_pause = milliseconds(500);
  /// This long without any input (a tick, a report, an acknowledgement) at the end of a lease is deafness:
  /// the release may have been missed. The bus stays blocked until something is heard, then the holder is
  /// asked. After the patience, in which the ring replaces a deaf switcher, the holder is fenced as usual.
  static constexpr nanoseconds deaf_limit = milliseconds(30);
  static constexpr nanoseconds deaf_patience = seconds(2);
  static constexpr nanoseconds deaf_look = milliseconds(20);
  /// A holder that waited for a CPU instead of releasing is recalled. If it also waits for a CPU then, it is
  /// killed only after it could run for so many lengths of its lease, or after the patience, in which
  /// the ring finds who takes the CPUs. One length would be too little: the end of a wait shows a look later,
  /// and it may sleep for a lock whose owner has no CPU. Its lease is over all the same: its handle refuses
  /// to write.
  static constexpr nanoseconds starved_patience = seconds(10);
  static constexpr int starved_leases = 16;
  static constexpr nanoseconds starved_look = milliseconds(25);

 private:
  enum class Phase : std::uint8_t { free, granted, taken, reset_ordered, fencing, recalling };

  /// Nothing came in around the end of the lease; it is checked again a little later.
  [[nodiscard]] bool waits_to_hear(MonotonicTime now, MonotonicTime last_heard, RotationActions& actions);
  /// Of a holder whose lease is over, by the time in which it had a CPU.
  enum class HolderVerdict : std::uint8_t { could_run, starved, may_starve };
  [[nodiscard]] HolderVerdict judge(MonotonicTime now, const HolderCpu& holder, RotationActions& actions);
  void ask_starved_holder(MonotonicTime now, RotationActions& actions);
  Recall ask(std::uint32_t process, MonotonicTime now, nanoseconds time);
  RotationActions grant_next(MonotonicTime now, MissionCycle cycle, MonotonicTime received);
  Grant grant(MonotonicTime now, MissionCycle cycle, MonotonicTime received);
  [[nodiscard]] std::optional<std::size_t> slot_of(const std::string& payload) const;
  /// Its incarnation; nullopt: it has not reported yet.
  [[nodiscard]] std::optional<std::uint32_t> process_of_holder() const {
    return holder_process_ ? holder_process_ : known_process_[current_->slot];
  }
  ReportVerdict on_current_report(const BusReport& report, MonotonicTime now);
  ReportVerdict count(ReportVerdict verdict);
  void end_lease(MonotonicTime now, const std::optional<HolderCpu>& holder, RotationActions& actions);
  RotationActions recall(MonotonicTime now, MonotonicTime received);
  ReportVerdict on_recall_answer(const BusReport& report, MonotonicTime now);
  void free_bus() {
    phase_ = Phase::free;
    deaf_since_.reset();
    starved_end_.reset();
    starved_since_.reset();
  }

  std::vector<Slot> slots_;
  std::vector<std::size_t> order_;  ///< indices of slots_, never empty
  /// The process of each payload that has reported: it is up and matched, so its silence is a failure, not a
  /// start.
  std::vector<std::optional<std::uint32_t>> known_process_;
  std::vector<SlotCounters> slot_counters_;
  std::uint32_t incarnation_;
  std::uint32_t next_counter_ = 1;
  std::size_t next_place_ = 0;  ///< in order_
  bool early_handover_ = false;
  bool slot_left_unused_ = false;    ///< by the last report
  std::vector<bool> had_this_tick_;  ///< by slot
  Phase phase_ = Phase::free;
  bool suspended_ = false;
  std::optional<MonotonicTime> resumed_;
  std::optional<Grant> current_;  ///< the last grant, also after its release
  std::optional<std::uint32_t> holder_process_;
  MonotonicTime not_before_;
  nanoseconds recall_time_ = seconds(3);
  std::optional<MonotonicTime> deaf_since_;   ///< the end of this lease came, and nothing is heard
  std::optional<MonotonicTime> starved_end_;  ///< the lease ended then, and its holder had no CPU to release
  std::optional<MonotonicTime> starved_since_;  ///< the first such end since the grant, recalls included
  bool recalled_ = false;                       ///< a Recall was given out: its time runs
  MonotonicTime recalled_first_;                ///< then
  MonotonicTime recalled_last_;
  MissionCycle last_cycle_ = 0;
  Counters counters_;
};

}  // namespace srfs
