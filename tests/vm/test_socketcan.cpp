// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The SocketCAN back-end on the kernel's virtual CAN interfaces.

#include <memory>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hw/open.hpp"
#include "tests/can_bus_checks.hpp"
#include "tests/node/hw/poll_until.hpp"
#include "tests/vm/virtual_can.hpp"

namespace srfs::hw {
namespace {

using ::testing::HasSubstr;
using vm::OtherStation;
using vm::patience;
using vm::VirtualCan;

constexpr canid_t to_computer = CAN_EFF_FLAG | 0x18DA0111U;

std::unique_ptr<CanBus> open(const std::string& interface, std::vector<CanFilter> filters = {}) {
  return open_can("socketcan:" + interface, "/", std::move(filters)).value();
}

/// Serves the bus like its owner's loop until @p condition holds. Also checks the condition every 10 ms,
/// because not every condition wakes the bus.
bool await(CanBus& bus, const std::function<bool()>& condition) {
  const MonotonicTime end = monotonic_now() + patience;
  while (monotonic_now() < end) {
    while (bus.receive()) {
    }
    if (condition()) return true;
    pollfd p{.fd = bus.fd(), .events = POLLIN, .revents = 0};
    ::poll(&p, 1, 10);
  }
  return false;
}

bool await_state(CanBus& bus, CanBusState state) {
  return await(bus, [&] { return bus.state() == state; });
}
bool await_all_confirmed(CanBus& bus) {
  return await(bus, [&] { return bus.unconfirmed() == 0; });
}

bool readable(const CanBus& bus) {
  pollfd p{.fd = bus.fd(), .events = POLLIN, .revents = 0};
  return ::poll(&p, 1, 0) == 1;
}

TEST(SocketCanOnVcan, CarriesAFrameToTheOthersAndEchoesItToItsSender) {
  const VirtualCan can;
  const auto a = open(can.name());
  const auto b = open(can.name());
  expect_a_frame_and_its_echo(*a, *b);
}

TEST(SocketCanOnVcan, CarriesStandardAndExtendedFramesOfEveryLength) {
  const VirtualCan can;
  const auto bus = open(can.name());
  OtherStation other(can.name());
  for (std::uint8_t size = 0; size <= 8; ++size) {
    for (const bool extended : {false, true}) {
      CanFrame sent = frame(0x123, 0x5A);
      sent.extended = extended;
      sent.size = size;
      ASSERT_TRUE(bus->send(sent));
      const auto seen = other.read();
      ASSERT_TRUE(seen);
      EXPECT_EQ(seen->can_id, 0x123U | (extended ? CAN_EFF_FLAG : 0U));
      EXPECT_EQ(seen->len, size);

      ASSERT_TRUE(await_frame(*bus)->is_echo);
      ASSERT_TRUE(other.write(*seen));
      const auto received = await_frame(*bus);
      ASSERT_TRUE(received);
      EXPECT_FALSE(received->is_echo);
      EXPECT_EQ(received->extended, extended);
      EXPECT_EQ(received->size, size);
    }
  }
}

TEST(SocketCanOnVcan, IsNotWokenByFramesOutsideItsFilters) {
  const VirtualCan can;
  const auto computer = open(can.name(), {isotp_between(0x01, 0x11)});
  const auto peripheral = open(can.name(), {isotp_to(0x11)});
  OtherStation other(can.name());
  OtherStation witness(can.name());
  const std::vector<canid_t> foreign{0x111,
                                     CAN_EFF_FLAG | 0x111U,
                                     CAN_EFF_FLAG | 0x18DA0112U,
                                     CAN_EFF_FLAG | 0x18DA1201U,
                                     CAN_EFF_FLAG | 0x18DB0111U,
                                     to_computer | CAN_RTR_FLAG,
                                     CAN_SFF_MASK | CAN_RTR_FLAG};
  for (const canid_t id : foreign) {
    ASSERT_TRUE(other.write(id, 3));
    ASSERT_TRUE(witness.read());  // the frame has been on the bus
  }
  EXPECT_FALSE(readable(*computer));
  EXPECT_FALSE(readable(*peripheral));

  ASSERT_TRUE(other.write(to_computer));
  EXPECT_EQ(await_frame(*computer)->id, 0x18DA0111U);
  ASSERT_TRUE(computer->send(frame(0x18DA1101)));
  EXPECT_TRUE(await_frame(*computer)->is_echo);
  EXPECT_EQ(await_frame(*peripheral)->id, 0x18DA1101U);
  EXPECT_EQ(computer->counters().received, 1U);
  EXPECT_EQ(computer->counters().malformed, 0U);
}

TEST(SocketCanOnVcan, HearsRemoteFramesOnlyWhereItHearsEverythingAndNeverFlexibleDataRate) {
  const VirtualCan can;
  const auto bus = open(can.name());
  const auto computer = open_can(can.uri(), "/", {isotp_to(0x01)}).value();
  OtherStation other(can.name());
  canfd_frame flexible{};
  flexible.can_id = to_computer;
  flexible.len = 48;
  ASSERT_TRUE(other.write(flexible));
  ASSERT_TRUE(other.write(to_computer | CAN_RTR_FLAG, 8));
  ASSERT_TRUE(other.write(0x7FF | CAN_RTR_FLAG, 0));
  ASSERT_TRUE(other.write(to_computer, 8, 0x77));
  for (const bool remote : {true, true, false}) EXPECT_EQ(await_frame(*bus)->remote, remote);
  EXPECT_EQ(bus->counters().malformed, 0U);
  EXPECT_EQ(bus->counters().received, 3U);
  EXPECT_EQ(await_frame(*computer)->data[0], 0x77);
  EXPECT_EQ(computer->counters().received, 1U);
}

TEST(SocketCanOnVcan, StampsAFrameWhenItCameNotWhenItIsRead) {
  const VirtualCan can;
  const auto bus = open(can.name());
  OtherStation other(can.name());
  OtherStation witness(can.name());
  constexpr milliseconds unread(400);
  constexpr milliseconds limit(900);  // the back-end rejects time stamps older than a second
  constexpr milliseconds tolerance(100);
  // Repeat when the machine is too busy for a clear result. The kernel also starts to stamp frames only a
  // moment after the first socket requests it.
  for (int attempt = 0; attempt < 20; ++attempt) {
    const MonotonicTime before = monotonic_now();
    ASSERT_TRUE(other.write(to_computer));
    ASSERT_TRUE(witness.read());
    const MonotonicTime after = monotonic_now();
    while (monotonic_now() < after + unread) {
    }
    const auto received = bus->receive();
    ASSERT_TRUE(received);
    if (monotonic_now() > before + limit || after > before + unread / 2) continue;
    EXPECT_GE(received->timestamp, before - tolerance);
    if (received->timestamp <= after + tolerance) return;
  }
  FAIL() << "every stamp is the time of reading";
}

TEST(SocketCanOnVcan, RefusesWhileTheTransmitQueueIsFullAndLosesNothingItTook) {
  VirtualCan can;
  const auto bus = open(can.name());
  OtherStation witness(can.name());
  can.pace(1600, 10);  // 100 frames per second
  std::uint64_t accepted = 0;
  std::optional<CanError> refusal;
  while (!refusal && accepted < 100'000) {
    const auto sent = bus->send(frame(0x100));
    if (sent) ++accepted;
    if (!sent) refusal = sent.error();
  }
  EXPECT_EQ(refusal, CanError::queue_full);
  EXPECT_GE(accepted, 10U);
  EXPECT_EQ(bus->counters().refused_full, 1U);
  EXPECT_EQ(bus->state(), CanBusState::active);
  if (can.echoes_when_sent()) {
    EXPECT_GE(bus->unconfirmed(), 1U);
  }

  EXPECT_TRUE(await_all_confirmed(*bus));
  EXPECT_EQ(bus->counters().echoed, accepted);
  EXPECT_TRUE(await(*bus, [&] { return bus->send(frame(0x101)).has_value(); }));
  for (std::uint64_t i = 0; i < accepted; ++i) ASSERT_EQ(witness.read()->can_id, CAN_EFF_FLAG | 0x100U);
  EXPECT_EQ(witness.read()->can_id, CAN_EFF_FLAG | 0x101U);
}

TEST(SocketCanOnVcan, CountsEveryFrameThatCameFasterThanItReads) {
  const VirtualCan can;
  const auto bus = open(can.name());
  OtherStation other(can.name());
  OtherStation witness(can.name());
  constexpr std::uint64_t flood = 5000;
  for (std::uint64_t i = 0; i < flood; ++i) {
    ASSERT_TRUE(other.write(to_computer));
    ASSERT_TRUE(witness.read());
  }
  std::uint64_t received = 0;
  while (bus->receive()) ++received;
  ASSERT_LT(received, flood);
  ASSERT_TRUE(other.write(to_computer));  // the next frame carries the count of dropped frames
  ASSERT_TRUE(await_frame(*bus));
  EXPECT_EQ(bus->counters().receive_overruns + received, flood);
}

TEST(SocketCanOnVcan, ComesBackWhenTheInterfaceGoesDownAndUp) {
  VirtualCan can;
  const auto bus = open(can.name());
  const int fd = bus->fd();
  can.pace(16, 10);  // one frame per second: further frames wait
  while (bus->send(frame(0x100))) {
  }
  const std::uint64_t sent = bus->counters().sent;

  can.down();
  EXPECT_TRUE(await_state(*bus, CanBusState::down));
  EXPECT_THAT(bus->reason(), HasSubstr("down"));
  EXPECT_EQ(bus->send(frame(0x101)).error(), CanError::down);
  EXPECT_EQ(bus->unconfirmed(), 0U);
  EXPECT_EQ(bus->counters().echoed + bus->counters().lost_in_queue, sent);

  can.up();
  EXPECT_EQ(bus->fd(), fd);
  EXPECT_TRUE(await_state(*bus, CanBusState::active));
  EXPECT_EQ(bus->counters().reopened, 1U);
  EXPECT_TRUE(bus->send(frame(0x102)));
  EXPECT_TRUE(await_all_confirmed(*bus));
}

TEST(SocketCanOnVcan, NoticesWhileWritingThatTheInterfaceWentDown) {
  VirtualCan can;
  const auto bus = open(can.name());
  can.down();
  EXPECT_EQ(bus->send(frame(0x100)).error(), CanError::down);
  EXPECT_EQ(bus->state(), CanBusState::down);
  EXPECT_EQ(bus->counters().sent, 0U);
  can.up();
  EXPECT_TRUE(await(*bus, [&] { return bus->send(frame(0x101)).has_value(); }));
}

TEST(SocketCanOnVcan, TellsStandardFromExtendedIdentifiers) {
  const VirtualCan can;
  const auto bus = open(can.name(), {exactly(0x3A1, 0x321, false)});
  OtherStation other(can.name());
  ASSERT_TRUE(other.write(CAN_EFF_FLAG | 0x3A1U));
  ASSERT_TRUE(other.write(0x3A1U));
  const auto heard = await_frame(*bus);
  ASSERT_TRUE(heard);
  EXPECT_FALSE(heard->extended);
  CanFrame request = frame(0x321);
  request.extended = false;
  ASSERT_TRUE(bus->send(request));
  EXPECT_TRUE(await_frame(*bus)->is_echo);
}

TEST(SocketCanOnVcan, OutlivesTheDeletionOfItsInterface) {
  VirtualCan can;
  const auto bus = open(can.name(), {isotp_to(0x01)});
  can.remove();
  EXPECT_TRUE(await_state(*bus, CanBusState::gone));
  EXPECT_EQ(bus->send(frame(0x18DA1101)).error(), CanError::gone);

  can.create();
  EXPECT_TRUE(await_state(*bus, CanBusState::active)) << bus->reason();
  OtherStation other(can.name());
  ASSERT_TRUE(other.write(CAN_EFF_FLAG | 0x18DA0211U));
  ASSERT_TRUE(other.write(to_computer));
  EXPECT_EQ(await_frame(*bus)->id, 0x18DA0111U) << "its filters hold on the new interface";
}

TEST(SocketCanOnVcan, FindsAnInterfaceThatComesLater) {
  VirtualCan can;
  can.remove();
  const auto bus = open(can.name());
  EXPECT_EQ(bus->state(), CanBusState::gone);
  EXPECT_THAT(bus->reason(), HasSubstr(can.name()));
  can.create();
  EXPECT_TRUE(await_state(*bus, CanBusState::active));
  EXPECT_EQ(bus->counters().reopened, 0U);
}

TEST(SocketCanOnVcan, FollowsTheControllersStateByItsErrorFrames) {
  const VirtualCan can;
  const auto bus = open(can.name(), {isotp_to(0x01)});
  OtherStation driver(can.name());
  ASSERT_TRUE(driver.report_error(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING));
  EXPECT_TRUE(await_state(*bus, CanBusState::warning));
  ASSERT_TRUE(driver.report_error(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE | CAN_ERR_CRTL_RX_WARNING));
  EXPECT_TRUE(await_state(*bus, CanBusState::passive));
  ASSERT_TRUE(driver.report_error(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE));
  EXPECT_TRUE(await_state(*bus, CanBusState::active));

  ASSERT_TRUE(driver.report_error(CAN_ERR_PROT | CAN_ERR_BUSERROR));
  ASSERT_TRUE(driver.report_error(CAN_ERR_ACK));
  ASSERT_TRUE(driver.report_error(CAN_ERR_LOSTARB));
  ASSERT_TRUE(driver.report_error(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW));
  EXPECT_TRUE(await(*bus, [&] { return bus->counters().receive_overruns == 1; }));
  EXPECT_EQ(bus->counters().bus_errors, 2U);
  EXPECT_EQ(bus->counters().arbitration_lost, 1U);
  EXPECT_EQ(bus->counters().received, 0U) << "error frames are no data";

  ASSERT_TRUE(driver.report_error(CAN_ERR_BUSOFF));
  ASSERT_TRUE(driver.report_error(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE));
  EXPECT_TRUE(await_state(*bus, CanBusState::bus_off));
  ASSERT_TRUE(driver.report_error(CAN_ERR_RESTARTED));
  EXPECT_TRUE(await_state(*bus, CanBusState::active));
  EXPECT_EQ(bus->counters().bus_off, 1U);
  EXPECT_TRUE(bus->send(frame(0x18DA1101)));
  EXPECT_TRUE(await_all_confirmed(*bus));
}

TEST(SocketCanOnVcan, WhatWaitedWhenTheControllerWentBusOffNeverLeavesInALaterSlot) {
  VirtualCan can;
  if (!can.echoes_when_sent()) GTEST_SKIP() << "vcan without echo=1";
  const auto bus = open(can.name());
  const auto next_holder = open(can.name());
  {
    // The bus-off report waits in the socket ahead of all echoes.
    OtherStation driver(can.name());
    OtherStation witness(can.name());
    ASSERT_TRUE(driver.report_error(CAN_ERR_BUSOFF));
    ASSERT_TRUE(driver.write(to_computer));
    ASSERT_EQ(witness.read()->can_id, to_computer);
  }
  can.pace(16, 20);  // one frame per second
  std::uint64_t written = 0;
  while (bus->send(frame(0x18DA1101))) ++written;
  ASSERT_GT(written, 3U);

  EXPECT_TRUE(await(*bus, [&] { return bus->counters().bus_off == 1; }));
  EXPECT_EQ(bus->unconfirmed(), 0U);
  EXPECT_EQ(bus->counters().lost_in_queue, written);
  EXPECT_EQ(bus->counters().withdrawals, 1U);
  EXPECT_EQ(bus->state(), CanBusState::bus_off) << "it waits before it tries again, as ever";
  EXPECT_TRUE(await_state(*bus, CanBusState::active));

  // The controller is back. Any frame still waiting would leave first.
  OtherStation witness(can.name());
  EXPECT_TRUE(await(*next_holder, [&] { return next_holder->send(frame(0x18DA1201)).has_value(); }));
  const auto seen = witness.read();
  ASSERT_TRUE(seen);
  EXPECT_EQ(seen->can_id & CAN_EFF_MASK, 0x18DA1201U);
}

/// Two interfaces joined by a cable. While the second is down the first has no carrier, like a bus-off
/// controller.
class SocketCanOnVxcan : public ::testing::Test {
 protected:
  SocketCanOnVxcan() {
    vm::shell(fmt::format("ip link add {} type vxcan peer name {} && ip link set {} up", near_, far_, near_));
    vm::set_up(far_, true);
    // Until its link watch has run, the kernel drops sent frames silently.
    for (const std::string& end : {near_, far_}) {
      vm::shell(fmt::format(
          "timeout 30 sh -c 'until grep -q up /sys/class/net/{}/operstate; do sleep 0.01; done'", end));
    }
  }
  ~SocketCanOnVxcan() override { vm::shell("ip link del " + near_); }

  std::string near_ = vm::unique_name();
  std::string far_ = vm::unique_name();
};

TEST_F(SocketCanOnVxcan, CarriesFramesThroughTheCable) {
  const auto near = open(near_);
  const auto far = open(far_);
  ASSERT_TRUE(near->send(frame(0x18DA1101, 1)));
  EXPECT_EQ(await_frame(*far)->id, 0x18DA1101U);
  EXPECT_TRUE(await_frame(*near)->is_echo);
  ASSERT_TRUE(far->send(frame(0x18DA0111, 2)));
  EXPECT_EQ(await_frame(*near)->id, 0x18DA0111U);
}

TEST_F(SocketCanOnVxcan, SendsNothingWhileBusOffAndGoesOnWithTheCarrierWhenNobodySaidRestarted) {
  const auto bus = open(near_);
  OtherStation driver(far_);
  bool off = false;
  // The carrier must be gone when the back-end checks it, one second after the report. Repeat on a busy
  // machine.
  for (int attempt = 0; attempt < 10 && !off; ++attempt) {
    vm::set_up(far_, true);
    ASSERT_TRUE(await(*bus, [&] { return bus->send(frame(1)).has_value(); }));
    const std::uint64_t before = bus->counters().bus_off;
    ASSERT_TRUE(await(*bus, [&] { return driver.report_error(CAN_ERR_BUSOFF); }));
    ASSERT_TRUE(await(*bus, [&] { return bus->counters().bus_off > before; }));
    vm::set_up(far_, false);
    off = bus->send(frame(2)) == tl::unexpected(CanError::bus_off);
  }
  ASSERT_TRUE(off);
  const MonotonicTime later = monotonic_now() + seconds(2);
  while (monotonic_now() < later) ASSERT_EQ(bus->send(frame(3)).error(), CanError::bus_off);

  vm::set_up(far_, true);
  EXPECT_TRUE(await(*bus, [&] { return bus->send(frame(4)).has_value(); }));
  EXPECT_EQ(bus->state(), CanBusState::active);
  EXPECT_EQ(bus->counters().reopened, 0U);
}

}  // namespace
}  // namespace srfs::hw
