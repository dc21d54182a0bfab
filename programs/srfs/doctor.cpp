// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/doctor.hpp"

#include <algorithm>
#include <array>
#include <iostream>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "suite/launcher.hpp"

namespace srfs::tool {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array verdicts{Verdict::ok, Verdict::note, Verdict::unknown, Verdict::warn, Verdict::fail};

std::size_t count(const std::vector<Finding>& findings, Verdict verdict) {
  return static_cast<std::size_t>(std::count_if(findings.begin(), findings.end(),
                                                [&](const Finding& f) { return f.verdict == verdict; }));
}

Json text_or_null(const std::string& text) {
  return text.empty() ? Json(nullptr) : Json(text);
}

Json to_json(const suite::Deployment& deployment, const std::vector<Finding>& findings) {
  Json counts = Json::object();
  for (const Verdict verdict : verdicts) counts[std::string(to_text(verdict))] = count(findings, verdict);
  Json list = Json::array();
  for (const Finding& f : findings)
    list.push_back({{"verdict", to_text(f.verdict)},
                    {"check", f.check},
                    {"found", f.found},
                    {"expected", text_or_null(f.expected)},
                    {"command", text_or_null(f.command)}});
  return {{"ok", count(findings, Verdict::fail) == 0},
          {"deployment", deployment.name},
          {"counts", counts},
          {"findings", list}};
}

void print(const suite::Deployment& deployment, const std::vector<Finding>& findings) {
  for (const Finding& f : findings) {
    std::string line = fmt::format("{:<8} {:<38} {}", to_text(f.verdict), f.check, f.found);
    if (!f.expected.empty()) line += "; expected " + f.expected;
    if (!f.command.empty()) line += " -> " + f.command;
    fmt::print("{}\n", line);
  }
  std::string counts;
  for (const Verdict verdict : verdicts)
    counts += fmt::format("{}{} {}", counts.empty() ? "" : ", ", count(findings, verdict), to_text(verdict));
  const bool commands =
      std::any_of(findings.begin(), findings.end(), [](const Finding& f) { return !f.command.empty(); });
  fmt::print("{} for '{}': {}{}\n", count(findings, Verdict::fail) == 0 ? "Ready" : "NOT ready",
             deployment.name, counts, commands ? "; after ->: a command to run as root" : "");
}

}  // namespace

std::string_view to_text(Verdict verdict) {
  static constexpr std::array<std::string_view, verdicts.size()> texts{"OK", "note", "unknown", "WARN",
                                                                       "FAIL"};
  return texts[static_cast<std::size_t>(verdict)];
}

void Examination::ok(std::string check, std::string found) {
  add(Verdict::ok, std::move(check), std::move(found), "", "");
}

void Examination::note(std::string check, std::string found, std::string expected, std::string command) {
  add(Verdict::note, std::move(check), std::move(found), std::move(expected), std::move(command));
}

void Examination::unknown(std::string check, std::string why, std::string expected) {
  add(Verdict::unknown, std::move(check), std::move(why), std::move(expected), "");
}

void Examination::add(Verdict verdict, std::string check, std::string found, std::string expected,
                      std::string command) {
  findings.push_back({verdict, std::move(check), std::move(found), std::move(expected), std::move(command)});
}

bool Examination::flies() const {
  return std::any_of(deployment.devices.begin(), deployment.devices.end(), [](const auto& device) {
    const std::string& uri = device.second;
    if (uri.starts_with("socketcan:")) return !uri.starts_with("socketcan:vcan");
    // A path relative to VAR is the simulation's.
    return !uri.starts_with("sim:") && !uri.starts_with("dir:") && uri.find(":/") != std::string::npos;
  });
}

bool Examination::is_real_time() const {
  return std::any_of(deployment.nodes.begin(), deployment.nodes.end(), [](const suite::NodeEntry& node) {
    return node.scheduling.policy == suite::SchedulingPolicy::fifo;
  });
}

const suite::NodeEntry* Examination::running(std::string_view executable) const {
  const auto found =
      std::find_if(deployment.nodes.begin(), deployment.nodes.end(), [&](const suite::NodeEntry& node) {
        return std::filesystem::path(node.executable).filename() == executable;
      });
  return found == deployment.nodes.end() ? nullptr : &*found;
}

std::optional<Account> Examination::account(const suite::NodeEntry& node) const {
  if (node.user.empty() || node.user == starter.name) return starter;
  return account_of(machine, node.user);
}

std::vector<Finding> examine(const Machine& machine, const suite::Deployment& deployment,
                             const std::filesystem::path& var, const std::filesystem::path& prefix,
                             UtcTime now) {
  Examination x{machine, deployment, var, prefix, now, {}};
  if (const auto account = caller(machine)) {
    x.starter = *account;
    x.note("user", fmt::format("assumed: {} starts the suite", account->name));
  } else {
    x.starter = {"nobody", 65534, {65534}, 0};
    x.unknown("user", "not shown in /proc/self/status; assumed: user nobody");
  }
  examine_kernel(x);
  examine_waiting(x);
  examine_processors(x);
  examine_limits(x);
  examine_users(x);
  examine_privileges(x);
  examine_devices(x);
  examine_sysctls(x);
  examine_memory(x);
  examine_orders(x);
  examine_disk(x);
  examine_network(x);
  examine_clock(x);
  examine_lane(x);
  examine_keys(x);
  return std::move(x.findings);
}

int doctor(const suite::Deployment& deployment, const std::filesystem::path& var, bool json) {
  const Machine machine;
  const auto findings =
      examine(machine, deployment, var, suite::suite_bin_folder().parent_path(), system_utc_now());
  if (json) {
    std::cout << to_json(deployment, findings).dump(2, ' ', false, Json::error_handler_t::replace) << "\n";
  } else {
    print(deployment, findings);
  }
  return count(findings, Verdict::fail) == 0 ? 0 : 1;
}

}  // namespace srfs::tool
