// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace srfs::sim {

/// Niceness of the thread that stands for the hardware. Hardware never waits for a CPU, so this thread goes
/// before all that it tests.
inline constexpr int hardware_niceness = -10;

/// Gives the calling thread short turns (srfs::set_turn) and raises it, and its session if this process leads
/// it. Threads and processes it starts later begin with niceness 0. @return 0 or errno: EPERM or EACCES
/// without permission (CAP_SYS_NICE)
int put_before_the_tested();

}  // namespace srfs::sim
