// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/cpu_wait.hpp"
#include "base/time.hpp"
#include "ros/lifecycle.hpp"
#include "suite/ring/fault.hpp"
#include "suite/ring/heartbeat_page.hpp"
#include "suite/ring/membership.hpp"

namespace srfs::suite {

/// How patiently a member of the ring watches (RingSettings says what each means).
struct RingPatience {
  /// With a node that runs and cannot be heard.
  static constexpr milliseconds deaf{1500};
  milliseconds period{100};
  int misses = 3;
  milliseconds start_deadline{3000};
  milliseconds work_deadline{2000};
  bool absence_counts_misses = false;
  /// A node that cannot answer for want of a CPU is reported as starved after so long, and each time again.
  static constexpr milliseconds starved{10'000};
  static constexpr milliseconds starved_in_real_time{1000};
};

/// What can be seen of a node without asking it.
struct NodeReading {
  pid_t pid = 0;                  ///< the holder of its instance lock; 0: none
  std::uint32_t incarnation = 0;  ///< of that process; 0: not written yet
  std::optional<HeartbeatPage::Reading> page;
  bool real_time = false;  ///< the deployment gives it a real-time priority
  bool starting = false;   ///< the lock is free, and a process is on the way to it
};

/// A node's answer to a check, as it came.
struct CheckAnswer {
  std::uint64_t nonce = 0;
  std::uint32_t incarnation = 0;
  ros::State state = ros::State::unknown;
  ros::State desired = ros::State::unknown;
  std::uint32_t generation = 0;
  std::uint32_t work_done = 0;
  milliseconds oldest_due{0};  ///< age of the oldest undone work
  std::string_view worker{};   ///< whose job runs longest against its deadline
  milliseconds worker_busy{0};
  milliseconds worker_deadline{0};
  milliseconds own_last_check_age{0};
};

/// What a node's process takes, against its caps; a cap of 0: none.
struct Footprint {
  std::uint64_t memory_octets = 0;
  std::uint64_t memory_cap_octets = 0;
  std::uint64_t descriptors = 0;
  std::uint64_t descriptor_cap = 0;
  std::size_t busy_threads = 0;  ///< that used, or waited for, a CPU all the time since the reading before
  std::size_t busy_threads_cap = 0;  ///< as many as CPUs take them from all others
};

/// What an observer reports of a subject on /liveness. The numbers are on the wire.
enum class LivenessVerdict : std::uint8_t {
  alive = 1,      ///< answered correctly
  miss = 2,       ///< a check went unanswered, and the observer was not at fault
  void_ = 3,      ///< a check that proves nothing
  accused = 4,    ///< a restart is asked for
  outcome = 5,    ///< what became of it
  not_asked = 6,  ///< the subject, our upstream, has not checked us for long
  starved = 7,    ///< it cannot answer for want of a CPU: no fault of its own
};

/// One member's half of the liveness ring (DESIGN section 8): which node to ask when, and what an answer,
/// silence or an exit means. Pure: no clock, no DDS, no file. Time comes in as an argument, what can be seen
/// of a node through the function given; decisions go out as actions. Deterministic and bounded: at most one
/// request, one process and one accusation a member.
class RingMonitor {
 public:
  // Actions. Their names live until the next membership.
  struct Ask {
    std::string_view subject;
    std::uint64_t nonce;
  };
  /// Checks the observer itself, through the wire.
  struct AskSelf {
    std::uint64_t nonce;
  };
  /// Its process is to be waited for, until Unfollow or another Follow: on_exit when it ends, or has ended.
  struct Follow {
    std::string_view subject;
    pid_t pid;
  };
  /// The subject is not watched any more: neither its answers nor its process.
  struct Unwatch {
    std::string_view subject;
  };
  struct Accuse {
    Accusation accusation;
  };
  struct Report {
    std::string_view subject;
    LivenessVerdict verdict = LivenessVerdict::alive;
    std::uint32_t incarnation = 0;  ///< of the subject; 0: not known
    FaultClass fault = FaultClass::none;
    std::optional<RestartOutcome::What> outcome{};
    ros::State state = ros::State::unknown;  ///< as last answered
    std::uint32_t misses = 0;
    nanoseconds answer_age{0};  ///< since the subject's last right answer
    nanoseconds round_trip{0};  ///< of this answer
    std::string detail{};
  };
  /// A node whose restart this observer caused is in its desired state.
  struct Recovered {
    std::string_view subject;
    std::uint32_t incarnation;
    FaultClass fault;
    MonotonicTime at;
    nanoseconds took;  ///< since the first evidence
  };
  /// The subject cannot answer because it gets no CPU. First without a report, so that the caller can measure
  /// what takes the CPUs meanwhile; then each RingPatience::starved with one.
  struct Starved {
    std::string_view subject;
    bool report = false;
    nanoseconds silent_for{0};  ///< since the first check that it did not answer
    nanoseconds waited{0};      ///< of these, runnable without a CPU
  };
  /// Another node knows another generation of the membership.
  struct ReadMembership {};
  /// This node cannot hear itself: it judges no node and is to be restarted.
  struct ExitSelf {};
  using Action = std::variant<Ask, AskSelf, Follow, Unwatch, Accuse, Report, Recovered, Starved,
                              ReadMembership, ExitSelf>;
  using Look = std::function<NodeReading(std::string_view subject)>;
  /// What the process of a subject has had of the CPU; nullopt: the kernel does not report it.
  /// @param doubt  its answers are missing: any_waited is asked for, too
  using LookAtCpu = std::function<std::optional<CpuTotals>(std::string_view subject, pid_t pid, bool doubt)>;

  /// Requests and answers that changed nothing.
  struct Counters {
    std::uint64_t stale_answers = 0;  ///< unknown or old nonce, or from a node not asked
    std::uint64_t wrong_answers = 0;  ///< another incarnation, or an impossible state
    std::uint64_t void_rounds = 0;    ///< this node's own timer was late
    std::uint64_t late_answers = 0;   ///< right, and late for want of a CPU or on a slow machine
    std::uint64_t void_checks = 0;    ///< its check of itself was not answered, or the generations differ
    std::uint64_t failed_self_checks = 0;
  };

  /// @param look, cpu asked only from within calls of this object; without @p cpu all times are the clock's
  /// @param seed makes unpredictable nonces
  RingMonitor(std::string self, RingPatience patience, Membership membership, Look look, std::uint64_t seed,
              MonotonicTime now, LookAtCpu cpu = {});

  RingMonitor(const RingMonitor&) = delete;  // names point into it
  RingMonitor& operator=(const RingMonitor&) = delete;

  /// The timer of the checks, each period. @param late how long after its time it came @param waited of that,
  /// for want of a CPU; the rest this node was stopped, or busy
  void on_period(MonotonicTime now, nanoseconds late, nanoseconds waited = nanoseconds(0));
  /// @param now when it is handled: before it, everything that had come in was handled
  void on_self_answer(std::uint64_t nonce, MonotonicTime now);
  void on_answer(std::string_view subject, const CheckAnswer& answer, MonotonicTime now);
  /// The followed process ended.
  void on_exit(std::string_view subject, pid_t pid, MonotonicTime now);
  /// Some observer checked this node. @param generation of its membership
  void on_asked(std::string_view observer, std::uint32_t generation, MonotonicTime now);
  void on_footprint(std::string_view subject, pid_t pid, const Footprint& footprint, MonotonicTime now);
  /// The process runs a version on probation and was started @p lived ago; called each second. It has to be
  /// in its desired state by the start deadline, whatever reason it gives for not being there.
  void on_trial(std::string_view subject, pid_t pid, nanoseconds lived, MonotonicTime now);
  /// The process runs a version on probation that has failed, however well the process does.
  void on_bad_version(std::string_view subject, pid_t pid, FaultClass fault, std::string detail,
                      MonotonicTime now);
  void on_outcome(std::string_view subject, const RestartOutcome& outcome, MonotonicTime now);
  /// Verdicts of the generation before are void.
  void on_membership(Membership membership, MonotonicTime now);

  /// What is to be done, in order; nullopt: nothing more. To be emptied after each call above.
  [[nodiscard]] std::optional<Action> next_action();

  /// Time since this node last checked another one; zero when there is none to check.
  [[nodiscard]] nanoseconds last_check_age(MonotonicTime now) const;
  /// How long this node was held up (stopped, starved) since then, as its late timers show: ages of its own
  /// work do not count this time. Remembers the last 64 times.
  [[nodiscard]] nanoseconds held_up_since(MonotonicTime since) const;
  /// The same without its waits for a CPU, for ages of what another thread does, which waits or does not.
  [[nodiscard]] nanoseconds stopped_since(MonotonicTime since) const;
  [[nodiscard]] const Membership& membership() const { return membership_; }
  [[nodiscard]] const Counters& counters() const { return counters_; }
  /// The downstream first, in ring order.
  [[nodiscard]] std::vector<std::string_view> watched() const;
  /// The process followed for this subject; 0: none.
  [[nodiscard]] pid_t process_of(std::string_view subject) const;
  /// It answered last in the state it is to be in.
  [[nodiscard]] bool is_as_desired(std::string_view subject) const;

 private:
  struct Asked {
    std::uint64_t nonce;
    MonotonicTime at;
  };
  struct Subject {
    std::string_view name;
    bool downstream = false;  ///< our own, not one behind a silent node
    // The process that is judged.
    pid_t pid = 0;
    std::uint32_t incarnation = 0;
    MonotonicTime first_seen;
    std::optional<MonotonicTime> starting_since;
    bool ended = false;  ///< it has exited
    bool heard = false;  ///< it answered, to us
    bool lost = false;   ///< ended, absent or accused, and has not answered since
    ros::State state = ros::State::unknown;
    ros::State desired = ros::State::unknown;
    MonotonicTime last_answer;
    // The check that is out, and the one before while the check of ourselves is out.
    std::uint64_t nonce = 0;
    std::uint64_t suspected = 0;
    MonotonicTime asked_at;
    MonotonicTime suspected_asked_at;
    MonotonicTime ask_from;
    std::deque<Asked> unanswered;  ///< older ones, of which an answer may come late for want of a CPU
    std::string wrong;             ///< what the answers to the check that is out got wrong
    // Evidence, in a row.
    int misses = 0;
    int wrong_in_row = 0;
    int not_checking_in_row = 0;
    int not_working_in_row = 0;
    int large_in_row = 0;
    int overdue_in_row = 0;
    int busy_in_row = 0;
    MonotonicTime fields_counted;  ///< round of the last answer whose fields count in a row
    std::optional<std::uint32_t> work_done;
    CpuHistory cpu;  ///< of this process
    bool real_time = false;
    std::optional<MonotonicTime> excused_from;  ///< the unanswered checks are explained by want of a CPU
    MonotonicTime next_starved_report;
    std::optional<MonotonicTime> last_excused;  ///< of this process
    std::optional<MonotonicTime> first_evidence;
    // The accusation.
    std::optional<MonotonicTime> accused;  ///< when; until its outcome
    MonotonicTime not_before;              ///< accuse again
    MonotonicTime expected_until;          ///< it is being started
    struct Recovery {
      FaultClass fault = FaultClass::none;
      MonotonicTime since;
      bool started = false;  ///< by us; now it has to come up
      MonotonicTime give_up;
    };
    std::optional<Recovery> recovery;
  };

  [[nodiscard]] nanoseconds tolerance() const;
  bool count_absence(Subject& s, MonotonicTime now);
  [[nodiscard]] bool is_troubled(const Subject& s, MonotonicTime now) const;
  [[nodiscard]] Subject* find(std::string_view name);
  [[nodiscard]] std::uint64_t next_nonce();
  void void_round(MonotonicTime now);
  void skip_round(MonotonicTime now);
  void conclude_round(MonotonicTime now, nanoseconds waited);
  void ask(MonotonicTime now, bool doubt);
  void count_miss(Subject& s, MonotonicTime now);
  void judge_silence(Subject& s, MonotonicTime now);
  void judge_stale_page(Subject& s, MonotonicTime last_turn, MonotonicTime now);
  void judge_cpu(Subject& s, const Footprint& footprint, MonotonicTime now);
  void excuse(Subject& s, MonotonicTime now);
  [[nodiscard]] nanoseconds able_since(const Subject& s, MonotonicTime since, MonotonicTime now,
                                       nanoseconds CpuTotals::*waited) const;
  [[nodiscard]] std::optional<MonotonicTime> find_late_question(Subject& s, std::uint64_t nonce,
                                                                MonotonicTime now);
  void note_cpu(Subject& s, MonotonicTime now);
  void judge_fields(Subject& s, const CheckAnswer& answer, MonotonicTime now);
  /// Reads which process runs; accuses when none does. @return whether the process judged so far still runs
  bool observe(Subject& s, MonotonicTime now);
  void note_recovery(Subject& s, const NodeReading& reading, MonotonicTime now);
  void adopt(Subject& s, pid_t pid, std::uint32_t incarnation, MonotonicTime now);
  static void clear_evidence(Subject& s);
  static void expect_another(Subject& s);
  void accuse(Subject& s, FaultClass fault, MonotonicTime now, std::string detail);
  void report(const Subject& s, LivenessVerdict verdict, MonotonicTime now, std::string detail = {});
  void review_watch(MonotonicTime now);
  Subject& watch(std::string_view name, bool downstream, MonotonicTime now);

  std::string self_;
  RingPatience patience_;
  Membership membership_;
  Membership former_;
  Look look_;
  LookAtCpu cpu_;
  std::uint64_t nonce_state_;
  std::deque<Subject> subjects_;  // watched; at most one a member
  std::deque<Action> actions_;
  MonotonicTime begun_;
  MonotonicTime last_period_;
  MonotonicTime last_void_;
  MonotonicTime last_asked_;
  MonotonicTime last_not_asked_;
  bool not_asked_ = false;
  std::uint64_t self_nonce_ = 0;
  int self_failures_ = 0;  ///< in a row
  MonotonicTime failing_since_;
  std::deque<Asked> asked_self_;  ///< without an answer
  /// How long this node took to hear itself lately (the longest time), on a slow machine; zero: within a
  /// period.
  nanoseconds own_delay_{0};
  MonotonicTime own_delay_at_;
  MonotonicTime misses_counted_;  ///< round in which that was done last for a late answer to itself
  bool exiting_ = false;
  struct HeldUp {
    MonotonicTime until;
    nanoseconds duration;
    nanoseconds waited;  ///< of it, for a CPU
  };
  void count_misses_before(MonotonicTime asked, MonotonicTime now);
  /// Failed checks of itself in a row with which this node takes itself for deaf.
  [[nodiscard]] int self_failures_at_most() const;
  /// @param part  of one time, at most what lies after @p since counts
  [[nodiscard]] nanoseconds sum_since(MonotonicTime since, nanoseconds (*part)(const HeldUp&)) const;
  std::deque<HeldUp> held_up_;
  Counters counters_;
};

}  // namespace srfs::suite
