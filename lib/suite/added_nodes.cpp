// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/added_nodes.hpp"

#include <algorithm>

#include <fmt/format.h>
#include <sys/stat.h>

#include "base/crc32c.hpp"
#include "base/file.hpp"
#include "base/text.hpp"

namespace srfs::suite {
namespace {

constexpr std::string_view head = "# Nodes that were added to the suite. Written by SRFS.\n";
constexpr std::string_view checksum_key = "# crc32c ";
constexpr std::size_t checksum_octets = 8;
constexpr int format = 1;
// Escaping makes an octet up to four.
constexpr std::size_t largest_file =
    AddedNodes::nodes_max * 4 * (2 * AddedNodes::description_octets_max + AddedNodes::dictionary_octets_max) +
    4096;

/// A double-quoted scalar of YAML, on one line.
std::string yaml_text(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    const auto octet = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (c == '\n') {
      out += "\\n";
    } else if (octet < 0x20 || octet == 0x7F) {
      out += fmt::format("\\x{:02x}", octet);
    } else {
      out += c;
    }
  }
  return out + '"';
}

AddedNode read_added_node(const ConfigSection& section) {
  AddedNode node{section.text("node"), section.text("ring_after"), section.text("description"),
                 section.text("dictionary")};
  if (section.has("flag"))
    node.flag = static_cast<std::size_t>(section.integer("flag", 0, slots_at_most - 1));
  node.slot = section.text("slot", "");
  section.finish();
  if (node.slot.size() > AddedNodes::description_octets_max)
    throw section.bad("slot", fmt::format("{} octets at most", AddedNodes::description_octets_max));
  if (node.description.size() > AddedNodes::description_octets_max)
    throw section.bad("description", fmt::format("{} octets at most", AddedNodes::description_octets_max));
  if (node.dictionary.size() > AddedNodes::dictionary_octets_max)
    throw section.bad("dictionary", fmt::format("{} octets at most", AddedNodes::dictionary_octets_max));
  return node;
}

/// Its peripheral may be on the bus from the start (`peripherals` of the file), at the same place then.
std::string refusal_of_peripheral(const Deployment& d, const NodeEntry& entry) {
  const Peripheral* const known = d.peripheral_of(entry.name);
  const Peripheral* const place = entry.peripheral ? &*entry.peripheral : known;
  if (place != nullptr && place->bus != d.buses.front().name)
    return fmt::format("the peripheral of an added node is on the bus '{}'", d.buses.front().name);
  if (!entry.peripheral) return "";
  if (known == nullptr) return refusal_of_place(*entry.peripheral, d.peripherals);
  if (*known == *entry.peripheral) return "";
  return fmt::format("the deployment has its peripheral at CAN address {:#04x}, power line {}",
                     known->can_address, known->power_line);
}

/// What is wrong with a node that is to be added to @p d; empty: it is added.
std::string add(Deployment& d, const AddedNode& node) {
  AddedDescription description = read_added_description(node);
  if (d.find(node.name) != nullptr) return "the deployment already has a node with this name";
  for (const auto& [key, uri] : description.devices) {
    const auto known = d.devices.find(key);
    if (known != d.devices.end() && known->second != uri)
      return fmt::format("device '{}' is {} in the deployment", key, known->second);
  }
  if (const std::string refusal = refusal_of_peripheral(d, description.entry); !refusal.empty())
    return refusal;
  if (description.slot) {
    if (!node.flag || *node.flag >= slots_at_most) return "no position for its task flag";
    std::vector<Slot>& slots = d.buses.front().slots;
    if (*node.flag < slots.size() && !slots[*node.flag].payload.empty())
      return fmt::format("task flag {} belongs to {}", *node.flag, slots[*node.flag].payload);
    if (slots.size() <= *node.flag) slots.resize(*node.flag + 1);
    slots[*node.flag] = std::move(*description.slot);
  }
  d.devices.insert(description.devices.begin(), description.devices.end());
  if (description.entry.peripheral && d.peripheral_of(node.name) == nullptr)
    d.peripherals.push_back(*description.entry.peripheral);
  if (description.entry.worker_deadline == description.entry.worker_deadline.zero())
    description.entry.worker_deadline = d.ring.worker_deadline;
  d.nodes.push_back(std::move(description.entry));
  d.added.push_back(node);
  return "";
}

}  // namespace

const AddedNode* AddedNodes::find(std::string_view node) const {
  const auto found =
      std::find_if(nodes.begin(), nodes.end(), [&](const AddedNode& n) { return n.name == node; });
  return found == nodes.end() ? nullptr : &*found;
}

std::string to_text(const AddedNodes& added) {
  std::string text = fmt::format("{}format: {}\nrevision: {}\nnodes:", head, format, added.revision);
  if (added.nodes.empty()) text += " []";
  text += '\n';
  for (const AddedNode& node : added.nodes) {
    text +=
        fmt::format("  - node: {}\n    ring_after: {}\n", yaml_text(node.name), yaml_text(node.ring_after));
    if (node.flag) text += fmt::format("    flag: {}\n", *node.flag);
    if (!node.slot.empty()) text += fmt::format("    slot: {}\n", yaml_text(node.slot));
    text += fmt::format("    description: {}\n    dictionary: {}\n", yaml_text(node.description),
                        yaml_text(node.dictionary));
  }
  return text + fmt::format("{}{:08x}\n", checksum_key, crc32c(as_octets(text)));
}

Result<AddedNodes, std::string> added_nodes_from_text(const std::string& text) {
  if (!text.starts_with(head)) return Err(std::string("not a list of added nodes"));
  const auto sum_begin = text.rfind(checksum_key);
  if (sum_begin == std::string::npos ||
      text.size() != sum_begin + checksum_key.size() + checksum_octets + 1 || text.back() != '\n')
    return Err(std::string("cut off"));
  const std::string_view all = text;
  const auto sum = to_number<std::uint32_t>(all.substr(sum_begin + checksum_key.size(), checksum_octets), 16);
  if (sum != crc32c(as_octets(all.substr(0, sum_begin)))) return Err(std::string("wrong checksum"));
  try {
    const ConfigSection root = ConfigSection::parse(text, "added_nodes");
    (void)root.integer("format", format, format);
    AddedNodes added;
    added.revision = static_cast<std::uint32_t>(root.integer("revision", 0, UINT32_MAX));
    for (const ConfigSection& section : root.sections("nodes")) {
      if (added.nodes.size() == AddedNodes::nodes_max)
        throw root.bad("nodes", fmt::format("{} entries at most", AddedNodes::nodes_max));
      added.nodes.push_back(read_added_node(section));
    }
    root.finish();
    return added;
  } catch (const ConfigError& e) {
    return Err(std::string(e.what()));
  }
}

std::filesystem::path added_nodes_file(const VarPaths& var) {
  return var.state("suite") / "added_nodes";
}

AddedNodesReading read_added_nodes(const VarPaths& var) {
  const auto file = added_nodes_file(var);
  std::error_code ec;
  if (!std::filesystem::exists(file, ec) && !ec) return {};
  const auto text = read_file(file, largest_file);
  if (!text) return {{}, text.error().message};
  auto added = added_nodes_from_text(*text);
  if (!added) return {{}, fmt::format("{}: {}", file.string(), added.error())};
  return {std::move(*added), {}};
}

DeploymentReading with_added(Deployment file, const AddedNodes& added) {
  DeploymentReading reading{std::move(file), {}};
  reading.deployment.added_revision = added.revision;
  for (const AddedNode& node : added.nodes) {
    std::string problem;
    try {
      problem = add(reading.deployment, node);
    } catch (const ConfigError& e) {
      problem = e.what();
    }
    if (!problem.empty())
      reading.problems.push_back(fmt::format("added node {} is ignored: {}", node.name, problem));
  }
  return reading;
}

namespace {

DeploymentReading with_list(Deployment file, const VarPaths& var) {
  const AddedNodesReading added = read_added_nodes(var);
  DeploymentReading reading = with_added(std::move(file), added.added);
  if (!added.damage.empty()) reading.problems.push_back(added.damage + "; continuing without added nodes");
  reading.deployment.added_problems = reading.problems;
  return reading;
}

}  // namespace

DeploymentReading load_deployment(const std::filesystem::path& file, const VarPaths& var) {
  Deployment deployment = Deployment::load(file);
  return with_list(std::move(deployment), var);
}

LiveDeployment::LiveDeployment(Deployment file, VarPaths var)
    : file_(std::move(file)), var_(std::move(var)), stamp_(stamp()), first_(read()), current_(first_.get()) {}

bool LiveDeployment::refresh() {
  std::string now = stamp();
  if (now == stamp_) return false;
  stamp_ = std::move(now);
  std::unique_ptr<const Deployment> fresh = read();
  const Deployment& old = current();
  if (fresh->added_revision == old.added_revision && fresh->added == old.added &&
      fresh->added_problems == old.added_problems)
    return false;
  later_[next_] = std::move(fresh);
  current_.store(later_[next_].get(), std::memory_order_release);
  next_ = (next_ + 1) % kept;
  return true;
}

std::string LiveDeployment::stamp() const {
  struct stat status {};
  if (stat(added_nodes_file(var_).c_str(), &status) != 0) return "";
  return fmt::format("{}.{}.{}.{}", status.st_ino, status.st_mtim.tv_sec, status.st_mtim.tv_nsec,
                     status.st_size);
}

std::unique_ptr<const Deployment> LiveDeployment::read() {
  return std::make_unique<const Deployment>(with_list(file_, var_).deployment);
}

}  // namespace srfs::suite
