// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The parameter services and /parameter_events, octet by octet, as used by `ros2 param`.

#include "tests/conformance/node_process.hpp"

namespace srfs::conformance {
namespace {

/// rcl_interfaces/msg/ParameterValue with the type numbers of ParameterType.
struct Value {
  std::uint8_t type = 0;
  bool boolean = false;
  std::int64_t integer = 0;
  double real = 0;
  std::string text{};
  std::vector<bool> booleans{};
  std::vector<std::int64_t> integers{};
  std::vector<double> reals{};
  std::vector<std::string> texts{};
};

Cdr& put(Cdr& cdr, const Value& v) {
  cdr.u8(v.type).u8(v.boolean ? 1 : 0).i64(v.integer).f64(v.real).str(v.text);
  cdr.u32(0);  // byte_array_value
  cdr.u32(static_cast<std::uint32_t>(v.booleans.size()));
  for (const bool item : v.booleans) cdr.u8(item ? 1 : 0);
  cdr.u32(static_cast<std::uint32_t>(v.integers.size()));
  for (const std::int64_t item : v.integers) cdr.i64(item);
  cdr.u32(static_cast<std::uint32_t>(v.reals.size()));
  for (const double item : v.reals) cdr.f64(item);
  return cdr.strings(v.texts);
}

Value boolean(bool v) {
  return {.type = 1, .boolean = v};
}
Value integer(std::int64_t v) {
  return {.type = 2, .integer = v};
}
Value real(double v) {
  return {.type = 3, .real = v};
}
Value text(const std::string& v) {
  return {.type = 4, .text = v};
}

Octets names(const std::vector<std::string>& list) {
  return Cdr().strings(list).payload();
}

class Parameters : public ConformanceTest {
 protected:
  Octets call(const std::string& service, const std::string& type, const Octets& request) {
    RawClient client(peer_, "/probe/" + service, "rcl_interfaces::srv::dds_::" + type);
    return client.call(request);
  }
  std::string values(const std::vector<std::string>& wanted) {
    return hex(call("get_parameters", "GetParameters", names(wanted)));
  }
  static std::string expected_values(const std::vector<Value>& list) {
    Cdr cdr;
    cdr.u32(static_cast<std::uint32_t>(list.size()));
    for (const Value& value : list) put(cdr, value);
    return hex(cdr.payload());
  }
  static Octets parameters(const std::vector<std::pair<std::string, Value>>& list) {
    Cdr cdr;
    cdr.u32(static_cast<std::uint32_t>(list.size()));
    for (const auto& [name, value] : list) put(cdr.str(name), value);
    return cdr.payload();
  }
  std::string set(const std::vector<std::pair<std::string, Value>>& list) {
    return hex(call("set_parameters", "SetParameters", parameters(list)));
  }
  std::string list(const std::vector<std::string>& prefixes, std::uint64_t depth) {
    return hex(call("list_parameters", "ListParameters", Cdr().strings(prefixes).u64(depth).payload()));
  }
};

TEST_F(Parameters, ValuesOfEveryTypeAreGot) {
  EXPECT_EQ(values({"configure_fails", "camera.lens.focus", "camera.gain", "camera.name"}),
            expected_values({boolean(false), integer(-3), real(1.5), text("cam")}));
  EXPECT_EQ(values({"lists.bools", "lists.integers", "lists.doubles", "lists.strings"}),
            expected_values({{.type = 6, .booleans = {true, false, true}},
                             {.type = 7, .integers = {1, -2}},
                             {.type = 8, .reals = {0.5}},
                             {.type = 9, .texts = {"a", "", "ccc"}}}));
}

TEST_F(Parameters, AnUnknownNameIsAnsweredAsNotSetInItsPlace) {
  // GetParameters.srv: as many values as names. Early versions of rclcpp answered with an empty list.
  EXPECT_EQ(values({"nothing", "camera.lens.focus"}), expected_values({Value{}, integer(-3)}));
  EXPECT_EQ(values({}), expected_values({}));
}

TEST_F(Parameters, TypesAreGot) {
  EXPECT_EQ(
      hex(call("get_parameter_types", "GetParameterTypes",
               names({"configure_fails", "camera.lens.focus", "camera.gain", "camera.name", "nothing"}))),
      hex(Cdr().u32(5).u8(1).u8(2).u8(3).u8(4).u8(0).payload()));
}

TEST_F(Parameters, AreListedByPrefixAndDepthWithTheirPrefixes) {
  EXPECT_EQ(list({"camera"}, 0), hex(Cdr()
                                         .strings({"camera.gain", "camera.lens.focus", "camera.name"})
                                         .strings({"camera", "camera.lens"})
                                         .payload()));
  EXPECT_EQ(list({"camera"}, 1),
            hex(Cdr().strings({"camera.gain", "camera.name"}).strings({"camera"}).payload()));
  EXPECT_EQ(list({"camera.lens", "configure_fails"}, 1),
            hex(Cdr().strings({"camera.lens.focus", "configure_fails"}).strings({"camera.lens"}).payload()));
  EXPECT_EQ(list({"nothing"}, 0), hex(Cdr().strings({}).strings({}).payload()));
}

TEST_F(Parameters, AllAreListedToARequestWithoutPrefix) {
  CdrView all(call("list_parameters", "ListParameters", Cdr().strings({}).u64(0).payload()));
  std::vector<std::string> found(all.u32());
  for (std::string& name : found) name = all.str();
  for (const char* name : {"camera.gain", "camera.lens.focus", "camera.name", "configure_fails",
                           "lists.bools", "lists.doubles", "lists.integers", "lists.strings"}) {
    EXPECT_NE(std::find(found.begin(), found.end(), name), found.end()) << name;
  }
}

TEST_F(Parameters, AreDescribedWithTypeRangeAndReadOnly) {
  const Octets answer = call("describe_parameters", "DescribeParameters",
                             names({"camera.gain", "camera.lens.focus", "camera.name", "nothing"}));
  Cdr expected;
  expected.u32(4);
  // name, type, description, additional_constraints, read_only, dynamic_typing, floating_point_range,
  // integer_range
  expected.str("camera.gain").u8(3).str("Gain of the camera").str("").u8(0).u8(0);
  expected.u32(1).f64(0.0).f64(8.0).f64(0.0).u32(0);
  expected.str("camera.lens.focus").u8(2).str("Focus in steps").str("").u8(0).u8(0);
  expected.u32(0).u32(1).i64(-10).i64(10).u64(1);
  expected.str("camera.name").u8(4).str("Name").str("").u8(1).u8(0).u32(0).u32(0);
  expected.str("nothing").u8(0).str("").str("").u8(0).u8(0).u32(0).u32(0);
  EXPECT_EQ(hex(answer), hex(expected.payload()));
}

TEST_F(Parameters, AChangeIsAnsweredHoldsAndIsToldOnParameterEvents) {
  RawReader events(peer_, "rt/parameter_events", "rcl_interfaces::msg::dds_::ParameterEvent_");
  ASSERT_TRUE(events.heard([&] { (void)set({{"camera.lens.focus", integer(-3)}}); }));
  EXPECT_EQ(set({{"camera.gain", real(2.25)}}), hex(Cdr().u32(1).u8(1).str("").payload()));
  EXPECT_EQ(values({"camera.gain"}), expected_values({real(2.25)}));

  const auto event = events.next([](const ReceivedSample& s) {
    return std::string(s.payload.begin(), s.payload.end()).find("camera.gain") != std::string::npos;
  });
  ASSERT_TRUE(event);
  CdrView view(event->payload);
  const std::uint32_t sec = view.u32();
  const std::uint32_t nanosec = view.u32();
  EXPECT_GT(sec, 1'700'000'000U) << "ROS time";
  EXPECT_LT(nanosec, 1'000'000'000U);
  Cdr expected;
  expected.u32(sec).u32(nanosec).str("/probe").u32(0).u32(1).str("camera.gain");
  put(expected, real(2.25)).u32(0);
  EXPECT_EQ(hex(event->payload), hex(expected.payload()));
  EXPECT_EQ(set({{"camera.gain", real(1.5)}}), hex(Cdr().u32(1).u8(1).str("").payload()));
}

TEST_F(Parameters, RefusalsSayWhyAndLeaveTheOthersAlone) {
  CdrView answer(call("set_parameters", "SetParameters",
                      parameters({{"camera.gain", real(99.0)},
                                  {"camera.name", text("other")},
                                  {"nothing", integer(1)},
                                  {"camera.lens.focus", real(1.0)},
                                  {"camera.lens.focus", integer(4)}})));
  ASSERT_EQ(answer.u32(), 5U);
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(answer.u8(), 0) << i;
    EXPECT_FALSE(answer.str().empty()) << i;
  }
  EXPECT_EQ(answer.u8(), 1);
  EXPECT_EQ(answer.str(), "");
  EXPECT_TRUE(answer.at_end());
  EXPECT_EQ(values({"camera.gain", "camera.name", "camera.lens.focus"}),
            expected_values({real(1.5), text("cam"), integer(4)}));
  EXPECT_EQ(set({{"camera.lens.focus", integer(-3)}}), hex(Cdr().u32(1).u8(1).str("").payload()));
}

TEST_F(Parameters, AtomicallyMeansAllOrNone) {
  CdrView refused(call("set_parameters_atomically", "SetParametersAtomically",
                       parameters({{"camera.gain", real(3.0)}, {"camera.lens.focus", integer(1000)}})));
  EXPECT_EQ(refused.u8(), 0);
  EXPECT_FALSE(refused.str().empty());
  EXPECT_EQ(values({"camera.gain"}), expected_values({real(1.5)}));
  EXPECT_EQ(hex(call("set_parameters_atomically", "SetParametersAtomically",
                     parameters({{"camera.gain", real(1.5)}, {"camera.lens.focus", integer(-3)}}))),
            hex(Cdr().u8(1).str("").payload()));
}

TEST_F(Parameters, AValueOfNoTypeOrOfOctetsIsRefused) {
  CdrView answer(call("set_parameters", "SetParameters",
                      parameters({{"camera.gain", Value{}}, {"camera.gain", {.type = 5}}})));
  ASSERT_EQ(answer.u32(), 2U);
  EXPECT_EQ(answer.u8(), 0);
  EXPECT_FALSE(answer.str().empty());
  EXPECT_EQ(answer.u8(), 0);
}

}  // namespace
}  // namespace srfs::conformance
