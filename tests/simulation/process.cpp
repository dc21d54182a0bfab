// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/process.hpp"

#include "ros/lifecycle.hpp"

namespace srfs::simulation {

Host::Host(Kernel& kernel, Lane lane, MakeProgram make)
    : kernel_(kernel), lane_(lane), make_(std::move(make)) {}

nanoseconds Host::waited() const {
  return waited_ + (starves_from_ ? now() - *starves_from_ : nanoseconds(0));
}

void Host::begin(nanoseconds delay) {
  if (state_ != State::down) throw Violation{"C6a", "two processes: " + name()};
  state_ = State::starting;
  // Numbers are never used again, so they say which start this is.
  pid_ = static_cast<pid_t>(100 + 100 * static_cast<int>(lane_) + static_cast<int>(starts_++) * 2000);
  ++incarnation_;
  starves_from_.reset();
  waited_ = nanoseconds(0);
  page_ = {};
  page_.pid = pid_;
  page_.incarnation = incarnation_;
  page_.last_turn = now();
  page_.state = static_cast<std::uint32_t>(ros::State::configuring);
  page_.desired = static_cast<std::uint32_t>(ros::State::active);
  kernel_.trace(Lane::world, lane_, "start", incarnation_);
  kernel_.later(delay, [this, pid = pid_] {
    if (pid_ != pid || state_ != State::starting) return;
    state_ = State::running;
    well_since_ = now();
    page_.state = page_.desired;
    if (observer_) observer_(*this);
    run([this] {
      program_ = make_(*this);
      if (program_) program_->start();
    });
  });
}

void Host::end(const char* why) {
  if (state_ == State::down) return;
  kernel_.trace(Lane::world, lane_, why, incarnation_);
  state_ = State::down;
  program_.reset();
  inbox_.clear();
  outbox_.clear();
  kill_in_.reset();
  stop_in_.reset();
  starves_from_.reset();
  if (observer_) observer_(*this);
}

void Host::stop(bool for_want_of_cpu) {
  if (state_ != State::running) return;
  kernel_.trace(Lane::world, lane_, for_want_of_cpu ? "no CPU" : "SIGSTOP", incarnation_);
  state_ = State::stopped;
  if (for_want_of_cpu) starves_from_ = now();
}

void Host::go_on() {
  if (state_ != State::stopped) return;
  kernel_.trace(Lane::world, lane_, "goes on", incarnation_);
  state_ = State::running;
  well_since_ = now();
  if (const auto from = std::exchange(starves_from_, std::nullopt)) waited_ += now() - *from;
  const pid_t pid = pid_;
  while (!outbox_.empty() && state_ == State::running && pid_ == pid) {
    const auto event = std::move(outbox_.front());
    outbox_.pop_front();
    event();
  }
  while (!inbox_.empty() && state_ == State::running && pid_ == pid) {
    const auto event = std::move(inbox_.front());
    inbox_.pop_front();
    run(event);
  }
}

void Host::kill_at_action(std::uint32_t actions) {
  if (state_ != State::down) kill_in_ = actions;
}

void Host::stop_at_action(std::uint32_t actions, nanoseconds duration) {
  if (state_ == State::down) return;
  stop_in_ = actions;
  stop_for_ = duration;
}

void Host::later(nanoseconds delay, Kernel::Event event) {
  kernel_.later(delay, [this, pid = pid_, event = std::move(event)] {
    if (pid_ == pid && is_up()) give(event);
  });
}

void Host::every(nanoseconds period, Kernel::Event event) {
  later(period, [this, period, event = std::move(event)] {
    event();
    if (is_up()) every(period, event);
  });
}

void Host::give(Kernel::Event event) {
  if (state_ == State::running && inbox_.empty()) return run(event);
  if (is_up()) inbox_.push_back(std::move(event));
}

void Host::output(Kernel::Event event) {
  if (state_ == State::running && outbox_.empty()) return event();
  if (is_up()) outbox_.push_back(std::move(event));
}

void Host::run(const Kernel::Event& event) {
  page_.last_turn = now();
  ++page_.turns;
  try {
    event();
  } catch (const Killed&) {
    end("killed between two actions");
  }
}

void Host::action_point() {
  if (state_ != State::running) return;
  if (kill_in_ && (*kill_in_)-- == 0) throw Killed{};
  if (stop_in_ && (*stop_in_)-- == 0) {
    stop_in_.reset();
    stop(false);
    kernel_.later(stop_for_, [this, pid = pid_] {
      if (pid_ == pid) go_on();
    });
  }
}

void Network::on_begin(const Host& host) {
  const auto self = static_cast<std::size_t>(host.lane());
  for (std::size_t other = 0; other < lane_count; ++other) {
    matched_[self][other] = kernel_.now() + random_.between(milliseconds(3), milliseconds(250));
    matched_[other][self] = kernel_.now() + random_.between(milliseconds(3), milliseconds(250));
  }
  matched_[self][self] = kernel_.now();
}

nanoseconds Network::delay() {
  const nanoseconds usual = random_.between(microseconds(60), microseconds(400));
  return longest_ > nanoseconds(0) && random_.one_in(8) ? random_.between(usual, longest_) : usual;
}

}  // namespace srfs::simulation
