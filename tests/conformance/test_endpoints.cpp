// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Names, types and QoS of the endpoints of every node, as announced by endpoint discovery.

#include "tests/conformance/node_process.hpp"

namespace srfs::conformance {
namespace {

struct Expected {
  std::string topic;
  std::string type;
  bool is_reader;
  bool transient_local = false;
  double lifespan_s = 0;
};

std::vector<Expected> service(const std::string& name, const std::string& type) {
  const std::size_t slash = type.find('/');
  const std::string dds = type.substr(0, slash) + "::srv::dds_::" + type.substr(slash + 1);
  return {{"rq/probe/" + name + "Request", dds + "_Request_", true},
          {"rr/probe/" + name + "Reply", dds + "_Response_", false}};
}

/// rcl_lifecycle's com_interface.c, rclcpp's parameter_service_names.hpp, rcl's logging_rosout.h with
/// rmw_qos_profile_rosout_default.
std::vector<Expected> standard_endpoints() {
  std::vector<Expected> all{
      {"rt/rosout", "rcl_interfaces::msg::dds_::Log_", false, true, 10.0},
      {"rt/parameter_events", "rcl_interfaces::msg::dds_::ParameterEvent_", false},
      {"rt/probe/transition_event", "lifecycle_msgs::msg::dds_::TransitionEvent_", false},
  };
  for (const auto& [name, type] : std::vector<std::pair<std::string, std::string>>{
           {"change_state", "lifecycle_msgs/ChangeState"},
           {"get_state", "lifecycle_msgs/GetState"},
           {"get_available_states", "lifecycle_msgs/GetAvailableStates"},
           {"get_available_transitions", "lifecycle_msgs/GetAvailableTransitions"},
           {"get_transition_graph", "lifecycle_msgs/GetAvailableTransitions"},
           {"describe_parameters", "rcl_interfaces/DescribeParameters"},
           {"get_parameter_types", "rcl_interfaces/GetParameterTypes"},
           {"get_parameters", "rcl_interfaces/GetParameters"},
           {"list_parameters", "rcl_interfaces/ListParameters"},
           {"set_parameters", "rcl_interfaces/SetParameters"},
           {"set_parameters_atomically", "rcl_interfaces/SetParametersAtomically"}}) {
    for (const Expected& half : service(name, type)) all.push_back(half);
  }
  return all;
}

class Endpoints : public ConformanceTest {
 protected:
  /// Waits until the node's endpoint is discovered.
  std::optional<SeenEndpoint> find_endpoint(const Expected& wanted) {
    const SeenParticipant seen = participant();
    std::optional<SeenEndpoint> found;
    (void)wait_for([&] {
      for (const SeenEndpoint& endpoint : peer_.endpoints_of(seen.guid)) {
        if (endpoint.topic == wanted.topic && endpoint.is_reader == wanted.is_reader) found = endpoint;
      }
      return found.has_value();
    });
    return found;
  }
};

TEST_F(Endpoints, EveryStandardEndpointHasItsNameTypeAndQos) {
  for (const Expected& expected : standard_endpoints()) {
    SCOPED_TRACE(expected.topic);
    const auto found = find_endpoint(expected);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->type, expected.type);
    EXPECT_TRUE(found->reliable);
    EXPECT_EQ(found->transient_local, expected.transient_local);
    EXPECT_DOUBLE_EQ(found->lifespan_s, expected.lifespan_s);
  }
}

TEST_F(Endpoints, WhatRos2LeavesAtItsDefaultIsAtItsDefault) {
  ASSERT_TRUE(find_endpoint(standard_endpoints().back()));
  for (const SeenEndpoint& endpoint : peer_.endpoints_of(participant().guid)) {
    SCOPED_TRACE(endpoint.topic);
    EXPECT_TRUE(endpoint.automatic_liveliness);
    EXPECT_TRUE(endpoint.infinite_liveliness_lease);
    EXPECT_TRUE(endpoint.infinite_deadline);
    EXPECT_TRUE(endpoint.shared_ownership);
    EXPECT_FALSE(endpoint.keyed) << "ROS 2 topics have no keys";
    EXPECT_FALSE(endpoint.with_type_description) << "rmw_fastrtps sends none";
  }
}

TEST_F(Endpoints, EveryNameIsOneThatRos2CanTranslateBack) {
  ASSERT_TRUE(find_endpoint(standard_endpoints().back()));
  for (const SeenEndpoint& endpoint : peer_.endpoints_of(participant().guid)) {
    SCOPED_TRACE(endpoint.topic + " " + endpoint.type);
    if (endpoint.topic == "ros_discovery_info") continue;
    const std::string kind = endpoint.topic.substr(0, 3);
    EXPECT_TRUE(kind == "rt/" || kind == "rq/" || kind == "rr/");
    EXPECT_NE(endpoint.type.find("::dds_::"), std::string::npos);
    EXPECT_EQ(endpoint.type.back(), '_');
    if (kind == "rq/") {
      EXPECT_TRUE(endpoint.topic.ends_with("Request"));
      EXPECT_TRUE(endpoint.type.ends_with("_Request_"));
    }
    if (kind == "rr/") {
      EXPECT_TRUE(endpoint.topic.ends_with("Reply"));
      EXPECT_TRUE(endpoint.type.ends_with("_Response_"));
    }
  }
}

TEST_F(Endpoints, EveryRequestReaderHasItsReplyWriter) {
  // rmw_service_server_is_available counts both endpoints.
  ASSERT_TRUE(find_endpoint(standard_endpoints().back()));
  ASSERT_TRUE(wait_for([&] {
    int servers = 0;
    int repliers = 0;
    for (const SeenEndpoint& endpoint : peer_.endpoints_of(participant().guid)) {
      servers += endpoint.topic.starts_with("rq/") && endpoint.is_reader ? 1 : 0;
      repliers += endpoint.topic.starts_with("rr/") && !endpoint.is_reader ? 1 : 0;
    }
    return servers >= 11 && servers == repliers;
  }));
}

}  // namespace
}  // namespace srfs::conformance
