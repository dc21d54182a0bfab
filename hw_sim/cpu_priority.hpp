#pragma once

namespace srfs::sim {

/// Niceness of the thread that stands for the hardware, which never waits for a CPU: before all that it
/// tests.
inline constexpr int hardware_niceness = -10;
/// Of work that must not hold up that thread, relative to what it has (camera frames).
inline constexpr int background_niceness = 10;

/// Raises the calling thread, and its session if this process leads it. Threads and processes it starts later
/// begin with niceness 0. @return 0 or errno: EPERM or EACCES without permission (CAP_SYS_NICE)
int put_before_the_tested();

}  // namespace srfs::sim
