// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/ring/ring_monitor.hpp"

#include <algorithm>
#include <deque>
#include <map>
#include <memory>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace srfs::suite {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using testing::UnorderedElementsAre;
using What = RestartOutcome::What;

/// The monitor of node "a" in a ring of five, and its view of the other nodes. Unless a test changes it, all
/// nodes run and answer. Time advances in rounds of 100 ms; an answer takes 1 ms.
class RingMonitorTest : public testing::Test {
 protected:
  struct Other {
    NodeReading reading;
    bool answers = true;
    bool turns = true;  ///< the heartbeat page is fresh
    CheckAnswer answer;
    CpuTotals cpu{};
    bool starves = false;  ///< the process waits for a CPU until `fed`
  };

  void SetUp() override {
    pid_t pid = 100;
    for (const char* name : {"b", "c", "d", "e"}) start(name, ++pid, 1);
    make({1, {"a", "b", "c", "d", "e"}});
  }
  void make(Membership membership) {
    monitor_ = std::make_unique<RingMonitor>(
        "a", patience_, std::move(membership), [this](std::string_view name) { return look(name); }, 42, now_,
        [this](std::string_view name, pid_t, bool) { return look_at_cpu(name); });
    drain();
  }
  void start(const std::string& name, pid_t pid, std::uint32_t incarnation) {
    Other& other = others_[name];
    other = {};
    other.reading.pid = pid;
    other.reading.incarnation = incarnation;
    other.reading.page = HeartbeatPage::Reading{};
    other.reading.page->pid = pid;
    other.reading.page->incarnation = incarnation;
    other.reading.page->turns = 1000;
    other.reading.page->last_turn = now_;
    other.reading.page->state = other.reading.page->desired = static_cast<std::uint32_t>(ros::State::active);
    other.answer.state = ros::State::active;
    other.answer.desired = ros::State::active;
    other.answer.generation = 1;
  }
  /// Ends the node's process: frees the lock and signals the pidfd.
  void exit(const std::string& name) {
    Other& other = others_[name];
    const pid_t pid = std::exchange(other.reading.pid, 0);
    other.reading.incarnation = 0;
    other.answers = other.turns = false;
    monitor_->on_exit(name, pid, now_);
    drain();
  }
  /// The node stops, loops or deadlocks: no turn, no answer.
  void hang(const std::string& name) { others_[name].answers = others_[name].turns = false; }

  NodeReading look(std::string_view name) {
    Other& other = others_[std::string(name)];
    NodeReading reading = other.reading;
    if (other.turns && reading.page) reading.page->last_turn = now_;
    return reading;
  }

  /// Its downstream hangs, so it checks itself; it heard itself before, and hears nothing from now on.
  void doubt_itself() {
    rounds(40);
    others_["b"].answers = false;
    rounds(2);
    hang("b");
    hears_itself_ = false;
  }

  /// All answers, its own too, come so many rounds late.
  void slow_rounds(int n, std::size_t late) {
    const bool answers = std::exchange(others_["b"].answers, false);
    hears_itself_ = false;
    for (int i = 0; i < n; ++i) {
      round();
      if (!asks_.empty()) asked_.push_back(asks_.front());
      if (asked_.size() > late) {
        if (answers) answer(asked_.front());
        asked_.pop_front();
      }
      asked_itself_.push_back(self_nonce_);
      if (asked_itself_.size() > late) {
        monitor_->on_self_answer(asked_itself_.front(), now_);
        asked_itself_.pop_front();
      }
      drain();
    }
    others_["b"].answers = answers;
  }

  /// Takes the CPU from the node: no turn, no answer, and the kernel's accounting shows why.
  void starve(const std::string& name) {
    hang(name);
    others_[name].starves = true;
    starved_from_ = now_;
  }
  std::optional<CpuTotals> look_at_cpu(std::string_view name) {
    if (!kernel_tells_) return std::nullopt;
    Other& other = others_[std::string(name)];
    CpuTotals totals = other.cpu;
    if (other.starves) {
      totals.waited += now_ - starved_from_;
      totals.any_waited += now_ - starved_from_;
    }
    return totals;
  }

  void drain() {
    while (auto action = monitor_->next_action()) {
      if (const auto* accuse = std::get_if<RingMonitor::Accuse>(&*action)) {
        accusations_.push_back(accuse->accusation);
      } else if (const auto* report = std::get_if<RingMonitor::Report>(&*action)) {
        reports_.push_back(*report);
        report_subjects_.emplace_back(report->subject);
      } else if (const auto* ask = std::get_if<RingMonitor::Ask>(&*action)) {
        asks_.emplace_back(*ask);
      } else if (const auto* self = std::get_if<RingMonitor::AskSelf>(&*action)) {
        self_nonce_ = self->nonce;
        ++self_checks_;
      } else if (std::holds_alternative<RingMonitor::ExitSelf>(*action)) {
        ++exits_;
      } else if (std::holds_alternative<RingMonitor::ReadMembership>(*action)) {
        ++membership_reads_;
      } else if (const auto* recovered = std::get_if<RingMonitor::Recovered>(&*action)) {
        recoveries_.emplace_back(std::string(recovered->subject), recovered->fault, recovered->took);
      } else if (const auto* starved = std::get_if<RingMonitor::Starved>(&*action)) {
        (starved->report ? starved_reports_ : starved_notes_).push_back(*starved);
      } else if (const auto* follow = std::get_if<RingMonitor::Follow>(&*action)) {
        followed_.emplace_back(std::string(follow->subject), follow->pid);
      }
    }
  }

  /// One period: the timer, then the answers. Our own answer comes first or last, as on a loaded machine.
  void round(nanoseconds late = nanoseconds(0), nanoseconds waited = nanoseconds(0)) {
    now_ += milliseconds(99) + late;
    asks_.clear();
    self_nonce_ = 0;
    if (upstream_asks_) monitor_->on_asked("e", monitor_->membership().generation, now_);
    monitor_->on_period(now_, late, waited);
    drain();
    now_ += milliseconds(1);
    for (const auto& ask : std::vector<RingMonitor::Ask>(asks_)) {
      if (others_[std::string(ask.subject)].answers) answer(ask);
    }
    if (hears_itself_ && self_nonce_ != 0) monitor_->on_self_answer(self_nonce_, now_);
    drain();
  }
  void rounds(int n) {
    for (int i = 0; i < n; ++i) round();
  }
  void answer(const RingMonitor::Ask& ask) {
    Other& other = others_[std::string(ask.subject)];
    CheckAnswer answer = other.answer;
    answer.nonce = ask.nonce;
    if (answer.incarnation == 0) answer.incarnation = other.reading.incarnation;
    monitor_->on_answer(ask.subject, answer, now_);
    drain();
  }
  void conclude(const std::string& subject, What what, pid_t pid = 0) {
    RestartOutcome outcome;
    outcome.what = what;
    outcome.pid = pid;
    monitor_->on_outcome(subject, outcome, now_);
    drain();
  }
  /// The restarter has finished: a new process is starting.
  void restart(const std::string& name) {
    const pid_t pid = ++last_pid_;
    const std::uint32_t incarnation = ++last_incarnation_;
    start(name, pid, incarnation);
    others_[name].reading.page->turns = 0;
    others_[name].reading.page->state = static_cast<std::uint32_t>(ros::State::configuring);
    others_[name].answers = others_[name].turns = false;
    conclude(name, What::restarted, pid);
  }
  void come_up(const std::string& name) {
    others_[name].reading.page->turns = 1;
    others_[name].reading.page->state = static_cast<std::uint32_t>(ros::State::active);
    others_[name].answers = others_[name].turns = true;
  }
  [[nodiscard]] std::vector<std::string> accused() const {
    std::vector<std::string> names;
    for (const auto& a : accusations_) names.push_back(a.subject + ": " + to_text(a.fault));
    return names;
  }
  [[nodiscard]] std::size_t reported(LivenessVerdict verdict) const {
    return static_cast<std::size_t>(
        std::count_if(reports_.begin(), reports_.end(), [&](const auto& r) { return r.verdict == verdict; }));
  }

  RingPatience patience_;
  MonotonicTime now_{seconds(1000)};
  std::map<std::string, Other> others_;
  std::unique_ptr<RingMonitor> monitor_;
  bool hears_itself_ = true;
  bool upstream_asks_ = true;
  bool kernel_tells_ = true;
  MonotonicTime starved_from_;
  std::vector<RingMonitor::Starved> starved_notes_;
  std::vector<RingMonitor::Starved> starved_reports_;
  std::uint64_t self_nonce_ = 0;
  std::deque<RingMonitor::Ask> asked_;
  std::deque<std::uint64_t> asked_itself_;
  pid_t last_pid_ = 500;
  std::uint32_t last_incarnation_ = 50;
  int self_checks_ = 0;
  int exits_ = 0;
  int membership_reads_ = 0;
  std::vector<RingMonitor::Ask> asks_;
  std::vector<Accusation> accusations_;
  std::vector<RingMonitor::Report> reports_;
  std::vector<std::string> report_subjects_;
  std::vector<std::pair<std::string, pid_t>> followed_;
  std::vector<std::tuple<std::string, FaultClass, nanoseconds>> recoveries_;
};

TEST_F(RingMonitorTest, ChecksItsDownstreamEachPeriodAndNobodyElse) {
  rounds(10);
  EXPECT_THAT(monitor_->watched(), ElementsAre("b"));
  EXPECT_EQ(reported(LivenessVerdict::alive), 10U);
  EXPECT_THAT(accusations_, IsEmpty());
  EXPECT_EQ(self_checks_, 0) << "a check of itself is for doubt only";
  EXPECT_THAT(followed_, ElementsAre(std::pair<std::string, pid_t>("b", 101)));
}

TEST_F(RingMonitorTest, NeverUsesANonceTwice) {
  std::set<std::uint64_t> nonces;
  for (int i = 0; i < 1000; ++i) {
    round();
    ASSERT_THAT(asks_, SizeIs(1));
    EXPECT_TRUE(nonces.insert(asks_.front().nonce).second);
  }
}

// ---- Silence

TEST_F(RingMonitorTest, TakesThreeUnansweredChecksAndAStalePageForDeath) {
  round();
  hang("b");
  rounds(3);  // a check counts as missed at the next round
  EXPECT_THAT(accusations_, IsEmpty());
  round();
  ASSERT_THAT(accused(), ElementsAre("b: silent"));
  EXPECT_EQ(accusations_[0].misses, 3U);
  EXPECT_EQ(accusations_[0].pid, 101);
  EXPECT_EQ(accusations_[0].incarnation, 1U);
  EXPECT_EQ(accusations_[0].generation, 1U);
  EXPECT_EQ(accusations_[0].decided - accusations_[0].first_evidence, milliseconds(301));
}

TEST_F(RingMonitorTest, CountsAnewAfterAnAnswer) {
  round();
  for (int i = 0; i < 10; ++i) {
    others_["b"].answers = false;
    rounds(2);
    others_["b"].answers = true;
    round();
  }
  EXPECT_THAT(accusations_, IsEmpty());
}

TEST_F(RingMonitorTest, TakesAnAnswerThatIsLateButComesBeforeItsOwn) {
  round();
  for (int i = 0; i < 10; ++i) {
    others_["b"].answers = false;
    round();
    const auto late = asks_;
    now_ += milliseconds(99);
    monitor_->on_period(now_, nanoseconds(0));
    drain();
    answer(late.front());
    monitor_->on_self_answer(self_nonce_, now_);
    drain();
  }
  EXPECT_THAT(accusations_, IsEmpty());
  EXPECT_EQ(reported(LivenessVerdict::miss), 0U);
}

TEST_F(RingMonitorTest, TakesSilenceWithAFreshPageForACommunicationFault) {
  round();
  others_["b"].answers = false;
  rounds(12);
  EXPECT_THAT(accusations_, IsEmpty()) << "DDS may repair it by itself";
  rounds(6);
  EXPECT_THAT(accused(), ElementsAre("b: deaf"));
}

TEST_F(RingMonitorTest, CallsADeafNodeSilentWhenItsPageGrowsStaleToo) {
  round();
  others_["b"].answers = false;
  rounds(18);
  conclude("b", What::communication);
  hang("b");
  rounds(20);
  EXPECT_THAT(accused(), ElementsAre("b: deaf", "b: silent"));
}

TEST_F(RingMonitorTest, TakesAPageOfAnotherProcessForNone) {
  round();
  others_["b"].answers = false;
  others_["b"].reading.page->pid = 7;  // a predecessor's
  rounds(4);
  EXPECT_THAT(accusations_, IsEmpty()) << "it may be starting";
  rounds(30);
  EXPECT_THAT(accused(), ElementsAre("b: silent"));
}

// ---- Starvation

TEST_F(RingMonitorTest, NeverAccusesANodeThatOnlyWaitsForACpu) {
  round();
  starve("b");
  rounds(6000);
  EXPECT_THAT(accusations_, IsEmpty());
  EXPECT_GT(reported(LivenessVerdict::miss), 100U) << "what is seen is reported all the same";
}

TEST_F(RingMonitorTest, ReportsAStarvedNodeEachTenSecondsAndOneOfRealTimeEachSecond) {
  round();
  starve("b");
  rounds(90);
  EXPECT_THAT(starved_notes_, SizeIs(1)) << "who takes the CPUs is to be measured meanwhile";
  EXPECT_THAT(starved_reports_, IsEmpty());
  rounds(15);
  ASSERT_THAT(starved_reports_, SizeIs(1));
  EXPECT_GE(starved_reports_[0].silent_for, seconds(10));
  EXPECT_GE(starved_reports_[0].waited, milliseconds(9'800));
  EXPECT_EQ(reported(LivenessVerdict::starved), 1U);
  rounds(100);
  EXPECT_THAT(starved_reports_, SizeIs(2));
  others_["b"].reading.real_time = true;
  others_["b"].starves = false;
  come_up("b");
  rounds(3);
  starve("b");
  rounds(15);
  EXPECT_THAT(starved_reports_, SizeIs(3));
  EXPECT_THAT(accusations_, IsEmpty());
}

TEST_F(RingMonitorTest, AccusesAsSoonAsEverWhoHangsThoughItStarvedBefore) {
  round();
  starve("b");
  rounds(50);
  others_["b"].cpu.waited += now_ - starved_from_;
  others_["b"].cpu.any_waited += now_ - starved_from_;
  others_["b"].starves = false;  // the node has a CPU again but makes no turn
  rounds(2);
  EXPECT_THAT(accusations_, IsEmpty());
  rounds(2);
  EXPECT_THAT(accused(), ElementsAre("b: silent"));
}

TEST_F(RingMonitorTest, TakesTheClockForAllTimesWhereTheKernelDoesNotTell) {
  kernel_tells_ = false;
  round();
  starve("b");
  rounds(4);
  EXPECT_THAT(accused(), ElementsAre("b: silent"));
}

TEST_F(RingMonitorTest, FindsALoopThatGetsLittleOfTheCpuByWhatItHasUsed) {
  round();
  starve("b");
  others_["b"].starves = false;
  for (int i = 0; i < 26; ++i) {  // a tenth of a CPU
    if (i == 18) {
      EXPECT_THAT(accused(), IsEmpty()) << "it may be doing something useful";
    }
    others_["b"].cpu.waited += milliseconds(90);
    others_["b"].cpu.any_waited += milliseconds(90);
    others_["b"].cpu.ran += milliseconds(10);
    round();
  }
  EXPECT_THAT(accused(), ElementsAre("b: silent"));
}

TEST_F(RingMonitorTest, TakesALateAnswerOfANodeThatWaitedForACpuForARightOne) {
  round();
  starve("b");
  rounds(3);
  const auto late = asks_;
  rounds(2);
  answer(late.front());
  EXPECT_EQ(monitor_->counters().late_answers, 1U);
  EXPECT_EQ(monitor_->counters().stale_answers, 0U);
  answer(late.front());
  EXPECT_EQ(monitor_->counters().stale_answers, 1U) << "once";
  EXPECT_TRUE(monitor_->is_as_desired("b"));
}

TEST_F(RingMonitorTest, TakesNoLateAnswerOfANodeThatCouldHaveAnsweredInTime) {
  round();
  hang("b");
  round();
  const auto late = asks_;
  rounds(2);
  answer(late.front());
  EXPECT_EQ(monitor_->counters().stale_answers, 1U);
  rounds(2);
  EXPECT_THAT(accused(), ElementsAre("b: silent"));
}

TEST_F(RingMonitorTest, GivesAStartThatWaitsForACpuAllTheTimeItNeeds) {
  round();
  exit("b");
  restart("b");
  others_["b"].starves = true;
  starved_from_ = now_;
  rounds(300);
  EXPECT_THAT(accused(), ElementsAre("b: exited"));
  others_["b"].cpu.any_waited += now_ - starved_from_;
  others_["b"].starves = false;  // the node hangs while it starts
  rounds(35);
  EXPECT_THAT(accused(), ElementsAre("b: exited", "b: start overdue"));
}

TEST_F(RingMonitorTest, WatchesBehindAStarvedNodeAlsoWhileThatAnswersNowAndThen) {
  round();
  starve("b");
  rounds(6);
  EXPECT_THAT(monitor_->watched(), ElementsAre("b", "c"));
  others_["b"].cpu.waited += now_ - starved_from_;
  others_["b"].cpu.any_waited += now_ - starved_from_;
  others_["b"].starves = false;
  come_up("b");
  rounds(20);
  EXPECT_THAT(monitor_->watched(), ElementsAre("b", "c"));
  hang("c");
  rounds(10);
  EXPECT_THAT(accused(), ElementsAre("c: silent"));
  conclude("c", What::renewed);
  come_up("c");
  rounds(120);
  EXPECT_THAT(monitor_->watched(), ElementsAre("b")) << "ten seconds after the last excuse";
}

TEST_F(RingMonitorTest, LeavesTheStartDeadlineToWhoIsOnTheWayToItsLock) {
  others_["b"].reading.pid = 0;
  others_["b"].reading.starting = true;
  make({1, {"a", "b", "c", "d", "e"}});
  rounds(29);
  EXPECT_THAT(accusations_, IsEmpty());
  rounds(2);
  EXPECT_THAT(accused(), ElementsAre("b: absent")) << "the restarter looks whether it hangs";
}

TEST_F(RingMonitorTest, ExcusesAWorkThreadThatIsBlockedWhileTheMiddlewareHasNoCpu) {
  round();
  hang("b");
  for (int i = 0; i < 100; ++i) {
    others_["b"].cpu.any_waited += milliseconds(95);
    round();
  }
  EXPECT_THAT(accused(), ElementsAre("b: silent")) << "a twentieth of the time is its own";
  EXPECT_GE(accusations_[0].decided - accusations_[0].first_evidence, seconds(4));
}

TEST_F(RingMonitorTest, CountsOnWhenItWaitedForACpuItself) {
  round();
  hang("b");
  rounds(3);
  round(milliseconds(120), milliseconds(115));
  EXPECT_THAT(accusations_, IsEmpty()) << "that round says nothing";
  EXPECT_EQ(monitor_->counters().void_rounds, 1U);
  rounds(2);
  EXPECT_THAT(accused(), ElementsAre("b: silent")) << "what was counted before stands";
}

TEST_F(RingMonitorTest, TakesAnAnswerThatItReadsLateForWantOfACpuOfItsOwn) {
  round();
  others_["b"].answers = false;
  round();
  const auto unread = asks_;
  round(milliseconds(300), milliseconds(300));
  answer(unread.front());
  EXPECT_EQ(monitor_->counters().late_answers, 1U);
  EXPECT_EQ(reported(LivenessVerdict::miss), 0U);
}

TEST_F(RingMonitorTest, AccusesWhoWantsAllCpusTwoSecondsLong) {
  round();
  Footprint footprint;
  footprint.busy_threads_cap = 2;
  footprint.busy_threads = 8;
  monitor_->on_footprint("b", 101, footprint, now_);
  drain();
  rounds(10);
  EXPECT_THAT(accusations_, IsEmpty());
  monitor_->on_footprint("b", 101, footprint, now_);
  drain();
  EXPECT_THAT(accused(), ElementsAre("b: taking the CPUs"));
}

TEST_F(RingMonitorTest, AccusesWhoWantsAllCpusAlsoWhenItGetsHardlyOneItself) {
  round();
  Footprint footprint;
  footprint.busy_threads_cap = 2;
  footprint.busy_threads = 8;
  monitor_->on_footprint("b", 101, footprint, now_);
  drain();
  round(seconds(1));  // late, although a CPU was available
  EXPECT_EQ(monitor_->counters().void_rounds, 1U);
  monitor_->on_footprint("b", 101, footprint, now_);
  drain();
  EXPECT_THAT(accused(), ElementsAre("b: taking the CPUs"));
}

TEST_F(RingMonitorTest, AccusesNobodyWhoLeavesACpuOrGivesWayToAllOthers) {
  round();
  Footprint footprint;
  footprint.busy_threads_cap = 2;
  for (int second = 0; second < 20; ++second) {
    footprint.busy_threads = second % 2 == 0 ? 1 : 2;
    monitor_->on_footprint("b", 101, footprint, now_);
    drain();
    rounds(10);
  }
  footprint.busy_threads_cap = 0;
  footprint.busy_threads = 8;
  for (int second = 0; second < 20; ++second) {
    monitor_->on_footprint("b", 101, footprint, now_);
    drain();
    rounds(10);
  }
  EXPECT_THAT(accusations_, IsEmpty());
}

// ---- Clean hands

TEST_F(RingMonitorTest, CountsNoMissWhileItDoesNotHearItself) {
  round();
  hang("b");
  hears_itself_ = false;
  rounds(6);
  EXPECT_THAT(accusations_, IsEmpty());
  EXPECT_EQ(reported(LivenessVerdict::miss), 0U);
  EXPECT_EQ(exits_, 0);
}

TEST_F(RingMonitorTest, ExitsWhenItHasNotHeardItselfForTwiceTheMisses) {
  doubt_itself();
  rounds(6);
  EXPECT_EQ(exits_, 0);
  rounds(1);
  EXPECT_EQ(exits_, 1);
  EXPECT_THAT(accusations_, IsEmpty());
}

TEST_F(RingMonitorTest, ExitsLaterWhenItHasNeverHeardItself) {
  round();
  hang("b");
  hears_itself_ = false;
  rounds(31);
  EXPECT_EQ(exits_, 0) << "its endpoints may not have found each other";
  rounds(1);
  EXPECT_EQ(exits_, 1);
}

TEST_F(RingMonitorTest, ExitsAsSoonAsEverWhenItWasNeverInDoubtForLong) {
  rounds(40);
  hang("b");
  hears_itself_ = false;
  rounds(7);
  EXPECT_EQ(exits_, 0);
  rounds(1);
  EXPECT_EQ(exits_, 1);
}

TEST_F(RingMonitorTest, ACheckOfItselfThatFailedInItsStartDoesNotCountHoursLater) {
  hang("b");
  hears_itself_ = false;
  rounds(3);
  come_up("b");
  rounds(100);
  hang("b");
  rounds(7);
  EXPECT_EQ(exits_, 0);
  rounds(1);
  EXPECT_EQ(exits_, 1);
}

TEST_F(RingMonitorTest, OnASlowMachineABurstOfItsOwnAnswersIsOneMiss) {
  round();
  slow_rounds(50, 5);
  hang("b");
  slow_rounds(1, 10);  // nothing comes any more
  slow_rounds(4, 10);
  const auto before = reported(LivenessVerdict::miss);
  for (const std::uint64_t nonce : asked_itself_) monitor_->on_self_answer(nonce, now_);
  drain();
  EXPECT_EQ(reported(LivenessVerdict::miss), before + 1);
  EXPECT_THAT(accusations_, IsEmpty());
}

TEST_F(RingMonitorTest, OnASlowMachineABurstOfAnswersCountsItsUndoneWorkOnce) {
  round();
  slow_rounds(50, 5);
  others_["b"].answer.oldest_due = seconds(60);
  for (const auto& ask : asked_) answer(ask);
  EXPECT_THAT(accusations_, IsEmpty());
  asked_.clear();
  slow_rounds(12, 5);
  EXPECT_THAT(accused(), ElementsAre("b: not working"));
}

TEST_F(RingMonitorTest, OnASlowMachineANodeWithoutOthersAsksItselfNoMore) {
  round();
  slow_rounds(50, 5);
  monitor_->on_membership(Membership{}, now_);
  drain();
  const int checks = self_checks_;
  rounds(50);
  EXPECT_EQ(self_checks_, checks);
  EXPECT_EQ(exits_, 0);
}

TEST_F(RingMonitorTest, OnASlowMachineItTakesNeitherItselfNorOthersForDeaf) {
  round();
  slow_rounds(200, 14);
  EXPECT_EQ(exits_, 0);
  EXPECT_THAT(accusations_, IsEmpty());
  EXPECT_GT(reported(LivenessVerdict::alive), 180U);
  EXPECT_TRUE(monitor_->is_as_desired("b"));
  others_["b"].answers = false;
  rounds(14);
  EXPECT_EQ(exits_, 0) << "it is slow";
  rounds(4);
  EXPECT_EQ(exits_, 1) << "nothing any more";
}

TEST_F(RingMonitorTest, OnASlowMachineItFindsWhatHangs) {
  round();
  slow_rounds(50, 5);
  hang("b");
  others_["b"].reading.page->last_turn = now_;
  slow_rounds(6, 5);
  EXPECT_THAT(accusations_, IsEmpty()) << "the answer may come as late as its own";
  slow_rounds(3, 5);
  EXPECT_THAT(accused(), ElementsAre("b: silent"));
  EXPECT_EQ(exits_, 0);
}

TEST_F(RingMonitorTest, OnASlowMachineItFindsAnAnswerThatShowsAFault) {
  round();
  slow_rounds(50, 5);
  others_["b"].answer.worker_busy = seconds(60);
  others_["b"].answer.worker_deadline = seconds(5);
  slow_rounds(6, 5);
  EXPECT_THAT(accused(), ElementsAre("b: worker frozen"));
}

TEST_F(RingMonitorTest, TakesANodeThatAnswersLateForDeafWhenItHearsItselfInTime) {
  round();
  others_["b"].answers = false;
  std::deque<RingMonitor::Ask> asked;
  for (int i = 0; i < 18; ++i) {
    round();
    asked.push_back(asks_.front());
    if (asked.size() <= 10) continue;
    answer(asked.front());
    asked.pop_front();
  }
  EXPECT_THAT(accused(), ElementsAre("b: deaf"));
}

TEST_F(RingMonitorTest, ANodeThatWaitedForACpuBetweenItsRoundsDoesNotTakeItselfForDeaf) {
  doubt_itself();
  for (int i = 0; i < 100; ++i) round(nanoseconds(0), milliseconds(80));
  EXPECT_EQ(exits_, 0) << "its timer came in time, and it had no time for more";
  for (int i = 0; i < 20; ++i) round();
  EXPECT_EQ(exits_, 1) << "with a CPU it is deaf";
}

TEST_F(RingMonitorTest, DoesNotExitForSelfChecksThatFailNowAndThen) {
  round();
  hang("b");
  for (int i = 0; i < 20; ++i) {
    hears_itself_ = i % 5 == 4;
    round();
  }
  EXPECT_EQ(exits_, 0);
}

TEST_F(RingMonitorTest, VoidsARoundWhoseTimerWasLate) {
  round();
  hang("b");
  rounds(3);
  round(milliseconds(51));
  EXPECT_THAT(accusations_, IsEmpty());
  EXPECT_EQ(monitor_->counters().void_rounds, 1U);
  rounds(2);
  EXPECT_THAT(accusations_, IsEmpty()) << "misses start anew";
  round();
  EXPECT_THAT(accused(), ElementsAre("b: silent"));
}

TEST_F(RingMonitorTest, AllowsATimerItsTolerance) {
  round();
  hang("b");
  for (int i = 0; i < 4; ++i) round(milliseconds(50));
  EXPECT_THAT(accused(), ElementsAre("b: silent"));
}

TEST_F(RingMonitorTest, JudgesNobodyWhenItWasItselfStoppedBetweenTimerAndAnswer) {
  round();
  others_["b"].answers = false;
  rounds(3);
  now_ += milliseconds(99);
  monitor_->on_period(now_, nanoseconds(0));
  drain();
  now_ += seconds(5);  // stopped here
  monitor_->on_self_answer(self_nonce_, now_);
  drain();
  EXPECT_THAT(accusations_, IsEmpty());
}

TEST_F(RingMonitorTest, KillsNobodyWhenAllWereStoppedAndGoOn) {
  rounds(3);
  for (int i = 0; i < 100; ++i) {
    // All nodes stop in the middle of a round, for one period up to a minute, and at last for an hour (like a
    // paused virtual machine). The downstream node resumes later.
    others_["b"].answers = false;
    others_["b"].turns = false;
    round();
    round(i == 99 ? nanoseconds(std::chrono::hours(1)) : milliseconds(60) + milliseconds(600) * i);
    round();
    others_["b"].answers = true;
    others_["b"].turns = true;
    round();
  }
  EXPECT_THAT(accusations_, IsEmpty());
}

TEST_F(RingMonitorTest, IgnoresAnAnswerToACheckOfItselfThatItDidNotMake) {
  round();
  hang("b");
  hears_itself_ = false;
  for (int i = 0; i < 6; ++i) {
    round();
    monitor_->on_self_answer(12345, now_);
    drain();
  }
  EXPECT_THAT(accusations_, IsEmpty());
  EXPECT_EQ(reported(LivenessVerdict::miss), 0U);
}

// ---- Exits

TEST_F(RingMonitorTest, AccusesAtOnceWhenTheProcessEnds) {
  round();
  exit("b");
  ASSERT_THAT(accused(), ElementsAre("b: exited"));
  EXPECT_EQ(accusations_[0].pid, 101);
  EXPECT_EQ(accusations_[0].first_evidence, now_);
}

TEST_F(RingMonitorTest, IsCalmAboutAnExitWhoseSuccessorRunsAlready) {
  round();
  start("b", 200, 2);
  monitor_->on_exit("b", 101, now_);
  drain();
  rounds(5);
  EXPECT_THAT(accusations_, IsEmpty());
  EXPECT_EQ(monitor_->process_of("b"), 200);
}

TEST_F(RingMonitorTest, IgnoresTheExitOfAProcessItDoesNotFollow) {
  round();
  monitor_->on_exit("b", 999, now_);
  monitor_->on_exit("nobody", 101, now_);
  drain();
  EXPECT_THAT(accusations_, IsEmpty());
}

TEST_F(RingMonitorTest, AccusesOnceUntilTheOutcomeIsKnown) {
  round();
  exit("b");
  rounds(50);
  const auto all = accused();
  EXPECT_EQ(std::count(all.begin(), all.end(), "b: exited"), 1);
}

TEST_F(RingMonitorTest, AccusesWhomNobodySawEndAfterAGraceOfItsOwnStart) {
  others_["b"].reading = {};
  make({1, {"a", "b", "c", "d", "e"}});
  rounds(9);
  EXPECT_THAT(accusations_, IsEmpty()) << "whoever starts the suite starts it in order";
  rounds(2);
  EXPECT_THAT(accused(), ElementsAre("b: absent"));
}

TEST_F(RingMonitorTest, MissesANodeThatNeverRanAsOftenAsASilentOneWhenToldTo) {
  patience_.absence_counts_misses = true;
  for (const char* name : {"b", "c"}) others_[name].reading = {};
  patience_.misses = 15;
  make({1, {"a", "b", "c", "d", "e"}});
  rounds(24);  // the grace period after its own start, then one miss per round
  EXPECT_THAT(accusations_, IsEmpty());
  rounds(2);
  ASSERT_THAT(accused(), ElementsAre("b: absent")) << "what lies behind it is not even missed yet";
  EXPECT_EQ(accusations_.front().misses, 15U);

  restart("b");
  come_up("b");
  rounds(5);
  EXPECT_THAT(monitor_->watched(), ElementsAre("b")) << "b answers: it has to raise c";
  rounds(50);
  EXPECT_THAT(accused(), ElementsAre("b: absent"));
}

TEST_F(RingMonitorTest, AccusesARestartedProcessThatEndsAgain) {
  round();
  exit("b");
  restart("b");
  rounds(2);
  exit("b");
  EXPECT_THAT(accused(), ElementsAre("b: exited", "b: exited"));
}

TEST_F(RingMonitorTest, GivesARestartTheStartDeadlineToTakeTheLock) {
  round();
  exit("b");
  conclude("b", What::restarted, 300);  // the lock stays free
  rounds(29);
  EXPECT_THAT(accused(), ElementsAre("b: exited"));
  rounds(2);
  EXPECT_THAT(accused(), ElementsAre("b: exited", "b: absent"));
}

TEST_F(RingMonitorTest, LooksAgainAfterASecondWhenSomebodyElseRestarts) {
  round();
  exit("b");
  conclude("b", What::under_way);
  rounds(9);
  EXPECT_THAT(accused(), ElementsAre("b: exited"));
  rounds(2);
  EXPECT_THAT(accused(), ElementsAre("b: exited", "b: absent")) << "that restarter may have died, too";
}

TEST_F(RingMonitorTest, AccusesAtOnceWhenWhatSomebodyElseStartedEndsAgain) {
  rounds(3);
  exit("b");
  conclude("b", What::under_way);
  start("b", 555, 2);
  rounds(1);
  exit("b");
  EXPECT_THAT(accused(), ElementsAre("b: exited", "b: exited"));
}

TEST_F(RingMonitorTest, WaitsAsLongAsTheBackOffSays) {
  round();
  exit("b");
  RestartOutcome outcome;
  outcome.what = What::backing_off;
  outcome.not_before = now_ + seconds(8);
  monitor_->on_outcome("b", outcome, now_);
  drain();
  rounds(79);
  EXPECT_THAT(accused(), ElementsAre("b: exited"));
  rounds(2);
  EXPECT_THAT(accused(), ElementsAre("b: exited", "b: exited"));
}

TEST_F(RingMonitorTest, TriesAgainEachSecondWhenARestartFailed) {
  for (const What what : {What::cannot_start, What::unkillable, What::stopping}) {
    accusations_.clear();
    others_.clear();
    SetUp();
    round();
    exit("b");
    conclude("b", what);
    rounds(9);
    EXPECT_THAT(accused(), SizeIs(1));
    rounds(2);
    EXPECT_THAT(accused(), SizeIs(2)) << to_text(what);
  }
}

TEST_F(RingMonitorTest, StartsItsEvidenceAnewWhenItWasNotBelieved) {
  round();
  hang("b");
  rounds(4);
  conclude("b", What::not_believed);
  rounds(3);
  EXPECT_THAT(accused(), SizeIs(1));
  round();
  EXPECT_THAT(accused(), SizeIs(2));
}

TEST_F(RingMonitorTest, GivesUpWaitingForARestarterThatNeverAnswers) {
  round();
  exit("b");
  rounds(302);
  const auto all = accused();
  EXPECT_EQ(std::count(all.begin(), all.end(), "b: exited"), 2);
}

TEST_F(RingMonitorTest, SaysHowLongItTookUntilTheRestartedNodeWasInItsDesiredState) {
  round();
  exit("b");
  restart("b");
  rounds(5);
  EXPECT_THAT(recoveries_, IsEmpty());
  come_up("b");
  rounds(5);
  EXPECT_THAT(recoveries_, ElementsAre(std::tuple("b", FaultClass::exited, milliseconds(599))));
}

TEST_F(RingMonitorTest, SeesTheRecoveryOfANodeItNoLongerChecks) {
  round();
  others_["c"].reading = {};
  others_["c"].answers = false;
  rounds(10);
  exit("b");
  ASSERT_THAT(accused(), ElementsAre("b: exited", "c: absent"));
  restart("b");
  restart("c");
  come_up("b");
  rounds(3);
  come_up("c");
  rounds(2);
  ASSERT_THAT(recoveries_, SizeIs(2));
  EXPECT_EQ(std::get<0>(recoveries_[1]), "c");
  EXPECT_THAT(monitor_->watched(), ElementsAre("b"));
}

// ---- Starts

TEST_F(RingMonitorTest, LeavesANodeThatStartsItsStartDeadline) {
  round();
  exit("b");
  restart("b");
  others_["b"].turns = false;
  rounds(29);
  EXPECT_THAT(accused(), ElementsAre("b: exited"));
  rounds(3);
  EXPECT_THAT(accused(), ElementsAre("b: exited", "b: start overdue"));
}

TEST_F(RingMonitorTest, LeavesATransitionTheStartDeadlineAndNoMore) {
  round();
  hang("b");
  others_["b"].reading.page->state = static_cast<std::uint32_t>(ros::State::configuring);
  others_["b"].reading.page->last_turn = now_;
  rounds(29);
  EXPECT_THAT(accusations_, IsEmpty());
  rounds(3);
  ASSERT_THAT(accused(), ElementsAre("b: silent"));
  EXPECT_THAT(accusations_[0].detail, HasSubstr("in configuring"));
}

TEST_F(RingMonitorTest, LeavesWhomItNeverHeardTheStartDeadlineToBeDiscovered) {
  others_["b"].answers = false;  // runs and makes turns, but DDS has not discovered it yet
  make({1, {"a", "b", "c", "d", "e"}});
  rounds(29);
  EXPECT_THAT(accusations_, IsEmpty());
  EXPECT_THAT(monitor_->watched(), ElementsAre("b"));
  rounds(3);
  EXPECT_THAT(accused(), ElementsAre("b: deaf"));
}

TEST_F(RingMonitorTest, SeesByThePageAloneThatAnUnknownNodeHangs) {
  hang("b");
  others_["b"].reading.page->last_turn = now_ - seconds(1);
  make({1, {"a", "b", "c", "d", "e"}});
  rounds(4);
  EXPECT_THAT(accused(), ElementsAre("b: silent"));
}

TEST_F(RingMonitorTest, OnlyReportsANodeThatRetriesByItself) {
  others_["b"].answer.state = ros::State::unconfigured;  // a device is missing; desired: active
  rounds(100);
  EXPECT_THAT(accusations_, IsEmpty());
  EXPECT_EQ(reported(LivenessVerdict::alive), 100U);
  EXPECT_EQ(reports_.back().state, ros::State::unconfigured);
}

// ---- Wrong answers

TEST_F(RingMonitorTest, GivesAVersionOnProbationTheStartDeadlineToReachItsDesiredState) {
  others_["b"].answer.state = ros::State::unconfigured;
  rounds(3);
  const auto after = [&](milliseconds lived, pid_t pid) {
    monitor_->on_trial("b", pid, lived, now_);
    drain();
  };
  after(patience_.start_deadline, 101);
  after(patience_.start_deadline, 101);
  after(patience_.start_deadline + milliseconds(1), 101);
  after(patience_.start_deadline + milliseconds(1), 999);
  EXPECT_FALSE(monitor_->is_as_desired("b"));
  EXPECT_THAT(accusations_, IsEmpty()) << "twice, of this process";
  after(patience_.start_deadline + milliseconds(1), 101);
  ASSERT_THAT(accusations_, SizeIs(1));
  EXPECT_EQ(accusations_[0].fault, FaultClass::start_overdue);
  EXPECT_THAT(accusations_[0].detail, HasSubstr("unconfigured instead of active on probation"));
}

TEST_F(RingMonitorTest, IsContentWithAVersionOnProbationThatWorksOrIsToldNotTo) {
  rounds(3);
  EXPECT_TRUE(monitor_->is_as_desired("b"));
  for (int i = 0; i < 5; ++i) monitor_->on_trial("b", 101, seconds(100), now_);
  others_["b"].answer.state = others_["b"].answer.desired = ros::State::inactive;
  rounds(3);
  for (int i = 0; i < 5; ++i) monitor_->on_trial("b", 101, seconds(100), now_);
  drain();
  EXPECT_THAT(accusations_, IsEmpty());
}

TEST_F(RingMonitorTest, AccusesANodeThatAnswersWellOfItsBadVersionOnceUntilThatHasAnOutcome) {
  rounds(3);
  const auto accuse = [&](pid_t pid) {
    monitor_->on_bad_version("b", pid, FaultClass::not_confirmed, "why", now_);
    drain();
  };
  accuse(999);
  monitor_->on_bad_version("nobody", 101, FaultClass::not_confirmed, "why", now_);
  EXPECT_THAT(accusations_, IsEmpty()) << "another process";
  accuse(101);
  accuse(101);
  ASSERT_THAT(accusations_, SizeIs(1));
  EXPECT_EQ(accusations_[0].fault, FaultClass::not_confirmed);
  EXPECT_EQ(accusations_[0].pid, 101);
  EXPECT_EQ(accusations_[0].detail, "why");

  monitor_->on_outcome("b", {RestartOutcome::What::not_believed, 101, std::nullopt, ""}, now_);
  drain();
  accuse(101);
  EXPECT_THAT(accusations_, SizeIs(1)) << "not again in the same period";
  rounds(2);
  accuse(101);
  EXPECT_THAT(accusations_, SizeIs(2));
}

TEST_F(RingMonitorTest, IgnoresAndCountsStaleAndUnknownNonces) {
  round();
  const auto old = asks_.front();
  hang("b");
  for (int i = 0; i < 3; ++i) {
    round();
    answer(old);
    CheckAnswer forged = others_["b"].answer;
    forged.incarnation = 1;
    for (const std::uint64_t nonce : {std::uint64_t{0}, std::uint64_t{77}, old.nonce + 1}) {
      forged.nonce = nonce;
      monitor_->on_answer("b", forged, now_);
      monitor_->on_answer("nobody", forged, now_);
      drain();
    }
  }
  round();
  EXPECT_THAT(accused(), ElementsAre("b: silent")) << "a dead node stays dead";
  EXPECT_EQ(monitor_->counters().stale_answers, 3U * 7U);
}

TEST_F(RingMonitorTest, AccusesWhoAnswersForAnotherIncarnation) {
  round();
  others_["b"].answer.incarnation = 9;
  rounds(3);
  EXPECT_THAT(accusations_, IsEmpty());
  round();
  ASSERT_THAT(accused(), ElementsAre("b: wrong answer"));
  EXPECT_THAT(accusations_[0].detail, HasSubstr("incarnation 9"));
}

TEST_F(RingMonitorTest, AccusesWhoAnswersImpossibleStates) {
  for (const ros::State state :
       {ros::State::finalized, ros::State::configuring, ros::State::unknown, static_cast<ros::State>(99)}) {
    accusations_.clear();
    others_.clear();
    SetUp();
    round();
    others_["b"].answer.state = state;
    rounds(4);
    EXPECT_THAT(accused(), ElementsAre("b: wrong answer"));
  }
}

TEST_F(RingMonitorTest, IsNotMovedByAForgerBesideANodeThatAnswers) {
  round();
  for (int i = 0; i < 20; ++i) {
    now_ += milliseconds(99);
    asks_.clear();
    monitor_->on_period(now_, nanoseconds(0));
    drain();
    CheckAnswer forged = others_["b"].answer;
    forged.nonce = asks_.front().nonce;
    forged.incarnation = 9;
    forged.state = ros::State::finalized;
    monitor_->on_answer("b", forged, now_);
    answer(asks_.front());
    monitor_->on_answer("b", forged, now_);
    drain();
  }
  EXPECT_THAT(accusations_, IsEmpty());
}

TEST_F(RingMonitorTest, TakesANewIncarnationThatTheLockConfirms) {
  round();
  start("b", 150, 2);  // restarted by an operator between two rounds
  rounds(20);
  EXPECT_THAT(accusations_, IsEmpty());
  EXPECT_EQ(monitor_->process_of("b"), 150);
}

TEST_F(RingMonitorTest, TellsAReusedPidByItsIncarnation) {
  round();
  start("b", 101, 2);
  rounds(3);
  EXPECT_THAT(accusations_, IsEmpty());
  EXPECT_THAT(followed_, SizeIs(2));
}

// ---- Answers that report a problem

TEST_F(RingMonitorTest, AccusesWhoAnswersAndNoLongerChecks) {
  round();
  others_["b"].answer.own_last_check_age = milliseconds(1000);
  rounds(10);
  EXPECT_THAT(accusations_, IsEmpty());
  others_["b"].answer.own_last_check_age = milliseconds(1001);
  rounds(2);
  EXPECT_THAT(accusations_, IsEmpty());
  round();
  EXPECT_THAT(accused(), ElementsAre("b: not checking"));
}

TEST_F(RingMonitorTest, AccusesWhoAnswersAndLeavesDueWorkUndone) {
  rounds(2);
  others_["b"].answer.oldest_due = milliseconds(2001);
  others_["b"].answer.work_done = 5;
  rounds(3);  // the first answer shows progress since the last check
  EXPECT_THAT(accusations_, IsEmpty());
  round();
  EXPECT_THAT(accused(), ElementsAre("b: not working"));
}

TEST_F(RingMonitorTest, ExcusesUndoneWorkAndChecksOfANodeThatWaitsForACpuButNotForEver) {
  rounds(2);
  others_["b"].answer.work_done = 5;
  for (int i = 0; i < 60; ++i) {
    others_["b"].cpu.waited += milliseconds(90);
    others_["b"].cpu.any_waited += milliseconds(90);
    // From the third second on, so that the readings reach back far enough.
    others_["b"].answer.oldest_due = milliseconds(i < 30 ? 0 : 3000);
    others_["b"].answer.own_last_check_age = milliseconds(i < 30 ? 0 : 3000);
    round();
  }
  EXPECT_THAT(accusations_, IsEmpty());
  for (int i = 0; i < 60 && accusations_.empty(); ++i) round();  // it has a CPU again, and does nothing
  EXPECT_THAT(accused(), ElementsAre("b: not checking"));
}

TEST_F(RingMonitorTest, IsCalmAboutLateWorkThatGoesOn) {
  round();
  for (int i = 0; i < 30; ++i) {
    others_["b"].answer.oldest_due = seconds(60);
    others_["b"].answer.work_done += 1;
    round();
  }
  EXPECT_THAT(accusations_, IsEmpty());
}

TEST_F(RingMonitorTest, AccusesWhoseWorkerIsFrozen) {
  round();
  others_["b"].answer.worker = "store";
  others_["b"].answer.worker_deadline = seconds(10);
  others_["b"].answer.worker_busy = milliseconds(10'300);
  rounds(10);
  EXPECT_THAT(accusations_, IsEmpty());
  others_["b"].answer.worker_busy = milliseconds(10'301);
  round();
  ASSERT_THAT(accused(), ElementsAre("b: worker frozen")) << "one answer proves it";
  EXPECT_THAT(accusations_[0].detail, HasSubstr("worker 'store' busy for 10301 ms"));
}

TEST_F(RingMonitorTest, AccusesWhoTakesMoreThanItsCapTwice) {
  round();
  const Footprint fine{.memory_octets = 99, .memory_cap_octets = 100, .descriptors = 1000};
  const Footprint large{.memory_octets = 101, .memory_cap_octets = 100};
  const Footprint open{.descriptors = 91, .descriptor_cap = 90};
  for (const Footprint& f : {fine, large, fine, open, fine}) monitor_->on_footprint("b", 101, f, now_);
  monitor_->on_footprint("b", 99, large, now_);
  monitor_->on_footprint("b", 99, large, now_);  // of another process
  drain();
  EXPECT_THAT(accusations_, IsEmpty());
  monitor_->on_footprint("b", 101, large, now_);
  monitor_->on_footprint("b", 101, large, now_);
  drain();
  EXPECT_THAT(accused(), ElementsAre("b: too large"));
}

// ---- Past a silent node

TEST_F(RingMonitorTest, WatchesWhatLiesBehindASilentNodeUntilThatAnswersAgain) {
  round();
  hang("b");
  rounds(2);
  EXPECT_THAT(monitor_->watched(), ElementsAre("b", "c"));
  rounds(2);
  restart("b");
  EXPECT_THAT(monitor_->watched(), ElementsAre("b", "c"));
  come_up("b");
  rounds(2);
  EXPECT_THAT(monitor_->watched(), ElementsAre("b"));
  EXPECT_THAT(accused(), ElementsAre("b: silent"));
}

TEST_F(RingMonitorTest, RaisesAllOthersWhenItAloneLives) {
  round();
  for (const char* name : {"e", "d", "c"}) {
    others_[name].reading = {};
    others_[name].answers = false;
  }
  now_ += seconds(2);  // past the grace period after its own start
  monitor_->on_period(now_, nanoseconds(0));
  drain();
  exit("b");
  EXPECT_THAT(accused(), UnorderedElementsAre("b: exited", "c: absent", "d: absent", "e: absent"));
}

TEST_F(RingMonitorTest, FindsAWholeRowOfHungNodes) {
  round();
  for (const char* name : {"b", "c", "d", "e"}) hang(name);
  for (int i = 0; i < 100 && accusations_.size() < 4; ++i) {
    round();
    for (const auto& a : accusations_) {
      if (others_[a.subject].reading.pid == a.pid) restart(a.subject);
    }
  }
  EXPECT_THAT(accused(), ElementsAre("b: silent", "c: silent", "d: silent", "e: silent"));
}

TEST_F(RingMonitorTest, KeepsAnAccusedNodeUntilItsOutcomeIsKnown) {
  round();
  hang("b");
  hang("c");
  rounds(20);
  ASSERT_THAT(accused(), testing::Contains("c: silent"));
  restart("b");
  come_up("b");
  rounds(2);
  EXPECT_THAT(monitor_->watched(), testing::Contains("c"));
  restart("c");
  come_up("c");
  rounds(2);
  EXPECT_THAT(monitor_->watched(), ElementsAre("b"));
}

// ---- Missing checks by the upstream node

TEST_F(RingMonitorTest, ReportsAndWatchesItsUpstreamWhenItIsNotAsked) {
  upstream_asks_ = false;
  rounds(9);
  EXPECT_EQ(reported(LivenessVerdict::not_asked), 0U);
  rounds(2);
  EXPECT_EQ(reported(LivenessVerdict::not_asked), 1U);
  EXPECT_THAT(monitor_->watched(), ElementsAre("b", "e"));
  EXPECT_THAT(accusations_, IsEmpty()) << "it answers";

  upstream_asks_ = true;
  round();
  EXPECT_THAT(monitor_->watched(), ElementsAre("b"));
}

TEST_F(RingMonitorTest, AccusesAnUpstreamThatNeitherAsksNorAnswers) {
  upstream_asks_ = false;
  round();
  hang("e");
  others_["e"].reading.page->last_turn = now_;
  rounds(20);
  EXPECT_THAT(accused(), ElementsAre("e: silent"));
}

TEST_F(RingMonitorTest, AccusesAnUpstreamThatAnswersAndDoesNotAsk) {
  upstream_asks_ = false;
  others_["e"].answer.own_last_check_age = seconds(5);
  rounds(20);
  EXPECT_THAT(accused(), ElementsAre("e: not checking"));
}

TEST_F(RingMonitorTest, IsNotCalmedByItsOwnOrAStrangersQuestions) {
  upstream_asks_ = false;
  for (int i = 0; i < 12; ++i) {
    monitor_->on_asked("a", 1, now_);
    monitor_->on_asked("stranger", 1, now_);
    round();
  }
  EXPECT_EQ(reported(LivenessVerdict::not_asked), 1U);
}

// ---- Membership

TEST_F(RingMonitorTest, AloneWatchesNobody) {
  make({1, {"a"}});
  rounds(30);
  EXPECT_THAT(monitor_->watched(), IsEmpty());
  EXPECT_EQ(monitor_->last_check_age(now_ + seconds(60)), nanoseconds(0));
  EXPECT_EQ(reported(LivenessVerdict::not_asked), 0U);
}

TEST_F(RingMonitorTest, WatchesNobodyInAnEmptyRingOrAsNoMember) {
  for (const Membership& membership : {Membership{1, {}}, Membership{1, {"b", "c"}}}) {
    make(membership);
    rounds(30);
    EXPECT_THAT(monitor_->watched(), IsEmpty());
    EXPECT_THAT(accusations_, IsEmpty());
  }
}

TEST_F(RingMonitorTest, VoidsWhatItHeldAgainstAMemberOfAnOlderGeneration) {
  round();
  hang("b");
  rounds(3);
  monitor_->on_membership({2, {"a", "b", "c"}}, now_);
  drain();
  rounds(2);
  EXPECT_THAT(accusations_, IsEmpty());
  rounds(2);
  ASSERT_THAT(accused(), ElementsAre("b: silent"));
  EXPECT_EQ(accusations_[0].generation, 2U);
}

TEST_F(RingMonitorTest, FollowsAChangedOrder) {
  round();
  monitor_->on_membership({2, {"a", "d", "b"}}, now_);
  others_["d"].answer.generation = 2;
  drain();
  rounds(3);
  EXPECT_THAT(monitor_->watched(), ElementsAre("d"));
  EXPECT_EQ(monitor_->process_of("d"), 103);
}

TEST_F(RingMonitorTest, ForgetsAnOutcomeOfAnOlderGeneration) {
  round();
  exit("b");
  monitor_->on_membership({2, {"a", "c"}}, now_);
  drain();
  conclude("b", What::restarted, 300);
  EXPECT_THAT(monitor_->watched(), ElementsAre("c"));
  EXPECT_EQ(reported(LivenessVerdict::outcome), 0U);
}

TEST_F(RingMonitorTest, VoidsAnAnswerOfAnotherGenerationAndReadsTheMembershipAgain) {
  round();
  others_["b"].answer.generation = 2;
  others_["b"].answer.own_last_check_age = seconds(60);
  rounds(20);
  EXPECT_THAT(accusations_, IsEmpty());
  EXPECT_EQ(membership_reads_, 20);
}

TEST_F(RingMonitorTest, ReadsTheMembershipAgainWhenItIsAskedWithAnotherGeneration) {
  monitor_->on_asked("e", 2, now_);
  drain();
  EXPECT_EQ(membership_reads_, 1);
}

TEST_F(RingMonitorTest, KnowsHowLongItWasHeldUpSinceSomethingBegan) {
  const MonotonicTime early = now_;
  round();
  round(seconds(20));
  const MonotonicTime stopped_in = now_ - seconds(5);
  EXPECT_EQ(monitor_->held_up_since(early), seconds(20));
  EXPECT_EQ(monitor_->held_up_since(stopped_in), seconds(5) - milliseconds(1));
  EXPECT_EQ(monitor_->held_up_since(now_), nanoseconds(0));
  round(milliseconds(50));
  EXPECT_EQ(monitor_->held_up_since(early), seconds(20)) << "within the tolerance";
}

TEST_F(RingMonitorTest, KnowsHowLongItWasStoppedWithoutItsWaitsForACpu) {
  const MonotonicTime early = now_;
  round();
  now_ += seconds(5);
  monitor_->on_period(now_, seconds(5), seconds(4));
  drain();
  EXPECT_EQ(monitor_->held_up_since(early), seconds(5));
  EXPECT_EQ(monitor_->stopped_since(early), seconds(1));
  now_ += seconds(5);
  monitor_->on_period(now_, seconds(5), seconds(6));
  drain();
  EXPECT_EQ(monitor_->stopped_since(early), seconds(1)) << "it waited all the time";
}

TEST_F(RingMonitorTest, KnowsHowLongAgoItCheckedLast) {
  round();
  EXPECT_EQ(monitor_->last_check_age(now_ + milliseconds(500)), milliseconds(501));
}

}  // namespace
}  // namespace srfs::suite
