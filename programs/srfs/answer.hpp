// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <iostream>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

/// How a command answers: one line for people, or one JSON object with `ok`.
namespace srfs::tool {

using Json = nlohmann::ordered_json;

/// Exit codes of the commands to one node.
enum class CommandExit : int {
  done = 0,
  refused = 1,        ///< the node refused, or what was asked for failed
  usage = 2,          ///< no such node, no such value
  still_running = 3,  ///< a transition that has not ended within the deadline; it goes on
  no_answer = 4,      ///< the node does not answer
};

/// One line.
inline void print(const Json& json) {
  std::cout << json.dump(-1, ' ', false, Json::error_handler_t::replace) << "\n";
}

/// Says why a command did not do what it should. @return its exit code
inline int fail(CommandExit exit, const std::string& why, bool json) {
  if (json) {
    print({{"ok", false}, {"error", why}});
  } else {
    fmt::print(stderr, "srfs: {}\n", why);
  }
  return static_cast<int>(exit);
}

inline int no_node(const std::string& node, bool json) {
  return fail(CommandExit::usage, fmt::format("no node '{}' in the deployment", node), json);
}

/// Says that a command did what it should. @param facts  for programs, beside `ok` @return its exit code
inline int done(const std::string& what, bool json, Json facts = Json::object()) {
  if (json) {
    Json all{{"ok", true}};
    all.update(facts);
    print(all);
  } else {
    fmt::print("{}\n", what);
  }
  return static_cast<int>(CommandExit::done);
}

}  // namespace srfs::tool
