// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/ring.hpp"

#include <algorithm>

namespace srfs::simulation {

using suite::Accusation;
using suite::FaultClass;
using suite::RestartDecision;
using suite::RestartOutcome;
using suite::RingMonitor;
using What = RestartOutcome::What;

namespace {

constexpr nanoseconds check_period = milliseconds(100);
constexpr int misses = 5;  // launch_config/sim.yaml
constexpr nanoseconds excusable = seconds(3);

/// Nothing has kept it from its work for some time.
bool now_well(const Host& host) {
  return host.runs() && host.now() - host.well_since() > excusable;
}

}  // namespace

Ring::Ring(Kernel& kernel, Network& network, Versions& versions, std::vector<Host*> members)
    : kernel_(kernel),
      network_(network),
      versions_(versions),
      random_(kernel.random("ring")),
      members_(std::move(members)),
      present_(members_.size(), nullptr),
      subjects_(members_.size()) {
  for (const Host* host : members_) membership_.members.push_back(host->name());
  settings_.misses = misses;
}

void Ring::join(Member& member) {
  present_[member.self_] = &member;
}

void Ring::leave(Member& member) {
  present_[member.self_] = nullptr;
}

void Ring::on_process(Host& host) {
  if (host.state() != Host::State::down) return;
  const pid_t pid = host.page().pid;
  const std::size_t gone = index(host.name());
  for (Subject& subject : subjects_) {
    if (subject.lock == pid) subject.lock = 0;
  }
  for (Member* member : present_) {
    if (member == nullptr || member->followed_[gone] != pid) continue;
    member->host_.later(microseconds(100), [member, name = host.name(), pid] {
      member->monitor_->on_exit(name, pid, member->host_.now());
      member->act();
    });
  }
}

/// 0 in the table: it was started with the suite.
void Ring::note(std::size_t i, RestartDecision::Step step) {
  kernel_.coverage().note(StateTable::restart, i, static_cast<std::uint8_t>(1 + static_cast<int>(step)));
}

void Ring::lose_power() {
  for (std::size_t i = 0; i < members_.size(); ++i) kernel_.coverage().forget(StateTable::restart, i);
  ++boots_;
  subjects_.assign(members_.size(), {});
  last_deaf_kill_.reset();
}

void Ring::keep_down(Host& host) {
  kept_down_.insert(index(host.name()));
  if (host.pid() != 0) host.end("SIGKILL, and it cannot be started");
}

void Ring::begin(std::size_t i) {
  if (kept_down_.contains(i)) return;
  suite::count_start(subjects_[i].deaths, kernel_.now());
  (void)versions_.on_begin(*members_[i]);
  members_[i]->begin(start_time());
}

pid_t Ring::restart_now(Host& host) {
  host.end("SIGTERM for another version");
  begin(index(host.name()));
  return host.pid();
}

void Ring::start_all() {
  nanoseconds after{0};
  for (std::size_t i = 0; i < members_.size(); ++i) {
    kernel_.later(after, [this, i, boot = boots_] {
      if (boots_ != boot || subjects_[i].lock != 0) return;  // without power again; another one starts it
      kernel_.coverage().note(StateTable::restart, i, 0);
      begin(i);
    });
    after += milliseconds(30);
  }
}

std::optional<MonotonicTime> Ring::not_before(const Host& host) const {
  return subjects_[index(host.name())].not_before;
}

// ---------------------------------------------------------------- the restarter, as its contract says

std::optional<RestartOutcome> Ring::look_again(const Accusation& a) {
  const Host& subject = *members_[index(a.subject)];
  if (subjects_[index(a.subject)].lock != 0) return RestartOutcome{What::under_way, 0, {}, ""};
  if (subject.pid() != 0 && subject.pid() != a.pid)
    return RestartOutcome{What::renewed, subject.pid(), {}, ""};
  const bool gone = a.fault == FaultClass::exited || a.fault == FaultClass::absent;
  if (gone && subject.pid() != 0) return RestartOutcome{What::not_believed, subject.pid(), {}, "it runs"};
  if (a.fault == FaultClass::silent && subject.pid() != 0 && subject.page().last_turn > a.decided)
    return RestartOutcome{What::not_believed, subject.pid(), {}, "its work thread turns again"};
  if (a.fault == FaultClass::deaf && subject.pid() != 0) {
    if (last_deaf_kill_ && kernel_.now() - *last_deaf_kill_ < settings_.deaf_interval)
      return RestartOutcome{What::communication, subject.pid(), {}, ""};
    last_deaf_kill_ = kernel_.now();
  }
  return std::nullopt;
}

std::optional<RestartOutcome> Ring::ask_policy(const Accusation& a, Host& host) {
  Subject& subject = subjects_[index(a.subject)];
  suite::count_death(subject.deaths, settings_, kernel_.now());
  const auto trial = versions_.trial_of(host);
  const RestartDecision decision = suite::decide(subject.deaths, settings_, trial);
  if (decision.step == RestartDecision::Step::last_good) {
    note(index(a.subject), decision.step);
    versions_.set_aside(host, trial->version, "it died in its probation");
    subject.not_before.reset();
    return std::nullopt;
  }
  const bool waits = decision.step != RestartDecision::Step::start && kernel_.now() < decision.not_before;
  note(index(a.subject), waits ? decision.step : RestartDecision::Step::start);
  if (!waits) {
    subject.not_before.reset();
    return std::nullopt;
  }
  subject.not_before = decision.not_before;
  if (host.pid() != 0) host.end("SIGKILL of the ring");
  const bool quarantined = decision.step == RestartDecision::Step::quarantine;
  return RestartOutcome{quarantined ? What::quarantined : What::backing_off, 0, decision.not_before, ""};
}

void Ring::restart(Member& observer, const Accusation& accusation) {
  const std::size_t i = index(accusation.subject);
  const std::size_t by = observer.self_;
  const pid_t pid = observer.host_.pid();
  auto outcome = look_again(accusation);
  if (!outcome) outcome = ask_policy(accusation, *members_[i]);
  if (outcome) {
    kernel_.later(milliseconds(1),
                  [this, by, pid, name = accusation.subject, outcome] { conclude(by, pid, name, *outcome); });
    return;
  }
  subjects_[i].lock = pid;
  kernel_.later(random_.between(milliseconds(1), milliseconds(20)), [this, i, by, pid, accusation] {
    if (subjects_[i].lock != pid) return;  // the observer died before its first action
    kill_and_start(i, by, pid, accusation);
  });
}

void Ring::kill_and_start(std::size_t i, std::size_t observer, pid_t pid, const Accusation& accusation) {
  if (members_[i]->pid() != 0) members_[i]->end("SIGKILL of the ring");
  kernel_.later(random_.between(milliseconds(1), milliseconds(20)), [this, i, observer, pid, accusation] {
    if (subjects_[i].lock != pid) return;  // it died between kill and start
    subjects_[i].lock = 0;
    ++restarts_;
    begin(i);
    conclude(observer, pid, accusation.subject, {What::restarted, members_[i]->pid(), {}, ""});
  });
}

void Ring::conclude(std::size_t observer, pid_t pid, const std::string& subject, RestartOutcome outcome) {
  Member* const member = present_[observer];
  if (member == nullptr || member->host_.pid() != pid) return;
  member->host_.give([member, subject, outcome] {
    member->restarting_ = false;
    member->monitor_->on_outcome(subject, outcome, member->host_.now());
    member->act();
    member->restart_next();
  });
}

// ---------------------------------------------------------------- a member

Ring::Member::Member(Host& host, Ring& ring)
    : host_(host),
      ring_(ring),
      self_(ring.index(host.name())),
      due_(host.now() + check_period),
      period_(host.kernel(), host.guard(), [this] { on_period(); }),
      followed_(ring.size(), 0) {
  suite::RingPatience patience;
  patience.period = std::chrono::duration_cast<milliseconds>(check_period);
  patience.misses = misses;
  monitor_ = std::make_unique<RingMonitor>(
      host_.name(), patience, ring_.membership_, [this](std::string_view name) { return look(name); },
      static_cast<std::uint64_t>(host_.pid()) * 7919, host_.now(),
      [this](std::string_view name, pid_t pid, bool) -> std::optional<CpuTotals> {
        const Host& subject = ring_.host(ring_.index(name));
        if (subject.pid() != pid) return std::nullopt;
        return CpuTotals{subject.waited(), nanoseconds(0), subject.waited()};
      });
  ring_.join(*this);
}

void Ring::Member::start() {
  act();
  period_.arm(due_);
}

Ring::Member::~Member() {
  ring_.leave(*this);
}

suite::NodeReading Ring::Member::look(std::string_view name) const {
  const Host& host = ring_.host(ring_.index(name));
  if (host.pid() == 0) return {};
  return {host.pid(), host.incarnation(), host.page()};
}

void Ring::Member::on_period() {
  const nanoseconds late = host_.now() - due_;
  due_ += check_period * (late / check_period + 1);
  monitor_->on_period(host_.now(), late, host_.waited() - std::exchange(waited_, host_.waited()));
  act();
  period_.arm(due_);
}

void Ring::Member::act() {
  while (const auto action = monitor_->next_action()) {
    host_.action_point();
    carry_out(*action);
  }
}

void Ring::Member::carry_out(const RingMonitor::Action& action) {
  if (const auto* question = std::get_if<RingMonitor::Ask>(&action)) {
    ask(ring_.index(question->subject), question->nonce);
  } else if (const auto* self = std::get_if<RingMonitor::AskSelf>(&action)) {
    host_.later(ring_.network_.delay(), [this, nonce = self->nonce] {
      monitor_->on_self_answer(nonce, host_.now());
      act();
    });
  } else if (const auto* process = std::get_if<RingMonitor::Follow>(&action)) {
    follow(ring_.index(process->subject), process->pid);
  } else if (const auto* unwatch = std::get_if<RingMonitor::Unwatch>(&action)) {
    followed_[ring_.index(unwatch->subject)] = 0;
  } else if (const auto* accuse = std::get_if<RingMonitor::Accuse>(&action)) {
    const Accusation& a = accuse->accusation;
    Host& subject = ring_.host(ring_.index(a.subject));
    host_.trace(subject.lane(), "accuses", static_cast<std::uint64_t>(a.fault), a.incarnation);
    const bool only_starves = subject.only_starves(excusable) && now_well(host_);
    if (subject.pid() == a.pid && only_starves && a.fault != FaultClass::exited)
      throw Violation{"F3", "a node that waits for a CPU is accused: " + a.subject + ": " + to_text(a.fault)};
    if (ring_.quiet_ && subject.pid() == a.pid && subject.runs())
      throw Violation{"F3", "a healthy node is accused: " + a.subject + ": " + to_text(a.fault)};
    accusations_.push_back(a);
    restart_next();
  } else if (std::holds_alternative<RingMonitor::ExitSelf>(action)) {
    throw Host::Killed{};
  }
}

void Ring::Member::restart_next() {
  if (restarting_ || accusations_.empty()) return;
  restarting_ = true;
  const Accusation accusation = std::move(accusations_.front());
  accusations_.pop_front();
  host_.output([this, accusation] { ring_.restart(*this, accusation); });
}

void Ring::Member::follow(std::size_t subject, pid_t pid) {
  followed_[subject] = pid;
  Host& host = ring_.host(subject);
  if (host.pid() == pid) return;
  host_.later(microseconds(100), [this, name = host.name(), pid] {
    monitor_->on_exit(name, pid, host_.now());
    act();
  });
}

void Ring::Member::ask(std::size_t subject, std::uint64_t nonce) {
  Host& to = ring_.host(subject);
  if (!ring_.network_.hears(host_, to)) return;
  host_.output([this, &to, subject, nonce, &ring = ring_, self = self_] {
    to.later(ring.network_.delay(), [&ring, subject, self, nonce] {
      if (Member* member = ring.present_[subject]) member->on_asked_by(self, nonce);
    });
  });
}

void Ring::Member::on_asked_by(std::size_t observer, std::uint64_t nonce) {
  Host& to = ring_.host(observer);
  monitor_->on_asked(to.name(), ring_.membership_.generation, host_.now());
  act();
  if (!ring_.network_.hears(host_, to)) return;
  suite::CheckAnswer answer;
  answer.nonce = nonce;
  answer.incarnation = host_.incarnation();
  answer.state = answer.desired = ros::State::active;
  answer.generation = ring_.membership_.generation;
  answer.own_last_check_age = std::chrono::duration_cast<milliseconds>(monitor_->last_check_age(host_.now()));
  to.later(ring_.network_.delay(), [&ring = ring_, observer, name = host_.name(), answer] {
    Member* const member = ring.present_[observer];
    if (member == nullptr) return;
    member->monitor_->on_answer(name, answer, member->host_.now());
    member->act();
  });
}

}  // namespace srfs::simulation
