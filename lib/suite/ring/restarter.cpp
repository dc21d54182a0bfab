// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/ring/restarter.hpp"

#include <array>
#include <cerrno>
#include <condition_variable>
#include <csignal>
#include <deque>
#include <mutex>
#include <thread>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/file.h>
#include <unistd.h>

#include "base/background.hpp"
#include "base/cpu_users.hpp"
#include "base/file.hpp"
#include "base/log.hpp"
#include "base/private_file.hpp"
#include "suite/crash_report.hpp"
#include "suite/node_versions.hpp"
#include "suite/ring/heartbeat_page.hpp"
#include "suite/ring/node_record.hpp"
#include "suite/ring/process_cpu.hpp"

namespace srfs::suite {
namespace {

using What = RestartOutcome::What;

constexpr std::size_t most_waiting_records = 32;
constexpr milliseconds longest_flush{2000};
constexpr milliseconds longest_wait_for_incarnation{3000};
constexpr milliseconds longest_wait_for_turn{50};
constexpr int most_favoured = -20;  ///< niceness

/// It hangs or computes without end: a backtrace shows where.
bool is_hang(FaultClass fault) {
  switch (fault) {
    case FaultClass::silent:
    case FaultClass::not_checking:
    case FaultClass::not_working:
    case FaultClass::worker_frozen:
    case FaultClass::start_overdue:
    case FaultClass::cpu_hog:
      return true;
    default:
      return false;
  }
}

/// It does nothing useful any more, so it is better dead than alive while its restart has to wait.
bool is_useless(FaultClass fault) {
  return fault == FaultClass::silent || fault == FaultClass::wrong_answer ||
         fault == FaultClass::start_overdue || fault == FaultClass::cpu_hog;
}

/// Whatever the process does: its version is the fault.
bool is_of_the_version(FaultClass fault) {
  return fault == FaultClass::not_confirmed || fault == FaultClass::limit_violation;
}

/// `srfs up` is on its way through the list and has not reached every node.
bool is_being_started(const VarPaths& var) {
  const Fd lock(open(var.starting_lock().c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC));
  return lock && flock(lock.get(), LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
}

/// How long a process could have run since it was started @p since, at least what it has run. Blocks for 25
/// ms at most.
nanoseconds able_since_start(pid_t pid, MonotonicTime since) {
  constexpr int look_ms = 25;
  const auto files = ThreadCpuFiles::open(pid, pid);
  const auto before = files ? files->read() : std::nullopt;
  if (!before) return monotonic_now() - since;
  if (files->state() == 'R') {
    poll(nullptr, 0, look_ms);
    if (files->read() == before && files->state() == 'R') return before->ran;  // it waits just now
  }
  return std::max(monotonic_now() - since - before->waited, before->ran);
}

std::string signal_text(std::uint32_t number) {
  const char* name = sigabbrev_np(static_cast<int>(number));
  return name == nullptr ? fmt::format("signal {}", number) : fmt::format("signal {} (SIG{})", number, name);
}

std::string end_text(const HeartbeatPage::Reading& reading) {
  switch (reading.end) {
    case EndKind::exit:
      return fmt::format("exit code {}", reading.end_value);
    case EndKind::signal:
      return signal_text(reading.end_value);
    case EndKind::running:
      break;
  }
  return "killed without a word (SIGKILL?)";
}

std::string what_happened(const FaultRecord& record) {
  return record.detail.empty() ? to_text(record.fault)
                               : fmt::format("{}: {}", to_text(record.fault), record.detail);
}

}  // namespace

/// The version that gives way to the next best one, and why.
struct Restarter::FailedVersion {
  update::VersionNumber number = update::golden;
  std::string why;
};

/// One accusation in progress.
struct Restarter::Case {
  explicit Case(const Accusation& a) : accusation(a) {}

  const Accusation& accusation;
  const NodeEntry* node = nullptr;
  std::optional<RunningInstance> running;           ///< the accused, seen under the lock
  std::optional<Process> process;                   ///< the same
  std::optional<HeartbeatPage::Reading> last_page;  ///< of the accused
  LogEnd log_end;
  char kernel_state = '-';
  std::string killed_with;  ///< "SIGKILL"; empty: it was gone
  std::optional<MonotonicTime> begun;
  std::optional<MonotonicTime> gone;
  std::optional<MonotonicTime> started;
  bool acted = false;                     ///< killed or started: worth a line in any case
  std::optional<FailedVersion> failed;    ///< the version it died with gives way to another one
  std::optional<std::uint32_t> outlived;  ///< the same, after its probation: it is good
  std::optional<VersionFallback> fallback;

  [[nodiscard]] std::uint32_t old_incarnation() const {
    if (running && running->incarnation != 0) return running->incarnation;
    if (accusation.incarnation != 0) return accusation.incarnation;
    return last_page ? last_page->incarnation : 0;
  }
};

/// Writes what costs a disk's time, on a thread of its own that may hang without harm.
class Restarter::Recorder {
 public:
  struct Job {
    FaultRecord record;
    std::optional<pid_t> new_pid;   ///< whose incarnation and start record belong to it
    std::optional<NodeEntry> node;  ///< the same
    LogEnd log_end;
    pid_t old_pid = 0;
    bool report = false;
    bool settle = false;                  ///< a version was set aside
    std::optional<std::uint32_t> commit;  ///< the version is good
    bool fault = true;                    ///< the record goes into the ledger
  };

  Recorder(const Deployment& deployment, const VarPaths& var, std::filesystem::path bin_folder)
      : deployment_(deployment), var_(var), bin_folder_(std::move(bin_folder)), ledger_(var) {}

  static void start(const std::shared_ptr<Recorder>& self) {
    std::thread([self] {
      pthread_setname_np(pthread_self(), "fault_ledger");
      self->run();
    }).detach();
  }
  void post(Job job) {
    const std::lock_guard guard(mutex_);
    if (jobs_.size() >= most_waiting_records) {
      ++lost_;
      return;
    }
    jobs_.push_back(std::move(job));
    changed_.notify_all();
  }
  bool flush(milliseconds patience) {
    std::unique_lock guard(mutex_);
    return changed_.wait_for(guard, patience, [&] { return jobs_.empty() && !busy_; });
  }
  void stop() {
    const std::lock_guard guard(mutex_);
    stop_ = true;
    changed_.notify_all();
  }
  [[nodiscard]] std::uint64_t lost() const {
    const std::lock_guard guard(mutex_);
    return lost_;
  }
  /// When the process of an incarnation held its instance lock, for the time from there to Active.
  void remember_start(const std::string& node, MonotonicTime started) {
    const std::lock_guard guard(mutex_);
    started_[node] = started;
  }
  [[nodiscard]] std::optional<MonotonicTime> started(const std::string& node) const {
    const std::lock_guard guard(mutex_);
    const auto found = started_.find(node);
    return found == started_.end() ? std::nullopt : std::optional(found->second);
  }

 private:
  void run() {
    std::unique_lock guard(mutex_);
    while (true) {
      changed_.wait(guard, [&] { return stop_ || !jobs_.empty(); });
      if (jobs_.empty()) return;
      Job job = std::move(jobs_.front());
      jobs_.pop_front();
      busy_ = true;
      guard.unlock();
      const bool written = write(job);
      guard.lock();
      busy_ = false;
      if (!written) ++lost_;
      changed_.notify_all();
    }
  }

  bool write(Job& job) const {
    FaultRecord& record = job.record;
    const bool versions_written = write_versions(job);
    if (!job.fault) return versions_written;
    if (job.new_pid) {
      const MonotonicTime give_up = monotonic_now() + longest_wait_for_incarnation;
      while (record.new_incarnation == 0 && monotonic_now() < give_up) {
        const auto instance = find_instance(var_, record.subject);
        if (!instance || instance->pid != *job.new_pid) break;
        record.new_incarnation = instance->incarnation;
        if (record.new_incarnation == 0) poll(nullptr, 0, 2);
      }
      if (job.node) count_start_on_disk({deployment_, var_, bin_folder_, what_happened(record)}, *job.node);
    }
    const auto sequence = ledger_.append(record);
    if (sequence) {
      record.sequence = *sequence;
    } else {
      log::warn("the fault of {} is not in the ledger: {}", record.subject, sequence.error());
    }
    if (job.report) {
      const std::string header = fmt::format(
          "node {}, incarnation {}\n{} by {}: {}\nend: {}\noutcome: {} {}\nledger: {}", record.subject,
          record.old_incarnation, to_iso8601(record.utc), record.observer, what_happened(record),
          record.cause, to_text(record.outcome), record.reason, encode(record));
      const auto report = write_crash_report(var_, {record.subject, record.old_incarnation, job.old_pid},
                                             header, job.log_end);
      if (!report) log::warn("no report of the end of {}: {}", record.subject, report.error());
    }
    return sequence.has_value() && versions_written;
  }

  bool write_versions(const Job& job) const {
    const std::string& node = job.record.subject;
    if (job.settle) {
      if (const auto settled = settle_versions(var_, node); !settled) {
        log::error("versions of {}: {}", node, settled.error());
        return false;
      }
    }
    if (!job.commit) return true;
    const auto done =
        change_versions(var_, node, [&](update::VersionStore& store) -> Result<void, std::string> {
          const auto table = store.read().table;
          const update::Version* trial = table.on_trial();
          if (trial == nullptr || trial->number != *job.commit) return {};  // another process was quicker
          return store.commit(*job.commit);
        });
    if (!done) log::error("versions of {}: {}", node, done.error());
    return done.has_value();
  }

  const Deployment deployment_;  // a copy: this may outlive the node
  const VarPaths var_;
  const std::filesystem::path bin_folder_;
  const FaultLedger ledger_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Job> jobs_;
  std::map<std::string, MonotonicTime> started_;  ///< by node
  bool busy_ = false;
  bool stop_ = false;
  std::uint64_t lost_ = 0;
};

Restarter::Restarter(const Deployment& deployment, VarPaths var, std::string observer,
                     std::filesystem::path bin_folder)
    : deployment_(deployment),
      var_(std::move(var)),
      observer_(std::move(observer)),
      bin_folder_(std::move(bin_folder)),
      send_([](const Process& process, int number) { return process.signal(number); }),
      pressure_(cpu_pressure),
      recorder_(std::make_shared<Recorder>(deployment_, var_, bin_folder_)) {
  Recorder::start(recorder_);
}

Restarter::~Restarter() {
  recorder_->stop();
  (void)recorder_->flush(longest_flush);
}

std::uint64_t Restarter::records_lost() const {
  return recorder_->lost();
}

bool Restarter::flush(milliseconds patience) {
  return recorder_->flush(patience);
}

RestartOutcome Restarter::restart(const Accusation& accusation) {
  Case c(accusation);
  c.node = (deployment_now_ ? deployment_now_() : deployment_).find(accusation.subject);
  if (c.node == nullptr) return {What::not_believed, 0, {}, "no node of this deployment"};
  if (accusation.subject == observer_)
    return {What::not_believed, 0, {}, "an observer does not restart itself"};
  RestartOutcome outcome = decide_and_act(c);
  record(c, outcome);
  return outcome;
}

RestartOutcome Restarter::decide_and_act(Case& c) {
  const auto lock = RestartLock::take(var_, c.node->name);
  if (!lock && lock.error().held) return {What::under_way, 0, {}, wait_for_stand_in(c)};
  if (!lock) return {What::cannot_start, 0, {}, lock.error().text};
  std::error_code ec;
  if (std::filesystem::exists(var_.stopping_flag(), ec)) return {What::stopping, 0, {}, ""};
  // The way back from a version that the operator cannot reach must not depend on an order that can no longer
  // be lifted.
  const auto why_held =
      held_because(var_, deployment_now_ ? deployment_now_() : deployment_, c.node->name, monotonic_now());
  if (why_held && c.accusation.fault != FaultClass::not_confirmed) return {What::held, 0, {}, *why_held};
  if (c.accusation.fault == FaultClass::absent && is_being_started(var_))
    return {What::under_way, 0, {}, "srfs up is starting the suite"};
  if (auto outcome = look_again(c)) return *outcome;
  c.begun = monotonic_now();
  if (auto outcome = ask_policy(c)) return *outcome;
  // Checked first: one that may not be killed yet must not use up the turn of another's start.
  const bool deaf = c.accusation.fault == FaultClass::deaf && c.process;
  const auto may_kill_deaf = [&](Turn what) {
    return !deaf || turn("last_deaf_kill", deployment_.ring.deaf_interval, false, what);
  };
  const auto too_early = [&] {
    return RestartOutcome{
        What::communication, c.process->pid(), {}, "another node was restarted for that a short time ago"};
  };
  if (!may_kill_deaf(Turn::look)) return too_early();
  if (auto outcome = wait_for_pressure(c)) return *outcome;
  if (!may_kill_deaf(Turn::take)) return too_early();
  if (auto outcome = kill_old(c)) return *outcome;
  return start_new(c, *lock);
}

/// Another process has the node. A stand-in that overruns its time is ended, which frees the lock for the
/// next attempt.
std::string Restarter::wait_for_stand_in(const Case& c) const {
  const auto stand_in = read_stand_in(var_, c.node->name);
  if (!stand_in) return "somebody else restarts it";
  const auto overrun = find_overrun(var_, *stand_in, monotonic_now());
  if (!overrun) return fmt::format("{} stands in for it", stand_in->by);
  log::error("{} (pid {}) has stood in for {} beyond its lease and is killed", stand_in->by, stand_in->pid,
             c.node->name);
  (void)send_(*overrun, SIGKILL);
  return fmt::format("{} stood in for it beyond its lease", stand_in->by);
}

/// Is the accused still what runs, and still as it was accused?
std::optional<RestartOutcome> Restarter::look_again(Case& c) const {
  const Accusation& a = c.accusation;
  if (generation_ && a.generation != 0) {
    const auto now = generation_();
    if (now && *now != a.generation)
      return RestartOutcome{
          What::not_believed,
          0,
          {},
          fmt::format("judged in generation {} of the ring, now it is {}", a.generation, *now)};
  }
  c.last_page = HeartbeatPage::read(var_, a.subject);
  const auto running = find_instance(var_, a.subject);
  if (!running) return look_for_starting(c);
  // A process that has not made its number known in its lock may have done so in its page.
  std::uint32_t incarnation = running->incarnation;
  if (incarnation == 0 && c.last_page && c.last_page->pid == running->pid)
    incarnation = c.last_page->incarnation;
  const bool other_pid = a.pid != running->pid;
  const bool other_incarnation = a.incarnation != 0 && incarnation != a.incarnation;
  if (other_pid || other_incarnation) {
    const bool later = a.incarnation == 0 || incarnation == 0 || incarnation > a.incarnation;
    return RestartOutcome{later ? What::renewed : What::not_believed,
                          running->pid,
                          {},
                          fmt::format("pid {} incarnation {} was accused, pid {} incarnation {} runs", a.pid,
                                      a.incarnation, running->pid, incarnation)};
  }
  if (a.fault == FaultClass::exited || a.fault == FaultClass::absent)
    return RestartOutcome{What::not_believed, running->pid, {}, "it runs"};
  if (c.last_page && c.last_page->pid != running->pid) c.last_page.reset();
  if (a.fault == FaultClass::silent && c.last_page && c.last_page->last_turn > a.decided)
    return RestartOutcome{What::not_believed, running->pid, {}, "its work thread turns again"};
  c.process = open_instance(var_, a.subject);
  if (!c.process || c.process->pid() != running->pid) {
    c.process.reset();  // it has just ended by itself
    return std::nullopt;
  }
  c.running = running;
  c.kernel_state = process_state(running->pid).value_or('-');
  return std::nullopt;
}

/// No process holds the instance lock. One may be on the way to it: a second one is started only when the
/// first had its time, and then in its place.
std::optional<RestartOutcome> Restarter::look_for_starting(Case& c) const {
  auto starting = find_starting(var_, c.node->name);
  if (!starting) return std::nullopt;  // it is down, or goes down just now
  const pid_t pid = starting->process.pid();
  const bool accused = c.accusation.pid == pid && c.accusation.fault == FaultClass::start_overdue;
  if (!accused && able_since_start(pid, starting->since) < deployment_.ring.start_deadline)
    return RestartOutcome{What::under_way, pid, {}, fmt::format("pid {} is starting", pid)};
  c.kernel_state = process_state(pid).value_or('-');
  c.process = std::move(starting->process);
  return std::nullopt;
}

std::optional<RestartOutcome> Restarter::ask_policy(Case& c) const {
  const MonotonicTime now = *c.begun;
  DeathHistory history = read_deaths(var_, c.node->name);
  const bool counted = history.down;
  count_death(history, deployment_.ring, now);
  const auto table = read_versions(var_, c.node->name).table;
  const auto trial = trial_of(var_, deployment_.ring, c.node->name, table, c.accusation.pid != 0, now);
  const RestartDecision decision = decide(history, deployment_.ring, trial);
  const bool in_time = c.accusation.fault == FaultClass::not_confirmed && trial &&
                       (!trial->to_confirm || trial->lived < trial->probation);
  if (is_of_the_version(c.accusation.fault) && (in_time || decision.step != RestartDecision::Step::last_good))
    return RestartOutcome{
        What::not_believed, c.accusation.pid, {}, "its version is not in question any more"};
  if (decision.step == RestartDecision::Step::last_good) {
    c.failed = {trial->version,
                fmt::format("{}{}{} {:.1f} s after its start, in its probation", to_text(c.accusation.fault),
                            c.accusation.detail.empty() ? "" : ": ", c.accusation.detail,
                            static_cast<double>(trial->lived.count()) / 1e9)};
    return std::nullopt;
  }
  if (trial) c.outlived = trial->version;
  if (decision.step == RestartDecision::Step::quarantine && gives_way_to_golden(c, table.active())) {
    c.failed = {table.active(), fmt::format("{} deaths within {} s, and telecommands need this node",
                                            decision.deaths, deployment_.ring.window.count() / 1000)};
    c.outlived.reset();
    return std::nullopt;
  }
  const bool waits = decision.step != RestartDecision::Step::start && now < decision.not_before;
  if (waits && c.running && !is_useless(c.accusation.fault))
    return RestartOutcome{What::backing_off, c.process->pid(), decision.not_before,
                          fmt::format("{} deaths within {} s; it works on as it can", decision.deaths - 1,
                                      deployment_.ring.window.count() / 1000)};
  if (!waits) return std::nullopt;  // the death is written down together with the start
  if (c.process) {
    if (auto outcome = kill_old(c)) return outcome;
  }
  if (!counted) write_deaths(var_, c.node->name, history);
  const bool quarantined = decision.step == RestartDecision::Step::quarantine;
  return RestartOutcome{
      quarantined ? What::quarantined : What::backing_off, 0, decision.not_before,
      fmt::format("{} deaths within {} s", decision.deaths, deployment_.ring.window.count() / 1000)};
}

/// A node of the command path does not wait in quarantine with a version other than golden, however good that
/// one was: it may be what keeps the operator from reaching the spacecraft. The deaths have to be its own.
bool Restarter::gives_way_to_golden(const Case& c, update::VersionNumber active) const {
  const auto started = last_started(var_, c.node->name);
  return active != update::golden && started && started->version == active &&
         (deployment_now_ ? deployment_now_() : deployment_).on_command_path(c.node->name);
}

/// Signals until its instance lock is free. Nothing when it is gone.
std::optional<RestartOutcome> Restarter::kill_old(Case& c) const {
  if (!c.process) {
    c.gone = monotonic_now();
    c.log_end = remember_log_end(var_, c.node->name);
    return std::nullopt;
  }
  // The instance lock ends with its holder; for a process that never held it, its end is the proof.
  const auto is_gone = [&] {
    const auto holder = find_instance(var_, c.node->name);
    return holder ? holder->pid != c.process->pid() : c.running || c.process->wait_for_exit(nanoseconds(0));
  };
  c.acted = true;
  // Its threads end sooner when they need not wait for a CPU.
  CpuLoan last(c.process->pid(), most_favoured);
  last.lend();
  // A stopped process must not run again, not even into its handler: a payload would write to the bus.
  const bool stopped = c.kernel_state == 'T' || c.kernel_state == 't';
  const bool hang = is_hang(c.accusation.fault);
  if (!stopped) {
    (void)send_(*c.process, hang ? SIGABRT : SIGTERM);
    c.killed_with = hang ? "SIGABRT" : "SIGTERM";
  }
  if (stopped || !c.process->wait_for_exit(hang ? abort_patience : term_patience)) {
    const int error = send_(*c.process, SIGKILL);
    c.killed_with = "SIGKILL";
    (void)c.process->wait_for_exit(kill_patience);
    if (!is_gone()) {
      const char state = process_state(c.process->pid()).value_or('?');
      return RestartOutcome{
          What::unkillable,
          c.process->pid(),
          {},
          error != 0 ? "cannot be killed: " + errno_text(error)
                     : fmt::format("survived SIGKILL for {} ms, state {}", kill_patience.count(), state)};
    }
  } else if (!is_gone()) {
    return RestartOutcome{
        What::unkillable, c.process->pid(), {}, "it ended and its instance lock is not free"};
  }
  c.gone = monotonic_now();
  c.log_end = remember_log_end(var_, c.node->name);
  if (const auto page = HeartbeatPage::read(var_, c.node->name); page && page->pid == c.process->pid())
    c.last_page = page;
  c.process.reset();
  return std::nullopt;
}

RestartOutcome Restarter::start_new(Case& c, const RestartLock& lock) const {
  // The stop of the suite waits a second for this lock; killing may have taken longer.
  std::error_code ec;
  if (std::filesystem::exists(var_.stopping_flag(), ec)) return {What::stopping, 0, {}, ""};
  if (wanted_ && !wanted_()) return {What::stopping, 0, {}, "who asked for it has ended"};
  DeathHistory history = read_deaths(var_, c.node->name);
  count_death(history, deployment_.ring, *c.begun);
  if (c.failed) take_next_best(c, *c.failed, history);
  write_deaths(var_, c.node->name, history);
  c.acted = true;
  const auto launched =
      launch_locked({deployment_, var_, bin_folder_, ""}, *c.node, lock, ProgramCheck::size);
  if (!launched) return {What::cannot_start, 0, {}, launched.error()};
  c.started = monotonic_now();
  if (launched->fallback && c.fallback) c.fallback->why += "; " + launched->fallback->why;
  if (launched->fallback && !c.fallback) c.fallback = launched->fallback;
  if (c.fallback) c.fallback->to = launched->version;
  return {What::restarted,   launched->pid, {}, c.fallback ? to_text(*c.fallback) : std::string(),
          launched->version, c.fallback};
}

/// Its deaths are not held against the version that comes back.
void Restarter::take_next_best(Case& c, const FailedVersion& failed, DeathHistory& history) const {
  if (!set_aside(var_, c.node->name, failed.number, failed.why))
    log::error("version {} of {} cannot be set aside", failed.number, c.node->name);
  history.deaths.clear();
  const update::VersionNumber active = read_versions(var_, c.node->name).table.active();
  if (active != failed.number)
    c.fallback = VersionFallback{failed.number, active, failed.why};  // else confirmed just now
}

/// A node that takes the CPUs from all others is the pressure: ending it does not wait.
std::optional<RestartOutcome> Restarter::wait_for_pressure(const Case& c) const {
  if (c.accusation.fault == FaultClass::cpu_hog) return std::nullopt;
  const auto pressure = pressure_();
  if (!pressure || *pressure < busy_cpu_pressure || turn("last_start", between_starts, true, Turn::take))
    return std::nullopt;
  return RestartOutcome{
      What::under_way,
      c.accusation.pid,
      {},
      fmt::format("some task waits for a CPU {:.0f} % of the time, so starts are spaced", 100 * *pressure)};
}

/// One turn in the whole suite per interval. For kills for a communication fault: when the network stack
/// fails, all nodes seem deaf to each other.
/// @param without_memory  the answer where there is no place to remember the last turn
bool Restarter::turn(const char* name, nanoseconds interval, bool without_memory, Turn what) const {
  const auto opened = open_private(var_.memory() / name, O_RDWR | O_CREAT, var_.owner());
  if (!opened) return without_memory;
  const Fd& file = *opened;
  const MonotonicTime give_up = monotonic_now() + longest_wait_for_turn;
  while (flock(file.get(), LOCK_EX | LOCK_NB) != 0) {
    if (monotonic_now() >= give_up) return false;  // another process is deciding just now
    poll(nullptr, 0, 1);
  }
  const MonotonicTime now = monotonic_now();
  std::int64_t last_ns = 0;
  const bool stamped =
      pread(file.get(), &last_ns, sizeof last_ns, 0) == sizeof last_ns && last_ns <= now.ns();
  bool mine = !stamped || nanoseconds(now.ns() - last_ns) >= interval;
  if (mine && what == Turn::take) {
    const std::int64_t now_ns = now.ns();
    mine = pwrite(file.get(), &now_ns, sizeof now_ns, 0) == sizeof now_ns;
  }
  flock(file.get(), LOCK_UN);
  return mine;
}

void Restarter::record(const Case& c, const RestartOutcome& outcome) {
  const Accusation& a = c.accusation;
  const bool ours = c.acted || outcome.what == What::backing_off || outcome.what == What::quarantined ||
                    outcome.what == What::communication || outcome.what == What::not_believed ||
                    outcome.what == What::cannot_start || outcome.what == What::held;
  if (!ours) return;
  const auto last = last_recorded_.find(a.subject);
  const bool repeated = last != last_recorded_.end() && last->second == outcome.what;
  last_recorded_[a.subject] = outcome.what;
  const bool ends_a_life = outcome.what == What::restarted || (c.acted && outcome.what != What::unkillable);
  if (repeated && !ends_a_life) return;

  Recorder::Job job;
  FaultRecord& r = job.record;
  r.utc = system_utc_now();
  r.monotonic = monotonic_now();
  r.boot = kernel_boot_id().value_or("unknown");
  r.observer = observer_;
  r.subject = a.subject;
  r.fault = a.fault;
  r.misses = a.misses;
  r.detail = a.detail;
  r.kernel_state = c.kernel_state;
  r.old_incarnation = c.old_incarnation();
  r.outcome = outcome.what;
  r.reason = outcome.reason;
  r.version = outcome.version;
  if (c.fallback) r.failed_version = c.fallback->from;
  job.settle = c.fallback || outcome.what == What::cannot_start;
  job.commit = c.outlived;
  if (c.last_page && c.last_page->last_turn <= a.first_evidence)
    r.last_turn_age = a.first_evidence - c.last_page->last_turn;
  if (!c.killed_with.empty()) {
    r.cause = fmt::format("{} by the observer", c.killed_with);
    if (c.last_page && c.last_page->end != EndKind::running)
      r.cause += ", ended with " + end_text(*c.last_page);
  } else if (a.pid != 0 || a.fault == FaultClass::absent || a.fault == FaultClass::exited) {
    r.cause = c.process ? "runs" : c.last_page ? end_text(*c.last_page) : "unknown, no heartbeat page";
  }
  if (a.decided >= a.first_evidence) r.judged = a.decided - a.first_evidence;
  if (c.gone && *c.gone >= a.decided) r.killed = *c.gone - a.decided;
  if (c.started && c.gone) r.started = *c.started - *c.gone;
  if (c.started) {
    job.new_pid = outcome.pid;
    job.node = *c.node;
    recorder_->remember_start(a.subject, *c.started);
  }
  job.old_pid = a.pid != 0 ? a.pid : c.last_page ? c.last_page->pid : 0;
  job.report = c.acted && !c.process;  // a life has ended
  job.log_end = {Fd(c.log_end.log ? fcntl(c.log_end.log.get(), F_DUPFD_CLOEXEC, 3) : -1), c.log_end.size};
  recorder_->post(std::move(job));
}

void Restarter::commit(const std::string& subject, std::uint32_t version) {
  Recorder::Job job;
  job.fault = false;
  job.record.subject = subject;
  job.commit = version;
  recorder_->post(std::move(job));
}

void Restarter::on_recovered(const std::string& subject, std::uint32_t incarnation, MonotonicTime active) {
  Recorder::Job job;
  FaultRecord& r = job.record;
  r.kind = FaultRecord::Kind::active;
  r.utc = system_utc_now();
  r.monotonic = active;
  r.boot = kernel_boot_id().value_or("unknown");
  r.observer = observer_;
  r.subject = subject;
  r.new_incarnation = incarnation;
  if (const auto started = recorder_->started(subject); started && active >= *started)
    r.active = active - *started;
  recorder_->post(std::move(job));
}

}  // namespace srfs::suite
