// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "tests/conformance/ros2_peer.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::conformance {

/// The DDS domain that only this test program uses.
[[nodiscard]] int test_domain();

/// A running conformance_node in a separate folder; the destructor ends it.
class NodeProcess {
 public:
  /// Starts the node in state unconfigured. @param dds the deployment's `dds` section without the domain
  NodeProcess(std::string name, const std::string& dds);
  ~NodeProcess();
  NodeProcess(const NodeProcess&) = delete;
  NodeProcess& operator=(const NodeProcess&) = delete;

  [[nodiscard]] const std::string& name() const { return name_; }
  /// The USER_DATA that the node's participant must have.
  [[nodiscard]] Octets user_data() const;

 private:
  std::string name_;
  testing_support::TemporaryFolder folder_;
  pid_t pid_ = -1;
};

/// One node and one ROS 2 peer for all tests of a suite. (One peer per test is not possible: Fast DDS 2.9
/// gives each participant of a process the next participant id, and announcements do not reach the port of
/// the 33rd.)
class ConformanceTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    node_ = std::make_unique<NodeProcess>("probe", "{ros_graph: humble, orders: open}");
    shared_peer_ = std::make_unique<Ros2Peer>(test_domain());
  }
  static void TearDownTestSuite() {
    node_.reset();
    shared_peer_.reset();
  }

  /// Waits until the node's participant is discovered. @return the participant
  [[nodiscard]] SeenParticipant participant() { return find(*node_); }
  [[nodiscard]] SeenParticipant find(const NodeProcess& node);

  static std::unique_ptr<NodeProcess> node_;
  static std::unique_ptr<Ros2Peer> shared_peer_;
  Ros2Peer& peer_ = *shared_peer_;
};

}  // namespace srfs::conformance
