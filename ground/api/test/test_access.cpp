// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/api/access.hpp"

#include <algorithm>
#include <atomic>
#include <cctype>
#include <fstream>
#include <set>
#include <string>
#include <thread>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include "ground/api/routes.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::ground::api {
namespace {

const Tokens tokens{"observe-0123456789abcdef", "command-0123456789abcdef"};

HttpRequest request_with(const std::string& authorization, const std::string& target = "/api/v1/stream") {
  HttpRequest request;
  request.method = "GET";
  request.target = *parse_target(target);
  request.authorization = authorization;
  return request;
}

TEST(Token, SaysWhatARequestMayDo) {
  EXPECT_EQ(role_of(request_with("Bearer " + tokens.command), tokens, false), Role::commander);
  EXPECT_EQ(role_of(request_with("Bearer " + tokens.observe), tokens, false), Role::observer);
  for (const char* wrong : {"", "Bearer", "Bearer ", "Basic abc", "Bearer observe-0123456789abcde",
                            "Bearer observe-0123456789abcdeff", "bearer observe-0123456789abcdef"})
    EXPECT_EQ(role_of(request_with(wrong), tokens, false), Role::stranger) << wrong;
}

TEST(Token, IsTakenFromTheQueryOnlyWhereItMayStand) {
  const auto request = request_with("", "/api/v1/stream?token=" + tokens.command);
  EXPECT_EQ(role_of(request, tokens, true), Role::commander);
  EXPECT_EQ(role_of(request, tokens, false), Role::stranger);
  EXPECT_EQ(role_of(request_with("Bearer wrong", "/api/v1/stream?token=" + tokens.command), tokens, true),
            Role::stranger)
      << "the header decides";
}

TEST(SiteOfARequest, IsThisServerOrRefused) {
  const Site site{.scheme = "http", .port = 8190, .is_own_name = is_loopback_name};
  const auto wrong = [&site](const std::string& host, const std::string& origin) {
    HttpRequest request;
    request.host = host;
    request.origin = origin;
    return wrong_site(request, site).has_value();
  };
  for (const char* host : {"127.0.0.1:8190", "localhost:8190", "[::1]:8190"}) {
    EXPECT_FALSE(wrong(host, "")) << host;
    EXPECT_FALSE(wrong(host, std::string("http://") + host)) << host;
    EXPECT_TRUE(wrong(host, std::string("https://") + host)) << host;
  }
  for (const char* host : {"", "127.0.0.1", "127.0.0.1:80", "evil.example:8190",
                           "127.0.0.1.evil.example:8190", "localhost:81900", "[::1", "user@127.0.0.1:8190"})
    EXPECT_TRUE(wrong(host, "")) << host;
  for (const char* origin : {"null", "http://evil.example", "http://localhost:8190", "http://127.0.0.1:8191",
                             "http://127.0.0.1:8190/", "http://127.0.0.1"})
    EXPECT_TRUE(wrong("127.0.0.1:8190", origin)) << origin;
}

TEST(WebFile, HoldsTokensThatStayAndThatTheOwnerAloneReads) {
  const testing_support::TemporaryFolder folder;
  const auto made = open_web_file(folder.path());
  ASSERT_TRUE(made);
  EXPECT_EQ(made->tokens.observe.size(), 64U);
  EXPECT_NE(made->tokens.observe, made->tokens.command);
  ASSERT_TRUE(write_web_file(folder.path(), {"http://127.0.0.1:8190", made->tokens}));
  struct stat status {};
  ASSERT_EQ(::stat((folder.path() / web_file).c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0600U);

  const auto again = open_web_file(folder.path());
  ASSERT_TRUE(again);
  EXPECT_EQ(again->tokens.command, made->tokens.command);
  EXPECT_EQ(again->url, "http://127.0.0.1:8190");
  EXPECT_NE(open_web_file(folder.path() / "other")->tokens.command, made->tokens.command);
}

/// A thread of this process does, as the kernel tells.
bool somebody_waits_for_a_lock() {
  std::ifstream locks("/proc/locks");
  for (std::string line; std::getline(locks, line);) {
    if (line.find("-> FLOCK") != std::string::npos &&
        line.find(fmt::format(" {} ", ::getpid())) != std::string::npos)
      return true;
  }
  return false;
}

TEST(WebFile, TheGatewayOfAServerWaitsUntilThatOfTheServerBeforeIsGone) {
  const testing_support::TemporaryFolder folder;
  auto before = await_web_of_server(folder.path());
  ASSERT_TRUE(before);
  std::atomic<bool> gone = false;
  std::thread next([&] {
    const auto lock = await_web_of_server(folder.path());
    EXPECT_TRUE(lock && *lock);
    EXPECT_TRUE(gone);
  });
  while (!somebody_waits_for_a_lock()) std::this_thread::yield();
  gone = true;
  before->reset();
  next.join();
}

TEST(WebFile, IsWrittenByTheFirstGatewayOfAFolderAlone) {
  const testing_support::TemporaryFolder folder;
  auto first = lock_web_file(folder.path());
  ASSERT_TRUE(first);
  EXPECT_TRUE(static_cast<bool>(*first));
  const auto second = lock_web_file(folder.path());
  ASSERT_TRUE(second) << "it runs, and leaves the file as it is";
  EXPECT_FALSE(static_cast<bool>(*second));
  first->reset();
  EXPECT_TRUE(static_cast<bool>(*lock_web_file(folder.path()))) << "the first one has ended";
  EXPECT_FALSE(lock_web_file(folder.path() / "none"));
}

TEST(WebFile, WithShortTokensOrRubbishIsRefused) {
  const testing_support::TemporaryFolder folder;
  for (const char* text : {"", "[]", "{\"observe\":\"\",\"command\":\"\"}", "{\"observe\":1}"}) {
    std::ofstream(folder.path() / web_file) << text;
    EXPECT_FALSE(open_web_file(folder.path())) << text;
  }
}

TEST(Routes, AreThoseThatTheDescriptionLists) {
  const YAML::Node paths = YAML::LoadFile(SRFS_SOURCE_DIR "/ground/web/openapi.yaml")["paths"];
  std::set<std::string> described;
  for (const auto& path : paths) {
    auto text = path.first.as<std::string>();
    const std::size_t begin = text.find('{');
    if (begin != std::string::npos) text.replace(begin, text.find('}') - begin + 1, "{}");
    for (const auto& method : path.second) {
      auto name = method.first.as<std::string>();
      std::transform(name.begin(), name.end(), name.begin(),
                     [](char c) { return static_cast<char>(std::toupper(c)); });
      described.insert(name + " " + text);
    }
  }
  std::set<std::string> served;
  for (const Route& route : routes())
    served.insert(std::string(route.method) + " /" + std::string(route.path));
  EXPECT_EQ(described, served);
}

TEST(Routes, LetObserversReadAndCommandersOrder) {
  for (const Route& route : routes()) {
    EXPECT_EQ(route.role, route.method == "GET" ? Role::observer : Role::commander) << route.path;
    EXPECT_FALSE(route.token_in_query && route.method != "GET") << route.path;
  }
}

TEST(Routes, AreFoundByMethodAndPath) {
  const auto found = route_of("POST", *parse_target("/api/v1/transfers/1:17"));
  ASSERT_TRUE(std::holds_alternative<Found>(found));
  EXPECT_EQ(std::get<Found>(found).parameter, "1:17");
  EXPECT_EQ(std::get<Found>(found).route->endpoint, Endpoint::order_transfer);
  const auto wrong = route_of("DELETE", *parse_target("/api/v1/station"));
  ASSERT_TRUE(std::holds_alternative<WrongMethod>(wrong));
  EXPECT_EQ(std::get<WrongMethod>(wrong).allowed, "GET");
  for (const char* path : {"/api", "/api/v1", "/api/v1/", "/api/v2/station", "/api/v1/station/",
                           "/api/v1/files/", "/api/v1/files/a/b", "/api/v1/stations"})
    EXPECT_TRUE(std::holds_alternative<NotFound>(route_of("GET", *parse_target(path)))) << path;
}

}  // namespace
}  // namespace srfs::ground::api
