// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include <poll.h>

#include "base/time.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::hw {

/// Waits on @p fd and tries @p condition after every wake-up, for at most @p limit.
inline bool poll_until(int fd, const std::function<bool()>& condition, milliseconds limit = seconds(5)) {
  const MonotonicTime deadline = monotonic_now() + limit;
  while (!condition()) {
    const auto left = std::chrono::duration_cast<milliseconds>(deadline - monotonic_now());
    if (left <= milliseconds(0)) return false;
    pollfd p{.fd = fd, .events = POLLIN, .revents = 0};
    ::poll(&p, 1, static_cast<int>(left.count()));
  }
  return true;
}

using testing_support::TemporaryFolder;

}  // namespace srfs::hw
