// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <variant>

#include "base/fd.hpp"
#include "base/result.hpp"

namespace srfs::ground {

/// UNIX sockets that keep messages apart (SOCK_SEQPACKET), at a path of any length. Non-blocking.

/// Listens at @p path, for this user alone (0600); a socket that is there is replaced, so the caller holds a
/// lock. The error is ready to print.
[[nodiscard]] Result<Fd, std::string> listen_at(const std::filesystem::path& path);

struct Peer {
  int pid = 0;
  unsigned uid = 0;
};
/// The next client that waits; no descriptor: none does.
[[nodiscard]] Fd accept_from(int listener);
/// Who is at the other end (SO_PEERCRED). nullopt: nobody any more.
[[nodiscard]] std::optional<Peer> peer_of(int socket);

/// nullopt: nobody listens there. The error is ready to print.
[[nodiscard]] Result<std::optional<Fd>, std::string> connect_to(const std::filesystem::path& path);

enum class SendResult : std::uint8_t { sent, full, closed };
/// One message, whole or not at all.
[[nodiscard]] SendResult send_message(int socket, const std::string& message);

struct NoMessage {};  ///< none is there
struct Closed {};     ///< the other end closed
struct TooLong {};    ///< a message was longer than allowed, and is gone
[[nodiscard]] std::variant<std::string, NoMessage, Closed, TooLong> receive_message(int socket,
                                                                                    std::size_t octets_max);

}  // namespace srfs::ground
