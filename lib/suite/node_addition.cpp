// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/node_addition.hpp"

#include <algorithm>
#include <csignal>
#include <set>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/file.h>

#include "base/file.hpp"
#include "base/log.hpp"
#include "base/private_file.hpp"
#include "base/process.hpp"
#include "msgs/mission/dictionary.hpp"
#include "suite/launcher.hpp"
#include "suite/node_versions.hpp"
#include "suite/ring/node_record.hpp"

namespace srfs::suite {
namespace {

constexpr milliseconds longest_wait_for_list{2000};
constexpr milliseconds longest_wait_for_restart{3000};
constexpr milliseconds patience_with_end{1000};

/// One writer of the list at a time. The file left behind means nothing.
Result<Fd, std::string> lock_list(const VarPaths& var) {
  std::filesystem::path path = added_nodes_file(var);
  path += ".lock";
  std::error_code ec;
  std::filesystem::create_directories(path.parent_path(), ec);
  Fd lock = open_lock_file(path);
  if (!lock) return Err(fmt::format("{}: {}", path.string(), errno_text(errno)));
  const MonotonicTime deadline = monotonic_now() + longest_wait_for_list;
  while (flock(lock.get(), LOCK_EX | LOCK_NB) != 0) {
    if (monotonic_now() >= deadline) return Err(std::string("another node is being added or removed"));
    poll(nullptr, 0, 5);
  }
  return lock;
}

/// The commit point.
Result<void, std::string> write_list(const VarPaths& var, AddedNodes added) {
  ++added.revision;
  const std::string text = to_text(added);
  if (added_nodes_from_text(text) != added)
    return Err(std::string("the description or the dictionary fragment is not plain UTF-8 text"));
  if (const auto written = write_file_atomically(added_nodes_file(var), text); !written)
    return Err(written.error().message);
  return {};
}

/// The lowest position behind the file's own that no other node has.
std::optional<std::size_t> free_flag(const Deployment& file, const AddedNodes& added) {
  std::set<std::size_t> taken;
  for (const AddedNode& node : added.nodes) {
    if (node.flag) taken.insert(*node.flag);
  }
  for (std::size_t flag = file.buses.front().slots.size(); flag < slots_at_most; ++flag) {
    if (!taken.contains(flag)) return flag;
  }
  return std::nullopt;
}

/// What does not fit in the fragments together, or that it is about another node.
Result<void, std::string> check_fragments(const AddedNodes& added, const std::filesystem::path& folder) {
  std::vector<mission::Fragment> fragments;
  for (const AddedNode& node : added.nodes) {
    if (node.dictionary.empty()) continue;
    fragments.push_back({node.name + "'s dictionary fragment", node.dictionary});
  }
  const AddedNode& last = added.nodes.back();
  if (last.dictionary.empty()) return {};
  const auto about = fragments.back().node();
  if (about && *about != last.name)
    return Err(fmt::format("the dictionary fragment describes {}, not {}", *about, last.name));
  try {
    (void)mission::Dictionary::load(folder, fragments);
    return {};
  } catch (const ConfigError& e) {
    return Err(std::string(e.what()));
  }
}

Result<void, std::string> check_program(const VarPaths& var, const std::string& node) {
  const auto [table, problem] = read_versions(var, node);
  if (!problem.empty()) return Err(fmt::format("versions of {}: {}", node, problem));
  const update::Version* active = table.find(table.active());
  if (table.active() == update::golden || active == nullptr)
    return Err(fmt::format("{} has no program: none of its versions is active", node));
  update::PosixVersionFiles files(versions_folder(var, node));
  const update::VersionStore store(files, node);
  if (const auto damage = store.damage(*active)) return Err(*damage);
  return {};
}

/// Gives the node its flag and says what does not fit. @param added  without the node
Result<void, std::string> check(const Deployment& file, const AddedNodes& added, AddedNode& node) {
  if (std::max(node.description.size(), node.slot.size()) > AddedNodes::description_octets_max)
    return Err(fmt::format("the description has more than {} octets", AddedNodes::description_octets_max));
  if (node.dictionary.size() > AddedNodes::dictionary_octets_max)
    return Err(
        fmt::format("the dictionary fragment has more than {} octets", AddedNodes::dictionary_octets_max));
  if (added.nodes.size() == AddedNodes::nodes_max)
    return Err(fmt::format("{} nodes are added already, no more are allowed", AddedNodes::nodes_max));
  const AddedDescription description = read_added_description(node);
  const Deployment before = with_added(file, added).deployment;
  if (!node.ring_after.empty() && before.find(node.ring_after) == nullptr)
    return Err(fmt::format("the ring has no node '{}' to check it", node.ring_after));
  node.flag.reset();
  if (description.slot) {
    const auto turns = turns_of(before.buses.front().slots);
    const std::string& after = description.slot->after;
    if (!after.empty() && std::find(turns.begin(), turns.end(), after) == turns.end())
      return Err(fmt::format("slot.after: '{}' has no slot", after));
    node.flag = free_flag(file, added);
    if (!node.flag) return Err(fmt::format("all {} places of the slot plan are taken", slots_at_most));
  }
  AddedNodes alone;
  alone.nodes.push_back(node);
  const DeploymentReading after = with_added(before, alone);
  if (!after.problems.empty()) return Err(after.problems.front());
  return {};
}

/// Ends the node's process, if there is one. Under its restart lock.
Result<void, std::string> stop_process(const VarPaths& var, const std::string& node) {
  auto process = open_instance(var, node);
  if (!process) {
    if (auto starting = find_starting(var, node)) process = std::move(starting->process);
  }
  if (!process) return {};
  process->signal(SIGTERM);
  process->signal(SIGCONT);  // a stopped process would sleep through it
  if (process->wait_for_exit(patience_with_end)) return {};
  process->signal(SIGKILL);
  if (process->wait_for_exit(patience_with_end)) return {};
  return Err(fmt::format("the process of {} cannot be killed", node));
}

/// Removes what is not needed any more. Best effort: the node is gone already.
void clean_up(const VarPaths& var, const std::string& node) {
  std::error_code ec;
  std::filesystem::remove_all(versions_folder(var, node), ec);
  std::filesystem::remove(var.state(node) / "hold", ec);
  std::filesystem::remove(var.state(node) / "desired_state", ec);
  std::filesystem::remove(var.instance_lock(node), ec);
  std::filesystem::remove(var.restart_lock(node), ec);
  std::vector<std::filesystem::path> marks;
  for (const auto& entry : std::filesystem::directory_iterator(var.memory(), ec)) {
    const auto name = entry.path().filename();
    if (name.string().starts_with(node + ".")) marks.push_back(entry.path());
  }
  for (const auto& mark : marks) std::filesystem::remove(mark, ec);
}

}  // namespace

AddedNode added_node_of(const update::Manifest& manifest, std::string dictionary) {
  AddedNode node;
  node.name = manifest.node;
  node.ring_after = manifest.ring_after.value_or("");
  node.description = manifest.deployment.value_or("");
  node.dictionary = std::move(dictionary);
  if (const auto& slot = manifest.slot) {
    node.slot = slot_text(
        {slot->payload.value_or(manifest.node), slot->allotted, slot->overrun, slot->reset, slot->after});
  }
  return node;
}

Result<void, std::string> add_node(const VarPaths& var, const Deployment& deployment, AddedNode node,
                                   const std::filesystem::path& dictionary) {
  const auto lock = lock_list(var);
  if (!lock) return Err(lock.error());
  const AddedNodesReading reading = read_added_nodes(var);
  AddedNodes added = reading.added;
  if (const AddedNode* known = added.find(node.name)) {
    node.flag = known->flag;
    if (*known == node) return {};
    return Err(fmt::format("{} is added already, with different settings", node.name));
  }
  try {
    const Deployment file = Deployment::load(deployment.file);
    if (const auto fits = check(file, added, node); !fits) return fits;
    added.nodes.push_back(node);
    if (const auto fits = check_fragments(added, dictionary); !fits) return fits;
  } catch (const ConfigError& e) {
    return Err(std::string(e.what()));
  }
  if (const auto there = check_program(var, node.name); !there) return there;
  if (!reading.damage.empty()) {
    log::error("{}; set aside", reading.damage);
    std::filesystem::path aside = added_nodes_file(var);
    aside += ".damaged";
    std::error_code ec;
    std::filesystem::rename(added_nodes_file(var), aside, ec);
  }
  return write_list(var, std::move(added));
}

Result<void, std::string> add_node(const VarPaths& var, const Deployment& deployment, AddedNode node) {
  const auto folder =
      deployment.dictionary.empty() ? mission::Dictionary::default_folder() : deployment.dictionary;
  return add_node(var, deployment, std::move(node), folder);
}

Result<void, std::string> remove_node(const VarPaths& var, const std::string& node) {
  const auto list_lock = lock_list(var);
  if (!list_lock) return Err(list_lock.error());
  AddedNodesReading reading = read_added_nodes(var);
  if (!reading.damage.empty()) return Err(reading.damage);
  if (reading.added.find(node) == nullptr) return Err(fmt::format("{} is not an added node", node));
  auto lock = RestartLock::take(var, node);
  const MonotonicTime deadline = monotonic_now() + longest_wait_for_restart;
  while (!lock && lock.error().held && monotonic_now() < deadline) {
    poll(nullptr, 0, 2);
    lock = RestartLock::take(var, node);
  }
  if (!lock) return Err(lock.error().text);
  // Before the list: from then on no process would watch over it, or end it.
  if (const auto stopped = stop_process(var, node); !stopped) return stopped;
  std::erase_if(reading.added.nodes, [&](const AddedNode& n) { return n.name == node; });
  if (const auto written = write_list(var, std::move(reading.added)); !written) return written;
  clean_up(var, node);
  return {};
}

}  // namespace srfs::suite
