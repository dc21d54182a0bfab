// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/peripheral.hpp"

#include <algorithm>

#include <gtest/gtest.h>

#include "hw/fake/fake_can_bus.hpp"
#include "hw_sim/can_peripheral.hpp"
#include "hw_sim/frame_peripheral_channel.hpp"
#include "hw_sim/isotp_peripheral_channel.hpp"

namespace srfs::sim {
namespace {

using wire::PeripheralResult;

class FakeModel : public PeripheralModel {
 public:
  [[nodiscard]] Octets measure() override { return {1, 2, 3}; }
  [[nodiscard]] PeripheralResult execute(std::uint8_t function, OctetView) override {
    ++executed;
    return function == 1 ? PeripheralResult::done : PeripheralResult::unknown_function;
  }
  void restart() override { ++restarts; }
  void set_power(bool on) override { powered = on; }
  int executed = 0;
  int restarts = 0;
  bool powered = true;
};

class PeripheralTest : public ::testing::Test {
 protected:
  std::optional<Octets> ask_raw(const wire::PeripheralRequest& request) {
    peripheral.on_request(wire::encode(request), now);
    now += milliseconds(1);
    return peripheral.poll(now);
  }
  template <class Response>
  Response ask(const wire::PeripheralRequest& request) {
    const auto octets = ask_raw(request);
    if (!octets) throw std::runtime_error("no answer");
    return std::get<Response>(wire::decode_response(*octets, request).value().body);
  }
  PeripheralResult command(std::uint32_t id, std::uint8_t function = 1) {
    return ask<wire::CommandResponse>({.sequence = 7, .body = wire::CommandRequest{id, function, {}}}).result;
  }
  void reset() {
    static_cast<void>(ask<wire::ResetResponse>({.sequence = 9, .body = wire::ResetRequest{}}));
    now += milliseconds(10);
    EXPECT_FALSE(peripheral.poll(now));
  }

  static constexpr wire::PeripheralRequest wake_up{.sequence = 3, .body = wire::WakeUpRequest{}};
  FakeModel model;
  RunningTime now{seconds(100)};
  Peripheral peripheral{{}, model, now};
  void SetUp() override { now += seconds(1); }
};

TEST_F(PeripheralTest, AnswersAWakeUpWithItsMeasurement) {
  const auto answer = ask<wire::WakeUpResponse>(wake_up);
  EXPECT_EQ(answer.status, wire::PeripheralStatus::ready);
  EXPECT_EQ(answer.uptime_ms, 1000U);
  EXPECT_EQ(answer.measurement, (Octets{1, 2, 3}));
}

TEST_F(PeripheralTest, AnswersOnlyAfterItsDelay) {
  peripheral.on_request(wire::encode(wake_up), now);
  EXPECT_FALSE(peripheral.poll(now));
  EXPECT_EQ(peripheral.next_deadline(), now + microseconds(800));
  EXPECT_TRUE(peripheral.poll(now + microseconds(800)));
}

TEST_F(PeripheralTest, SaysAlreadyDoneForARepeatedId) {
  EXPECT_EQ(command(42), PeripheralResult::done);
  EXPECT_EQ(command(42), PeripheralResult::already_done);
  EXPECT_EQ(model.executed, 1);
}

TEST_F(PeripheralTest, RemembersTheLastSixteenIds) {
  for (std::uint32_t id = 1; id <= 17; ++id) EXPECT_EQ(command(id), PeripheralResult::done);
  EXPECT_EQ(command(2), PeripheralResult::already_done);
  EXPECT_EQ(command(1), PeripheralResult::done);
}

TEST_F(PeripheralTest, TriesARefusedCommandAgain) {
  EXPECT_EQ(command(5, 99), PeripheralResult::unknown_function);
  EXPECT_EQ(command(5, 1), PeripheralResult::done);
}

TEST_F(PeripheralTest, KeepsTheIdsOverAReset) {
  EXPECT_EQ(command(42), PeripheralResult::done);
  reset();
  EXPECT_EQ(model.restarts, 1);
  now += seconds(1);
  EXPECT_EQ(command(42), PeripheralResult::already_done);
}

TEST_F(PeripheralTest, IsSilentThenBootsAfterAReset) {
  reset();
  EXPECT_FALSE(ask_raw(wake_up));
  now += milliseconds(30);
  const auto booting = ask<wire::WakeUpResponse>(wake_up);
  EXPECT_EQ(booting.status, wire::PeripheralStatus::booting);
  EXPECT_TRUE(booting.measurement.empty());
  EXPECT_EQ(command(1), PeripheralResult::cannot_now);
  now += milliseconds(150);
  EXPECT_EQ(ask<wire::WakeUpResponse>(wake_up).status, wire::PeripheralStatus::ready);
}

TEST_F(PeripheralTest, ForgetsEverythingWithoutPower) {
  EXPECT_EQ(command(42), PeripheralResult::done);
  peripheral.on_request(wire::encode(wake_up), now);
  peripheral.set_power(false, now);
  EXPECT_FALSE(model.powered);
  now += seconds(1);
  EXPECT_FALSE(peripheral.poll(now));
  EXPECT_FALSE(ask_raw(wake_up));
  peripheral.set_power(true, now);
  now += seconds(1);
  EXPECT_EQ(command(42), PeripheralResult::done);
  EXPECT_EQ(peripheral.counters().power_cycles, 1U);
}

TEST_F(PeripheralTest, DoesNotAnswerADamagedRequest) {
  Octets damaged = wire::encode(wake_up);
  damaged.back() ^= 1U;
  peripheral.on_request(damaged, now);
  EXPECT_FALSE(peripheral.poll(now + seconds(1)));
  EXPECT_EQ(peripheral.counters().invalid_requests, 1U);
}

TEST_F(PeripheralTest, KeepsSilentUnderThatFault) {
  peripheral.set_fault(PeripheralFault::silent, {}, FaultCure::never);
  EXPECT_FALSE(ask_raw(wake_up));
  peripheral.set_fault(PeripheralFault::none, {}, FaultCure::never);
  EXPECT_TRUE(ask_raw(wake_up));
}

TEST_F(PeripheralTest, AnswersLateUnderThatFault) {
  peripheral.set_fault(PeripheralFault::late, milliseconds(70), FaultCure::never);
  EXPECT_FALSE(ask_raw(wake_up));
  EXPECT_FALSE(peripheral.poll(now + milliseconds(69)));
  EXPECT_TRUE(peripheral.poll(now + milliseconds(70)));
}

TEST_F(PeripheralTest, CutsOrGarblesItsAnswersUnderThoseFaults) {
  const std::size_t length = ask_raw(wake_up)->size();
  peripheral.set_fault(PeripheralFault::short_answer, {}, FaultCure::never);
  const auto cut = ask_raw(wake_up);
  EXPECT_LT(cut->size(), length);
  EXPECT_FALSE(wire::decode_response(*cut));
  peripheral.set_fault(PeripheralFault::garbage, {}, FaultCure::never);
  const auto garbled = ask_raw(wake_up);
  EXPECT_EQ(garbled->size(), length);
  EXPECT_FALSE(wire::decode_response(*garbled));
}

TEST_F(PeripheralTest, IsCuredByWhatTheFaultNames) {
  peripheral.set_fault(PeripheralFault::late, milliseconds(1), FaultCure::restart);
  peripheral.on_request(wire::encode({.sequence = 1, .body = wire::ResetRequest{}}), now);
  EXPECT_TRUE(peripheral.poll(now + milliseconds(5)));
  EXPECT_FALSE(peripheral.poll(now + milliseconds(10)));
  EXPECT_EQ(peripheral.fault(), PeripheralFault::none);

  peripheral.set_fault(PeripheralFault::babble, {}, FaultCure::power_cycle);
  peripheral.set_power(false, now + seconds(1));
  EXPECT_EQ(peripheral.fault(), PeripheralFault::none);
}

TEST_F(PeripheralTest, AnswersANewRequestAtOnceThoughNobodyTookTheAnswerBefore) {
  EventLoop loop;
  auto bus = std::make_unique<hw::FakeCanBus>();
  hw::FakeCanBus& wire = *bus;
  CanPeripheral on_bus(loop, "eps", 0x12, std::move(bus), std::make_unique<IsoTpPeripheralChannel>(0x12),
                       peripheral);
  const auto request_and_answer = [&](std::uint8_t sequence) {
    const Octets message = wire::encode(wire::PeripheralRequest{sequence, wire::WakeUpRequest{}});
    hw::CanFrame frame{
        .id = wire::normal_fixed_id({.target = 0x12, .source = 0x01}), .extended = true, .size = 8};
    frame.data[0] = static_cast<std::uint8_t>(message.size());
    std::copy(message.begin(), message.end(), frame.data.begin() + 1);
    wire.deliver(frame);
    on_bus.service(now);
    now += milliseconds(2);
    on_bus.service(now);
    on_bus.service(now);
  };
  request_and_answer(5);
  ASSERT_EQ(wire.sent.size(), 1U) << "the first frame of the answer; flow control never comes";
  now += milliseconds(60);  // less than the peripheral's wait for flow control
  request_and_answer(6);
  ASSERT_EQ(wire.sent.size(), 2U);
  EXPECT_EQ(wire.sent[1].data[0] & 0xF0U, 0x10U);
  EXPECT_EQ(wire.sent[1].data[3], 6) << "the answer to the second request";
}

}  // namespace
}  // namespace srfs::sim
