// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/deployment.hpp"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "base/file.hpp"
#include "base/known_key.hpp"

namespace srfs::suite {
namespace {

constexpr int tm_sealed_frame_octets_min = 43;  ///< security fields and an idle packet

Scheduling read_scheduling(const ConfigSection& section) {
  Scheduling s;
  const std::string policy = section.choice("policy", {"other", "fifo", "batch", "idle"}, "other");
  s.policy = policy == "fifo"    ? SchedulingPolicy::fifo
             : policy == "batch" ? SchedulingPolicy::batch
             : policy == "idle"  ? SchedulingPolicy::idle
                                 : SchedulingPolicy::other;
  s.priority = static_cast<int>(section.integer("priority", 0, 99, 0));
  if (s.policy == SchedulingPolicy::fifo && s.priority == 0)
    throw section.bad("priority", "an integer from 1 to 99 with policy fifo");
  if (s.policy != SchedulingPolicy::fifo && s.priority != 0)
    throw section.bad("priority", "0 unless the policy is fifo");
  s.nice = static_cast<int>(section.integer("nice", -20, 19, 0));
  for (const auto cpu : section.integers("cpus", 0, 1023)) s.cpus.push_back(static_cast<int>(cpu));
  s.background = section.boolean("background", s.background);
  if (s.background && s.policy == SchedulingPolicy::fifo)
    throw section.bad("background", "false with policy fifo");
  section.finish();
  return s;
}

MemorySettings read_memory(const ConfigSection& section) {
  MemorySettings m;
  m.lock = section.boolean("lock", m.lock);
  m.stack_kib = static_cast<int>(section.integer("stack_kib", 0, 4096, m.stack_kib));
  section.finish();
  return m;
}

bool is_node_name(const std::string& name) {
  return !name.empty() && name.size() <= 32 &&
         name.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_") == std::string::npos;
}

std::string read_control_group(const ConfigSection& section) {
  std::string group = section.text("control_group", "");
  if (group.starts_with('/') || group.find("..") != std::string::npos)
    throw section.bad("control_group", "a folder below /sys/fs/cgroup, such as srfs.slice/srfs.service");
  return group;
}

std::vector<ros::RemapRule> read_remaps(const ConfigSection& section, const std::string& node) {
  std::vector<ros::RemapRule> rules;
  for (const std::string& text : section.texts("remap")) {
    auto rule = ros::parse_remap_rule(text);
    const std::string refusal = rule ? refusal_of_remap(*rule, node) : rule.error();
    if (!refusal.empty()) throw section.bad("remap", fmt::format("a list of FROM:=TO ({})", refusal));
    rules.push_back(std::move(*rule));
  }
  return rules;
}

Peripheral read_peripheral(const ConfigSection& section, std::string payload) {
  Peripheral peripheral{
      std::move(payload),
      static_cast<std::uint8_t>(
          section.integer("can_address", Peripheral::lowest_can_address, Peripheral::highest_can_address)),
      static_cast<std::uint8_t>(section.integer("power_line", 0, Peripheral::power_lines - 1)),
      section.text("bus", "can")};
  for (const std::int64_t id : section.integers("answers", 0, 0x1FFFFFFF))
    peripheral.answers.push_back(static_cast<std::uint32_t>(id));
  section.finish();
  return peripheral;
}

/// All but the name, the executable and finish().
NodeEntry read_entry(const ConfigSection& section, const std::string& name, std::string executable) {
  NodeEntry entry{name,
                  std::move(executable),
                  read_scheduling(section.section("scheduling")),
                  read_memory(section.section("memory")),
                  section.integer("memory_limit_mib", 0, 65536, 0),
                  static_cast<int>(section.integer("oom_score_adj", -1000, 1000, 0)),
                  std::chrono::milliseconds(section.integer("worker_deadline_ms", 100, 3'600'000, 0)),
                  section.text("user", ""),
                  read_control_group(section),
                  section.section("parameters"),
                  read_remaps(section, name),
                  section.boolean("needed", true)};
  if (section.has("peripheral")) entry.peripheral = read_peripheral(section.section("peripheral"), name);
  return entry;
}

NodeEntry read_node(const ConfigSection& section) {
  NodeEntry node = read_entry(section, section.text("name"), section.text("executable"));
  if (!is_node_name(node.name)) throw section.bad("name", "1-32 characters of a-z, 0-9 and _");
  section.finish();
  return node;
}

/// All but finish().
Slot read_slot(const ConfigSection& section, std::string payload) {
  return {std::move(payload), std::chrono::milliseconds(section.integer("allotted_ms", 1, 60000)),
          std::chrono::milliseconds(section.integer("overrun_ms", 0, 60000)),
          std::chrono::milliseconds(section.integer("reset_ms", 1, 60000))};
}

StepPolicy read_step_down(const ConfigSection& section) {
  StepPolicy policy;
  const auto starts = [&](std::string_view key, std::uint32_t fallback) {
    return static_cast<std::uint32_t>(section.integer(key, 1, 1000, fallback));
  };
  policy.last_good = starts("last_good", policy.last_good);
  policy.golden = starts("golden", policy.golden);
  policy.rescue = starts("rescue", policy.rescue);
  policy.calm = seconds(section.integer("calm_s", 60, 31'536'000, policy.calm.count()));
  policy.no_contact = seconds(section.integer("no_contact_s", 10, 31'536'000, policy.no_contact.count()));
  if (!policy.is_sound()) throw section.bad("rescue", "last_good < golden < rescue");
  section.finish();
  return policy;
}

RingSettings read_ring(const ConfigSection& section) {
  using std::chrono::milliseconds;
  RingSettings ring;
  ring.enabled = true;
  const auto duration = [&](std::string_view key, std::int64_t lowest, milliseconds fallback) {
    return milliseconds(section.integer(key, lowest, 3'600'000, fallback.count()));
  };
  ring.period = duration("period_ms", 10, ring.period);
  ring.misses = static_cast<int>(section.integer("misses", 1, 100, ring.misses));
  ring.members = section.texts("members");
  ring.critical = section.texts("critical");
  ring.confirmed = section.texts("confirmed");
  ring.command_path = section.texts("command_path");
  ring.command_path_limit = duration("command_path_limit_ms", 1000, ring.command_path_limit);
  ring.unhealthy_starts =
      static_cast<int>(section.integer("unhealthy_starts", 1, 1000, ring.unhealthy_starts));
  ring.start_deadline = duration("start_deadline_ms", 100, ring.start_deadline);
  ring.absence_counts_misses = section.boolean("absence_counts_misses", ring.absence_counts_misses);
  ring.work_deadline = duration("work_deadline_ms", 100, ring.work_deadline);
  ring.worker_deadline = duration("worker_deadline_ms", 100, ring.worker_deadline);
  ring.deaf_interval = duration("deaf_interval_ms", 0, ring.deaf_interval);
  ring.restarts = static_cast<int>(section.integer("restarts", 1, 1000, ring.restarts));
  ring.window = duration("window_ms", 1000, ring.window);
  ring.first_wait = duration("first_wait_ms", 10, ring.first_wait);
  ring.longest_wait = duration("longest_wait_ms", 10, ring.longest_wait);
  if (ring.longest_wait < ring.first_wait) throw section.bad("longest_wait_ms", "at least first_wait_ms");
  ring.quarantine_deaths =
      static_cast<int>(section.integer("quarantine_deaths", 1, 1000, ring.quarantine_deaths));
  if (ring.quarantine_deaths < ring.restarts) throw section.bad("quarantine_deaths", "at least restarts");
  section.finish();
  return ring;
}

constexpr std::array<std::string_view, 4> commanding_programs{"ttc_node", "maintenance_node", "timing_node",
                                                              "can_switcher_node"};
constexpr std::size_t always_commanding =
    2;  ///< of them; without these nothing can be repaired by telecommand

std::string program_of(const NodeEntry& node) {
  return std::filesystem::path(node.executable).filename().string();
}

void check_command_path(const Deployment& d, const ConfigSection& section) {
  if (d.ring.command_path.empty()) return;
  for (const NodeEntry& node : d.nodes) {
    const auto* const end = commanding_programs.begin() + always_commanding;
    const bool needed = std::find(commanding_programs.begin(), end, program_of(node)) != end;
    if (needed && !d.on_command_path(node.name))
      throw section.bad("command_path",
                        "also '" + node.name + "', without which telecommands repair nothing");
  }
}

void check_ring(Deployment& d, const ConfigSection& section) {
  if (d.ring.members.empty()) {
    for (const NodeEntry& node : d.nodes) d.ring.members.push_back(node.name);
  }
  if (!section.has("confirmed")) {
    for (const std::string& name : d.ring.members) {
      if (name == "ttc" || name == "maintenance") d.ring.confirmed.push_back(name);
    }
  }
  for (const auto& [key, list] :
       {std::pair{"members", &d.ring.members}, std::pair{"critical", &d.ring.critical},
        std::pair{"confirmed", &d.ring.confirmed}, std::pair{"command_path", &d.ring.command_path}}) {
    for (const std::string& name : *list) {
      if (d.find(name) == nullptr) throw section.bad(key, "nodes of this file, '" + name + "' is not one");
      if (std::count(list->begin(), list->end(), name) != 1)
        throw section.bad(key, "different names, '" + name + "' appears twice");
    }
  }
  check_command_path(d, section);
}

void check_names(const Deployment& d, const ConfigSection& root) {
  for (const NodeEntry& node : d.nodes) {
    const auto same = [&](const NodeEntry& other) { return other.name == node.name; };
    if (std::count_if(d.nodes.begin(), d.nodes.end(), same) != 1)
      throw root.bad("nodes", "different names, '" + node.name + "' appears twice");
  }
}

/// `slots` of the first bus, and the further ones.
void read_buses(Deployment& d, const ConfigSection& root) {
  const auto read_slots = [](const ConfigSection& section, Bus& bus) {
    for (const ConfigSection& slot : section.sections("slots")) {
      bus.slots.push_back(read_slot(slot, slot.text("payload")));
      slot.finish();
    }
  };
  read_slots(root, d.buses.front());
  for (const ConfigSection& section : root.sections("buses")) {
    Bus bus{section.text("name"), section.text("switcher")};
    const auto same = [&](const Bus& other) {
      return other.name == bus.name || other.switcher == bus.switcher;
    };
    if (!is_node_name(bus.name)) throw section.bad("name", "1-32 characters of a-z, 0-9 and _");
    if (std::any_of(d.buses.begin(), d.buses.end(), same))
      throw section.bad("name", "another name and switcher than those of the buses before");
    if (!d.devices.contains(bus.name)) throw section.bad("name", "the key of its URI in devices");
    read_slots(section, bus);
    section.finish();
    d.buses.push_back(std::move(bus));
  }
}

void check_slots(const Deployment& d, const Bus& bus, const ConfigSection& root) {
  for (const Slot& slot : bus.slots) {
    if (d.find(slot.payload) == nullptr)
      throw root.bad("slots", "payloads that are nodes of this file, '" + slot.payload + "' is not one");
    if (d.bus_of(slot.payload).name != bus.name && d.peripheral_of(slot.payload) == nullptr)
      throw root.bad("slots", fmt::format("{}: slots on one bus", slot.payload));
    const Peripheral* const place = d.peripheral_of(slot.payload);
    if (place != nullptr && place->bus != bus.name)
      throw root.bad("slots",
                     fmt::format("{}: a slot on the bus of its peripheral, '{}'", slot.payload, place->bus));
  }
}

/// After nodes and peripherals. The nodes of a further bus get its topics.
void check_buses(Deployment& d, const ConfigSection& root) {
  const auto first = d.buses.begin();
  for (const Bus& bus : d.buses) {
    check_slots(d, bus, root);
    if (bus.name != first->name && d.find(bus.switcher) == nullptr)
      throw root.bad("buses",
                     fmt::format("switchers that are nodes of this file, '{}' is not one", bus.switcher));
  }
  for (const Peripheral& peripheral : d.peripherals) {
    const auto is_its = [&](const Bus& bus) { return bus.name == peripheral.bus; };
    if (std::none_of(d.buses.begin(), d.buses.end(), is_its))
      throw root.bad("buses", fmt::format("the bus '{}' of {}", peripheral.bus, peripheral.payload));
  }
  for (NodeEntry& node : d.nodes) {
    const Bus& bus = d.bus_of(node.name);
    if (bus.name == first->name) continue;
    for (const char* topic : {"task_flags", "bus_status", "reset_peripheral"})
      node.remap.push_back(
          {fmt::format("/{}/{}", first->name, topic), fmt::format("/{}/{}", bus.name, topic)});
  }
}

/// Those of the nodes, then those whose node is not of this file.
void read_peripherals(Deployment& d, const ConfigSection& root) {
  const auto place = [&d, &root](const Peripheral& peripheral, std::string_view key) {
    const std::string refusal = refusal_of_place(peripheral, d.peripherals);
    if (!refusal.empty()) throw root.bad(key, fmt::format("peripherals at different places: {}", refusal));
    d.peripherals.push_back(peripheral);
  };
  for (const NodeEntry& node : d.nodes) {
    if (node.peripheral) place(*node.peripheral, "nodes");
  }
  for (const ConfigSection& section : root.sections("peripherals")) {
    const std::string payload = section.text("payload");
    if (!is_node_name(payload)) throw section.bad("payload", "1-32 characters of a-z, 0-9 and _");
    if (d.find(payload) != nullptr)
      throw section.bad("payload", "a payload that is no node of this file: of a node, its entry says it");
    place(read_peripheral(section, payload), "peripherals");
  }
}

}  // namespace

std::string refusal_of_place(const Peripheral& peripheral, const std::vector<Peripheral>& others) {
  for (const Peripheral& other : others) {
    if (other.payload == peripheral.payload) return fmt::format("{} has two", peripheral.payload);
    if (other.bus == peripheral.bus && other.can_address == peripheral.can_address)
      return fmt::format("CAN address {:#04x} is that of {} and of {}", peripheral.can_address, other.payload,
                         peripheral.payload);
    if (other.power_line == peripheral.power_line)
      return fmt::format("power line {} is that of {} and of {}", peripheral.power_line, other.payload,
                         peripheral.payload);
  }
  return {};
}

std::string refusal_of_remap(const ros::RemapRule& rule, const std::string& node) {
  if (rule.from.starts_with("__"))
    return fmt::format("'{}': a suite knows its nodes by their names", rule.from);
  const std::string from = ros::NodeNames(node).resolve(rule.from, ros::NameKind::topic);
  if (from.starts_with("/" + node + "/"))
    return fmt::format("'{}': the suite reaches the node there", rule.from);
  return {};
}

std::vector<std::string> turns_of(const std::vector<Slot>& slots) {
  std::vector<std::string> turns;
  for (const Slot& slot : slots) {
    if (slot.payload.empty()) continue;
    const auto before = std::find(turns.begin(), turns.end(), slot.after);
    turns.insert(slot.after.empty() || before == turns.end() ? turns.end() : before + 1, slot.payload);
  }
  return turns;
}

AddedDescription read_added_description(const AddedNode& node) {
  const ConfigSection root = ConfigSection::parse(node.description, node.name);
  if (!is_node_name(node.name))
    throw ConfigError(node.name + ": expected a name of 1-32 characters of a-z, 0-9 and _");
  AddedDescription description{read_entry(root, node.name, ""), std::nullopt, {}};
  description.entry.added = true;
  if (root.text("name", node.name) != node.name) throw root.bad("name", "the name of the node, or nothing");
  (void)root.text("executable", "");  // its program is in the version store
  if (root.has("slot") || !node.slot.empty()) {
    if (root.has("slot") && !node.slot.empty()) throw root.bad("slot", "one slot");
    const ConfigSection slot =
        node.slot.empty() ? root.section("slot") : ConfigSection::parse(node.slot, node.name + "'s slot");
    if (slot.text("payload", node.name) != node.name)
      throw slot.bad("payload", "the name of the node, or nothing");
    description.slot = read_slot(slot, node.name);
    description.slot->after = slot.text("after", "");
    slot.finish();
  }
  const ConfigSection devices = root.section("devices");
  for (const std::string& key : devices.keys()) description.devices[key] = devices.text(key);
  root.finish();
  return description;
}

std::string slot_text(const Slot& slot) {
  std::string text = "{payload: " + slot.payload + ", allotted_ms: " + std::to_string(slot.allotted.count()) +
                     ", overrun_ms: " + std::to_string(slot.overrun.count()) +
                     ", reset_ms: " + std::to_string(slot.reset.count());
  if (!slot.after.empty()) text += ", after: " + slot.after;
  return text + "}";
}

namespace {

/// All but finish(). After the telecommand channels.
std::optional<TelemetrySecurity> read_tm_security(const ConfigSection& tm, const LinkSettings& link) {
  const bool sealed = tm.choice("sdls", {"none", "strict"}, "none") == "strict";
  // Of a file that this one is laid over they may stand there without it.
  TelemetrySecurity security{sealed || tm.has("spi") ? static_cast<int>(tm.integer("spi", 1, 65534)) : 0,
                             sealed || tm.has("key_file") ? tm.text("key_file") : ""};
  if (!sealed) return std::nullopt;
  for (const TelecommandChannel& channel : link.channels) {
    if (channel.security != ChannelSecurity::sdls) continue;
    if (channel.spi == security.spi) throw tm.bad("spi", "a number not used by a telecommand channel");
    if (channel.key_file == security.key_file)
      throw tm.bad("key_file", "a key not used by a telecommand channel");
  }
  if (link.tm_frame_length < tm_sealed_frame_octets_min)
    throw tm.bad("frame_length", fmt::format("{} at least with sdls", tm_sealed_frame_octets_min));
  return security;
}

/// After all other keys of the link.
void read_key_encryption_keys(const ConfigSection& section, LinkSettings& link) {
  for (const ConfigSection& entry : section.sections("key_encryption_keys")) {
    KeyEncryptionKeyFile key{.id = static_cast<int>(entry.integer("id", 1, 127)),
                             .key_file = entry.text("key_file")};
    for (const KeyEncryptionKeyFile& other : link.key_encryption_keys) {
      if (other.id == key.id) throw entry.bad("id", "a number not used by another entry");
    }
    const std::vector<std::string> used = key_files_of(link);
    if (std::find(used.begin(), used.end(), key.key_file) != used.end())
      throw entry.bad("key_file", "a key not used by another entry");
    entry.finish();
    link.key_encryption_keys.push_back(std::move(key));
  }
}

}  // namespace

std::vector<std::string> key_files_of(const LinkSettings& link) {
  std::vector<std::string> files;
  for (const TelecommandChannel& channel : link.channels) {
    if (channel.security == ChannelSecurity::sdls) files.push_back(channel.key_file);
  }
  for (const KeyEncryptionKeyFile& key : link.key_encryption_keys) files.push_back(key.key_file);
  if (link.tm_security) files.push_back(link.tm_security->key_file);
  return files;
}

void use_self_test_keys(LinkSettings& link) {
  for (TelecommandChannel& channel : link.channels)
    channel.key_file = fmt::format("keys/self_test_{}.key", channel.spi);
  for (KeyEncryptionKeyFile& key : link.key_encryption_keys)
    key.key_file = fmt::format("keys/self_test_master_{}.key", key.id);
  if (link.tm_security) link.tm_security->key_file = "keys/self_test_tm.key";
}

LinkSettings read_link(const ConfigSection& section) {
  LinkSettings link;
  link.spacecraft_id = static_cast<int>(section.integer("spacecraft_id", 0, 1023, link.spacecraft_id));
  link.baud = static_cast<int>(section.integer("baud", 1200, 4'000'000, link.baud));
  const ConfigSection tm = section.section("tm");
  link.tm_interleave = static_cast<int>(tm.integer("interleave", 1, 8, link.tm_interleave));
  link.tm_reed_solomon = tm.boolean("reed_solomon", link.tm_reed_solomon);
  link.tm_frame_length = static_cast<int>(tm.integer("frame_length", 32, 2048, link.tm_frame_length));
  if (link.tm_reed_solomon && link.tm_frame_length != 223 * link.tm_interleave) {
    throw tm.bad("frame_length", "223 x interleave with reed_solomon");
  }
  link.tm_randomizer = tm.boolean("randomizer", link.tm_randomizer);
  link.tm_continuous = tm.boolean("continuous", link.tm_continuous);
  const ConfigSection tc = section.section("tc");
  link.tc_randomizer = tc.boolean("randomizer", link.tc_randomizer);
  link.tc_correct_single_bits = tc.boolean("correct_single_bits", link.tc_correct_single_bits);
  link.tc_strict = tc.choice("sdls", {"standard", "strict"}, "standard") == "strict";
  tc.finish();
  for (const ConfigSection& entry : section.sections("tc_channels")) {
    const auto is_taken = [&link](auto member, const auto& value) {
      return std::any_of(link.channels.begin(), link.channels.end(), [&](const TelecommandChannel& other) {
        return other.security == ChannelSecurity::sdls && other.*member == value;
      });
    };
    TelecommandChannel channel{static_cast<int>(entry.integer("vc", 0, 63)), ChannelSecurity::none, 0, "",
                               AssociationSet::a};
    if (entry.choice("security", {"sdls", "none"}, "sdls") == "sdls") {
      channel.security = ChannelSecurity::sdls;
      channel.spi = static_cast<int>(entry.integer("spi", 1, 65534));
      if (is_taken(&TelecommandChannel::spi, channel.spi))
        throw entry.bad("spi", "a number not used by another entry");
      channel.key_file = entry.text("key_file");
      // Two counters under one key would use an IV twice, which breaks AES-GCM.
      if (is_taken(&TelecommandChannel::key_file, channel.key_file))
        throw entry.bad("key_file", "a key not used by another entry");
      const std::string set = entry.choice("set", {"a", "b", "contingency"}, "a");
      channel.set = set == "a"   ? AssociationSet::a
                    : set == "b" ? AssociationSet::b
                                 : AssociationSet::contingency;
      const auto of_the_same =
          std::count_if(link.channels.begin(), link.channels.end(), [&](const TelecommandChannel& other) {
            return other.virtual_channel == channel.virtual_channel && other.set == channel.set &&
                   other.security == ChannelSecurity::sdls;
          });
      if (of_the_same >= (channel.set == AssociationSet::contingency ? 1 : 2))
        throw entry.bad("set", "at most two entries of a set for a channel, one for contingency");
    }
    entry.finish();
    link.channels.push_back(channel);
  }
  link.tm_security = read_tm_security(tm, link);
  tm.finish();
  read_key_encryption_keys(section, link);
  section.finish();
  return link;
}

Deployment Deployment::load(const std::filesystem::path& file) {
  const ConfigSection root = ConfigSection::load(file);
  Deployment d;
  for (const std::string& each : root.files()) d.extended.push_back(std::filesystem::absolute(each));
  d.file = d.extended.front();
  d.extended.erase(d.extended.begin());
  d.name = root.text("deployment");
  const auto beside_file = [&d](const std::string& path) {
    return (d.file.parent_path() / path).lexically_normal();
  };
  if (root.has("dictionary")) {
    d.dictionary = beside_file(root.text("dictionary"));
    std::error_code ec;
    if (!std::filesystem::exists(d.dictionary / "mission.yaml", ec))
      throw root.bad("dictionary",
                     fmt::format("the folder of mission.yaml, which {} is not", d.dictionary.string()));
  }
  const ConfigSection dds = root.section("dds");
  if (dds.text("domain", "auto") != "auto") d.domain = static_cast<int>(dds.integer("domain", 0, 101));
  d.interfaces = dds.texts("interfaces");
  if (d.interfaces.empty()) d.interfaces = {"127.0.0.1"};
  const std::string graph = dds.choice("ros_graph", {"humble", "iron", "off"}, "humble");
  d.ros_graph = graph == "humble" ? ros::GraphDialect::humble
                : graph == "iron" ? ros::GraphDialect::iron
                                  : ros::GraphDialect::off;
  d.drop_foreign = dds.choice("foreign", {"report", "drop"}, "report") == "drop";
  d.open_orders = dds.choice("orders", {"proven", "open"}, "proven") == "open";
  dds.finish();
  const ConfigSection devices = root.section("devices");
  for (const std::string& key : devices.keys()) d.devices[key] = devices.text(key);
  d.link = read_link(root.section("link"));
  read_buses(d, root);
  for (const ConfigSection& node : root.sections("nodes")) d.nodes.push_back(read_node(node));
  if (d.nodes.empty()) throw root.bad("nodes", "at least one node");
  if (root.has("programs")) {
    const auto programs = beside_file(root.text("programs"));
    for (NodeEntry& node : d.nodes) {
      std::error_code ec;
      if (std::filesystem::exists(programs / node.executable, ec))
        node.executable = (programs / node.executable).string();
    }
  }
  (void)root.has("simulation");  // hw_sim's
  if (root.has("ring")) d.ring = read_ring(root.section("ring"));
  if (root.has("step_down")) d.step_down = read_step_down(root.section("step_down"));
  if (root.has("modes")) {
    d.modes = read_modes(root.section("modes"));
    if (d.find("ttc") == nullptr) d.modes = {};  // nobody would publish the mode
    if (d.modes.critical.empty()) d.modes.critical = d.ring.critical;
  }
  read_peripherals(d, root);
  root.finish();
  check_names(d, root);
  check_buses(d, root);
  if (d.ring.enabled) check_ring(d, root.section("ring"));
  for (NodeEntry& node : d.nodes) {
    if (node.worker_deadline == node.worker_deadline.zero()) node.worker_deadline = d.ring.worker_deadline;
  }
  return d;
}

const NodeEntry* Deployment::find(const std::string& node) const {
  const auto found =
      std::find_if(nodes.begin(), nodes.end(), [&](const NodeEntry& e) { return e.name == node; });
  return found == nodes.end() ? nullptr : &*found;
}

const Bus& Deployment::bus_of(const std::string& node) const {
  const Peripheral* const place = peripheral_of(node);
  for (const Bus& bus : buses) {
    const auto has_turn = [&](const Slot& slot) { return slot.payload == node; };
    if (bus.switcher == node || (place != nullptr && place->bus == bus.name) ||
        std::any_of(bus.slots.begin(), bus.slots.end(), has_turn))
      return bus;
  }
  return buses.front();
}

const Peripheral* Deployment::peripheral_of(const std::string& payload) const {
  const auto found = std::find_if(peripherals.begin(), peripherals.end(),
                                  [&](const Peripheral& p) { return p.payload == payload; });
  return found == peripherals.end() ? nullptr : &*found;
}

namespace {

/// Where a path leads, also when nothing is there now.
std::filesystem::path end_of_links(std::filesystem::path path) {
  std::error_code ec;
  if (auto real = std::filesystem::canonical(path, ec); !ec) return real;
  constexpr int most_links = 40;  // as the kernel's
  for (int i = 0; i < most_links; ++i) {
    const auto target = std::filesystem::read_symlink(path, ec);
    if (ec) break;
    path = path.parent_path() / target;
  }
  return path.lexically_normal();
}

}  // namespace

bool is_hardware_line(const std::string& uri, const std::filesystem::path& var) {
  constexpr std::string_view scheme = "serial:";
  if (!uri.starts_with(scheme)) return false;
  const auto path = var / uri.substr(scheme.size(), uri.find('?') - scheme.size());
  const auto real = end_of_links(path);
  return real.native().starts_with("/dev/") && !real.native().starts_with("/dev/pts/");
}

namespace {

/// nullopt: the key is not publicly known, or cannot be read (ttc reports more).
std::optional<std::string_view> why_known_key_file(const std::filesystem::path& file) {
  constexpr std::size_t key_octets = 32;
  auto text = read_file(file, 4096);
  if (!text) return std::nullopt;
  while (!text->empty() && (text->back() == '\n' || text->back() == '\r')) text->pop_back();
  auto octets = from_hex(*text);
  std::fill(text->begin(), text->end(), '\0');
  if (!octets || octets->size() != key_octets) return std::nullopt;
  const auto why = why_known(*octets);
  std::fill(octets->begin(), octets->end(), std::uint8_t{0});
  return why;
}

}  // namespace

std::string unsafe_link(const Deployment& deployment, const std::filesystem::path& var) {
  const auto line = deployment.devices.find("rs422");
  if (line == deployment.devices.end() || !is_hardware_line(line->second, var)) return {};
  if (deployment.open_orders)
    return fmt::format(
        "{}: 'dds.orders': is open, and {} is a line of hardware: any program on this computer could command "
        "the spacecraft",
        deployment.file.string(), line->second);
  for (const TelecommandChannel& channel : deployment.link.channels) {
    if (channel.security == ChannelSecurity::none)
      return fmt::format(
          "{}: 'link.tc_channels': TC virtual channel {} has no security, and {} is a line of hardware: "
          "anyone on it could command the spacecraft",
          deployment.file.string(), channel.virtual_channel, line->second);
  }
  std::error_code ec;
  if (std::filesystem::exists(var / "state" / "ttc" / "mode", ec)) return {};  // it ran
  for (const TelecommandChannel& channel : deployment.link.channels) {
    if (const auto why = why_known_key_file(var / channel.key_file))
      return fmt::format(
          "{}: 'link.tc_channels': everybody may know the key {} of TC virtual channel {} ({}), and {} is a "
          "line of hardware: make another one",
          deployment.file.string(), channel.key_file, channel.virtual_channel, *why, line->second);
  }
  for (const KeyEncryptionKeyFile& key : deployment.link.key_encryption_keys) {
    if (const auto why = why_known_key_file(var / key.key_file))
      return fmt::format(
          "{}: 'link.key_encryption_keys': everybody may know the key {} ({}), and {} is a line of hardware: "
          "make another one",
          deployment.file.string(), key.key_file, *why, line->second);
  }
  const auto& downlink = deployment.link.tm_security;
  const auto why = downlink ? why_known_key_file(var / downlink->key_file) : std::nullopt;
  if (!why) return {};
  return fmt::format(
      "{}: 'link.tm': everybody may know the key {} ({}), and {} is a line of hardware: make another one",
      deployment.file.string(), downlink->key_file, *why, line->second);
}

bool Deployment::on_command_path(const std::string& node) const {
  const auto contains = [](const auto& list, std::string_view text) {
    return std::find(list.begin(), list.end(), text) != list.end();
  };
  const NodeEntry* const entry = find(node);
  return entry != nullptr &&
         (contains(ring.critical, node) || contains(ring.confirmed, node) ||
          contains(ring.command_path, node) ||
          (ring.command_path.empty() && contains(commanding_programs, program_of(*entry))));
}

}  // namespace srfs::suite
