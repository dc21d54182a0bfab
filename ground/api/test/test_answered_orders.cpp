// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/api/answered_orders.hpp"

#include <thread>

#include <gtest/gtest.h>

namespace srfs::ground::api {
namespace {

constexpr milliseconds none{0};
const HttpResponse sent = json_response(202, {{"id", "1811c000"}});

TEST(AnsweredOrder, IsAnsweredAgainAndCarriedOutOnce) {
  AnsweredOrders orders;
  EXPECT_FALSE(orders.begin("key-0001", "ping", none)) << "the first time it is carried out";
  orders.end("key-0001", sent);

  const auto again = orders.begin("key-0001", "ping", none);

  ASSERT_TRUE(again);
  EXPECT_EQ(again->body, sent.body);
  EXPECT_EQ(again->status, 202);
  EXPECT_EQ(again->headers.at("Idempotency-Replayed"), "true");
  EXPECT_FALSE(orders.begin("key-0002", "ping", none)) << "another key is another order";
}

TEST(AnsweredOrder, OfAnotherRequestWithItsKeyIsRefused) {
  AnsweredOrders orders;
  ASSERT_FALSE(orders.begin("key-0001", "ping", none));
  EXPECT_EQ(orders.begin("key-0001", "eps.switch_load", none)->status, 422) << "while the first one runs";
  orders.end("key-0001", sent);
  EXPECT_EQ(orders.begin("key-0001", "eps.switch_load", none)->status, 422);
}

TEST(AnsweredOrder, ThatWasRefusedMayBeTriedAgain) {
  AnsweredOrders orders;
  ASSERT_FALSE(orders.begin("key-0001", "ping", none));
  orders.end("key-0001", error_response(503, "the line is closed"));
  EXPECT_FALSE(orders.begin("key-0001", "ping", none));
}

TEST(AnsweredOrder, OfUnknownOutcomeIsNotCarriedOutAgain) {
  AnsweredOrders orders;
  ASSERT_FALSE(orders.begin("key-0001", "ping", none));
  orders.end("key-0001", unknown_response("the server ended before it answered"));

  const auto again = orders.begin("key-0001", "ping", none);

  ASSERT_TRUE(again);
  EXPECT_EQ(again->status, unknown_outcome);
  EXPECT_EQ(nlohmann::json::parse(again->body)["outcome"], "unknown");
}

TEST(AnsweredOrder, ThatIsStillCarriedOutIsWaitedFor) {
  AnsweredOrders orders;
  ASSERT_FALSE(orders.begin("key-0001", "ping", none));
  EXPECT_EQ(orders.begin("key-0001", "ping", none)->status, 409) << "it has not ended yet";
  std::optional<HttpResponse> second;
  std::thread repeats([&] { second = orders.begin("key-0001", "ping", seconds(60)); });
  orders.end("key-0001", sent);
  repeats.join();
  ASSERT_TRUE(second);
  EXPECT_EQ(second->body, sent.body);
}

TEST(AnsweredOrder, IsForgottenWhenManyNewerOnesWereCarriedOut) {
  AnsweredOrders orders;
  const auto key = [](std::size_t number) { return "key-" + std::to_string(1'000'000 + number); };
  for (std::size_t i = 0; i <= AnsweredOrders::kept_max; ++i) {
    ASSERT_FALSE(orders.begin(key(i), "ping", none));
    orders.end(key(i), sent);
  }
  EXPECT_FALSE(orders.begin(key(0), "ping", none)) << "the oldest one";
  EXPECT_TRUE(orders.begin(key(1), "ping", none));
  EXPECT_TRUE(orders.begin(key(AnsweredOrders::kept_max), "ping", none));
}

TEST(AnsweredOrder, HasAKeyOfLettersAndDigits) {
  EXPECT_TRUE(AnsweredOrders::is_key("2b1f6f9e-0f57-4c5b-8d3a-6a1f0e1d2c3b"));
  for (const std::string& wrong : {std::string("short"), std::string(65, 'a'), std::string("a b c d e f"),
                                   std::string("12345678'"), std::string("12345678\n")})
    EXPECT_FALSE(AnsweredOrders::is_key(wrong)) << wrong;
}

}  // namespace
}  // namespace srfs::ground::api
