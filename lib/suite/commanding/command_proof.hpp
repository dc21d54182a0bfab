// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include <srfs_msgs/msg/telecommand.hpp>
#include <srfs_msgs/msg/telecommand_report.hpp>

#include "suite/command_keys.hpp"

namespace srfs {

/// HMAC-SHA-256 over all other fields, cut to 16 octets (RFC 2104, section 5). Anybody in the DDS domain can
/// publish on /telecommand; who has not the node's key cannot prove that ttc accepted the telecommand, which
/// includes that a hazardous one was armed.
using CommandProof = std::array<std::uint8_t, 16>;

[[nodiscard]] CommandProof prove(const suite::CommandKey& key,
                                 const srfs_msgs::msg::Telecommand& telecommand);
[[nodiscard]] CommandProof prove(const suite::CommandKey& key,
                                 const srfs_msgs::msg::TelecommandReport& report);

enum class Rejection : std::uint8_t {
  no_key,       ///< this node has none: it cannot know
  no_proof,     ///< all zero
  wrong_proof,  ///< not of this key, or not of these fields
  no_expiry,    ///< it could be replayed for ever
};
[[nodiscard]] const char* to_text(Rejection rejection);

/// Why a node must not take this telecommand; nullopt: it is ttc's. A replay is: the journal knows its id, or
/// it has expired, or it is older than what the journal knows (TelecommandJournal).
/// @param key  nullptr: there is none
[[nodiscard]] std::optional<Rejection> rejection_of(const suite::CommandKey* key,
                                                    const srfs_msgs::msg::Telecommand& telecommand);
[[nodiscard]] bool is_proven(const suite::CommandKey& key, const srfs_msgs::msg::TelecommandReport& report);

}  // namespace srfs
