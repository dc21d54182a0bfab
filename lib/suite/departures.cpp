// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/departures.hpp"

#include <algorithm>
#include <utility>

#include <sys/epoll.h>

#include "base/log.hpp"
#include "ros/datagram_seal.hpp"

namespace srfs::suite {

Departures::Departures(ros::Executor& executor, ros::Participant& participant, VarPaths var,
                       std::function<bool(const std::string&)> is_node)
    : executor_(executor), participant_(participant), var_(std::move(var)), is_node_(std::move(is_node)) {
  participant_.on_peers_changed([this, alive = std::weak_ptr<bool>(alive_)] {
    executor_.post([this, alive] {
      if (!alive.expired()) look();
    });
  });
  look();
}

Departures::~Departures() {
  participant_.on_peers_changed({});
}

void Departures::look() {
  const auto members = participant_.known_participants().members();
  std::erase_if(watches_, [&](const Watch& w) {
    return std::none_of(members.begin(), members.end(),
                        [&](const auto& m) { return m.prefix == w.member.prefix; });
  });
  for (const auto& member : members) {
    const bool watched = std::any_of(watches_.begin(), watches_.end(),
                                     [&](const Watch& w) { return w.member.prefix == member.prefix; });
    if (!watched && is_node_(member.identity.node)) watch(member);
  }
}

void Departures::watch(const ros::KnownParticipants::Member& member) {
  auto process = open_instance(var_, member.identity.node);
  const auto holder = find_instance(var_, member.identity.node);
  // Each incarnation holds the lock for as long as it has a participant: another holder came after its end.
  if (holder && holder->incarnation > member.identity.incarnation) return announce(member);
  const bool is_this = process && holder && holder->pid == process->pid() &&
                       holder->incarnation == member.identity.incarnation;
  if (!is_this) return;
  const int fd = process->fd();
  auto handle = executor_.add_fd(
      fd, EPOLLIN, [this, prefix = member.prefix](std::uint32_t) { on_exit(prefix); }, "end of a node");
  watches_.push_back({member, std::move(*process), std::move(handle)});
}

void Departures::on_exit(const ros::GuidPrefix& prefix) {
  const auto found = std::find_if(watches_.begin(), watches_.end(),
                                  [&](const Watch& w) { return w.member.prefix == prefix; });
  if (found == watches_.end()) return;
  const Watch ended = std::move(*found);  // until this call ends, it is of this watch
  watches_.erase(found);
  announce(ended.member);
}

void Departures::announce(const ros::KnownParticipants::Member& member) {
  // Of an uplinked node nobody believes it.
  if (const auto& seal = ros::datagram_seal(); seal && seal->is_limited()) return;
  ++announced_;
  if (!participant_.announce_departure(member.prefix))
    log::warn("{} (incarnation {}) has ended but stays in the ROS graph until its lease ends",
              member.identity.node, member.identity.incarnation);
}

}  // namespace srfs::suite
