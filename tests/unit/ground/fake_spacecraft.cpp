#include "fake_spacecraft.hpp"

#include <cstdlib>
#include <fstream>
#include <stdexcept>

namespace srfs::ground {

VarFolder::VarFolder() {
  std::string pattern = (std::filesystem::temp_directory_path() / "srfs_ground_XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("no temporary folder");
  path_ = pattern;
  std::filesystem::create_directories(path_ / "keys");
  std::ofstream(path_ / "keys/tc_uplink.key") << test_key << "\n";
  std::ofstream(path_ / "keys/tc_uplink_ad.key") << ad_test_key << "\n";
}

VarFolder::~VarFolder() {
  std::error_code error;
  std::filesystem::remove_all(path_, error);
}

}  // namespace srfs::ground
