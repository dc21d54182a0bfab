// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "nodes/ttc/services/pus_service.hpp"

namespace srfs {

/// Service 17 for application processes whose node is another one: 17,1 to its APID and 17,3 with its APID
/// as argument. The node is asked; its answer becomes 17,2 or 17,4. One test at a time; pure.
class ConnectionTester final : public PusService {
 public:
  static constexpr std::uint8_t service_type = 17;
  static constexpr std::uint8_t are_you_alive = 1;
  static constexpr std::uint8_t are_you_alive_report = 2;
  static constexpr std::uint8_t test_connection = 3;
  static constexpr std::uint8_t connection_report = 4;
  /// The running one included; more fail with `busy`.
  static constexpr std::size_t capacity = 8;

  /// @param own_node  answers by the request itself. Dictionary and report_queue outlive this
  ConnectionTester(const mission::Dictionary& dictionary, std::string own_node, ReportQueue& report_queue)
      : dictionary_(dictionary), own_node_(std::move(own_node)), report_queue_(report_queue) {}

  [[nodiscard]] bool provides(const mission::Command& command) const override {
    return command.service == service_type;
  }
  void execute(const Telecommand& telecommand, MonotonicTime now) override;
  /// The node to ask now; nullopt: none, or one is being asked.
  [[nodiscard]] std::optional<std::string> take_question();
  /// What became of it.
  void on_answer(bool answered);

 private:
  struct Test {
    TelecommandOrigin origin;
    std::uint8_t subtype = 0;
    std::uint16_t apid = 0;
    std::string node;
  };
  void end(const Test& test, bool answered);

  const mission::Dictionary& dictionary_;
  std::string own_node_;
  ReportQueue& report_queue_;
  std::deque<Test> waiting_;  ///< the first one is asked
  bool asking_ = false;
};

}  // namespace srfs
