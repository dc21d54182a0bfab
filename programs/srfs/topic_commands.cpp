// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/topic_commands.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdio>

#include <fmt/format.h>
#include <sys/epoll.h>
#include <nlohmann/json.hpp>

#include "base/signals.hpp"
#include "mcap/message_definition.hpp"
#include "mcap/message_layout.hpp"
#include "programs/srfs/definition_folders.hpp"
#include "ros/node_directory.hpp"
#include "ros/serialized.hpp"

namespace srfs::tool {
namespace {

constexpr milliseconds look_period{100};  // for the topic's publishers

/// Subscribes to a topic when one publishes it, and prints what comes.
class Echo {
 public:
  Echo(ros::Executor& executor, ros::Participant& participant, const TopicEcho& order)
      : executor_(executor), participant_(participant), order_(order), heard_(monotonic_now()) {
    look_ = executor.add_timer(
        monotonic_now(), look_period, [this] { look(); }, "topic");
  }

  /// Why it ended before its time; empty: it did not.
  [[nodiscard]] const std::string& failure() const { return failure_; }
  [[nodiscard]] std::uint64_t shown() const { return shown_; }

 private:
  void look() {
    if (monotonic_now() - heard_ > order_.patience)
      return end(subscription_
                     ? fmt::format("no message of {} for {} s", order_.topic, order_.patience.count())
                     : fmt::format("nobody publishes {}: `srfs topics` shows the topics", order_.topic));
    if (subscription_) return;
    for (const ros::TopicEnds& ends : participant_.topics().topics()) {
      const std::string type = ros::ros_type_name(ends.type);
      if (ends.topic == "rt" + order_.topic && ends.publishers > 0 && !type.empty())
        return subscribe(type, ends);
    }
  }

  void subscribe(const std::string& type, const ros::TopicEnds& ends) {
    const auto definition = mcap::message_definition(type, definition_folders(order_.interfaces));
    if (!definition)
      return end(
          fmt::format("{} is of type {}, which has no definition here: name the folder with its "
                      "package by --interfaces",
                      order_.topic, type));
    auto layout = mcap::MessageLayout::parse(type, *definition);
    if (!layout) return end(fmt::format("{}: {}", type, layout.error()));
    layout_.emplace(std::move(*layout));
    const ros::Qos qos{
        .depth = 256, .transient_local = ends.transient_local, .best_effort = ends.best_effort};
    try {
      subscription_ = std::make_unique<ros::SerializedSubscription>(
          executor_, participant_, order_.topic, type, qos, ros::Priority::normal,
          [this](OctetView octets, const ros::MessageInfo&) { show(octets); });
    } catch (const std::runtime_error& error) {
      end(error.what());
    }
  }

  void show(OctetView octets) {
    heard_ = monotonic_now();
    const auto json = layout_->to_json(octets, order_.most);
    if (!json) return end(fmt::format("{} has a message that its definition does not fit", order_.topic));
    if (order_.count != 0 && shown_ == order_.count) return;
    std::puts(json->c_str());
    std::fflush(stdout);
    if (++shown_ == order_.count) executor_.stop();
  }

  void end(std::string failure) {
    failure_ = std::move(failure);
    executor_.stop();
  }

  ros::Executor& executor_;
  ros::Participant& participant_;
  const TopicEcho& order_;
  MonotonicTime heard_;
  std::uint64_t shown_ = 0;
  std::string failure_;
  std::optional<mcap::MessageLayout> layout_;
  std::unique_ptr<ros::SerializedSubscription> subscription_;
  ros::Timer look_;
};

/// A list of a node's ends: its key in JSON, its word in text.
struct EndList {
  const char* key;
  const char* text;
  std::vector<ros::NamedEnd> ros::NodeEnds::*ends;
  bool of_topics;
};
constexpr std::array end_lists{EndList{"publishers", "publishes", &ros::NodeEnds::publishers, true},
                               EndList{"subscriptions", "subscribes", &ros::NodeEnds::subscriptions, true},
                               EndList{"services", "serves", &ros::NodeEnds::services, false},
                               EndList{"clients", "calls", &ros::NodeEnds::clients, false},
                               EndList{"action_servers", "action", &ros::NodeEnds::action_servers, false},
                               EndList{"action_clients", "orders", &ros::NodeEnds::action_clients, false}};

/// A stranger's names may hold what moves a terminal's cursor.
std::string printable(std::string text) {
  for (char& c : text) {
    if (std::iscntrl(static_cast<unsigned char>(c)) != 0) c = '?';
  }
  return text;
}

void print_node(const ros::NodeEnds& node) {
  fmt::print("{}\n", node.node.empty() ? "(no node)" : printable(node.node));
  for (const EndList& list : end_lists)
    for (const ros::NamedEnd& end : node.*list.ends)
      fmt::print("  {:<10} {:44} {}{}{}\n", list.text, printable(end.name), printable(end.type),
                 end.best_effort ? "  best effort" : "", end.transient_local ? "  transient local" : "");
}

nlohmann::ordered_json to_json(const ros::NodeEnds& node) {
  nlohmann::ordered_json json{{"node", node.node}};
  for (const EndList& list : end_lists) {
    nlohmann::ordered_json& ends = json[list.key] = nlohmann::ordered_json::array();
    for (const ros::NamedEnd& end : node.*list.ends) {
      nlohmann::ordered_json& entry = ends.emplace_back();
      entry = {{"name", end.name}, {"type", end.type}};
      if (!list.of_topics) continue;
      entry["best_effort"] = end.best_effort;
      entry["transient_local"] = end.transient_local;
    }
  }
  return json;
}

/// A topic without keys: a shallow reader would keep the last of all participants' messages alone.
constexpr ros::Qos graph_qos{.depth = ros::NodeDirectory::most, .transient_local = true};

template <class M>
std::shared_ptr<ros::ReaderEndpoint> read_graph(ros::Executor& executor, ros::Participant& participant,
                                                ros::NodeDirectory& nodes) {
  return ros::TypedReader<M>::create(
      executor, participant, ros::graph_topic, graph_qos, ros::Priority::normal,
      [&nodes](const M& message, const ros::MessageInfo& info) {
        // Each participant speaks for itself alone.
        const auto sender = ros::to_gid(info.identity.writer_guid());
        constexpr std::size_t prefix_octets = 12;
        if (std::equal(sender.begin(), sender.begin() + prefix_octets, message.gid.data.begin()))
          nodes.on_graph(message);
      });
}

/// The nodes of the domain, as far as their processes speak the deployment's dialect of the graph.
std::vector<ros::NodeEnds> nodes_in(ros::Executor& executor, ros::Participant& participant,
                                    ros::GraphDialect dialect, milliseconds wait) {
  ros::NodeDirectory nodes;
  const auto reader = dialect == ros::GraphDialect::iron
                          ? read_graph<ros::IronGraphMessage>(executor, participant, nodes)
                          : read_graph<ros::HumbleGraphMessage>(executor, participant, nodes);
  (void)executor.spin_until([] { return false; }, monotonic_now() + wait);
  reader->close();
  if (const auto malformed = reader->stats().malformed; malformed > 0)
    fmt::print(stderr,
               "srfs graph: {} messages of nodes could not be read (another ROS 2 release? dds.ros_graph)\n",
               malformed);
  if (nodes.forgotten() > 0)
    fmt::print(stderr, "srfs graph: messages of more than {} participants: not all are shown\n",
               ros::NodeDirectory::most);
  return nodes.nodes(participant.topics().endpoints());
}

/// @param wanted full name or its last part; empty: any
bool is_wanted(const std::string& node, const std::string& wanted) {
  return wanted.empty() || node == wanted || node.ends_with("/" + wanted);
}

}  // namespace

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
      fmt::print("{:36} {:36} {:3} publish {:3} subscribe{}{}\n", printable(name), type, ends.publishers,
                 ends.subscriptions, ends.best_effort ? "  best effort" : "",
                 ends.transient_local ? "  transient local" : "");
    }
  }
  if (json) fmt::print("{}\n", list.dump(2, ' ', false, Json::error_handler_t::replace));
  return 0;
}

int show_graph(const Target& target, const GraphOrder& order, bool json) {
  using Json = nlohmann::ordered_json;
  const auto fail = [](const std::string& why) {
    fmt::print(stderr, "srfs graph: {}\n", why);
    return 1;
  };
  const auto domain = order.domain ? order.domain : running_domain(target);
  if (!domain)
    return fail(fmt::format("the suite is not running (no {}); --domain shows another domain",
                            target.var.domain_file().string()));
  ros::Executor executor;
  ros::ParticipantOptions options = participant_options(target, *domain, executor);
  options.remember_topics = true;
  options.bound_foreign = false;
  options.drop_foreign = false;
  const auto participant = ros::Participant::create(options);
  if (!participant) return fail(participant.error());
  auto nodes = nodes_in(executor, **participant, target.deployment.ros_graph, order.wait);
  std::erase_if(nodes, [&](const ros::NodeEnds& node) { return !is_wanted(node.node, order.node); });
  if (!order.node.empty() && nodes.empty())
    return fail(fmt::format("no node '{}' in domain {}: `srfs graph` shows all", order.node, *domain));
  if (json) {
    Json list = Json::array();
    for (const ros::NodeEnds& node : nodes) list.push_back(to_json(node));
    fmt::print("{}\n", list.dump(2, ' ', false, Json::error_handler_t::replace));
  } else {
    for (const ros::NodeEnds& node : nodes) print_node(node);
  }
  return 0;
}

int echo_topic(const Target& target, const TopicEcho& order) {
  const auto fail = [](const std::string& why) {
    fmt::print(stderr, "srfs echo: {}\n", why);
    return 1;
  };
  const auto domain = order.domain ? order.domain : running_domain(target);
  if (!domain)
    return fail(fmt::format("the suite is not running (no {}); --domain names another domain",
                            target.var.domain_file().string()));
  const Fd signals = termination_signals();
  ros::Executor executor;
  ros::ParticipantOptions options = participant_options(target, *domain, executor);
  options.remember_topics = true;
  options.bound_foreign = false;
  options.drop_foreign = false;
  const auto participant = ros::Participant::create(options);
  if (!participant) return fail(participant.error());
  const auto watch = executor.add_fd(signals.get(), EPOLLIN, [&](std::uint32_t) { executor.stop(); });
  Echo echo(executor, **participant, order);
  executor.spin();
  if (!echo.failure().empty()) return fail(echo.failure());
  return echo.shown() > 0 ? 0 : 1;
}

}  // namespace srfs::tool
