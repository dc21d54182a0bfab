// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <mission/structures.hpp>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "msgs/mission/dictionary.hpp"
#include "nodes/ttc/services/pus_service.hpp"

namespace srfs {

/// The value of a parameter as its node has it.
using NodeValue = std::variant<bool, std::int64_t, double, std::string, std::vector<std::string>>;

/// One call of a node's parameter services.
struct ParameterCall {
  std::uint64_t number = 0;  ///< goes back with the answer
  std::string node;
  std::string parameter;
  std::optional<NodeValue> value;  ///< to be set; nullopt: ask for it
};

/// What became of a call.
enum class ParameterCallError : std::uint8_t { no_answer, no_such_parameter };

/// The PUS service 20 (ECSS-E-ST-70-41C 6.20): turns requests into calls of the nodes' parameter services,
/// one after another in the order of the telecommands, and reports what the nodes say. A node that was silent
/// once is not asked again by the same request. Pure.
class ParameterService final : public PusService {
 public:
  static constexpr std::uint8_t service_type = 20;
  static constexpr std::size_t max_waiting = 8;

  /// @param apid the reports come from. Dictionary and report_queue outlive this
  ParameterService(const mission::Dictionary& dictionary, ReportQueue& report_queue, std::uint16_t apid)
      : dictionary_(dictionary), report_queue_(report_queue), apid_(apid) {}

  [[nodiscard]] bool provides(const mission::Command& command) const override {
    return command.service == service_type;
  }
  void execute(const Telecommand& telecommand, MonotonicTime now) override;
  /// The call to make next; then one of the answers. The caller sees to it that one comes.
  [[nodiscard]] std::optional<ParameterCall> next_call(MonotonicTime now);
  /// Answers; those to another call than the last are ignored.
  void on_value(std::uint64_t call, const NodeValue& value);
  /// @param result  or why the node refused it
  void on_set(std::uint64_t call, const Result<void, std::string>& result);
  void on_error(std::uint64_t call, ParameterCallError error);

  /// An event for each value that a node refused since the last call.
  [[nodiscard]] std::vector<mission::ParameterRefusedEvent> take_refused() {
    return std::exchange(refused_, {});
  }

 private:
  struct Item {
    const mission::Parameter* parameter;
    std::optional<NodeValue> value;
  };
  struct Request {
    TelecommandOrigin origin;
    bool sets = false;
    std::deque<Item> items;  ///< the first one is under way
    MonotonicTime expiry;
    bool started = false;
    std::vector<std::string> silent_nodes;
    std::uint16_t failure = 0;  ///< the first
    std::uint16_t failed_parameter = 0;
  };
  [[nodiscard]] std::optional<std::deque<Item>> items_of(const mission::Command& command,
                                                         OctetView arguments) const;
  [[nodiscard]] bool is_under_way(std::uint64_t call) const {
    return call_under_way_ && call == number_ && !requests_.empty();
  }
  void begin(Request& request);
  void end_item(std::uint16_t failure);
  void end_request();

  const mission::Dictionary& dictionary_;
  ReportQueue& report_queue_;
  std::uint16_t apid_;
  std::deque<Request> requests_;  ///< the first one runs
  std::uint64_t number_ = 0;      ///< of the last call
  bool call_under_way_ = false;
  std::vector<mission::ParameterRefusedEvent> refused_;
};

/// Between the value on the link and that of the node. nullopt: no equivalent.
[[nodiscard]] std::optional<NodeValue> to_node(const mission::Parameter& parameter,
                                               const mission::Value& value);
[[nodiscard]] std::optional<mission::Value> from_node(const mission::Parameter& parameter,
                                                      const NodeValue& value);

}  // namespace srfs
