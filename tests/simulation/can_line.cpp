// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/can_line.hpp"

#include <algorithm>

namespace srfs::simulation {
namespace {

constexpr std::uint32_t bit_rate = 500'000;

sim::BusFrame to_bus(const hw::CanFrame& frame) {
  return {.id = frame.id,
          .extended = frame.extended,
          .remote = frame.remote,
          .size = frame.size,
          .data = frame.data};
}
hw::CanFrame to_can(const sim::BusFrame& frame) {
  hw::CanFrame can;
  can.id = frame.id;
  can.extended = frame.extended;
  can.remote = frame.remote;
  can.size = frame.size;
  can.data = frame.data;
  return can;
}

bool passes(const hw::CanFrame& frame, bool is_echo, const std::vector<hw::CanFilter>& filters) {
  return filters.empty() || std::any_of(filters.begin(), filters.end(), [&](const hw::CanFilter& f) {
           return is_echo ? (frame.id & f.echo_mask) == (f.echo_match & f.echo_mask)
                          : (frame.id & f.mask) == (f.match & f.mask);
         });
}

}  // namespace

CanLine::CanLine(Kernel& kernel)
    : kernel_(kernel),
      arbiter_(bit_rate, 64, kernel.random("bus").next()),
      computer_(arbiter_.add_station()),
      computer_client_(arbiter_.add_client(computer_)),
      deadline_(
          kernel,
          [&kernel](nanoseconds delay, Kernel::Event event) { kernel.later(delay, std::move(event)); },
          [this] { advance(); }) {
  arbiter_.set_automatic_restart(milliseconds(100));  // restart-ms of the interface
}

std::unique_ptr<CanHandle> CanLine::open(Host& host, std::vector<hw::CanFilter> filters,
                                         std::function<void()> on_input) {
  auto handle = std::make_unique<CanHandle>(*this, &host, std::move(filters), std::move(on_input));
  handle->client_ = computer_client_;
  handles_.push_back(handle.get());
  return handle;
}

std::unique_ptr<CanHandle> CanLine::open_device(std::function<void()> on_input) {
  auto handle =
      std::make_unique<CanHandle>(*this, nullptr, std::vector<hw::CanFilter>{}, std::move(on_input));
  handle->client_ = arbiter_.add_client();
  handles_.push_back(handle.get());
  return handle;
}

Result<void, hw::CanError> CanLine::submit(CanHandle& handle, const hw::CanFrame& frame) {
  advance();
  switch (arbiter_.submit(handle.client_, to_bus(frame), kernel_.now())) {
    case sim::Submission::queued:
      break;
    case sim::Submission::queue_full:
      return Err(hw::CanError::queue_full);
    case sim::Submission::invalid:
      return Err(hw::CanError::invalid_frame);
    case sim::Submission::bus_off:
      return Err(hw::CanError::bus_off);
  }
  if (handle.host_ != nullptr) {
    owners_.push_back({&handle, handle.host_->lane(), handle.pid_});
    if (tap_) tap_(handle.host_->lane());
  }
  deadline_.arm(arbiter_.next_deadline());
  return {};
}

std::size_t CanLine::waiting_of(Lane node) const {
  return static_cast<std::size_t>(
      std::count_if(owners_.begin(), owners_.end(), [node](const Owner& o) { return o.node == node; }));
}

/// Takes back what waits of the whole computer: its interface has one queue.
bool CanLine::withdraw(CanHandle& /*handle*/) {
  advance();
  forget_own(arbiter_.withdraw(computer_client_));
  return true;
}

void CanLine::forget_own(std::size_t left) {
  while (owners_.size() > left) {
    if (CanHandle* owner = owners_.back().handle) {
      --owner->unconfirmed_;
      ++owner->counters_.lost_in_queue;
      owner->notify();
    }
    owners_.pop_back();
  }
}

void CanLine::close(CanHandle& handle) {
  for (Owner& owner : owners_) {
    if (owner.handle == &handle) owner.handle = nullptr;
  }
  if (handle.host_ == nullptr) arbiter_.remove_client(handle.client_);
  std::erase(handles_, &handle);
}

void CanLine::lose_computer() {
  advance();
  forget_own(arbiter_.withdraw(computer_client_));
}

void CanLine::force_bus_off() {
  advance();
  kernel_.trace(Lane::world, Lane::bus, "bus-off");
  arbiter_.force_bus_off(computer_, kernel_.now());
  take_reports();
  deadline_.arm(arbiter_.next_deadline());
}

void CanLine::advance() {
  while (const auto delivery = arbiter_.advance(kernel_.now())) {
    take_reports();
    deliver(*delivery);
  }
  take_reports();
  deadline_.arm(arbiter_.next_deadline());
}

void CanLine::take_reports() {
  for (const sim::ControllerReport& report : arbiter_.take_reports()) {
    if (report.station != computer_ || report.kind != sim::ControllerReport::Kind::bus_off) continue;
    forget_own(0);
    for (CanHandle* handle : handles_) {
      if (handle->host_ == nullptr) continue;
      ++handle->counters_.bus_off;
      handle->notify();
    }
  }
}

void CanLine::deliver(const sim::BusDelivery& delivery) {
  CanHandle* owner = nullptr;
  const bool own = delivery.sender == computer_client_;
  if (own && !owners_.empty()) {
    owner = owners_.front().handle;
    kernel_.trace(Lane::bus, Lane::bus, "frame of the computer",
                  static_cast<std::uint64_t>(owners_.front().pid), delivery.frame.id);
    owners_.pop_front();
  }
  const hw::CanFrame original = to_can(delivery.original);
  const hw::CanFrame frame = to_can(delivery.frame);
  for (std::size_t i = 0; i < handles_.size(); ++i) {
    CanHandle* handle = handles_[i];
    if (handle == owner) {
      --handle->unconfirmed_;
      handle->push(original, true);
      continue;
    }
    if (!own && handle->client_ == delivery.sender) {
      --handle->unconfirmed_;
      handle->push(original, true);
      continue;
    }
    const bool hears =
        arbiter_.controller(arbiter_.station_of(handle->client_)).state() != sim::ErrorState::bus_off;
    if (!delivery.lost && hears) handle->push(frame, false);
  }
}

// ---------------------------------------------------------------- handle

CanHandle::CanHandle(CanLine& line, Host* host, std::vector<hw::CanFilter> filters,
                     std::function<void()> on_input)
    : line_(line),
      host_(host),
      pid_(host != nullptr ? host->pid() : 0),
      filters_(std::move(filters)),
      on_input_(std::move(on_input)) {}

CanHandle::~CanHandle() {
  *self_ = nullptr;
  line_.close(*this);
}

Result<void, hw::CanError> CanHandle::send(const hw::CanFrame& frame) {
  if (host_ != nullptr && !host_->runs()) {
    // Stopped between the decision to write and the write.
    ++unconfirmed_;
    host_->output([self = self_, frame] {
      if (*self == nullptr) return;
      CanHandle& handle = **self;
      --handle.unconfirmed_;
      if (handle.line_.submit(handle, frame)) ++handle.unconfirmed_;
    });
    return {};
  }
  auto sent = line_.submit(*this, frame);
  if (sent) {
    ++unconfirmed_;
    ++counters_.sent;
  } else if (sent.error() == hw::CanError::queue_full) {
    ++counters_.refused_full;
  }
  return sent;
}

std::optional<hw::CanFrame> CanHandle::receive() {
  if (incoming_.empty()) return std::nullopt;
  const hw::CanFrame frame = incoming_.front();
  incoming_.pop_front();
  return frame;
}

bool CanHandle::withdraw() {
  ++counters_.withdrawals;
  return line_.withdraw(*this);
}

hw::CanController CanHandle::controller() const {
  const bool off =
      line_.arbiter_.controller(line_.arbiter_.station_of(client_)).state() == sim::ErrorState::bus_off;
  return {.state = off ? hw::CanBusState::bus_off : hw::CanBusState::active,
          .transmit_errors = {},
          .receive_errors = {},
          .bit_rate = bit_rate};
}

void CanHandle::push(hw::CanFrame frame, bool is_echo) {
  if (!passes(frame, is_echo, filters_)) return;
  if (is_echo) {
    ++counters_.echoed;
  } else {
    ++counters_.received;
  }
  if (incoming_.size() == queue_frames) {
    incoming_.pop_front();
    ++counters_.receive_overruns;
  }
  frame.is_echo = is_echo;
  frame.timestamp = line_.kernel_.now();
  incoming_.push_back(frame);
  notify();
}

/// As a readable descriptor: once for all that waits.
void CanHandle::notify() {
  if (std::exchange(notified_, true)) return;
  const auto wake = [self = self_] {
    if (*self == nullptr) return;
    (*self)->notified_ = false;
    (*self)->on_input_();
  };
  if (host_ != nullptr) {
    host_->later(microseconds(20), wake);
  } else {
    line_.kernel_.later(nanoseconds(0), wake);
  }
}

}  // namespace srfs::simulation
