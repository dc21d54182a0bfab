// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/ring/ring_monitor.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

namespace srfs::suite {
namespace {

/// The nodes behind a silent one are watched at once and asked later: most silent nodes are back by then, and
/// two processes that just start should not spend time on discovering a third.
constexpr milliseconds settling{1000};
/// A node not started before this observer came is left to the starter of the suite for so long.
constexpr milliseconds longest_start_grace{1000};
constexpr milliseconds retry_wait{1000};
constexpr milliseconds held_wait{5000};
/// No outcome by then: the accusation is made again.
constexpr seconds longest_restart{30};
constexpr int rounds_not_asked = 10;
constexpr int large_readings = 2;
constexpr int overdue_readings = 2;
constexpr int busy_readings = 2;
constexpr std::size_t most_held_up = 64;
constexpr std::size_t most_unanswered = 64;

milliseconds in_ms(nanoseconds d) {
  return std::chrono::duration_cast<milliseconds>(d);
}

/// Answers come from the work thread between callbacks, so no state of a transition can be seen.
bool is_possible(ros::State state, ros::State desired) {
  const auto lasting = [](ros::State s) {
    return s == ros::State::unconfigured || s == ros::State::inactive || s == ros::State::active;
  };
  return lasting(state) && lasting(desired);
}

}  // namespace

RingMonitor::RingMonitor(std::string self, RingPatience patience, Membership membership, Look look,
                         std::uint64_t seed, MonotonicTime now, LookAtCpu cpu)
    : self_(std::move(self)),
      patience_(patience),
      membership_(std::move(membership)),
      look_(std::move(look)),
      cpu_(std::move(cpu)),
      nonce_state_(seed),
      begun_(now),
      last_period_(now),
      last_void_(now),
      last_asked_(now),
      last_not_asked_(now) {
  review_watch(now);
}

nanoseconds RingMonitor::tolerance() const {
  return std::max<nanoseconds>(patience_.period / 2, milliseconds(50));
}

// SplitMix64
std::uint64_t RingMonitor::next_nonce() {
  std::uint64_t z = nonce_state_ += 0x9E3779B97F4A7C15;
  z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9;
  z = (z ^ (z >> 27U)) * 0x94D049BB133111EB;
  z ^= z >> 31U;
  return z != 0 ? z : 1;  // 0: none
}

std::optional<RingMonitor::Action> RingMonitor::next_action() {
  if (actions_.empty()) return std::nullopt;
  Action action = std::move(actions_.front());
  actions_.pop_front();
  return action;
}

RingMonitor::Subject* RingMonitor::find(std::string_view name) {
  const auto found =
      std::find_if(subjects_.begin(), subjects_.end(), [&](const Subject& s) { return s.name == name; });
  return found == subjects_.end() ? nullptr : &*found;
}

std::vector<std::string_view> RingMonitor::watched() const {
  std::vector<std::string_view> names;
  names.reserve(subjects_.size());
  for (const Subject& s : subjects_) names.push_back(s.name);
  return names;
}

pid_t RingMonitor::process_of(std::string_view subject) const {
  for (const Subject& s : subjects_) {
    if (s.name == subject) return s.ended ? 0 : s.pid;
  }
  return 0;
}

bool RingMonitor::is_as_desired(std::string_view subject) const {
  for (const Subject& s : subjects_) {
    if (s.name == subject) return s.heard && !s.ended && !s.lost && s.misses == 0 && s.state == s.desired;
  }
  return false;
}

nanoseconds RingMonitor::last_check_age(MonotonicTime now) const {
  return subjects_.empty() ? nanoseconds(0) : now - last_period_;
}

nanoseconds RingMonitor::held_up_since(MonotonicTime since) const {
  return sum_since(since, [](const HeldUp& time) { return time.duration; });
}

nanoseconds RingMonitor::stopped_since(MonotonicTime since) const {
  return sum_since(since, [](const HeldUp& time) { return time.duration - time.waited; });
}

nanoseconds RingMonitor::sum_since(MonotonicTime since, nanoseconds (*part)(const HeldUp&)) const {
  nanoseconds total{0};
  for (const HeldUp& time : held_up_) {
    if (time.until > since) total += std::min(part(time), time.until - since);
  }
  return total;
}

// ---- Rounds

void RingMonitor::on_period(MonotonicTime now, nanoseconds late, nanoseconds waited) {
  if (exiting_) return;
  const bool on_time = late <= tolerance();
  if (on_time) {
    conclude_round(now, waited);
  } else {
    held_up_.push_back({now, late, std::min(waited, late)});
    if (held_up_.size() > most_held_up) held_up_.pop_front();
    if (late - waited <= tolerance()) {
      skip_round(now);
    } else {
      void_round(now);
    }
  }
  last_period_ = now;
  if (exiting_) return;
  for (Subject& s : subjects_) {
    note_cpu(s, now);
    if (s.accused && now - *s.accused > longest_restart) s.accused.reset();
    const bool doubtful = s.pid == 0 || s.recovery || s.ended || !s.heard || s.suspected != 0 || s.misses > 0;
    if (doubtful) observe(s, now);
  }
  if (membership_.members.size() > 1 && membership_.position_of(self_) &&
      now - last_asked_ >= rounds_not_asked * patience_.period) {
    not_asked_ = true;
  }
  review_watch(now);
  if (not_asked_ && now - last_not_asked_ >= rounds_not_asked * patience_.period) {
    last_not_asked_ = now;
    const auto here = membership_.position_of(self_);
    const auto& upstream = membership_.after(*here, membership_.members.size() - 1);
    if (const Subject* s = find(upstream)) report(*s, LivenessVerdict::not_asked, now);
  }
  const bool doubt =
      std::any_of(subjects_.begin(), subjects_.end(), [](const Subject& s) { return s.suspected != 0; });
  ask(now, doubt);
}

/// The timer was late: this node did not run, or hardly, and what it did not hear proves nothing.
void RingMonitor::void_round(MonotonicTime now) {
  ++counters_.void_rounds;
  last_void_ = now;
  last_asked_ = now;  // nor could it be asked
  not_asked_ = false;
  self_nonce_ = 0;
  self_failures_ = 0;
  asked_self_.clear();
  for (Subject& s : subjects_) {
    if (s.nonce != 0) report(s, LivenessVerdict::void_, now);
    // What the kernel reports of a process is true however late this node asks.
    const int large = s.large_in_row;
    const int busy = s.busy_in_row;
    clear_evidence(s);
    s.large_in_row = large;
    s.busy_in_row = busy;
  }
}

/// The timer was late because this node waited for a CPU. What it did not hear proves nothing; what was
/// counted before stands, for the subject's own want of a CPU is known.
void RingMonitor::skip_round(MonotonicTime now) {
  ++counters_.void_rounds;
  last_asked_ = now;  // requests to this node wait in the socket
  not_asked_ = false;
  self_nonce_ = 0;
  self_failures_ = 0;
  if (own_delay_ == nanoseconds(0)) asked_self_.clear();
  for (Subject& s : subjects_) s.suspected = 0;
}

/// @param waited  for a CPU since the round before
void RingMonitor::conclude_round(MonotonicTime now, nanoseconds waited) {
  if (self_nonce_ != 0) {
    // The check of this node itself is still out: it may have missed the answers itself.
    ++counters_.failed_self_checks;
    self_nonce_ = 0;
    for (Subject& s : subjects_) {
      if (s.suspected == 0) continue;
      ++counters_.void_checks;
      s.suspected = 0;
      report(s, LivenessVerdict::void_, now, "the observer did not hear itself");
    }
    // A node that waited for a CPU between two timely timers may have had no time to hear itself.
    if (waited <= tolerance() && self_failures_++ == 0) failing_since_ = now;
    if (self_failures_ >= self_failures_at_most()) {
      exiting_ = true;
      actions_.emplace_back(ExitSelf{});
      return;
    }
  }
  for (Subject& s : subjects_) {
    if (s.nonce == 0) continue;
    if (s.wrong.empty()) {
      s.suspected = std::exchange(s.nonce, 0);
      s.suspected_asked_at = s.asked_at;
      continue;
    }
    s.nonce = 0;
    if (!s.first_evidence) s.first_evidence = s.asked_at;
    if (++s.wrong_in_row >= patience_.misses) accuse(s, FaultClass::wrong_answer, now, s.wrong);
  }
}

/// In rounds, for only those count in which it had a CPU. A slow node is not deaf: its own answer may be on
/// the way, or its endpoints may not have found each other yet.
int RingMonitor::self_failures_at_most() const {
  const bool starts = failing_since_ - begun_ < patience_.start_deadline;
  const bool is_slow = own_delay_ > nanoseconds(0);
  const milliseconds patience = starts    ? patience_.start_deadline
                                : is_slow ? RingPatience::deaf
                                          : milliseconds(0);
  return std::max(2 * patience_.misses, static_cast<int>(patience / patience_.period));
}

void RingMonitor::ask(MonotonicTime now, bool doubt) {
  for (Subject& s : subjects_) {
    s.wrong.clear();
    s.nonce = 0;
    if (s.pid == 0 || s.ended || now < s.ask_from) continue;
    s.nonce = next_nonce();
    s.asked_at = now;
    s.unanswered.push_back({s.nonce, now});
    if (s.unanswered.size() > most_unanswered) s.unanswered.pop_front();
    actions_.emplace_back(Ask{s.name, s.nonce});
  }
  self_nonce_ = 0;
  if (subjects_.empty()) own_delay_ = nanoseconds(0);
  if (!doubt && own_delay_ == nanoseconds(0)) {
    self_failures_ = 0;
    return;
  }
  self_nonce_ = next_nonce();
  asked_self_.push_back({self_nonce_, now});
  if (asked_self_.size() > most_unanswered) asked_self_.pop_front();
  actions_.emplace_back(AskSelf{self_nonce_});
}

void RingMonitor::on_self_answer(std::uint64_t nonce, MonotonicTime now) {
  const auto asked = std::find_if(asked_self_.begin(), asked_self_.end(),
                                  [&](const Asked& a) { return nonce != 0 && a.nonce == nonce; });
  if (asked == asked_self_.end()) {
    ++counters_.stale_answers;
    return;
  }
  const MonotonicTime asked_at = asked->at;
  const bool is_current = nonce == self_nonce_;
  asked_self_.erase(asked_self_.begin(), asked + 1);
  self_failures_ = 0;
  const nanoseconds delay = is_current ? nanoseconds(0) : now - asked_at - held_up_since(asked_at);
  if (delay >= own_delay_ || now - own_delay_at_ >= RingPatience::deaf) {
    own_delay_ = std::max(delay, nanoseconds(0));
    own_delay_at_ = now;
  }
  if (!is_current) {
    ++counters_.late_answers;
    count_misses_before(asked_at, now);
    review_watch(now);
    return;
  }
  self_nonce_ = 0;
  const bool in_time = now - last_period_ <= patience_.period + tolerance();
  for (Subject& s : subjects_) {
    if (s.suspected == 0) continue;
    if (in_time) {
      count_miss(s, now);
    } else {
      ++counters_.void_checks;  // this node was stopped between its timer and now
      s.suspected = 0;
    }
  }
  review_watch(now);
}

/// This node has heard what came before the answer to its own question of @p asked. Who was asked in a round
/// before that has had as long as this node takes to hear itself. Once a round: answers come in bursts.
void RingMonitor::count_misses_before(MonotonicTime asked, MonotonicTime now) {
  if (std::exchange(misses_counted_, last_period_) == last_period_) return;
  for (Subject& s : subjects_) {
    const auto last = std::find_if(s.unanswered.rbegin(), s.unanswered.rend(),
                                   [&](const Asked& a) { return a.at < asked; });
    if (last == s.unanswered.rend()) continue;
    s.suspected_asked_at = last->at;
    count_miss(s, now);
  }
}

void RingMonitor::count_miss(Subject& s, MonotonicTime now) {
  s.suspected = 0;
  ++s.misses;
  if (!s.first_evidence) s.first_evidence = s.suspected_asked_at;
  report(s, LivenessVerdict::miss, now);
  judge_silence(s, now);
}

void RingMonitor::judge_silence(Subject& s, MonotonicTime now) {
  if (s.misses < patience_.misses || s.accused) return;
  if (!observe(s, now)) return;
  const NodeReading reading = look_(s.name);
  const auto& page = reading.page;
  const bool own_page = page && page->pid == s.pid;
  const bool in_transition = own_page && page->state >= static_cast<std::uint32_t>(ros::State::configuring);
  note_cpu(s, now);
  if (!own_page || page->turns == 0 || in_transition) {
    // Its work thread is busy with a start or a transition, which has its own deadline.
    const MonotonicTime since = own_page ? page->last_turn : s.first_seen;
    if (able_since(s, since, now, &CpuTotals::any_waited) < patience_.start_deadline) {
      if (now - std::max(since, last_void_) >= patience_.start_deadline) excuse(s, now);
      return;
    }
    const auto where =
        in_transition ? fmt::format("in {} ", label(static_cast<ros::State>(page->state))) : std::string();
    accuse(s, s.heard ? FaultClass::silent : FaultClass::start_overdue, now,
           fmt::format("{}for {} ms", where, in_ms(now - std::max(since, last_void_)).count()));
    return;
  }
  if (now - std::max(page->last_turn, last_void_) >= 2 * patience_.period + own_delay_) {
    judge_stale_page(s, page->last_turn, now);
    return;
  }
  // It runs and cannot be heard. A node never heard may not have been discovered yet.
  const nanoseconds known_for = able_since(s, s.first_seen, now, &CpuTotals::any_waited);
  if (!s.heard && known_for < patience_.start_deadline) return;
  // A restart is the last remedy for a link that DDS mostly repairs itself, within its announcement period.
  if (s.first_evidence && now - *s.first_evidence < RingPatience::deaf + own_delay_) return;
  if (s.first_evidence &&
      able_since(s, *s.first_evidence, now, &CpuTotals::any_waited) < RingPatience::deaf) {
    excuse(s, now);
    return;
  }
  accuse(s, FaultClass::deaf, now,
         fmt::format("its work thread turned {} ms ago", in_ms(now - page->last_turn).count()));
}

/// Its work thread makes no turn: it hangs, unless it had no CPU for one.
void RingMonitor::judge_stale_page(Subject& s, MonotonicTime last_turn, MonotonicTime now) {
  const MonotonicTime first = s.first_evidence.value_or(now);
  const nanoseconds missed = patience_.misses * patience_.period - patience_.period / 2;
  // A thread of the middleware that waits for a CPU may hold what the work thread needs.
  constexpr auto any = &CpuTotals::any_waited;
  const bool could_answer =
      able_since(s, first, now, any) >= missed && able_since(s, last_turn, now, any) >= 2 * patience_.period;
  // A turn that has used so much CPU time does not end, however little of it the node gets.
  const CpuTotals had = s.cpu.since(last_turn);
  const bool loops = had.ran >= 2 * patience_.period;
  if (!could_answer && !loops) {
    excuse(s, now);
    return;
  }
  accuse(s, FaultClass::silent, now,
         fmt::format("no turn of its work thread for {} ms, in which it ran {} and waited {} for a CPU",
                     in_ms(now - last_turn).count(), in_ms(had.ran).count(), in_ms(had.any_waited).count()));
}

/// Time since then in which the subject could have run: not that in which it waited for a CPU, nor that
/// before this node was itself held up (a subject stopped with it needs a moment, too).
nanoseconds RingMonitor::able_since(const Subject& s, MonotonicTime since, MonotonicTime now,
                                    nanoseconds CpuTotals::*waited) const {
  const MonotonicTime from = std::max(since, last_void_);
  return now - from - s.cpu.since(from).*waited;
}

/// Its silence is explained by want of a CPU, which is reported when it lasts and is never a reason to
/// restart it.
void RingMonitor::excuse(Subject& s, MonotonicTime now) {
  const nanoseconds bound = s.real_time ? RingPatience::starved_in_real_time : RingPatience::starved;
  const MonotonicTime first = s.first_evidence.value_or(now);
  s.last_excused = now;
  if (!s.excused_from) {
    s.excused_from = first;
    s.next_starved_report = first + bound;
    actions_.emplace_back(Starved{s.name});
    return;
  }
  if (now < s.next_starved_report) return;
  s.next_starved_report = now + bound;
  const nanoseconds silent_for = now - *s.excused_from;
  const nanoseconds waited = s.cpu.since(*s.excused_from).any_waited;
  report(s, LivenessVerdict::starved, now,
         fmt::format("waited {} of {} ms for a CPU", in_ms(waited).count(), in_ms(silent_for).count()));
  actions_.emplace_back(Starved{s.name, true, silent_for, waited});
}

void RingMonitor::note_cpu(Subject& s, MonotonicTime now) {
  if (!cpu_ || s.pid == 0 || s.ended) return;
  const bool doubt = s.misses > 0 || s.suspected != 0 || !s.heard;
  if (const auto totals = cpu_(s.name, s.pid, doubt)) s.cpu.add(now, *totals);
}

// ---- Answers

void RingMonitor::on_answer(std::string_view subject, const CheckAnswer& answer, MonotonicTime now) {
  Subject* s = find(subject);
  const bool current = s != nullptr && answer.nonce != 0 && answer.nonce == s->nonce;
  const bool previous = s != nullptr && answer.nonce != 0 && answer.nonce == s->suspected;
  const auto late_question =
      s != nullptr && !current && !previous ? find_late_question(*s, answer.nonce, now) : std::nullopt;
  if (!current && !previous && !late_question) {
    ++counters_.stale_answers;
    return;
  }
  if (s->incarnation == 0 || answer.incarnation != s->incarnation) observe(*s, now);
  std::string wrong;
  if (s->incarnation != 0 && answer.incarnation != s->incarnation)
    wrong = fmt::format("says incarnation {}, its lock says {}", answer.incarnation, s->incarnation);
  if (!is_possible(answer.state, answer.desired))
    wrong = fmt::format("says state {}, desired {}", static_cast<int>(answer.state),
                        static_cast<int>(answer.desired));
  if (!wrong.empty()) {
    // A right answer may still come: a forged one must not silence the node.
    ++counters_.wrong_answers;
    s->wrong = std::move(wrong);
    return;
  }
  const nanoseconds round_trip = now - (late_question ? *late_question
                                        : current     ? s->asked_at
                                                      : s->suspected_asked_at);
  if (late_question) ++counters_.late_answers;
  // Those asked since may be answered just as late.
  std::erase_if(s->unanswered, [&](const Asked& a) { return !late_question || a.at <= *late_question; });
  s->excused_from.reset();
  s->nonce = 0;
  s->suspected = 0;
  s->wrong.clear();
  s->wrong_in_row = 0;
  s->misses = 0;
  s->heard = true;
  s->state = answer.state;
  s->desired = answer.desired;
  s->last_answer = now;
  if (answer.generation != membership_.generation) {
    ++counters_.void_checks;
    s->first_evidence.reset();
    report(*s, LivenessVerdict::void_, now, fmt::format("its ring is generation {}", answer.generation));
    actions_.emplace_back(ReadMembership{});
    return;
  }
  report(*s, LivenessVerdict::alive, now);
  std::get<Report>(actions_.back()).round_trip = round_trip;
  judge_fields(*s, answer, now);
  review_watch(now);
}

/// When the question of this answer was asked, if it comes late only because its node, or this one, waited
/// for a CPU, or no later than this node hears itself.
std::optional<MonotonicTime> RingMonitor::find_late_question(Subject& s, std::uint64_t nonce,
                                                             MonotonicTime now) {
  const auto asked = std::find_if(s.unanswered.begin(), s.unanswered.end(),
                                  [&](const Asked& a) { return a.nonce == nonce; });
  if (nonce == 0 || asked == s.unanswered.end()) return std::nullopt;
  note_cpu(s, now);
  const nanoseconds in_time = patience_.period + tolerance() + held_up_since(asked->at) + own_delay_;
  if (now - asked->at - s.cpu.since(asked->at).any_waited > in_time) return std::nullopt;
  return asked->at;
}

void RingMonitor::judge_fields(Subject& s, const CheckAnswer& answer, MonotonicTime now) {
  // A node that gets hardly any CPU does not see all that it waited: the ages it states are less the time
  // that the kernel says.
  const auto is_within = [&](milliseconds age, milliseconds limit) {
    if (age <= limit) return true;
    note_cpu(s, now);
    return age - s.cpu.since(now - age).any_waited <= limit;
  };
  const bool checks =
      is_within(answer.own_last_check_age, std::max<milliseconds>(5 * patience_.period, seconds(1)));
  const bool works = s.work_done != answer.work_done || is_within(answer.oldest_due, patience_.work_deadline);
  // An age of its own time, which one answer proves: the next may come late from a node behind all others.
  const bool flows = answer.worker_busy <= answer.worker_deadline + patience_.misses * patience_.period;
  s.work_done = answer.work_done;
  // Once a round: late answers come in bursts.
  const bool is_new = std::exchange(s.fields_counted, last_period_) != last_period_;
  const auto count = [is_new](int& in_row, bool fine) { in_row = fine ? 0 : in_row + (is_new ? 1 : 0); };
  count(s.not_checking_in_row, checks);
  count(s.not_working_in_row, works);
  if (checks && works && flows) {
    if (s.large_in_row == 0) s.first_evidence.reset();
    if (!s.accused) s.lost = false;
    return;
  }
  if (!s.first_evidence) s.first_evidence = now;
  if (s.not_checking_in_row >= patience_.misses) {
    accuse(s, FaultClass::not_checking, now,
           fmt::format("checked no node for {} ms", answer.own_last_check_age.count()));
  } else if (!flows) {
    accuse(s, FaultClass::worker_frozen, now,
           fmt::format("worker '{}' busy for {} ms", answer.worker, answer.worker_busy.count()));
  } else if (s.not_working_in_row >= patience_.misses) {
    accuse(s, FaultClass::not_working, now, fmt::format("work undone for {} ms", answer.oldest_due.count()));
  }
}

void RingMonitor::on_footprint(std::string_view subject, pid_t pid, const Footprint& footprint,
                               MonotonicTime now) {
  Subject* s = find(subject);
  if (s == nullptr || s->pid != pid || s->ended) return;
  const auto over = [](std::uint64_t value, std::uint64_t cap) { return cap != 0 && value > cap; };
  const bool memory = over(footprint.memory_octets, footprint.memory_cap_octets);
  const bool descriptors = over(footprint.descriptors, footprint.descriptor_cap);
  judge_cpu(*s, footprint, now);
  s->large_in_row = memory || descriptors ? s->large_in_row + 1 : 0;
  if (s->large_in_row == 0) return;
  if (!s->first_evidence) s->first_evidence = now;
  if (s->large_in_row < large_readings) return;
  accuse(*s, FaultClass::too_large, now,
         memory ? fmt::format("{} KiB of memory, cap {} KiB", footprint.memory_octets / 1024,
                              footprint.memory_cap_octets / 1024)
                : fmt::format("{} descriptors, cap {}", footprint.descriptors, footprint.descriptor_cap));
  review_watch(now);
}

/// One of ours that takes the machine from all others, however little of it they leave.
void RingMonitor::judge_cpu(Subject& s, const Footprint& footprint, MonotonicTime now) {
  const bool busy = footprint.busy_threads_cap != 0 && footprint.busy_threads >= footprint.busy_threads_cap;
  s.busy_in_row = busy ? s.busy_in_row + 1 : 0;
  if (s.busy_in_row < busy_readings) return;
  accuse(s, FaultClass::cpu_hog, now,
         fmt::format("{} threads use or want a CPU all the time, cap {}", footprint.busy_threads,
                     footprint.busy_threads_cap));
  review_watch(now);
}

void RingMonitor::on_trial(std::string_view subject, pid_t pid, nanoseconds lived, MonotonicTime now) {
  Subject* s = find(subject);
  if (s == nullptr || s->pid != pid || s->ended || !s->heard) return;
  const nanoseconds able = lived - s->cpu.since(now - lived).any_waited;
  const bool overdue = s->state != s->desired && able > patience_.start_deadline;
  s->overdue_in_row = overdue ? s->overdue_in_row + 1 : 0;
  if (s->overdue_in_row < overdue_readings) return;
  accuse(*s, FaultClass::start_overdue, now,
         fmt::format("{} instead of {} on probation", label(s->state), label(s->desired)));
  review_watch(now);
}

void RingMonitor::on_bad_version(std::string_view subject, pid_t pid, FaultClass fault, std::string detail,
                                 MonotonicTime now) {
  Subject* s = find(subject);
  if (s == nullptr || s->pid != pid || s->ended || s->accused || now < s->not_before) return;
  accuse(*s, fault, now, std::move(detail));
  review_watch(now);
}

void RingMonitor::on_asked(std::string_view observer, std::uint32_t generation, MonotonicTime now) {
  if (observer == self_) return;
  if (!membership_.position_of(observer) || generation != membership_.generation) {
    const bool is_member = generation != 0;
    if (is_member && generation != membership_.generation) actions_.emplace_back(ReadMembership{});
    return;
  }
  last_asked_ = now;
  if (std::exchange(not_asked_, false)) review_watch(now);
}

// ---- Processes

bool RingMonitor::observe(Subject& s, MonotonicTime now) {
  const NodeReading reading = look_(s.name);
  if (reading.pid != 0) {
    const bool same =
        reading.pid == s.pid && !s.ended &&
        (s.incarnation == 0 || reading.incarnation == 0 || reading.incarnation == s.incarnation);
    if (!same) {
      adopt(s, reading.pid, reading.incarnation, now);
      return false;
    }
    if (s.incarnation == 0) s.incarnation = reading.incarnation;
    s.real_time = reading.real_time;
    note_recovery(s, reading, now);
    return true;
  }
  const bool never_seen = s.pid == 0;
  // It was started, and it loads.
  if (!reading.starting) {
    s.starting_since.reset();
  } else if (now - s.starting_since.value_or(now) < patience_.start_deadline) {
    s.starting_since = s.starting_since.value_or(now);
    return false;
  }
  const nanoseconds grace = std::min<nanoseconds>(longest_start_grace, patience_.start_deadline / 2);
  if (never_seen && now - std::max(begun_, last_void_) < grace) return false;
  if (now < s.expected_until && !s.ended) return false;
  if (never_seen && !count_absence(s, now)) return false;
  accuse(s, s.ended ? FaultClass::exited : FaultClass::absent, now, {});
  return false;
}

/// @return whether it was missed often enough
bool RingMonitor::count_absence(Subject& s, MonotonicTime now) {
  if (!patience_.absence_counts_misses) return true;
  const MonotonicTime since = std::max({s.first_seen, begun_, last_void_});
  const auto periods = (now - since) / patience_.period;
  if (periods > s.misses && s.misses < patience_.misses) {
    ++s.misses;
    if (!s.first_evidence) s.first_evidence = since;
    report(s, LivenessVerdict::miss, now);
  }
  return s.misses >= patience_.misses;
}

void RingMonitor::note_recovery(Subject& s, const NodeReading& reading, MonotonicTime now) {
  if (!s.recovery || !s.recovery->started) return;
  const auto& page = reading.page;
  const bool up =
      page && page->pid == s.pid && page->turns > 0 && page->state != 0 && page->state == page->desired;
  if (up) {
    actions_.emplace_back(Recovered{s.name, s.incarnation, s.recovery->fault, now, now - s.recovery->since});
  }
  if (up || now >= s.recovery->give_up) s.recovery.reset();
}

void RingMonitor::adopt(Subject& s, pid_t pid, std::uint32_t incarnation, MonotonicTime now) {
  // A process that came after the last one needs time before it is asked; one that was there before this node
  // does not.
  const bool restarted = s.pid != 0 || s.lost;
  clear_evidence(s);
  s.pid = pid;
  s.starting_since.reset();
  s.last_excused.reset();
  s.incarnation = incarnation;
  s.first_seen = now;
  s.not_before = now;  // the wait was for another process
  s.ended = false;
  s.heard = false;
  s.state = ros::State::unknown;
  s.desired = ros::State::unknown;
  s.work_done.reset();
  s.cpu.clear();
  s.ask_from =
      s.downstream ? now : now + (restarted ? nanoseconds(settling) : patience_.misses * patience_.period);
  actions_.emplace_back(Follow{s.name, pid});
}

void RingMonitor::on_exit(std::string_view subject, pid_t pid, MonotonicTime now) {
  Subject* s = find(subject);
  if (s == nullptr || s->pid != pid || s->ended) return;
  s->ended = true;
  s->lost = true;
  clear_evidence(*s);
  s->first_evidence = now;
  observe(*s, now);
  review_watch(now);
}

void RingMonitor::clear_evidence(Subject& s) {
  s.nonce = 0;
  s.suspected = 0;
  s.wrong.clear();
  s.misses = 0;
  s.wrong_in_row = 0;
  s.not_checking_in_row = 0;
  s.not_working_in_row = 0;
  s.large_in_row = 0;
  s.overdue_in_row = 0;
  s.busy_in_row = 0;
  s.unanswered.clear();
  s.excused_from.reset();
  s.first_evidence.reset();
}

/// The process so far is not judged any more.
void RingMonitor::expect_another(Subject& s) {
  s.pid = 0;
  s.incarnation = 0;
  s.ended = false;
}

void RingMonitor::accuse(Subject& s, FaultClass fault, MonotonicTime now, std::string detail) {
  s.lost = true;
  if (s.accused || now < s.not_before) return;
  s.accused = now;
  Accusation accusation;
  accusation.subject = s.name;
  accusation.fault = fault;
  accusation.pid = s.pid;
  accusation.incarnation = s.incarnation;
  accusation.generation = membership_.generation;
  accusation.misses = static_cast<std::uint32_t>(s.misses);
  accusation.first_evidence = s.first_evidence.value_or(now);
  accusation.decided = now;
  accusation.detail = detail;
  s.recovery = Subject::Recovery{fault, accusation.first_evidence, false, {}};
  actions_.emplace_back(Accuse{std::move(accusation)});
  report(s, LivenessVerdict::accused, now, std::move(detail));
  std::get<Report>(actions_.back()).fault = fault;
}

void RingMonitor::on_outcome(std::string_view subject, const RestartOutcome& outcome, MonotonicTime now) {
  using What = RestartOutcome::What;
  Subject* s = find(subject);
  if (s == nullptr || !s->accused) return;  // of another generation
  s->accused.reset();
  report(*s, LivenessVerdict::outcome, now, outcome.reason);
  std::get<Report>(actions_.back()).outcome = outcome.what;
  clear_evidence(*s);
  switch (outcome.what) {
    case What::restarted:
      s->not_before = now;
      s->expected_until = now + patience_.start_deadline;
      if (outcome.pid != 0) adopt(*s, outcome.pid, 0, now);
      if (s->recovery) {
        s->recovery->started = true;
        s->recovery->give_up = now + patience_.start_deadline;
      }
      break;
    case What::renewed:
      s->not_before = now;
      s->expected_until = now + patience_.start_deadline;
      expect_another(*s);
      break;
    case What::under_way:
      // Its restarter may die of the same fault.
      s->not_before = now + std::min<nanoseconds>(retry_wait, patience_.start_deadline);
      s->expected_until = s->not_before;
      expect_another(*s);
      break;
    case What::not_believed:
      s->not_before = now + patience_.period;
      break;
    case What::held:
      s->not_before = outcome.not_before.value_or(now + held_wait);
      break;
    case What::backing_off:
    case What::quarantined:
    case What::stopping:
    case What::unkillable:
    case What::cannot_start:
    case What::communication:
      s->not_before = std::max(outcome.not_before.value_or(now + retry_wait), now);
      break;
  }
  if (outcome.what != What::restarted) s->recovery.reset();
  if (outcome.what == What::restarted || outcome.what == What::renewed || outcome.what == What::under_way)
    observe(*s, now);
  review_watch(now);
}

void RingMonitor::report(const Subject& s, LivenessVerdict verdict, MonotonicTime now, std::string detail) {
  Report report;
  report.subject = s.name;
  report.verdict = verdict;
  report.incarnation = s.incarnation;
  report.state = s.state;
  report.misses = static_cast<std::uint32_t>(s.misses);
  report.answer_age = now - s.last_answer;
  report.detail = std::move(detail);
  actions_.emplace_back(std::move(report));
}

// ---- Which nodes to watch

bool RingMonitor::is_troubled(const Subject& s, MonotonicTime now) const {
  if (s.lost || s.accused) return true;
  // A node that gets a CPU only now and then watches badly.
  if (s.last_excused && now - *s.last_excused < RingPatience::starved) return true;
  // A node not heard yet may not have been discovered yet.
  const bool known = s.heard || now - std::max(s.first_seen, last_void_) >= patience_.start_deadline;
  return s.misses > 0 && known;
}

RingMonitor::Subject& RingMonitor::watch(std::string_view name, bool downstream, MonotonicTime now) {
  Subject& s = subjects_.emplace_back();
  s.name = name;
  s.downstream = downstream;
  s.first_seen = now;
  s.last_answer = now;
  observe(s, now);
  return s;
}

/// The downstream, what lies behind it while that is troubled, and the upstream when it does not ask.
void RingMonitor::review_watch(MonotonicTime now) {
  std::vector<std::string_view> wanted;
  const auto here = membership_.position_of(self_);
  const std::size_t size = membership_.members.size();
  for (std::size_t step = 1; here && step < size; ++step) {
    const std::string_view name = membership_.after(*here, step);
    wanted.push_back(name);
    Subject* s = find(name);
    if (s == nullptr) s = &watch(name, step == 1, now);
    if (!is_troubled(*s, now)) break;
  }
  if (here && size > 1 && not_asked_) {
    const std::string_view upstream = membership_.after(*here, size - 1);
    if (find(upstream) == nullptr) watch(upstream, false, now);
    wanted.push_back(upstream);
  }
  for (auto s = subjects_.begin(); s != subjects_.end();) {
    const bool comes_up = s->recovery && s->recovery->started;
    const bool keep =
        s->accused || comes_up || std::find(wanted.begin(), wanted.end(), s->name) != wanted.end();
    if (!keep) actions_.emplace_back(Unwatch{s->name});
    s = keep ? s + 1 : subjects_.erase(s);
  }
}

void RingMonitor::on_membership(Membership membership, MonotonicTime now) {
  if (membership == membership_) return;
  for (const Subject& s : subjects_) actions_.emplace_back(Unwatch{s.name});
  subjects_.clear();
  former_ = std::exchange(membership_, std::move(membership));  // the actions' names live on
  last_asked_ = now;
  not_asked_ = false;
  self_nonce_ = 0;
  self_failures_ = 0;
  asked_self_.clear();
  review_watch(now);
}

}  // namespace srfs::suite
