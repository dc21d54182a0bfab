// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/random.h>

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <span>

namespace srfs {

/// Fills @p octets from the kernel's random generator, fit for keys. Blocks only early in the boot, until the
/// generator is seeded.
/// @return false: there are none; why is in errno, and @p octets are not to be used
[[nodiscard]] inline bool fill_random(std::span<std::uint8_t> octets) {
  while (!octets.empty()) {
    const ssize_t got = ::getrandom(octets.data(), octets.size(), 0);
    if (got < 0 && errno != EINTR) return false;
    if (got > 0) octets = octets.subspan(static_cast<std::size_t>(got));
  }
  return true;
}

}  // namespace srfs
