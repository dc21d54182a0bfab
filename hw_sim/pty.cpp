// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/pty.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <system_error>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

namespace srfs::sim {
namespace {

// The line discipline's queue holds 4095 octets; what is written beyond it waits where unread() cannot see
// it.
constexpr std::size_t slave_queue = 4000;

tl::unexpected<std::string> failure(const std::filesystem::path& link, const char* what) {
  return Err(fmt::format("{}: cannot {}: {}", link.string(), what, errno_text(errno)));
}

}  // namespace

Result<Pty, std::string> Pty::create(const std::filesystem::path& link) {
  Fd master(posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK));
  std::array<char, 128> name{};
  if (!master || grantpt(master.get()) != 0 || unlockpt(master.get()) != 0 ||
      ptsname_r(master.get(), name.data(), name.size()) != 0) {
    return failure(link, "create a pseudo-terminal");
  }
  Fd slave(open(name.data(), O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK));
  if (!slave) return failure(link, "open the pseudo-terminal's slave");
  termios mode{};
  if (tcgetattr(slave.get(), &mode) != 0) return failure(link, "read the terminal's settings");
  cfmakeraw(&mode);
  if (tcsetattr(slave.get(), TCSANOW, &mode) != 0) return failure(link, "set the terminal to raw mode");

  std::error_code ec;
  std::filesystem::create_directories(link.parent_path(), ec);
  // A link of ours leads to a pseudo-terminal; what else is there belongs to somebody.
  const auto there = std::filesystem::symlink_status(link, ec);
  const bool ours = std::filesystem::is_symlink(there) &&
                    std::filesystem::read_symlink(link, ec).native().starts_with("/dev/pts/");
  if (std::filesystem::exists(there) && !ours)
    return Err(fmt::format("{}: not a link to a pseudo-terminal; it is left alone", link.string()));
  const std::filesystem::path temporary = fmt::format("{}.{}.tmp", link.string(), getpid());
  unlink(temporary.c_str());
  if (symlink(name.data(), temporary.c_str()) != 0 || rename(temporary.c_str(), link.c_str()) != 0)
    return failure(link, "link");
  return Pty(link, std::move(master), std::move(slave));
}

Pty::~Pty() {
  if (master_) unlink(link_.c_str());  // not when moved from
}

std::size_t Pty::read(std::span<std::uint8_t> into) {
  if (into.empty()) return 0;
  const ssize_t n = ::read(master_.get(), into.data(), into.size());
  return n > 0 ? static_cast<std::size_t>(n) : 0;
}

std::size_t Pty::write(OctetView octets) {
  const std::size_t waiting = unread();
  if (waiting >= slave_queue || octets.empty()) return 0;
  const ssize_t n = ::write(master_.get(), octets.data(), std::min(octets.size(), slave_queue - waiting));
  return n > 0 ? static_cast<std::size_t>(n) : 0;
}

std::size_t Pty::unread() const {
  int n = 0;
  return ioctl(slave_.get(), FIONREAD, &n) == 0 && n > 0 ? static_cast<std::size_t>(n) : 0;
}

void Pty::discard_unread() {
  tcflush(master_.get(), TCOFLUSH);
  tcflush(slave_.get(), TCIFLUSH);
}

void Pty::release_exclusive_hold() {
  ioctl(slave_.get(), TIOCNXCL);
}

}  // namespace srfs::sim
