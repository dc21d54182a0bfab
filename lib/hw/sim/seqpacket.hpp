// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include <sys/un.h>

#include "base/fd.hpp"
#include "base/result.hpp"

namespace srfs::hw {

/// The address of a socket file; the error (path too long) is for a person.
[[nodiscard]] Result<sockaddr_un, std::string> unix_address(const std::filesystem::path& path);

/// Listens at a socket file, for this user alone; replaces the file. Non-blocking, close-on-exec. The error
/// is for a person.
[[nodiscard]] Result<Fd, std::string> listen_seqpacket(const std::filesystem::path& path, int backlog);

/// Connects to an AF_UNIX SOCK_SEQPACKET server. Non-blocking, close-on-exec. The error is for a person.
[[nodiscard]] Result<Fd, std::string> connect_seqpacket(const std::filesystem::path& path);

}  // namespace srfs::hw
