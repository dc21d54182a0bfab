// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <optional>
#include <thread>
#include <vector>

#include <poll.h>
#include <nlohmann/json.hpp>

#include "ground/local_socket.hpp"
#include "ground/serve_messages.hpp"

namespace srfs::ground {

using Messages = std::vector<nlohmann::json>;

/// A server, and those that follow it at the same socket: one connection at a time, in its own thread. It
/// says what the test gave it to say.
class FakeServer {
 public:
  /// @return what it says to a message of its n-th client, from 1; nullopt, or a null among it: it ends
  using Answer = std::function<std::optional<Messages>(int client, const nlohmann::json&)>;

  FakeServer(const std::filesystem::path& socket, Answer answer)
      : listener_(*listen_at(socket)), answer_(std::move(answer)), thread_([this] { serve(); }) {}
  ~FakeServer() {
    stopped_ = true;
    thread_.join();
  }
  FakeServer(const FakeServer&) = delete;
  FakeServer& operator=(const FakeServer&) = delete;

 private:
  void serve() {
    Fd socket;
    int client = 0;
    while (!stopped_) {
      pollfd wait{socket ? socket.get() : listener_.get(), POLLIN, 0};
      if (::poll(&wait, 1, 10) <= 0) continue;
      if (!socket) {
        socket = accept_from(listener_.get());
        ++client;
        continue;
      }
      const auto received = receive_message(socket.get(), serve::message_octets_max);
      const auto* text = std::get_if<std::string>(&received);
      const auto said =
          text == nullptr ? std::optional<Messages>() : answer_(client, nlohmann::json::parse(*text));
      for (const auto& message : said.value_or(Messages{nullptr})) {
        if (message.is_null()) socket.reset();
        if (socket) static_cast<void>(send_message(socket.get(), message.dump()));
      }
    }
  }

  Fd listener_;
  Answer answer_;
  std::atomic<bool> stopped_{false};
  std::thread thread_;
};

inline nlohmann::json cop_in(AdPhase phase) {
  CopReport report;
  report.phase = phase;
  return serve::to_message(report);
}

inline nlohmann::json welcome(AdPhase phase, const std::vector<cfdp::Report>& transfers, std::uint64_t sent,
                              bool archive = true) {
  return {{"type", "welcome"},
          {"vc", 0},
          {"archive", archive},
          {"line_open", true},
          {"cop", cop_in(phase)},
          {"transfers", serve::to_message(transfers)},
          {"counters", serve::to_message(DownlinkCounters{})},
          {"locked", true},
          {"clcw", nullptr},
          {"sent", sent}};
}

inline nlohmann::json reply_to(const nlohmann::json& message,
                               nlohmann::json reply = nlohmann::json::object()) {
  reply["type"] = "reply";
  reply["call"] = message["call"];
  return reply;
}

}  // namespace srfs::ground
