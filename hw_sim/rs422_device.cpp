// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/rs422_device.hpp"

#include <algorithm>
#include <array>

#include <sys/epoll.h>

namespace srfs::sim {
namespace {

constexpr nanoseconds listener_patience = seconds(1);
constexpr nanoseconds retry_interval = milliseconds(2);

}  // namespace

Result<std::unique_ptr<Rs422Device>, std::string> Rs422Device::create(
    EventLoop& loop, const std::filesystem::path& operator_link, const std::filesystem::path& computer_link,
    std::uint32_t baud, std::uint64_t seed) {
  auto operator_side = Pty::create(operator_link);
  if (!operator_side) return Err(operator_side.error());
  auto computer_side = Pty::create(computer_link);
  if (!computer_side) return Err(computer_side.error());
  return std::unique_ptr<Rs422Device>(
      new Rs422Device(loop, std::move(*operator_side), std::move(*computer_side), baud, seed));
}

Rs422Device::Rs422Device(EventLoop& loop, Pty operator_side, Pty computer_side, std::uint32_t baud,
                         std::uint64_t seed)
    : loop_(loop),
      operator_side_(std::move(operator_side)),
      computer_side_(std::move(computer_side)),
      up_{operator_side_, computer_side_, SerialLine(baud, seed),
          loop.add_timer([this](MonotonicTime t) { service(up_, t); })},
      down_{computer_side_, operator_side_, SerialLine(baud, seed + 1),
            loop.add_timer([this](MonotonicTime t) { service(down_, t); })} {
  loop_.watch(operator_side_.fd(), EPOLLIN, [this](std::uint32_t, MonotonicTime now) { read(up_, now); });
  loop_.watch(computer_side_.fd(), EPOLLIN, [this](std::uint32_t, MonotonicTime now) { read(down_, now); });
}

Rs422Device::~Rs422Device() {
  loop_.unwatch(operator_side_.fd());
  loop_.unwatch(computer_side_.fd());
  loop_.set_timer(up_.timer, std::nullopt);
  loop_.set_timer(down_.timer, std::nullopt);
}

void Rs422Device::set_flip_probability(double probability) {
  up_.line.set_flip_probability(probability);
  down_.line.set_flip_probability(probability);
}

void Rs422Device::set_burst_probability(double probability) {
  up_.line.set_burst_probability(probability);
  down_.line.set_burst_probability(probability);
}

void Rs422Device::release_exclusive_holds() {
  operator_side_.release_exclusive_hold();
  computer_side_.release_exclusive_hold();
}

void Rs422Device::read(Direction& direction, MonotonicTime now) {
  std::array<std::uint8_t, 8192> buffer{};
  direction.line.advance(now);
  const std::size_t most = std::min(direction.line.room(), buffer.size());
  const std::size_t n = direction.from.read(std::span(buffer.data(), most));
  if (!cut_) direction.line.accept(OctetView(buffer.data(), n), now);
  service(direction, now);
}

void Rs422Device::deliver(Direction& direction) {
  const Octets next = direction.line.arrived(4096);
  const std::size_t taken = direction.to.write(next);
  direction.line.taken(taken);
  direction.written += taken;

  const std::size_t unread = direction.to.unread();
  const std::uint64_t consumed = direction.written - std::min<std::uint64_t>(direction.written, unread);
  const RunningTime now = loop_.running_now();
  const bool waiting = unread > 0 || direction.line.has_arrived();
  if (!waiting || consumed != direction.last_consumed) {
    direction.last_consumed = consumed;
    direction.progress_at = now;
  } else if (now - direction.progress_at >= listener_patience) {
    direction.to.discard_unread();
    direction.line.lose_received(unread);
    direction.last_consumed = direction.written;
    direction.progress_at = now;
  }
}

void Rs422Device::service(Direction& direction, MonotonicTime now) {
  direction.line.advance(now);
  deliver(direction);

  const bool full = direction.line.room() == 0;
  if (full != direction.paused) {
    direction.paused = full;
    loop_.change(direction.from.fd(), full ? 0U : static_cast<std::uint32_t>(EPOLLIN));
  }
  std::optional<MonotonicTime> next = direction.line.next_deadline();
  if (direction.line.has_arrived()) {
    next = std::min(next.value_or(now + retry_interval), now + retry_interval);
  } else if (direction.to.unread() > 0) {
    const MonotonicTime check = now + listener_patience / 10;
    next = std::min(next.value_or(check), check);
  }
  loop_.set_timer(direction.timer, next);
}

}  // namespace srfs::sim
