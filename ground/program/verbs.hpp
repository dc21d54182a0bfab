// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "ground/program/operation.hpp"

// Each adds subcommands to the program; these are run by Arguments::verb when all arguments were read.
namespace srfs::ground::program {

void define_telecommands(CLI::App& app, Arguments& a);
void define_lists_of_commands(CLI::App& app, Arguments& a);
void define_farm(CLI::App& app, Arguments& a);
void define_telemetry(CLI::App& app, Arguments& a);
void define_screens(CLI::App& app, Arguments& a);
void define_files(CLI::App& app, Arguments& a);
void define_parameters(CLI::App& app, Arguments& a);
void define_packages(CLI::App& app, Arguments& a);
void define_keys(CLI::App& app, Arguments& a);
void define_bridge(CLI::App& app, Arguments& a);
void define_server(CLI::App& app, Arguments& a);
void define_archive(CLI::App& app, Arguments& a);
void define_passes(CLI::App& app, Arguments& a);

}  // namespace srfs::ground::program
