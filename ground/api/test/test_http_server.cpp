// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/api/http_server.hpp"

#include <array>
#include <condition_variable>
#include <vector>

#include <gtest/gtest.h>
#include <poll.h>

namespace srfs::ground::api {
namespace {

/// Answers /known at once. Other requests are strangers', and wait: as if their threads had no CPU.
class Application : public HttpApplication {
 public:
  Admission admit(const HttpRequest& request) override {
    return {
        .refusal = {}, .body_max = 0, .known = request.target.segments == std::vector<std::string>{"known"}};
  }
  HttpResponse answer(const HttpRequest& request) override {
    if (admit(request).known) return error_response(200, "welcome");
    std::unique_lock lock(mutex_);
    ++waiting_;
    changed_.notify_all();
    changed_.wait(lock, [this] { return have_cpu_; });
    return error_response(200, "at last");
  }
  bool stream(const HttpRequest&, Transport&) override { return false; }

  void wait_for_strangers(std::size_t count) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return waiting_ >= count; });
  }
  void give_cpu() {
    const std::lock_guard lock(mutex_);
    have_cpu_ = true;
    changed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::size_t waiting_ = 0;
  bool have_cpu_ = false;
};

class Client {
 public:
  Client(std::uint16_t port, const std::string& path) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const std::string request = "GET " + path + " HTTP/1.1\r\nHost: localhost\r\n\r\n";
    EXPECT_EQ(::connect(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    EXPECT_EQ(::send(socket_.get(), request.data(), request.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(request.size()));
  }
  /// Empty: it was closed.
  [[nodiscard]] std::string first_octets() const {
    std::array<char, 64> octets{};
    const auto got = ::recv(socket_.get(), octets.data(), octets.size(), 0);
    return got > 0 ? std::string(octets.data(), static_cast<std::size_t>(got)) : std::string();
  }

 private:
  Fd socket_{::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)};
};

TEST(HttpServer, ServesWhoIsKnownThoughThreadsOfStrangersHaveNoCpu) {
  Application application;
  const auto server = HttpServer::open(*parse_address("127.0.0.1:0"), 0, nullptr);
  ASSERT_TRUE(server) << server.error();
  (*server)->start(application);
  std::vector<std::unique_ptr<Client>> strangers;
  for (std::size_t i = 0; i < HttpServer::connections_max; ++i)
    strangers.push_back(std::make_unique<Client>((*server)->port(), "/"));
  application.wait_for_strangers(HttpServer::connections_max);

  const Client known((*server)->port(), "/known");
  EXPECT_TRUE(known.first_octets().starts_with("HTTP/1.1 200"));
  EXPECT_EQ(strangers.front()->first_octets(), "") << "the oldest gave way";

  // As many more as there are threads for are served, too.
  std::vector<std::unique_ptr<Client>> others;
  for (std::size_t i = strangers.size() + 1; i < HttpServer::threads_max; ++i) {
    others.push_back(std::make_unique<Client>((*server)->port(), "/known"));
    EXPECT_TRUE(others.back()->first_octets().starts_with("HTTP/1.1 200")) << i;
  }
  application.give_cpu();
  const Client last((*server)->port(), "/known");
  EXPECT_TRUE(last.first_octets().starts_with("HTTP/1.1 200")) << "threads end when they have a CPU";
}

}  // namespace
}  // namespace srfs::ground::api
