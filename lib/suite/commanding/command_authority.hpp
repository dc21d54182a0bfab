// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <srfs_msgs/msg/telecommand.hpp>
#include <srfs_msgs/msg/telecommand_report.hpp>

#include "base/rejection_log.hpp"
#include "ros/executor.hpp"
#include "suite/commanding/command_proof.hpp"
#include "suite/node.hpp"

namespace srfs {

/// A node's side of the proofs: which telecommands it takes, and the proofs of its own reports. In a
/// deployment with open orders (dds.orders) it takes all. On the node's work thread.
class CommandAuthority {
 public:
  /// Reads the node's key. @param node  outlives it
  explicit CommandAuthority(suite::Node& node);

  /// Whether the telecommand, which is for this node, is ttc's. One that is not is counted, and reported by
  /// an event, as are those after it once in 10 s. After a wrong proof the key is read again, at most once a
  /// second: it changes when the files were lost and a process made them anew.
  [[nodiscard]] bool admits(const srfs_msgs::msg::Telecommand& telecommand);
  void prove(srfs_msgs::msg::TelecommandReport& report) const;
  [[nodiscard]] std::uint32_t rejected() const { return log_.count(); }

 private:
  void read_key();
  void reject(const srfs_msgs::msg::Telecommand& telecommand, Rejection why);
  void report();

  suite::Node& node_;
  std::optional<suite::CommandKey> key_;
  MonotonicTime key_read_;
  RejectionLog log_;
  std::string last_;  ///< what came, and why it was rejected
  ros::Timer timer_;
};

/// ttc's side: the proofs of its telecommands, and which reports it believes. On the work thread.
class CommandSigner {
 public:
  using Nodes = std::function<std::vector<std::string>()>;

  /// Reads the suite's key, or makes it. @param open  all reports are believed
  /// @param nodes  names of those that get a key of it
  CommandSigner(suite::VarPaths var, bool open, Nodes nodes);

  /// The key may have been made anew meanwhile: read again, at most once a second. Where its file is missing,
  /// the one that is known is written again: the nodes hold theirs of it.
  void prove(srfs_msgs::msg::Telecommand& telecommand);
  [[nodiscard]] bool believes(const srfs_msgs::msg::TelecommandReport& report);
  /// To be called each second: writes the suite's keys again, of telecommands and of datagrams, where their
  /// files are missing. Nodes that are confined to the folder of before have them in memory, and could not
  /// read others.
  void keep_keys();

 private:
  void read_key();

  suite::VarPaths var_;
  bool open_;
  Nodes nodes_;
  std::optional<suite::CommandKey> key_;
  MonotonicTime key_read_;
};

}  // namespace srfs
