#include "fake_spacecraft.hpp"

#include <cstdlib>
#include <fstream>
#include <stdexcept>

namespace srfs::ground {

VarFolder::VarFolder() {
  std::filesystem::create_directories(path() / "keys");
  std::ofstream(path() / "keys/tc_uplink.key") << test_key << "\n";
}

}  // namespace srfs::ground
