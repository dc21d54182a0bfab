// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/versions.hpp"

#include <map>

#include <fmt/format.h>

#include "base/text.hpp"

namespace srfs::simulation {

using update::VersionNumber;
using update::VersionStore;
using update::VersionTable;

namespace {

constexpr nanoseconds disk_patience = seconds(1);

}  // namespace

std::string to_text(const PlayedProgram& program) {
  return fmt::format("{} {}", program.name, program.lives.count());
}

Versions::Versions(Kernel& kernel, const Disk& disk, const std::vector<Host*>& hosts)
    : kernel_(kernel), disk_(disk) {
  for (const Host* host : hosts) {
    nodes_.emplace_back();
    nodes_.back().name = host->name();
    nodes_.back().files.random = static_cast<std::uint32_t>(kernel.random("versions " + host->name()).next());
  }
}

VersionTable Versions::read(const Node& node) {
  VersionTable table = VersionStore(node.files, node.name).read().table;
  const std::uint64_t revision = table.revision();
  for (const SetAside& failed : node.aside) {
    if (failed.revision == revision) (void)table.fail(failed.version, failed.reason);
  }
  return table;
}

VersionTable Versions::read(const Host& host) const {
  return read(node(host));
}

Result<void, std::string> Versions::change(const Host& host, const Change& change) {
  Node& n = node(host);
  n.files.refuses = disk_.failing();
  VersionStore store(n.files, n.name);
  const std::uint64_t revision = store.read().table.revision();
  for (const SetAside& failed : n.aside) {
    if (failed.revision != revision) continue;
    if (auto done = store.fail(failed.version, failed.reason); !done) return done;
  }
  auto changed = change(store);
  const VersionTable table = store.read().table;
  for (const update::Version& version : table.versions())
    kernel_.coverage().note(StateTable::version,
                            static_cast<std::uint64_t>(host.lane()) << 32U | version.number,
                            static_cast<std::uint8_t>(version.state));
  return changed;
}

std::optional<std::string> Versions::damage_of(const Node& node, const update::Version& version) {
  return VersionStore(node.files, node.name).damage(version);
}

VersionNumber Versions::on_begin(const Host& host) {
  Node& n = node(host);
  n.since = kernel_.now();
  n.running = update::golden;
  const VersionTable table = read(n);
  for (const update::Version& version : table.versions()) {
    // Nothing rots here.
    if (const auto bad = damage_of(n, version))
      throw Violation{"C6d", fmt::format("the table names a program that is not there whole: {} {}: {}",
                                         n.name, version.number, *bad)};
  }
  n.running = table.start_order().front();
  return n.running;
}

milliseconds Versions::life_of(const Node& node) {
  if (node.running == update::golden) return milliseconds(0);
  const auto program = node.files.read(VersionStore(node.files, node.name).file_of(node.running));
  if (!program) return milliseconds(0);
  return milliseconds(to_number<std::uint32_t>(program->substr(program->find(' ') + 1)).value_or(0));
}

void Versions::on_running(Host& host) {
  const Node& n = node(host);
  if (const milliseconds life = life_of(n); life > milliseconds(0))
    host.later(life, [] { throw Host::Killed{}; });
  const auto trial = trial_of(host);
  if (!trial) return;
  host.later(trial->probation, [this, &host, version = trial->version] {
    (void)change(host, [version](VersionStore& store) -> Result<void, std::string> {
      const VersionTable table = store.read().table;
      const update::Version* const on_trial = table.on_trial();
      if (on_trial == nullptr || on_trial->number != version) return {};
      return store.commit(version);
    });
  });
}

std::string Versions::running_origin(const Host& host) const {
  const VersionTable table = read(host);
  const update::Version* const version = table.find(running(host));
  return version == nullptr ? std::string() : version->origin;
}

std::optional<suite::VersionTrial> Versions::trial_of(const Host& host) const {
  const Node& n = node(host);
  const VersionTable table = read(n);
  const update::Version* const version = table.on_trial();
  if (version == nullptr || n.running != version->number) return std::nullopt;
  return suite::VersionTrial{version->number, version->probation, kernel_.now() - n.since, false};
}

void Versions::set_aside(Host& host, VersionNumber version, const std::string& reason) {
  Node& n = node(host);
  const std::uint64_t revision = VersionStore(n.files, n.name).read().table.revision();
  n.aside.push_back({revision, version, reason});
  ++fallbacks_;
  kernel_.trace(Lane::world, host.lane(), "version set aside", version);
  kernel_.later(disk_patience, [this, &host] {
    (void)change(host, [](VersionStore&) { return Result<void, std::string>(); });
  });
}

void Versions::count_suite_start(const Host& host) {
  Node& n = node(host);
  if (read(n).on_trial() == nullptr) return;
  const VersionNumber version = read(n).on_trial()->number;
  const auto counted = change(host, [](VersionStore& store) -> Result<void, std::string> {
    if (store.read().table.on_trial() == nullptr) return {};
    return store.count_reset();
  });
  if (!counted)
    n.aside.push_back({VersionStore(n.files, n.name).read().table.revision(), version, counted.error()});
}

void Versions::lose_power() {
  for (Node& n : nodes_) {
    n.files.lose_unsynced();
    n.aside.clear();
  }
}

void Versions::check() const {
  for (const Node& n : nodes_) {
    if (life_of(n) > milliseconds(0))
      throw Violation{"C6d", fmt::format("a program that dies is still in use: {} {}", n.name, n.running)};
    std::map<std::string, VersionNumber> by_origin;
    const VersionTable table = read(n);
    if (const VersionNumber named = table.start_order().front(); n.running != named)
      throw Violation{"C6d", fmt::format("a node runs another program than its table names: {} {}, not {}",
                                         n.name, n.running, named)};
    for (const update::Version& version : table.versions()) {
      if (!by_origin.emplace(version.origin, version.number).second)
        throw Violation{"F6", fmt::format("a package is stored twice: {} {}", n.name, version.origin)};
    }
  }
}

}  // namespace srfs::simulation
