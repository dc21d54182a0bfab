// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "programs/srfs/doctor.hpp"
#include "suite/instance.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::tool {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

const std::string key = "b1946ac92492d2347c6235b4d2611184aaaa3d91e0f5c68729d410be7f33c25e\n";

const std::string board = R"(deployment: board
devices:
  can: "socketcan:can0"
  rs422: "serial:/dev/ttyS3"
  gps_pulse: "pps:/dev/pps0"
  gps_serial: "serial:/dev/ttyS4"
  gpio: "gpiochip:/dev/gpiochip0?0=17"
  watchdog: "dev:/dev/watchdog"
  camera: "v4l2:/dev/video0"
link:
  tc_channels:
    - {vc: 0, security: sdls, spi: 1, key_file: keys/up.key}
ring: {period_ms: 100}
nodes:
  - name: timing
    executable: timing_node
    scheduling: {policy: fifo, priority: 60, cpus: [3]}
    memory: {lock: true, stack_kib: 256}
    parameters: {watchdog_timeout_s: 20}
  - {name: can_switcher, executable: can_switcher_node, scheduling: {policy: fifo, priority: 50}}
  - {name: ttc, executable: ttc_node}
  - {name: image_acquisition, executable: image_acquisition_node, scheduling: {nice: 10}}
  - {name: maintenance, executable: maintenance_node}
)";

const std::string root_status =
    "Name:\tsrfs\nUid:\t0\t0\t0\t0\nGid:\t0\t0\t0\t0\nGroups:\t0\nCapEff:\t000001ffffffffff\n";
const std::string user_status =
    "Name:\tsrfs\nUid:\t1000\t1000\t1000\t1000\nGid:\t1000\t1000\t1000\t1000\nGroups:\t20 "
    "1000\nCapEff:\t0000000000000000\n";

/// A folder that looks like the board without any fault.
class DoctorTest : public testing::Test {
 protected:
  DoctorTest() {
    machine_.look = [this](const fs::path& path) -> Result<Machine::File, int> {
      if (const auto found = files_.find(path); found != files_.end()) return found->second;
      return machine_of_files_.look(path);
    };
    machine_.room = [this](const fs::path&) -> Result<Machine::Room, int> { return room_; };
    machine_.can_link = [this](const std::string&) -> Result<hw::CanLink, int> { return can_link_; };
    can_link_.bit_rate = 500'000;
    can_link_.state = hw::CanBusState::active;
    put("/proc/self/status", root_status);
    put("/proc/self/limits",
        "Limit                     Soft Limit           Hard Limit           Units     \n"
        "Max open files            1024                 524288               files     \n"
        "Max locked memory         8388608              8388608              bytes     \n"
        "Max nice priority         0                    0                    \n"
        "Max realtime priority     0                    0                    \n");
    put("/etc/passwd", "root:x:0:0::/root:/bin/sh\nsat:x:1000:1000::/:/bin/sh\n");
    put("/etc/group", "root:x:0:\ndialout:x:20:sat\nvideo:x:44:\ngpio:x:997:\n");
    put_kernel();
    put_memory();
    put_devices();
    put_lane();
    put("/var/lib/srfs/keys/up.key", key);
    put("/var/lib/srfs/keys/package.pub", key);
    for (const auto& [name, mode] : {std::pair{"up.key", 0600}, std::pair{"package.pub", 0644}})
      files_[fs::path("/var/lib/srfs/keys") / name] = {static_cast<mode_t>(S_IFREG | mode), 0, 0};
    files_["/var/lib/srfs"] = {S_IFDIR | 0755, 0, 0};
  }

  void put(const fs::path& path, const std::string& text) {
    fs::create_directories(machine_.at(path).parent_path());
    std::ofstream(machine_.at(path), std::ios::binary) << text;
  }
  void remove(const fs::path& path) { fs::remove_all(machine_.at(path)); }
  void device(const std::string& path, unsigned mode, gid_t group) {
    files_[path] = {static_cast<mode_t>(S_IFCHR | mode), 0, group};
    put(path, "");
  }
  void sysctl(const std::string& name, const std::string& value) { put("/proc/sys/" + name, value + "\n"); }

  std::vector<Finding> examined(const std::string& yaml = board) {
    put("/deployment.yaml", yaml);
    return examine(machine_, suite::Deployment::load(machine_.at("/deployment.yaml")), "/var/lib/srfs",
                   "/opt/srfs", UtcTime(seconds(1'700'000'001)));
  }
  /// The worst finding of a check.
  Finding finding(const std::string& check, const std::string& yaml = board) {
    Finding worst{Verdict::ok, "none", "", "", ""};
    for (const Finding& f : examined(yaml)) {
      if (f.check == check && (worst.check == "none" || f.verdict > worst.verdict)) worst = f;
    }
    return worst;
  }

  const testing_support::TemporaryFolder temporary_;
  Machine machine_{temporary_.path()};
  Machine machine_of_files_{temporary_.path()};
  std::map<fs::path, Machine::File> files_;
  Machine::Room room_{8ULL << 30};
  hw::CanLink can_link_;

 private:
  void put_kernel() {
    sysctl("kernel/osrelease", "6.1.0-18-rt-arm64");
    put("/proc/version", "Linux version 6.1.0-18-rt-arm64 #1 SMP PREEMPT_RT Debian\n");
    put("/sys/devices/system/cpu/online", "0-3\n");
    for (int cpu = 0; cpu < 4; ++cpu) {
      const std::string folder = "/sys/devices/system/cpu/cpu" + std::to_string(cpu) + "/cpufreq/";
      put(folder + "scaling_governor", "performance\n");
      put(folder + "scaling_max_freq", "1992000\n");
      put(folder + "cpuinfo_max_freq", "1992000\n");
    }
    sysctl("net/core/rmem_max", "4194304");
    sysctl("net/core/wmem_max", "4194304");
    sysctl("kernel/sched_rt_runtime_us", "950000");
    sysctl("vm/overcommit_memory", "0");
    sysctl("kernel/core_pattern", "core");
    put("/sys/devices/system/clocksource/clocksource0/current_clocksource", "arch_sys_counter\n");
    put("/sys/class/net/lo/flags", "0x9\n");
    put("/proc/1/comm", "systemd\n");
    put("/proc/1/cmdline", "/sbin/init");
    put("/proc/1/maps", "");
    put("/proc/self/schedstat", "8000000 2000000 12\n");
    put("/proc/pressure/cpu", "some avg10=0.00 avg60=0.20 avg300=0.78 total=13364204\n");
  }
  void put_memory() {
    put("/proc/swaps", "Filename\tType\tSize\tUsed\tPriority\n");
    put("/proc/meminfo", "MemTotal: 3900000 kB\nMemAvailable:    3500000 kB\n");
    put("/proc/mounts",
        "/dev/mmcblk0p1 / ext4 rw,relatime 0 0\ntmpfs /run tmpfs rw,nosuid,nodev 0 0\n"
        "cgroup2 /sys/fs/cgroup cgroup2 rw,nosuid 0 0\n");
    fs::create_directories(machine_.at("/run"));
    files_["/run"] = {S_IFDIR | 0755, 0, 0};
    fs::create_directories(machine_.at("/var/lib/srfs"));
  }
  void put_devices() {
    for (const char* module : {"can_raw", "can_isotp"})
      fs::create_directories(machine_.at("/sys/module") / module);
    put("/sys/class/net/can0/type", "280\n");
    put("/sys/class/net/can0/flags", "0x40081\n");
    device("/dev/ttyS3", 0660, 20);
    device("/dev/ttyS4", 0660, 20);
    device("/dev/pps0", 0660, 20);
    device("/dev/gpiochip0", 0660, 997);
    device("/dev/video0", 0660, 44);
    device("/dev/watchdog", 0600, 0);
    for (const char* entry : {"tty/ttyS3", "tty/ttyS4", "video4linux/video0"})
      fs::create_directories(machine_.at("/sys/class") / entry);
    fs::create_directories(machine_.at("/sys/bus/gpio/devices/gpiochip0"));
    put("/sys/class/tty/console/active", "tty0 ttyS2\n");
    put("/sys/class/pps/pps0/assert", "1700000000.500000000#1234\n");
    put("/sys/class/watchdog/watchdog0/identity", "Synopsys DesignWare Watchdog\n");
    put("/sys/class/watchdog/watchdog0/nowayout", "1\n");
    put("/sys/class/watchdog/watchdog0/max_timeout", "85\n");
  }
  void put_lane() {
    for (const char* file :
         {"/usr/bin/g++", "/usr/bin/ld", "/usr/include/tl/expected.hpp", "/usr/include/fastcdr/Cdr.h",
          "/usr/include/fastdds/dds/domain/DomainParticipant.hpp", "/usr/include/fmt/format.h",
          "/usr/include/yaml-cpp/yaml.h", "/opt/srfs/bin/srfs-lane", "/opt/srfs/include/srfs/x",
          "/proc/self/ns/mnt", "/proc/self/ns/pid", "/proc/self/ns/net", "/proc/self/ns/ipc",
          "/proc/self/ns/uts", "/proc/sys/kernel/seccomp/actions_avail"})
      put(file, "");
    put("/opt/srfs/share/srfs/node_build.json",
        R"({"format": "srfs node build 1", "version": "0.1.0", "flags": [], "include": ["include/srfs"], "readable": [],
            "library_folder": "lib", "libraries": []})");
    put("/sys/fs/cgroup/cgroup.controllers", "cpuset cpu io memory pids\n");
    put("/sys/fs/cgroup/cgroup.subtree_control", "cpu memory pids\n");
    put("/sys/kernel/security/lsm", "lockdown,capability,landlock,yama\n");
  }
};

TEST_F(DoctorTest, NothingIsWrongWithAMachineThatHasWhatTheDeploymentAsksFor) {
  for (const Finding& f : examined()) {
    EXPECT_LE(f.verdict, Verdict::note) << f.check << ": " << f.found << "; " << f.expected;
    EXPECT_FALSE(f.found.empty()) << f.check;
  }
  EXPECT_THAT(finding("device.can").found, HasSubstr("500000 bit/s"));
  EXPECT_THAT(finding("device.gps_pulse").found, HasSubstr("pulse 1234, 0.5 s ago"));
  EXPECT_THAT(finding("device.watchdog").found, HasSubstr("Synopsys"));
}

TEST_F(DoctorTest, WhatCannotBeReadIsNeverOk) {
  for (const auto& entry : fs::directory_iterator(machine_.at("/"))) fs::remove_all(entry.path());
  files_.clear();
  machine_.room = [](const fs::path&) -> Result<Machine::Room, int> { return Err(EACCES); };
  machine_.can_link = [](const std::string&) -> Result<hw::CanLink, int> { return Err(EPERM); };
  std::string asking = board;
  asking.replace(asking.find("{nice: 10}"), 10, "{nice: -5}");
  std::size_t unknown = 0;
  for (const Finding& f : examined(asking)) {
    EXPECT_NE(f.verdict, Verdict::ok) << f.check << ": " << f.found;
    if (f.verdict == Verdict::unknown) ++unknown;
    EXPECT_TRUE(f.verdict <= Verdict::unknown || !f.expected.empty()) << f.check;
  }
  EXPECT_GT(unknown, 10U);
}

TEST_F(DoctorTest, ASimulationNeedsNoHardwareNoRealTimeAndNoKeys) {
  remove("/dev");
  remove("/var/lib/srfs/keys");
  files_.clear();
  put("/proc/version", "Linux version 6.1.0 #1 SMP PREEMPT_DYNAMIC\n");
  put("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "powersave\n");
  put("/proc/1/comm", "systemd-timesyn\n");
  sysctl("net/core/rmem_max", "212992");
  const suite::Deployment deployment = suite::Deployment::load(SRFS_SOURCE_DIR "/launch_config/sim.yaml");
  const auto findings =
      examine(machine_, deployment, "/var/lib/srfs", "/opt/srfs", UtcTime(seconds(1'700'000'001)));
  for (const Finding& f : findings) EXPECT_NE(f.verdict, Verdict::fail) << f.check << ": " << f.found;
  const auto verdict = [&](const std::string& check) {
    const auto found =
        std::find_if(findings.begin(), findings.end(), [&](const Finding& f) { return f.check == check; });
    return found == findings.end() ? Verdict::ok : found->verdict;
  };
  for (const char* check :
       {"kernel.preemption", "cpu.governor", "clock.discipline", "device.can", "key.tc_uplink.key"})
    EXPECT_EQ(verdict(check), Verdict::note) << check;
  EXPECT_EQ(verdict("sysctl.net.core.rmem_max"), Verdict::warn);
}

TEST_F(DoctorTest, AKernelThatIsTooOldOrNotRealTimeIsNamedWithThePackageThatBringsABetterOne) {
  sysctl("kernel/osrelease", "4.19.232");
  put("/proc/version", "Linux version 4.19.232 #1 SMP PREEMPT\n");
  EXPECT_EQ(finding("kernel.release").verdict, Verdict::fail);
  EXPECT_EQ(finding("kernel.preemption").verdict, Verdict::warn);
  EXPECT_THAT(finding("kernel.preemption").command, HasSubstr("linux-image-rt-"));
  sysctl("kernel/osrelease", "5.10.160");
  EXPECT_EQ(finding("kernel.release").verdict, Verdict::warn) << "a weaker sandbox";
  put("/sys/kernel/realtime", "1\n");
  EXPECT_EQ(finding("kernel.preemption").verdict, Verdict::ok) << "kernels before 6.1 say it there";
}

TEST_F(DoctorTest, AKernelThatDoesNotTellWhoWaitsForACpuIsNamedWithTheConsequence) {
  EXPECT_EQ(finding("kernel.schedstat").verdict, Verdict::ok);
  EXPECT_EQ(finding("kernel.pressure").verdict, Verdict::ok);
  put("/proc/self/schedstat", "0 0 0\n");
  EXPECT_EQ(finding("kernel.schedstat").verdict, Verdict::warn) << "the file is there, the count is not";
  put("/proc/self/schedstat", "");
  remove("/proc/pressure");
  EXPECT_EQ(finding("kernel.schedstat").verdict, Verdict::warn);
  EXPECT_THAT(finding("kernel.schedstat").found, HasSubstr("taken for one that hangs"));
  EXPECT_EQ(finding("kernel.pressure").verdict, Verdict::warn);
  EXPECT_THAT(finding("kernel.pressure").found, HasSubstr("only the load average"));
}

TEST_F(DoctorTest, AGovernorOrALimitThatSlowsACpuIsNamedWithTheCommand) {
  put("/sys/devices/system/cpu/cpu2/cpufreq/scaling_governor", "schedutil\n");
  put("/sys/devices/system/cpu/cpu1/cpufreq/scaling_max_freq", "408000\n");
  EXPECT_EQ(finding("cpu.governor").verdict, Verdict::warn);
  EXPECT_EQ(finding("cpu.governor").found, "cpu2: schedutil");
  EXPECT_EQ(finding("cpu.governor").command,
            "echo performance | tee /sys/devices/system/cpu/cpu[0-9]*/cpufreq/scaling_governor");
  EXPECT_EQ(finding("cpu.frequency").found, "cpu1: 408000 of 1992000 kHz");
  remove("/sys/devices/system/cpu/cpu0/cpufreq");
  remove("/sys/devices/system/cpu/cpu1/cpufreq");
  remove("/sys/devices/system/cpu/cpu2/cpufreq");
  remove("/sys/devices/system/cpu/cpu3/cpufreq");
  EXPECT_EQ(finding("cpu.governor").verdict, Verdict::unknown);
}

TEST_F(DoctorTest, ACpuOfTheDeploymentThatIsNotOnlineFailsWhenTheNodeHasNoOther) {
  put("/sys/devices/system/cpu/online", "0-1\n");
  EXPECT_EQ(finding("cpu.sets").verdict, Verdict::fail);
  EXPECT_THAT(finding("cpu.sets").found, HasSubstr("not 3 of timing"));
  EXPECT_EQ(finding("cpu.sets").command, "echo 1 | tee /sys/devices/system/cpu/cpu3/online");
}

TEST_F(DoctorTest, WhoMayNotGiveANodeItsPriorityIsToldWhichLimitGivesIt) {
  put("/proc/self/status", user_status);
  const Finding priority = finding("limit.rtprio");
  EXPECT_EQ(priority.verdict, Verdict::fail);
  EXPECT_EQ(priority.found, "0 of user sat");
  EXPECT_THAT(priority.expected, HasSubstr("60, needed by timing"));
  EXPECT_EQ(priority.command, "echo 'sat - rtprio 60' >> /etc/security/limits.d/60-srfs.conf");
  EXPECT_EQ(finding("limit.memlock").verdict, Verdict::fail);
  EXPECT_EQ(finding("limit.nice").verdict, Verdict::ok) << "no node asks for less than 0";

  put("/proc/self/limits",
      "Max open files            1024                 4096                 files     \n"
      "Max locked memory         unlimited            unlimited            bytes     \n"
      "Max nice priority         0                    0                    \n"
      "Max realtime priority     0                    60                   \n");
  EXPECT_EQ(finding("limit.rtprio").verdict, Verdict::ok);
  EXPECT_EQ(finding("limit.memlock").verdict, Verdict::ok);
}

TEST_F(DoctorTest, ANodeOfAnotherUserKeepsNoCapabilityToLockItsMemory) {
  std::string yaml = board;
  yaml.replace(yaml.find("executable: timing_node"), 23, "executable: timing_node\n    user: sat");
  std::string status = root_status;
  status.replace(status.find("000001ffffffffff"), 16, "0000000000804000");  // CAP_SYS_NICE, CAP_IPC_LOCK
  put("/proc/self/status", status);
  EXPECT_EQ(finding("limit.memlock").verdict, Verdict::ok);
  EXPECT_EQ(finding("limit.memlock", yaml).verdict, Verdict::fail);
  EXPECT_EQ(finding("user.sat", yaml).verdict, Verdict::fail) << "nor may it change the user";
  EXPECT_EQ(finding("user.ring", yaml).verdict, Verdict::warn);
  yaml.replace(yaml.find("user: sat"), 9, "user: cat");
  EXPECT_THAT(finding("user.cat", yaml).command, HasSubstr("useradd --system"));
}

TEST_F(DoctorTest, ADeviceThatOthersMayUseIsOpenedByAGroupOrARuleOfUdev) {
  put("/proc/self/status", user_status);  // user sat is in group dialout
  EXPECT_EQ(finding("device.rs422").verdict, Verdict::ok);
  EXPECT_EQ(finding("device.camera").command, "usermod -aG video sat");
  const Finding watchdog = finding("device.watchdog");
  EXPECT_EQ(watchdog.verdict, Verdict::fail);
  EXPECT_EQ(watchdog.found, "/dev/watchdog is root:root 0600");
  EXPECT_THAT(watchdog.command, HasSubstr("KERNEL==\"watchdog\", GROUP=\"watchdog\", MODE=\"0660\""));
}

TEST_F(DoctorTest, ADeviceThatIsMissingOrNoDeviceFails) {
  files_.erase("/dev/pps0");
  remove("/dev/pps0");
  EXPECT_EQ(finding("device.gps_pulse").verdict, Verdict::fail);
  EXPECT_THAT(finding("device.gps_pulse").found, HasSubstr("ENOENT"));
  files_["/dev/video0"].mode = S_IFREG | 0660;
  EXPECT_THAT(finding("device.camera").found, HasSubstr("not a character device"));
  remove("/sys/bus/gpio");
  EXPECT_EQ(finding("device.gpio").verdict, Verdict::unknown) << "there, but nobody says what it is";
  std::string yaml = board;
  yaml.replace(yaml.find("v4l2:"), 5, "v4l3:");
  EXPECT_THAT(finding("device.camera", yaml).found, HasSubstr("unknown scheme 'v4l3'"));
}

TEST_F(DoctorTest, ASerialLineWithALoginOrTheKernelsConsoleIsNotOurs) {
  put("/proc/77/cmdline", std::string("/sbin/agetty\0-o\0ttyS3\0", 22));
  put("/proc/77/comm", "agetty\n");
  put("/proc/77/maps", "");
  EXPECT_EQ(finding("device.rs422").command, "systemctl disable --now serial-getty@ttyS3.service");
  put("/sys/class/tty/console/active", "ttyS4\n");
  EXPECT_THAT(finding("device.gps_serial").found, HasSubstr("console"));
  put("/proc/77/comm", "ModemManager\n");
  EXPECT_EQ(finding("device.intruder").command, "systemctl disable --now ModemManager");
}

TEST_F(DoctorTest, APulseThatStoppedOrNeverCameIsAWarning) {
  put("/sys/class/pps/pps0/assert", "1699999900.000000000#1200\n");
  EXPECT_EQ(finding("device.gps_pulse").verdict, Verdict::warn);
  EXPECT_THAT(finding("device.gps_pulse").found, HasSubstr("101 s old"));
  put("/sys/class/pps/pps0/assert", "0.000000000#0\n");
  EXPECT_THAT(finding("device.gps_pulse").found, HasSubstr("no pulse so far"));
}

TEST_F(DoctorTest, AWatchdogThatCanBeStoppedIsFedByOthersOrIsTooFastIsNamed) {
  put("/sys/class/watchdog/watchdog0/nowayout", "0\n");
  put("/sys/class/watchdog/watchdog0/max_timeout", "16\n");
  put("/etc/systemd/system.conf", "[Manager]\n#RebootWatchdogSec=10min\nRuntimeWatchdogSec=20\n");
  EXPECT_EQ(finding("device.watchdog").verdict, Verdict::warn);
  EXPECT_EQ(finding("device.watchdog").command, "echo 1 > /sys/class/watchdog/watchdog0/nowayout");
  EXPECT_EQ(finding("device.watchdog.timeout").verdict, Verdict::fail);
  EXPECT_EQ(finding("device.watchdog.user").verdict, Verdict::fail);
  remove("/etc/systemd/system.conf");
  EXPECT_EQ(finding("device.watchdog.user").check, "none");
  put("/etc/systemd/system.conf.d/10-board.conf", "[Manager]\nRuntimeWatchdogSec=20\n");
  EXPECT_THAT(finding("device.watchdog.user").found, HasSubstr("10-board.conf"));
  remove("/sys/class/watchdog");
  EXPECT_EQ(finding("device.watchdog").verdict, Verdict::unknown);
}

TEST_F(DoctorTest, ACanInterfaceIsUpAtTheRightBitRateAndActive) {
  put("/sys/class/net/can0/flags", "0x40080\n");
  EXPECT_EQ(finding("device.can").command, "ip link set can0 up type can bitrate 500000 restart-ms 100");
  put("/sys/class/net/can0/flags", "0x40081\n");
  can_link_.bit_rate = 250'000;
  EXPECT_THAT(finding("device.can").found, HasSubstr("250000"));
  EXPECT_THAT(finding("device.can").command, HasSubstr("ip link set can0 down && "));
  can_link_.bit_rate = 500'000;
  can_link_.state = hw::CanBusState::bus_off;
  EXPECT_EQ(finding("device.can").verdict, Verdict::fail);
  can_link_.state = hw::CanBusState::passive;
  EXPECT_EQ(finding("device.can").verdict, Verdict::warn);
  can_link_.bit_rate.reset();
  EXPECT_EQ(finding("device.can").verdict, Verdict::unknown);
  remove("/sys/class/net/can0");
  EXPECT_THAT(finding("device.can").found, HasSubstr("no interface can0"));
}

TEST_F(DoctorTest, ModulesOfTheKernelAreThereLoadableMissingOrUnknown) {
  const std::string yaml =
      "deployment: v\ndevices: {can: \"socketcan:vcan0\"}\nnodes: [{name: a, executable: x}]\n";
  const fs::path folder = "/lib/modules/6.1.0-18-rt-arm64";
  EXPECT_EQ(finding("kernel.module.vcan", yaml).verdict, Verdict::unknown);
  put(folder / "modules.dep", "kernel/net/can/can-raw.ko: kernel/net/can/can.ko\n");
  EXPECT_EQ(finding("kernel.module.vcan", yaml).verdict, Verdict::fail);
  put(folder / "modules.dep", "kernel/drivers/net/can/vcan.ko.xz:\n");
  EXPECT_EQ(finding("kernel.module.vcan", yaml).command, "modprobe vcan");
  put(folder / "modules.builtin", "kernel/drivers/net/can/vcan.ko\n");
  EXPECT_EQ(finding("kernel.module.vcan", yaml).verdict, Verdict::ok);
  EXPECT_EQ(finding("device.can", yaml).command,
            "modprobe vcan; ip link add vcan0 type vcan && ip link set vcan0 up");
}

TEST_F(DoctorTest, ASysctlIsNamedWithTheCommandThatChangesItNowAndForTheNextBoot) {
  sysctl("net/core/rmem_max", "212992");
  sysctl("kernel/sched_rt_runtime_us", "-1");
  sysctl("kernel/core_pattern", "|/usr/lib/systemd/systemd-coredump %P");
  sysctl("vm/overcommit_memory", "2");
  const Finding buffers = finding("sysctl.net.core.rmem_max");
  EXPECT_EQ(buffers.verdict, Verdict::fail);
  EXPECT_EQ(buffers.found, "212992");
  EXPECT_EQ(buffers.command, "sysctl -w net.core.rmem_max=4194304 | tee -a /etc/sysctl.d/60-srfs.conf");
  EXPECT_EQ(finding("sysctl.kernel.sched_rt_runtime_us").verdict, Verdict::note);
  EXPECT_EQ(finding("sysctl.kernel.core_pattern").verdict, Verdict::warn);
  EXPECT_EQ(finding("sysctl.vm.overcommit_memory").verdict, Verdict::warn);
  EXPECT_EQ(finding("sysctl.vm.swappiness").found, "no swap");
  put("/proc/swaps", "Filename Type Size\n/dev/zram0 partition 100\n");
  sysctl("vm/swappiness", "60");
  EXPECT_EQ(finding("sysctl.vm.swappiness").verdict, Verdict::warn);
}

TEST_F(DoctorTest, WhatAKilledSuiteLeftInMemoryIsToldFromASuiteThatRuns) {
  const std::string own = "/run/srfs/" + suite::VarPaths{"/var/lib/srfs"}.memory_name();
  fs::create_directories(machine_.at(own));
  fs::create_directories(machine_.at("/run/srfs/0123456789abcdef"));
  EXPECT_EQ(finding("memory.suites").verdict, Verdict::warn);
  EXPECT_EQ(finding("memory.suites").command, "rm -r /run/srfs/0123456789abcdef");
  put("/proc/9/maps", "7f00-7f01 rw-s 00000000 00:18 5 /run/srfs/0123456789abcdef/ttc.heartbeat\n");
  EXPECT_EQ(finding("memory.suites").verdict, Verdict::note);
  remove("/proc/1/maps");
  EXPECT_EQ(finding("memory.suites").verdict, Verdict::unknown)
      << "its process might be the one that is not seen";
}

TEST_F(DoctorTest, KeysOfOrdersAreOfTheSuitesUserAlone) {
  files_["/run/srfs"] = {S_IFDIR | 0755, 0, 0};
  EXPECT_EQ(finding("orders.keys").found, "none; srfs up makes them");
  const std::string folder = "/run/srfs/" + suite::VarPaths{"/var/lib/srfs"}.memory_name() + ".keys";
  const std::string seal = folder + "/seal/seal_key";
  for (const std::string& one : {folder + "/command_key", folder + "/of_ttc/command_key", seal}) {
    put(one, "");
    files_[one] = {S_IFREG | 0600, 0, 0};
  }
  files_[folder] = {S_IFDIR | 0700, 0, 0};
  EXPECT_EQ(finding("orders.keys").verdict, Verdict::ok);
  EXPECT_EQ(finding("orders.keys").found, "3 keys in " + folder + ", of this suite's user only");
  files_[seal] = {S_IFREG | 0640, 0, 0};
  EXPECT_EQ(finding("orders.keys").verdict, Verdict::fail);
  EXPECT_EQ(finding("orders.keys").found, seal + ": others may use it");
  EXPECT_THAT(finding("orders.keys").command, HasSubstr("srfs restart"));
  files_[folder] = {S_IFDIR | 0700, 1000, 1000};
  EXPECT_EQ(finding("orders.keys").found, folder + ": belongs to user sat");
}

TEST_F(DoctorTest, WhatANodeMayDoIsShownBesideWhatItNeeds) {
  EXPECT_EQ(finding("privileges").found, "no node runs");
  const auto run = [this](const std::string& node, const std::string& program, const std::string& status) {
    put("/proc/77/cmdline",
        program + std::string("\0--name\0", 8) + node + std::string("\0--var\0/var/lib/srfs\0", 21));
    put("/proc/77/status", "Uid:\t0\t0\t0\t0\n" + status);
  };
  const std::string node = suite::Deployment::load(machine_.at("/deployment.yaml")).nodes.front().name;
  const std::string check = "privileges." + node;
  run(node, "/opt/srfs/bin/x",
      "CapPrm:\t0000000002000000\nCapEff:\t0000000002000000\nNoNewPrivs:\t1\nSeccomp:\t2\n");
  EXPECT_EQ(finding(check).verdict, Verdict::ok) << "CAP_SYS_TIME of timing";
  EXPECT_EQ(finding(check).found, "user root, capabilities: CAP_SYS_TIME, gains none, system calls filtered");
  run(node, "/opt/srfs/bin/x",
      "CapPrm:\t000001ffffffffff\nCapEff:\t000001ffffffffff\nNoNewPrivs:\t0\nSeccomp:\t0\n");
  EXPECT_EQ(finding(check).verdict, Verdict::warn);
  EXPECT_EQ(
      finding(check).found,
      "user root, capabilities: 41 capabilities, may gain some (no_new_privs is off), all system calls");
  run(node, "/opt/srfs/bin/x",
      "CapPrm:\t0000000002001000\nCapEff:\t0000000002001000\nNoNewPrivs:\t1\nSeccomp:\t2\n");
  EXPECT_THAT(finding(check).command, HasSubstr("rmem_max"));
}

TEST_F(DoctorTest, AUserWithoutAFolderInMemoryIsToldHowToHaveOne) {
  files_["/var/lib/srfs"] = {S_IFDIR | 0755, 1000, 1000};
  EXPECT_EQ(finding("memory.runtime").verdict, Verdict::warn);
  EXPECT_EQ(finding("memory.runtime").command, "loginctl enable-linger sat");
  files_["/run/user/1000"] = {S_IFDIR | 0700, 1000, 1000};
  EXPECT_EQ(finding("memory.runtime").verdict, Verdict::ok);
  files_["/run/user/1000"] = {S_IFDIR | 0777, 1000, 1000};
  EXPECT_EQ(finding("memory.runtime").verdict, Verdict::warn) << "others could take its names";
}

TEST_F(DoctorTest, AFolderInMemoryOrOfLocksThatSomebodyElseMadeIsNotThisSuites) {
  const std::string own = "/run/srfs/" + suite::VarPaths{"/var/lib/srfs"}.memory_name();
  for (const auto& [check, folder] : {std::pair<std::string, std::string>("memory.suites", own),
                                      {"network.domains", "/run/srfs/domains"}}) {
    fs::create_directories(machine_.at(folder));
    files_[folder] = {S_IFDIR | 0700, 0, 0};
    EXPECT_LT(finding(check).verdict, Verdict::fail) << check;
    files_[folder] = {S_IFDIR | 0700, 1000, 1000};
    EXPECT_EQ(finding(check).verdict, Verdict::fail) << check;
    EXPECT_EQ(finding(check).found, folder + ": belongs to user sat");
    EXPECT_EQ(finding(check).command, "rm -r " + folder);
    files_[folder] = {S_IFDIR | 0777, 0, 0};
    EXPECT_EQ(finding(check).found, folder + ": others may write to it");
    files_.erase(folder);
    remove(folder);
    fs::create_directories(machine_.at("/root_s"));
    fs::create_directory_symlink(machine_.at("/root_s"), machine_.at(folder));
    EXPECT_EQ(finding(check).found, folder + ": is a symbolic link");
    remove(folder);
  }
}

TEST_F(DoctorTest, ALineOfHardwareNeedsSecurityAndKeysThatNobodyKnows) {
  const fs::path path = "/var/lib/srfs/keys/up.key";
  EXPECT_EQ(finding("key.up.key").verdict, Verdict::ok);
  for (const std::string& known :
       {std::string(64, '0'),
        std::string("000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f")}) {
    put(path, known + "\n");
    EXPECT_EQ(finding("key.up.key").verdict, Verdict::fail);
    EXPECT_THAT(finding("key.up.key").found, HasSubstr("publicly known"));
    EXPECT_THAT(finding("key.up.key").command, HasSubstr("openssl rand"));
  }
  put("/var/lib/srfs/keys/package.pub", "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a\n");
  EXPECT_EQ(finding("key.package.pub").verdict, Verdict::fail);

  std::string open = board;
  const std::string secured = "{vc: 0, security: sdls, spi: 1, key_file: keys/up.key}";
  open.replace(open.find(secured), secured.size(), "{vc: 1, security: none}");
  EXPECT_EQ(finding("link.security", open).verdict, Verdict::fail);
  EXPECT_THAT(finding("link.security", open).found, HasSubstr("TC virtual channel 1 has no security"));
  const std::string line = "serial:/dev/ttyS3";
  open.replace(open.find(line), line.size(), "serial:run/rs422_obc");
  EXPECT_EQ(finding("link.security", open).verdict, Verdict::note) << "hw_sim's line";
  EXPECT_EQ(finding("key.package.pub", open).verdict, Verdict::fail) << "also in a simulation";
}

TEST_F(DoctorTest, ADiskThatIsSmallReadOnlyOrForgetsIsNamed) {
  room_.free_octets = 1U << 30;
  EXPECT_EQ(finding("disk.room").verdict, Verdict::warn);
  EXPECT_EQ(finding("memory.runtime").verdict, Verdict::ok);
  room_.free_octets = 1U << 20;
  EXPECT_EQ(finding("disk.room").verdict, Verdict::fail);
  EXPECT_EQ(finding("memory.runtime").verdict, Verdict::fail);
  const std::string shm = "tmpfs /run tmpfs rw 0 0\n";
  put("/proc/mounts", "/dev/a / ext4 ro,relatime 0 0\n/dev/b /var ext4 rw 0 0\n" + shm);
  EXPECT_EQ(finding("disk.kind").verdict, Verdict::ok) << "the nearest one above counts";
  put("/proc/mounts", "/dev/a / ext4 rw 0 0\n/dev/b /var/lib ext4 ro,relatime 0 0\n" + shm);
  EXPECT_EQ(finding("disk.kind").command, "mount -o remount,rw /var/lib");
  put("/proc/mounts", "/dev/a / ext4 rw 0 0\ntmpfs /var/lib/srfs tmpfs rw 0 0\n" + shm);
  EXPECT_EQ(finding("disk.kind").verdict, Verdict::warn);
  files_["/var/lib/srfs"].mode = S_IFDIR | 0777;
  EXPECT_EQ(finding("disk.access").command, "chmod o-w /var/lib/srfs");
  files_["/var/lib/srfs"].mode = S_IFDIR | 0755;
  put("/proc/self/status", user_status);
  EXPECT_EQ(finding("disk.access").command, "install -d -o sat -m 0755 /var/lib/srfs");
}

TEST_F(DoctorTest, WhoeverSetsTheClockBesideTimingIsNamed) {
  put("/proc/1/comm", "chronyd\n");
  EXPECT_EQ(finding("clock.discipline").verdict, Verdict::warn);
  EXPECT_EQ(finding("clock.discipline").command, "systemctl disable --now chrony");
  std::string yaml = board;
  yaml.replace(yaml.find("watchdog_timeout_s: 20"), 22, "clock: system");
  EXPECT_EQ(finding("clock.discipline", yaml).verdict, Verdict::fail);
  EXPECT_EQ(finding("clock.right", yaml).verdict, Verdict::ok);
  put("/proc/self/status", user_status);
  EXPECT_EQ(finding("clock.right", yaml).verdict, Verdict::fail);
}

TEST_F(DoctorTest, TheBuildLaneNeedsACompilerAUserGroupsAndNamespaces) {
  remove("/usr/bin/g++");
  EXPECT_EQ(finding("lane.tools").command, "apt-get install --no-install-recommends g++");
  put("/sys/fs/cgroup/cgroup.subtree_control", "cpu\n");
  EXPECT_EQ(finding("lane.cgroup").command, "echo '+memory +pids' > /sys/fs/cgroup/cgroup.subtree_control");
  put("/etc/passwd", "root:x:0:0::/root:/bin/sh\ncat:x:64042:64042::/:/bin/sh\nsat:x:1000:1000::/:/bin/sh\n");
  EXPECT_THAT(finding("lane.user").found, HasSubstr("uid 64042 belongs to cat"));
  remove("/opt/srfs/include");
  EXPECT_THAT(finding("lane.installation").found, HasSubstr("/opt/srfs/include/srfs is missing"));
  put("/proc/self/status", user_status);
  sysctl("user/max_user_namespaces", "0");
  EXPECT_THAT(finding("lane.namespaces").command, HasSubstr("user.max_user_namespaces=1024"));
  sysctl("user/max_user_namespaces", "1000");
  sysctl("kernel/unprivileged_userns_clone", "0");
  EXPECT_THAT(finding("lane.namespaces").command, HasSubstr("kernel.unprivileged_userns_clone=1"));
  sysctl("kernel/unprivileged_userns_clone", "1");
  EXPECT_EQ(finding("lane.namespaces").verdict, Verdict::ok);
}

TEST_F(DoctorTest, AKeyIsThereIsOneAndNobodyElseMayReadIt) {
  const fs::path path = "/var/lib/srfs/keys/up.key";
  files_[path].mode = S_IFREG | 0640;
  EXPECT_EQ(finding("key.up.key").verdict, Verdict::fail);
  EXPECT_EQ(finding("key.up.key").command, "chmod 600 /var/lib/srfs/keys/up.key");
  files_[path].mode = S_IFREG | 0600;
  put(path, "not a key\n");
  EXPECT_THAT(finding("key.up.key").found, HasSubstr("is not a key"));
  remove(path);
  files_.erase(path);
  EXPECT_THAT(finding("key.up.key").command, HasSubstr("umask 077; openssl rand -hex 32"));
  files_["/var/lib/srfs/keys/package.pub"].mode = S_IFREG | 0666;
  EXPECT_EQ(finding("key.package.pub").command, "chmod 644 /var/lib/srfs/keys/package.pub");
  for (const Finding& f : examined())
    EXPECT_EQ((f.found + f.expected).find("aaaa"), std::string::npos) << f.check;
}

TEST(ListOfCpus, IsReadAsTheKernelWritesItAndNothingElseIsTakenForOne) {
  EXPECT_EQ(parse_cpus("0-2,5"), (std::set<int>{0, 1, 2, 5}));
  EXPECT_EQ(parse_cpus("0"), std::set<int>{0});
  for (const char* text : {"", "x", "0-", "-1", "0-5000", "1-2-3"})
    EXPECT_EQ(parse_cpus(text), std::nullopt) << text;
}

TEST(AccountTest, MayWhatTheOwnerTheGroupOrAllOthersMay) {
  const Account sat{"sat", 1000, {1000, 20}, 0};
  EXPECT_TRUE(sat.may({S_IFCHR | 0600, 1000, 0}, R_OK | W_OK));
  EXPECT_TRUE(sat.may({S_IFCHR | 0060, 0, 20}, R_OK | W_OK));
  EXPECT_FALSE(sat.may({S_IFCHR | 0640, 0, 20}, R_OK | W_OK));
  EXPECT_FALSE(sat.may({S_IFCHR | 0066, 1000, 20}, R_OK)) << "the owner's own bits count";
  EXPECT_TRUE((Account{"root", 0, {0}, 0}).may({S_IFCHR | 0000, 1000, 1000}, R_OK | W_OK));
}

}  // namespace
}  // namespace srfs::tool
