// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "suite/topics.hpp"

/// Messages for the benchmarks only: plain structs with visit(), like generated ones.
namespace srfs::bench {

/// 64 octets on the wire (encapsulation 4). Times are CLOCK_MONOTONIC, which all processes of a computer
/// share, so a message carries all that is needed for its one-way latency.
struct Probe {
  static constexpr const char* dds_type_name = "srfs_bench::msg::dds_::Probe_";
  std::int64_t sent_ns = 0;   ///< read just before publishing
  std::int64_t there_ns = 0;  ///< in an echo: one-way latency of the answered probe
  std::uint32_t number = 0;
  std::array<std::uint8_t, 40> padding{};
  template <class Self, class V>
  static void visit(Self& s, V& v) {
    v.value(s.sent_ns);
    v.value(s.there_ns);
    v.value(s.number);
    v.array(s.padding);
  }
};

struct Heard {
  std::string name;
  std::uint32_t incarnation = 0;
  template <class Self, class V>
  static void visit(Self& s, V& v) {
    v.string(s.name, 32);
    v.value(s.incarnation);
  }
};

/// Report of a node in the restart cycles, ten times a second: the node itself and the nodes that it hears.
struct Beat {
  static constexpr const char* dds_type_name = "srfs_bench::msg::dds_::Beat_";
  Heard source;
  std::uint32_t publishers = 0;   ///< matched with its own subscription
  std::uint32_t subscribers = 0;  ///< matched with its own publisher
  std::vector<Heard> heard;
  template <class Self, class V>
  static void visit(Self& s, V& v) {
    v.value(s.source);
    v.value(s.publishers);
    v.value(s.subscribers);
    v.sequence(s.heard, 64, 0);
  }
};

inline const ros::Topic<Beat> beat_topic{"/bench/beat", {.depth = 16}, ros::Priority::time};

}  // namespace srfs::bench
