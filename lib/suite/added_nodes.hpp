// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.hpp"
#include "suite/deployment.hpp"
#include "suite/instance.hpp"

namespace srfs::suite {

/// The nodes that were added to the running system, in one file beside the read-only deployment:
/// VAR/state/suite/added_nodes. It holds everything that the other nodes know of an added node: its entry,
/// its place in the ring, its slot on the CAN bus, its devices, its fragment of the mission dictionary.
/// Replacing it is the one instant at which a node joins or leaves; every process checks it each second. No
/// DDS here; node_addition.hpp adds and removes nodes.
struct AddedNodes {
  static constexpr std::size_t nodes_max = 8;
  static constexpr std::size_t description_octets_max = 4096;
  static constexpr std::size_t dictionary_octets_max = 32768;

  std::uint32_t revision = 0;  ///< counts the changes; 0: there never was one
  std::vector<AddedNode> nodes;

  [[nodiscard]] const AddedNode* find(std::string_view node) const;
  friend bool operator==(const AddedNodes&, const AddedNodes&) = default;
};

/// The file's text: YAML, closed by a line with the CRC-32C of all before it.
[[nodiscard]] std::string to_text(const AddedNodes& added);
/// @return the list, or what is wrong with the text
[[nodiscard]] Result<AddedNodes, std::string> added_nodes_from_text(const std::string& text);

/// VAR/state/suite/added_nodes
[[nodiscard]] std::filesystem::path added_nodes_file(const VarPaths& var);

struct AddedNodesReading {
  AddedNodes added;
  std::string damage;  ///< for people; empty: the file is sound, or there is none
};
/// A damaged file is an empty list, and stays as it is until a node is added. Blocks on the disk.
[[nodiscard]] AddedNodesReading read_added_nodes(const VarPaths& var);

struct DeploymentReading {
  Deployment deployment;
  std::vector<std::string> problems;  ///< for people: what of the list is not used; empty: all is well
};
/// The deployment with the added nodes in it. A node that does not fit (its description, its name, its flag's
/// position) is left out with a problem: the suite of the file flies on. Pure.
[[nodiscard]] DeploymentReading with_added(Deployment file, const AddedNodes& added);

/// Every program that works with a VAR reads its deployment here. Throws ConfigError for the deployment file
/// alone.
[[nodiscard]] DeploymentReading load_deployment(const std::filesystem::path& file, const VarPaths& var);

/// The deployment of a running process, which follows the list of added nodes.
class LiveDeployment {
 public:
  static constexpr std::size_t kept = 8;

  /// @param file  the deployment file alone. Blocks on the disk
  LiveDeployment(Deployment file, VarPaths var);
  LiveDeployment(const LiveDeployment&) = delete;
  LiveDeployment& operator=(const LiveDeployment&) = delete;

  /// Any thread. Whole, constant; valid until refresh() has returned true @p kept more times.
  [[nodiscard]] const Deployment& current() const { return *current_.load(std::memory_order_acquire); }
  /// The one of the start: valid as long as this.
  [[nodiscard]] const Deployment& first() const { return *first_; }
  /// Checks the file (one `stat`), reads it when it is another one. One thread. Blocks on the disk.
  /// @return whether current() is another one now
  bool refresh();

 private:
  [[nodiscard]] std::string stamp() const;
  [[nodiscard]] std::unique_ptr<const Deployment> read();

  const Deployment file_;
  const VarPaths var_;
  std::string stamp_;
  std::unique_ptr<const Deployment> first_;
  std::array<std::unique_ptr<const Deployment>, kept> later_;
  std::size_t next_ = 0;  ///< in later_
  std::atomic<const Deployment*> current_;
};

}  // namespace srfs::suite
