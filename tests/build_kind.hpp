// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace srfs::testing_support {

/// Built with AddressSanitizer or ThreadSanitizer: several times slower, and with terabytes of shadow memory.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool sanitized = true;
#else
constexpr bool sanitized = false;
#endif

/// Built for the board and run by QEMU's user-mode emulation (./run arm64): an order of magnitude slower;
/// what it does not emulate is skipped.
#ifdef SRFS_EMULATED
constexpr bool emulated = true;
#else
constexpr bool emulated = false;
#endif

/// Tests of many random cases take fewer.
constexpr bool slow = sanitized || emulated;

}  // namespace srfs::testing_support
