// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include <netinet/in.h>

namespace srfs::ground {

/// "127.0.0.1:10015" or "10015" (loopback); no names. nullopt: malformed.
[[nodiscard]] std::optional<sockaddr_in> parse_internet_address(std::string_view text);
[[nodiscard]] std::string to_text(const sockaddr_in& address);

}  // namespace srfs::ground
