// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// FOP-1 under arbitrary sequences of events: control words from the line, requests, directives, time.
#include <cstdlib>

#include "wire/fop1.hpp"

namespace {

using namespace srfs;
using namespace srfs::wire;
using Kind = FopSignal::Kind;

/// Counts the requests that have not ended.
class Balance {
 public:
  void requested() { ++open_; }
  void handle(const FopSignal& signal) {
    if (signal.kind == Kind::confirmed || signal.kind == Kind::not_confirmed ||
        (signal.kind == Kind::rejected && signal.tag == ad_tag))
      --open_;
  }
  void check(const Fop1& fop) const {
    if (open_ != static_cast<long>(fop.outstanding() + (fop.waiting() ? 1 : 0))) std::abort();
    if (fop.outstanding() > 255) std::abort();
    const bool works = fop.state() == FopState::active || fop.state() == FopState::retransmit_without_wait ||
                       fop.state() == FopState::retransmit_with_wait;
    // Nothing hangs: the timer watches all frames in flight.
    if (works && fop.outstanding() > 0 && !fop.deadline()) std::abort();
  }
  static constexpr std::uint64_t ad_tag = 1;

 private:
  long open_ = 0;
};

/// One event of any kind. @return whether the line takes the frames that it causes
bool give_event(Fop1& fop, Balance& balance, std::uint8_t event, OctetReader& in, MonotonicTime& now) {
  bool line_takes = true;
  switch (event & 15) {
    case 0:
      fop.initiate_without_check(2, now);
      break;
    case 1:
      fop.initiate_with_check(2, now);
      break;
    case 2:
      fop.initiate_with_unlock(2, now);
      break;
    case 3:
      fop.initiate_with_set_vr(2, in.u8(), now);
      break;
    case 4:
      fop.terminate(2, now);
      break;
    case 5:
      fop.resume(2, now);
      break;
    case 6:
      fop.set_vs(2, in.u8(), now);
      break;
    case 7:
      line_takes = false;
      [[fallthrough]];
    case 8:
    case 9:
      fop.request_ad(Balance::ad_tag, {event}, now);
      balance.requested();
      break;
    case 10:
      fop.request_bd(3, {event}, now);
      break;
    case 11:
      now += milliseconds(100);
      fop.on_time(now);
      break;
    case 12: {
      const auto clcw = decode_clcw(in.u32());
      clcw ? fop.on_clcw(*clcw, now) : fop.on_invalid_clcw(now);
      break;
    }
    default: {  // a plausible control word
      const std::uint8_t flags = in.u8();
      fop.on_clcw({.wait = (flags & 1) != 0,
                   .retransmit = (flags & 2) != 0,
                   .report_value = static_cast<std::uint8_t>(fop.nnr() + (flags >> 2))},
                  now);
    }
  }
  return line_takes;
}

void handle_signals(Fop1& fop, Balance& balance, bool line_takes, MonotonicTime now) {
  while (const auto signal = fop.next_signal()) {
    balance.handle(*signal);
    if (signal->kind == Kind::transmit_ad) line_takes ? fop.on_ad_accepted(now) : fop.on_ad_rejected(now);
    if (signal->kind == Kind::transmit_bc) line_takes ? fop.on_bc_accepted(now) : fop.on_bc_rejected(now);
    if (signal->kind == Kind::transmit_bd) line_takes ? fop.on_bd_accepted(now) : fop.on_bd_rejected(now);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  OctetReader in(OctetView(data, size));
  Fop1 fop({.window = static_cast<std::uint8_t>(1 + in.u8() % 32),
            .timer = milliseconds(100),
            .transmission_limit = static_cast<std::uint8_t>(1 + in.u8() % 8),
            .suspend_when_exhausted = in.u8() % 2 == 0});
  Balance balance;
  MonotonicTime now;
  while (in.ok() && in.remaining() > 0) {
    const std::uint8_t event = in.u8();
    now += milliseconds(event >> 4);
    const bool line_takes = give_event(fop, balance, event, in, now);
    handle_signals(fop, balance, line_takes, now);
    balance.check(fop);
  }

  // After any sequence, FOP-1 must work once it is terminated and started again.
  fop.terminate(2, now);
  fop.initiate_with_set_vr(2, 7, now);
  fop.on_bc_accepted(now);
  fop.on_clcw({.report_value = 7}, now);
  while (fop.next_signal()) {
  }
  if (fop.state() != FopState::active || !fop.room()) std::abort();
  return 0;
}
