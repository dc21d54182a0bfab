// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <memory>
#include <set>
#include <vector>

#include "suite/ring/restart_policy.hpp"
#include "suite/ring/ring_monitor.hpp"
#include "tests/simulation/process.hpp"
#include "tests/simulation/versions.hpp"

namespace srfs::simulation {

/// What the ring's members share: the nodes, and the restarts with their lock and their history, which live
/// as long as the computer's power.
class Ring {
 public:
  Ring(Kernel& kernel, Network& network, Versions& versions, std::vector<Host*> members);

  [[nodiscard]] const suite::Membership& membership() const { return membership_; }
  [[nodiscard]] std::size_t index(std::string_view name) const { return *membership_.position_of(name); }
  [[nodiscard]] Host& host(std::size_t i) { return *members_[i]; }
  [[nodiscard]] std::size_t size() const { return members_.size(); }

  class Member;
  void join(Member& member);
  void leave(Member& member);
  /// The process of a host has ended or begun.
  void on_process(Host& host);
  /// All processes, the histories and the locks are gone.
  void lose_power();
  /// A computer's start: all nodes are started one after the other.
  void start_all();
  [[nodiscard]] std::uint64_t restarts() const { return restarts_; }
  /// It may not be started before; nullopt: nothing keeps it down.
  [[nodiscard]] std::optional<MonotonicTime> not_before(const Host& host) const;
  void set_quiet(bool quiet) { quiet_ = quiet; }
  /// A process restarts it.
  [[nodiscard]] bool is_locked(const Host& host) const { return subjects_[index(host.name())].lock != 0; }
  /// It is not started any more, as a node that cannot be: as good as in quarantine.
  void keep_down(Host& host);
  /// For another version: what runs is ended. @return number of the new process
  pid_t restart_now(Host& host);

 private:
  friend class Member;
  void restart(Member& observer, const suite::Accusation& accusation);
  [[nodiscard]] std::optional<suite::RestartOutcome> look_again(const suite::Accusation& accusation);
  [[nodiscard]] std::optional<suite::RestartOutcome> ask_policy(const suite::Accusation& accusation,
                                                                Host& subject);
  void begin(std::size_t subject);
  void note(std::size_t subject, suite::RestartDecision::Step step);
  void kill_and_start(std::size_t subject, std::size_t observer, pid_t observer_pid,
                      const suite::Accusation& accusation);
  void conclude(std::size_t observer, pid_t observer_pid, const std::string& subject,
                suite::RestartOutcome outcome);
  [[nodiscard]] nanoseconds start_time() { return random_.between(milliseconds(50), milliseconds(400)); }

  Kernel& kernel_;
  Network& network_;
  Versions& versions_;
  Random random_;
  std::vector<Host*> members_;
  suite::Membership membership_;
  suite::RingSettings settings_;
  std::vector<Member*> present_;
  struct Subject {
    pid_t lock = 0;  ///< process that restarts it
    suite::DeathHistory deaths;
    std::optional<MonotonicTime> not_before;
  };
  std::vector<Subject> subjects_;
  std::set<std::size_t> kept_down_;
  std::optional<MonotonicTime> last_deaf_kill_;
  std::uint64_t restarts_ = 0;
  std::uint32_t boots_ = 0;  ///< times that the power was lost
  bool quiet_ = false;       ///< no fault for long: nobody is to be accused
};

/// One node's half of the ring (RingMonitor), in its process.
class Ring::Member {
 public:
  Member(Host& host, Ring& ring);
  ~Member();
  Member(const Member&) = delete;
  Member& operator=(const Member&) = delete;
  void start();
  [[nodiscard]] Host& host() { return host_; }

 private:
  friend class Ring;
  void on_period();
  void act();
  void carry_out(const suite::RingMonitor::Action& action);
  void ask(std::size_t subject, std::uint64_t nonce);
  void on_asked_by(std::size_t observer, std::uint64_t nonce);
  void follow(std::size_t subject, pid_t pid);
  [[nodiscard]] suite::NodeReading look(std::string_view name) const;
  void restart_next();

  Host& host_;
  Ring& ring_;
  std::size_t self_;
  std::unique_ptr<suite::RingMonitor> monitor_;
  MonotonicTime due_;
  nanoseconds waited_{0};
  Deadline period_;
  std::vector<pid_t> followed_;
  std::deque<suite::Accusation> accusations_;
  bool restarting_ = false;
};

}  // namespace srfs::simulation
