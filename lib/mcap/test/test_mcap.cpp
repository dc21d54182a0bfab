// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Writer against reader. A reader that shares nothing with them, written from the specification, is in
// tests/system/mcap_file.py.
#include <gtest/gtest.h>

#include <random>
#include <sstream>

#include "mcap/mcap_reader.hpp"
#include "mcap/mcap_writer.hpp"

namespace srfs::mcap {
namespace {

/// A recording of three chunks on two channels.
class McapTest : public testing::Test {
 protected:
  void SetUp() override {
    append(writer_.begin("ros2"));
    const auto schema = writer_.add_schema({"std_msgs/msg/String", "ros2msg", "string data\n"});
    a_ = writer_.add_channel({*schema, "/a", "cdr", {{"offered_qos_profiles", ""}}}).value();
    b_ = writer_.add_channel({0, "/b", "cdr", {}}).value();
    for (int chunk = 0; chunk < 3; ++chunk) {
      for (int i = 0; i < 20; ++i) write(i % 3 == 0 ? b_ : a_, static_cast<std::size_t>(random_() % 300));
      append(writer_.end_chunk());
      chunk_ends_.push_back(file_.size());
    }
    append(writer_.finish());
  }
  void write(std::uint16_t channel, std::size_t octets) {
    const auto n = static_cast<std::uint32_t>(messages_.size());
    messages_.push_back({channel, n, 1000 + n, 900 + n, Octets(octets, static_cast<std::uint8_t>(n))});
    const Message& m = messages_.back();
    writer_.add(m.channel, m.sequence, m.log_time, m.publish_time, m.data);
  }
  void append(const Octets& octets) { file_.append(octets.begin(), octets.end()); }
  struct Read {
    std::vector<Message> messages;
    std::string error;
    bool is_whole = false;
    std::map<std::uint16_t, Channel> channels;
    std::map<std::uint16_t, Schema> schemas;
  };
  static Read read(const std::string& octets) {
    std::istringstream file(octets);
    Reader reader(file);
    Read found;
    while (true) {
      auto message = reader.next();
      if (!message) found.error = message.error();
      if (!message || !*message) break;
      found.messages.push_back(std::move(**message));
    }
    found.is_whole = reader.is_whole();
    found.channels = reader.channels();
    found.schemas = reader.schemas();
    return found;
  }
  void expect_first(const std::vector<Message>& found, std::size_t count) const {
    ASSERT_EQ(found.size(), count);
    for (std::size_t i = 0; i < count; ++i) {
      EXPECT_EQ(found[i].channel, messages_[i].channel);
      EXPECT_EQ(found[i].sequence, messages_[i].sequence);
      EXPECT_EQ(found[i].log_time, messages_[i].log_time);
      EXPECT_EQ(found[i].publish_time, messages_[i].publish_time);
      EXPECT_EQ(found[i].data, messages_[i].data);
    }
  }
  std::mt19937 random_{20261126};
  Writer writer_;
  std::string file_;
  std::vector<std::size_t> chunk_ends_;
  std::vector<Message> messages_;
  std::uint16_t a_ = 0;
  std::uint16_t b_ = 0;
};

TEST_F(McapTest, WhatWasWrittenIsReadInItsOrder) {
  EXPECT_EQ(file_.size(), writer_.size());
  const Read found = read(file_);
  EXPECT_EQ(found.error, "");
  EXPECT_TRUE(found.is_whole);
  expect_first(found.messages, 60);
  EXPECT_EQ(found.channels.at(a_).topic, "/a");
  EXPECT_EQ(found.channels.at(b_).schema, 0);
  EXPECT_EQ(found.schemas.at(found.channels.at(a_).schema).data, "string data\n");
}

TEST_F(McapTest, AFileThatEndsAnywhereHasTheChunksThatItHasWhole) {
  for (std::size_t octets = magic.size(); octets < file_.size(); ++octets) {
    const Read found = read(file_.substr(0, octets));
    EXPECT_EQ(found.error, "") << octets;
    std::size_t chunks = 0;
    for (const std::size_t end : chunk_ends_) chunks += end <= octets ? 1U : 0U;
    EXPECT_GE(found.messages.size(), 20 * chunks) << octets;
    EXPECT_LE(found.messages.size(), 20 * (chunks + 1)) << "the next, whose index is not whole: " << octets;
    expect_first(found.messages, found.messages.size() / 20 * 20);
  }
}

TEST_F(McapTest, ADamagedFileIsReportedOrReadAndNothingWorse) {
  for (int i = 0; i < 2000; ++i) {
    std::string damaged = file_;
    for (std::size_t n = 1 + random_() % 3; n > 0; --n)
      damaged[random_() % damaged.size()] = static_cast<char>(random_());
    EXPECT_LE(read(damaged).messages.size(), 60U);
  }
}

TEST_F(McapTest, AnotherFileIsNone) {
  EXPECT_NE(read("").error.find("no MCAP file"), std::string::npos);
  EXPECT_NE(read("SQLite format 3 and more").error.find("no MCAP file"), std::string::npos);
}

TEST(McapWriter, EqualSchemasAndChannelsHaveOneNumber) {
  Writer writer;
  (void)writer.begin("ros2");
  EXPECT_EQ(writer.add_schema({"a/msg/A", "", ""}), 1);
  EXPECT_EQ(writer.add_schema({"a/msg/B", "", ""}), 2);
  EXPECT_EQ(writer.add_schema({"a/msg/A", "", ""}), 1);
  EXPECT_EQ(writer.add_channel({1, "/a", "cdr", {}}), 0);
  EXPECT_EQ(writer.add_channel({2, "/a", "cdr", {}}), 1);
  EXPECT_EQ(writer.add_channel({1, "/a", "cdr", {}}), 0);
}

TEST(McapWriter, ARecordingOfNothingIsAWholeFile) {
  Writer writer;
  std::string file;
  for (const Octets& part : {writer.begin("ros2"), writer.end_chunk(), writer.finish()})
    file.append(part.begin(), part.end());
  std::istringstream stream(file);
  Reader reader(stream);
  const auto message = reader.next();
  ASSERT_TRUE(message);
  EXPECT_FALSE(*message);
  EXPECT_TRUE(reader.is_whole());
}

}  // namespace
}  // namespace srfs::mcap
