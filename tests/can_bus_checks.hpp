// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include <gtest/gtest.h>

#include "hw/can_bus.hpp"
#include "tests/node/hw/poll_until.hpp"

namespace srfs::hw {

// Requirements for every CAN back-end, checked with the simulated bus (tests/node/hw) and with Linux' virtual
// bus (tests/vm).

inline CanFrame frame(std::uint32_t id, std::uint8_t fill = 0) {
  CanFrame f{.id = id, .size = 8};
  f.data.fill(fill);
  return f;
}

inline std::optional<CanFrame> await_frame(CanBus& bus) {
  std::optional<CanFrame> received;
  poll_until(
      bus.fd(), [&] { return (received = bus.receive()).has_value(); }, seconds(30));
  return received;
}

/// @p sender and @p other are two fresh handles on one bus.
inline void expect_a_frame_and_its_echo(CanBus& sender, CanBus& other) {
  ASSERT_EQ(sender.state(), CanBusState::active) << sender.reason();
  ASSERT_TRUE(sender.send(frame(0x18DA1101, 0xAB)));
  EXPECT_EQ(sender.unconfirmed(), 1U);

  const auto heard = await_frame(other);
  ASSERT_TRUE(heard);
  EXPECT_FALSE(heard->is_echo);
  EXPECT_EQ(heard->id, 0x18DA1101U);
  EXPECT_TRUE(heard->extended);
  EXPECT_EQ(heard->data[7], 0xAB);

  const auto echo = await_frame(sender);
  ASSERT_TRUE(echo);
  EXPECT_TRUE(echo->is_echo);
  EXPECT_EQ(sender.unconfirmed(), 0U);
  EXPECT_EQ(sender.counters().echoed, 1U);
  EXPECT_EQ(other.counters().received, 1U);
}

}  // namespace srfs::hw
