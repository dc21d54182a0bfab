// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/fop1.hpp"

#include <algorithm>
#include <cassert>
#include <utility>

namespace srfs::wire {
namespace {

using A = FopAction;
using Row = std::array<FopCell, fop_state_count>;

constexpr auto s1 = FopState::active;
constexpr auto s2 = FopState::retransmit_without_wait;
constexpr auto s3 = FopState::retransmit_with_wait;
constexpr auto s4 = FopState::initialising;
constexpr auto s5 = FopState::initialising_with_bc;
constexpr auto s6 = FopState::initial;

constexpr FopCell go(FopState next, A a = A::none, A b = A::none, A c = A::none, A d = A::none) {
  return {{a, b, c, d}, next, {}};
}
constexpr FopCell alert(FopAlert reason, A before = A::none) {
  return before == A::none ? FopCell{{A::alert}, s6, reason} : FopCell{{before, A::alert}, s6, reason};
}
/// The same actions in every state, which stays.
constexpr Row everywhere(A a, A b = A::none, A c = A::none) {
  return {go(s1, a, b, c), go(s2, a, b, c), go(s3, a, b, c),
          go(s4, a, b, c), go(s5, a, b, c), go(s6, a, b, c)};
}
/// A directive for S6 alone.
constexpr Row only_in_s6(FopCell cell) {
  return {go(s1, A::reject), go(s2, A::reject), go(s3, A::reject),
          go(s4, A::reject), go(s5, A::reject), cell};
}
/// A CLCW that S4 takes for a contradiction, and S5 and S6 ignore.
constexpr Row clcw(FopCell in_s1, FopCell in_s2, FopCell in_s3, FopAlert in_s4 = FopAlert::synch) {
  return {in_s1, in_s2, in_s3, alert(in_s4), go(s5), go(s6)};
}
constexpr Row alert_but_s5(FopAlert reason) {
  return {alert(reason), alert(reason), alert(reason), alert(reason), go(s5), go(s6)};
}
constexpr Row alert_but_s6(FopAlert reason) {
  return {alert(reason), alert(reason), alert(reason), alert(reason), alert(reason), go(s6)};
}
/// The lower procedures refused a frame. They are not busy with it any more.
constexpr Row refused(A ready, A answer = A::none) {
  const FopCell cell = answer == A::none ? FopCell{{ready, A::alert}, s6, FopAlert::llif}
                                         : FopCell{{ready, answer, A::alert}, s6, FopAlert::llif};
  return {cell, cell, cell, cell, cell, go(s6, ready, answer)};
}

constexpr FopCell all_acknowledged = go(s1, A::remove_acknowledged, A::cancel_timer, A::look_for_frame);
constexpr FopCell some_acknowledged = go(s1, A::remove_acknowledged, A::look_for_frame);
constexpr FopCell some_and_again = go(s2, A::remove_acknowledged, A::retransmit_ad, A::look_for_frame);
constexpr FopCell again = go(s2, A::retransmit_ad, A::look_for_frame);
constexpr FopCell bc_again = go(s5, A::retransmit_bc, A::look_for_directive);
constexpr FopCell synch = alert(FopAlert::synch);
constexpr FopCell suspend = go(s6, A::suspend);
constexpr FopCell exhausted = alert(FopAlert::limit, A::remove_acknowledged);

/// CCSDS 232.1-B-2, table 5-1. Rows: FopEvent; columns: S1 to S6.
constexpr std::array<Row, fop_event_count> table{{
    /* E1   */ {go(s1), synch, synch, go(s1, A::confirm_initiate, A::cancel_timer),
                go(s1, A::confirm_initiate, A::release_bc, A::cancel_timer), go(s6)},
    /* E2   */ clcw(all_acknowledged, all_acknowledged, all_acknowledged),
    /* E3   */ alert_but_s6(FopAlert::clcw),
    /* E4   */ alert_but_s5(FopAlert::synch),
    /* E5   */ clcw(go(s1), synch, synch),
    /* E6   */ clcw(some_acknowledged, some_acknowledged, some_acknowledged),
    /* E7   */ alert_but_s6(FopAlert::clcw),
    /* E101 */ clcw(exhausted, exhausted, exhausted),
    /* E102 */ clcw(alert(FopAlert::limit), alert(FopAlert::limit), alert(FopAlert::limit)),
    /* E8   */ clcw(some_and_again, some_and_again, some_and_again),
    /* E9   */
    clcw(go(s3, A::remove_acknowledged), go(s3, A::remove_acknowledged), go(s3, A::remove_acknowledged)),
    /* E10  */ clcw(again, go(s2), again),
    /* E11  */ clcw(go(s3), go(s3), go(s3)),
    /* E12  */ clcw(go(s2), go(s2), go(s2)),
    /* E103 */ clcw(go(s3), go(s3), go(s3)),
    /* E13  */ alert_but_s5(FopAlert::nn_r),
    /* E14  */ alert_but_s5(FopAlert::lockout),
    /* E15  */ alert_but_s6(FopAlert::clcw),
    /* E16  */
    {go(s1, A::retransmit_ad, A::look_for_frame), again, go(s3), alert(FopAlert::t1), bc_again, go(s6)},
    /* E104 */ {go(s1, A::retransmit_ad, A::look_for_frame), again, go(s3), suspend, bc_again, go(s6)},
    /* E17  */ alert_but_s6(FopAlert::t1),
    /* E18  */ {suspend, suspend, suspend, suspend, alert(FopAlert::t1), go(s6)},
    /* E19  */
    {go(s1, A::queue_frame, A::look_for_frame), go(s2, A::queue_frame, A::look_for_frame),
     go(s3, A::queue_frame), go(s4, A::reject), go(s5, A::reject), go(s6, A::reject)},
    /* E20  */ everywhere(A::reject),
    /* E21  */ everywhere(A::transmit_bd),
    /* E22  */ everywhere(A::reject),
    /* E23  */ only_in_s6(go(s1, A::accept, A::initialise, A::confirm)),
    /* E24  */ only_in_s6(go(s4, A::accept, A::initialise, A::start_timer)),
    /* E25  */ only_in_s6(go(s5, A::accept, A::initialise, A::transmit_bc)),
    /* E26  */ everywhere(A::reject),
    /* E27  */ only_in_s6(go(s5, A::accept, A::initialise, A::take_vs, A::transmit_bc)),
    /* E28  */ everywhere(A::reject),
    /* E29  */
    {FopCell{{A::accept, A::alert, A::confirm}, s6, FopAlert::term},
     FopCell{{A::accept, A::alert, A::confirm}, s6, FopAlert::term},
     FopCell{{A::accept, A::alert, A::confirm}, s6, FopAlert::term},
     FopCell{{A::accept, A::alert, A::confirm}, s6, FopAlert::term},
     FopCell{{A::accept, A::alert, A::confirm}, s6, FopAlert::term}, go(s6, A::accept, A::confirm)},
    /* E30  */ everywhere(A::reject),
    /* E31  */ only_in_s6(go(s1, A::accept, A::resume, A::confirm)),
    /* E32  */ only_in_s6(go(s2, A::accept, A::resume, A::confirm)),
    /* E33  */ only_in_s6(go(s3, A::accept, A::resume, A::confirm)),
    /* E34  */ only_in_s6(go(s4, A::accept, A::resume, A::confirm)),
    /* E35  */ only_in_s6(go(s6, A::accept, A::take_vs, A::confirm)),
    /* E36  */ everywhere(A::accept, A::take_value, A::confirm),
    /* E37  */ everywhere(A::accept, A::take_value, A::confirm),
    /* E38  */ everywhere(A::accept, A::take_value, A::confirm),
    /* E39  */ everywhere(A::accept, A::take_value, A::confirm),
    /* E40  */ everywhere(A::reject),
    /* E41  */
    {go(s1, A::ad_ready, A::look_for_frame), go(s2, A::ad_ready, A::look_for_frame), go(s3, A::ad_ready),
     go(s4, A::ad_ready), go(s5, A::ad_ready), go(s6, A::ad_ready)},
    /* E42  */ refused(A::ad_ready),
    /* E43  */
    {go(s1, A::bc_ready), go(s2, A::bc_ready), go(s3, A::bc_ready), go(s4, A::bc_ready),
     go(s5, A::bc_ready, A::look_for_directive), go(s6, A::bc_ready)},
    /* E44  */ refused(A::bc_ready),
    /* E45  */ everywhere(A::bd_ready, A::accept),
    /* E46  */ refused(A::bd_ready, A::reject),
}};

constexpr std::array<std::string_view, fop_event_count> event_names{
    "E1",  "E2",   "E3",  "E4",  "E5",  "E6",  "E7",   "E101", "E102", "E8",  "E9",  "E10", "E11",
    "E12", "E103", "E13", "E14", "E15", "E16", "E104", "E17",  "E18",  "E19", "E20", "E21", "E22",
    "E23", "E24",  "E25", "E26", "E27", "E28", "E29",  "E30",  "E31",  "E32", "E33", "E34", "E35",
    "E36", "E37",  "E38", "E39", "E40", "E41", "E42",  "E43",  "E44",  "E45", "E46"};

std::uint8_t distance(std::uint8_t from, std::uint8_t to) {
  return static_cast<std::uint8_t>(to - from);
}

}  // namespace

std::string_view to_string(FopState state) {
  constexpr std::array<std::string_view, fop_state_count> names{
      "active",       "retransmit_without_wait", "retransmit_with_wait",
      "initialising", "initialising_with_bc",    "initial"};
  return names.at(static_cast<std::size_t>(state) - 1);
}

std::string_view to_string(FopEvent event) {
  return event_names.at(static_cast<std::size_t>(event));
}

std::string_view to_string(FopAlert alert) {
  switch (alert) {
    case FopAlert::limit:
      return "limit";
    case FopAlert::t1:
      return "t1";
    case FopAlert::lockout:
      return "lockout";
    case FopAlert::synch:
      return "synch";
    case FopAlert::nn_r:
      return "nn_r";
    case FopAlert::clcw:
      return "clcw";
    case FopAlert::llif:
      return "llif";
    case FopAlert::term:
      return "term";
  }
  return "?";
}

const FopCell& fop_cell(FopEvent event, FopState state) {
  return table.at(static_cast<std::size_t>(event)).at(static_cast<std::size_t>(state) - 1);
}

bool is_valid(const FopSettings& settings) {
  return settings.window >= 1 && settings.window <= farm_window_default / 2 &&
         settings.timer > milliseconds(0) && settings.transmission_limit >= 1;
}

Fop1::Fop1(FopSettings settings) : settings_(settings) {
  assert(is_valid(settings));
}

void Fop1::initiate_without_check(std::uint64_t tag, MonotonicTime now) {
  apply(FopEvent::e23, {.tag = tag, .directive = true}, now);
}

void Fop1::initiate_with_check(std::uint64_t tag, MonotonicTime now) {
  apply(FopEvent::e24, {.tag = tag, .directive = true}, now);
}

void Fop1::initiate_with_unlock(std::uint64_t tag, MonotonicTime now) {
  apply(bc_ready_ ? FopEvent::e25 : FopEvent::e26,
        {.tag = tag, .control = {.kind = ControlCommand::Kind::unlock}, .directive = true}, now);
}

void Fop1::initiate_with_set_vr(std::uint64_t tag, std::uint8_t vr, MonotonicTime now) {
  apply(bc_ready_ ? FopEvent::e27 : FopEvent::e28,
        {.tag = tag,
         .value = vr,
         .control = {.kind = ControlCommand::Kind::set_vr, .vr = vr},
         .directive = true},
        now);
}

void Fop1::terminate(std::uint64_t tag, MonotonicTime now) {
  apply(FopEvent::e29, {.tag = tag, .directive = true}, now);
}

void Fop1::resume(std::uint64_t tag, MonotonicTime now) {
  FopEvent event = FopEvent::e30;
  if (suspended_in_)
    event = static_cast<FopEvent>(static_cast<unsigned>(FopEvent::e31) +
                                  (static_cast<unsigned>(*suspended_in_) - 1));
  apply(event, {.tag = tag, .directive = true}, now);
}

void Fop1::set_vs(std::uint64_t tag, std::uint8_t vs, MonotonicTime now) {
  // What waits for resume keeps its numbers.
  apply(suspended_in_ ? FopEvent::e40 : FopEvent::e35, {.tag = tag, .value = vs, .directive = true}, now);
}

void Fop1::set_settings(std::uint64_t tag, const FopSettings& settings, MonotonicTime now) {
  apply(is_valid(settings) ? FopEvent::e36 : FopEvent::e40,
        {.tag = tag, .settings = settings, .directive = true}, now);
}

void Fop1::request_ad(std::uint64_t tag, Octets data, MonotonicTime now) {
  apply(wait_ ? FopEvent::e20 : FopEvent::e19, {.tag = tag, .data = std::move(data)}, now);
}

void Fop1::request_bd(std::uint64_t tag, Octets data, MonotonicTime now) {
  apply(bd_ready_ ? FopEvent::e21 : FopEvent::e22, {.tag = tag, .data = std::move(data)}, now);
}

void Fop1::on_clcw(const Clcw& clcw, MonotonicTime now) {
  apply(classify(clcw), {.value = clcw.report_value}, now);
}

void Fop1::on_invalid_clcw(MonotonicTime now) {
  apply(FopEvent::e15, {}, now);
}

void Fop1::on_time(MonotonicTime now) {
  if (!timer_ || now < *timer_) return;
  timer_.reset();
  const bool left = transmission_count_ < settings_.transmission_limit;
  if (settings_.suspend_when_exhausted) {
    apply(left ? FopEvent::e104 : FopEvent::e18, {}, now);
  } else {
    apply(left ? FopEvent::e16 : FopEvent::e17, {}, now);
  }
  // The table ignores E16 in S3 and starts no timer on the way back to S1: frames would be left unwatched.
  if (state_ == s3 && !timer_) start_timer(now);
}

void Fop1::on_ad_accepted(MonotonicTime now) {
  apply(FopEvent::e41, {}, now);
}
void Fop1::on_ad_rejected(MonotonicTime now) {
  apply(FopEvent::e42, {}, now);
}
void Fop1::on_bc_accepted(MonotonicTime now) {
  apply(FopEvent::e43, {}, now);
}
void Fop1::on_bc_rejected(MonotonicTime now) {
  apply(FopEvent::e44, {}, now);
}
void Fop1::on_bd_accepted(MonotonicTime now) {
  apply(FopEvent::e45, {.tag = bd_tag_}, now);
}
void Fop1::on_bd_rejected(MonotonicTime now) {
  apply(FopEvent::e46, {.tag = bd_tag_}, now);
}

std::optional<FopSignal> Fop1::next_signal() {
  if (signals_.empty()) return std::nullopt;
  FopSignal signal = std::move(signals_.front());
  signals_.pop_front();
  return signal;
}

bool Fop1::room() const {
  return (state_ == s1 || state_ == s2 || state_ == s3) && !wait_;
}

FopEvent Fop1::classify(const Clcw& clcw) const {
  using E = FopEvent;
  if (clcw.lockout) return E::e14;
  const std::uint8_t nr = clcw.report_value;
  if (distance(nnr_, nr) > distance(nnr_, vs_)) return E::e13;
  const bool news = nr != nnr_;
  const bool all = nr == vs_;
  if (!clcw.retransmit) {
    if (clcw.wait) return all ? E::e3 : E::e7;
    if (all) return news ? E::e2 : E::e1;
    return news ? E::e6 : E::e5;
  }
  if (all) return E::e4;
  if (settings_.transmission_limit == 1) return news ? E::e101 : E::e102;
  if (news) return clcw.wait ? E::e9 : E::e8;
  if (transmission_count_ < settings_.transmission_limit) return clcw.wait ? E::e11 : E::e10;
  return clcw.wait ? E::e103 : E::e12;
}

void Fop1::apply(FopEvent event, Input input, MonotonicTime now) {
  const FopCell& cell = fop_cell(event, state_);
  for (const FopAction action : cell.actions) act(action, event, cell, input, now);
  const bool initiates = state_ == s6 && (cell.next == s4 || cell.next == s5) && event != FopEvent::e34;
  if (initiates) initiating_ = input.tag;
  state_ = cell.next;
}

void Fop1::act(FopAction action, FopEvent event, const FopCell& cell, Input& input, MonotonicTime now) {
  using Kind = FopSignal::Kind;
  switch (action) {
    case A::none:
      return;
    case A::remove_acknowledged:
      return remove_acknowledged(input.value);
    case A::look_for_frame:
      return look_for_frame(now);
    case A::look_for_directive:
      return look_for_directive();
    case A::retransmit_ad:
      return retransmit_ad(now);
    case A::retransmit_bc:
      return retransmit_bc(now);
    case A::start_timer:
      return start_timer(now);
    case A::cancel_timer:
      return timer_.reset();
    case A::alert:
      return raise_alert(cell.reason, event);
    case A::confirm_initiate:
      return confirm_initiate();
    case A::release_bc:
      return bc_.reset();
    case A::suspend:
      return suspend(event);
    case A::resume:
      suspended_in_.reset();
      return start_timer(now);
    case A::queue_frame:
      wait_ = Waiting{input.tag, std::move(input.data)};
      return;
    case A::accept:
      return answer(Kind::directive_accepted, Kind::accepted, input);
    case A::reject:
      return answer(Kind::directive_rejected, Kind::rejected, input);
    case A::confirm:
      return answer(Kind::directive_confirmed, Kind::confirmed, input);
    case A::initialise:
      return initialise();
    case A::take_vs:
      vs_ = nnr_ = input.value;
      return;
    case A::transmit_bc:
      return transmit_bc(input.control, now);
    case A::transmit_bd:
      return transmit_bd(input);
    case A::take_value:
      settings_ = input.settings;
      return;
    case A::ad_ready:
      ad_ready_ = true;
      return;
    case A::bc_ready:
      bc_ready_ = true;
      return;
    case A::bd_ready:
      bd_ready_ = true;
      return;
  }
}

void Fop1::retransmit_ad(MonotonicTime now) {
  ++transmission_count_;
  start_timer(now);
  for (Sent& sent : sent_) sent.retransmit = true;
}

void Fop1::retransmit_bc(MonotonicTime now) {
  ++transmission_count_;
  start_timer(now);
  if (bc_) bc_->retransmit = true;
}

void Fop1::confirm_initiate() {
  if (initiating_) signals_.push_back({.kind = FopSignal::Kind::directive_confirmed, .tag = *initiating_});
  initiating_.reset();
}

void Fop1::suspend(FopEvent event) {
  suspended_in_ = state_;
  signals_.push_back({.kind = FopSignal::Kind::suspended, .event = event, .state = state_});
}

void Fop1::initialise() {
  purge();
  transmission_count_ = 1;
  suspended_in_.reset();
}

void Fop1::transmit_bc(const ControlCommand& command, MonotonicTime now) {
  bc_ = ControlFrame{.command = command};
  transmission_count_ = 1;
  start_timer(now);
  bc_ready_ = false;
  signals_.push_back({.kind = FopSignal::Kind::transmit_bc, .control = command});
}

void Fop1::transmit_bd(Input& input) {
  bd_ready_ = false;
  bd_tag_ = input.tag;
  signals_.push_back({.kind = FopSignal::Kind::transmit_bd, .tag = input.tag, .data = std::move(input.data)});
}

void Fop1::remove_acknowledged(std::uint8_t nr) {
  for (; nnr_ != nr; ++nnr_) {
    // A purge leaves V(S) where it was: then there are numbers without a frame.
    if (sent_.empty() || sent_.front().sequence != nnr_) continue;
    signals_.push_back(
        {.kind = FopSignal::Kind::confirmed, .tag = sent_.front().tag, .sequence = sent_.front().sequence});
    sent_.pop_front();
  }
  transmission_count_ = 1;
}

void Fop1::look_for_frame(MonotonicTime now) {
  using Kind = FopSignal::Kind;
  if (!ad_ready_) return;
  const auto again = std::find_if(sent_.begin(), sent_.end(), [](const Sent& s) { return s.retransmit; });
  if (again != sent_.end()) {
    again->retransmit = false;
    ad_ready_ = false;
    signals_.push_back({.kind = Kind::transmit_ad,
                        .tag = again->tag,
                        .sequence = again->sequence,
                        .repeated = true,
                        .data = again->data});
    return;
  }
  if (!wait_ || distance(nnr_, vs_) >= settings_.window) return;
  signals_.push_back({.kind = Kind::accepted, .tag = wait_->tag});
  if (sent_.empty()) transmission_count_ = 1;
  sent_.push_back({.sequence = vs_, .tag = wait_->tag, .data = std::move(wait_->data)});
  wait_.reset();
  ++vs_;
  start_timer(now);
  ad_ready_ = false;
  const Sent& sent = sent_.back();
  signals_.push_back(
      {.kind = Kind::transmit_ad, .tag = sent.tag, .sequence = sent.sequence, .data = sent.data});
}

void Fop1::look_for_directive() {
  if (!bc_ready_ || !bc_ || !bc_->retransmit) return;
  bc_->retransmit = false;
  bc_ready_ = false;
  signals_.push_back({.kind = FopSignal::Kind::transmit_bc, .repeated = true, .control = bc_->command});
}

void Fop1::raise_alert(FopAlert reason, FopEvent event) {
  timer_.reset();
  purge();
  signals_.push_back({.kind = FopSignal::Kind::alert, .reason = reason, .event = event, .state = state_});
}

void Fop1::purge() {
  using Kind = FopSignal::Kind;
  for (const Sent& sent : sent_)
    signals_.push_back({.kind = Kind::not_confirmed, .tag = sent.tag, .sequence = sent.sequence});
  sent_.clear();
  bc_.reset();
  if (wait_) signals_.push_back({.kind = Kind::rejected, .tag = wait_->tag});
  wait_.reset();
  if (initiating_) signals_.push_back({.kind = Kind::directive_failed, .tag = *initiating_});
  initiating_.reset();
}

void Fop1::answer(FopSignal::Kind directive, FopSignal::Kind request, const Input& input) {
  signals_.push_back({.kind = input.directive ? directive : request, .tag = input.tag});
}

}  // namespace srfs::wire
