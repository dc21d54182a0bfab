// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/program/verbs.hpp"

#include <filesystem>

#include "ground/files.hpp"
#include "ground/remote.hpp"

namespace srfs::ground::program {
namespace {

// One function for each subcommand. What can be checked is checked before the port is opened.
namespace verbs {

Exit put(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const std::string name =
      a.destination.empty() ? std::filesystem::path(a.source).filename().string() : a.destination;
  if (const auto wrong = wrong_name_on_board(name)) return fail(a, *wrong);
  return with_console(operation, link_of(a), {.files = true},
                      [&](Console& console) { return console.put(a.source, name, duration(a.timeout_s)); });
}

Exit files(const Operation& operation) {
  const Arguments& a = operation.arguments;
  return with_console(operation, link_of(a), {.files = true},
                      [&](Console& console) { return console.files(duration(a.duration_s)); });
}

Exit remote(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const auto request = remote_request(a.action, a.words, system_utc_now());
  if (!request) return fail(a, request.error());
  if (const auto wrong = wrong_telecommand(operation, request->telecommands)) return fail(a, *wrong);
  return with_console(operation, link_of(a), {.files = !request->awaited_file.empty()},
                      [&](Console& console) { return console.remote(*request, duration(a.timeout_s)); });
}

}  // namespace verbs

}  // namespace

void define_files(CLI::App& app, Arguments& a) {
  CLI::App& put =
      add(app, a, "put", "Send a file up and wait until the spacecraft has it (CFDP)", verbs::put);
  put.add_option("file", a.source, "The file")->required()->check(CLI::ExistingFile);
  put.add_option("name", a.destination, "Its name on board (default: the file's)");
  add_timeout(put, a);
  add_duration(
      add(app, a, "files", "Transfer files up and down; received files are in STATE/files", verbs::files), a);
  CLI::App& remote =
      add(app, a, "remote", "The folder of files on board (PUS 23): " + remote_actions(), verbs::remote);
  remote.add_option("action", a.action, "Action")->required();
  remote.add_option("words", a.words, "Arguments of the action");
  add_timeout(remote, a);
}

}  // namespace srfs::ground::program
