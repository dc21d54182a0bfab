// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace srfs::testing_support {

/// Whether this is a build with AddressSanitizer or ThreadSanitizer: several times slower, and with terabytes
/// of shadow memory.
#ifdef SRFS_SANITIZED
constexpr bool sanitized = true;
#else
constexpr bool sanitized = false;
#endif

/// Whether this is a build for the board that runs in QEMU's user-mode emulation (./run arm64): an order of
/// magnitude slower. Tests skip what QEMU does not emulate.
#ifdef SRFS_EMULATED
constexpr bool emulated = true;
#else
constexpr bool emulated = false;
#endif

/// Tests with many random cases run fewer of them.
constexpr bool slow = sanitized || emulated;

}  // namespace srfs::testing_support
