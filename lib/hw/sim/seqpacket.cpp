// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw/sim/seqpacket.hpp"

#include <cerrno>
#include <cstring>

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

namespace srfs::hw {

Result<sockaddr_un, std::string> unix_address(const std::filesystem::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string text = path.string();
  if (text.size() >= sizeof address.sun_path) {
    return Err(
        fmt::format("{}: longer than the {} characters a socket's path may have; choose a shorter --var",
                    text, sizeof address.sun_path - 1));
  }
  std::memcpy(address.sun_path, text.c_str(), text.size() + 1);
  return address;
}

Result<Fd, std::string> listen_seqpacket(const std::filesystem::path& path, int backlog) {
  const auto address = unix_address(path);
  if (!address) return Err(address.error());
  Fd socket(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  ::unlink(path.c_str());
  ::fchmod(socket.get(), S_IRUSR | S_IWUSR);  // before bind: what the name gets
  if (!socket || ::bind(socket.get(), reinterpret_cast<const sockaddr*>(&*address), sizeof *address) != 0 ||
      ::listen(socket.get(), backlog) != 0)
    return Err(fmt::format("cannot listen at {}: {}", path.string(), errno_text(errno)));
  return socket;
}

Result<Fd, std::string> connect_seqpacket(const std::filesystem::path& path) {
  const auto address = unix_address(path);
  if (!address) return Err(address.error());
  Fd socket(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!socket) return Err("socket: " + errno_text(errno));
  if (::connect(socket.get(), reinterpret_cast<const sockaddr*>(&*address), sizeof *address) != 0) {
    return Err(fmt::format("nothing listens at {}: {}", path.string(), errno_text(errno)));
  }
  return socket;
}

}  // namespace srfs::hw
