// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/parameter_service.hpp"
#include "tests/mission_dictionary.hpp"

#include <gmock/gmock.h>

#include <mission/structures.hpp>

namespace srfs {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

constexpr MonotonicTime start(seconds(100));

class ParameterServiceTest : public testing::Test {
 protected:
  void submit(const std::string& command, const Octets& data, MonotonicTime now = start) {
    TelecommandOrigin origin{.apid = 1, .ack_flags = wire::ack::all, .source_id = 7};
    origin.request.packet_sequence_control = ++number_;
    const mission::Command& known = *dictionary_.command(command);
    ASSERT_TRUE(dictionary_.check_arguments(known, data));
    service_.execute({.origin = origin, .command = &known, .arguments = data}, now);
  }
  void ask(const std::vector<std::string>& names, MonotonicTime now = start) {
    OctetWriter data;
    data.u16(static_cast<std::uint16_t>(names.size()));
    for (const std::string& name : names) data.u16(id(name));
    submit("parameters.report", data.take(), now);
  }
  void set(const std::vector<std::pair<std::string, std::string>>& values) {
    OctetWriter data;
    data.u16(static_cast<std::uint16_t>(values.size()));
    for (const auto& [name, value] : values) {
      const auto one = dictionary_.encode("parameters.set", {"parameter=" + name, "value=" + value});
      ASSERT_TRUE(one) << one.error().message;
      data.bytes(OctetView(one->data).subspan(2));
    }
    submit("parameters.set", data.take());
  }
  [[nodiscard]] std::uint16_t id(const std::string& name) const { return dictionary_.parameter(name)->id; }
  /// Like the function in test_file_service.cpp, but a value also has its octets.
  std::vector<std::string> reports() {
    std::vector<std::string> texts;
    for (const Report& report : report_queue_.take()) {
      OctetReader in(report.data);
      if (report.service == 20) {
        EXPECT_EQ(report.destination_id, 7);
        texts.push_back("20,2 " + to_hex(report.data));
        continue;
      }
      static_cast<void>(in.u16());
      const unsigned number = in.u16();
      std::string text = std::to_string(number) + ":1," + std::to_string(report.subtype);
      if (report.subtype % 2 == 0) {
        const unsigned code = in.u16();
        text += "=" + std::to_string(code) + " " + to_hex(in.rest());
      }
      texts.push_back(text);
    }
    return texts;
  }
  ParameterCall next() {
    const auto call = service_.next_call(start);
    EXPECT_TRUE(call);
    return call.value_or(ParameterCall{});
  }

  const mission::Dictionary& dictionary_ = testing_support::dictionary();
  ReportQueue report_queue_;
  ParameterService service_{dictionary_, report_queue_, mission::apid::ttc};
  std::uint16_t number_ = 0;
};

TEST_F(ParameterServiceTest, AsksTheNodeAndReportsTheValueInTheTypeOfTheDictionary) {
  ask({"can_switcher.early_handover", "timing.late_tick_ms", "ttc.log_level", "can_switcher.rotation_order"});
  const ParameterCall first = next();
  EXPECT_EQ(first.node, "can_switcher");
  EXPECT_EQ(first.parameter, "early_handover");
  EXPECT_FALSE(first.value);
  EXPECT_FALSE(service_.next_call(start)) << "one call at a time";
  service_.on_value(first.number, NodeValue(true));
  service_.on_value(next().number, NodeValue(std::int64_t{50}));
  service_.on_value(next().number, NodeValue(std::string("warn")));
  service_.on_value(next().number, NodeValue(std::vector<std::string>{"payload_eps", "payload_adcs"}));
  EXPECT_THAT(reports(), ElementsAre("1:1,3", "20,2 0001007001", "20,2 000100650032", "20,2 0001000102",
                                     "20,2 0001006f"
                                     "18"
                                     "7061796c6f61645f6570732c7061796c6f61645f61646373",
                                     "1:1,7"));
}

TEST_F(ParameterServiceTest, SetsValuesOneAfterAnother) {
  set({{"can_switcher.early_handover", "true"},
       {"can_switcher.rotation_order", "payload_eps,payload_adcs"},
       {"payload_eps.log_level", "debug"},
       {"payload_eps.answer_timeout_ms", "30"}});
  const ParameterCall first = next();
  EXPECT_EQ(first.value, NodeValue(true));
  service_.on_set(first.number, {});
  const ParameterCall second = next();
  EXPECT_EQ(second.value, NodeValue(std::vector<std::string>{"payload_eps", "payload_adcs"}));
  service_.on_set(second.number, {});
  const ParameterCall third = next();
  EXPECT_EQ(third.node, "payload_eps");
  EXPECT_EQ(third.value, NodeValue(std::string("debug")));
  service_.on_set(third.number, {});
  const ParameterCall last = next();
  EXPECT_EQ(last.value, NodeValue(std::int64_t{30}));
  EXPECT_THAT(reports(), ElementsAre("1:1,3"));
  service_.on_set(last.number, {});
  EXPECT_THAT(reports(), ElementsAre("1:1,7"));
}

TEST_F(ParameterServiceTest, AValueThatItsNodeRefusesEndsTheRequestAndTheReasonIsSaid) {
  set({{"can_switcher.rotation_order", "payload_x"}, {"can_switcher.early_handover", "true"}});
  service_.on_set(next().number, Err(std::string(300, 'r')));
  EXPECT_THAT(reports(), ElementsAre("1:1,3", "1:1,8=81 006f"));
  EXPECT_FALSE(service_.next_call(start)) << "the second is not set";
  const auto refused = service_.take_refused();
  ASSERT_THAT(refused, SizeIs(1));
  EXPECT_EQ(refused[0].parameter, 111);
  EXPECT_EQ(refused[0].reason.size(), 120U);
}

TEST_F(ParameterServiceTest, ASilentNodeIsAskedOnceARequestAndTheOthersAreReported) {
  ask({"timing.leap_seconds", "timing.late_tick_ms", "can_switcher.early_handover"});
  service_.on_error(next().number, ParameterCallError::no_answer);
  const ParameterCall other = next();
  EXPECT_EQ(other.node, "can_switcher");
  service_.on_value(other.number, NodeValue(false));
  EXPECT_THAT(reports(), ElementsAre("1:1,3", "20,2 0001007000", "1:1,8=80 0066"));
  ask({"timing.leap_seconds"});
  EXPECT_EQ(next().node, "timing") << "the next request asks again";
}

TEST_F(ParameterServiceTest, AValueOfAnotherTypeThanTheDictionarySaysIsAFailure) {
  for (const NodeValue& value :
       {NodeValue(std::string("x")), NodeValue(1.5), NodeValue(std::int64_t{-1}),
        NodeValue(std::int64_t{70000}), NodeValue(std::vector<std::string>{"a"}), NodeValue(true)}) {
    ask({"timing.late_tick_ms"});
    service_.on_value(next().number, value);
    EXPECT_THAT(reports().back(), testing::HasSubstr("1,8=82 0065"));
  }
  ask({"can_switcher.rotation_order"});
  service_.on_value(next().number, NodeValue(std::vector<std::string>{"a,b"}));
  EXPECT_THAT(reports().back(), testing::HasSubstr("1,8=82 006f")) << "a comma would be taken for two";
  ask({"ttc.log_level"});
  service_.on_value(next().number, NodeValue(std::string("loud")));
  EXPECT_THAT(reports().back(), testing::HasSubstr("1,8=82 0001"));
  ask({"ttc.log_level"});
  service_.on_error(next().number, ParameterCallError::no_such_parameter);
  EXPECT_THAT(reports().back(), testing::HasSubstr("1,8=82 0001"));
}

TEST_F(ParameterServiceTest, AnswersToAnotherCallAreIgnored) {
  ask({"timing.late_tick_ms"});
  const ParameterCall call = next();
  service_.on_value(call.number + 1, NodeValue(std::int64_t{1}));
  service_.on_value(call.number, NodeValue(std::int64_t{2}));
  service_.on_value(call.number, NodeValue(std::int64_t{3}));
  service_.on_error(call.number, ParameterCallError::no_answer);
  service_.on_set(call.number, {});
  EXPECT_THAT(reports(), ElementsAre("1:1,3", "20,2 000100650002", "1:1,7"));
}

TEST_F(ParameterServiceTest, RequestsBeyondTheQueueAreRefusedAndThoseThatWaitedTooLongToo) {
  for (std::size_t i = 0; i < ParameterService::max_waiting; ++i) ask({"timing.late_tick_ms"});
  EXPECT_THAT(reports(), IsEmpty());
  ask({"timing.late_tick_ms"});
  EXPECT_THAT(reports(), ElementsAre("9:1,4=23 "));
  const ParameterCall first = next();
  service_.on_error(first.number, ParameterCallError::no_answer);
  EXPECT_FALSE(service_.next_call(start + seconds(30)));
  const auto told = reports();
  ASSERT_THAT(told, SizeIs(2 + ParameterService::max_waiting - 1));
  EXPECT_EQ(told.back(), "8:1,4=20 ");
}

TEST_F(ParameterServiceTest, AnEmptyListIsOneAndAListOfOneToo) {
  const mission::Parameter& order = *dictionary_.parameter("can_switcher.rotation_order");
  using List = std::vector<std::string>;
  for (const auto& [text, list] :
       {std::pair<std::string, List>{"", {}}, {"a", {"a"}}, {"a,b", {"a", "b"}}, {"a,", {"a", ""}}}) {
    EXPECT_EQ(to_node(order, mission::Value(text)), NodeValue(list)) << text;
    EXPECT_EQ(from_node(order, NodeValue(list)), mission::Value(text)) << text;
  }
}

}  // namespace
}  // namespace srfs
