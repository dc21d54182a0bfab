// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/ad_service.hpp"

#include <utility>

#include <fmt/format.h>

namespace srfs::ground {
namespace {

using wire::FopAlert;
using wire::FopSignal;
using wire::FopState;

std::string explain(const FopSignal& alert) {
  const auto why = [&]() -> std::string_view {
    switch (alert.reason) {
      case FopAlert::limit:
      case FopAlert::t1:
        return "the spacecraft acknowledges nothing, all transmissions are used up";
      case FopAlert::lockout:
        return "FARM-1 is locked out: unlock";
      case FopAlert::synch:
      case FopAlert::nn_r:
        return "the CLCW does not fit what was sent; another sender may be using the AD service";
      case FopAlert::clcw:
        return "the CLCW contradicts itself";
      case FopAlert::llif:
        return "the line takes no frame";
      case FopAlert::term:
        return "ended";
    }
    return "?";
  }();
  return fmt::format("{} (alert {}, {} in S{})", why, wire::to_string(alert.reason),
                     wire::to_string(alert.event), static_cast<int>(alert.state));
}

std::uint32_t flags_of(const std::optional<wire::Clcw>& clcw) {
  if (!clcw) return 0;
  return 1U | (clcw->lockout ? 2U : 0U) | (clcw->wait ? 4U : 0U) | (clcw->retransmit ? 8U : 0U);
}

}  // namespace

std::string_view to_text(AdPhase phase) {
  switch (phase) {
    case AdPhase::off:
      return "off";
    case AdPhase::seeking:
      return "seeking";
    case AdPhase::initiating:
      return "initiating";
    case AdPhase::on:
      return "on";
  }
  return "?";
}

AdPhase AdService::phase() const {
  if (seeking_until_) return AdPhase::seeking;
  switch (fop_.state()) {
    case FopState::initial:
      return AdPhase::off;
    case FopState::initialising:
    case FopState::initialising_with_bc:
      return AdPhase::initiating;
    default:
      return AdPhase::on;
  }
}

void AdService::start(MonotonicTime now) {
  if (phase() == AdPhase::off) seek(Purpose::check, now);
  settle(now);
}

void AdService::unlock(MonotonicTime now) {
  fop_.terminate(0, now);
  // N(R) of a locked-out FARM-1 does not move: the last CLCW is as good as the next.
  if (clcw_) {
    purpose_ = Purpose::unlock;
    problem_.clear();
    initiate(clcw_, now);
  } else {
    seek(Purpose::unlock, now);
  }
  settle(now);
}

void AdService::set_vr(std::uint8_t vr, MonotonicTime now) {
  fop_.terminate(0, now);
  seeking_until_.reset();
  problem_.clear();
  by_unlock_ = false;
  fop_.initiate_with_set_vr(0, vr, now);
  settle(now);
}

void AdService::stop(MonotonicTime now) {
  seeking_until_.reset();
  problem_.clear();
  fop_.terminate(0, now);
  settle(now);
}

bool AdService::request(std::uint64_t tag, Octets packet, MonotonicTime now) {
  if (phase() == AdPhase::off || queue_.size() == queue_capacity) return false;
  queue_.push_back({tag, std::move(packet)});
  settle(now);
  return true;
}

void AdService::on_control_word(std::uint32_t word, MonotonicTime now) {
  const auto clcw = wire::decode_clcw(word);
  if (!clcw) {
    ++bad_clcws_;
    const bool type_1 = word >> 31 == 0;
    const bool ours = (word >> 18 & 0x3FU) == vc_;
    if (type_1 && ours) fop_.on_invalid_clcw(now);
    return settle(now);
  }
  if (clcw->vc != vc_) return;
  clcw_ = *clcw;
  if (seeking_until_) {
    initiate(clcw_, now);
  } else if (fop_.state() == FopState::initialising_with_bc && by_unlock_ && !clcw->lockout &&
             clcw->report_value != fop_.vs()) {
    // Unlocked, but not where the ground thought.
    fop_.terminate(0, now);
    problem_.clear();
    purpose_ = Purpose::check;
    initiate(clcw_, now);
  } else if (fop_.state() == FopState::initialising_with_bc && !by_unlock_ && clcw->lockout) {
    // Set V(R) has no effect on a FARM-1 that is locked out.
    fop_.terminate(0, now);
    problem_ = "FARM-1 is locked out: unlock";
    settle(now);
  }
  fop_.on_clcw(*clcw, now);
  settle(now);
}

void AdService::on_transmitted(AdSignal::Kind kind, bool written, MonotonicTime now) {
  if (kind == AdSignal::Kind::transmit_ad) {
    written ? fop_.on_ad_accepted(now) : fop_.on_ad_rejected(now);
  } else {
    written ? fop_.on_bc_accepted(now) : fop_.on_bc_rejected(now);
  }
  settle(now);
}

void AdService::on_time(MonotonicTime now) {
  if (seeking_until_ && now >= *seeking_until_) initiate(std::nullopt, now);
  fop_.on_time(now);
  settle(now);
}

std::optional<MonotonicTime> AdService::deadline() const {
  return seeking_until_ ? seeking_until_ : fop_.deadline();
}

std::optional<AdSignal> AdService::next_signal() {
  if (signals_.empty()) return std::nullopt;
  AdSignal signal = std::move(signals_.front());
  signals_.pop_front();
  return signal;
}

CopReport AdService::report() const {
  return {.phase = phase(),
          .state = fop_.state(),
          .vs = fop_.vs(),
          .nnr = fop_.nnr(),
          .outstanding = fop_.outstanding(),
          .queued = queue_.size() + (fop_.waiting() ? 1 : 0),
          .repeated = repeated_,
          .clcw = clcw_,
          .bad_clcws = bad_clcws_,
          .problem = problem_};
}

void AdService::seek(Purpose purpose, MonotonicTime now) {
  problem_.clear();
  purpose_ = purpose;
  seeking_until_ = now + fop_.settings().timer;
}

void AdService::initiate(std::optional<wire::Clcw> clcw, MonotonicTime now) {
  seeking_until_.reset();
  by_unlock_ = purpose_ == Purpose::unlock;
  if (clcw) fop_.set_vs(0, clcw->report_value, now);
  if (by_unlock_) return fop_.initiate_with_unlock(0, now);
  // Without a CLCW a control frame makes the spacecraft send one. A control frame also ends a retransmit flag
  // that was left behind. V(R) stays where it was last seen.
  const auto seen = clcw ? clcw : clcw_;
  if (!clcw || clcw->retransmit)
    return fop_.initiate_with_set_vr(0, seen ? seen->report_value : fop_.vs(), now);
  fop_.initiate_with_check(0, now);
}

void AdService::end(std::string problem) {
  problem_ = std::move(problem);
  for (Queued& queued : queue_) signals_.push_back({.kind = AdSignal::Kind::not_sent, .tag = queued.tag});
  queue_.clear();
}

void AdService::settle(MonotonicTime now) {
  while (auto signal = fop_.next_signal()) pass_on(std::move(*signal));
  while (phase() == AdPhase::on && fop_.room() && !queue_.empty()) {
    Queued next = std::move(queue_.front());
    queue_.pop_front();
    fop_.request_ad(next.tag, std::move(next.packet), now);
    while (auto signal = fop_.next_signal()) pass_on(std::move(*signal));
  }
  if (told_phase_ != phase() || told_state_ != fop_.state() || told_flags_ != flags_of(clcw_)) {
    told_phase_ = phase();
    told_state_ = fop_.state();
    told_flags_ = flags_of(clcw_);
    signals_.push_back({.kind = AdSignal::Kind::changed});
  }
  // After the reason: who hears that its telecommand was not sent may not listen any more.
  if (phase() == AdPhase::off && !queue_.empty()) end(problem_);
}

void AdService::pass_on(FopSignal signal) {
  using Kind = FopSignal::Kind;
  switch (signal.kind) {
    case Kind::transmit_ad:
      if (signal.repeated) ++repeated_;
      signals_.push_back({.kind = AdSignal::Kind::transmit_ad,
                          .tag = signal.tag,
                          .sequence = signal.sequence,
                          .repeated = signal.repeated,
                          .packet = std::move(signal.data)});
      break;
    case Kind::transmit_bc:
      if (signal.repeated) ++repeated_;
      signals_.push_back({.kind = AdSignal::Kind::transmit_bc, .control = signal.control});
      break;
    case Kind::confirmed:
      signals_.push_back({.kind = AdSignal::Kind::delivered, .tag = signal.tag});
      break;
    case Kind::not_confirmed:
      signals_.push_back({.kind = AdSignal::Kind::undelivered, .tag = signal.tag});
      break;
    case Kind::rejected:
      signals_.push_back({.kind = AdSignal::Kind::not_sent, .tag = signal.tag});
      break;
    case Kind::alert:
      if (signal.reason != FopAlert::term) problem_ = explain(signal);
      break;
    case Kind::suspended:  // the timeout type is 0
    case Kind::transmit_bd:
    case Kind::accepted:
    case Kind::directive_accepted:
    case Kind::directive_rejected:
    case Kind::directive_confirmed:
    case Kind::directive_failed:
      break;
  }
}

}  // namespace srfs::ground
