// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// FOP-1 against FARM-1 over a line that loses, delays and duplicates frames in both directions. Frames on the
// line never overtake one another.
#include <algorithm>
#include <deque>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "tests/build_kind.hpp"
#include "wire/farm1.hpp"
#include "wire/fop1.hpp"

namespace srfs::wire {
namespace {

using Kind = FopSignal::Kind;

/// One direction of the link.
template <class T>
class Line {
 public:
  Line(std::mt19937& random, double loss, milliseconds longest_delay)
      : random_(random), loss_(loss), longest_delay_(longest_delay) {}

  void send(const T& item, MonotonicTime now) {
    if (chance(loss_)) return;
    const int copies = chance(loss_ / 2) ? 2 : 1;
    for (int copy = 0; copy < copies; ++copy) {
      const milliseconds delay(
          std::uniform_int_distribution<int>(0, static_cast<int>(longest_delay_.count()))(random_));
      last_ = std::max(last_, now + delay);
      items_.push_back({last_, item});
    }
  }
  std::vector<T> receive(MonotonicTime now) {
    std::vector<T> items;
    for (; !items_.empty() && items_.front().first <= now; items_.pop_front())
      items.push_back(std::move(items_.front().second));
    return items;
  }
  [[nodiscard]] bool chance(double probability) {
    return std::uniform_real_distribution<>(0, 1)(random_) < probability;
  }
  void clear() { items_.clear(); }

 private:
  std::mt19937& random_;
  double loss_;
  milliseconds longest_delay_;
  MonotonicTime last_;
  std::deque<std::pair<MonotonicTime, T>> items_;
};

struct Conditions {
  double loss = 0.2;
  milliseconds longest_delay{300};
  FopSettings settings = {};
};

/// Both ends and the line between them.
class Link {
 public:
  Link(unsigned seed, const Conditions& conditions)
      : random_(seed),
        up_(random_, conditions.loss, conditions.longest_delay),
        down_(random_, conditions.loss, conditions.longest_delay),
        fop_(conditions.settings) {
    farm_.vr = static_cast<std::uint8_t>(random_());
  }

  /// Starts the AD service from FARM-1's current state. @return false: the line lost too many frames
  [[nodiscard]] bool initiate() {
    switch (random_() % 3) {
      case 0:
        fop_.set_vs(0, farm_.vr, now_);
        fop_.initiate_with_check(0, now_);
        break;
      case 1:
        fop_.set_vs(0, farm_.vr, now_);
        fop_.initiate_with_unlock(0, now_);
        break;
      default:
        fop_.initiate_with_set_vr(0, static_cast<std::uint8_t>(random_()), now_);
    }
    drain();
    while (fop_.state() == FopState::initialising || fop_.state() == FopState::initialising_with_bc) step();
    return fop_.state() != FopState::initial;
  }

  void step() {
    now_ += milliseconds(1 + static_cast<int>(random_() % 25));
    const bool buffer = random_() % 8 != 0;
    if (buffer && farm_.wait) farm_ = farm_step(farm_, FarmEvent::e10_buffer_released).state;
    for (const TcFrame& frame : up_.receive(now_)) {
      const FarmOutcome outcome = farm_receive(farm_, frame, buffer);
      farm_ = outcome.state;
      if (outcome.verdict == FarmVerdict::accept_sequenced) delivered_.push_back(number(frame.data));
    }
    down_.send(make_clcw(farm_, 0), now_);
    for (const Clcw& clcw : down_.receive(now_)) {
      fop_.on_clcw(clcw, now_);
      drain();
    }
    fop_.on_time(now_);
    drain();
  }

  void request(std::uint64_t tag) {
    fop_.request_ad(tag, {static_cast<std::uint8_t>(tag >> 8), static_cast<std::uint8_t>(tag)}, now_);
    drain();
  }
  void unlock() {
    fop_.set_vs(0, farm_.vr, now_);
    fop_.initiate_with_unlock(0, now_);
    drain();
  }
  /// Simulates a pause longer than the line's delay: empties the line and discards the alerts.
  void quiet() {
    up_.clear();
    down_.clear();
    alerts_.clear();
  }

  [[nodiscard]] const Fop1& fop() const { return fop_; }
  [[nodiscard]] FarmState& farm() { return farm_; }
  [[nodiscard]] const std::vector<std::uint64_t>& delivered() const { return delivered_; }
  [[nodiscard]] const std::vector<std::uint64_t>& confirmed() const { return confirmed_; }
  [[nodiscard]] const std::vector<FopAlert>& alerts() const { return alerts_; }
  [[nodiscard]] std::size_t ended() const { return ended_; }
  [[nodiscard]] MonotonicTime now() const { return now_; }

 private:
  static std::uint64_t number(OctetView data) { return static_cast<std::uint64_t>(data[0]) << 8 | data[1]; }

  void drain() {
    while (const auto signal = fop_.next_signal()) {
      switch (signal->kind) {
        case Kind::transmit_ad:
          up_.send({.type = TcFrameType::ad, .sequence = signal->sequence, .data = signal->data}, now_);
          fop_.on_ad_accepted(now_);
          break;
        case Kind::transmit_bc:
          up_.send({.type = TcFrameType::bc, .data = encode_control_command(signal->control)}, now_);
          fop_.on_bc_accepted(now_);
          break;
        case Kind::confirmed:
          confirmed_.push_back(signal->tag);
          ++ended_;
          break;
        case Kind::not_confirmed:
        case Kind::rejected:
          ++ended_;
          break;
        case Kind::alert:
          alerts_.push_back(signal->reason);
          break;
        default:
          break;
      }
    }
    ASSERT_LE(fop_.outstanding(), fop_.settings().window);
  }

  std::mt19937 random_;
  Line<TcFrame> up_;
  Line<Clcw> down_;
  Fop1 fop_;
  FarmState farm_;
  MonotonicTime now_{seconds(1)};
  std::vector<std::uint64_t> delivered_;
  std::vector<std::uint64_t> confirmed_;
  std::vector<FopAlert> alerts_;
  std::size_t ended_ = 0;
};

constexpr seconds longest_transfer{20000};  // simulated time

std::vector<std::uint64_t> numbers(std::uint64_t count) {
  std::vector<std::uint64_t> all(count);
  for (std::uint64_t i = 0; i < count; ++i) all[i] = i;
  return all;
}

TEST(CopOne, DeliversEveryFrameInOrderExactlyOnceOverAnyLine) {
  constexpr std::uint64_t frames = 600;  // the sequence number wraps twice
  for (unsigned seed = 0; seed < (testing_support::slow ? 18 : 60); ++seed) {
    std::mt19937 random(seed);
    const Conditions conditions{.loss = (seed % 6) * 0.1,
                                .longest_delay = milliseconds(1 + random() % 2000),
                                .settings = {.window = static_cast<std::uint8_t>(1 + random() % 32),
                                             .timer = milliseconds(50 + random() % 4000),
                                             .transmission_limit = 255}};
    Link link(seed, conditions);
    while (!link.initiate()) link.quiet();
    std::uint64_t next = 0;
    while (link.confirmed().size() < frames && link.alerts().empty()) {
      ASSERT_LT(link.now(), MonotonicTime(longest_transfer)) << "it hangs, seed " << seed;
      if (next < frames && link.fop().room()) link.request(next++);
      link.step();
      if (::testing::Test::HasFatalFailure()) FAIL() << "seed " << seed;
    }
    ASSERT_TRUE(link.alerts().empty()) << to_string(link.alerts().front()) << ", seed " << seed;
    EXPECT_EQ(link.delivered(), numbers(frames)) << "seed " << seed;
    EXPECT_EQ(link.confirmed(), numbers(frames)) << "seed " << seed;
  }
}

TEST(CopOne, WhatIsConfirmedWasDeliveredOnceInOrderAlsoWhenTheServiceEndsAgainAndAgain) {
  for (unsigned seed = 0; seed < 60; ++seed) {
    const Conditions conditions{.loss = 0.35,
                                .longest_delay = milliseconds(200),
                                .settings = {.window = 8,
                                             .timer = milliseconds(500),
                                             .transmission_limit = static_cast<std::uint8_t>(1 + seed % 4)}};
    Link link(seed, conditions);
    std::uint64_t next = 0;
    for (int service = 0; service < 30; ++service) {
      if (link.fop().state() == FopState::initial) {
        link.quiet();  // the operator waits longer than the line's delay
        static_cast<void>(link.initiate());
      }
      const MonotonicTime begun = link.now();
      while (link.fop().state() != FopState::initial && link.now() - begun < seconds(20)) {
        if (link.fop().room()) link.request(next++);
        link.step();
      }
      if (::testing::Test::HasFatalFailure()) FAIL() << "seed " << seed;
    }
    // Frames arrive in order and at most once; every confirmed frame has arrived.
    EXPECT_TRUE(std::is_sorted(link.delivered().begin(), link.delivered().end(), std::less_equal<>()))
        << seed;
    EXPECT_TRUE(std::is_sorted(link.confirmed().begin(), link.confirmed().end(), std::less_equal<>()))
        << seed;
    EXPECT_TRUE(std::includes(link.delivered().begin(), link.delivered().end(), link.confirmed().begin(),
                              link.confirmed().end()))
        << seed;
    EXPECT_GE(link.delivered().size(), 1U) << seed;
    // Every request has ended or is still in progress.
    EXPECT_EQ(link.ended() + link.fop().outstanding() + (link.fop().waiting() ? 1 : 0), next) << seed;
  }
}

TEST(CopOne, ALockedOutFarmEndsTheServiceAndUnlockBringsItBack) {
  Link link(3, {.loss = 0});
  while (!link.initiate()) link.quiet();
  link.request(0);
  const auto far = static_cast<std::uint8_t>(link.farm().vr + 100);
  link.farm() =
      farm_receive(link.farm(), {.type = TcFrameType::ad, .sequence = far, .data = {0, 9}}, true).state;
  ASSERT_TRUE(link.farm().lockout);
  for (int i = 0; i < 200 && link.alerts().empty(); ++i) link.step();
  ASSERT_EQ(link.alerts(), std::vector<FopAlert>{FopAlert::lockout});

  link.quiet();
  link.unlock();
  for (int i = 0; i < 200 && !link.fop().room(); ++i) link.step();
  EXPECT_FALSE(link.farm().lockout);
  link.request(1);
  for (int i = 0; i < 200 && link.confirmed().empty(); ++i) link.step();
  EXPECT_EQ(link.confirmed(), std::vector<std::uint64_t>{1});
}

}  // namespace
}  // namespace srfs::wire
