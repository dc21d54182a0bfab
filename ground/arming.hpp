#pragma once

#include <string>
#include <vector>

#include "msgs/mission/dictionary.hpp"

namespace srfs::ground {

/// A telecommand as an operator writes it.
struct TextCommand {
  std::string name;
  std::vector<std::string> arguments;
};

/// What must be completed before the hazardous @p command, with exactly these arguments, is taken. Pure.
[[nodiscard]] TextCommand arming_of(const mission::EncodedCommand& command);

}  // namespace srfs::ground
