// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/api/order_journal.hpp"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/file.hpp"
#include "ground/api/answered_orders.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::ground::api {
namespace {

using ::testing::HasSubstr;

constexpr milliseconds none{0};
const HttpResponse sent = json_response(202, {{"id", "1:7"}});

class Journal : public ::testing::Test {
 protected:
  OrderJournal open(std::size_t orders_max = 100) const {
    return OrderJournal::open(file_, orders_max).value();
  }
  testing_support::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_.path() / "web_orders";
};

TEST_F(Journal, KnowsWhatTheLastGatewayBeganAndHowItEnded) {
  {
    auto journal = open();
    ASSERT_TRUE(journal.begin("key-0001", "ping"));
    ASSERT_TRUE(journal.end("key-0001", sent));
    ASSERT_TRUE(journal.begin("key-0002", "put"));
    ASSERT_TRUE(journal.begin("key-0003", "put"));
    ASSERT_TRUE(journal.end("key-0003", std::nullopt));
  }

  const auto orders = open().orders();

  ASSERT_EQ(orders.size(), 2U) << "the third one was refused";
  EXPECT_EQ(orders[0].key, "key-0001");
  EXPECT_EQ(orders[0].digest, "ping");
  ASSERT_TRUE(orders[0].answer);
  EXPECT_EQ(orders[0].answer->status, 202);
  EXPECT_EQ(orders[0].answer->body, sent.body);
  EXPECT_EQ(orders[1].key, "key-0002");
  EXPECT_FALSE(orders[1].answer);
}

TEST_F(Journal, IsReadAfterACutAnywhere) {
  {
    auto journal = open();
    for (const char* key : {"key-0001", "key-0002"}) {
      ASSERT_TRUE(journal.begin(key, "ping"));
      ASSERT_TRUE(journal.end(key, sent));
    }
  }
  const std::string whole = *read_file(file_);
  for (std::size_t size = 0; size <= whole.size(); size += 5) {
    std::ofstream(file_, std::ios::trunc) << whole.substr(0, size);
    auto journal = open();
    const auto orders = journal.orders();
    EXPECT_LE(orders.size(), 2U);
    ASSERT_TRUE(journal.begin("key-0003", "put")) << size;
    EXPECT_EQ(journal.orders().size(), orders.size() + 1) << size;
  }
}

TEST_F(Journal, GoesOnBehindALineThatWasCut) {
  auto journal = open();
  std::ofstream(file_, std::ios::app) << R"({"key":"key-0001","dig)";  // as when the disk was full
  ASSERT_TRUE(journal.begin("key-0002", "ping"));
  ASSERT_EQ(journal.orders().size(), 1U);
  EXPECT_EQ(journal.orders()[0].key, "key-0002");
}

TEST_F(Journal, HasBounds) {
  auto journal = open(10);
  const HttpResponse long_one = json_response(202, {{"id", std::string(10'000, 'x')}});
  for (int i = 0; i < 300; ++i) {
    const std::string key = "key-" + std::to_string(10'000 + i);
    ASSERT_TRUE(journal.begin(key, "ping"));
    ASSERT_TRUE(journal.end(key, long_one));
  }
  EXPECT_LE(std::filesystem::file_size(file_), OrderJournal::octets_max + 20'000);
  const auto orders = journal.orders();
  ASSERT_EQ(orders.size(), 10U);
  EXPECT_EQ(orders.back().key, "key-10299");
}

TEST_F(Journal, MakesOrdersOfAnEarlierGatewayKnown) {
  {
    AnsweredOrders orders(open());
    ASSERT_FALSE(orders.begin("key-0001", "ping", none));
    orders.end("key-0001", sent);
    ASSERT_FALSE(orders.begin("key-0002", "put", none)) << "and then this gateway is killed";
    ASSERT_FALSE(orders.begin("key-0003", "put", none));
    orders.end("key-0003", error_response(503, "the line is closed"));
    ASSERT_FALSE(orders.begin("key-0004", "put", none, false)) << "the archive knows this one";
  }
  AnsweredOrders orders(open());

  const auto done = orders.begin("key-0001", "ping", none);
  ASSERT_TRUE(done);
  EXPECT_EQ(done->status, 202);
  EXPECT_EQ(done->body, sent.body);
  const auto not_ended = orders.begin("key-0002", "put", none);
  ASSERT_TRUE(not_ended);
  EXPECT_EQ(not_ended->status, unknown_outcome);
  EXPECT_THAT(not_ended->body, HasSubstr("not known whether it was carried out"));
  EXPECT_EQ(orders.begin("key-0002", "ping", none)->status, 422) << "another request with its key";
  EXPECT_FALSE(orders.begin("key-0003", "put", none)) << "it was refused";
  EXPECT_FALSE(orders.begin("key-0004", "put", none));
}

TEST_F(Journal, ThatCannotBeWrittenStopsNoOrder) {
  std::filesystem::create_directories(file_);
  EXPECT_FALSE(OrderJournal::open(file_, 10));
}

}  // namespace
}  // namespace srfs::ground::api
