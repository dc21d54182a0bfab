// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/seqpacket_server.hpp"

#include <array>
#include <cerrno>

#include <fmt/format.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include "hw/sim/seqpacket.hpp"

namespace srfs::sim {
namespace {

constexpr std::size_t most_clients = 16;
constexpr std::size_t longest_message = 4096;

std::string failure(const std::filesystem::path& path, const char* what) {
  return fmt::format("{}: cannot {}: {}", path.string(), what, errno_text(errno));
}

}  // namespace

Result<std::unique_ptr<SeqpacketServer>, std::string> SeqpacketServer::create(
    EventLoop& loop, const std::filesystem::path& path, OnMessage on_message) {
  auto listener = hw::listen_seqpacket(path, static_cast<int>(most_clients));
  if (!listener) return Err(listener.error());
  return std::unique_ptr<SeqpacketServer>(
      new SeqpacketServer(loop, path, *std::move(listener), std::move(on_message)));
}

SeqpacketServer::SeqpacketServer(EventLoop& loop, std::filesystem::path path, Fd listener,
                                 OnMessage on_message)
    : loop_(loop),
      path_(std::move(path)),
      listener_(std::move(listener)),
      on_message_(std::move(on_message)) {
  loop_.watch(listener_.get(), EPOLLIN, [this](std::uint32_t, MonotonicTime) { accept_one(); });
}

SeqpacketServer::~SeqpacketServer() {
  for (const auto& [fd, owner] : clients_) loop_.unwatch(fd);
  loop_.unwatch(listener_.get());
  unlink(path_.c_str());
}

void SeqpacketServer::accept_one() {
  Fd client(accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
  if (!client) return;
  if (clients_.size() == most_clients) {
    ++refused_;
    return;
  }
  const int fd = client.get();
  clients_.emplace(fd, std::move(client));
  loop_.watch(fd, EPOLLIN, [this, fd](std::uint32_t, MonotonicTime now) { read_one(fd, now); });
}

void SeqpacketServer::read_one(int client, MonotonicTime now) {
  std::array<std::uint8_t, longest_message> buffer{};
  const ssize_t n = recv(client, buffer.data(), buffer.size(), MSG_DONTWAIT);
  if (n > 0) {
    on_message_(client, OctetView(buffer.data(), static_cast<std::size_t>(n)), now);
  } else if (n == 0 || (errno != EAGAIN && errno != EINTR)) {
    loop_.unwatch(client);
    clients_.erase(client);
  }
}

void SeqpacketServer::send(int client, OctetView message) {
  if (!clients_.contains(client)) return;
  if (::send(client, message.data(), message.size(), MSG_DONTWAIT | MSG_NOSIGNAL) < 0) ++dropped_;
}

void SeqpacketServer::send_to_all(OctetView message) {
  for (const auto& [fd, owner] : clients_) send(fd, message);
}

Result<std::string, std::string> ask_seqpacket(const std::filesystem::path& path, const std::string& request,
                                               milliseconds patience) {
  const auto address = hw::unix_address(path);
  if (!address) return Err(address.error());
  const Fd socket(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
  if (!socket) return Err(failure(path, "create a socket"));
  const timeval limit{.tv_sec = patience.count() / 1000, .tv_usec = patience.count() % 1000 * 1000};
  setsockopt(socket.get(), SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
  setsockopt(socket.get(), SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit);
  // With these limits a stop and a SIGCONT end each call with EINTR, though no signal is handled (signal(7)).
  if (TEMP_FAILURE_RETRY(
          connect(socket.get(), reinterpret_cast<const sockaddr*>(&*address), sizeof *address)) != 0)
    return Err(failure(path, "connect (is hw_sim running?)"));
  if (TEMP_FAILURE_RETRY(send(socket.get(), request.data(), request.size(), MSG_NOSIGNAL)) < 0)
    return Err(failure(path, "send"));
  std::string reply(65536, '\0');
  const ssize_t n = TEMP_FAILURE_RETRY(recv(socket.get(), reply.data(), reply.size(), 0));
  if (n <= 0) return Err(failure(path, "receive the reply"));
  reply.resize(static_cast<std::size_t>(n));
  return reply;
}

}  // namespace srfs::sim
