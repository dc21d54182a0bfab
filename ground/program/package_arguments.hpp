// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>

#include "ground/package_commands.hpp"

namespace srfs::ground {

/// What the command line says after `package`.
struct PackageArguments {
  PackageCommand command;
  bool no_activate = false;
};

/// Adds `package` with its subcommands, which have no callback yet. @param timeout_s of install
CLI::App& define_package(CLI::App& app, PackageArguments& arguments, double& timeout_s);

}  // namespace srfs::ground
