// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The devices that the deployment names. None is opened.

#include <algorithm>
#include <array>
#include <cerrno>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/fd.hpp"
#include "hw/open.hpp"
#include "programs/srfs/doctor.hpp"

namespace srfs::tool {
namespace {

namespace fs = std::filesystem;
using suite::NodeEntry;

constexpr std::uint32_t bit_rate = 500'000;  // docs/reference/icd_can.md, section 1

// ---------------------------------------------------------------- modules of the kernel

enum class Module : std::uint8_t { there, loadable, absent, unknown };

/// @param file  name of its file, "can-raw"
Module module_state(const Machine& machine, const std::string& file) {
  std::string name = file;
  std::replace(name.begin(), name.end(), '-', '_');
  if (machine.exists(fs::path("/sys/module") / name)) return Module::there;
  for (const std::string& line : machine.lines("/proc/modules"))
    if (line.starts_with(name + " ")) return Module::there;
  const fs::path folder =
      fs::path("/lib/modules") / machine.text("/proc/sys/kernel/osrelease").value_or("unknown");
  const std::string entry = "/" + file + ".ko";
  if (machine.text(folder / "modules.builtin").value_or("").find(entry) != std::string::npos)
    return Module::there;
  const auto loadable = machine.text(folder / "modules.dep");
  if (!loadable) return Module::unknown;
  return loadable->find(entry) != std::string::npos ? Module::loadable : Module::absent;
}

void examine_module(Examination& x, const std::string& file, Verdict without, const std::string& why) {
  const std::string check = "kernel.module." + file;
  switch (module_state(x.machine, file)) {
    case Module::there:
      return x.ok(check, "there");
    case Module::loadable:
      return x.note(check, "not loaded", why, "modprobe " + file);
    case Module::unknown:
      return x.unknown(check, "neither loaded nor listed in /lib/modules", why);
    case Module::absent:
      break;
  }
  x.add(without, check, "not in this kernel", why,
        "apt-get install linux-image-$(dpkg --print-architecture)");
}

// ---------------------------------------------------------------- files of devices

/// What of /sys and of the system's groups belongs to a kind of device.
struct Kind {
  std::string_view scheme;
  const char* what;
  const char* class_folder;  ///< of /sys
  const char* group;
  const char* look;  ///< where a missing one can be found out
  int access;
};
constexpr std::array kinds{
    Kind{"serial", "serial line", "/sys/class/tty", "dialout", "dmesg | grep -i tty", R_OK | W_OK},
    Kind{"pps", "source of pulses", "/sys/class/pps", "dialout", "modprobe pps-gpio; dmesg | grep -i pps",
         R_OK | W_OK},
    Kind{"gpiochip", "GPIO chip", "/sys/bus/gpio/devices", "gpio", "dmesg | grep -i gpio", R_OK | W_OK},
    Kind{"dev", "watchdog", "/sys/class/watchdog", "watchdog", "dmesg | grep -i -e watchdog -e wdt", W_OK},
    Kind{"v4l2", "camera", "/sys/class/video4linux", "video", "dmesg | grep -i video", R_OK | W_OK}};

/// Executables that open a device, beside those of payloads; empty: one of added nodes, or unknown.
std::vector<std::string_view> users_of(std::string_view key, bool bus) {
  if (bus || key == "gpio") return {"can_switcher_node"};
  if (key == "rs422") return {"ttc_node"};
  if (key == "camera") return {"image_acquisition_node"};
  if (key == "gps_pulse" || key == "gps_serial" || key == "watchdog") return {"timing_node"};
  return {};
}

/// The accounts of the processes that open a device, each once.
std::vector<Account> accounts_for(const Examination& x, std::string_view key) {
  const auto& buses = x.deployment.buses;
  const bool bus =
      std::any_of(buses.begin(), buses.end(), [&](const suite::Bus& b) { return b.name == key; });
  const auto executables = users_of(key, bus);
  const bool of_payloads = bus || key == "gpio";
  std::vector<Account> accounts;
  for (const NodeEntry& node : x.deployment.nodes) {
    const std::string executable = fs::path(node.executable).filename();
    const bool payload = of_payloads && node.peripheral;
    if (!executables.empty() && !payload &&
        std::find(executables.begin(), executables.end(), executable) == executables.end())
      continue;
    const auto account = x.account(node);
    const bool known = account && std::any_of(accounts.begin(), accounts.end(), [&](const Account& other) {
                         return other.name == account->name;
                       });
    if (account && !known) accounts.push_back(*account);
  }
  return accounts;
}

/// A group that may, or a rule of udev that makes one.
std::string access_command(const Examination& x, const Kind& kind, const fs::path& path,
                           const Machine::File& file, const std::string& user) {
  const auto wanted = static_cast<unsigned>(kind.access);
  if (file.group != 0 && (file.mode >> 3U & wanted) == wanted)
    return fmt::format("usermod -aG {} {}", name_of_group(x.machine, file.group), user);
  return fmt::format(
      "groupadd -f --system {0} && usermod -aG {0} {1} && echo 'KERNEL==\"{2}\", GROUP=\"{0}\", "
      "MODE=\"0660\"' >> /etc/udev/rules.d/60-srfs.rules && udevadm control --reload && udevadm trigger",
      kind.group, user, x.machine.name_behind(path));
}

/// Existence, type and access. @return whether it is one that can be used
bool examine_file(Examination& x, const std::string& check, std::string_view key, const Kind& kind,
                  const fs::path& path) {
  const auto file = x.machine.look(path);
  if (!file) {
    x.add(Verdict::fail, check, fmt::format("{}: {}", path.string(), errno_text(file.error())),
          fmt::format("a {}", kind.what), kind.look);
    return false;
  }
  if (!S_ISCHR(file->mode)) {
    x.add(Verdict::fail, check, path.string() + " is not a character device", fmt::format("a {}", kind.what),
          kind.look);
    return false;
  }
  for (const Account& account : accounts_for(x, key)) {
    if (account.may(*file, kind.access)) continue;
    x.add(Verdict::fail, check,
          fmt::format("{} is {}:{} {:04o}", path.string(), name_of_user(x.machine, file->owner),
                      name_of_group(x.machine, file->group), file->mode & 07777U),
          fmt::format("access for user {}", account.name),
          access_command(x, kind, path, *file, account.name));
    return false;
  }
  const fs::path entry = fs::path(kind.class_folder) / x.machine.name_behind(path);
  // The old name /dev/watchdog is the first device's.
  if (!x.machine.exists(entry) && entry.filename() != "watchdog") {
    x.unknown(
        check,
        fmt::format("{} exists, but {} does not: kind of device unknown", path.string(), entry.string()),
        fmt::format("a {}", kind.what));
    return false;
  }
  return true;
}

// ---------------------------------------------------------------- kinds

void examine_can(Examination& x, const std::string& check, const std::string& interface) {
  const bool virtual_one = interface.starts_with("vcan");
  examine_module(x, "can-raw", Verdict::fail, "SocketCAN (CONFIG_CAN_RAW)");
  if (virtual_one) examine_module(x, "vcan", Verdict::fail, "virtual CAN interfaces (CONFIG_CAN_VCAN)");
  examine_module(x, "can-isotp", Verdict::note, "for tools (isotpdump) only");
  const fs::path folder = fs::path("/sys/class/net") / interface;
  constexpr std::int64_t can_type = 280;  // ARPHRD_CAN
  constexpr unsigned long is_up = 1;      // IFF_UP
  const std::string bring_up =
      virtual_one ? fmt::format("ip link set {} up", interface)
                  : fmt::format("ip link set {} up type can bitrate {} restart-ms 100", interface, bit_rate);
  const std::string expected = virtual_one ? "up" : fmt::format("up, {} bit/s", bit_rate);
  if (!x.machine.exists(folder))
    return x.add(Verdict::fail, check, "no interface " + interface, expected,
                 virtual_one
                     ? fmt::format("modprobe vcan; ip link add {} type vcan && {}", interface, bring_up)
                     : "dmesg | grep -i can");
  if (const auto type = x.machine.number(folder / "type"); type && *type != can_type)
    return x.add(Verdict::fail, check, interface + " is not a CAN interface", expected, "ip -d link show");
  const auto flags = x.machine.text(folder / "flags");
  if (!flags) return x.unknown(check, fmt::format("{}: /sys does not show its flags", interface), expected);
  if ((std::strtoul(flags->c_str(), nullptr, 16) & is_up) == 0)
    return x.add(Verdict::fail, check, interface + " is down", expected, bring_up);
  if (virtual_one) return x.ok(check, interface + " is up");
  const auto link = x.machine.can_link(interface);
  if (!link)
    return x.unknown(
        check, fmt::format("{} is up; cannot read its bit rate: {}", interface, errno_text(link.error())),
        expected);
  if (!link->bit_rate) return x.unknown(check, interface + " is up, but reports no bit rate", expected);
  if (*link->bit_rate != bit_rate)
    return x.add(Verdict::fail, check, fmt::format("{} runs at {} bit/s", interface, *link->bit_rate),
                 expected, fmt::format("ip link set {} down && {}", interface, bring_up));
  if (link->state == hw::CanBusState::bus_off)
    return x.add(Verdict::fail, check, interface + " is bus-off: cabling, bit rate, no partner", "active",
                 fmt::format("ip link set {} type can restart", interface));
  if (link->state == hw::CanBusState::passive || link->state == hw::CanBusState::warning)
    return x.add(Verdict::warn, check, interface + " counts errors: cabling, bit rate, no partner", "active",
                 fmt::format("ip -d -s link show {}", interface));
  x.ok(check, fmt::format("{} is up, {} bit/s", interface, *link->bit_rate));
}

void examine_serial(Examination& x, const std::string& check, const fs::path& path) {
  const std::string tty = x.machine.name_behind(path);
  const auto login = x.machine.processes("cmdline", [&](const std::string& words) {
    return words.find("getty") != std::string::npos && words.find(tty) != std::string::npos;
  });
  if (!login.found.empty())
    return x.add(Verdict::fail, check, fmt::format("a login waits on {} (pid {})", tty, login.found.front()),
                 "no other user", fmt::format("systemctl disable --now serial-getty@{}.service", tty));
  const auto consoles = x.machine.text("/sys/class/tty/console/active");
  if (!consoles || !login.complete)
    return x.unknown(check,
                     fmt::format("{} exists; whether it has other users is not visible", path.string()));
  if ((" " + *consoles + " ").find(" " + tty + " ") != std::string::npos)
    return x.add(Verdict::fail, check, fmt::format("{} is a console of the kernel", tty),
                 fmt::format("no console={} on the kernel's command line", tty), "");
  x.ok(check, path.string() + ", no other user");
}

void examine_pulse(Examination& x, const std::string& check, const fs::path& path) {
  const fs::path folder = fs::path("/sys/class/pps") / x.machine.name_behind(path);
  const auto assert = x.machine.text(folder / "assert");
  double second = 0;
  unsigned long count = 0;
  if (!assert || std::sscanf(assert->c_str(), "%lf#%lu", &second, &count) != 2)
    return x.unknown(check, path.string() + " does not show its last pulse", "one pulse per second");
  const double age_s = static_cast<double>(x.now.ns()) / 1e9 - second;
  constexpr double recent_s = 3;
  if (count > 0 && age_s > -recent_s && age_s < recent_s)
    return x.ok(check, fmt::format("{}: pulse {}, {:.1f} s ago", path.string(), count, age_s));
  x.add(Verdict::warn, check,
        count == 0 ? path.string() + ": no pulse so far"
                   : fmt::format("{}: the last pulse is {:.0f} s old", path.string(), age_s),
        "one pulse per second", fmt::format("watch -n 1 cat {}/assert", folder.string()));
}

/// systemd or a daemon that has the watchdog keeps timing from it.
void examine_watchdog_users(Examination& x, const std::string& check) {
  const std::string drop_ins = "/etc/systemd/system.conf.d";
  std::vector<std::string> files{"/etc/systemd/system.conf"};
  for (const std::string& name : x.machine.names(drop_ins).value_or(std::vector<std::string>()))
    files.push_back(drop_ins + "/" + name);
  for (const std::string& file : files) {
    for (const std::string& line : x.machine.lines(file)) {
      const std::string key = "RuntimeWatchdogSec=";
      const std::string value = line.starts_with(key) ? line.substr(key.size()) : "";
      if (value.empty() || value == "0" || value == "off" || value == "infinity") continue;
      x.add(Verdict::fail, check + ".user", fmt::format("{}: {}", file, line), "only timing feeds it",
            fmt::format(
                "sed -i 's/^RuntimeWatchdogSec=.*/RuntimeWatchdogSec=off/' {} && systemctl daemon-reexec",
                file));
    }
  }
  for (const char* daemon : {"watchdog", "wd_keepalive"}) {
    const auto running = x.machine.processes("comm", [&](const std::string& name) { return name == daemon; });
    if (running.found.empty()) continue;
    x.add(Verdict::fail, check + ".user", fmt::format("{} runs (pid {})", daemon, running.found.front()),
          "only timing feeds it", fmt::format("systemctl disable --now {}", daemon));
  }
}

void examine_watchdog(Examination& x, const std::string& check, const fs::path& path) {
  const std::string name = x.machine.name_behind(path);
  const fs::path folder = fs::path("/sys/class/watchdog") / (name == "watchdog" ? "watchdog0" : name);
  examine_watchdog_users(x, check);
  const std::string identity = x.machine.text(folder / "identity").value_or("a watchdog");
  const auto nowayout = x.machine.text(folder / "nowayout");
  if (!nowayout) {
    x.unknown(check,
              fmt::format("{}: {}; {} does not show nowayout", path.string(), identity, folder.string()),
              "nowayout");
  } else if (*nowayout == "0") {
    x.add(Verdict::warn, check,
          fmt::format("{}: {}, without nowayout: root can stop it", path.string(), identity), "nowayout",
          fmt::format("echo 1 > {}/nowayout", folder.string()));
  } else {
    x.ok(check, fmt::format("{}: {}, nowayout", path.string(), identity));
  }
  const NodeEntry* timing = x.running("timing_node");
  const auto longest = x.machine.number(folder / "max_timeout");
  constexpr std::int64_t usual_timeout_s = 30;  // nodes/timing/timing_node.cpp
  const std::int64_t wanted =
      timing != nullptr ? timing->parameters.integer("watchdog_timeout_s", 1, 3600, usual_timeout_s) : 0;
  if (timing == nullptr) return;
  if (!longest)
    return x.unknown(check + ".timeout", folder.string() + " does not show the longest time-out",
                     fmt::format("{} s, timing's watchdog_timeout_s", wanted));
  if (*longest == 0) return x.ok(check + ".timeout", fmt::format("{} s, the driver has no limit", wanted));
  if (*longest >= wanted)
    return x.ok(check + ".timeout", fmt::format("{} s of at most {} s", wanted, *longest));
  x.add(Verdict::fail, check + ".timeout", fmt::format("{} s at most", *longest),
        fmt::format("{} s, timing's watchdog_timeout_s", wanted), "");
}

void examine_folder(Examination& x, const std::string& check, const fs::path& path) {
  const auto file = x.machine.look(path);
  if (file && S_ISDIR(file->mode)) return x.ok(check, path.string());
  x.add(Verdict::fail, check, fmt::format("no folder {}", path.string()), "a folder with frames",
        fmt::format("mkdir -p {}", path.string()));
}

void examine_device(Examination& x, const std::string& key, const std::string& uri) {
  const std::string check = "device." + key;
  const auto parsed =
      hw::parse_device_uri(uri, {"socketcan", "serial", "pps", "gpiochip", "dev", "v4l2", "dir", "sim"});
  if (!parsed)
    return x.add(Verdict::fail, check, parsed.error().message, "a device URI (lib/hw/open.hpp)", "");
  if (parsed->scheme == "socketcan") return examine_can(x, check, parsed->rest);
  const fs::path path = hw::below_var(parsed->rest, x.var);
  if (parsed->scheme == "dir") return examine_folder(x, check, path);
  if (parsed->scheme == "sim" || fs::path(parsed->rest).is_relative())
    return x.note(check, fmt::format("{}: simulated, {}", uri,
                                     x.machine.exists(path) ? "exists" : "exists while hw_sim runs"));
  const auto* const kind =
      std::find_if(kinds.begin(), kinds.end(), [&](const Kind& k) { return k.scheme == parsed->scheme; });
  if (kind == kinds.end() || !examine_file(x, check, key, *kind, path)) return;
  if (parsed->scheme == "serial") return examine_serial(x, check, path);
  if (parsed->scheme == "pps") return examine_pulse(x, check, path);
  if (parsed->scheme == "dev") return examine_watchdog(x, check, path);
  x.ok(check, fmt::format("{}, a {}", path.string(), kind->what));
}

struct Intruder {
  const char* process;
  const char* units;
  const char* why;
};
constexpr std::array intruders{Intruder{"gpsd", "gpsd.socket gpsd.service", "takes serial lines and pulses"},
                               Intruder{"ModemManager", "ModemManager", "talks to serial lines"}};

}  // namespace

void examine_devices(Examination& x) {
  for (const auto& [key, uri] : x.deployment.devices) examine_device(x, key, uri);
  const bool serial = std::any_of(x.deployment.devices.begin(), x.deployment.devices.end(),
                                  [](const auto& device) { return device.second.starts_with("serial:/"); });
  if (!serial) return;
  for (const Intruder& one : intruders) {
    const auto running =
        x.machine.processes("comm", [&](const std::string& name) { return name == one.process; });
    if (running.found.empty()) continue;
    x.add(Verdict::fail, std::string("device.intruder"),
          fmt::format("{} runs (pid {})", one.process, running.found.front()),
          fmt::format("not running: it {}", one.why), fmt::format("systemctl disable --now {}", one.units));
  }
}

}  // namespace srfs::tool
