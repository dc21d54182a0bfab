// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "base/fd.hpp"
#include "ground/archive/recorder.hpp"
#include "ground/client_hub.hpp"
#include "ground/direct_link.hpp"

namespace srfs::ground {

/// The sockets and the loop of `srfs-ground serve`: one line, many clients, until SIGINT or SIGTERM. A line
/// that is closed is opened again as soon as it is there. Logs to standard error.
class Server {
 public:
  using OpenPort = std::function<Result<Port, std::string>()>;

  /// Takes STATE for this process and listens at STATE/serve.sock. The error is ready to print.
  [[nodiscard]] static Result<Server, std::string> open(const std::filesystem::path& state_dir);

  /// Serves until a signal.
  /// @param link  its port may be closed
  /// @param fop  of the link's AD service
  /// @param recorder  nullptr: nothing is remembered
  /// @param companion  done in every turn, at least each ClientHub::state_period; never blocks
  void run(DirectLink& link, const OpenPort& open_port, const wire::FopSettings& fop, Recorder* recorder,
           const std::function<void(MonotonicTime)>& companion = {});

  [[nodiscard]] const std::filesystem::path& socket() const { return socket_; }

 private:
  Server(std::filesystem::path socket, Fd lock, Fd listener)
      : socket_(std::move(socket)), lock_(std::move(lock)), listener_(std::move(listener)) {}
  /// @return whether it is open since now
  [[nodiscard]] bool open_line(DirectLink& link, const OpenPort& open_port, MonotonicTime now);
  void accept_clients(ClientHub& hub);
  /// One message: the line and the other clients come before the next.
  void read_from(ClientHub& hub, ClientHub::ClientId client);
  /// What the socket takes. @return false: it is closed
  [[nodiscard]] bool write_to(ClientHub& hub, ClientHub::ClientId client);
  void drop(ClientHub& hub, ClientHub::ClientId client);
  void wait(DirectLink& link, ClientHub& hub, int signals, bool busy);
  void write_to_clients(ClientHub& hub);

  std::filesystem::path socket_;
  Fd lock_;
  Fd listener_;
  std::map<ClientHub::ClientId, Fd> sockets_;
  MonotonicTime next_opening_;
  std::string told_problem_;
  bool ended_ = false;
};

/// What the server says goes to its log.
void log_of_server(const std::string& text);

/// Takes STATE for a process that owns the line; held until the descriptor is closed. The error is ready to
/// print.
[[nodiscard]] Result<Fd, std::string> lock_state(const std::filesystem::path& state_dir);
/// Takes the folders whose server may write an archive's file, however it is spelled: that of the file, and
/// STATE when its server records there.
/// @param recorded  the archive of STATE's server
[[nodiscard]] Result<std::vector<Fd>, std::string> lock_archive(const std::filesystem::path& file,
                                                                const std::filesystem::path& state_dir,
                                                                const std::filesystem::path& recorded);

}  // namespace srfs::ground
