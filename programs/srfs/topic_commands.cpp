// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/topic_commands.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "ros/serialized.hpp"

namespace srfs::tool {

int show_topics(const Target& target, std::optional<int> domain, milliseconds wait, bool json) {
  using Json = nlohmann::ordered_json;
  if (!domain) domain = running_domain(target);
  if (!domain) {
    fmt::print(stderr, "srfs topics: the suite is not running (no {}); --domain shows another domain\n",
               target.var.domain_file().string());
    return 1;
  }
  ros::Executor executor;
  ros::ParticipantOptions options = participant_options(target, *domain, executor);
  options.remember_topics = true;
  const auto participant = ros::Participant::create(options);
  if (!participant) {
    fmt::print(stderr, "srfs topics: {}\n", participant.error());
    return 1;
  }
  (void)executor.spin_until([] { return false; }, monotonic_now() + wait);
  Json list = Json::array();
  for (const ros::TopicEnds& ends : (*participant)->topics().topics()) {
    const std::string type = ros::ros_type_name(ends.type);
    if (!ends.topic.starts_with("rt/") || type.empty()) continue;  // a service, or no topic of ROS 2
    const std::string name = ends.topic.substr(2);
    if (json) {
      list.push_back({{"topic", name},
                      {"type", type},
                      {"publishers", ends.publishers},
                      {"subscriptions", ends.subscriptions},
                      {"best_effort", ends.best_effort},
                      {"transient_local", ends.transient_local}});
    } else {
      fmt::print("{:36} {:36} {:3} publish {:3} subscribe{}{}\n", name, type, ends.publishers,
                 ends.subscriptions, ends.best_effort ? "  best effort" : "",
                 ends.transient_local ? "  transient local" : "");
    }
  }
  if (json) fmt::print("{}\n", list.dump(2, ' ', false, Json::error_handler_t::replace));
  return 0;
}

}  // namespace srfs::tool
