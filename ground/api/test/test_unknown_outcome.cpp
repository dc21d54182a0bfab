// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// A server that is killed while it carries out an order of the API.
#include <atomic>
#include <fstream>
#include <thread>

#include <gtest/gtest.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "ground/api/api.hpp"
#include "ground/test/fake_server.hpp"
#include "tests/mission_dictionary.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::ground::api {
namespace {

/// Takes the head of a response and what follows, then the connection breaks.
class BrokenAfterOneItem : public Transport {
 public:
  bool open(MonotonicTime) override { return true; }
  bool read(std::string&, MonotonicTime) override { return false; }
  bool write(std::string_view octets, MonotonicTime) override {
    written += octets;
    return ++writes_ == 1;
  }
  [[nodiscard]] bool has_gone() const override { return writes_ > 1; }
  std::string written;

 private:
  int writes_ = 0;
};

/// The API over a server that takes each order and ends before it answers; without an archive unless said.
class ApiOverAServerThatEnds : public ::testing::Test {
 protected:
  void SetUp() override {
    server_.emplace(folder_.path() / serve::socket_name,
                    [this](int, const nlohmann::json& message) -> std::optional<Messages> {
                      if (message["type"] == "hello")
                        return Messages{welcome(AdPhase::off, {}, 0, has_archive())};
                      ++taken_;
                      if (!ends_) return Messages{reply_to(message, {{"error", "the line is closed"}})};
                      return std::nullopt;
                    });
    auto gateway = Gateway::open(dictionary_, folder_.path(), folder_.path() / archive_name);
    ASSERT_TRUE(gateway) << gateway.error();
    gateway_ = std::move(*gateway);
    Api::Settings settings;
    settings.state_dir = folder_.path();
    settings.archive = folder_.path() / archive_name;
    api_.emplace(dictionary_, *gateway_, settings);
    running_ = std::thread([this] { static_cast<void>(gateway_->run(stop_.get())); });
  }
  void TearDown() override {
    const std::uint64_t one = 1;
    EXPECT_EQ(::write(stop_.get(), &one, sizeof one), static_cast<ssize_t>(sizeof one));
    if (running_.joinable()) running_.join();
  }
  [[nodiscard]] virtual bool has_archive() const { return false; }
  HttpResponse post(const std::string& path, const std::string& body, const std::string& key) {
    const auto target = parse_target("/api/v1/" + path);
    HttpRequest request;
    request.method = "POST";
    request.target = *target;
    request.idempotency_key = key;
    request.body = body;
    return api_->answer(request);
  }

  testing_support::TemporaryFolder folder_;
  const mission::Dictionary& dictionary_ = testing_support::dictionary();
  std::atomic<int> taken_{0};
  std::atomic<bool> ends_{true};
  Fd stop_{::eventfd(0, EFD_CLOEXEC)};
  std::optional<FakeServer> server_;
  std::unique_ptr<Gateway> gateway_;
  std::optional<Api> api_;
  std::thread running_;
};

constexpr const char* ping = R"({"name":"ttc.ping","arguments":{}})";

TEST_F(ApiOverAServerThatEnds, TelecommandThatMayHaveBeenSentIsNotSentAgainWithItsKey) {
  const HttpResponse first = post("telecommands", ping, "key-0001");
  const HttpResponse second = post("telecommands", ping, "key-0001");

  EXPECT_EQ(first.status, 504);
  EXPECT_EQ(nlohmann::json::parse(first.body)["outcome"], "unknown") << first.body;
  EXPECT_EQ(second.status, 504);
  EXPECT_EQ(second.body, first.body);
  EXPECT_EQ(second.headers.at("Idempotency-Replayed"), "true");
  EXPECT_EQ(taken_, 1) << "the server got it once";
  EXPECT_EQ(post("telecommands", ping, "key-0002").status, 504) << "another key is another order";
  EXPECT_EQ(taken_, 2);
}

TEST_F(ApiOverAServerThatEnds, FileThatMayGoUpIsNotSentAgainWithItsKey) {
  const HttpResponse first = post("uplink?name=a.bin", "octets", "key-0001");
  const HttpResponse second = post("uplink?name=a.bin", "octets", "key-0001");

  EXPECT_EQ(first.status, 504);
  EXPECT_EQ(nlohmann::json::parse(first.body)["outcome"], "unknown") << first.body;
  EXPECT_EQ(second.body, first.body);
  EXPECT_EQ(taken_, 1);
}

TEST_F(ApiOverAServerThatEnds, OrderThatWasRefusedMayBeTriedAgain) {
  ends_ = false;
  const HttpResponse first = post("telecommands", ping, "key-0001");
  const HttpResponse second = post("telecommands", ping, "key-0001");

  EXPECT_EQ(first.status, 409);
  EXPECT_FALSE(nlohmann::json::parse(first.body).contains("outcome"));
  EXPECT_EQ(second.status, 409);
  EXPECT_EQ(taken_, 2);
}

class ApiOverADamagedArchive : public ApiOverAServerThatEnds {
 protected:
  void SetUp() override {
    std::ofstream(folder_.path() / archive_name) << std::string(8192, 'x');
    ApiOverAServerThatEnds::SetUp();
  }
  [[nodiscard]] bool has_archive() const override { return true; }
};

TEST_F(ApiOverADamagedArchive, StreamSaysThatWhatCameBeforeIsMissing) {
  HttpRequest request;
  request.method = "GET";
  request.target = *parse_target("/api/v1/stream?after=7");
  BrokenAfterOneItem transport;
  EXPECT_TRUE(api_->stream(request, transport));
  EXPECT_NE(transport.written.find("event: note\ndata: {\"message\":\"the archive cannot be read: "),
            std::string::npos)
      << transport.written;
}

}  // namespace
}  // namespace srfs::ground::api
