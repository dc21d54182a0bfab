#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include <poll.h>
#include <stdlib.h>

#include "base/time.hpp"

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

/// A folder of its own, removed at the end.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    char name[] = "/tmp/srfs_hw_XXXXXX";
    path_ = ::mkdtemp(name);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace srfs::hw
