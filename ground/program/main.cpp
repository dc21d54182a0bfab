// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// srfs-ground: the operator's side of the ground link on a command line.
#include <cstdio>
#include <exception>

#include <CLI/CLI.hpp>

#include "base/version.hpp"
#include "ground/program/program_help.hpp"
#include "ground/program/verbs.hpp"

namespace {

using namespace srfs;
using namespace srfs::ground;
using namespace srfs::ground::program;

void define_help(CLI::App& app, Arguments&) {
  app.add_subcommand("completion", "Write a completion script for bash: source <(srfs-ground completion)")
      ->final_callback([&app] { std::fputs(bash_completion(app, "srfs-ground").c_str(), stdout); });
  app.add_subcommand("man", "Write the manual page: srfs-ground man | man -l -")->final_callback([&app] {
    std::fputs(man_page(app, "srfs-ground", version()).c_str(), stdout);
  });
}

/// The order is that of --help.
void define(CLI::App& app, Arguments& a) {
  define_run(app, a);
  define_telecommands(app, a);
  define_telemetry(app, a);
  define_screens(app, a);
  define_lists_of_commands(app, a);
  define_farm(app, a);
  define_files(app, a);
  define_parameters(app, a);
  define_keys(app, a);
  define_bridge(app, a);
  define_server(app, a);
  define_archive(app, a);
  define_passes(app, a);
  define_packages(app, a);
  define_help(app, a);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("The operator's side of the ground link");
  Arguments arguments;
  define(app, arguments);
  try {
    app.parse(argc, argv);
    return static_cast<int>(arguments.exit);
  } catch (const CLI::ParseError& error) {
    // 0: help was asked for; CLI11 numbers its errors from 100.
    return app.exit(error) == 0 ? 0 : static_cast<int>(Exit::unusable);
  } catch (const std::exception& error) {
    return static_cast<int>(fail(arguments, error.what()));
  }
}
