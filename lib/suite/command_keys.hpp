// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.hpp"
#include "ros/datagram_seal.hpp"
#include "suite/instance.hpp"

namespace srfs::suite {

/// What ttc and one node share, to know each other's telecommands and reports
/// (commanding/command_proof.hpp).
using CommandKey = std::array<std::uint8_t, 32>;

/// The key of a node follows from the suite's, which is random and made anew at each start of the suite. Of a
/// node's key neither the suite's nor another node's can be found.
[[nodiscard]] CommandKey command_key_of(const CommandKey& suite_key, std::string_view node);

// The keys are files below order_keys(), for the suite's user alone (0600): `command_key` is the suite's, for
// ttc, `of_NODE/command_key` a node's, `seal/seal_key` that of all but uplinked nodes, `of_NODE/seal_key` an
// uplinked one's. One that is missing or damaged is made anew by who may write to the folder. One that cannot
// be read now is not: it may be good. None of these blocks on a disk while tmpfs has room.

/// Beside VarPaths::memory(), which a confined node may read as a whole: of this folder it may read
/// order_keys_for() alone. Without a runtime folder, and where tmpfs takes none, VAR/keys/orders. Removed by
/// `srfs down`.
[[nodiscard]] std::filesystem::path order_keys(const VarPaths& var);
inline constexpr std::string_view order_keys_suffix = ".keys";  ///< behind VarPaths::memory_name()
/// The folders of what a node reads: its own keys, and the suite's seal unless it is uplinked. A key that is
/// made anew lies there, too.
[[nodiscard]] std::vector<std::filesystem::path> order_keys_for(const VarPaths& var, const std::string& node,
                                                                bool uplinked);

[[nodiscard]] Result<std::array<std::uint8_t, 32>, std::string> random_key();

/// The suite's. Made when it is missing, by one process of those that ask. @param known  what it was when the
/// caller read it last: the one that is made then, since the nodes have theirs of it
[[nodiscard]] Result<CommandKey, std::string> suite_command_key(
    const VarPaths& var, const std::optional<CommandKey>& known = std::nullopt);
/// Writes a node's, where it is not there already; one that is there stays while the suite's is missing. By
/// who starts the node.
[[nodiscard]] Result<void, std::string> hand_out_command_key(const VarPaths& var, const std::string& node);
/// A node's own; made as above when the node was not started by the suite's launcher, or the suite's is
/// another one.
[[nodiscard]] Result<CommandKey, std::string> command_key(const VarPaths& var, const std::string& node);
/// That of the suite's processes but uplinked nodes, by which they know each other's datagrams
/// (ros/datagram_seal.hpp). Made as suite_command_key().
[[nodiscard]] Result<ros::SealKey, std::string> suite_seal_key(
    const VarPaths& var, const std::optional<ros::SealKey>& known = std::nullopt);
/// Writes an uplinked node's, which follows from the suite's, and those of others when that was made anew;
/// another node's is removed. By who starts the node.
[[nodiscard]] Result<void, std::string> hand_out_seal_key(const VarPaths& var, const std::string& node,
                                                          bool uplinked);
/// What a node seals by: the suite's if it may read that, else its own.
[[nodiscard]] Result<ros::SealKeys, std::string> seal_keys(const VarPaths& var, const std::string& node);
/// The same, only what is there: for a node that runs. It never makes a key, since all that ran before have
/// the one that was lost, and ttc writes that again.
[[nodiscard]] std::optional<ros::SealKeys> find_seal_keys(const VarPaths& var, const std::string& node);
/// The suite's, for a tool: only what is there and this user may read.
[[nodiscard]] std::optional<ros::SealKey> find_seal_key(const VarPaths& var);
/// Before the first node of a suite is started: the next keys are others.
void forget_command_keys(const VarPaths& var);

}  // namespace srfs::suite
