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

bool ModeCauses::has_row(MissionMode mode) const {
  if (mode == MissionMode::safe) return true;
  const auto name = names_.find(static_cast<std::uint8_t>(mode));
  return name != names_.end() && settings_.knows(name->second);
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
    if (active) critical.lost = critical.reported = false;
  }
}

void ModeCauses::look_at_age(MonotonicTime now) {
  for (Cause& cause : causes_) {
    if (cause.structure_id == 0 || cause.rule.stale == seconds(0)) continue;
    if (now - cause.heard < cause.rule.stale || std::exchange(cause.stale, true)) continue;
    cause.present = true;  // only samples beyond the second threshold end it
    cause.beyond = 0;
  }
  for (Critical& critical : critical_)
    critical.lost = !critical.active && now - critical.since >= settings_.lost;
}

// ---- decisions

bool ModeCauses::counts(const std::string& name) const {
  return std::find(ignored_.begin(), ignored_.end(), name) == ignored_.end();
}

const ModeCauses::Critical* ModeCauses::first_lost() const {
  if (!counts(node_lost)) return nullptr;
  const auto lost = std::find_if(critical_.begin(), critical_.end(),
                                 [](const Critical& critical) { return critical.lost; });
  return lost == critical_.end() ? nullptr : &*lost;
}

int ModeCauses::protection(MissionMode mode) const {
  if (mode == MissionMode::safe) return protection_of_safe;
  return std::any_of(causes_.begin(), causes_.end(), [&](const Cause& c) { return c.mode == mode; }) ? 1 : 0;
}

const ModeCauses::Cause* ModeCauses::demanding() const {
  const Cause* most = nullptr;
  for (const Cause& cause : causes_) {
    if (!cause.present || !counts(cause.rule.name)) continue;
    if (most == nullptr || protection(cause.mode) > protection(most->mode)) most = &cause;
  }
  return most;
}

ModeWhy ModeCauses::why(const Cause& cause) const {
  ModeWhy why{.cause = ModeCause::measurement, .source = cause.rule.name};
  const bool below = cause.rule.below;
  if (cause.stale) {
    why.reason = fmt::format("{}: no sample for {} s", cause.rule.name, cause.rule.stale.count());
  } else if (below ? cause.last < cause.rule.enter : cause.last > cause.rule.enter) {
    why.reason = fmt::format("{}: {} {:.3g} {} {:.3g}", cause.rule.name, cause.rule.field, cause.last,
                             below ? "below" : "above", cause.rule.enter);
  } else {
    why.reason = fmt::format("{}: {} {:.3g} not {} {:.3g}", cause.rule.name, cause.rule.field, cause.last,
                             below ? "above" : "below", cause.rule.leave);
  }
  return why;
}

std::optional<ModeCauses::Change> ModeCauses::lost_node(const ModeManager& mode) {
  if (mode.mode() == MissionMode::safe || !counts(node_lost)) return std::nullopt;
  for (Critical& critical : critical_) {
    if (!critical.lost || std::exchange(critical.reported, true)) continue;
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
      const bool is_why = mode.why().cause == ModeCause::measurement && mode.why().source == cause.rule.name;
      const std::vector<std::string>& found = mode.present();
      if (is_why || std::find(found.begin(), found.end(), cause.rule.name) != found.end())
        cause.present = true;
    }
  }
  look_at_age(now);
  if (settings_.enabled() && !has_row(mode.mode())) {
    return Change{
        MissionMode::safe,
        {.cause = ModeCause::on_board,
         .reason = fmt::format("the deployment has no row for mode {}", static_cast<unsigned>(mode.mode()))}};
  }
  if (auto lost = lost_node(mode)) return lost;
  const Cause* most = demanding();
  if (most != nullptr && protection(most->mode) > protection(mode.mode()))
    return Change{most->mode, why(*most)};
  if (mode.why().cause != ModeCause::measurement) return std::nullopt;
  const auto own = std::find_if(causes_.begin(), causes_.end(),
                                [&](const Cause& c) { return c.rule.name == mode.why().source; });
  if (own == causes_.end() || !own->rule.returns) return std::nullopt;
  if (own->present && counts(own->rule.name)) return std::nullopt;
  if (most != nullptr) {
    if (most->mode == mode.mode() && most->rule.name == own->rule.name) return std::nullopt;
    return Change{most->mode, why(*most)};
  }
  if (mode.commanded() == mode.mode() || first_lost() != nullptr) return std::nullopt;
  if (!has_row(mode.commanded())) return std::nullopt;
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
    if (!critical.active && !critical.lost) sooner(critical.since + settings_.lost);
  }
  return due;
}

std::optional<std::pair<std::uint16_t, Octets>> ModeCauses::why_not(MissionMode mode) const {
  if (settings_.enabled() && !has_row(mode))
    return std::pair(mission::failure::unknown_identifier, octets_of_u16(static_cast<std::uint16_t>(mode)));
  const Cause* most = demanding();
  if (most == nullptr || protection(mode) >= protection(most->mode)) return std::nullopt;
  const auto number = static_cast<std::uint8_t>(most - causes_.data() + 1);
  return std::pair(mission::failure::mode_held, Octets{number});
}

std::vector<std::string> ModeCauses::present() const {
  std::vector<std::string> names;
  for (const Cause& cause : causes_) {
    if (cause.present) names.push_back(cause.rule.name);
  }
  return names;
}

// ---- for the ground

std::uint8_t ModeCauses::present_bits() const {
  unsigned bits = 0;
  for (std::size_t i = 0; i < causes_.size(); ++i) {
    if (causes_[i].present) bits |= 1U << std::min<std::size_t>(i, bit_of_nodes);
  }
  for (const Critical& critical : critical_) {
    if (critical.lost) bits |= 1U << bit_of_nodes;
  }
  return static_cast<std::uint8_t>(bits);
}

std::string ModeCauses::present_text() const {
  std::vector<std::string> names;
  for (const Cause& cause : causes_) {
    if (cause.present) names.push_back(cause.rule.name + (counts(cause.rule.name) ? "" : " (ignored)"));
  }
  for (const Critical& critical : critical_) {
    if (critical.lost) names.push_back(critical.node + (counts(node_lost) ? " lost" : " lost (ignored)"));
  }
  return fmt::format("{}", fmt::join(names, ", "));
}

std::string ModeCauses::way_back(const ModeManager& mode) const {
  if (mode.why().cause != ModeCause::measurement) return {};
  for (const Cause& cause : causes_) {
    if (cause.rule.name != mode.why().source || !cause.rule.returns || mode.commanded() == mode.mode())
      continue;
    const Critical* lost = first_lost();
    return fmt::format("{} when {} is {} {:.3g}{}", name_of(mode.commanded()), cause.rule.field,
                       cause.rule.below ? "above" : "below", cause.rule.leave,
                       lost == nullptr ? "" : fmt::format(" and {} is active", lost->node));
  }
  return {};
}

}  // namespace srfs
