// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace srfs::ground {

/// A completion script for bash: subcommands, options, and telecommands by `PROGRAM list --names`.
[[nodiscard]] std::string bash_completion(const CLI::App& app, const std::string& program);

/// The manual page, section 1, for man(1).
[[nodiscard]] std::string man_page(const CLI::App& app, const std::string& program,
                                   const std::string& version);

}  // namespace srfs::ground
