// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/server.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <set>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/file.h>
#include <unistd.h>

#include "base/signals.hpp"
#include "ground/local_socket.hpp"

namespace srfs::ground {

void log_of_server(const std::string& text) {
  std::fprintf(stderr, "srfs-ground serve: %s\n", text.c_str());
}

namespace {

constexpr seconds opening_period{1};

constexpr std::string_view server_lock_name = "serve.lock";  ///< in STATE

constexpr std::size_t replayed_max = 5000;  ///< packets, for a client that comes back

ClientHub::Memory memory_of(Recorder* recorder) {
  if (recorder == nullptr) return {};
  return {.packet = [recorder](const auto& packet) { return recorder->on_packet(packet, system_utc_now()); },
          .request_of = [recorder](const auto& token) { return recorder->request_of(token); },
          .packets_after =
              [recorder](std::int64_t id, const auto& take) {
                recorder->packets_after(id, replayed_max,
                                        [&](const StoredPacket& stored) { take(stored.id, stored.packet); });
              },
          .file = [recorder](const auto& news) { recorder->on_file(news, system_utc_now()); },
          .problem = [recorder] { return recorder->problem(); },
          .acknowledge =
              [recorder](std::int64_t id, const auto& who) {
                return recorder->acknowledge(id, {system_utc_now(), who});
              },
          .fill_gaps = [recorder] { recorder->fill_gaps(); }};
}

}  // namespace

Result<Fd, std::string> lock_state(const std::filesystem::path& state_dir) {
  std::error_code error;
  std::filesystem::create_directories(state_dir, error);
  const auto file = state_dir / server_lock_name;
  constexpr mode_t owner_alone = 0600;
  Fd lock(::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, owner_alone));
  if (!lock) return Err(fmt::format("{}: cannot open: {}", file.string(), errno_text(errno)));
  if (::flock(lock.get(), LOCK_EX | LOCK_NB) != 0)
    return Err(
        fmt::format("{}: another srfs-ground owns this folder (a server that does not answer, or a command "
                    "that has the line); end it first",
                    file.string()));
  return lock;
}

Result<std::vector<Fd>, std::string> lock_archive(const std::filesystem::path& file,
                                                  const std::filesystem::path& state_dir,
                                                  const std::filesystem::path& recorded) {
  std::error_code error;
  const auto real = std::filesystem::weakly_canonical(file, error);
  const auto of_state = std::filesystem::weakly_canonical(state_dir, error);
  std::set<std::filesystem::path> folders;
  if (std::filesystem::exists(real.parent_path() / server_lock_name, error))
    folders.insert(real.parent_path());
  if (std::filesystem::weakly_canonical(recorded, error) == real) folders.insert(of_state);
  std::vector<Fd> locks;
  for (const auto& folder : folders) {
    auto lock = lock_state(folder);
    if (!lock) return Err(lock.error());
    locks.push_back(std::move(*lock));
  }
  return locks;
}

Result<Server, std::string> Server::open(const std::filesystem::path& state_dir) {
  auto lock = lock_state(state_dir);
  if (!lock) return Err(lock.error());
  const auto socket = state_dir / serve::socket_name;
  auto listener = listen_at(socket);
  if (!listener) return Err(listener.error());
  return Server(socket, std::move(*lock), std::move(*listener));
}

bool Server::open_line(DirectLink& link, const OpenPort& open_port, MonotonicTime now) {
  if (link.fd() >= 0 || now < next_opening_) return false;
  next_opening_ = now + opening_period;
  auto port = open_port();
  if (!port) {
    if (std::exchange(told_problem_, port.error()) != port.error())
      log_of_server(port.error() + "; trying again every second");
    return false;
  }
  told_problem_.clear();
  link.replace_port(std::move(*port));
  log_of_server("the line is open");
  return true;
}

void Server::run(DirectLink& link, const OpenPort& open_port, const wire::FopSettings& fop,
                 Recorder* recorder, const std::function<void(MonotonicTime)>& companion) {
  const Fd signals = termination_signals();
  ignore_broken_pipes();
  ClientHub hub(link, {.write = [&link](OctetView octets) { return link.write(octets); },
                       .log = log_of_server,
                       .fop = fop,
                       .memory = memory_of(recorder)});
  link.set_octets_output([&hub](OctetView octets) { hub.on_octets(octets); });
  link.set_made_output([recorder, &hub](const auto& order, const auto& request, bool scheduled) {
    if (recorder != nullptr && !recorder->on_telecommand(order, request, scheduled, system_utc_now()) &&
        order.recorded_alone)
      return false;
    hub.on_telecommand({request, order.command.command->name, order.who, scheduled});
    return true;
  });
  link.set_unsent_output([recorder](const auto& order) {
    if (recorder != nullptr) recorder->on_not_sent(order.token);
  });
  link.queue_for_line();
  bool busy = false;  // aggregates are to be made, between the turns
  while (!ended_) {
    if (open_line(link, open_port, monotonic_now())) hub.on_line_opened();
    wait(link, hub, signals.get(), busy);
    static_cast<void>(link.on_time());
    hub.on_time(monotonic_now());
    if (companion) companion(monotonic_now());
    if (recorder != nullptr) {
      recorder->fill(link, monotonic_now());
      recorder->commit();  // before anything is shown
    }
    write_to_clients(hub);
    busy = recorder != nullptr && recorder->make_minute(system_utc_now());
  }
}

void Server::write_to_clients(ClientHub& hub) {
  std::vector<ClientHub::ClientId> gone;
  for (const auto& [client, socket] : sockets_) {
    if (!write_to(hub, client)) gone.push_back(client);
  }
  for (const ClientHub::ClientId client : hub.take_closing()) gone.push_back(client);
  for (const ClientHub::ClientId client : gone) drop(hub, client);
}

void Server::wait(DirectLink& link, ClientHub& hub, int signals, bool busy) {
  const auto of_line = static_cast<short>(link.has_waiting() ? POLLIN | POLLOUT : POLLIN);
  std::vector<pollfd> fds{{link.fd(), of_line, 0}, {listener_.get(), POLLIN, 0}, {signals, POLLIN, 0}};
  std::vector<ClientHub::ClientId> clients;
  for (const auto& [client, socket] : sockets_) {
    const bool writes = hub.front(client) != nullptr;
    fds.push_back({socket.get(), static_cast<short>(writes ? POLLIN | POLLOUT : POLLIN), 0});
    clients.push_back(client);
  }
  MonotonicTime wake = monotonic_now() + (busy ? milliseconds(0) : ClientHub::state_period);
  if (const auto next = link.next_deadline(); next && *next < wake) wake = *next;
  const auto left = std::chrono::ceil<milliseconds>(wake - monotonic_now()).count();
  if (::poll(fds.data(), fds.size(), static_cast<int>(std::clamp<std::int64_t>(left, 0, 1000))) <= 0) return;
  if (fds[2].revents != 0) {
    ended_ = true;
    return;
  }
  if ((fds[0].revents & ~POLLOUT) != 0) {  // on_time() writes
    if (const auto read = link.on_readable(); !read) {
      log_of_server(read.error());
      link.replace_port(Port::closed("the line"));
      hub.on_line_closed(read.error());
    }
  }
  for (std::size_t i = 0; i < clients.size(); ++i) {
    if ((fds[i + 3].revents & (POLLIN | POLLHUP | POLLERR)) != 0) read_from(hub, clients[i]);
  }
  if (fds[1].revents != 0) accept_clients(hub);
}

void Server::accept_clients(ClientHub& hub) {
  while (Fd socket = accept_from(listener_.get())) {
    const auto peer = peer_of(socket.get());
    if (!peer || (peer->uid != ::geteuid() && peer->uid != 0)) {
      log_of_server(fmt::format("a client of user {} was refused", peer ? peer->uid : 0));
      continue;
    }
    const auto client = hub.on_connect(fmt::format("pid {} of user {}", peer->pid, peer->uid));
    if (client) {
      sockets_[*client] = std::move(socket);
    } else {
      static_cast<void>(send_message(socket.get(), client.error()));
    }
  }
}

void Server::read_from(ClientHub& hub, ClientHub::ClientId client) {
  const int socket = sockets_.at(client).get();
  const auto received = receive_message(socket, serve::message_octets_max);
  if (std::holds_alternative<NoMessage>(received)) return;
  if (const auto* message = std::get_if<std::string>(&received)) return hub.on_message(client, *message);
  if (std::holds_alternative<TooLong>(received)) log_of_server("a client sent a message that is too long");
  drop(hub, client);
}

bool Server::write_to(ClientHub& hub, ClientHub::ClientId client) {
  const int socket = sockets_.at(client).get();
  while (const auto message = hub.front(client)) {
    const SendResult result = send_message(socket, *message);
    if (result == SendResult::closed) return false;
    if (result == SendResult::full) return true;
    hub.pop(client);
  }
  return true;
}

void Server::drop(ClientHub& hub, ClientHub::ClientId client) {
  hub.on_disconnect(client);
  sockets_.erase(client);
}

}  // namespace srfs::ground
