// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/api/stream_hub.hpp"

#include <gtest/gtest.h>

namespace srfs::ground::api {
namespace {

std::vector<StreamItem> taken(StreamHub::Reader& reader) {
  std::vector<StreamItem> items;
  EXPECT_TRUE(reader.wait(milliseconds(0), items));
  return items;
}

TEST(StreamItem, IsAServerSentEventOfOneLine) {
  const auto item = stream_item(7, {{"type", "event"}, {"text", "a\nb\xe2\x80\xa8"}});
  EXPECT_EQ(*item.text, "id: 7\nevent: event\ndata: {\"text\":\"a\\nb\\u2028\",\"type\":\"event\"}\n\n");
  EXPECT_EQ(*stream_item(0, {{"type", "cop"}}).text, "event: cop\ndata: {\"type\":\"cop\"}\n\n");
}

TEST(StreamHub, GivesEverythingToEachReaderInOrder) {
  StreamHub hub;
  const auto first = hub.subscribe();
  const auto second = hub.subscribe();
  hub.publish(stream_item(1, {{"type", "event"}}));
  EXPECT_EQ(taken(*first).size(), 1U);
  hub.publish(stream_item(2, {{"type", "event"}}));
  hub.unsubscribe(first);
  hub.publish(stream_item(3, {{"type", "event"}}));
  const auto items = taken(*second);
  ASSERT_EQ(items.size(), 3U);
  EXPECT_EQ(items[0].id, 1);
  EXPECT_EQ(items[2].id, 3);
  EXPECT_EQ(taken(*first).size(), 1U) << "what came before it left";
}

TEST(StreamHub, EndsAReaderThatIsTooSlowAndNoOther) {
  StreamHub hub;
  const auto slow = hub.subscribe();
  const auto quick = hub.subscribe();
  const auto item = stream_item(1, {{"type", "event"}, {"text", std::string(100'000, 'x')}});
  for (std::size_t octets = 0; octets <= StreamHub::queue_octets_max; octets += item.text->size()) {
    hub.publish(item);
    EXPECT_EQ(taken(*quick).size(), 1U);
  }
  std::vector<StreamItem> items;
  EXPECT_FALSE(slow->wait(milliseconds(0), items));
  EXPECT_EQ(hub.readers(), 1U);
  EXPECT_EQ(hub.overflows(), 1U);
}

TEST(StreamHub, HasPlacesForSoManyReadersAndNoneAfterItsEnd) {
  StreamHub hub;
  std::vector<std::shared_ptr<StreamHub::Reader>> readers;
  for (std::size_t i = 0; i < StreamHub::readers_max; ++i) readers.push_back(hub.subscribe());
  EXPECT_EQ(hub.subscribe(), nullptr);
  hub.unsubscribe(readers.front());
  EXPECT_NE(hub.subscribe(), nullptr);
  hub.close();
  std::vector<StreamItem> items;
  EXPECT_FALSE(readers.back()->wait(milliseconds(0), items));
  EXPECT_EQ(hub.subscribe(), nullptr);
}

}  // namespace
}  // namespace srfs::ground::api
