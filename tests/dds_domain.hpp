// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "ros/instance.hpp"

namespace srfs::testing_support {

/// A DDS domain of this test process alone, so that tests run in parallel on one machine. Upper half, away
/// from suites.
inline int own_domain() {
  static const auto lock = ros::DomainLock::allocate(std::nullopt, 60);
  return lock.value().domain();
}

}  // namespace srfs::testing_support
