// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include <netinet/in.h>
#include <sys/socket.h>

#include "base/fd.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "ground/api/http.hpp"
#include "ground/api/transport.hpp"

namespace srfs::ground::api {

/// Answers requests. Called by the threads of connections.
class HttpApplication {
 public:
  HttpApplication() = default;
  virtual ~HttpApplication() = default;
  HttpApplication(const HttpApplication&) = delete;
  HttpApplication& operator=(const HttpApplication&) = delete;

  struct Admission {
    std::optional<HttpResponse> refusal;
    std::uint64_t body_max = 0;
    bool known = false;  ///< it has a token: its connection does not give way to strangers
  };
  /// By the head alone.
  [[nodiscard]] virtual Admission admit(const HttpRequest& request) = 0;
  /// A request that was admitted, with its body.
  [[nodiscard]] virtual HttpResponse answer(const HttpRequest& request) = 0;
  /// Writes a response without end. @return false: the request asks for none
  [[nodiscard]] virtual bool stream(const HttpRequest& request, Transport& transport) = 0;
};

/// An address of the option --web: "[ADDRESS:]PORT".
struct Address {
  sockaddr_storage storage{};
  socklen_t octets = 0;
  std::string name;  ///< as in a URL: "127.0.0.1", "[::1]"
  [[nodiscard]] bool is_loopback() const;
};
/// The error is ready to print.
[[nodiscard]] Result<Address, std::string> parse_address(const std::string& text);

/// Listens, and serves each connection by a thread of its own. Bounds: connections_max and threads_max,
/// deadlines for whatever comes and goes, the sizes of RequestReader. When all places are taken, the oldest
/// connection without a token gives way at once, though its thread needs a CPU to end; without any such, the
/// new one is refused.
class HttpServer {
 public:
  static constexpr std::size_t connections_max = 96;
  static constexpr std::size_t threads_max = 160;             ///< with those of connections that gave way
  static constexpr seconds head_patience{15};                 ///< for a whole head, and between requests
  static constexpr seconds write_patience{10};                ///< without progress of a stream
  static constexpr std::size_t octets_a_second_min = 50'000;  ///< of long bodies

  /// @param wanted_port  taken instead of port 0, if it is free; 0: any. The error is ready to print.
  [[nodiscard]] static Result<std::unique_ptr<HttpServer>, std::string> open(
      Address address, std::uint16_t wanted_port, std::shared_ptr<const TlsSettings> tls);
  /// Ends all connections.
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  [[nodiscard]] std::uint16_t port() const { return port_; }
  void start(HttpApplication& application);
  /// Connections end, and none is accepted.
  void stop();

 private:
  struct Connection {
    int socket = -1;
    bool known = false;
    bool leaves = false;  ///< it gave way
  };
  HttpServer(Fd listener, Fd stop, std::uint16_t port, std::shared_ptr<const TlsSettings> tls)
      : listener_(std::move(listener)), stop_(std::move(stop)), port_(port), tls_(std::move(tls)) {}
  void accept_all();
  void take(Fd socket);
  void serve(std::uint64_t number, const Fd& socket);
  /// @return whether the connection goes on
  [[nodiscard]] bool serve_request(std::uint64_t number, Transport& transport, std::string& input);
  [[nodiscard]] bool make_place(std::unique_lock<std::mutex>& lock);

  Fd listener_;
  Fd stop_;
  std::uint16_t port_;
  std::shared_ptr<const TlsSettings> tls_;
  HttpApplication* application_ = nullptr;
  std::thread acceptor_;
  std::mutex mutex_;
  std::condition_variable ended_;
  std::map<std::uint64_t, Connection> connections_;  ///< by number, the oldest first
  std::uint64_t next_number_ = 1;
  bool stopped_ = false;
};

}  // namespace srfs::ground::api
