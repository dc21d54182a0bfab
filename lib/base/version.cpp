// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/version.hpp"

namespace srfs {

const char* version() {
  return SRFS_VERSION;
}

}  // namespace srfs
