// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

/// Before a function whose loops the compiler turns into vector instructions: on x86-64 it is compiled twice,
/// and the machine decides at start which one runs. Results differ between the two in the last bits of a
/// float. (The sanitizers do not survive the resolvers this needs.)
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define SRFS_VECTORISED __attribute__((target_clones("arch=x86-64-v3", "default")))
#else
#define SRFS_VECTORISED
#endif
