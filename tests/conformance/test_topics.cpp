// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// /rosout, and a workstation that publishes on a topic of the flight software.

#include "tests/conformance/node_process.hpp"

namespace srfs::conformance {
namespace {

class Topics : public ConformanceTest {
 protected:
  std::unique_ptr<RawReader> rosout() {
    return std::make_unique<RawReader>(peer_, "rt/rosout", "rcl_interfaces::msg::dds_::Log_", true);
  }
  void change(const std::string& label) {
    RawClient client(peer_, "/probe/change_state", "lifecycle_msgs::srv::dds_::ChangeState");
    EXPECT_FALSE(client.call(Cdr().u8(0).str(label).payload()).empty());
  }
};

/// rcl_interfaces/msg/Log without its stamp, decoded by the test.
struct LogLine {
  std::uint8_t level = 0;
  std::string name;
  std::string text;
};

LogLine read_log(const Octets& payload) {
  CdrView view(payload);
  EXPECT_GT(view.u32(), 1'700'000'000U) << "seconds";
  EXPECT_LT(view.u32(), 1'000'000'000U) << "nanoseconds";
  LogLine line;
  line.level = view.u8();
  line.name = view.str();
  line.text = view.str();
  (void)view.str();  // file
  (void)view.str();  // function
  (void)view.u32();  // line
  EXPECT_TRUE(view.at_end());
  return line;
}

TEST_F(Topics, LogLinesGoToRosoutWithLevelAndName) {
  const auto reader = rosout();
  ASSERT_TRUE(wait_for([&] { return reader->matched() == 1; }));
  change("configure");
  const auto sample = reader->next(
      [](const ReceivedSample& s) { return read_log(s.payload).text.find("inactive") != std::string::npos; });
  ASSERT_TRUE(sample);
  EXPECT_EQ(read_log(sample->payload).level, 20) << "Log.INFO";
  EXPECT_EQ(read_log(sample->payload).name, "probe");
  change("cleanup");
}

TEST_F(Topics, WhoComesLaterStillGetsTheLastLines) {
  change("activate");  // refused, with a warning
  const auto reader = rosout();
  const auto sample = reader->next(
      [](const ReceivedSample& s) { return read_log(s.payload).text.find("activate") != std::string::npos; });
  ASSERT_TRUE(sample);
  EXPECT_EQ(read_log(sample->payload).level, 30) << "Log.WARN";
}

TEST_F(Topics, AWorkstationThatPublishesOnAFlightTopicIsReported) {
  RawReader events(peer_, "rt/event", "srfs_msgs::msg::dds_::Event_");
  RawWriter flags(peer_, "rt/can/task_flags", "srfs_msgs::msg::dds_::TaskFlags_");
  ASSERT_TRUE(wait_for([&] { return events.matched() == 1 && flags.matched() == 1; }));
  // `ros2 topic pub /can/task_flags srfs_msgs/msg/TaskFlags`: all fields zero, but well-formed.
  flags.write(Cdr().u64(0).u32(0).u32(0).u32(0).str("").u64(0).u64(0).u32(0).u64(0).payload());
  std::string text;
  const auto event = events.next([&](const ReceivedSample& s) {
    CdrView view(s.payload);
    if (view.str() != "probe" || view.u16() != 11) return false;
    text.assign(s.payload.begin(), s.payload.end());
    return true;
  });
  ASSERT_TRUE(event) << "node.foreign_samples of the mission dictionary";
  EXPECT_NE(text.find("/can/task_flags"), std::string::npos);
  EXPECT_NE(text.find("'/' at 127.0.0.1"), std::string::npos);
}

}  // namespace
}  // namespace srfs::conformance
