// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "base/fd.hpp"
#include "base/octets.hpp"
#include "base/result.hpp"
#include "hw_sim/event_loop.hpp"

namespace srfs::sim {

/// An AF_UNIX SOCK_SEQPACKET server inside the loop: at most 16 clients, datagrams of at most 4 KiB. Never
/// blocks; what a client does not take in time is dropped and counted. Removes its socket file when
/// destroyed.
class SeqpacketServer {
 public:
  using OnMessage = std::function<void(int client, OctetView message, MonotonicTime now)>;

  /// Replaces a socket file left by a dead predecessor. Error: ready to print.
  [[nodiscard]] static Result<std::unique_ptr<SeqpacketServer>, std::string> create(
      EventLoop& loop, const std::filesystem::path& path, OnMessage on_message);
  ~SeqpacketServer();
  SeqpacketServer(const SeqpacketServer&) = delete;
  SeqpacketServer& operator=(const SeqpacketServer&) = delete;

  void send(int client, OctetView message);
  void send_to_all(OctetView message);
  [[nodiscard]] std::size_t clients() const { return clients_.size(); }
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }
  [[nodiscard]] std::uint64_t refused() const { return refused_; }

 private:
  SeqpacketServer(EventLoop& loop, std::filesystem::path path, Fd listener, OnMessage on_message);
  void accept_one();
  void read_one(int client, MonotonicTime now);

  EventLoop& loop_;
  std::filesystem::path path_;
  Fd listener_;
  OnMessage on_message_;
  std::map<int, Fd> clients_;
  std::uint64_t dropped_ = 0;
  std::uint64_t refused_ = 0;
};

/// One request and its reply as a client. Blocks up to @p patience, which begins anew when this
/// process was stopped. Error: ready to print.
[[nodiscard]] Result<std::string, std::string> ask_seqpacket(const std::filesystem::path& path,
                                                             const std::string& request,
                                                             milliseconds patience);

}  // namespace srfs::sim
