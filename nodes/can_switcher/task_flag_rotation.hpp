#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "base/grant_id.hpp"
#include "base/time.hpp"

namespace srfs {

/// One payload's place in the plan.
struct Slot {
  std::string payload;      ///< empty: the place is free
  nanoseconds allotted{0};  ///< time the payload may plan with
  nanoseconds overrun{0};   ///< tolerated beyond it before the payload is told to reset its peripheral
  nanoseconds reset{0};     ///< time for that reset; then the lease ends
  [[nodiscard]] nanoseconds lease() const { return allotted + overrun + reset; }
  friend bool operator==(const Slot&, const Slot&) = default;
};

// What the rotation decides.

struct Nothing {
  friend bool operator==(Nothing, Nothing) = default;
};
/// Publish the flag of this payload.
struct Grant {
  GrantId id;
  std::size_t slot = 0;  ///< index in the configured order
  std::string payload;
  MissionCycle cycle = 0;
  MonotonicTime granted;    ///< the tick's receipt; of an early grant, that of the release before
  MonotonicTime lease_end;  ///< never renewed
  nanoseconds allotted{0};
};
/// No flag on this tick: the holder keeps the bus (the paper's Fig. 14b).
struct Blocked {
  std::string holder;
  nanoseconds held{0};
};
/// No flag on this tick: leases of an earlier switcher, or the guard time after a fence, may still run.
struct WaitingOut {
  MonotonicTime until;
};
/// Send PeripheralReset to the holder.
struct OrderReset {
  GrantId id;
  std::string payload;
  nanoseconds held{0};
};
/// The lease ended without release. Kill the holder's process, wait until it is gone and nothing of it waits
/// to be sent, then call on_fenced(). Until then nobody is granted.
struct Fence {
  GrantId id;
  std::string payload;
  std::optional<std::uint32_t> process;  ///< incarnation of the holder where known: a later one is innocent
};

/// Publish a flag of nobody under this id: the payload gives up what it was granted before, and says so with
/// RELEASED of this id. Until then nobody is granted.
struct Recall {
  GrantId id;
  std::string payload;
};

/// What the kernel says of the holder's work thread since its grant, or since it was asked to give the bus
/// back.
struct HolderCpu {
  nanoseconds waited{0};  ///< ready to run, without a CPU
  nanoseconds ran{0};
  bool runnable = false;  ///< now: it runs, or waits
};

using Decision = std::variant<Nothing, Grant, Blocked, WaitingOut, OrderReset, Fence, Recall>;

/// What was granted and not watched since: the switcher was killed, or unconfigured. Past its lease a holder
/// refuses to write, but one that was stopped between that check and the write would still do it when it goes
/// on.
struct InheritedGrant {
  std::string payload;
  /// Incarnation of the payload's process, which runs; nullopt: it is gone. What it wrote may still wait to
  /// be sent.
  std::optional<std::uint32_t> process;
};

/// What a payload says on /can/bus_status.
struct BusReport {
  enum class Kind : std::uint8_t { taken = 1, released = 2, failed = 3 };
  Kind kind = Kind::taken;
  GrantId grant;
  std::string payload;
  std::uint32_t payload_incarnation = 0;
  bool unused = false;  ///< released without a single frame: the payload had nothing to say
};

enum class ReportVerdict : std::uint8_t {
  applied,
  greeting,   ///< grant {0,0}: the payload is there (or leaves) and holds nothing
  duplicate,  ///< says what is known already
  old_grant,
  foreign,  ///< unknown payload, another's grant, another process of the payload, or a grant never given
};

/// The flag rotation (paper section IV.A, Figs. 4-6; DESIGN section 5). At most one payload holds the bus,
/// ever: the next flag is given only after the holder released, was fenced, or - when it never took the bus
/// and never spoke, so that it cannot have written - its lease ended. Pure; one thread.
class TaskFlagRotation {
 public:
  /// @param slots        rotation order, with a payload at least; the indices are the flags' positions
  /// @param incarnation  of this switcher process, higher than any before it
  /// @param now          nothing is granted before now + the longest lease: an earlier switcher may have
  /// granted until now
  /// @param inherited  as for inherit()
  TaskFlagRotation(std::vector<Slot> slots, std::uint32_t incarnation, MonotonicTime now,
                   const std::optional<InheritedGrant>& inherited = {});

  /// A tick that TickFlywheel believed, or made.
  /// @param received  when the tick arrived, before now if it had to wait
  /// @return Grant, Blocked, WaitingOut, Recall, or Nothing (suspended, a tick from before resume())
  [[nodiscard]] Decision on_tick(MonotonicTime now, MissionCycle cycle, MonotonicTime received);
  /// @return OrderReset or Fence when due, else Nothing. To call at next_deadline(); harmless at any other
  /// time.
  /// @param last_heard  when anything came in by the network; a switcher that hears nobody accuses nobody
  /// @param holder      nullopt: not known, so the clock alone counts
  [[nodiscard]] Decision on_deadline(MonotonicTime now, MonotonicTime last_heard,
                                     const std::optional<HolderCpu>& holder = std::nullopt);
  [[nodiscard]] Decision on_deadline(MonotonicTime now) { return on_deadline(now, now); }
  ReportVerdict on_bus_status(const BusReport& report, MonotonicTime now);
  /// The next grant where the last report left a slot unused and early hand-over is on, else Nothing: the
  /// rest of the round until the next tick, every payload at most once a tick. To call after each report.
  [[nodiscard]] Decision on_early_release(MonotonicTime now);
  /// The flag of this grant was not published: this process came to it too late. Nobody can have taken the
  /// bus.
  void withdraw(GrantId id);
  /// The answer to Fence: the process is gone, and all it wrote has left or was taken back. Until then the
  /// bus stays blocked, however long that takes: a process that lives may write, a queue that is not empty
  /// may send.
  void on_fenced(GrantId id, MonotonicTime now);
  /// That is not known after another wait.
  void on_fence_unproven() { ++counters_.unproven_fences; }
  /// Takes over a grant that nobody watched since. It is asked back from the next tick on, under a new id;
  /// who does not answer in time is fenced. Of a process that is gone, on_fenced() is awaited at once.
  void inherit(const InheritedGrant& granted, MonotonicTime now);
  /// Nobody knows of a grant from before, but of frames nobody knows either: a suite that was killed and
  /// started anew, a record that is gone. Blocked until on_fenced() of current().
  void await_empty_queue(MonotonicTime now);
  /// A grant is out whose end can only be heard: not released, not recalled, not fenced.
  [[nodiscard]] bool awaits_release() const {
    return phase_ == Phase::granted || phase_ == Phase::taken || phase_ == Phase::reset_ordered;
  }
  [[nodiscard]] bool awaits_fence() const { return phase_ == Phase::fencing; }

  /// When on_deadline() has something to do; nullopt: nothing before the next tick or report.
  [[nodiscard]] std::optional<MonotonicTime> next_deadline() const;

  /// A slot that was not used is given on at once, not at the next tick. Off at first.
  void set_early_handover(bool on) { early_handover_ = on; }
  /// The rotation goes through these payloads in this order from the next grant on; who is left out gets no
  /// slot. A running slot is finished. The flags keep their positions.
  /// @return false: not a list of different payloads of the plan, or an empty one; nothing was changed
  bool set_order(const std::vector<std::string>& payloads);
  /// Payloads joined or left: from the next grant on the rotation goes through @p order, which are payloads
  /// of
  /// @p slots, behind who had the bus last, so that nobody loses a turn. Who has a place in both plans keeps
  /// it. A running slot is finished, overrun or fenced by its old plan.
  /// @return false: that slot's place changes, and the change waits for its end: call it again then
  bool set_plan(const std::vector<Slot>& slots, const std::vector<std::string>& order);
  /// Grants nothing until resume(); a running slot is finished or fenced as ever.
  void suspend() {
    suspended_ = true;
    recalled_ = false;  // nobody is asked now, so nobody is late with an answer
  }
  /// @param now  ticks received before grant nothing: their slot is partly over, its flag would come late
  void resume(MonotonicTime now) {
    suspended_ = false;
    resumed_ = now;
  }

  /// How long a recalled payload may take to answer, from the first Recall on.
  void set_recall_time(nanoseconds time) { recall_time_ = time; }

  [[nodiscard]] const std::optional<Grant>& current() const { return current_; }
  /// Who may write now, as far as is known here; for a successor of this process.
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
    std::uint32_t not_taken = 0;  ///< lease ended without a word
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
    std::uint32_t early_grants = 0;     ///< given on before the next tick
    std::uint32_t unproven_fences = 0;  ///< waits for the end of a fenced holder that ended without it
    std::uint32_t late_deadlines = 0;   ///< ends of leases this process came to so late that it asked first
    std::uint32_t deaf_deadlines = 0;   ///< ends of leases at which this process heard nobody
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
  /// So long without any input at the end of a lease (a tick, a report, an acknowledgement) is deafness: the
  /// release may have been missed. Until something is heard the bus stays blocked, then the holder is asked;
  /// but after the patience, in which the ring replaces a deaf switcher, it is fenced as ever.
  static constexpr nanoseconds deaf_limit = milliseconds(30);
  static constexpr nanoseconds deaf_patience = seconds(2);
  static constexpr nanoseconds deaf_look = milliseconds(20);
  /// A holder that waited for a CPU instead of releasing is not killed for that before it had the length of
  /// its lease to run, or the patience has passed. Its lease is over all the same: its handle refuses to
  /// write.
  static constexpr nanoseconds starved_patience = seconds(2);
  static constexpr nanoseconds starved_look = milliseconds(25);

 private:
  enum class Phase : std::uint8_t { free, granted, taken, reset_ordered, fencing, recalling };

  /// Nothing came in around the end of the lease; it is looked at again a little later.
  [[nodiscard]] bool waits_to_hear(MonotonicTime now, MonotonicTime last_heard);
  [[nodiscard]] bool waits_for_starved_holder(MonotonicTime now, const HolderCpu& holder);
  Decision grant_next(MonotonicTime now, MissionCycle cycle, MonotonicTime received);
  Grant grant(MonotonicTime now, MissionCycle cycle);
  [[nodiscard]] std::optional<std::size_t> slot_of(const std::string& payload) const;
  ReportVerdict on_current_report(const BusReport& report, MonotonicTime now);
  ReportVerdict count(ReportVerdict verdict);
  Decision end_of_lease(MonotonicTime now);
  Recall recall(MonotonicTime now);
  ReportVerdict on_recall_answer(const BusReport& report, MonotonicTime now);
  void free_bus() {
    phase_ = Phase::free;
    deaf_since_.reset();
    starved_end_.reset();
  }

  std::vector<Slot> slots_;
  std::vector<std::size_t> order_;  ///< indices of slots_, never empty
  /// The process of each payload that has spoken: it is up and matched, so its silence is a failure, not a
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
  bool recalled_ = false;                     ///< a Recall was given out: its time runs
  MissionCycle last_cycle_ = 0;
  Counters counters_;
};

}  // namespace srfs
