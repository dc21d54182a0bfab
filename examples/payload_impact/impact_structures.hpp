// Generated from dictionary.yaml by msgs/generator/mission_structures.py --fragment. Do not edit.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <mission/structures.hpp>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "msgs/mission/fields.hpp"
#include "msgs/mission/node_tables.hpp"

namespace srfs::mission {

/// Application processes.
namespace apid {
inline constexpr std::uint16_t payload_impact = 19;  ///< Impacts of dust and debris
}  // namespace apid

/// Structure ids of the PUS service 3.
namespace structure {
inline constexpr std::uint16_t payload_impact = 1019;
inline constexpr std::uint16_t payload_impact_counters = 1119;
}  // namespace structure

/// Measurement block of the peripheral's wake-up answer
struct ImpactMeasurement {
  static constexpr std::string_view name = "impact_measurement";
  static constexpr std::size_t max_size = 56;

  std::uint32_t impacts{};  ///< Hits above the threshold since the counters were cleared
  std::uint32_t rejected{};  ///< Hits below it
  std::uint32_t last_impact_age_ms{};  ///< Time since the last hit [ms]
  float amplitude_v{};  ///< Signal of the last hit [V]
  float energy_uj{};  ///< Energy of the last hit [uJ]
  float threshold_v{};  ///< Signals below are not counted [V]
  std::array<std::uint32_t, 8> histogram{};  ///< Hits by energy

  void encode(OctetWriter& out) const;
  [[nodiscard]] Octets encoded() const;

  /// Reads the fields and nothing more; nullopt when the octets end early.
  [[nodiscard]] static std::optional<ImpactMeasurement> decode(OctetReader& in);
  [[nodiscard]] static std::optional<ImpactMeasurement> decode(OctetView octets);

  friend bool operator==(const ImpactMeasurement&, const ImpactMeasurement&) = default;
};

/// Impacts of dust and debris
struct PayloadImpactHousekeeping {
  static constexpr std::string_view name = "payload_impact";
  static constexpr std::uint16_t structure_id = 1019;
  static constexpr std::uint16_t apid = 19;
  static constexpr milliseconds default_interval{1000};
  static constexpr std::size_t max_size = 96;

  std::uint64_t cycle{};  ///< Cycle of the slot that measured this [ticks]
  ImpactMeasurement measurement{};
  float flux_per_hour{};  ///< Hits an hour, over the last minutes; not a number: too early to say
  SlotStatistics slots{};

  void encode(OctetWriter& out) const;
  [[nodiscard]] Octets encoded() const;

  /// Reads the fields and nothing more; nullopt when the octets end early.
  [[nodiscard]] static std::optional<PayloadImpactHousekeeping> decode(OctetReader& in);
  [[nodiscard]] static std::optional<PayloadImpactHousekeeping> decode(OctetView octets);

  friend bool operator==(const PayloadImpactHousekeeping&, const PayloadImpactHousekeeping&) = default;
};

/// Counters of the node; they come also when the peripheral is silent
struct PayloadImpactCountersHousekeeping {
  static constexpr std::string_view name = "payload_impact_counters";
  static constexpr std::uint16_t structure_id = 1119;
  static constexpr std::uint16_t apid = 19;
  static constexpr milliseconds default_interval{5000};
  static constexpr std::size_t max_size = 184;

  std::uint64_t cycle{};  ///< Mission cycle [ticks]
  PayloadCounters counters{};
  SensorInputs inputs{};

  void encode(OctetWriter& out) const;
  [[nodiscard]] Octets encoded() const;

  /// Reads the fields and nothing more; nullopt when the octets end early.
  [[nodiscard]] static std::optional<PayloadImpactCountersHousekeeping> decode(OctetReader& in);
  [[nodiscard]] static std::optional<PayloadImpactCountersHousekeeping> decode(OctetView octets);

  friend bool operator==(const PayloadImpactCountersHousekeeping&, const PayloadImpactCountersHousekeeping&) = default;
};

// Every translation unit has its own: no library of one mission may use those of another.
constexpr std::array<GuardedParameter, 0> fragment_guarded_parameters{{
}};
constexpr std::array<WorkThreadStructure, 0> fragment_work_threads{{
}};
constexpr NodeTables fragment_tables{fragment_guarded_parameters, fragment_work_threads};

/// Event ids of the PUS service 5.
namespace event {
inline constexpr std::uint16_t impact_hit = 1901;  ///< {count} hits, the last one of {energy_uj} uJ
inline constexpr std::uint16_t impact_large_hit = 1902;  ///< a hit of {energy_uj} uJ
}  // namespace event

/// Event 1901, info: {count} hits, the last one of {energy_uj} uJ
struct ImpactHitEvent {
  static constexpr std::uint16_t event_id = 1901;
  static constexpr EventSeverity severity = EventSeverity::info;
  static constexpr std::size_t max_size = 8;

  std::uint32_t count{};  ///< Since the slot before
  float energy_uj{};  ///< Energy [uJ]

  void encode(OctetWriter& out) const;
  [[nodiscard]] Octets encoded() const;

  /// Reads the fields and nothing more; nullopt when the octets end early.
  [[nodiscard]] static std::optional<ImpactHitEvent> decode(OctetReader& in);
  [[nodiscard]] static std::optional<ImpactHitEvent> decode(OctetView octets);

  friend bool operator==(const ImpactHitEvent&, const ImpactHitEvent&) = default;
};

/// Event 1902, medium: a hit of {energy_uj} uJ
struct ImpactLargeHitEvent {
  static constexpr std::uint16_t event_id = 1902;
  static constexpr EventSeverity severity = EventSeverity::medium;
  static constexpr std::size_t max_size = 4;

  float energy_uj{};  ///< Energy [uJ]

  void encode(OctetWriter& out) const;
  [[nodiscard]] Octets encoded() const;

  /// Reads the fields and nothing more; nullopt when the octets end early.
  [[nodiscard]] static std::optional<ImpactLargeHitEvent> decode(OctetReader& in);
  [[nodiscard]] static std::optional<ImpactLargeHitEvent> decode(OctetView octets);

  friend bool operator==(const ImpactLargeHitEvent&, const ImpactLargeHitEvent&) = default;
};

/// Telecommand impact.set_threshold: Signal below which hits are not counted
struct ImpactSetThreshold {
  static constexpr std::string_view name = "impact.set_threshold";
  static constexpr std::uint16_t apid = 19;
  static constexpr std::uint8_t service = 8;
  static constexpr std::uint8_t subtype = 1;
  static constexpr std::uint16_t function_id = 1;
  static constexpr std::uint8_t peripheral_function = 1;
  static constexpr RepeatClass repeat_class = RepeatClass::by_id;
  static constexpr milliseconds timeout{10000};  ///< accepted -> not started any more

  float threshold_v{};  ///< Threshold [V]

  void encode(OctetWriter& out) const;
  [[nodiscard]] Octets encoded() const;

  [[nodiscard]] static Result<ImpactSetThreshold, ArgumentError> decode(OctetView octets);
  [[nodiscard]] static Result<ImpactSetThreshold, ArgumentError> decode_one(OctetReader& in);
  friend bool operator==(const ImpactSetThreshold&, const ImpactSetThreshold&) = default;
};

/// Telecommand impact.clear: Clear counts, histogram and the last hit
struct ImpactClear {
  static constexpr std::string_view name = "impact.clear";
  static constexpr std::uint16_t apid = 19;
  static constexpr std::uint8_t service = 8;
  static constexpr std::uint8_t subtype = 1;
  static constexpr std::uint16_t function_id = 2;
  static constexpr std::uint8_t peripheral_function = 2;
  static constexpr RepeatClass repeat_class = RepeatClass::by_id;
  static constexpr milliseconds timeout{10000};  ///< accepted -> not started any more


  void encode(OctetWriter& out) const;
  [[nodiscard]] Octets encoded() const;

  [[nodiscard]] static Result<ImpactClear, ArgumentError> decode(OctetView octets);
  [[nodiscard]] static Result<ImpactClear, ArgumentError> decode_one(OctetReader& in);
  friend bool operator==(const ImpactClear&, const ImpactClear&) = default;
};

/// Telecommand impact.reset_peripheral: Reset the peripheral by a CAN request in the next slot
struct ImpactResetPeripheral {
  static constexpr std::string_view name = "impact.reset_peripheral";
  static constexpr std::uint16_t apid = 19;
  static constexpr std::uint8_t service = 8;
  static constexpr std::uint8_t subtype = 1;
  static constexpr std::uint16_t function_id = 16;
  static constexpr RepeatClass repeat_class = RepeatClass::at_most_once;
  static constexpr milliseconds timeout{15000};  ///< accepted -> not started any more


  void encode(OctetWriter& out) const;
  [[nodiscard]] Octets encoded() const;

  [[nodiscard]] static Result<ImpactResetPeripheral, ArgumentError> decode(OctetView octets);
  [[nodiscard]] static Result<ImpactResetPeripheral, ArgumentError> decode_one(OctetReader& in);
  friend bool operator==(const ImpactResetPeripheral&, const ImpactResetPeripheral&) = default;
};

/// Telecommand impact.power_cycle_peripheral: Switch the peripheral off and on with its GPIO power switch: what it counted is lost
struct ImpactPowerCyclePeripheral {
  static constexpr std::string_view name = "impact.power_cycle_peripheral";
  static constexpr std::uint16_t apid = 19;
  static constexpr std::uint8_t service = 8;
  static constexpr std::uint8_t subtype = 1;
  static constexpr std::uint16_t function_id = 17;
  static constexpr RepeatClass repeat_class = RepeatClass::at_most_once;
  static constexpr milliseconds timeout{20000};  ///< accepted -> not started any more

  std::uint16_t off_ms{};  ///< Time without power [ms]

  void encode(OctetWriter& out) const;
  [[nodiscard]] Octets encoded() const;

  [[nodiscard]] static Result<ImpactPowerCyclePeripheral, ArgumentError> decode(OctetView octets);
  [[nodiscard]] static Result<ImpactPowerCyclePeripheral, ArgumentError> decode_one(OctetReader& in);
  friend bool operator==(const ImpactPowerCyclePeripheral&, const ImpactPowerCyclePeripheral&) = default;
};

inline void ImpactMeasurement::encode(OctetWriter& out) const {
  detail::put(out, impacts);
  detail::put(out, rejected);
  detail::put(out, last_impact_age_ms);
  detail::put(out, amplitude_v);
  detail::put(out, energy_uj);
  detail::put(out, threshold_v);
  for (const auto& element : histogram) detail::put(out, element);
}
inline Octets ImpactMeasurement::encoded() const {
  OctetWriter out;
  encode(out);
  return out.take();
}

inline std::optional<ImpactMeasurement> ImpactMeasurement::decode(OctetReader& in) {
  ImpactMeasurement value;
  value.impacts = detail::take<std::uint32_t>(in);
  value.rejected = detail::take<std::uint32_t>(in);
  value.last_impact_age_ms = detail::take<std::uint32_t>(in);
  value.amplitude_v = detail::take<float>(in);
  value.energy_uj = detail::take<float>(in);
  value.threshold_v = detail::take<float>(in);
  for (auto& element : value.histogram) { element = detail::take<std::uint32_t>(in); }
  if (!in.ok()) return std::nullopt;
  return value;
}
inline std::optional<ImpactMeasurement> ImpactMeasurement::decode(OctetView octets) {
  OctetReader in(octets);
  const auto value = decode(in);
  return value && in.remaining() == 0 ? value : std::nullopt;
}


inline void PayloadImpactHousekeeping::encode(OctetWriter& out) const {
  detail::put(out, cycle);
  measurement.encode(out);
  detail::put(out, flux_per_hour);
  slots.encode(out);
}
inline Octets PayloadImpactHousekeeping::encoded() const {
  OctetWriter out;
  encode(out);
  return out.take();
}

inline std::optional<PayloadImpactHousekeeping> PayloadImpactHousekeeping::decode(OctetReader& in) {
  PayloadImpactHousekeeping value;
  value.cycle = detail::take<std::uint64_t>(in);
  { const auto part = ImpactMeasurement::decode(in); if (!part) return std::nullopt; value.measurement = *part; }
  value.flux_per_hour = detail::take<float>(in);
  { const auto part = SlotStatistics::decode(in); if (!part) return std::nullopt; value.slots = *part; }
  if (!in.ok()) return std::nullopt;
  return value;
}
inline std::optional<PayloadImpactHousekeeping> PayloadImpactHousekeeping::decode(OctetView octets) {
  OctetReader in(octets);
  const auto value = decode(in);
  return value && in.remaining() == 0 ? value : std::nullopt;
}


inline void PayloadImpactCountersHousekeeping::encode(OctetWriter& out) const {
  detail::put(out, cycle);
  counters.encode(out);
  inputs.encode(out);
}
inline Octets PayloadImpactCountersHousekeeping::encoded() const {
  OctetWriter out;
  encode(out);
  return out.take();
}

inline std::optional<PayloadImpactCountersHousekeeping> PayloadImpactCountersHousekeeping::decode(OctetReader& in) {
  PayloadImpactCountersHousekeeping value;
  value.cycle = detail::take<std::uint64_t>(in);
  { const auto part = PayloadCounters::decode(in); if (!part) return std::nullopt; value.counters = *part; }
  { const auto part = SensorInputs::decode(in); if (!part) return std::nullopt; value.inputs = *part; }
  if (!in.ok()) return std::nullopt;
  return value;
}
inline std::optional<PayloadImpactCountersHousekeeping> PayloadImpactCountersHousekeeping::decode(OctetView octets) {
  OctetReader in(octets);
  const auto value = decode(in);
  return value && in.remaining() == 0 ? value : std::nullopt;
}


inline void ImpactHitEvent::encode(OctetWriter& out) const {
  detail::put(out, count);
  detail::put(out, energy_uj);
}
inline Octets ImpactHitEvent::encoded() const {
  OctetWriter out;
  encode(out);
  return out.take();
}

inline std::optional<ImpactHitEvent> ImpactHitEvent::decode(OctetReader& in) {
  ImpactHitEvent value;
  value.count = detail::take<std::uint32_t>(in);
  value.energy_uj = detail::take<float>(in);
  if (!in.ok()) return std::nullopt;
  return value;
}
inline std::optional<ImpactHitEvent> ImpactHitEvent::decode(OctetView octets) {
  OctetReader in(octets);
  const auto value = decode(in);
  return value && in.remaining() == 0 ? value : std::nullopt;
}


inline void ImpactLargeHitEvent::encode(OctetWriter& out) const {
  detail::put(out, energy_uj);
}
inline Octets ImpactLargeHitEvent::encoded() const {
  OctetWriter out;
  encode(out);
  return out.take();
}

inline std::optional<ImpactLargeHitEvent> ImpactLargeHitEvent::decode(OctetReader& in) {
  ImpactLargeHitEvent value;
  value.energy_uj = detail::take<float>(in);
  if (!in.ok()) return std::nullopt;
  return value;
}
inline std::optional<ImpactLargeHitEvent> ImpactLargeHitEvent::decode(OctetView octets) {
  OctetReader in(octets);
  const auto value = decode(in);
  return value && in.remaining() == 0 ? value : std::nullopt;
}


inline void ImpactSetThreshold::encode(OctetWriter& out) const {
  detail::put(out, threshold_v);
}
inline Octets ImpactSetThreshold::encoded() const {
  OctetWriter out;
  encode(out);
  return out.take();
}

inline Result<ImpactSetThreshold, ArgumentError> ImpactSetThreshold::decode_one(OctetReader& in) {
  ImpactSetThreshold value;
  value.threshold_v = detail::take<float>(in);
  if (!in.ok()) return Err(ArgumentError{0});
  if (!(value.threshold_v >= 0.01F && value.threshold_v <= 5.0F)) return Err(ArgumentError{1});
  return value;
}
inline Result<ImpactSetThreshold, ArgumentError> ImpactSetThreshold::decode(OctetView octets) {
  OctetReader in(octets);
  auto value = decode_one(in);
  if (value && in.remaining() != 0) return Err(ArgumentError{0});
  return value;
}

inline void ImpactClear::encode(OctetWriter&) const {
}
inline Octets ImpactClear::encoded() const {
  OctetWriter out;
  encode(out);
  return out.take();
}

inline Result<ImpactClear, ArgumentError> ImpactClear::decode_one(OctetReader&) {
  ImpactClear value;
  return value;
}
inline Result<ImpactClear, ArgumentError> ImpactClear::decode(OctetView octets) {
  OctetReader in(octets);
  auto value = decode_one(in);
  if (value && in.remaining() != 0) return Err(ArgumentError{0});
  return value;
}

inline void ImpactResetPeripheral::encode(OctetWriter&) const {
}
inline Octets ImpactResetPeripheral::encoded() const {
  OctetWriter out;
  encode(out);
  return out.take();
}

inline Result<ImpactResetPeripheral, ArgumentError> ImpactResetPeripheral::decode_one(OctetReader&) {
  ImpactResetPeripheral value;
  return value;
}
inline Result<ImpactResetPeripheral, ArgumentError> ImpactResetPeripheral::decode(OctetView octets) {
  OctetReader in(octets);
  auto value = decode_one(in);
  if (value && in.remaining() != 0) return Err(ArgumentError{0});
  return value;
}

inline void ImpactPowerCyclePeripheral::encode(OctetWriter& out) const {
  detail::put(out, off_ms);
}
inline Octets ImpactPowerCyclePeripheral::encoded() const {
  OctetWriter out;
  encode(out);
  return out.take();
}

inline Result<ImpactPowerCyclePeripheral, ArgumentError> ImpactPowerCyclePeripheral::decode_one(OctetReader& in) {
  ImpactPowerCyclePeripheral value;
  value.off_ms = detail::take<std::uint16_t>(in);
  if (!in.ok()) return Err(ArgumentError{0});
  if (!(value.off_ms >= 50 && value.off_ms <= 5000)) return Err(ArgumentError{1});
  return value;
}
inline Result<ImpactPowerCyclePeripheral, ArgumentError> ImpactPowerCyclePeripheral::decode(OctetView octets) {
  OctetReader in(octets);
  auto value = decode_one(in);
  if (value && in.remaining() != 0) return Err(ArgumentError{0});
  return value;
}


}  // namespace srfs::mission