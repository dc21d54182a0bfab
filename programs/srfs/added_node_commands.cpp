// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/added_node_commands.hpp"

#include <fmt/format.h>

#include "base/file.hpp"
#include "programs/srfs/answer.hpp"
#include "suite/launcher.hpp"
#include "suite/node_addition.hpp"
#include "suite/node_versions.hpp"

namespace srfs::tool {
namespace {

constexpr milliseconds patience_with_the_ring{4000};  // it may start the node first

/// What the manifest beside a package's sources (ground/README.md) says of its node.
Result<suite::AddedNode, std::string> read_package(const std::filesystem::path& folder) {
  const auto text_of = [&](const ConfigSection& manifest, const char* key, std::size_t most) {
    const std::string file = manifest.text(key, "");
    if (file.empty()) return std::string();
    auto text = read_file(folder / file, most);
    if (!text) throw ConfigError(text.error().message);
    return std::move(*text);
  };
  try {
    const ConfigSection manifest = ConfigSection::load(folder / "package.yaml");
    suite::AddedNode node;
    node.name = manifest.text("node");
    node.ring_after = manifest.text("ring_after", "");
    node.description = text_of(manifest, "deployment_entry", suite::AddedNodes::description_octets_max);
    node.dictionary = text_of(manifest, "fragment", suite::AddedNodes::dictionary_octets_max);
    if (manifest.has("slot")) {
      const ConfigSection slot = manifest.section("slot");
      const auto ms = [&](const char* key) { return milliseconds(slot.integer(key, 0, 60000)); };
      node.slot = suite::slot_text({slot.text("payload", node.name), ms("allotted_ms"), ms("overrun_ms"),
                                    ms("reset_ms"), slot.text("after", "")});
      slot.finish();
    }
    return node;
  } catch (const ConfigError& e) {
    return Err(std::string(e.what()));
  }
}

/// The program becomes the active version.
Result<void, std::string> store_program(const suite::VarPaths& var, const std::string& node,
                                        const std::filesystem::path& program, seconds probation) {
  return suite::change_versions(var, node, [&](update::VersionStore& store) -> Result<void, std::string> {
    const auto number = store.add(program, program.string(), system_utc_now());
    if (!number) return Err(number.error());
    if (const auto used = store.use(*number, probation, "it is added again"); !used) return used;
    return probation > seconds(0) ? Result<void, std::string>() : store.commit(*number);
  });
}

}  // namespace

int add_node(const Target& target, const std::filesystem::path& folder, const std::filesystem::path& program,
             seconds probation, bool json) {
  const auto node = read_package(folder);
  if (!node) return fail(CommandExit::usage, node.error(), json);
  if (target.deployment.find(node->name) != nullptr)
    return fail(CommandExit::refused, fmt::format("the suite already has a node '{}'", node->name), json);
  std::error_code ec;
  const bool had_versions = std::filesystem::exists(suite::versions_folder(target.var, node->name), ec);
  const auto stored = store_program(target.var, node->name, program, probation);
  const auto added = stored ? suite::add_node(target.var, target.deployment, *node)
                            : Result<void, std::string>(Err(stored.error()));
  if (!added) {
    if (!had_versions) std::filesystem::remove_all(suite::versions_folder(target.var, node->name), ec);
    return fail(CommandExit::refused, fmt::format("{}: {}", node->name, added.error()), json);
  }
  const auto now = suite::load_deployment(target.deployment.file, target.var);
  const suite::NodeEntry* entry = now.deployment.find(node->name);
  std::optional<pid_t> pid;
  std::string problem;
  if (running_domain(target) && entry != nullptr) {  // else it is for `srfs up`
    const suite::LaunchRequest request{now.deployment, target.var, suite::suite_bin_folder(),
                                       "added by command"};
    const auto launched = suite::launch(request, *entry, patience_with_the_ring);
    if (launched) pid = *launched;
    if (!launched) problem = launched.error();
  }
  if (!problem.empty())
    return fail(CommandExit::refused,
                fmt::format("{} was added to the suite, but does not start: {}", node->name, problem), json);
  return done(
      fmt::format("{} was added to the suite{}", node->name, pid ? fmt::format(", pid {}", *pid) : ""), json,
      {{"node", node->name}, {"pid", pid ? Json(*pid) : Json(nullptr)}});
}

int remove_node(const Target& target, const std::string& node, bool json) {
  const auto removed = suite::remove_node(target.var, node);
  if (!removed) return fail(CommandExit::refused, removed.error(), json);
  return done(fmt::format("{} was removed from the suite", node), json, {{"node", node}});
}

int list_added_nodes(const Target& target, bool json) {
  const auto turns = suite::turns_of(target.deployment.buses.front().slots);
  Json list = Json::array();
  for (const suite::AddedNode& node : target.deployment.added) {
    const suite::AddedDescription description = suite::read_added_description(node);
    list.push_back(
        {{"name", node.name},
         {"ring_after", node.ring_after.empty() ? Json(nullptr) : Json(node.ring_after)},
         {"flag", node.flag ? Json(*node.flag) : Json(nullptr)},
         {"allotted_ms", description.slot ? Json(description.slot->allotted.count()) : Json(nullptr)},
         {"dictionary_octets", node.dictionary.size()}});
    if (json) continue;
    fmt::print("{}: checked by {}, {}, dictionary fragment of {} octets\n", node.name,
               node.ring_after.empty() ? "the last node" : node.ring_after,
               description.slot ? fmt::format("CAN slot of {} ms (flag {})",
                                              description.slot->allotted.count(), *node.flag)
                                : "no CAN slot",
               node.dictionary.size());
  }
  if (json) {
    std::cout << Json{{"revision", target.deployment.added_revision}, {"turns", turns}, {"nodes", list}}.dump(
                     2)
              << "\n";
  } else if (target.deployment.added.empty()) {
    fmt::print("no nodes were added\n");
  }
  return static_cast<int>(CommandExit::done);
}

}  // namespace srfs::tool
