// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "ros/endpoint.hpp"

namespace srfs::ros {

/// A message of a type that this program was not built with: its octets as they are on the wire, with the
/// encapsulation header (00 01 00 00).
struct SerializedMessage {
  Octets octets;
};

/// "std_msgs/msg/String" -> "std_msgs::msg::dds_::String_", as rmw_fastrtps names types; empty: no such name.
[[nodiscard]] std::string dds_type_name(std::string_view ros_type);
/// The way back; empty: no type of a ROS 2 message.
[[nodiscard]] std::string ros_type_name(std::string_view dds_type);

/// Publishes messages of any type, as octets (rclcpp::GenericPublisher).
class SerializedPublisher {
 public:
  /// @param topic ROS name, as written; it is not remapped @param type "std_msgs/msg/String"
  /// @throws std::runtime_error when Fast DDS refuses, or the participant has this type or topic in C++
  SerializedPublisher(Participant& participant, const std::string& topic, std::string_view type,
                      const Qos& qos);

  /// Never waits for a reader. @return false when DDS refuses, or @p octets are more than largest_payload
  bool publish(OctetView octets);
  [[nodiscard]] std::size_t subscription_count() const { return writer_.matched_count(); }
  [[nodiscard]] GUID_t guid() const { return writer_.guid(); }

 private:
  WriterEndpoint writer_;
};

/// Receives messages of any type, as octets (rclcpp::GenericSubscription). Dropping it ends the subscription.
class SerializedSubscription {
 public:
  /// @param octets valid during the call
  using Callback = std::function<void(OctetView octets, const MessageInfo&)>;

  /// As for SerializedPublisher. Samples larger than qos.largest_octets (0: 1 MiB) are dropped and counted.
  SerializedSubscription(Executor& executor, Participant& participant, const std::string& topic,
                         std::string_view type, const Qos& qos, Priority priority, Callback callback);
  ~SerializedSubscription();
  SerializedSubscription(const SerializedSubscription&) = delete;
  SerializedSubscription& operator=(const SerializedSubscription&) = delete;

  [[nodiscard]] InputStats stats() const;
  [[nodiscard]] std::size_t publisher_count() const;

 private:
  class Reader;
  std::shared_ptr<Reader> reader_;
};

}  // namespace srfs::ros
