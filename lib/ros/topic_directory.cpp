// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/topic_directory.hpp"

#include <algorithm>
#include <map>
#include <utility>

namespace srfs::ros {

void TopicDirectory::add(const Gid& endpoint, bool is_publisher, std::string topic, std::string type,
                         const Qos& qos) {
  const std::lock_guard lock(mutex_);
  std::erase_if(endpoints_, [&](const Endpoint& e) { return e.gid == endpoint; });
  if (endpoints_.size() == most) {
    ++forgotten_;
    return;
  }
  endpoints_.push_back(
      {endpoint, is_publisher, std::move(topic), std::move(type), qos.best_effort, qos.transient_local});
}

void TopicDirectory::remove(const Gid& endpoint) {
  const std::lock_guard lock(mutex_);
  std::erase_if(endpoints_, [&](const Endpoint& e) { return e.gid == endpoint; });
}

void TopicDirectory::remove_all_of(const GuidPrefix& participant) {
  const std::lock_guard lock(mutex_);
  std::erase_if(endpoints_, [&](const Endpoint& e) {
    return std::equal(participant.begin(), participant.end(), e.gid.begin());
  });
}

std::vector<TopicEnds> TopicDirectory::topics() const {
  std::map<std::pair<std::string, std::string>, TopicEnds> found;
  const std::lock_guard lock(mutex_);
  for (const Endpoint& e : endpoints_) {
    TopicEnds& ends = found[{e.topic, e.type}];
    ends.topic = e.topic;
    ends.type = e.type;
    if (!e.is_publisher) {
      ++ends.subscriptions;
      continue;
    }
    ends.best_effort = ends.best_effort || e.best_effort;
    ends.transient_local = (ends.publishers == 0 || ends.transient_local) && e.transient_local;
    ++ends.publishers;
  }
  std::vector<TopicEnds> topics;
  for (auto& [key, ends] : found) topics.push_back(std::move(ends));
  return topics;
}

std::vector<TopicDirectory::Endpoint> TopicDirectory::endpoints() const {
  const std::lock_guard lock(mutex_);
  return endpoints_;
}

std::uint64_t TopicDirectory::forgotten() const {
  const std::lock_guard lock(mutex_);
  return forgotten_;
}

}  // namespace srfs::ros
