// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

#include "ros/graph.hpp"
#include "ros/isolation.hpp"
#include "ros/qos.hpp"

namespace srfs::ros {

/// A topic of the domain: every type that endpoints announce for a name stands by itself.
struct TopicEnds {
  std::string topic;  ///< of DDS: "rt/timing/tick"
  std::string type;   ///< of DDS: "srfs_msgs::msg::dds_::TimeTick_"
  std::size_t publishers = 0;
  std::size_t subscriptions = 0;
  /// With which all of its publishers are heard.
  bool best_effort = false;
  bool transient_local = false;
};

/// The endpoints of all other participants, as discovery tells of them. Remembers 4096; further ones are
/// counted. Filled on discovery's thread, asked on any.
class TopicDirectory {
 public:
  static constexpr std::size_t most = 4096;
  struct Endpoint {
    Gid gid;
    bool is_publisher;
    std::string topic;  ///< of DDS, as the type
    std::string type;
    bool best_effort;
    bool transient_local;
  };

  void add(const Gid& endpoint, bool is_publisher, std::string topic, std::string type, const Qos& qos);
  void remove(const Gid& endpoint);
  /// The participant has gone.
  void remove_all_of(const GuidPrefix& participant);

  /// By name, then by type.
  [[nodiscard]] std::vector<TopicEnds> topics() const;
  /// In the order of discovery.
  [[nodiscard]] std::vector<Endpoint> endpoints() const;
  [[nodiscard]] std::uint64_t forgotten() const;

 private:
  mutable std::mutex mutex_;
  std::vector<Endpoint> endpoints_;
  std::uint64_t forgotten_ = 0;
};

}  // namespace srfs::ros
