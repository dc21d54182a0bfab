// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "msgs/mission/dictionary.hpp"

namespace srfs::ground::screen {

/// What may stand at the end of a line: verbs, telecommands, their arguments, values that the dictionary
/// lists.
struct Completion {
  std::size_t begin = 0;                ///< octet where the word begins that is completed
  std::vector<std::string> candidates;  ///< whole words, sorted
  /// What replaces the word: all that the candidates have in common, and what follows a whole one.
  std::string text;
};

/// @param before  the line before the cursor
/// @param views  names for "view NAME"
[[nodiscard]] Completion complete(const std::string& before, const mission::Dictionary& dictionary,
                                  const std::vector<std::string>& views);

}  // namespace srfs::ground::screen
