// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/commanding/command_authority.hpp"

#include <fmt/format.h>

#include <mission/structures.hpp>

#include "base/log.hpp"
#include "ros/datagram_seal.hpp"
#include "suite/topics.hpp"

namespace srfs {
namespace {

constexpr seconds between_readings{1};

}  // namespace

CommandAuthority::CommandAuthority(suite::Node& node) : node_(node) {
  read_key();
}

void CommandAuthority::read_key() {
  key_read_ = monotonic_now();
  const auto key = suite::command_key(node_.var(), node_.name());
  if (key) {
    key_ = *key;
  } else {
    log::error("telecommands cannot be checked, so none is executed: {}", key.error());
  }
}

bool CommandAuthority::admits(const srfs_msgs::msg::Telecommand& telecommand) {
  if (node_.deployment().open_orders) return true;
  const auto judge = [&] { return rejection_of(key_ ? &*key_ : nullptr, telecommand); };
  auto rejection = judge();
  if ((rejection == Rejection::wrong_proof || rejection == Rejection::no_key) &&
      monotonic_now() - key_read_ >= between_readings) {
    read_key();
    rejection = judge();
  }
  if (rejection) reject(telecommand, *rejection);
  return !rejection;
}

void CommandAuthority::reject(const srfs_msgs::msg::Telecommand& telecommand, Rejection why) {
  const MonotonicTime now = monotonic_now();
  const bool report_now = log_.add(now);
  last_ =
      fmt::format("{}: telecommand {}, function {}", to_text(why), telecommand.id, telecommand.function_id);
  if (report_now) return report();
  if (timer_) return;
  timer_ = node_.context().executor.add_timer(
      log_.due().value_or(now), nanoseconds(0),
      [this] {
        timer_.reset();
        if (log_.on_time(monotonic_now())) report();
      },
      "rejected telecommands");
}

void CommandAuthority::report() {
  log::error("{} telecommands that are not ttc's were rejected so far, last {}", log_.count(), last_);
  node_.raise(mission::NodeForeignSamplesEvent{
      .count = log_.count(), .topic = suite::topics::telecommand.name, .participant = last_});
}

void CommandAuthority::prove(srfs_msgs::msg::TelecommandReport& report) const {
  if (key_) report.proof = srfs::prove(*key_, report);
}

CommandSigner::CommandSigner(suite::VarPaths var, bool open, Nodes nodes)
    : var_(std::move(var)), open_(open), nodes_(std::move(nodes)) {
  read_key();
}

void CommandSigner::read_key() {
  key_read_ = monotonic_now();
  const auto key = suite::suite_command_key(var_, key_);
  if (!key) {
    if (!key_) log::error("no node will execute a telecommand: {}", key.error());
    return;
  }
  if (key_ == *key) return;
  key_ = *key;
  // A confined node cannot derive its own of a key that was made anew; it reads it when a proof is wrong.
  for (const std::string& node : nodes_()) {
    if (const auto handed = suite::hand_out_command_key(var_, node); !handed)
      log::error("{} may execute no telecommand: {}", node, handed.error());
  }
}

void CommandSigner::prove(srfs_msgs::msg::Telecommand& telecommand) {
  if (monotonic_now() - key_read_ >= between_readings) read_key();
  if (key_) telecommand.proof = srfs::prove(suite::command_key_of(*key_, telecommand.target), telecommand);
}

void CommandSigner::keep_keys() {
  if (open_) return;
  read_key();
  if (const auto& seal = ros::datagram_seal(); seal && !seal->is_limited())
    (void)suite::suite_seal_key(var_, seal->keys().key);  // what is wrong with it is no news each second
}

bool CommandSigner::believes(const srfs_msgs::msg::TelecommandReport& report) {
  if (open_) return true;
  const auto is_good = [&] { return key_ && is_proven(suite::command_key_of(*key_, report.node), report); };
  if (is_good()) return true;
  if (monotonic_now() - key_read_ < between_readings) return false;
  read_key();
  return is_good();
}

}  // namespace srfs
