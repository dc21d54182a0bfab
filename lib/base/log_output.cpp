// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/log_output.hpp"

#include <cerrno>
#include <cstdlib>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

namespace srfs::log {

void Output::look() {
  struct stat now {};
  if (fstat(fd_, &now) != 0) {
    kind_ = Kind::none;
    return;
  }
  if (kind_ != Kind::none && now.st_dev == device_ && now.st_ino == inode_) return;
  device_ = now.st_dev;
  inode_ = now.st_ino;
  own_.reset();
  line_open_ = false;
  const char* stream = std::getenv("JOURNAL_STREAM");
  journal_ = stream != nullptr && fmt::format("{}:{}", now.st_dev, now.st_ino) == stream;
  if (S_ISSOCK(now.st_mode)) {
    kind_ = Kind::socket;
  } else if (S_ISREG(now.st_mode)) {
    kind_ = Kind::regular;
  } else {
    own_ =
        Fd(open(fmt::format("/proc/self/fd/{}", fd_).c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY));
    kind_ = own_ ? Kind::own : Kind::polled;
  }
}

ssize_t Output::write_some(std::string_view text) const {
  switch (kind_) {
    case Kind::none:
      errno = EBADF;
      return -1;
    case Kind::regular:
      return ::write(fd_, text.data(), text.size());
    case Kind::socket:
      return send(fd_, text.data(), text.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    case Kind::own:
      return ::write(own_.get(), text.data(), text.size());
    case Kind::polled: {
      // A pipe that is writable has room for PIPE_BUF octets.
      pollfd entry{fd_, POLLOUT, 0};
      if (poll(&entry, 1, 0) == 1 && (entry.revents & POLLOUT) != 0)
        return ::write(fd_, text.data(), text.size());
      errno = EAGAIN;
      return -1;
    }
  }
  return -1;
}

bool Output::write(std::string_view line) {
  look();
  if (line_open_) {
    if (write_some("\n") != 1) {
      ++lost_;
      return false;
    }
    line_open_ = false;
  }
  ssize_t taken = write_some(line);
  if (taken < 0 && errno == EINTR) taken = write_some(line);
  if (taken == static_cast<ssize_t>(line.size())) return true;
  line_open_ = taken > 0;
  ++lost_;
  return false;
}

bool Output::is_journal() {
  look();
  return journal_ && kind_ != Kind::none;
}

}  // namespace srfs::log
