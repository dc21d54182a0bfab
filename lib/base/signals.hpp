// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/fd.hpp"

namespace srfs {

/// SIGTERM and SIGINT as a descriptor of struct signalfd_siginfo (non-blocking): from now on they are blocked
/// in this thread and in every thread it starts. Call it before the first thread.
[[nodiscard]] Fd termination_signals();

/// A peer that closes its end shows as an error of the write, not as the end of this process.
void ignore_broken_pipes();

}  // namespace srfs
