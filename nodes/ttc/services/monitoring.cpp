// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/monitoring.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>
#include <string_view>

namespace srfs {
namespace {

constexpr std::uint8_t limit_repetition = 2;
constexpr std::uint8_t stale_repetition = 10;
constexpr seconds periodic_interval{1};  ///< what may come more often comes when there is something to say

bool is_number(const mission::Field& field) {
  return field.type != mission::FieldType::text && field.type != mission::FieldType::time &&
         field.type != mission::FieldType::packet;
}

bool has_low(MonitorCheck check) {
  return check == MonitorCheck::limits || check == MonitorCheck::at_least || check == MonitorCheck::delta;
}
bool has_high(MonitorCheck check) {
  return check == MonitorCheck::limits || check == MonitorCheck::at_most || check == MonitorCheck::delta;
}

template <std::size_t fields>
using EventForm = std::array<std::pair<std::string_view, mission::FieldType>, fields>;

template <std::size_t fields>
bool has_form(const mission::Event& event, const EventForm<fields>& form) {
  return std::equal(event.fields.begin(), event.fields.end(), form.begin(), form.end(),
                    [](const mission::Field& field, const auto& expected) {
                      return field.name == expected.first && field.type == expected.second;
                    });
}

/// Of an event that a monitor raises: definition, parameter, value, limit.
bool is_monitor_event(const mission::Event& event) {
  using mission::FieldType;
  constexpr EventForm<4> form{{{"definition", FieldType::u16},
                               {"parameter", FieldType::u32},
                               {"value", FieldType::f64},
                               {"limit", FieldType::f64}}};
  return has_form(event, form);
}

/// Of an event that a functional monitor raises: its id, how many monitors fail, how many it has.
bool is_functional_event(const mission::Event& event) {
  using mission::FieldType;
  constexpr EventForm<3> form{
      {{"functional", FieldType::u16}, {"failing", FieldType::u8}, {"monitors", FieldType::u8}}};
  return has_form(event, form);
}

constexpr std::uint32_t all_bits = UINT32_MAX;

bool has_bits(const mission::Field& field) {
  return is_number(field) && field.type != mission::FieldType::f32 && field.type != mission::FieldType::f64 &&
         field.calibration.empty();
}

bool fits(const mission::Field& field, std::uint32_t mask) {
  return mask == all_bits ? is_number(field) : has_bits(field);
}

/// @param parameter  0: there is no condition
bool is_condition(const mission::Dictionary& dictionary, std::uint32_t parameter, std::uint32_t mask) {
  const auto element = dictionary.telemetry(parameter);
  return parameter == 0 || (element && fits(*element->field, mask));
}

/// A mask selects bits of an integer. Without one an f32 is the nearest to @p wanted.
bool is_value(double value, bool single, std::uint32_t mask, double wanted) {
  constexpr double largest{std::numeric_limits<float>::max()};
  if (single && std::abs(wanted) <= largest) return value == static_cast<double>(static_cast<float>(wanted));
  if (mask == all_bits) return value == wanted;
  const bool has_all_bits = value >= 0 && value < 9e15;  // exact as a double
  return has_all_bits && static_cast<double>(static_cast<std::uint64_t>(value) & mask) == wanted;
}

bool contradicts_itself(const mission::MonitorAdd& d) {
  if (d.mask != all_bits && d.check != MonitorCheck::expected) return true;
  const bool two_sided = has_low(d.check) && has_high(d.check);
  if (!has_low(d.check) && !has_high(d.check)) return d.hysteresis != 0;
  return two_sided && d.low + d.hysteresis > d.high - d.hysteresis;
}

/// What the beacon repeats is monitored at its source.
bool is_repeated_by_beacon(const mission::Dictionary& dictionary, const mission::Structure& structure,
                           const mission::Field& field) {
  const auto& sources = dictionary.beacon_sources();
  return structure.id == mission::Beacon::structure_id &&
         std::any_of(sources.begin(), sources.end(),
                     [&](const mission::BeaconSource& source) { return source.value == field.name; });
}

/// Housekeeping structures of the mission's nodes, in the order of their ids.
std::vector<const mission::Structure*> monitored_structures(const mission::Dictionary& dictionary) {
  std::vector<const mission::Structure*> structures;
  for (const mission::Structure& structure : dictionary.structures()) {
    const mission::ApplicationProcess* process = dictionary.apid_of_node(structure.node);
    if (structure.id != 0 && process != nullptr && !process->added) structures.push_back(&structure);
  }
  std::sort(structures.begin(), structures.end(), [](const auto* a, const auto* b) { return a->id < b->id; });
  return structures;
}

std::uint32_t number_of(const mission::Structure& structure, std::size_t element) {
  return (static_cast<std::uint32_t>(structure.id) << 16U) | static_cast<std::uint32_t>(element);
}

mission::MonitorAdd definition_of(const mission::Bounds& bounds, std::uint32_t parameter,
                                  std::uint16_t event) {
  mission::MonitorAdd what;
  what.parameter = parameter;
  what.condition_mask = what.mask = all_bits;
  what.repetition = limit_repetition;
  what.check = !bounds.high  ? MonitorCheck::at_least
               : !bounds.low ? MonitorCheck::at_most
                             : MonitorCheck::limits;
  what.low = bounds.low.value_or(0);
  what.low_event = bounds.low ? event : std::uint16_t{0};
  what.high = bounds.high.value_or(0);
  what.high_event = bounds.high ? event : std::uint16_t{0};
  return what;
}

/// Ids count up also where an entry of the mission's file takes the place: they are those of the reference
/// page.
class LimitDefinitions {
 public:
  explicit LimitDefinitions(MonitorTable& table) : table_(table) {}

  void add(const std::optional<mission::Bounds>& bounds, std::uint32_t parameter, std::uint16_t event) {
    if (!bounds || (!bounds->low && !bounds->high)) return;
    mission::MonitorAdd what = definition_of(*bounds, parameter, event);
    what.id = next_id_++;
    const bool listed = std::any_of(table_.begin(), table_.end(), [&](const auto& entry) {
      const mission::MonitorAdd& other = entry.second.what;
      return other.parameter == parameter && other.check == what.check && other.low == what.low &&
             other.high == what.high;
    });
    if (!listed) table_[what.id] = {.what = what, .enabled = true};
  }

 private:
  MonitorTable& table_;
  std::uint16_t next_id_ = first_limit_id;
};

void add_listed(const mission::Dictionary& dictionary, MonitorTable& table) {
  for (const auto& arguments : dictionary.monitors()) {
    const auto encoded = dictionary.encode(mission::MonitorAdd::name, arguments);
    const auto listed = encoded ? mission::MonitorAdd::decode(encoded->data) : Err(mission::ArgumentError{});
    if (!listed) continue;  // the dictionary has checked them
    for (const mission::MonitorAdd& what : *listed) table[what.id] = {.what = what, .enabled = true};
  }
}

}  // namespace

// ---- definitions

MonitorTable factory_monitors(const mission::Dictionary& dictionary) {
  MonitorTable table;
  add_listed(dictionary, table);
  LimitDefinitions limits(table);
  for (const mission::Structure* structure : monitored_structures(dictionary)) {
    std::size_t element = 0;
    for (const mission::Field& field : structure->fields) {
      const bool repeated = is_repeated_by_beacon(dictionary, *structure, field);
      for (std::size_t i = 0; i < field.count; ++i, ++element) {
        if (repeated) continue;
        const std::uint32_t parameter = number_of(*structure, element);
        limits.add(field.soft, parameter, mission::event::monitor_soft_limit);
        limits.add(field.hard, parameter, mission::event::monitor_hard_limit);
      }
    }
    if (structure->apid == mission::apid::ttc || structure->interval < periodic_interval) continue;
    if (structure->id > UINT16_MAX - first_stale_id) continue;  // its monitor would have no number
    mission::MonitorAdd stale;
    stale.id = static_cast<std::uint16_t>(first_stale_id + structure->id);
    stale.parameter = number_of(*structure, 0);
    stale.condition_mask = stale.mask = all_bits;
    stale.repetition = stale_repetition;
    stale.check = MonitorCheck::stale;
    stale.low_event = mission::event::monitor_stale;
    table[stale.id] = {.what = stale, .enabled = true};
  }
  return table;
}

std::optional<MonitorRefusal> why_not_taken(const mission::MonitorAdd& d,
                                            const mission::Dictionary& dictionary) {
  const auto parameter = dictionary.telemetry(d.parameter);
  const bool stale = d.check == MonitorCheck::stale;
  const bool parameter_fits = parameter && (stale || fits(*parameter->field, d.mask));
  const bool condition_fits =
      stale ? d.condition == 0 : is_condition(dictionary, d.condition, d.condition_mask);
  if (!parameter_fits || !condition_fits) return MonitorRefusal{mission::failure::not_monitorable, d.id};
  if (contradicts_itself(d)) return MonitorRefusal{mission::failure::contradictory_limits, d.id};
  for (const std::uint16_t id : {d.low_event, d.high_event}) {
    const mission::Event* event = dictionary.event(id);
    if (id != 0 && (event == nullptr || !is_monitor_event(*event)))
      return MonitorRefusal{mission::failure::no_monitor_event, id};
  }
  return std::nullopt;
}

std::optional<MonitorRefusal> why_not_taken(std::uint16_t id, const FunctionalDefinition& d,
                                            const MonitorTable& monitors,
                                            const mission::Dictionary& dictionary) {
  if (!is_condition(dictionary, d.condition, d.condition_mask))
    return MonitorRefusal{mission::failure::not_monitorable, id};
  const auto unknown = std::find_if(d.monitors.begin(), d.monitors.end(),
                                    [&](std::uint16_t monitor) { return !monitors.contains(monitor); });
  if (unknown != d.monitors.end()) return MonitorRefusal{mission::failure::unknown_identifier, *unknown};
  const std::set<std::uint16_t> different(d.monitors.begin(), d.monitors.end());
  if (different.size() != d.monitors.size() || d.minimum_failing > different.size())
    return MonitorRefusal{mission::failure::contradictory_limits, id};
  const mission::Event* event = dictionary.event(d.event);
  if (d.event != 0 && (event == nullptr || !is_functional_event(*event)))
    return MonitorRefusal{mission::failure::no_monitor_event, d.event};
  return std::nullopt;
}

// ---- table

void Monitoring::set_table(MonitorTable table) {
  table_ = std::move(table);
  std::erase_if(checks_, [this](const auto& entry) { return !table_.contains(entry.first); });
  for (const auto& [id, definition] : table_) {
    Check& check = checks_[id];
    const bool same = check.what == definition.what && check.enabled == definition.enabled;
    if (!same) check = Check{.what = definition.what, .enabled = definition.enabled};
  }
  resolve();
}

void Monitoring::set_functional_table(FunctionalTable table) {
  functional_table_ = std::move(table);
  std::erase_if(functional_, [this](const auto& entry) { return !functional_table_.contains(entry.first); });
  for (const auto& [id, definition] : functional_table_) {
    Functional& functional = functional_[id];
    const bool begins = functional.what.enabled != definition.enabled;
    functional.what = definition;
    if (begins) functional.state = FunctionalState::unchecked;
  }
  resolve();
}

void Monitoring::set_functional_enabled(bool enabled) {
  if (std::exchange(functional_enabled_, enabled) == enabled) return;
  for (auto& [id, functional] : functional_) functional.state = FunctionalState::unchecked;
}

void Monitoring::set_enabled(bool enabled) {
  if (enabled_ == enabled) return;
  enabled_ = enabled;
  for (auto& [id, check] : checks_) forget(check);
  for (auto& [id, functional] : functional_) functional.state = FunctionalState::unchecked;
  for (auto& [id, watched] : watched_) watched.last_sample.reset();
  count_out_of_limits();
}

void Monitoring::forget(Check& check) {
  check =
      Check{.what = check.what, .enabled = check.enabled, .slot = check.slot, .condition = check.condition};
}

void Monitoring::resolve() {
  std::map<std::uint16_t, Watched> before = std::exchange(watched_, {});
  const auto slots_before = std::exchange(slots_, {});
  const auto values_before = std::exchange(values_, {});
  unresolved_ = 0;
  resolve_checks();
  resolve_functional();
  for (auto& [id, watched] : watched_) {
    watched.interval = dictionary_.structure(id)->interval;
    if (const auto known = before.find(id); known != before.end())
      watched.last_sample = known->second.last_sample;
  }
  for (const auto& [parameter, slot] : slots_) {
    const auto known = slots_before.find(parameter);
    if (known != slots_before.end()) values_[slot].value = values_before[known->second].value;
  }
  count_out_of_limits();
}

void Monitoring::resolve_checks() {
  for (auto& [id, check] : checks_) {
    const auto element = dictionary_.telemetry(check.what.parameter);
    check.slot = slot_of(check.what.parameter);
    check.condition = {check.what.condition, check.what.condition_mask, check.what.condition_value};
    if (!resolve(check.condition) || !element || check.slot == no_slot) {
      forget(check);
      ++unresolved_;
      continue;
    }
    Watched& watched = watched_[element->structure->id];
    (check.what.check == MonitorCheck::stale ? watched.stale_checks : watched.checks).push_back(&check);
  }
}

void Monitoring::resolve_functional() {
  for (auto& [id, functional] : functional_) {
    const FunctionalDefinition& what = functional.what;
    functional.condition = {what.condition, what.condition_mask, what.condition_value};
    functional.monitors.clear();
    for (const std::uint16_t monitor : what.monitors) {
      const auto found = checks_.find(monitor);
      if (found != checks_.end()) functional.monitors.push_back(&found->second);
    }
    if (resolve(functional.condition) && functional.monitors.size() == what.monitors.size()) continue;
    functional.monitors.clear();
    functional.state = FunctionalState::unchecked;
    ++unresolved_;
  }
}

bool Monitoring::resolve(Condition& condition) {
  condition.slot = condition.parameter == 0 ? no_slot : slot_of(condition.parameter);
  return condition.parameter == 0 || condition.slot != no_slot;
}

std::size_t Monitoring::slot_of(std::uint32_t parameter) {
  if (const auto known = slots_.find(parameter); known != slots_.end()) return known->second;
  const auto element = dictionary_.telemetry(parameter);
  if (!element || element->structure->kind != mission::StructureKind::housekeeping) return no_slot;
  const std::size_t slot = values_.size();
  const mission::Field& field = *element->field;
  values_.push_back(
      {.value = {}, .single = field.type == mission::FieldType::f32 && field.calibration.empty()});
  slots_[parameter] = slot;
  add_place(watched_[element->structure->id], *element, slot);
  return slot;
}

void Monitoring::add_place(Watched& watched, const mission::TelemetryElement& element,
                           std::size_t slot) const {
  Place place{.slot = slot, .offset = 0, .texts_before = 0, .form = {}};
  place.form.type = element.field->type;
  place.form.max_text = element.field->max_text;
  place.form.calibration = element.field->calibration;
  place.form.unknown = element.field->unknown;
  watched.texts.clear();
  std::size_t offset = 0;
  for (const mission::Field& field : element.structure->fields) {
    const bool is_text = field.type == mission::FieldType::text;
    const std::size_t octets = is_text ? 1 : field.max_size() / field.count;
    if (&field == element.field) {
      place.offset = offset + octets * element.index;
      place.texts_before = watched.texts.size() + (is_text ? element.index : 0);
    }
    for (std::size_t i = 0; i < field.count; ++i, offset += octets) {
      if (is_text) watched.texts.push_back(offset);
    }
  }
  watched.places.push_back(std::move(place));
}

// ---- checks

void Monitoring::read(const Watched& watched, OctetView data) {
  std::vector<std::size_t> characters{0};  // of the texts before the first, the second, ...
  for (const std::size_t offset : watched.texts) {
    const std::size_t at = offset + characters.back();
    characters.push_back(characters.back() + (at < data.size() ? data[at] : 0));
  }
  for (const Place& place : watched.places) {
    const std::size_t at = place.offset + characters[place.texts_before];
    OctetReader in(data.subspan(std::min(at, data.size())));
    values_[place.slot].value = mission::Dictionary::take_number(place.form, in);
  }
}

void Monitoring::on_sample(std::uint16_t structure_id, OctetView data, TaiTime tai, MonotonicTime now) {
  const auto found = watched_.find(structure_id);
  if (found == watched_.end() || !enabled_) return;
  Watched& watched = found->second;
  watched.last_sample = now;
  read(watched, data);
  for (Check* stale : watched.stale_checks) {
    if (stale->enabled) set_state(*stale, MonitorState::within, 0, 0, tai);
  }
  for (Check* each : watched.checks) {
    if (each->enabled && now >= each->next) check(*each, tai, now);
  }
  check_functional(now);
}

namespace {

struct Finding {
  MonitorState state = MonitorState::within;
  double limit = 0;
};

/// @param current  being out of limits, hysteresis holds it there
/// @param single  the parameter is an f32 as it is
Finding judge(const mission::MonitorAdd& d, MonitorState current, double value, bool single) {
  if (d.check == MonitorCheck::expected) {
    return {is_value(value, single, d.mask, d.low) ? MonitorState::within : MonitorState::unexpected, d.low};
  }
  const double low = d.low + (current == MonitorState::below ? d.hysteresis : 0);
  const double high = d.high - (current == MonitorState::above ? d.hysteresis : 0);
  if (has_low(d.check) && value < low) return {MonitorState::below, d.low};
  if (has_high(d.check) && value > high) return {MonitorState::above, d.high};
  return {MonitorState::within, current == MonitorState::above ? d.high : d.low};
}

}  // namespace

/// The value must have come, and lately when its structure is periodic.
bool Monitoring::holds(const Condition& condition, MonotonicTime now) const {
  if (condition.slot == no_slot) return true;
  const Slot& slot = values_[condition.slot];
  const Watched& source = watched_.at(static_cast<std::uint16_t>(condition.parameter >> 16U));
  const bool periodic = source.interval >= periodic_interval;
  const bool fresh = source.last_sample &&
                     (!periodic || now - *source.last_sample <= source.interval * int{stale_repetition});
  return fresh && slot.value && is_value(*slot.value, slot.single, condition.mask, condition.value);
}

void Monitoring::check(Check& check, TaiTime tai, MonotonicTime now) {
  check.next = now + milliseconds(check.what.interval_ms);
  ++counters_.checks;
  const std::optional<double>& value = values_[check.slot].value;
  const auto invalid = [&] {
    check.before.reset();
    check.in_row = 0;
    set_state(check, MonitorState::invalid, value.value_or(0), 0, tai);
  };
  if (!value || !holds(check.condition, now)) return invalid();
  double checked = *value;
  if (check.what.check == MonitorCheck::delta) {
    const auto before = std::exchange(check.before, *value);
    if (!before) return;
    checked = *value - *before;
    if (std::isnan(checked)) return invalid();  // of two infinite values
  }
  const Finding finding = judge(check.what, check.state, checked, values_[check.slot].single);
  if (finding.state != check.candidate) check.in_row = 0;
  check.candidate = finding.state;
  if (check.in_row < UINT8_MAX) ++check.in_row;
  if (check.in_row >= check.what.repetition) set_state(check, finding.state, checked, finding.limit, tai);
}

void Monitoring::set_state(Check& check, MonitorState state, double value, double limit, TaiTime tai) {
  const MonitorState previous = std::exchange(check.state, state);
  if (previous == state) return;
  const bool out = is_out_of_limits(state);
  check.last = {.definition = check.what.id,
                .parameter = check.what.parameter,
                .check = check.what.check,
                .value = value,
                .limit = limit,
                .previous = previous,
                .state = state,
                .since = tai,
                .event = !out                           ? std::uint16_t{0}
                         : state == MonitorState::above ? check.what.high_event
                                                        : check.what.low_event};
  if (out && !is_out_of_limits(previous)) ++out_of_limits_;
  if (!out && is_out_of_limits(previous)) --out_of_limits_;
  if (!out && !is_out_of_limits(previous)) return;
  ++counters_.transitions;
  transitions_.push_back(check.last);
}

void Monitoring::on_time(TaiTime tai, MonotonicTime now) {
  const auto last = last_time_;
  if (last && now - *last < stale_check_period) return;
  last_time_ = now;
  if (!enabled_ || !last) return;
  const nanoseconds deaf = now - *last > nanoseconds(longest_gap) ? now - *last : nanoseconds(0);
  for (auto& [id, watched] : watched_) {
    if (!watched.last_sample) continue;
    *watched.last_sample = std::min(*watched.last_sample + deaf, now);
    const nanoseconds silent = now - *watched.last_sample;
    for (Check* stale : watched.stale_checks) {
      const milliseconds interval =
          stale->what.interval_ms == 0 ? watched.interval : milliseconds(stale->what.interval_ms);
      if (!stale->enabled || silent <= interval * stale->what.repetition) continue;
      const auto in_seconds = [](nanoseconds d) { return static_cast<double>(d.count()) * 1e-9; };
      set_state(*stale, MonitorState::stale, in_seconds(silent), in_seconds(interval), tai);
    }
  }
  check_functional(now);
}

void Monitoring::check_functional(MonotonicTime now) {
  if (!functional_enabled_) return;
  for (auto& [id, functional] : functional_) {
    if (!functional.what.enabled || functional.monitors.empty()) continue;
    const auto failing = static_cast<std::uint8_t>(
        std::count_if(functional.monitors.begin(), functional.monitors.end(),
                      [](const Check* check) { return is_out_of_limits(check->state); }));
    const FunctionalState before = std::exchange(functional.state, state_of(functional, failing, now));
    if (functional.state != FunctionalState::failed || before == FunctionalState::failed) continue;
    functional_failures_.push_back({.definition = id,
                                    .event = functional.what.event,
                                    .failing = failing,
                                    .monitors = static_cast<std::uint8_t>(functional.monitors.size())});
  }
}

/// One whose monitors are all unchecked or invalid is so too; such a monitor never counts as failing.
FunctionalState Monitoring::state_of(const Functional& functional, std::uint8_t failing,
                                     MonotonicTime now) const {
  if (!holds(functional.condition, now)) return FunctionalState::invalid;
  if (failing >= functional.what.minimum_failing) return FunctionalState::failed;
  const auto any = [&](auto is) {
    return std::any_of(functional.monitors.begin(), functional.monitors.end(),
                       [is](const Check* check) { return is(check->state); });
  };
  if (any([](MonitorState state) { return state >= MonitorState::within; })) return FunctionalState::running;
  return any([](MonitorState state) { return state == MonitorState::invalid; }) ? FunctionalState::invalid
                                                                                : FunctionalState::unchecked;
}

// ---- what others want to know

MonitorState Monitoring::state(std::uint16_t definition) const {
  const auto found = checks_.find(definition);
  return found == checks_.end() ? MonitorState::unchecked : found->second.state;
}

FunctionalState Monitoring::functional_state(std::uint16_t definition) const {
  const auto found = functional_.find(definition);
  return found == functional_.end() ? FunctionalState::unchecked : found->second.state;
}

std::size_t Monitoring::functional_failed() const {
  return static_cast<std::size_t>(
      std::count_if(functional_.begin(), functional_.end(),
                    [](const auto& entry) { return entry.second.state == FunctionalState::failed; }));
}

std::vector<Monitoring::Transition> Monitoring::out_of_limits() const {
  std::vector<Transition> all;
  for (const auto& [id, check] : checks_) {
    if (is_out_of_limits(check.state)) all.push_back(check.last);
  }
  return all;
}

std::optional<Monitoring::Transition> Monitoring::out_of_limits(std::uint16_t definition) const {
  const auto found = checks_.find(definition);
  if (found == checks_.end() || !is_out_of_limits(found->second.state)) return std::nullopt;
  return found->second.last;
}

void Monitoring::count_out_of_limits() {
  out_of_limits_ =
      static_cast<std::size_t>(std::count_if(checks_.begin(), checks_.end(), [](const auto& entry) {
        return is_out_of_limits(entry.second.state);
      }));
}

}  // namespace srfs
