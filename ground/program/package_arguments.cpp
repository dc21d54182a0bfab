// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/program/package_arguments.hpp"

namespace srfs::ground {
namespace {

void define_make(CLI::App& make, PackageCommand& command) {
  PackageDraft& said = command.said;
  make.add_option("--manifest", command.manifest,
                  "File with all of the following except --key and -o (YAML)");
  make.add_option("--node", said.node, "Node");
  make.add_option("--kind", said.kind, "replace or new")->check(CLI::IsMember({"replace", "new"}));
  make.add_option("--counter", said.counter, "One more than that of the node's last package");
  make.add_option("--sources", said.sources, "Files, and folders: all .cpp, .hpp and .h below them");
  make.add_option("--root", said.root,
                  "Folder to which names in the package are relative (default: the one folder of --sources, "
                  "otherwise the current one)");
  make.add_option("--option", said.options, "Option of the compiler (default: -O2)")
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
      ->allow_extra_args(false);
  make.add_option("--self-test", said.self_test_s, "Seconds the self-test may take (default: 10)");
  make.add_option("--probation", said.probation_s, "Seconds (default: 300)");
  make.add_option("--ring-after", said.ring_after, "New node: node that checks it");
  make.add_option("--deployment-entry", said.deployment_entry, "New node: its deployment entry (YAML)");
  make.add_option("--fragment", said.fragment, "Fragment of the mission dictionary (YAML) to include");
  make.add_option("--binary", said.binary, "Program built from these sources here; its SHA-256 is included");
  make.add_option("--key", command.seed, "Seed that signs")->required();
  make.add_option("-o,--output", command.output, "The package")->required();
}

}  // namespace

CLI::App& define_package(CLI::App& app, PackageArguments& arguments, double& timeout_s) {
  PackageCommand& command = arguments.command;
  auto* package =
      app.add_subcommand("package", "Packages of sources that become a node's program")->fallthrough();
  package->require_subcommand(1);
  define_make(*package->add_subcommand("make", "Make and sign a package"), command);
  auto* keygen = package->add_subcommand("keygen", "Make a key pair; never replaces a file");
  keygen->add_option("seed", command.seed, "File of the seed, which signs: stays on the ground")->required();
  keygen->add_option("public", command.key, "File of the public key: VAR/keys/package.pub on board")
      ->required();
  auto* show = package->add_subcommand("show", "Show manifest, sizes, signature");
  show->add_option("file", command.file, "The package")->required();
  show->add_option("--key-public", command.key, "Public key that should have signed it");
  auto* verify = package->add_subcommand("verify", "Check everything that the spacecraft verifies");
  verify->add_option("file", command.file, "The package")->required();
  verify->add_option("--public", command.key, "Public key")->required();
  verify->add_option("--last-counter", command.last_counter, "Counter of the node's last accepted package")
      ->capture_default_str();
  auto* install =
      package->add_subcommand("install", "Send a package up and have it built, tested and activated");
  install->add_option("file", command.file, "The package")->required();
  install->add_option("--public", command.key,
                      "Key to verify it with first (default: VAR/keys/package.pub, if it exists)");
  install->add_flag("--no-activate", arguments.no_activate, "Only build and test it; the version is stored");
  install->add_option("--timeout", timeout_s, "Seconds for the whole installation")
      ->check(CLI::Range(0.001, 86400.0));
  for (auto* sub : package->get_subcommands({})) sub->fallthrough();
  return *package;
}

}  // namespace srfs::ground
