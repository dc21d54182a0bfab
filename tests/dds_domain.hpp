// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "suite/instance.hpp"

namespace srfs::testing_support {

/// A DDS domain that only this test process uses, so that tests can run in parallel on one computer. It is in
/// the upper half, away from suites.
inline int own_domain() {
  static const auto lock = suite::DomainLock::allocate(std::nullopt, 60);
  return lock.value().domain();
}

}  // namespace srfs::testing_support
