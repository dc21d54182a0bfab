// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/observer.hpp"

#include <cstdio>

#include <sys/epoll.h>
#include <lifecycle_msgs/msg/transition_event.hpp>
#include <nlohmann/json.hpp>

#include "base/octets.hpp"
#include "base/signals.hpp"
#include "ros/publisher.hpp"
#include "suite/ring/fault.hpp"
#include "suite/topics.hpp"

namespace srfs::tool {
namespace {

using Json = nlohmann::ordered_json;
namespace m = srfs_msgs::msg;
namespace topics = suite::topics;

Json begin(const char* type, MonotonicTime at) {
  return Json{{"type", type}, {"at_ns", at.ns()}};
}

void print_line(const Json& line) {
  // Texts come from any process: what is not UTF-8 is replaced, not thrown at.
  std::puts(line.dump(-1, ' ', false, Json::error_handler_t::replace).c_str());
  std::fflush(stdout);
}

/// From now on losses of its topic are told, too.
template <class M>
void tell_losses(ros::Subscription<M>& subscription) {
  subscription.on_lost([topic = subscription.topic_name()](MonotonicTime received, std::uint64_t messages) {
    Json j = begin("lost", received);
    j.update({{"topic", topic}, {"messages", messages}});
    print_line(j);
  });
}

Json describe(const m::TimeTick& t, MonotonicTime at) {
  Json j = begin("tick", at);
  j.update({{"cycle", t.cycle},
            {"due_ns", t.monotonic_ns},
            {"published_ns", t.published_ns},
            {"sync_state", t.sync_state},
            {"time_valid", t.time_valid},
            {"utc_s", t.utc.sec},
            {"incarnation", t.incarnation}});
  return j;
}

Json describe(const m::TaskFlags& f, MonotonicTime at) {
  Json j = begin("flags", at);
  j.update({{"cycle", f.cycle},
            {"switcher", f.switcher_incarnation},
            {"grant", f.grant_counter},
            {"holder", f.holder},
            {"flags", f.flags},
            {"tick_received_ns", f.tick_received_ns},
            {"published_ns", f.published_ns},
            {"lease_end_ns", f.lease_end_ns}});
  return j;
}

Json describe(const m::BusStatus& s, MonotonicTime at) {
  static constexpr const char* names[] = {"?", "taken", "released", "failed"};
  Json j = begin("bus", at);
  j.update({{"status", names[s.status < 4 ? s.status : 0]},
            {"said_ns", s.monotonic_ns},
            {"payload", s.payload},
            {"switcher", s.switcher_incarnation},
            {"grant", s.grant_counter},
            {"used_us", s.used_us},
            {"sent", s.frames_sent},
            {"received", s.frames_received},
            {"detail", s.detail}});
  return j;
}

Json describe(const m::PayloadActivity& a, MonotonicTime at) {
  static constexpr const char* names[] = {"off", "occupying_can", "data_processing", "other_async_command"};
  Json j = begin("activity", at);
  j.update({{"payload", a.payload},
            {"state", names[a.state < 4 ? a.state : 0]},
            {"since_ns", a.monotonic_ns},
            {"cycle", a.cycle}});
  return j;
}

Json describe(const m::Telecommand& t, MonotonicTime at) {
  Json j = begin("telecommand", at);
  j.update(
      {{"id", t.id}, {"target", t.target}, {"function", t.function_id}, {"arguments", to_hex(t.arguments)}});
  return j;
}

Json describe(const m::TelecommandReport& r, MonotonicTime at) {
  Json j = begin("report", at);
  j.update({{"id", r.id},
            {"node", r.node},
            {"stage", r.stage},
            {"success", r.success},
            {"failure_code", r.failure_code}});
  return j;
}

Json describe(const m::Event& e, MonotonicTime at) {
  Json j = begin("event", at);
  j.update({{"source", e.source}, {"event_id", e.event_id}, {"severity", e.severity}});
  return j;
}

Json describe(const m::LivenessReport& r, MonotonicTime at) {
  static constexpr const char* names[] = {"?",       "alive",   "miss",      "void",
                                          "accused", "outcome", "not_asked", "starved"};
  Json j = begin("liveness", at);
  j.update({{"observer", r.observer},
            {"subject", r.subject},
            {"verdict", names[r.verdict < std::size(names) ? r.verdict : 0]},
            {"observer_incarnation", r.observer_incarnation},
            {"subject_incarnation", r.subject_incarnation},
            {"generation", r.generation},
            {"lifecycle_state", r.lifecycle_state},
            {"misses", r.misses},
            {"age_ms", r.age_ms},
            {"round_trip_us", r.round_trip_us},
            {"said_ns", r.monotonic_ns}});
  if (r.verdict == m::LivenessReport::ACCUSED)
    j["fault"] = suite::to_text(static_cast<suite::FaultClass>(r.fault_class));
  if (r.verdict == m::LivenessReport::OUTCOME)
    j["outcome"] = suite::to_text(static_cast<suite::RestartOutcome::What>(r.outcome));
  if (!r.detail.empty()) j["detail"] = r.detail;
  return j;
}

Json describe(const m::PeripheralReset& r, MonotonicTime at) {
  Json j = begin("peripheral_reset", at);
  j.update({{"payload", r.payload}, {"grant", r.grant_counter}, {"reason", r.reason}});
  return j;
}

}  // namespace

int record(const Target& target, seconds duration) {
  const auto domain = running_domain(target);
  if (!domain) {
    std::fprintf(stderr, "srfs record: the suite is not running (no %s)\n", target.var.domain_file().c_str());
    return 1;
  }
  const Fd signals = termination_signals();

  ros::Executor executor;
  auto participant = ros::Participant::create(participant_options(target, *domain, executor));
  if (!participant) {
    std::fprintf(stderr, "srfs record: %s\n", participant.error().c_str());
    return 1;
  }
  std::vector<std::shared_ptr<void>> kept;
  const auto listen = [&]<class M>(ros::Topic<M> topic) {
    topic.qos.depth = 256;  // an observer may fall behind; the nodes' depths are theirs
    auto subscription = std::make_shared<ros::Subscription<M>>(
        executor, **participant, topic,
        [](const M& message, const ros::MessageInfo& info) { print_line(describe(message, info.received)); });
    tell_losses(*subscription);
    kept.push_back(std::move(subscription));
  };
  listen(topics::time_tick);
  for (const suite::Bus& bus : target.deployment.buses) {
    const auto on_bus = [&]<class M>(ros::Topic<M> topic) {
      topic.name = "/" + bus.name + topic.name.substr(topic.name.rfind('/'));
      listen(topic);
    };
    on_bus(topics::task_flags);
    on_bus(topics::bus_status);
    on_bus(topics::reset_peripheral);
  }
  listen(topics::telecommand);
  listen(topics::telecommand_report);
  listen(topics::event);
  listen(topics::liveness);
  for (const auto& node : target.deployment.nodes) {
    if (node.name.starts_with("payload")) listen(topics::activity(node.name));
    using Transition = lifecycle_msgs::msg::TransitionEvent;
    const ros::Topic<Transition> topic{"/" + node.name + "/transition_event", {}};
    auto subscription = std::make_shared<ros::Subscription<Transition>>(
        executor, **participant, topic,
        [name = node.name](const Transition& t, const ros::MessageInfo& info) {
          Json j = begin("lifecycle", info.received);
          j.update({{"node", name}, {"from", t.start_state.label}, {"to", t.goal_state.label}});
          print_line(j);
        });
    tell_losses(*subscription);
    kept.push_back(std::move(subscription));
  }
  const auto watch = executor.add_fd(signals.get(), EPOLLIN, [&](std::uint32_t) { executor.stop(); });
  print_line(Json{{"type", "recording"}, {"domain", *domain}});
  if (duration > seconds(0)) {
    executor.spin_until([] { return false; }, monotonic_now() + duration);
  } else {
    executor.spin();
  }
  return 0;
}

}  // namespace srfs::tool
