// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <mission/structures.hpp>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "msgs/mission/dictionary.hpp"
#include "nodes/ttc/report/report_queue.hpp"
#include "nodes/ttc/services/mode_manager.hpp"

namespace srfs {

/// What is known of one node's process from outside.
struct NodeFacts {
  bool running = false;
  std::uint32_t restarts = 0;
  std::string version;  ///< "0.2.0"; empty: unknown
};

/// How often and why the computer started.
struct BootTold {
  std::uint32_t count = 0;
  mission::ResetCause cause = mission::ResetCause::unknown;
};

/// What ttc itself knows at the moment of the beacon.
struct BeaconInputs {
  std::uint64_t cycle = 0;
  BootTold boot;  ///< used until timing has reported it
  MissionMode mode = MissionMode::safe;
  std::string mode_reason;
  std::optional<std::uint32_t> mode_since_s;
  std::uint8_t mode_pending = 0;
  std::uint8_t mode_causes = 0;
  bool time_valid = false;
  std::uint32_t storage_free_mib = 0;
  mission::StorageState storage_state = mission::StorageState::works;
  std::uint32_t store_records = 0;
  std::optional<LastTelecommand> last_telecommand;
  std::array<std::uint16_t, 2> sdls_spi{};      ///< BD, AD; 0: none
  std::array<std::uint64_t, 2> sdls_counter{};  ///< BD, AD
  std::uint8_t farm_vr = 0;
  bool farm_lockout = false;
  std::uint32_t command_loss_s = UINT32_MAX;         ///< until the next step of its timer
  std::uint16_t next_scheduled_function = 0;         ///< 0: none, or no function
  std::optional<std::uint32_t> next_scheduled_in_s;  ///< nullopt: none, or the time is not valid
};

/// Collects what the beacon says about the other nodes and builds it. A value not heard for value_lifetime is
/// unknown; a node whose process is not there is absent.
class BeaconBuilder {
 public:
  static constexpr seconds value_lifetime{60};

  /// The nodes in the beacon are those of the dictionary in APID order, without added ones.
  explicit BeaconBuilder(const mission::Dictionary& dictionary);

  [[nodiscard]] const std::vector<std::string>& nodes() const { return names_; }
  /// A housekeeping sample of any node; those that carry values of the beacon, as the dictionary says, are
  /// read.
  void on_telemetry(std::string_view node, std::uint16_t structure_id, OctetView data, MonotonicTime now);
  /// @param state id as in lifecycle_msgs/msg/State
  void on_lifecycle(std::string_view node, std::uint8_t state);
  void on_facts(std::string_view node, const NodeFacts& facts);
  /// nullopt: timing has not reported it yet.
  [[nodiscard]] const std::optional<BootTold>& boot() const { return boot_; }
  /// Running nodes whose state is not known yet: worth asking.
  [[nodiscard]] std::vector<std::string> nodes_to_ask() const;

  /// The parameters of the beacon structure, encoded.
  [[nodiscard]] Octets build(const BeaconInputs& inputs, MonotonicTime now) const;

 private:
  struct Node {
    std::optional<std::uint8_t> state;  ///< lifecycle state last reported
    NodeFacts facts;
  };
  struct Reading {
    float value = 0;
    MonotonicTime heard;
  };
  /// A value of the beacon that another node measures.
  struct Measured {
    mission::BeaconSource source;
    std::optional<Reading> last;
  };
  /// Where can_switcher's housekeeping counts failed slots.
  struct CanErrors {
    std::uint16_t structure_id = 0;
    std::size_t overruns = 0;  ///< octets before it
    std::size_t failures = 0;
    std::size_t payloads = 0;  ///< elements of failures
  };
  [[nodiscard]] Node* find(std::string_view node);
  /// Not a number: no source, not heard, or too old.
  [[nodiscard]] float fresh(std::string_view value, MonotonicTime now) const;
  void on_can_switcher(OctetView data);

  std::vector<std::string> names_;
  std::vector<Node> nodes_;  ///< as names_
  std::vector<Measured> measured_;
  CanErrors can_;
  std::optional<BootTold> boot_;
  std::uint32_t can_errors_ = UINT32_MAX;  ///< not heard yet
};

/// 4 bits major, 6 bits minor, 6 bits patch; 0 when @p version is not "a.b.c" or does not fit.
[[nodiscard]] std::uint16_t packed_version(std::string_view version);

}  // namespace srfs
