// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/api/http.hpp"

#include <chrono>
#include <filesystem>
#include <fstream>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ground/api/web_files.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::ground::api {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// Reads one request whose body is admitted.
Result<HttpRequest, HttpRefusal> read(std::string text) {
  RequestReader reader;
  auto state = reader.take(text);
  if (state && *state == RequestReader::State::admitted) {
    reader.admit_body();
    state = reader.take(text);
  }
  if (!state) return Err(state.error());
  if (*state != RequestReader::State::complete) return Err(HttpRefusal{0, "not complete"});
  return std::move(reader.request());
}

int refused(const std::string& text) {
  const auto request = read(text);
  return request ? 200 : request.error().status;
}

TEST(TargetOfARequest, IsDecodedOnceAndKeepsItsParts) {
  const auto target = parse_target("/api/v1/files/a%20b%2525?from=10m&text=a%3Db+c&empty=&from=20m");
  ASSERT_TRUE(target);
  EXPECT_THAT(target->segments, ElementsAre("api", "v1", "files", "a b%25"));
  EXPECT_EQ(target->query.at("from"), "20m");
  EXPECT_EQ(target->query.at("text"), "a=b c");
  EXPECT_EQ(target->query.at("empty"), "");
  EXPECT_THAT(parse_target("/")->segments, ElementsAre(""));
}

TEST(TargetOfARequest, LeadsNowhereElse) {
  for (const char* text : {"", "api", "/..", "/a/../b", "/%2e%2e/x", "/a//b", "/a/./b", "/a%2fb", "/a%5cb",
                           "/a%00", "/a%0d%0a", "/%", "/%4", "/%zz", "/a?b=%0a", "/\x7f"})
    EXPECT_FALSE(parse_target(text)) << text;
}

TEST(RequestReader, TakesARequestOctetByOctetAndKeepsTheNext) {
  const std::string text =
      "POST /api/v1/telecommands?x=1 HTTP/1.1\r\nHost: 127.0.0.1:8190\r\nOrigin: http://127.0.0.1:8190\r\n"
      "Authorization: Bearer abc\r\nLast-Event-ID: 7\r\nContent-Length: 5\r\n\r\nhello";
  RequestReader reader;
  std::string input;
  auto state = RequestReader::State::head;
  for (const char c : text + "GET") {
    input += c;
    if (state == RequestReader::State::complete) continue;
    const auto taken = reader.take(input);
    ASSERT_TRUE(taken) << taken.error().why;
    state = *taken;
    if (state == RequestReader::State::admitted) reader.admit_body();
  }
  ASSERT_EQ(state, RequestReader::State::complete);
  const HttpRequest& request = reader.request();
  EXPECT_EQ(request.method, "POST");
  EXPECT_EQ(request.host, "127.0.0.1:8190");
  EXPECT_EQ(request.origin, "http://127.0.0.1:8190");
  EXPECT_EQ(request.authorization, "Bearer abc");
  EXPECT_EQ(request.last_event_id, "7");
  EXPECT_EQ(request.body, "hello");
  EXPECT_TRUE(request.keep_alive);
  EXPECT_EQ(input, "GET");
}

TEST(RequestReader, WaitsForAdmissionBeforeTheBody) {
  RequestReader reader;
  std::string input = "POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 3\r\n\r\nabc";
  const auto state = reader.take(input);
  ASSERT_TRUE(state);
  EXPECT_EQ(*state, RequestReader::State::admitted);
  EXPECT_EQ(reader.request().content_octets, 3U);
  EXPECT_EQ(input, "abc");
}

TEST(RequestReader, RefusesWhatItDoesNotBound) {
  EXPECT_EQ(refused("GET / HTTP/1.1\r\nHost: a\r\n\r\n"), 200);
  EXPECT_EQ(refused("POST / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n"), 411);
  EXPECT_EQ(refused("POST / HTTP/1.1\r\nHost: a\r\nContent-Encoding: gzip\r\nContent-Length: 1\r\n\r\nx"),
            415);
  EXPECT_EQ(refused("POST / HTTP/1.1\r\nHost: a\r\nExpect: 100-continue\r\nContent-Length: 1\r\n\r\nx"), 417);
  EXPECT_EQ(refused("GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n"), 400);
  EXPECT_EQ(refused("GET / HTTP/1.1\r\nHost: a\r\nAuthorization: x\r\nAuthorization: y\r\n\r\n"), 400);
  EXPECT_EQ(refused("POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 99999999999\r\n\r\n"), 413);
  EXPECT_EQ(refused("POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\nx"), 400);
  EXPECT_EQ(refused("GET /.. HTTP/1.1\r\nHost: a\r\n\r\n"), 400);
  EXPECT_EQ(refused("GET / HTTP/9.9\r\nHost: a\r\n\r\n"), 400);
  EXPECT_EQ(refused("GET / HTTP/1.1\r\nHost: a\r\nX: " + std::string(20'000, 'x') + "\r\n\r\n"), 431);
  EXPECT_EQ(refused("GET /" + std::string(20'000, 'x') + " HTTP/1.1\r\nHost: a\r\n\r\n"), 431);
  std::string many = "GET / HTTP/1.1\r\nHost: a\r\n";
  for (int i = 0; i < 5000; ++i) many += "X: y\r\n";
  EXPECT_EQ(refused(many + "\r\n"), 431);
  EXPECT_EQ(refused("\x16\x03\x01 not http\r\n\r\n"), 400);
}

TEST(RequestReader, TakesAnythingWithoutHarm) {
  std::mt19937 random(1);
  const std::string good =
      "POST /api/v1/keys?token=x HTTP/1.1\r\nHost: 127.0.0.1:1\r\nContent-Length: 12\r\n\r\n{\"keys\":\"a\"}";
  std::uniform_int_distribution<int> octet(0, 255);
  for (int round = 0; round < 20'000; ++round) {
    std::string text = good;
    const int changes = 1 + static_cast<int>(random() % 4);
    for (int i = 0; i < changes; ++i) text[random() % text.size()] = static_cast<char>(octet(random));
    RequestReader reader;
    for (std::size_t begin = 0; begin < text.size();) {
      const std::size_t part = 1 + random() % text.size();
      std::string input = text.substr(begin, part);
      begin += part;
      const auto state = reader.take(input);
      if (!state || *state == RequestReader::State::complete) break;
      if (*state == RequestReader::State::admitted) reader.admit_body();
    }
  }
}

TEST(Response, ProtectsTheBrowserAndStatesItsLength) {
  const std::string head = head_of(error_response(404, "no \"such\" file"), 30, true);
  EXPECT_THAT(head, HasSubstr("HTTP/1.1 404 Not Found\r\n"));
  for (const char* field : {"X-Content-Type-Options: nosniff\r\n", "Referrer-Policy: no-referrer\r\n",
                            "default-src 'self'", "frame-ancestors 'none'", "Cache-Control: no-store\r\n",
                            "Content-Length: 30\r\n", "Connection: keep-alive\r\n"})
    EXPECT_THAT(head, HasSubstr(field));
  EXPECT_EQ(error_response(404, "no \"such\" file").body, "{\"error\":\"no \\\"such\\\" file\"}\n");
  EXPECT_THAT(json_response(200, {{"text", "a\xff\xe2\x80\xae"}}).body, HasSubstr("\\ufffd\\u202e"));
}

TEST(ReceivedFiles, AreListedTheNewestFirstAndCutAtTheOldest) {
  const testing_support::TemporaryFolder folder;
  const auto now = std::filesystem::file_time_type::clock::now();
  for (int age = 0; age < 7; ++age) {
    const auto file = folder.path() / ("file_" + std::to_string(age * 5 % 7));
    std::ofstream(file) << age;
    std::filesystem::last_write_time(file, now - std::chrono::minutes(age));
  }
  const auto list = list_files(folder.path(), 3);
  ASSERT_EQ(list.size(), 3U);
  EXPECT_EQ(list[0]["name"], "file_0");
  EXPECT_EQ(list[1]["name"], "file_5");
  EXPECT_EQ(list[2]["name"], "file_3");
  EXPECT_EQ(list_files(folder.path()).size(), 7U);
}

}  // namespace
}  // namespace srfs::ground::api
