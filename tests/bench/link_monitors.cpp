// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <ctime>
#include <random>
#include <stdexcept>
#include <vector>

#include "nodes/ttc/services/monitoring.hpp"
#include "tests/bench/link_measures.hpp"

namespace srfs::bench {
namespace {

nanoseconds cpu_now() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return seconds(t.tv_sec) + nanoseconds(t.tv_nsec);
}

bool is_number(const mission::Field& field) {
  return field.type != mission::FieldType::text && field.type != mission::FieldType::time &&
         field.type != mission::FieldType::packet;
}

/// The factory set, and further limits all over the telemetry until the table is full.
MonitorTable full_table(const mission::Dictionary& dictionary) {
  MonitorTable table = factory_monitors(dictionary);
  std::uint16_t id = 10'000;
  while (table.size() < Monitoring::max_definitions) {
    for (const mission::Structure& structure : dictionary.structures()) {
      std::uint32_t parameter = static_cast<std::uint32_t>(structure.id) << 16U;
      for (const mission::Field& field : structure.fields) {
        for (std::size_t i = 0; i < field.count; ++i, ++parameter) {
          if (structure.id == 0 || !is_number(field) || table.size() == Monitoring::max_definitions) continue;
          mission::MonitorAdd what;
          what.id = ++id;
          what.parameter = parameter;
          what.condition_mask = what.mask = UINT32_MAX;
          what.repetition = 3;
          what.check = MonitorCheck::limits;
          what.low = 0;
          what.high = 1e9;
          what.hysteresis = 1;
          table[id] = {.what = what, .enabled = true};
        }
      }
    }
  }
  return table;
}

/// As many functional monitors as there can be, each with as many monitors.
FunctionalTable full_functional_table(const MonitorTable& monitors) {
  FunctionalTable table;
  auto next = monitors.begin();
  for (std::uint16_t id = 1; id <= Monitoring::max_functional; ++id) {
    FunctionalDefinition& definition = table[id];
    definition.enabled = true;
    definition.minimum_failing = Monitoring::max_monitors;
    for (; definition.monitors.size() < Monitoring::max_monitors; ++next)
      definition.monitors.push_back(next->first);
  }
  return table;
}

}  // namespace

Json measure_monitors(const MonitorOptions& options) {
  const auto dictionary = mission::Dictionary::load(mission::Dictionary::default_folder());
  Monitoring monitoring(dictionary);
  const MonitorTable table = full_table(dictionary);
  const nanoseconds before_table = cpu_now();
  monitoring.set_table(table);
  const nanoseconds table_change = cpu_now() - before_table;
  monitoring.set_functional_table(full_functional_table(table));

  struct Source {
    const mission::Structure* structure;
    std::vector<Octets> samples;
  };
  std::mt19937_64 random(options.seed);
  std::vector<Source> sources;
  for (const mission::Structure& structure : dictionary.structures()) {
    if (structure.id == 0 || structure.interval < seconds(1)) continue;
    Source source{&structure, {}};
    for (int i = 0; i < 16; ++i) {
      Octets sample(structure.max_size());
      for (auto& octet : sample) octet = static_cast<std::uint8_t>(random() % 4);  // short texts
      source.samples.push_back(std::move(sample));
    }
    sources.push_back(std::move(source));
  }
  std::uint64_t samples = 0;
  const nanoseconds begin = cpu_now();
  for (int second = 0; second < options.seconds; ++second) {
    const MonotonicTime now{seconds(second)};
    for (const Source& source : sources) {
      if (second % std::max<std::int64_t>(1, source.structure->interval / seconds(1)) != 0) continue;
      ++samples;
      monitoring.on_sample(source.structure->id, source.samples[samples % source.samples.size()], {}, now);
      static_cast<void>(monitoring.take_transitions());
    }
    monitoring.on_time({}, now);
  }
  const nanoseconds used = cpu_now() - begin;
  if (monitoring.counters().checks == 0) throw std::runtime_error("nothing was checked");
  const double flown = options.seconds;
  return {
      {"definitions", monitoring.table().size()},
      {"functional", monitoring.functional_table().size()},
      {"samples_a_second", static_cast<double>(samples) / flown},
      {"checks_a_second", static_cast<double>(monitoring.counters().checks) / flown},
      {"ns_a_check", static_cast<double>(used.count()) / static_cast<double>(monitoring.counters().checks)},
      {"core_percent", 100 * static_cast<double>(used.count()) * 1e-9 / flown},
      {"table_change_us", static_cast<double>(table_change.count()) * 1e-3}};
}

}  // namespace srfs::bench
