// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "fake_spacecraft.hpp"

#include <fstream>

namespace srfs::ground {

VarFolder::VarFolder() {
  std::filesystem::create_directories(path() / "keys");
  std::ofstream(path() / "keys/tc_uplink.key") << test_key << "\n";
  std::ofstream(path() / "keys/tc_uplink_ad.key") << ad_test_key << "\n";
}

}  // namespace srfs::ground
