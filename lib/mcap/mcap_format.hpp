// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>

#include "base/octets.hpp"

/// MCAP, the container of recorded messages that ROS 2 tools open (https://mcap.dev/spec, major version 0).
namespace srfs::mcap {

inline constexpr std::array<std::uint8_t, 8> magic{0x89, 'M', 'C', 'A', 'P', 0x30, '\r', '\n'};

enum class Opcode : std::uint8_t {
  header = 0x01,
  footer = 0x02,
  schema = 0x03,
  channel = 0x04,
  message = 0x05,
  chunk = 0x06,
  message_index = 0x07,
  chunk_index = 0x08,
  statistics = 0x0b,
  summary_offset = 0x0e,
  data_end = 0x0f,
};

struct Schema {
  std::string name;      ///< "std_msgs/msg/String"
  std::string encoding;  ///< "ros2msg"; empty: no definition is known
  std::string data;
  friend bool operator==(const Schema&, const Schema&) = default;
};

struct Channel {
  std::uint16_t schema = 0;  ///< 0: none
  std::string topic;
  std::string message_encoding;  ///< "cdr"
  std::map<std::string, std::string> metadata;
  friend bool operator==(const Channel&, const Channel&) = default;
};

struct Message {
  std::uint16_t channel = 0;
  std::uint32_t sequence = 0;
  std::uint64_t log_time = 0;  ///< ns, UTC
  std::uint64_t publish_time = 0;
  Octets data;
};

}  // namespace srfs::mcap
