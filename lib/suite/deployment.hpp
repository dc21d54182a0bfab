// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/config.hpp"
#include "ros/graph.hpp"
#include "ros/node_names.hpp"
#include "suite/modes.hpp"
#include "suite/peripheral.hpp"
#include "suite/step_policy.hpp"

namespace srfs::suite {

enum class SchedulingPolicy : std::uint8_t { other, fifo, batch, idle };

/// How a node's process runs; set absolutely by the launcher, never inherited.
struct Scheduling {
  SchedulingPolicy policy = SchedulingPolicy::other;
  int priority = 0;       ///< 1..99 for fifo
  int nice = 0;           ///< -20..19 for other and batch; 0: the session has flight_niceness
  std::vector<int> cpus;  ///< empty: all
  /// It gives way to all others once it has started: its session has background_niceness, where Linux shares
  /// the CPUs among sessions (base/background.hpp). Its workers for bulk give way in any case; its loop,
  /// which answers the ring, does not. Not with policy fifo.
  bool background = false;
};

/// What of a node's memory never waits for the disk; run_node arranges it before the node is configured.
struct MemorySettings {
  bool lock = false;  ///< mlockall (real_time.hpp)
  int stack_kib = 0;  ///< of the work thread's stack, touched before it works
};

struct NodeEntry {
  std::string name;        ///< without slash
  std::string executable;  ///< beside the launcher, or a path
  Scheduling scheduling;
  MemorySettings memory;
  std::int64_t memory_limit_mib = 0;  ///< private memory (RLIMIT_DATA); 0: none
  int oom_score_adj = 0;
  std::chrono::milliseconds worker_deadline{};  ///< of a job of its workers; the ring's unless the file says
  std::string user;                             ///< owner of the process; empty: as its starter
  /// Folder below /sys/fs/cgroup that the process enters where there is one; empty: its starter's.
  std::string control_group;
  ConfigSection parameters;
  std::vector<ros::RemapRule> remap;  ///< other names for its topics and services
  bool needed = true;                 ///< for flight: `srfs up` is done without one that is not
  bool added = false;  ///< not of the file (added_nodes.hpp): no executable, it has no golden version
  std::optional<Peripheral> peripheral = {};  ///< of a payload
};

/// Whether a node of the suite may have a rule. The suite reaches a node by its name, so
/// neither the node itself nor what lies below it ("~/x", "/NODE/x") can have another.
/// @return why not; empty: it may
[[nodiscard]] std::string refusal_of_remap(const ros::RemapRule& rule, const std::string& node);

/// One turn of the CAN plan (DESIGN section 5). Its index in the plan is the position of its task flag.
struct Slot {
  std::string payload;  ///< empty: no payload, the position is left free
  std::chrono::milliseconds allotted;
  std::chrono::milliseconds overrun;
  std::chrono::milliseconds reset;
  std::string after = {};  ///< payload whose turn is before; empty: behind all that stand before it
};
inline constexpr std::size_t slots_at_most = 16;  ///< bound of TaskFlags.flags

/// A CAN bus: who has turns on it. Its URI is in `devices` under its name, its topics are /NAME/task_flags
/// and so on.
struct Bus {
  std::string name = "can";
  std::string switcher = "can_switcher";  ///< the node that grants it
  std::vector<Slot> slots = {};
};

/// The payloads of a plan in the order of their turns.
[[nodiscard]] std::vector<std::string> turns_of(const std::vector<Slot>& slots);

/// A node that was added to the running system (added_nodes.hpp).
struct AddedNode {
  std::string name;
  std::string ring_after;   ///< the member that checks it; empty, or no member: behind the last one
  std::string description;  ///< YAML or JSON, launch_config/README.md: "Added nodes"
  std::string dictionary;   ///< its fragment of the mission dictionary (YAML); empty: it has none
  std::optional<std::size_t> flag = {};  ///< position of its task flag; given by add_node(), none: no slot
  std::string slot = {};  ///< its slot, where the description has none: YAML or JSON (slot_text())

  friend bool operator==(const AddedNode&, const AddedNode&) = default;
};

enum class ChannelSecurity : std::uint8_t { none, sdls };

/// Sets of associations of a channel: a or b as commanded, contingency always.
enum class AssociationSet : std::uint8_t { a, b, contingency };

struct TelecommandChannel {
  int virtual_channel;
  ChannelSecurity security;
  int spi = 0;
  std::string key_file;  ///< relative to VAR
  AssociationSet set = AssociationSet::a;
};

/// The association that authenticates TM frames (ICD 3.4).
struct TelemetrySecurity {
  int spi = 0;
  std::string key_file;  ///< relative to VAR
};

/// Session keys come up sealed under it (SDLS Extended Procedures).
struct KeyEncryptionKeyFile {
  int id = 0;            ///< 1 to 127
  std::string key_file;  ///< relative to VAR
};

struct LinkSettings {
  int spacecraft_id = 0xAB;
  int baud = 921600;
  int tm_frame_length = 223;
  int tm_interleave = 1;
  bool tm_reed_solomon = true;
  bool tm_randomizer = true;
  bool tm_continuous = false;  ///< idle frames when there is nothing to send
  std::optional<TelemetrySecurity> tm_security = {};
  bool tc_randomizer = false;
  bool tc_correct_single_bits = true;
  bool tc_strict = false;  ///< whole header and control commands authentic, counters are UTC (ICD 2.3)
  std::vector<TelecommandChannel> channels;
  std::vector<KeyEncryptionKeyFile> key_encryption_keys = {};
};

/// The liveness ring (DESIGN section 8): which node watches which, and how patiently.
struct RingSettings {
  bool enabled = false;                   ///< the file has the section
  std::chrono::milliseconds period{100};  ///< of the checks
  int misses = 3;                         ///< unanswered checks in a row that mean death (the paper's count)
  std::vector<std::string> members;   ///< in ring order, different nodes of this file; default: start order
  std::vector<std::string> critical;  ///< starve the watchdog when they cannot be raised
  /// A version of theirs passes its probation only when the operator confirms it: through these two
  /// everything else can be repaired. Default: ttc and maintenance, where they are members.
  std::vector<std::string> confirmed;
  /// Nodes that make commanding possible; empty: those with the programs of timing, can_switcher, ttc and
  /// maintenance. See Deployment::on_command_path().
  std::vector<std::string> command_path;
  /// How long an operator's order may keep a node of the command path held or out of Active.
  std::chrono::milliseconds command_path_limit{600'000};
  /// After so many starts of the suite in a row that did not become healthy (timing: healthy_after_s), orders
  /// to nodes and kept parameters are set aside (set_aside.hpp).
  int unhealthy_starts = 3;
  std::chrono::milliseconds start_deadline{3000};  ///< from exec to the desired state
  std::chrono::milliseconds work_deadline{2000};   ///< age of undone work that is due
  /// Of a worker thread's job, from when it runs, or could run: what is older is frozen.
  std::chrono::milliseconds worker_deadline{3000};
  /// A node that never ran is missed `misses` times before it is started, as one that does not answer (the
  /// paper's rule: it raises a ring one after the other); else it is started at once.
  bool absence_counts_misses = false;
  std::chrono::milliseconds deaf_interval{10000};  ///< at most one kill for a communication fault in it
  // A node that died `restarts` times within `window` waits, from `first_wait` doubling to `longest_wait`; at
  // `quarantine_deaths` within the window it is quarantined: tried again each `longest_wait` only.
  int restarts = 4;
  std::chrono::milliseconds window{60000};
  std::chrono::milliseconds first_wait{1000};
  std::chrono::milliseconds longest_wait{60000};
  int quarantine_deaths = 8;
};

/// One deployment file (launch_config/NAME.yaml), read strictly.
struct Deployment {
  std::filesystem::path file;
  std::vector<std::filesystem::path> extended;  ///< by file, absolute
  std::string name;
  std::filesystem::path dictionary;  ///< folder of the mission's dictionary, absolute; empty: SRFS' default
  std::optional<int> domain;         ///< nullopt: auto
  std::vector<std::string> interfaces;
  ros::GraphDialect ros_graph = ros::GraphDialect::humble;
  bool drop_foreign = false;  ///< drop what participants outside the suite publish on flight topics
  /// Nodes obey anyone in the DDS domain: telecommands without ttc's proof, lifecycle transitions and
  /// parameters of participants outside the suite. For a bench; refused on a line of hardware.
  bool open_orders = false;
  std::map<std::string, std::string> devices;
  LinkSettings link;
  std::vector<Bus> buses{Bus{}};  ///< the first is that of `slots`, and of added nodes
  RingSettings ring;
  StepPolicy step_down;          ///< of what starts the suite
  ModeSettings modes;            ///< with critical nodes: those of the ring unless the file says
  std::vector<NodeEntry> nodes;  ///< in start order
  /// Those of the nodes, and those on the bus whose node may be added. No two at one place.
  std::vector<Peripheral> peripherals;
  std::vector<AddedNode> added;             ///< those of the nodes that were added (added_nodes.hpp)
  std::uint32_t added_revision = 0;         ///< counts the changes of their list
  std::vector<std::string> added_problems;  ///< for people: what of their list is not used

  /// Throws ConfigError that names file, line, key and what was expected.
  static Deployment load(const std::filesystem::path& file);
  [[nodiscard]] const NodeEntry* find(const std::string& node) const;
  /// The bus that the node grants, or has a turn or its peripheral on; the first for all others.
  [[nodiscard]] const Bus& bus_of(const std::string& node) const;
  /// nullptr: the deployment places none.
  [[nodiscard]] const Peripheral* peripheral_of(const std::string& payload) const;
  /// Without it no telecommand is taken or executed, or the watchdog resets the computer: what the ring has
  /// as command_path, critical or confirmed.
  [[nodiscard]] bool on_command_path(const std::string& node) const;
};

/// Whether a device is a serial line of hardware, on which others may be: neither hw_sim's pseudo-terminal
/// nor a path outside /dev. Follows links that are there. @param uri  "serial:PATH", below @p var unless
/// absolute
[[nodiscard]] bool is_hardware_line(const std::string& uri, const std::filesystem::path& var);
/// Why nothing may be started where the link is a line of hardware: TC channels without security; before the
/// first start also publicly known keys. Empty: it may. Reads the key files.
/// Once ttc ran, such a key costs its association only, as a damaged one does (ttc reports it, the doctor
/// fails). Either way it cannot be used, and one wrong file must not cost the spacecraft at its next reset.
[[nodiscard]] std::string unsafe_link(const Deployment& deployment, const std::filesystem::path& var);

/// The content of an added node's description. Throws ConfigError.
struct AddedDescription {
  NodeEntry entry;
  std::optional<Slot> slot;
  std::map<std::string, std::string> devices;
};
[[nodiscard]] AddedDescription read_added_description(const AddedNode& node);
/// Why a peripheral cannot be where it is beside the others; empty: it can.
[[nodiscard]] std::string refusal_of_place(const Peripheral& peripheral,
                                           const std::vector<Peripheral>& others);
/// As AddedNode::slot has it.
[[nodiscard]] std::string slot_text(const Slot& slot);

/// Reads the `link` section; also for the ground, which shares it.
[[nodiscard]] LinkSettings read_link(const ConfigSection& section);
/// The files of all keys of the link, relative to VAR.
[[nodiscard]] std::vector<std::string> key_files_of(const LinkSettings& link);
/// Gives each key of the link a file of its own for a self-test, which writes random keys there.
void use_self_test_keys(LinkSettings& link);

}  // namespace srfs::suite
