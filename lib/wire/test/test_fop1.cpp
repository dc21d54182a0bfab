// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "wire/fop1.hpp"

namespace srfs::wire {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using Kind = FopSignal::Kind;

// ---- the table, row by row ------------------------------------------------------------------------------

std::string_view word(FopAction action) {
  static const std::map<FopAction, std::string_view> words{{FopAction::remove_acknowledged, "remove"},
                                                           {FopAction::look_for_frame, "look"},
                                                           {FopAction::look_for_directive, "look-bc"},
                                                           {FopAction::retransmit_ad, "again"},
                                                           {FopAction::retransmit_bc, "again-bc"},
                                                           {FopAction::start_timer, "timer"},
                                                           {FopAction::cancel_timer, "cancel"},
                                                           {FopAction::confirm_initiate, "confirm-init"},
                                                           {FopAction::release_bc, "release-bc"},
                                                           {FopAction::suspend, "suspend"},
                                                           {FopAction::resume, "resume"},
                                                           {FopAction::queue_frame, "queue"},
                                                           {FopAction::accept, "accept"},
                                                           {FopAction::reject, "reject"},
                                                           {FopAction::confirm, "confirm"},
                                                           {FopAction::initialise, "init"},
                                                           {FopAction::take_vs, "set-vs"},
                                                           {FopAction::transmit_bc, "send-bc"},
                                                           {FopAction::transmit_bd, "send-bd"},
                                                           {FopAction::take_value, "set"},
                                                           {FopAction::ad_ready, "ad-ready"},
                                                           {FopAction::bc_ready, "bc-ready"},
                                                           {FopAction::bd_ready, "bd-ready"}};
  return words.at(action);
}

/// A cell of the table as text, like "remove look S1" or "alert(synch) S6".
std::string text(const FopCell& cell) {
  std::string text;
  for (const FopAction action : cell.actions) {
    if (action == FopAction::none) continue;
    text += action == FopAction::alert ? "alert(" + std::string(to_string(cell.reason)) + ")" : word(action);
    text += ' ';
  }
  return text + "S" + std::to_string(static_cast<int>(cell.next));
}

struct TableRow {
  std::string_view event;
  std::array<std::string_view, 6> cells;  // S1 to S6
};

// CCSDS 232.1-B-2, table 5-1, transcribed independently.
constexpr std::string_view synch = "alert(synch) S6";
constexpr std::string_view clcw = "alert(clcw) S6";
constexpr std::string_view t1 = "alert(t1) S6";
constexpr std::array<std::string_view, 6> reject{"reject S1", "reject S2", "reject S3",
                                                 "reject S4", "reject S5", "reject S6"};
constexpr std::array<std::string_view, 6> set{"accept set confirm S1", "accept set confirm S2",
                                              "accept set confirm S3", "accept set confirm S4",
                                              "accept set confirm S5", "accept set confirm S6"};
constexpr std::string_view terminate = "accept alert(term) confirm S6";
const std::vector<TableRow> standard{
    {"E1", {"S1", synch, synch, "confirm-init cancel S1", "confirm-init release-bc cancel S1", "S6"}},
    {"E2", {"remove cancel look S1", "remove cancel look S1", "remove cancel look S1", synch, "S5", "S6"}},
    {"E3", {clcw, clcw, clcw, clcw, clcw, "S6"}},
    {"E4", {synch, synch, synch, synch, "S5", "S6"}},
    {"E5", {"S1", synch, synch, synch, "S5", "S6"}},
    {"E6", {"remove look S1", "remove look S1", "remove look S1", synch, "S5", "S6"}},
    {"E7", {clcw, clcw, clcw, clcw, clcw, "S6"}},
    {"E101",
     {"remove alert(limit) S6", "remove alert(limit) S6", "remove alert(limit) S6", synch, "S5", "S6"}},
    {"E102", {"alert(limit) S6", "alert(limit) S6", "alert(limit) S6", synch, "S5", "S6"}},
    {"E8", {"remove again look S2", "remove again look S2", "remove again look S2", synch, "S5", "S6"}},
    {"E9", {"remove S3", "remove S3", "remove S3", synch, "S5", "S6"}},
    {"E10", {"again look S2", "S2", "again look S2", synch, "S5", "S6"}},
    {"E11", {"S3", "S3", "S3", synch, "S5", "S6"}},
    {"E12", {"S2", "S2", "S2", synch, "S5", "S6"}},
    {"E103", {"S3", "S3", "S3", synch, "S5", "S6"}},
    {"E13", {"alert(nn_r) S6", "alert(nn_r) S6", "alert(nn_r) S6", "alert(nn_r) S6", "S5", "S6"}},
    {"E14", {"alert(lockout) S6", "alert(lockout) S6", "alert(lockout) S6", "alert(lockout) S6", "S5", "S6"}},
    {"E15", {clcw, clcw, clcw, clcw, clcw, "S6"}},
    {"E16", {"again look S1", "again look S2", "S3", t1, "again-bc look-bc S5", "S6"}},
    {"E104", {"again look S1", "again look S2", "S3", "suspend S6", "again-bc look-bc S5", "S6"}},
    {"E17", {t1, t1, t1, t1, t1, "S6"}},
    {"E18", {"suspend S6", "suspend S6", "suspend S6", "suspend S6", t1, "S6"}},
    {"E19", {"queue look S1", "queue look S2", "queue S3", "reject S4", "reject S5", "reject S6"}},
    {"E20", reject},
    {"E21", {"send-bd S1", "send-bd S2", "send-bd S3", "send-bd S4", "send-bd S5", "send-bd S6"}},
    {"E22", reject},
    {"E23", {"reject S1", "reject S2", "reject S3", "reject S4", "reject S5", "accept init confirm S1"}},
    {"E24", {"reject S1", "reject S2", "reject S3", "reject S4", "reject S5", "accept init timer S4"}},
    {"E25", {"reject S1", "reject S2", "reject S3", "reject S4", "reject S5", "accept init send-bc S5"}},
    {"E26", reject},
    {"E27",
     {"reject S1", "reject S2", "reject S3", "reject S4", "reject S5", "accept init set-vs send-bc S5"}},
    {"E28", reject},
    {"E29", {terminate, terminate, terminate, terminate, terminate, "accept confirm S6"}},
    {"E30", reject},
    {"E31", {"reject S1", "reject S2", "reject S3", "reject S4", "reject S5", "accept resume confirm S1"}},
    {"E32", {"reject S1", "reject S2", "reject S3", "reject S4", "reject S5", "accept resume confirm S2"}},
    {"E33", {"reject S1", "reject S2", "reject S3", "reject S4", "reject S5", "accept resume confirm S3"}},
    {"E34", {"reject S1", "reject S2", "reject S3", "reject S4", "reject S5", "accept resume confirm S4"}},
    {"E35", {"reject S1", "reject S2", "reject S3", "reject S4", "reject S5", "accept set-vs confirm S6"}},
    {"E36", set},
    {"E37", set},
    {"E38", set},
    {"E39", set},
    {"E40", reject},
    {"E41",
     {"ad-ready look S1", "ad-ready look S2", "ad-ready S3", "ad-ready S4", "ad-ready S5", "ad-ready S6"}},
    {"E42",
     {"ad-ready alert(llif) S6", "ad-ready alert(llif) S6", "ad-ready alert(llif) S6",
      "ad-ready alert(llif) S6", "ad-ready alert(llif) S6", "ad-ready S6"}},
    {"E43",
     {"bc-ready S1", "bc-ready S2", "bc-ready S3", "bc-ready S4", "bc-ready look-bc S5", "bc-ready S6"}},
    {"E44",
     {"bc-ready alert(llif) S6", "bc-ready alert(llif) S6", "bc-ready alert(llif) S6",
      "bc-ready alert(llif) S6", "bc-ready alert(llif) S6", "bc-ready S6"}},
    {"E45",
     {"bd-ready accept S1", "bd-ready accept S2", "bd-ready accept S3", "bd-ready accept S4",
      "bd-ready accept S5", "bd-ready accept S6"}},
    {"E46",
     {"bd-ready reject alert(llif) S6", "bd-ready reject alert(llif) S6", "bd-ready reject alert(llif) S6",
      "bd-ready reject alert(llif) S6", "bd-ready reject alert(llif) S6", "bd-ready reject S6"}},
};

TEST(FopOneTable, IsTheStandardsRowByRow) {
  ASSERT_EQ(standard.size(), fop_event_count);
  for (std::size_t event = 0; event < fop_event_count; ++event) {
    EXPECT_EQ(to_string(static_cast<FopEvent>(event)), standard[event].event);
    for (std::size_t state = 0; state < fop_state_count; ++state) {
      EXPECT_EQ(text(fop_cell(static_cast<FopEvent>(event), static_cast<FopState>(state + 1))),
                standard[event].cells[state])
          << standard[event].event << " in S" << state + 1;
    }
  }
}

// ---- behaviour ------------------------------------------------------------------------------------------

constexpr MonotonicTime start{seconds(100)};
constexpr FopSettings settings{.window = 3, .timer = seconds(2), .transmission_limit = 3};

/// A signal as text: "ad 5", "ad 5 again", "unlock", "confirmed 7", "alert t1 E17 S1".
std::string text(const FopSignal& signal) {
  const std::string tag = " " + std::to_string(signal.tag);
  const std::string again = signal.repeated ? " again" : "";
  switch (signal.kind) {
    case Kind::transmit_ad:
      return "ad " + std::to_string(signal.sequence) + again;
    case Kind::transmit_bc:
      return (signal.control.kind == ControlCommand::Kind::unlock
                  ? std::string("unlock")
                  : "set V(R) " + std::to_string(signal.control.vr)) +
             again;
    case Kind::transmit_bd:
      return "bd" + tag;
    case Kind::accepted:
      return "accepted" + tag;
    case Kind::rejected:
      return "rejected" + tag;
    case Kind::confirmed:
      return "confirmed" + tag;
    case Kind::not_confirmed:
      return "not confirmed" + tag;
    case Kind::directive_accepted:
      return "directive accepted";
    case Kind::directive_rejected:
      return "directive rejected";
    case Kind::directive_confirmed:
      return "directive confirmed";
    case Kind::directive_failed:
      return "directive failed";
    case Kind::alert:
      return "alert " + std::string(to_string(signal.reason)) + " " + std::string(to_string(signal.event)) +
             " S" + std::to_string(static_cast<int>(signal.state));
    case Kind::suspended:
      return "suspended";
  }
  return "?";
}

class FopOne : public ::testing::Test {
 protected:
  /// Handles signals until none are left. The lower procedures accept every frame at once.
  std::vector<std::string> done() {
    std::vector<std::string> texts;
    while (const auto signal = fop.next_signal()) {
      texts.push_back(text(*signal));
      if (signal->kind == Kind::transmit_ad) fop.on_ad_accepted(now);
      if (signal->kind == Kind::transmit_bc) fop.on_bc_accepted(now);
      if (signal->kind == Kind::transmit_bd) fop.on_bd_accepted(now);
    }
    return texts;
  }
  void at_s1(std::uint8_t vs) {
    fop.set_vs(0, vs, now);
    fop.initiate_without_check(0, now);
    static_cast<void>(done());
    ASSERT_EQ(fop.state(), FopState::active);
  }
  std::vector<std::string> request(std::uint64_t tag) {
    fop.request_ad(tag, {static_cast<std::uint8_t>(tag)}, now);
    return done();
  }
  std::vector<std::string> report(std::uint8_t nr, bool retransmit = false, bool wait = false,
                                  bool lockout = false) {
    fop.on_clcw({.lockout = lockout, .wait = wait, .retransmit = retransmit, .report_value = nr}, now);
    return done();
  }
  std::vector<std::string> pass(nanoseconds duration) {
    now += duration;
    fop.on_time(now);
    return done();
  }
  MonotonicTime now = start;
  Fop1 fop{settings};
};

TEST_F(FopOne, StartsWithoutService) {
  EXPECT_EQ(fop.state(), FopState::initial);
  EXPECT_FALSE(fop.room());
  EXPECT_THAT(request(1), ElementsAre("rejected 1"));
  EXPECT_THAT(report(7, true, false, true), IsEmpty());
}

TEST_F(FopOne, InitiatesWithACheckWhenTheClcwAgrees) {
  fop.set_vs(1, 250, now);
  fop.initiate_with_check(2, now);
  EXPECT_THAT(done(), ElementsAre("directive accepted", "directive confirmed", "directive accepted"));
  EXPECT_EQ(fop.state(), FopState::initialising);
  EXPECT_THAT(request(1), ElementsAre("rejected 1"));
  EXPECT_THAT(report(250), ElementsAre("directive confirmed"));
  EXPECT_EQ(fop.state(), FopState::active);
  EXPECT_FALSE(fop.deadline());
}

TEST_F(FopOne, GivesUpInitiatingWithoutAClcw) {
  fop.initiate_with_check(2, now);
  EXPECT_THAT(done(), ElementsAre("directive accepted"));
  EXPECT_EQ(fop.deadline(), start + settings.timer);
  EXPECT_THAT(pass(seconds(2)), ElementsAre("directive failed", "alert t1 E16 S4"));
  EXPECT_EQ(fop.state(), FopState::initial);
}

TEST_F(FopOne, RefusesToStartOnALockedOutFarm) {
  fop.initiate_with_check(2, now);
  static_cast<void>(done());
  EXPECT_THAT(report(0, false, false, true), ElementsAre("directive failed", "alert lockout E14 S4"));
}

TEST_F(FopOne, UnlocksAndRepeatsTheControlFrameUntilTheClcwShowsIt) {
  fop.set_vs(1, 9, now);
  fop.initiate_with_unlock(2, now);
  EXPECT_THAT(done(),
              ElementsAre("directive accepted", "directive confirmed", "directive accepted", "unlock"));
  EXPECT_THAT(report(9, true, false, true), IsEmpty()) << "still locked: not yet there";
  EXPECT_THAT(pass(seconds(2)), ElementsAre("unlock again"));
  EXPECT_THAT(report(9), ElementsAre("directive confirmed"));
  EXPECT_EQ(fop.state(), FopState::active);
  EXPECT_THAT(request(1), ElementsAre("accepted 1", "ad 9"));
}

TEST_F(FopOne, GivesUpAControlFrameAfterTheLimit) {
  fop.initiate_with_unlock(2, now);
  static_cast<void>(done());
  EXPECT_THAT(pass(seconds(2)), ElementsAre("unlock again"));
  EXPECT_THAT(pass(seconds(2)), ElementsAre("unlock again"));
  EXPECT_THAT(pass(seconds(2)), ElementsAre("directive failed", "alert t1 E17 S5"));
}

TEST_F(FopOne, SetsVrAndItsOwnNumbersWithIt) {
  fop.initiate_with_set_vr(2, 77, now);
  EXPECT_THAT(done(), ElementsAre("directive accepted", "set V(R) 77"));
  EXPECT_THAT(report(12), IsEmpty()) << "not yet there";
  EXPECT_THAT(report(77), ElementsAre("directive confirmed"));
  EXPECT_THAT(request(1), ElementsAre("accepted 1", "ad 77"));
}

TEST_F(FopOne, RefusesASecondControlFrameWhileTheLineIsBusyWithOne) {
  fop.initiate_with_unlock(2, now);
  while (const auto signal = fop.next_signal()) {
  }  // the lower procedures do not answer
  fop.terminate(3, now);
  fop.initiate_with_set_vr(4, 1, now);
  EXPECT_THAT(done(), ElementsAre("directive accepted", "directive failed", "alert term E29 S5",
                                  "directive confirmed", "directive rejected"));
}

TEST_F(FopOne, SendsNoMoreThanTheWindowAndOneWaits) {
  at_s1(254);
  EXPECT_THAT(request(1), ElementsAre("accepted 1", "ad 254"));
  EXPECT_THAT(request(2), ElementsAre("accepted 2", "ad 255"));
  EXPECT_THAT(request(3), ElementsAre("accepted 3", "ad 0"));
  EXPECT_TRUE(fop.room());
  EXPECT_THAT(request(4), IsEmpty());
  EXPECT_FALSE(fop.room());
  EXPECT_THAT(request(5), ElementsAre("rejected 5"));
  EXPECT_THAT(report(0), ElementsAre("confirmed 1", "confirmed 2", "accepted 4", "ad 1"));
  EXPECT_EQ(fop.outstanding(), 2U);
  EXPECT_THAT(report(2), ElementsAre("confirmed 3", "confirmed 4"));
  EXPECT_FALSE(fop.deadline());
}

TEST_F(FopOne, WaitsForTheLowerProcedures) {
  at_s1(0);
  fop.request_ad(1, {1}, now);
  fop.request_ad(2, {2}, now);
  EXPECT_EQ(text(*fop.next_signal()), "accepted 1");
  EXPECT_EQ(text(*fop.next_signal()), "ad 0");
  EXPECT_FALSE(fop.next_signal()) << "the second has to wait";
  fop.on_ad_accepted(now);
  EXPECT_THAT(done(), ElementsAre("accepted 2", "ad 1"));
}

TEST_F(FopOne, RepeatsFromTheFrameThatTheFarmMisses) {
  at_s1(0);
  for (const std::uint64_t tag : {1, 2, 3}) static_cast<void>(request(tag));
  EXPECT_THAT(report(1, true), ElementsAre("confirmed 1", "ad 1 again", "ad 2 again"));
  EXPECT_EQ(fop.state(), FopState::retransmit_without_wait);
  EXPECT_THAT(report(1, true), IsEmpty()) << "already on its way";
  EXPECT_THAT(report(3), ElementsAre("confirmed 2", "confirmed 3"));
  EXPECT_EQ(fop.state(), FopState::active);
}

TEST_F(FopOne, WaitsWhileTheFarmHasNoBuffer) {
  at_s1(0);
  static_cast<void>(request(1));
  static_cast<void>(request(2));
  EXPECT_THAT(report(1, true, true), ElementsAre("confirmed 1"));
  EXPECT_EQ(fop.state(), FopState::retransmit_with_wait);
  EXPECT_THAT(pass(seconds(2)), IsEmpty());
  EXPECT_THAT(request(3), IsEmpty());
  EXPECT_THAT(report(1, true), ElementsAre("ad 1 again", "accepted 3", "ad 2"));
  EXPECT_THAT(report(3), ElementsAre("confirmed 2", "confirmed 3"));
}

TEST_F(FopOne, WatchesWhatIsUnderWayAlsoAfterALongWait) {
  at_s1(0);
  for (const std::uint64_t tag : {1, 2}) static_cast<void>(request(tag));
  static_cast<void>(report(0, true, true));
  EXPECT_THAT(pass(seconds(2)), IsEmpty()) << "E16 in S3";
  EXPECT_THAT(report(1), ElementsAre("confirmed 1"));
  EXPECT_EQ(fop.state(), FopState::active);
  EXPECT_THAT(pass(seconds(2)), ElementsAre("ad 1 again"));
}

TEST_F(FopOne, RepeatsWhenTheTimerExpiresUntilTheLimit) {
  at_s1(0);
  static_cast<void>(request(1));
  EXPECT_THAT(pass(milliseconds(1999)), IsEmpty());
  EXPECT_THAT(pass(milliseconds(1)), ElementsAre("ad 0 again"));
  EXPECT_THAT(pass(seconds(2)), ElementsAre("ad 0 again"));
  EXPECT_THAT(pass(seconds(2)), ElementsAre("not confirmed 1", "alert t1 E17 S1"));
  EXPECT_EQ(fop.outstanding(), 0U);
}

TEST_F(FopOne, NewsBeginsTheCountAnew) {
  at_s1(0);
  static_cast<void>(request(1));
  static_cast<void>(request(2));
  static_cast<void>(pass(seconds(2)));
  EXPECT_EQ(fop.transmission_count(), 2);
  static_cast<void>(report(1));
  EXPECT_EQ(fop.transmission_count(), 1);
}

TEST_F(FopOne, SuspendsInsteadOfGivingUpAndGoesOnWhenResumed) {
  FopSettings patient = settings;
  patient.suspend_when_exhausted = true;
  patient.transmission_limit = 2;
  fop.set_settings(9, patient, now);
  at_s1(0);
  static_cast<void>(request(1));
  EXPECT_THAT(pass(seconds(2)), ElementsAre("ad 0 again"));
  EXPECT_THAT(pass(seconds(2)), ElementsAre("suspended"));
  EXPECT_EQ(fop.suspended_in(), FopState::active);
  EXPECT_EQ(fop.outstanding(), 1U);
  fop.set_vs(3, 5, now);
  EXPECT_THAT(done(), ElementsAre("directive rejected")) << "what waits keeps its number";
  fop.resume(4, now);
  EXPECT_THAT(done(), ElementsAre("directive accepted", "directive confirmed"));
  EXPECT_EQ(fop.state(), FopState::active);
  EXPECT_THAT(report(1), ElementsAre("confirmed 1"));
  fop.resume(5, now);
  EXPECT_THAT(done(), ElementsAre("directive rejected"));
}

TEST_F(FopOne, SuspendsAndResumesInEachState) {
  for (const FopState state : {FopState::active, FopState::retransmit_without_wait,
                               FopState::retransmit_with_wait, FopState::initialising}) {
    fop = Fop1({.window = 3, .timer = seconds(2), .transmission_limit = 1, .suspend_when_exhausted = true});
    if (state == FopState::initialising) {
      fop.initiate_with_check(1, now);
    } else {
      at_s1(0);
      // With limit 1 a retransmit flag raises an alert, so use a higher limit while entering this state.
      fop.set_settings(
          2, {.window = 3, .timer = seconds(2), .transmission_limit = 2, .suspend_when_exhausted = true},
          now);
      static_cast<void>(request(1));
      if (state != FopState::active)
        static_cast<void>(report(0, true, state == FopState::retransmit_with_wait));
      fop.set_settings(
          2, {.window = 3, .timer = seconds(2), .transmission_limit = 1, .suspend_when_exhausted = true},
          now);
    }
    static_cast<void>(done());
    ASSERT_EQ(fop.state(), state);
    EXPECT_THAT(pass(seconds(2)), ElementsAre("suspended"));
    EXPECT_EQ(fop.suspended_in(), state);
    fop.resume(4, now);
    EXPECT_THAT(done(), ElementsAre("directive accepted", "directive confirmed"));
    EXPECT_EQ(fop.state(), state);
    EXPECT_TRUE(fop.deadline());
  }
}

TEST_F(FopOne, EndsWithItsReasonOnEveryContradiction) {
  struct Case {
    Clcw control_word;
    std::string_view alert;
  };
  for (const auto& [control_word, alert] : std::vector<Case>{
           {{.lockout = true, .report_value = 1}, "alert lockout E14 S1"},
           {{.report_value = 3}, "alert nn_r E13 S1"},
           {{.report_value = 255}, "alert nn_r E13 S1"},
           {{.retransmit = true, .report_value = 2}, "alert synch E4 S1"},
           {{.wait = true, .report_value = 2}, "alert clcw E3 S1"},
           {{.wait = true, .report_value = 1}, "alert clcw E7 S1"},
       }) {
    fop = Fop1(settings);
    at_s1(0);
    static_cast<void>(request(1));
    static_cast<void>(request(2));
    fop.on_clcw(control_word, now);
    EXPECT_THAT(done(), ElementsAre("not confirmed 1", "not confirmed 2", alert));
    EXPECT_FALSE(fop.deadline());
  }
}

TEST_F(FopOne, EndsOnAnInvalidClcw) {
  at_s1(0);
  static_cast<void>(request(1));
  fop.on_invalid_clcw(now);
  EXPECT_THAT(done(), ElementsAre("not confirmed 1", "alert clcw E15 S1"));
}

TEST_F(FopOne, EndsWhenAFlagVanishesWithoutProgress) {
  at_s1(0);
  static_cast<void>(request(1));
  static_cast<void>(report(0, true));
  EXPECT_THAT(report(0), ElementsAre("not confirmed 1", "alert synch E5 S2"));
}

TEST_F(FopOne, WithALimitOfOneARetransmitFlagIsTheEnd) {
  fop.set_settings(9, {.window = 3, .timer = seconds(2), .transmission_limit = 1}, now);
  at_s1(0);
  static_cast<void>(request(1));
  static_cast<void>(request(2));
  EXPECT_THAT(report(1, true), ElementsAre("confirmed 1", "not confirmed 2", "alert limit E101 S1"));
  at_s1(0);
  static_cast<void>(request(1));
  EXPECT_THAT(report(0, true), ElementsAre("not confirmed 1", "alert limit E102 S1"));
}

TEST_F(FopOne, KeepsQuietWhenTheTransmissionsAreUsedUpUntilTheTimerSaysSo) {
  fop.set_settings(9, {.window = 3, .timer = seconds(2), .transmission_limit = 2}, now);
  at_s1(0);
  static_cast<void>(request(1));
  EXPECT_THAT(report(0, true), ElementsAre("ad 0 again"));
  EXPECT_THAT(report(0, true, true), IsEmpty());
  EXPECT_EQ(fop.state(), FopState::retransmit_with_wait);
  EXPECT_THAT(report(0, true), IsEmpty());
  EXPECT_EQ(fop.state(), FopState::retransmit_without_wait);
  EXPECT_THAT(pass(seconds(2)), ElementsAre("not confirmed 1", "alert t1 E17 S2"));
}

TEST_F(FopOne, TerminatesOnRequest) {
  at_s1(0);
  for (const std::uint64_t tag : {1, 2, 3, 4}) static_cast<void>(request(tag));
  fop.terminate(5, now);
  EXPECT_THAT(done(),
              ElementsAre("directive accepted", "not confirmed 1", "not confirmed 2", "not confirmed 3",
                          "rejected 4", "alert term E29 S1", "directive confirmed"));
  fop.terminate(6, now);
  EXPECT_THAT(done(), ElementsAre("directive accepted", "directive confirmed"));
}

TEST_F(FopOne, ALineThatRefusesAFrameEndsTheServiceAndTheNextOneWorks) {
  at_s1(0);
  fop.request_ad(1, {1}, now);
  while (const auto signal = fop.next_signal()) {
  }
  fop.on_ad_rejected(now);
  EXPECT_THAT(done(), ElementsAre("not confirmed 1", "alert llif E42 S1"));
  at_s1(0);
  EXPECT_THAT(request(2), ElementsAre("accepted 2", "ad 0"));
}

TEST_F(FopOne, SendsExpeditedFramesInEveryState) {
  fop.request_bd(1, {1}, now);
  EXPECT_THAT(done(), ElementsAre("bd 1", "accepted 1"));
  at_s1(0);
  fop.request_bd(2, {1}, now);
  fop.request_bd(3, {1}, now);
  EXPECT_THAT(done(), ElementsAre("bd 2", "rejected 3", "accepted 2")) << "one at a time";
  fop.request_bd(4, {1}, now);
  while (const auto signal = fop.next_signal()) {
  }
  fop.on_bd_rejected(now);
  EXPECT_THAT(done(), ElementsAre("rejected 4", "alert llif E46 S1"));
}

TEST_F(FopOne, RefusesSettingsOutOfRangeAndKeepsTheOld) {
  for (const FopSettings wrong :
       {FopSettings{.window = 0}, FopSettings{.window = 33}, FopSettings{.timer = milliseconds(0)},
        FopSettings{.transmission_limit = 0}}) {
    fop.set_settings(1, wrong, now);
    EXPECT_THAT(done(), ElementsAre("directive rejected"));
    EXPECT_EQ(fop.settings(), settings);
  }
}

TEST_F(FopOne, AWiderWindowLetsTheWaitingFrameGoWithTheNextReport) {
  at_s1(0);
  for (const std::uint64_t tag : {1, 2, 3, 4}) static_cast<void>(request(tag));
  fop.set_settings(9, {.window = 5, .timer = seconds(2), .transmission_limit = 3}, now);
  static_cast<void>(done());
  EXPECT_THAT(report(1), ElementsAre("confirmed 1", "accepted 4", "ad 3"));
}

TEST_F(FopOne, CountsNumbersThatAnAlertLeftWithoutAFrame) {
  at_s1(0);
  for (const std::uint64_t tag : {1, 2}) static_cast<void>(request(tag));
  fop.terminate(5, now);
  fop.initiate_without_check(6, now);  // V(S) is still 2, NN(R) 0
  static_cast<void>(done());
  EXPECT_THAT(request(3), ElementsAre("accepted 3", "ad 2"));
  EXPECT_THAT(report(2), IsEmpty());
  EXPECT_THAT(report(3), ElementsAre("confirmed 3"));
}

}  // namespace
}  // namespace srfs::wire
