// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "msgs/mission/dictionary.hpp"
#include "nodes/payload/payload_cycle.hpp"
#include "suite/modes.hpp"

namespace srfs {

/// The deployment's orders of each mode for one payload, as its peripheral understands them.
struct ModeOrders {
  struct OfMode {
    std::vector<StandingOrder> once;
    std::vector<StandingOrder> hold;
  };
  struct Problem {
    std::string mode;
    std::string order;
    std::string why;
  };
  std::map<std::string, OfMode> modes;
  std::vector<Problem> problems;  ///< orders that are left out
};

/// Orders are telecommands of the node that go on to its peripheral and need no arming.
[[nodiscard]] ModeOrders resolve_orders(const mission::Dictionary& dictionary,
                                        const suite::ModeSettings& settings, const std::string& node,
                                        const PayloadCycle::CommandDecoder& decode);

}  // namespace srfs
