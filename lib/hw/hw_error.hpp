// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace srfs::hw {

/// Why a device could not be opened: the URI, what is wrong with it and what was expected, ready to print.
struct HwError {
  std::string message;
};

}  // namespace srfs::hw
