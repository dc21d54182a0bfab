// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/file.hpp"
#include "suite/deployment.hpp"
#include "suite/instance.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::suite {
namespace {

using testing::HasSubstr;

class DeploymentTest : public testing::Test {
 protected:
  std::string error_of(const std::string& yaml) {
    EXPECT_TRUE(write_file_atomically(folder_ / "d.yaml", yaml));
    try {
      (void)Deployment::load(folder_ / "d.yaml");
    } catch (const ConfigError& e) {
      return std::string(e.what()).substr(folder_.string().size() + 1);
    }
    return "no error";
  }
  const testing_support::TemporaryFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
};

const std::string node = "nodes:\n  - {name: timing, executable: timing_node}\n";

TEST_F(DeploymentTest, ALineOfHardwareIsATtyThatIsNoPseudoTerminal) {
  EXPECT_TRUE(is_hardware_line("serial:/dev/ttyS3", folder_)) << "also one that is not there";
  EXPECT_TRUE(is_hardware_line("serial:/dev/../dev/ttyUSB0", folder_));
  EXPECT_FALSE(is_hardware_line("serial:/dev/pts/3", folder_));
  EXPECT_FALSE(is_hardware_line("serial:run/rs422_obc", folder_));
  EXPECT_FALSE(is_hardware_line("sim:run/can_hub.sock", folder_));
  std::filesystem::create_symlink("/dev/null", folder_ / "line");
  EXPECT_TRUE(is_hardware_line("serial:line", folder_)) << "a link into /dev";
  std::filesystem::create_symlink("/dev/ttyUSB_unplugged", folder_ / "radio");
  std::filesystem::create_symlink("radio", folder_ / "uplink");
  EXPECT_TRUE(is_hardware_line("serial:uplink", folder_)) << "also while nothing is plugged in";
}

TEST_F(DeploymentTest, ChannelsWithoutSecurityAreUnsafeOnALineOfHardware) {
  const auto unsafe = [&](const std::string& line, const std::string& security) {
    const std::string text = "deployment: d\ndevices: {rs422: '" + line +
                             "'}\nlink:\n  tc_channels: [{vc: 1, " + security + "}]\n" + node;
    EXPECT_TRUE(write_file_atomically(folder_ / "d.yaml", text));
    return unsafe_link(Deployment::load(folder_ / "d.yaml"), folder_);
  };
  const std::string secured = "security: sdls, spi: 1, key_file: k";
  EXPECT_THAT(
      unsafe("serial:/dev/ttyS3", "security: none"),
      HasSubstr(
          "d.yaml: 'link.tc_channels': TC virtual channel 1 has no security, and serial:/dev/ttyS3 is"));
  EXPECT_EQ(unsafe("serial:/dev/ttyS3", secured), "");
  EXPECT_EQ(unsafe("serial:run/rs422_obc", "security: none"), "") << "hw_sim's line";
}

TEST_F(DeploymentTest, AKeyThatEverybodyMayKnowIsUnsafeOnALineOfHardwareUntilTheFirstStart) {
  const auto unsafe = [&](const std::string& line) {
    const std::string text =
        "deployment: d\ndevices: {rs422: '" + line +
        "'}\nlink:\n  tc_channels:\n    - {vc: 0, security: sdls, spi: 1, key_file: good}\n"
        "    - {vc: 0, security: sdls, spi: 5, set: contingency, key_file: bad}\n" +
        node;
    EXPECT_TRUE(write_file_atomically(folder_ / "d.yaml", text));
    return unsafe_link(Deployment::load(folder_ / "d.yaml"), folder_);
  };
  const std::string line = "serial:/dev/ttyS3";
  const std::string good = "b1946ac92492d2347c6235b4d2611184aaaa3d91e0f5c68729d410be7f33c25e\n";
  ASSERT_TRUE(write_file_atomically(folder_ / "good", good));
  EXPECT_EQ(unsafe(line), "") << "a key that is not there is no known one";
  ASSERT_TRUE(write_file_atomically(folder_ / "bad", "no key\n"));
  EXPECT_EQ(unsafe(line), "");
  ASSERT_TRUE(write_file_atomically(folder_ / "bad", std::string(64, '0') + "\n"));
  EXPECT_THAT(unsafe(line),
              HasSubstr("d.yaml: 'link.tc_channels': everybody may know the key bad of TC virtual "
                        "channel 0 (it is zero), and serial:/dev/ttyS3 is"));
  EXPECT_EQ(unsafe("serial:run/rs422_obc"), "") << "hw_sim's line";
  std::filesystem::create_directories(folder_ / "state" / "ttc");
  ASSERT_TRUE(write_file_atomically(folder_ / "state" / "ttc" / "mode", "safe\n"));
  EXPECT_EQ(unsafe(line), "") << "a spacecraft that ran is not lost by one file";
}

TEST_F(DeploymentTest, EveryFileInLaunchConfigIsValid) {
  int files = 0;
  for (const auto& file : std::filesystem::directory_iterator(SRFS_SOURCE_DIR "/launch_config")) {
    if (file.path().extension() != ".yaml") continue;
    EXPECT_NO_THROW((void)Deployment::load(file.path())) << file.path();
    ++files;
  }
  EXPECT_GT(files, 0);
}

TEST_F(DeploymentTest, ANodeThatGivesWayHasNoRealTimePriority) {
  const auto with = [](const std::string& scheduling) {
    return "deployment: x\nnodes:\n  - {name: n, executable: e, scheduling: {" + scheduling + "}}\n";
  };
  EXPECT_EQ(error_of(with("background: true")), "no error");
  EXPECT_EQ(error_of(with("policy: fifo, priority: 20, background: true")),
            "d.yaml:3: 'nodes[0].scheduling.background': expected false with policy fifo, found 'true'");
}

TEST_F(DeploymentTest, ErrorsNameFileLineKeyAndWhatWasExpected) {
  EXPECT_EQ(error_of("deployment: x\n" + node + "devcies: {}\n").substr(0, 35),
            "d.yaml:4: 'devcies': unknown key, e");
  EXPECT_EQ(error_of("deployment: x\n" + node + "link: {baud: fast}\n"),
            "d.yaml:4: 'link.baud': expected an integer from 1200 to 4000000, found 'fast'");
  const std::string channels =
      "link:\n  tc_channels:\n    - {vc: 0, security: sdls, spi: 1, key_file: a.key}\n";
  EXPECT_EQ(error_of("deployment: x\n" + node + channels +
                     "    - {vc: 0, security: sdls, spi: 1, key_file: b.key}\n"),
            "d.yaml:7: 'link.tc_channels[1].spi': expected a number not used by another entry, found '1'");
  EXPECT_EQ(
      error_of("deployment: x\n" + node + channels +
               "    - {vc: 1, security: sdls, spi: 2, key_file: a.key}\n"),
      "d.yaml:7: 'link.tc_channels[1].key_file': expected a key not used by another entry, found 'a.key'");
  EXPECT_EQ(error_of("deployment: x\n" + node + "link: {tm: {frame_length: 1115}}\n"),
            "d.yaml:4: 'link.tm.frame_length': expected 223 x interleave with reed_solomon, found '1115'");
  EXPECT_EQ(error_of("deployment: x\nnodes:\n  - {name: Timing, executable: t}\n"),
            "d.yaml:3: 'nodes[0].name': expected 1-32 characters of a-z, 0-9 and _, found 'Timing'");
  EXPECT_NE(error_of("deployment: x\n" + node +
                     "slots: [{payload: ghost, allotted_ms: 1, overrun_ms: 1, reset_ms: 1}]\n")
                .find("'ghost' is not one"),
            std::string::npos);
}

TEST_F(DeploymentTest, SealedFramesHaveAnAssociationOfTheirOwnAndRoomForIt) {
  const std::string channels = "  tc_channels: [{vc: 0, security: sdls, spi: 1, key_file: a.key}]\n";
  const auto error_with = [&](const std::string& tm) {
    return error_of("deployment: x\n" + node + "link:\n" + channels + "  tm: {" + tm + "}\n");
  };
  EXPECT_EQ(error_with("sdls: strict, spi: 16, key_file: tm.key"), "no error");
  EXPECT_EQ(error_with("sdls: none, spi: 1, key_file: a.key"), "no error") << "of a file it is laid over";
  EXPECT_EQ(error_with("sdls: strict, spi: 1, key_file: tm.key"),
            "d.yaml:6: 'link.tm.spi': expected a number not used by a telecommand channel, found '1'");
  EXPECT_EQ(error_with("sdls: strict, spi: 16, key_file: a.key"),
            "d.yaml:6: 'link.tm.key_file': expected a key not used by a telecommand channel, found 'a.key'");
  EXPECT_NE(error_with("sdls: strict, spi: 16"), "no error");
  EXPECT_EQ(error_with("sdls: strict, spi: 16, key_file: tm.key, reed_solomon: false, frame_length: 42"),
            "d.yaml:6: 'link.tm.frame_length': expected 43 at least with sdls, found '42'");

  ASSERT_TRUE(write_file_atomically(
      folder_ / "d.yaml",
      "deployment: x\n" + node + "link:\n" + channels + "  tm: {sdls: strict, spi: 16, key_file: tm.key}\n"));
  const LinkSettings link = Deployment::load(folder_ / "d.yaml").link;
  EXPECT_EQ(link.tm_security->spi, 16);
  EXPECT_EQ(key_files_of(link), (std::vector<std::string>{"a.key", "tm.key"}));
}

TEST_F(DeploymentTest, AKeyEncryptionKeyIsUsedForNothingElse) {
  const std::string channels = "  tc_channels: [{vc: 0, security: sdls, spi: 1, key_file: a.key}]\n";
  const auto error_with = [&](const std::string& entries) {
    return error_of("deployment: x\n" + node + "link:\n" + channels +
                    "  tm: {sdls: strict, spi: 16, key_file: tm.key}\n  key_encryption_keys: [" + entries +
                    "]\n");
  };
  EXPECT_EQ(error_with("{id: 1, key_file: m1.key}, {id: 2, key_file: m2.key}"), "no error");
  EXPECT_EQ(error_with("{id: 1, key_file: tm.key}"),
            "d.yaml:7: 'link.key_encryption_keys[0].key_file': expected a key not used by another entry, "
            "found 'tm.key'");
  EXPECT_THAT(error_with("{id: 1, key_file: a.key}"), HasSubstr("found 'a.key'"));
  EXPECT_THAT(error_with("{id: 1, key_file: m.key}, {id: 2, key_file: m.key}"), HasSubstr("found 'm.key'"));
  EXPECT_THAT(error_with("{id: 1, key_file: m1.key}, {id: 1, key_file: m2.key}"), HasSubstr("found '1'"));
}

TEST_F(DeploymentTest, ASelfTestHasNoKeyFileOfTheSpacecraft) {
  LinkSettings link = Deployment::load(std::string(SRFS_SOURCE_DIR) + "/launch_config/sim.yaml").link;
  const std::vector<std::string> own = key_files_of(link);
  ASSERT_TRUE(link.tm_security);
  ASSERT_FALSE(link.key_encryption_keys.empty());

  use_self_test_keys(link);

  const std::vector<std::string> of_test = key_files_of(link);
  EXPECT_EQ(std::set<std::string>(of_test.begin(), of_test.end()).size(), own.size()) << "one for each key";
  for (const std::string& file : of_test) {
    EXPECT_EQ(std::count(own.begin(), own.end(), file), 0) << file;
    EXPECT_TRUE(file.starts_with("keys/self_test_")) << file;
  }
}

TEST_F(DeploymentTest, TheRingIsTheStartOrderUnlessTheFileSaysOtherwiseAndOffWithoutTheSection) {
  const auto load = [&](const std::string& ring) {
    EXPECT_TRUE(write_file_atomically(folder_ / "d.yaml", "deployment: x\n" + node + ring));
    return Deployment::load(folder_ / "d.yaml").ring;
  };
  EXPECT_FALSE(load("").enabled);
  const RingSettings ring = load("ring: {period_ms: 50}\n");
  EXPECT_TRUE(ring.enabled);
  EXPECT_EQ(ring.period, std::chrono::milliseconds(50));
  EXPECT_EQ(ring.misses, 3);
  EXPECT_EQ(ring.members, std::vector<std::string>{"timing"});
  const std::string begin = "deployment: x\n" + node;
  EXPECT_NE(error_of(begin + "ring: {members: [ghost]}\n").find("'ghost' is not one"), std::string::npos);
  EXPECT_NE(error_of(begin + "ring: {members: [timing, timing]}\n").find("'timing' appears twice"),
            std::string::npos);
  EXPECT_NE(
      error_of(begin + "ring: {first_wait_ms: 100, longest_wait_ms: 50}\n").find("at least first_wait_ms"),
      std::string::npos);
}

TEST_F(DeploymentTest, VersionsOfTtcAndMaintenanceHaveToBeConfirmedUnlessTheFileSaysOtherwise) {
  const std::string begin =
      "deployment: x\n" + node + "  - {name: ttc, executable: x}\n  - {name: maintenance, executable: x}\n";
  const auto load = [&](const std::string& ring) {
    EXPECT_TRUE(write_file_atomically(folder_ / "d.yaml", begin + ring));
    return Deployment::load(folder_ / "d.yaml").ring.confirmed;
  };
  EXPECT_THAT(load("ring: {period_ms: 50}\n"), testing::ElementsAre("ttc", "maintenance"));
  EXPECT_THAT(load("ring: {members: [timing, ttc]}\n"), testing::ElementsAre("ttc"));
  EXPECT_THAT(load("ring: {confirmed: [timing]}\n"), testing::ElementsAre("timing"));
  EXPECT_THAT(load("ring: {confirmed: []}\n"), testing::IsEmpty());
  EXPECT_NE(error_of(begin + "ring: {confirmed: [ghost]}\n").find("'ghost' is not one"), std::string::npos);
}

TEST_F(DeploymentTest, FlightNeedsEveryNodeUnlessTheFileSaysOtherwise) {
  const std::string lane = "  - {name: lane, executable: x, needed: ";
  EXPECT_TRUE(write_file_atomically(folder_ / "d.yaml", "deployment: x\n" + node + lane + "false}\n"));
  const Deployment loaded = Deployment::load(folder_ / "d.yaml");
  EXPECT_TRUE(loaded.find("timing")->needed);
  EXPECT_FALSE(loaded.find("lane")->needed);
  EXPECT_NE(error_of("deployment: x\n" + node + lane + "perhaps}\n").find("'nodes[1].needed'"),
            std::string::npos);
}

TEST_F(DeploymentTest, TheImageLaneIsNotNeededInAnyFileOfLaunchConfig) {
  for (const auto& file : std::filesystem::directory_iterator(SRFS_SOURCE_DIR "/launch_config")) {
    if (file.path().extension() != ".yaml") continue;
    for (const NodeEntry& one : Deployment::load(file.path()).nodes)
      EXPECT_EQ(one.needed, !one.name.starts_with("image_")) << file.path() << ": " << one.name;
  }
}

TEST_F(DeploymentTest, AWorkersDeadlineIsTheRingsUnlessTheNodeHasItsOwn) {
  const auto load = [&](const std::string& rest) {
    EXPECT_TRUE(write_file_atomically(folder_ / "d.yaml", "deployment: x\n" + node + rest));
    std::vector<std::chrono::milliseconds> deadlines;
    for (const NodeEntry& entry : Deployment::load(folder_ / "d.yaml").nodes)
      deadlines.push_back(entry.worker_deadline);
    return deadlines;
  };
  const std::string slow = "  - {name: slow, executable: x, worker_deadline_ms: 60000}\n";
  EXPECT_THAT(load(slow), testing::ElementsAre(RingSettings().worker_deadline, seconds(60)));
  EXPECT_THAT(load(slow + "ring: {worker_deadline_ms: 700}\n"),
              testing::ElementsAre(milliseconds(700), seconds(60)));
}

TEST_F(DeploymentTest, ANodesMemoryIsLeftAloneUnlessTheFileSaysWhatIsToBeHeld) {
  const auto load = [&](const std::string& rest) {
    EXPECT_TRUE(write_file_atomically(folder_ / "d.yaml", "deployment: x\n" + node + rest));
    return Deployment::load(folder_ / "d.yaml").nodes.back().memory;
  };
  EXPECT_FALSE(load("").lock);
  EXPECT_EQ(load("").stack_kib, 0);
  const MemorySettings memory =
      load("  - {name: fast, executable: x, memory: {lock: true, stack_kib: 256}}\n");
  EXPECT_TRUE(memory.lock);
  EXPECT_EQ(memory.stack_kib, 256);

  const auto error = [&](const std::string& keys) {
    return error_of("deployment: x\nnodes:\n  - {name: fast, executable: x, memory: {" + keys + "}}\n");
  };
  EXPECT_EQ(error("lock: perhaps"),
            "d.yaml:3: 'nodes[0].memory.lock': expected true or false, found 'perhaps'");
  EXPECT_EQ(error("stack_kib: 8192"),
            "d.yaml:3: 'nodes[0].memory.stack_kib': expected an integer from 0 to 4096, found '8192'");
  EXPECT_EQ(error("stack: 64").substr(0, 49), "d.yaml:3: 'nodes[0].memory.stack': unknown key, e");
}

TEST_F(DeploymentTest, TheGraphsDialectAndTheRuleForForeignersAreTheDeployments) {
  const auto load = [&](const std::string& dds) {
    EXPECT_TRUE(write_file_atomically(folder_ / "d.yaml", "deployment: x\n" + node + "dds: " + dds + "\n"));
    return Deployment::load(folder_ / "d.yaml");
  };
  EXPECT_EQ(load("{}").ros_graph, ros::GraphDialect::humble);
  EXPECT_FALSE(load("{}").drop_foreign);
  EXPECT_EQ(load("{ros_graph: iron}").ros_graph, ros::GraphDialect::iron);
  EXPECT_EQ(load("{ros_graph: off}").ros_graph, ros::GraphDialect::off) << "a word of YAML 1.1 for false";
  EXPECT_TRUE(load("{foreign: drop}").drop_foreign);
}

TEST_F(DeploymentTest, AControlGroupIsAFolderBelowThatOfTheKernel) {
  const std::string begin = "deployment: x\nnodes:\n  - {name: n, executable: x, control_group: ";
  EXPECT_NE(error_of(begin + "/srfs.slice}\n").find("below /sys/fs/cgroup"), std::string::npos);
  EXPECT_NE(error_of(begin + "srfs.slice/../x}\n").find("below /sys/fs/cgroup"), std::string::npos);
  ASSERT_TRUE(write_file_atomically(folder_ / "d.yaml", begin + "srfs.slice/a.service}\n"));
  EXPECT_EQ(Deployment::load(folder_ / "d.yaml").nodes[0].control_group, "srfs.slice/a.service");
}

TEST_F(DeploymentTest, OnTheBoardEveryDeviceIsNamedTheTimeCriticalHaveRealTimeAndImagesOtherCpus) {
  const Deployment board = Deployment::load(SRFS_SOURCE_DIR "/launch_config/board_rk3568.yaml");
  for (const char* device : {"can", "rs422", "gps_serial", "gps_pulse", "gpio", "watchdog", "camera"}) {
    ASSERT_TRUE(board.devices.contains(device)) << device;
    EXPECT_FALSE(board.devices.at(device).starts_with("sim:")) << device;
  }
  for (const NodeEntry& entry : board.nodes) {
    const bool images = entry.name.starts_with("image_");
    const bool time_critical = !images && entry.name != "maintenance";
    EXPECT_EQ(entry.scheduling.policy == SchedulingPolicy::fifo, time_critical) << entry.name;
    EXPECT_EQ(entry.scheduling.cpus, time_critical ? (std::vector{0, 1}) : (std::vector{2, 3})) << entry.name;
    EXPECT_GT(entry.memory_limit_mib, 0) << entry.name;
    EXPECT_EQ(entry.oom_score_adj > 0, images) << entry.name;
    EXPECT_EQ(entry.control_group.find("srfs-image") != std::string::npos, images) << entry.name;
  }
  for (const Slot& slot : board.buses.front().slots) {
    EXPECT_LT(slot.allotted + slot.overrun + slot.reset, seconds(1)) << "a slot ends before the next tick";
  }
}

TEST_F(DeploymentTest, IncarnationsOnlyGoUpAlsoFromADamagedFile) {
  const VarPaths var{folder_};
  EXPECT_EQ(next_incarnation(var, "timing").number, 1U);
  EXPECT_EQ(next_incarnation(var, "timing").number, 2U);
  ASSERT_TRUE(write_file_atomically(var.state("timing") / "incarnation", "\x01garbage"));
  EXPECT_GT(next_incarnation(var, "timing").number, 2U);
}

TEST_F(DeploymentTest, AnIncarnationIsGivenAndExplainedWhenTheDiskCannotKeepIt) {
  const VarPaths var{"/proc/nowhere"};
  const Incarnation incarnation = next_incarnation(var, "timing");
  EXPECT_GE(incarnation.number, 1U);
  EXPECT_NE(incarnation.not_durable_because, "");
}

TEST_F(DeploymentTest, StartRecordsSurviveAndKeepTheCause) {
  const VarPaths var{folder_};
  EXPECT_EQ(read_start_record(var, "ttc").starts, 0U);
  write_start_record(var, "ttc", {3, 2, "watchdog starved\nsecond line"});
  EXPECT_EQ(read_start_record(var, "ttc").restarts, 2U);
  EXPECT_EQ(read_start_record(var, "ttc").last_cause, "watchdog starved second line");
}

TEST_F(DeploymentTest, PlacesThePeripheralsOfItsNodesAndThoseWhoseNodeIsNotThereYet) {
  const std::string head = "deployment: d\nnodes:\n";
  const std::string one = "  - {name: one, executable: x, peripheral: {can_address: 0x21, power_line: 4}}\n";
  EXPECT_TRUE(write_file_atomically(
      folder_ / "d.yaml", head + one + "  - {name: two, executable: x}\n" +
                              "peripherals: [{payload: later, can_address: 0x22, power_line: 5}]\n"));
  const Deployment d = Deployment::load(folder_ / "d.yaml");
  EXPECT_EQ(d.peripherals, (std::vector<Peripheral>{{"one", 0x21, 4}, {"later", 0x22, 5}}));
  EXPECT_EQ(*d.peripheral_of("one"), (Peripheral{"one", 0x21, 4}));
  EXPECT_EQ(d.peripheral_of("two"), nullptr);

  const auto error_beside_one = [&](const std::string& more) { return error_of(head + one + more); };
  const auto two = [](const std::string& place) {
    return "  - {name: two, executable: x, peripheral: {" + place + "}}\n";
  };
  EXPECT_THAT(error_beside_one(two("can_address: 0x21, power_line: 5")),
              HasSubstr("CAN address 0x21 is that of one and of two"));
  EXPECT_THAT(error_beside_one(two("can_address: 0x22, power_line: 4")),
              HasSubstr("power line 4 is that of one and of two"));
  EXPECT_THAT(error_beside_one(two("can_address: 1, power_line: 5")), HasSubstr("can_address"));
  EXPECT_THAT(error_beside_one(two("can_address: 255, power_line: 5")), HasSubstr("can_address"));
  EXPECT_THAT(error_beside_one(two("can_address: 0x22, power_line: 8")), HasSubstr("power_line"));
  EXPECT_THAT(error_beside_one(two("can_address: 0x22")), HasSubstr("power_line"));
  EXPECT_THAT(error_beside_one(two("can_address: 0x22, power_line: 5, bus: 1")), HasSubstr("bus"));
  EXPECT_THAT(error_beside_one("peripherals: [{payload: one, can_address: 0x22, power_line: 5}]\n"),
              HasSubstr("of a node, its entry says it"));
  EXPECT_THAT(error_beside_one("peripherals: [{payload: later, can_address: 0x21, power_line: 5}]\n"),
              HasSubstr("CAN address 0x21"));
}

/// Two payloads with the same CAN address; "two" is on the bus can_b.
std::string two_buses(const std::string& buses, const std::string& bus_of_two = "bus: can_b, ") {
  return "deployment: d\ndevices: {can: x, can_b: y}\n"
         "slots: [{payload: one, allotted_ms: 60, overrun_ms: 20, reset_ms: 40}]\n"
         "buses:\n" +
         buses +
         "nodes:\n  - {name: can_switcher, executable: x}\n  - {name: second, executable: x}\n"
         "  - {name: one, executable: x, peripheral: {can_address: 0x21, power_line: 1}}\n"
         "  - {name: two, executable: x, peripheral: {" +
         bus_of_two + "can_address: 0x21, power_line: 2}}\n";
}
const std::string bus_b =
    "  - {name: can_b, switcher: second, slots: [{payload: two, allotted_ms: 30, overrun_ms: 20, reset_ms: "
    "40}]}\n";

TEST_F(DeploymentTest, EachBusHasItsSwitcherItsSlotsAndItsTopics) {
  EXPECT_TRUE(write_file_atomically(folder_ / "d.yaml", two_buses(bus_b)));
  const Deployment d = Deployment::load(folder_ / "d.yaml");
  EXPECT_EQ(d.bus_of("one").name, "can");
  EXPECT_EQ(d.bus_of("can_switcher").name, "can");
  EXPECT_EQ(d.bus_of("no_node").name, "can");
  for (const char* own : {"two", "second"}) {
    EXPECT_EQ(d.bus_of(own).name, "can_b");
    EXPECT_EQ(d.bus_of(own).switcher, "second");
    ASSERT_EQ(d.find(own)->remap.size(), 3U);
    EXPECT_EQ(d.find(own)->remap.front(), (ros::RemapRule{"/can/task_flags", "/can_b/task_flags"}));
  }
  EXPECT_THAT(turns_of(d.bus_of("two").slots), ::testing::ElementsAre("two"));
  EXPECT_TRUE(d.find("one")->remap.empty());
}

TEST_F(DeploymentTest, APeripheralWithItsOwnProtocolIsKnownByItsAnswers) {
  const std::string answers = "bus: can_b, answers: [0x3A1, 0x18DA0155], ";
  EXPECT_TRUE(write_file_atomically(folder_ / "d.yaml", two_buses(bus_b, answers)));
  const Deployment d = Deployment::load(folder_ / "d.yaml");
  const Peripheral& own = *d.peripheral_of("two");
  EXPECT_TRUE(own.sends(0x3A1, false));
  EXPECT_FALSE(own.sends(0x3A1, true));
  EXPECT_TRUE(own.sends(0x18DA0155, true));
  EXPECT_FALSE(own.sends(0x18DA0121, true)) << "it does not speak the ICD";
  EXPECT_TRUE(d.peripheral_of("one")->sends(0x18DA0121, true));
  EXPECT_THAT(error_of(two_buses(bus_b, "bus: can_b, answers: [0x20000000], ")), HasSubstr("answers"));
}

TEST_F(DeploymentTest, RefusesABusThatIsNotWhole) {
  const std::string idle_twice =
      "deployment: d\ndevices: {can: x, can_b: y}\n"
      "slots: [{payload: idle, allotted_ms: 60, overrun_ms: 20, reset_ms: 40}]\n"
      "buses: [{name: can_b, switcher: second, slots: [{payload: idle, allotted_ms: 60, overrun_ms: 20, "
      "reset_ms: 40}]}]\n"
      "nodes: [{name: idle, executable: x}, {name: second, executable: x}]\n";
  EXPECT_THAT(error_of(idle_twice), HasSubstr("idle: slots on one bus"));
  EXPECT_THAT(error_of(two_buses("  - {name: can_c, switcher: second}\n")), HasSubstr("its URI in devices"));
  EXPECT_THAT(error_of(two_buses("  - {name: can, switcher: second}\n")), HasSubstr("another name"));
  EXPECT_THAT(error_of(two_buses("  - {name: can_b, switcher: can_switcher}\n")), HasSubstr("another name"));
  EXPECT_THAT(error_of(two_buses("  - {name: can_b, switcher: third}\n")), HasSubstr("'third' is not one"));
  EXPECT_THAT(error_of(two_buses("  - {name: can_b, switcher: second, color: 1}\n")), HasSubstr("color"));
  EXPECT_THAT(error_of(two_buses(bus_b, "")), HasSubstr("CAN address 0x21")) << "both on the first bus";
  EXPECT_THAT(error_of(two_buses(bus_b, "bus: can_d, ")),
              HasSubstr("two: a slot on the bus of its peripheral"));
  EXPECT_THAT(error_of(two_buses("  - {name: can_b, switcher: second}\n", "bus: can_d, ")),
              HasSubstr("the bus 'can_d' of two"));
}

TEST_F(DeploymentTest, AMissionHasItsDictionaryAndItsProgramsBesideTheFile) {
  std::filesystem::create_directories(folder_ / "bin");
  EXPECT_TRUE(write_file_atomically(folder_ / "bin" / "own_node", "x"));
  std::filesystem::create_directories(folder_ / "share");
  EXPECT_TRUE(write_file_atomically(
      folder_ / "share" / "d.yaml",
      "deployment: d\ndictionary: .\nprograms: ../bin\nnodes:\n"
      "  - {name: own, executable: own_node}\n  - {name: ttc, executable: ttc_node}\n"));
  EXPECT_THROW((void)Deployment::load(folder_ / "share" / "d.yaml"), ConfigError) << "no mission.yaml there";
  EXPECT_TRUE(write_file_atomically(folder_ / "share" / "mission.yaml", "subsystem: mission\n"));
  const Deployment d = Deployment::load(folder_ / "share" / "d.yaml");
  EXPECT_EQ(d.dictionary, folder_ / "share" / "");
  EXPECT_EQ(d.find("own")->executable, (folder_ / "bin" / "own_node").string());
  EXPECT_EQ(d.find("ttc")->executable, "ttc_node") << "beside the launcher";
}

TEST_F(DeploymentTest, ANodeMayHaveOtherNamesForTopicsButNotForItself) {
  const auto text = [](const std::string& rule) {
    return "deployment: d\nnodes: [{name: eps, executable: x, remap: ['" + rule + "']}]\n";
  };
  EXPECT_TRUE(write_file_atomically(folder_ / "d.yaml", text("/can/task_flags:=/can_b/task_flags")));
  const NodeEntry eps = Deployment::load(folder_ / "d.yaml").nodes.front();
  ASSERT_EQ(eps.remap.size(), 1U);
  EXPECT_EQ(eps.remap.front().to, "/can_b/task_flags");
  EXPECT_THAT(error_of(text("nonsense")), HasSubstr("'nodes[0].remap': expected a list of FROM:=TO"));
  EXPECT_THAT(error_of(text("__ns:=/b")), HasSubstr("a suite knows its nodes by their names"));
  EXPECT_THAT(error_of(text("~/get_state:=/a")), HasSubstr("the suite reaches the node there"));
  EXPECT_THAT(error_of(text("/eps/check_alive:=/a")), HasSubstr("the suite reaches the node there"));
  EXPECT_THAT(error_of(text("eps/check_alive:=/a")), HasSubstr("the suite reaches the node there"));
}

}  // namespace
}  // namespace srfs::suite
