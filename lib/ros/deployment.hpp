#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/config.hpp"

namespace srfs::ros {

enum class SchedulingPolicy : std::uint8_t { other, fifo, batch, idle };

/// How a node's process runs; set absolutely by the launcher, never inherited.
struct Scheduling {
  SchedulingPolicy policy = SchedulingPolicy::other;
  int priority = 0;       ///< 1..99 for fifo
  int nice = 0;           ///< -20..19 for other and batch
  std::vector<int> cpus;  ///< empty: all
};

struct NodeEntry {
  std::string name;        ///< without slash
  std::string executable;  ///< beside the launcher, or a path
  Scheduling scheduling;
  std::int64_t memory_limit_mib = 0;  ///< private memory (RLIMIT_DATA); 0: none
  int oom_score_adj = 0;
  std::string user;  ///< whom the process belongs to; empty: as its starter
  ConfigSection parameters;
};

/// One turn of the CAN plan (DESIGN section 5).
struct Slot {
  std::string payload;
  std::chrono::milliseconds allotted;
  std::chrono::milliseconds overrun;
  std::chrono::milliseconds reset;
};

enum class ChannelSecurity : std::uint8_t { none, sdls };

struct TelecommandChannel {
  int virtual_channel;
  ChannelSecurity security;
  int spi = 0;
  std::string key_file;  ///< relative to VAR
};

struct LinkSettings {
  int spacecraft_id = 0xAB;
  int baud = 921600;
  int tm_frame_length = 223;
  int tm_interleave = 1;
  bool tm_reed_solomon = true;
  bool tm_randomizer = true;
  bool tc_randomizer = false;
  bool tc_correct_single_bits = true;
  std::vector<TelecommandChannel> channels;
};

/// Layout of the ROS graph messages (lib/ros/graph.hpp): they differ between ROS 2 releases.
enum class RosGraph : std::uint8_t { off, humble, iron };

/// One deployment file (launch_config/NAME.yaml), read strictly.
struct Deployment {
  std::filesystem::path file;
  std::string name;
  std::optional<int> domain;  ///< nullopt: auto
  std::vector<std::string> interfaces;
  RosGraph ros_graph = RosGraph::humble;
  bool drop_foreign = false;  ///< drop what participants outside the suite publish on flight topics
  std::map<std::string, std::string> devices;
  LinkSettings link;
  std::vector<Slot> slots;
  std::vector<NodeEntry> nodes;  ///< in start order

  /// Throws ConfigError that names file, line, key and what was expected.
  static Deployment load(const std::filesystem::path& file);
  [[nodiscard]] const NodeEntry* find(const std::string& node) const;
};

/// Reads the `link` section; also for the ground, which shares it.
[[nodiscard]] LinkSettings read_link(const ConfigSection& section);

}  // namespace srfs::ros
