// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "ros/serialized.hpp"
#include "ros/topic_directory.hpp"

namespace srfs::ros {
namespace {

Gid endpoint(std::uint8_t participant, std::uint8_t number) {
  Gid gid{};
  gid[0] = participant;
  gid[15] = number;
  return gid;
}

TEST(TopicDirectory, CountsTheEndsOfEachTopicAndType) {
  TopicDirectory directory;
  directory.add(endpoint(1, 1), true, "rt/a", "A", {});
  directory.add(endpoint(2, 1), false, "rt/a", "A", {});
  directory.add(endpoint(2, 2), false, "rt/a", "A", {});
  directory.add(endpoint(2, 3), true, "rt/a", "B", {});
  const auto topics = directory.topics();
  ASSERT_EQ(topics.size(), 2U);
  EXPECT_EQ(topics[0].type, "A");
  EXPECT_EQ(topics[0].publishers, 1U);
  EXPECT_EQ(topics[0].subscriptions, 2U);
  EXPECT_EQ(topics[1].type, "B");
  EXPECT_EQ(topics[1].subscriptions, 0U);
}

TEST(TopicDirectory, StatesTheQosThatHearsAllPublishers) {
  TopicDirectory directory;
  directory.add(endpoint(1, 1), true, "rt/a", "A", {.transient_local = true});
  EXPECT_TRUE(directory.topics()[0].transient_local);
  EXPECT_FALSE(directory.topics()[0].best_effort);
  directory.add(endpoint(1, 2), true, "rt/a", "A", {.best_effort = true});
  EXPECT_FALSE(directory.topics()[0].transient_local);
  EXPECT_TRUE(directory.topics()[0].best_effort);
  directory.add(endpoint(1, 3), false, "rt/a", "A", {.transient_local = true});
  EXPECT_FALSE(directory.topics()[0].transient_local);
}

TEST(TopicDirectory, WhatHasGoneIsForgotten) {
  TopicDirectory directory;
  directory.add(endpoint(1, 1), true, "rt/a", "A", {});
  directory.add(endpoint(1, 2), true, "rt/b", "A", {});
  directory.add(endpoint(2, 1), true, "rt/b", "A", {});
  directory.remove(endpoint(1, 1));
  ASSERT_EQ(directory.topics().size(), 1U);
  directory.remove_all_of({1});
  EXPECT_EQ(directory.topics()[0].publishers, 1U);
}

TEST(TopicDirectory, RemembersSoManyAndCountsTheOthers) {
  TopicDirectory directory;
  for (std::size_t i = 0; i < TopicDirectory::most + 3; ++i) {
    Gid gid{};
    gid[0] = static_cast<std::uint8_t>(i);
    gid[1] = static_cast<std::uint8_t>(i >> 8);
    directory.add(gid, true, "rt/a", "A", {});
  }
  EXPECT_EQ(directory.topics()[0].publishers, TopicDirectory::most);
  EXPECT_EQ(directory.forgotten(), 3U);
}

TEST(TypeNames, AreThoseOfRmwFastrtpsInBothDirections) {
  EXPECT_EQ(dds_type_name("std_msgs/msg/String"), "std_msgs::msg::dds_::String_");
  EXPECT_EQ(ros_type_name("std_msgs::msg::dds_::String_"), "std_msgs/msg/String");
  EXPECT_EQ(ros_type_name("a::action::dds_::Fib_FeedbackMessage_"), "a/action/Fib_FeedbackMessage");
  for (const char* none :
       {"", "String", "std_msgs/String", "/msg/String", "std_msgs/msg/", "std_msgs//String", "a/b/c/D"})
    EXPECT_EQ(dds_type_name(none), "") << none;
  for (const char* none :
       {"", "String_", "dds_::String_", "std_msgs::dds_::String_", "std_msgs::msg::dds_::String",
        "std_msgs::msg::dds_::_", "::msg::dds_::A_", "a::b::c::dds_::A_"})
    EXPECT_EQ(ros_type_name(none), "") << none;
}

}  // namespace
}  // namespace srfs::ros
