// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "fake_spacecraft.hpp"

#include <fstream>

namespace srfs::ground {

VarFolder::VarFolder() {
  std::filesystem::create_directories(path() / "keys");
  write_key("tc_uplink", std::string(test_key) + "\n");
  write_key("tc_uplink_ad", std::string(ad_test_key) + "\n");
  write_key("tm_downlink", std::string(tm_test_key) + "\n");
}

void VarFolder::write_key(const std::string& name, const std::string& text) const {
  const auto file = path() / "keys" / (name + ".key");
  std::ofstream(file) << text;
  using std::filesystem::perms;
  std::filesystem::permissions(file, perms::owner_read | perms::owner_write);
}

}  // namespace srfs::ground
