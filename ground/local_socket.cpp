// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/local_socket.hpp"

#include <algorithm>
#include <cerrno>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

namespace srfs::ground {
namespace {

/// A path of any length in the 108 octets of an address: by the descriptor of its folder.
struct Address {
  Fd folder;
  sockaddr_un address{};
};

Result<Address, int> address_of(const std::filesystem::path& path) {
  Address made;
  made.address.sun_family = AF_UNIX;
  const auto parent = path.parent_path();
  made.folder = Fd(::open(parent.empty() ? "." : parent.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC));
  if (!made.folder) return Err(static_cast<int>(errno));
  const std::string name = fmt::format("/proc/self/fd/{}/{}", made.folder.get(), path.filename().string());
  if (name.size() >= sizeof made.address.sun_path) return Err(static_cast<int>(ENAMETOOLONG));
  std::copy(name.begin(), name.end(), made.address.sun_path);
  return made;
}

Fd new_socket() {
  return Fd(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
}

}  // namespace

Result<Fd, std::string> listen_at(const std::filesystem::path& path) {
  constexpr int waiting_max = 16;
  const auto fail = [&path](int error) {
    return Err(fmt::format("{}: cannot listen there: {}", path.string(), errno_text(error)));
  };
  const auto address = address_of(path);
  if (!address) return fail(address.error());
  Fd listener = new_socket();
  if (!listener) return fail(errno);
  if (::unlink(path.c_str()) != 0 && errno != ENOENT) return fail(errno);
  // The mode counts from the first moment: a socket is created with that of the umask.
  const mode_t before = ::umask(S_IRWXG | S_IRWXO | S_IXUSR);
  const int bound =
      ::bind(listener.get(), reinterpret_cast<const sockaddr*>(&address->address), sizeof address->address);
  const int error = errno;
  ::umask(before);
  if (bound != 0) return fail(error);
  if (::listen(listener.get(), waiting_max) != 0) return fail(errno);
  return listener;
}

Fd accept_from(int listener) {
  return Fd(::accept4(listener, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
}

std::optional<Peer> peer_of(int socket) {
  ucred credentials{};
  socklen_t length = sizeof credentials;
  if (::getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &credentials, &length) != 0) return std::nullopt;
  return Peer{credentials.pid, credentials.uid};
}

Result<std::optional<Fd>, std::string> connect_to(const std::filesystem::path& path) {
  const auto fail = [&path](int error) {
    return Err(fmt::format("{}: cannot reach the server: {}", path.string(), errno_text(error)));
  };
  const auto address = address_of(path);
  if (!address) {
    if (address.error() == ENOENT || address.error() == ENOTDIR) return std::optional<Fd>();
    return fail(address.error());
  }
  Fd socket = new_socket();
  if (!socket) return fail(errno);
  if (::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address->address),
                sizeof address->address) == 0)
    return std::optional<Fd>(std::move(socket));
  if (errno == ENOENT || errno == ECONNREFUSED) return std::optional<Fd>();
  return fail(errno);
}

SendResult send_message(int socket, const std::string& message) {
  while (true) {
    const ssize_t put = ::send(socket, message.data(), message.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (put >= 0) return SendResult::sent;
    if (errno == EINTR) continue;
    return errno == EAGAIN || errno == ENOBUFS ? SendResult::full : SendResult::closed;
  }
}

std::variant<std::string, NoMessage, Closed, TooLong> receive_message(int socket, std::size_t octets_max) {
  ssize_t size = 0;
  do {
    size = ::recv(socket, nullptr, 0, MSG_DONTWAIT | MSG_PEEK | MSG_TRUNC);
    // ECONNRESET comes once, before what was sent ahead of the close: a refusal, for instance.
  } while (size < 0 && (errno == EINTR || errno == ECONNRESET));
  if (size < 0 && errno == EAGAIN) return NoMessage{};
  if (size <= 0) return Closed{};
  if (static_cast<std::size_t>(size) > octets_max) return TooLong{};
  std::string message(static_cast<std::size_t>(size), '\0');
  const ssize_t got = ::recv(socket, message.data(), message.size(), MSG_DONTWAIT);
  if (got != size) return Closed{};
  return message;
}

}  // namespace srfs::ground
