// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "suite/command_keys.hpp"
#include "suite/instance.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::testing_support {

/// A temporary folder whose nodes have it, or `var` in it, as their VAR: what they leave in the runtime
/// folder is removed, too.
class VarFolder : public TemporaryFolder {
 public:
  VarFolder() = default;
  VarFolder(const VarFolder&) = delete;
  VarFolder& operator=(const VarFolder&) = delete;
  ~VarFolder() {
    std::error_code ignored;
    for (const auto& root : {path(), path() / "var"}) {
      const auto var = suite::VarPaths::at(root);
      suite::forget_command_keys(var);
      if (var.memory() != var.memory_link()) std::filesystem::remove_all(var.memory(), ignored);
    }
  }
};

}  // namespace srfs::testing_support
