// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/program/verbs.hpp"

#include <cstdio>

#include "ground/installation.hpp"
#include "ground/remote.hpp"
#include "update/package_keys.hpp"

namespace srfs::ground::program {
namespace {

/// What is to be installed, before anything goes up.
Result<Installation, std::string> installation(const Operation& operation) {
  const Arguments& a = operation.arguments;
  std::string key = a.package.command.key;
  const auto own = operation.var_dir / update::public_key_file;
  if (key.empty() && std::filesystem::exists(own)) key = own.string();
  auto made = prepare_installation(a.package.command.file, key);
  if (!made) return made;
  made->activate = !a.package.no_activate;
  if (const auto wrong = wrong_telecommand(operation, {install_telecommand(made->name, made->activate)}))
    return Err(*wrong);
  return made;
}

// One function for each subcommand. What can be checked is checked before the port is opened.
namespace verbs {

Exit get_parameters(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const auto parameters = parameters_named(operation.dictionary, a.words);
  if (!parameters) return fail(a, parameters.error());
  if (a.action == "list") {
    for (const auto* parameter : *parameters) std::fputs(to_line(*parameter).c_str(), stdout);
    return Exit::done;
  }
  return with_console(operation, link_of(a), {}, [&](Console& console) {
    return console.get_parameters(*parameters, duration(a.timeout_s));
  });
}

Exit set_parameters(const Operation& operation) {
  const Arguments& a = operation.arguments;
  if (a.words.empty()) return fail(a, "expected param set NODE.PARAMETER=VALUE...");
  std::vector<TelecommandText> settings;
  for (const std::string& change : a.words) {
    auto setting = setting_command(change);
    if (!setting) return fail(a, setting.error());
    settings.push_back(std::move(*setting));
  }
  if (const auto wrong = wrong_telecommand(operation, settings)) return fail(a, *wrong);
  return with_console(operation, link_of(a), {}, [&](Console& console) {
    return console.set_parameters(settings, duration(a.timeout_s));
  });
}

Exit param(const Operation& operation) {
  const Arguments& a = operation.arguments;
  if (a.action == "list" || a.action == "get") return get_parameters(operation);
  if (a.action == "set") return set_parameters(operation);
  const auto telecommand = keeping_command(a.action, a.words);
  if (!telecommand) return fail(a, telecommand.error());
  if (const auto wrong = wrong_telecommand(operation, {*telecommand})) return fail(a, *wrong);
  return with_console(operation, link_of(a), {}, [&](Console& console) {
    return console.keep_parameters(*telecommand, duration(a.timeout_s));
  });
}

Exit package_install(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const auto link = link_of(a);
  const auto package = installation(operation);
  if (!package) return fail(a, package.error());
  return with_console(operation, link, {.files = true}, [&](Console& console) {
    return console.install(package->file, package->name, package->activate, duration(a.timeout_s));
  });
}

}  // namespace verbs

}  // namespace

void define_parameters(CLI::App& app, Arguments& a) {
  CLI::App& param = add(app, a, "param",
                        "Parameters of the nodes: list [NAME|NODE...] | get [NAME|NODE...] | "
                        "set NAME=VALUE... | keep NODE | confirm NODE | history NODE | "
                        "restore NODE GENERATION | reset NODE",
                        verbs::param);
  param.add_option("action", a.action, "Action")
      ->required()
      ->check(CLI::IsMember({"list", "get", "set", "keep", "confirm", "history", "restore", "reset"}));
  param.add_option("words", a.words, "NODE.PARAMETER, NODE, or NODE.PARAMETER=VALUE");
  add_timeout(param, a);
}

void define_packages(CLI::App& app, Arguments& a) {
  CLI::App& package = define_package(app, a.package, a.timeout_s);
  const auto run = [&](const char* name, Exit (*verb)(const PackageCommand&)) {
    package.get_subcommand(name)->final_callback([&a, verb] {
      a.package.command.json = a.json;
      a.exit = verb(a.package.command);
    });
  };
  run("make", make_package);
  run("keygen", make_keys);
  run("show", show_package);
  run("verify", verify_package);
  package.get_subcommand("install")->final_callback([&a] {
    a.verb = "package install";
    a.exit = operate(a, verbs::package_install);
  });
}

}  // namespace srfs::ground::program
