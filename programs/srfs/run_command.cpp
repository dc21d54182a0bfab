// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/run_command.hpp"

#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include <fmt/format.h>

#include "base/config.hpp"
#include "base/file.hpp"
#include "programs/srfs/ad_hoc.hpp"
#include "suite/instance.hpp"
#include "suite/launcher.hpp"

namespace srfs::tool {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t largest_parameter_file = 1U << 20U;

fs::path folder_of(const RunOrder& order, const std::string& node) {
  if (!order.folder.empty()) return fs::absolute(order.folder);
  if (const char* state = std::getenv("XDG_STATE_HOME"); state != nullptr && *state == '/')
    return fs::path(state) / "srfs/run" / node;
  if (const char* home = std::getenv("HOME"); home != nullptr && *home == '/')
    return fs::path(home) / ".local/state/srfs/run" / node;
  throw ConfigError("no HOME for the node's folder: name one by --folder");
}

fs::path program_of(const std::string& named) {
  const fs::path program =
      named.find('/') != std::string::npos ? fs::absolute(named) : suite::suite_bin_folder() / named;
  if (access(program.c_str(), X_OK) != 0)
    throw ConfigError(fmt::format("{}: {}", program.string(), std::strerror(errno)));
  return program;
}

int domain_of(const Target& target, const RunOrder& order) {
  if (order.domain) return *order.domain;
  if (const char* text = std::getenv("ROS_DOMAIN_ID"); text != nullptr && *text != '\0') {
    int domain = -1;
    const char* const last = text + std::strlen(text);
    const auto [end, error] = std::from_chars(text, last, domain);
    if (error != std::errc() || end != last || domain < 0 || domain > 101)
      throw ConfigError(fmt::format("ROS_DOMAIN_ID={}: expected 0 to 101", text));
    return domain;
  }
  return running_domain(target).value_or(suite::DomainLock::first_domain);
}

std::vector<GivenParameter> parameters_of(const AdHocArguments& arguments, const std::string& node) {
  std::vector<GivenParameter> all;
  for (const std::string& file : arguments.files) {
    const auto text = read_file(file, largest_parameter_file);
    if (!text) throw ConfigError(text.error().message);
    const auto parameters = parameters_of_file(*text, node);
    if (!parameters) throw ConfigError(fmt::format("{}: {}", file, parameters.error()));
    all.insert(all.end(), parameters->begin(), parameters->end());
  }
  all.insert(all.end(), arguments.parameters.begin(), arguments.parameters.end());
  return all;
}

void prepare(const Target& target, const RunOrder& order, std::vector<std::string>& command) {
  const auto arguments = read_ad_hoc_arguments(order.arguments);
  if (!arguments) throw ConfigError(arguments.error());
  const fs::path program = program_of(order.program);
  const std::string node = order.node.empty() ? node_name_of(program.string()) : order.node;
  const fs::path folder = folder_of(order, node);
  const auto text = ad_hoc_deployment(node, program, parameters_of(*arguments, node));
  if (!text) throw ConfigError(text.error());
  const fs::path file = folder / "deployment.yaml";
  fs::create_directories(folder);
  if (const auto written = write_file_atomically(file, *text); !written)
    throw ConfigError(written.error().message);
  static_cast<void>(suite::Deployment::load(file));  // says what is wrong with a name
  const int domain = domain_of(target, order);
  const fs::path var = folder / "var";
  fs::create_directories(var);
  const auto paths = suite::VarPaths::at(var);
  if (const auto made = paths.make_run_folder(); !made) throw ConfigError(made.error());
  // For `srfs`, which asks this node as it asks those of a suite.
  if (const auto written = write_file_atomically(paths.domain_file(), fmt::format("{}\n", domain)); !written)
    throw ConfigError(written.error().message);
  fmt::print(stderr, "srfs run: {} in domain {}; for srfs: --deployment {} --var {}\n", node, domain,
             file.string(), var.string());
  command = {program, "--name", node, "--deployment", file, "--var", var, "--domain", std::to_string(domain)};
  command.insert(command.end(), arguments->others.begin(), arguments->others.end());
}

}  // namespace

int run_program(const Target& target, const RunOrder& order) {
  std::vector<std::string> command;
  try {
    prepare(target, order, command);
  } catch (const std::exception& error) {  // ConfigError, or the disk's
    fmt::print(stderr, "srfs run: {}\n", error.what());
    return 2;
  }
  std::vector<char*> argv;
  for (std::string& word : command) argv.push_back(word.data());
  argv.push_back(nullptr);
  std::fflush(nullptr);
  execv(argv[0], argv.data());
  fmt::print(stderr, "srfs run: {}: {}\n", command[0], std::strerror(errno));
  return 2;
}

}  // namespace srfs::tool
