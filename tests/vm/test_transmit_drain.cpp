// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// TransmitDrain and the recovery after withdraw(), on the kernel's virtual CAN interfaces.
#include <memory>
#include <thread>

#include <gtest/gtest.h>

#include "hw/open.hpp"
#include "nodes/can_switcher/transmit_drain.hpp"
#include "tests/vm/virtual_can.hpp"

namespace srfs::hw {
namespace {

using vm::OtherStation;
using vm::VirtualCan;
using State = TransmitDrain::State;

std::unique_ptr<CanBus> open(const std::string& interface) {
  return open_can("socketcan:" + interface, "/", {}).value();
}

State drain(CanBus& bus, TransmitDrain& drain) {
  const MonotonicTime end = monotonic_now() + vm::patience;
  State state = State::waiting;
  while (state == State::waiting && monotonic_now() < end) {
    while (bus.receive()) {
    }
    state = drain.step(bus, monotonic_now());
    if (state == State::waiting) std::this_thread::sleep_for(TransmitDrain::period);
  }
  return state;
}

TEST(TransmitDrainOnVcan, LeavesAHealthyInterfaceAlone) {
  const VirtualCan can;
  const auto bus = open(can.name());
  TransmitDrain proof;
  EXPECT_EQ(drain(*bus, proof), State::empty);
  EXPECT_EQ(bus->counters().withdrawals, 0U);
  EXPECT_EQ(bus->counters().reopened, 0U);
}

TEST(TransmitDrainOnVcan, ProvesThatTheFramesOfAProcessThatIsGoneHaveLeftByTheMarkerBehindThem) {
  VirtualCan can;
  if (!can.echoes_when_sent()) GTEST_SKIP() << "vcan without echo=1";
  const auto switcher = open(can.name());
  OtherStation witness(can.name());
  auto dead = open(can.name());
  constexpr int written = 10;
  for (int i = 0; i < written; ++i) ASSERT_TRUE(dead->send({.id = 0x18DA1101, .extended = true, .size = 8}));
  dead.reset();

  TransmitDrain proof;
  EXPECT_EQ(drain(*switcher, proof), State::empty);
  for (int i = 0; i < written; ++i) EXPECT_EQ(witness.read()->can_id & CAN_EFF_MASK, 0x18DA1101U);
  const auto marker = witness.read();
  ASSERT_TRUE(marker);
  EXPECT_EQ(marker->can_id & CAN_EFF_MASK, 0x1CDA0101U);
  EXPECT_EQ(marker->len, 0);
}

TEST(TransmitDrainOnVcan, TakesBackWhatAProcessThatIsGoneLeftOnAJammedBus) {
  VirtualCan can;
  if (!can.echoes_when_sent()) GTEST_SKIP() << "vcan without echo=1";
  const auto switcher = open(can.name());
  const auto bystander = open(can.name());
  can.pace(16, 20);  // one frame per second
  auto dead = open(can.name());
  std::uint64_t written = 0;
  const CanFrame f{.id = 0x18DA1101, .extended = true, .size = 8};
  while (dead->send(f)) ++written;
  ASSERT_GT(written, 3U);
  dead.reset();  // like the end of its process

  TransmitDrain proof;
  EXPECT_EQ(drain(*switcher, proof), State::empty);
  EXPECT_EQ(switcher->counters().withdrawals, 1U);
  EXPECT_EQ(switcher->state(), CanBusState::active) << "open again at once";
  EXPECT_EQ(switcher->counters().reopened, 1U);

  // The other handles also recover within moments.
  const MonotonicTime begin = monotonic_now();
  while (bystander->counters().reopened == 0 && monotonic_now() < begin + vm::patience) {
    while (bystander->receive()) {
    }
    pollfd p{.fd = bystander->fd(), .events = POLLIN, .revents = 0};
    ::poll(&p, 1, 10);
  }
  EXPECT_EQ(bystander->counters().reopened, 1U);

  // Any frame still waiting would leave first.
  OtherStation witness(can.name());
  const CanFrame last{.id = 0x18DA1201, .extended = true, .size = 8};
  ASSERT_TRUE(switcher->send(last));
  const auto seen = witness.read();
  ASSERT_TRUE(seen);
  EXPECT_EQ(seen->can_id & CAN_EFF_MASK, last.id);
}

}  // namespace
}  // namespace srfs::hw
