// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <string>

#include "base/octets.hpp"

namespace srfs::wire {

/// The vectors of tests/vectors/ground_link.txt: name in the file -> octets.
inline const std::map<std::string, Octets>& link_vectors() {
  static const auto vectors = [] {
    std::map<std::string, Octets> all;
    std::ifstream file(SRFS_SOURCE_DIR "/tests/vectors/ground_link.txt");
    for (std::string line; std::getline(file, line);) {
      const std::size_t equals = line.rfind(" = ");
      if (line.empty() || line[0] == '#' || equals == std::string::npos) continue;
      const auto octets = from_hex(line.substr(equals + 3));
      EXPECT_TRUE(octets) << line;
      if (octets) all[line.substr(0, equals)] = *octets;
    }
    return all;
  }();
  return vectors;
}

inline Octets vector_named(const std::string& name) {
  const auto found = link_vectors().find(name);
  EXPECT_NE(found, link_vectors().end()) << name;
  return found == link_vectors().end() ? Octets{} : found->second;
}

inline Octets octets_of(std::string_view hex) {
  return from_hex(hex).value();
}

}  // namespace srfs::wire
