// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "msgs/mission/dictionary.hpp"

namespace srfs::testing_support {

/// The mission of the source tree, read once.
inline const mission::Dictionary& dictionary() {
  static const auto loaded = mission::Dictionary::load(std::string(SRFS_SOURCE_DIR) + "/mission");
  return loaded;
}

}  // namespace srfs::testing_support
