// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

#include "base/octets.hpp"

namespace srfs {

/// Why a key may be publicly known: it is zero, a simple pattern as documentation and tests use them, or
/// stands in a published test vector (NIST SP 800-38A, RFC 8032; also the public keys of such seeds).
/// nullopt: none of these. Of random keys of 32 octets it refuses fewer than one in 10^20.
[[nodiscard]] std::optional<std::string_view> why_known(OctetView key);

}  // namespace srfs
