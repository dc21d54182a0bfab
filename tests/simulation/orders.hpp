// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "msgs/mission/dictionary.hpp"

namespace srfs::simulation {

/// A telecommand as an operator writes it.
struct Order {
  const mission::Command* command = nullptr;
  std::vector<std::string> arguments;  ///< "key=value"
};
/// "ttc.set_mode mode=safe"
[[nodiscard]] std::string to_text(const Order& order);

/// Every telecommand with the smallest and the largest value of each argument, and with every label of an
/// enumeration: as many orders as its argument with the most values has. Those that carry packets carry one
/// that commands mode safe. Left out: those whose value has the type of a parameter (no node of the
/// simulation has parameters).
[[nodiscard]] std::vector<Order> all_orders(const mission::Dictionary& dictionary);

/// What arms a hazardous telecommand. @param order  whose command is hazardous
[[nodiscard]] Order arming_of(const mission::Dictionary& dictionary, const Order& order);

}  // namespace srfs::simulation
