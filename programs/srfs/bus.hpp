// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "base/result.hpp"
#include "programs/srfs/suite.hpp"
#include "ros/client.hpp"
#include "ros/executor.hpp"
#include "suite/deployment.hpp"

namespace srfs::tool {

/// A tool's place on the bus: one participant, one executor, run only while something is waited for.
struct Bus {
  ros::Executor executor;
  std::unique_ptr<ros::Participant> participant;

  /// Throws std::runtime_error when no participant can be created.
  Bus(const Target& target, int domain) {
    auto made = ros::Participant::create(participant_options(target, domain, executor));
    if (!made) throw std::runtime_error(made.error());
    participant = std::move(*made);
  }

  template <class S>
  std::unique_ptr<ros::Client<S>> client(const std::string& name) {
    return std::make_unique<ros::Client<S>>(executor, *participant, name, ros::Qos{}, ros::Priority::normal);
  }

  /// One question. Blocks up to the deadline.
  template <class S>
  Result<typename S::Response, ros::CallError> ask(const std::string& service,
                                                   const typename S::Request& request,
                                                   milliseconds deadline) {
    using Answer = Result<typename S::Response, ros::CallError>;
    const auto asked = client<S>(service);
    std::optional<Answer> answer;
    asked->call(request, deadline, 1, [&](const Answer& a) { answer = a; });
    executor.spin_until([&] { return answer.has_value(); }, monotonic_now() + deadline + seconds(1));
    return answer.value_or(Err(ros::CallError::timeout));
  }
};

}  // namespace srfs::tool
