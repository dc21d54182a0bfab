// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/mode_causes.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace srfs {
namespace {

constexpr int protection_of_safe = 2;
constexpr unsigned bit_of_nodes = 7;

}  // namespace

ModeCauses::ModeCauses(const mission::Dictionary& dictionary, suite::ModeSettings settings, MonotonicTime now)
    : settings_(std::move(settings)) {
  const mission::Command* set_mode = dictionary.command(mission::TtcSetMode::name);
  if (set_mode != nullptr && !set_mode->arguments.empty() &&
      set_mode->arguments.front().enumeration != nullptr) {
    for (const auto& [number, name] : set_mode->arguments.front().enumeration->labels)
      names_[static_cast<std::uint8_t>(number)] = name;
  }
  for (const auto& [mode, rows] : settings_.table) {
    const bool known = std::any_of(names_.begin(), names_.end(),
                                   [&, name = mode](const auto& n) { return n.second == name; });
    if (!known) problems_.push_back(fmt::format("modes.table: the dictionary has no mode '{}'", mode));
  }
  std::set<std::string> rows;
  for (const auto& [mode, of_mode] : settings_.table) {
    for (const auto& [node, reaction] : of_mode) rows.insert(node);
  }
  rows.insert(settings_.critical.begin(), settings_.critical.end());
  for (const std::string& node : rows) {
    if (dictionary.apid_of_node(node) == nullptr)
      problems_.push_back(fmt::format("modes: the dictionary has no node '{}'", node));
  }
  for (const suite::ModeCause& rule : settings_.causes) {
    causes_.push_back({.rule = rule, .heard = now});
    resolve(dictionary, causes_.back());
  }
  if (!settings_.enabled()) return;
  for (const std::string& node : settings_.critical) critical_.push_back({.node = node, .since = now});
}

void ModeCauses::resolve(const mission::Dictionary& dictionary, Cause& cause) {
  const mission::Structure* structure = dictionary.structure(cause.rule.structure);
  const auto offset =
      structure == nullptr ? std::nullopt : mission::Dictionary::offset_of(*structure, cause.rule.field);
  const auto mode = std::find_if(names_.begin(), names_.end(),
                                 [&](const auto& name) { return name.second == cause.rule.mode; });
  bool fits = structure != nullptr && structure->id != 0 && offset && mode != names_.end();
  if (fits) {
    const auto field = std::find_if(structure->fields.begin(), structure->fields.end(),
                                    [&](const mission::Field& f) { return f.name == cause.rule.field; });
    fits = field->type == mission::FieldType::f32 && field->count == 1 && field->calibration.empty();
  }
  if (!fits) {
    problems_.push_back(fmt::format(
        "modes.causes: {}: the dictionary has no f32 '{}' in a housekeeping structure '{}', or no "
        "mode '{}'",
        cause.rule.name, cause.rule.field, cause.rule.structure, cause.rule.mode));
    return;
  }
  cause.structure_id = structure->id;
  cause.offset = *offset;
  cause.mode = static_cast<MissionMode>(mode->first);
}

std::string ModeCauses::name_of(MissionMode mode) const {
  const auto found = names_.find(static_cast<std::uint8_t>(mode));
  return found == names_.end() ? suite::ModeSettings::safe : found->second;
}

// ---- inputs

void ModeCauses::on_telemetry(std::uint16_t structure_id, OctetView data, MonotonicTime now) {
  for (Cause& cause : causes_) {
    if (cause.structure_id == 0 || cause.structure_id != structure_id) continue;
    OctetReader reader(data);
    (void)reader.bytes(cause.offset);
    const auto value = static_cast<double>(reader.f32());
    if (!reader.ok() || !std::isfinite(value)) continue;  // no measurement: it grows stale
    cause.heard = now;
    cause.stale = false;
    cause.last = value;
    judge(cause, value);
  }
}

void ModeCauses::judge(Cause& cause, double value) {
  const double threshold = cause.present ? cause.rule.leave : cause.rule.enter;
  const bool wants_below = cause.rule.below != cause.present;
  const bool is_beyond = wants_below ? value < threshold : value > threshold;
  cause.beyond = is_beyond ? cause.beyond + 1 : 0;
  if (cause.beyond < cause.rule.samples) return;
  cause.present = !cause.present;
  cause.beyond = 0;
}

void ModeCauses::on_node(const std::string& node, bool active, MonotonicTime now) {
  for (Critical& critical : critical_) {
    if (critical.node != node || critical.active == active) continue;
    critical.active = active;
    critical.since = now;
    if (active) critical.reported = false;
  }
}

void ModeCauses::look_at_age(MonotonicTime now) {
  for (Cause& cause : causes_) {
    if (cause.structure_id == 0 || cause.rule.stale == seconds(0)) continue;
    cause.stale = now - cause.heard >= cause.rule.stale;
  }
}

// ---- decisions

bool ModeCauses::counts(const std::string& name) const {
  return std::find(ignored_.begin(), ignored_.end(), name) == ignored_.end();
}

bool ModeCauses::is_lost(const Critical& critical, MonotonicTime now) const {
  return !critical.active && now - critical.since >= settings_.lost && counts(node_lost);
}

int ModeCauses::protection(MissionMode mode) const {
  if (mode == MissionMode::safe) return protection_of_safe;
  return std::any_of(causes_.begin(), causes_.end(), [&](const Cause& c) { return c.mode == mode; }) ? 1 : 0;
}

const ModeCauses::Cause* ModeCauses::demanding() const {
  const Cause* most = nullptr;
  for (const Cause& cause : causes_) {
    if (!(cause.present || cause.stale) || !counts(cause.rule.name)) continue;
    if (most == nullptr || protection(cause.mode) > protection(most->mode)) most = &cause;
  }
  return most;
}

ModeWhy ModeCauses::why(const Cause& cause) const {
  ModeWhy why{.cause = ModeCause::measurement, .source = cause.rule.name};
  why.reason = cause.stale ? fmt::format("{}: no sample for {} s", cause.rule.name, cause.rule.stale.count())
                           : fmt::format("{}: {} {:.3g} {} {:.3g}", cause.rule.name, cause.rule.field,
                                         cause.last, cause.rule.below ? "below" : "above", cause.rule.enter);
  return why;
}

std::optional<ModeCauses::Change> ModeCauses::lost_node(const ModeManager& mode, MonotonicTime now) {
  for (Critical& critical : critical_) {
    if (!is_lost(critical, now) || std::exchange(critical.reported, true)) continue;
    if (mode.mode() == MissionMode::safe) continue;
    return Change{
        MissionMode::safe,
        {.cause = ModeCause::node_lost,
         .source = node_lost,
         .reason = fmt::format("{} is not active for {} s", critical.node, settings_.lost / seconds(1))}};
  }
  return std::nullopt;
}

std::optional<ModeCauses::Change> ModeCauses::take_change(const ModeManager& mode, MonotonicTime now) {
  if (!std::exchange(restored_, true)) {
    // What an earlier process found is so until the second threshold says otherwise.
    for (Cause& cause : causes_) {
      if (mode.why().cause == ModeCause::measurement && mode.why().source == cause.rule.name)
        cause.present = true;
    }
  }
  look_at_age(now);
  if (auto lost = lost_node(mode, now)) return lost;
  const Cause* most = demanding();
  if (most != nullptr && protection(most->mode) > protection(mode.mode()))
    return Change{most->mode, why(*most)};
  if (mode.why().cause != ModeCause::measurement) return std::nullopt;
  const auto own = std::find_if(causes_.begin(), causes_.end(),
                                [&](const Cause& c) { return c.rule.name == mode.why().source; });
  if (own == causes_.end() || !own->rule.returns) return std::nullopt;
  if ((own->present || own->stale) && counts(own->rule.name)) return std::nullopt;
  if (most != nullptr) {
    if (most->mode == mode.mode() && most->rule.name == own->rule.name) return std::nullopt;
    return Change{most->mode, why(*most)};
  }
  if (mode.commanded() == mode.mode()) return std::nullopt;
  return Change{mode.commanded(),
                {.cause = ModeCause::on_board,
                 .reason = fmt::format("{} is over: {} {:.3g}", own->rule.name, own->rule.field, own->last)}};
}

std::optional<MonotonicTime> ModeCauses::next_due(MonotonicTime now) const {
  std::optional<MonotonicTime> due;
  const auto sooner = [&](MonotonicTime t) {
    if (t > now && (!due || t < *due)) due = t;
  };
  for (const Cause& cause : causes_) {
    if (cause.structure_id != 0 && cause.rule.stale > seconds(0)) sooner(cause.heard + cause.rule.stale);
  }
  for (const Critical& critical : critical_) {
    if (!critical.active && !critical.reported) sooner(critical.since + settings_.lost);
  }
  return due;
}

std::optional<std::pair<std::uint16_t, Octets>> ModeCauses::why_not(MissionMode mode) const {
  if (settings_.enabled() && !settings_.knows(name_of(mode)))
    return std::pair(mission::failure::unknown_identifier, octets_of_u16(static_cast<std::uint16_t>(mode)));
  const Cause* most = demanding();
  if (most == nullptr || protection(mode) >= protection(most->mode)) return std::nullopt;
  const auto number = static_cast<std::uint8_t>(most - causes_.data() + 1);
  return std::pair(mission::failure::mode_held, Octets{number});
}

// ---- for the ground

std::uint8_t ModeCauses::present_bits() const {
  unsigned bits = 0;
  for (std::size_t i = 0; i < causes_.size(); ++i) {
    if (causes_[i].present || causes_[i].stale) bits |= 1U << std::min<std::size_t>(i, bit_of_nodes);
  }
  for (const Critical& critical : critical_) {
    if (critical.reported) bits |= 1U << bit_of_nodes;
  }
  return static_cast<std::uint8_t>(bits);
}

std::string ModeCauses::present_text() const {
  std::vector<std::string> names;
  for (const Cause& cause : causes_) {
    if (cause.present || cause.stale)
      names.push_back(cause.rule.name + (counts(cause.rule.name) ? "" : " (ignored)"));
  }
  for (const Critical& critical : critical_) {
    if (critical.reported) names.push_back(critical.node + " lost");
  }
  return fmt::format("{}", fmt::join(names, ", "));
}

std::string ModeCauses::way_back(const ModeManager& mode) const {
  if (mode.why().cause != ModeCause::measurement) return {};
  for (const Cause& cause : causes_) {
    if (cause.rule.name != mode.why().source || !cause.rule.returns || mode.commanded() == mode.mode())
      continue;
    return fmt::format("{} when {} is {} {:.3g}", name_of(mode.commanded()), cause.rule.field,
                       cause.rule.below ? "above" : "below", cause.rule.leave);
  }
  return {};
}

}  // namespace srfs
