// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
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

/// Which change of the mode has its orders that count once carried out; kept on disk. What the node did by
/// itself, even the mode of the first start (change 0) puts right. Pure.
class OnceDone {
 public:
  OnceDone() = default;
  /// @param stored  nullopt: never stored, so that the mode of the first start changes nothing
  explicit OnceDone(std::optional<std::string_view> stored);

  [[nodiscard]] bool is_of(std::uint32_t change) const { return change_ == change; }
  /// @return false: as before
  bool set(std::optional<std::uint32_t> change) { return std::exchange(change_, change) != change; }
  [[nodiscard]] std::string stored_text() const;

 private:
  std::optional<std::uint32_t> change_ = 0;  ///< nullopt: of none
};

}  // namespace srfs
