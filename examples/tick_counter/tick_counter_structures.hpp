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
inline constexpr std::uint16_t tick_counter = 64;  ///< Counts ticks
}  // namespace apid

/// Structure ids of the PUS service 3.
namespace structure {
inline constexpr std::uint16_t tick_counter = 1064;
}  // namespace structure

/// Counters
struct TickCounterHousekeeping {
  static constexpr std::string_view name = "tick_counter";
  static constexpr std::uint16_t structure_id = 1064;
  static constexpr std::uint16_t apid = 64;
  static constexpr milliseconds default_interval{1000};
  static constexpr std::size_t max_size = 16;

  std::uint64_t cycle{};  ///< Mission cycle [ticks]
  std::uint32_t ticks{};  ///< Ticks since the start or the last clear [ticks]
  std::uint32_t clears{};  ///< Executed telecommands clear

  void encode(OctetWriter& out) const;
  [[nodiscard]] Octets encoded() const;

  /// Reads the fields and nothing more; nullopt when the octets end early.
  [[nodiscard]] static std::optional<TickCounterHousekeeping> decode(OctetReader& in);
  [[nodiscard]] static std::optional<TickCounterHousekeeping> decode(OctetView octets);

  friend bool operator==(const TickCounterHousekeeping&, const TickCounterHousekeeping&) = default;
};

// Every translation unit has its own: no library of one mission may use those of another.
constexpr std::array<GuardedParameter, 0> fragment_guarded_parameters{{
}};
constexpr std::array<WorkThreadStructure, 0> fragment_work_threads{{
}};
constexpr NodeTables fragment_tables{fragment_guarded_parameters, fragment_work_threads};

/// Event ids of the PUS service 5.
namespace event {
inline constexpr std::uint16_t tick_counter_counted = 6401;  ///< {ticks} ticks counted
}  // namespace event

/// Event 6401, info: {ticks} ticks counted
struct TickCounterCountedEvent {
  static constexpr std::uint16_t event_id = 6401;
  static constexpr EventSeverity severity = EventSeverity::info;
  static constexpr std::size_t max_size = 4;

  std::uint32_t ticks{};  ///< Since the start or the last clear [ticks]

  void encode(OctetWriter& out) const;
  [[nodiscard]] Octets encoded() const;

  /// Reads the fields and nothing more; nullopt when the octets end early.
  [[nodiscard]] static std::optional<TickCounterCountedEvent> decode(OctetReader& in);
  [[nodiscard]] static std::optional<TickCounterCountedEvent> decode(OctetView octets);

  friend bool operator==(const TickCounterCountedEvent&, const TickCounterCountedEvent&) = default;
};

/// Telecommand tick_counter.clear: Count from 0 again
struct TickCounterClear {
  static constexpr std::string_view name = "tick_counter.clear";
  static constexpr std::uint16_t apid = 64;
  static constexpr std::uint8_t service = 8;
  static constexpr std::uint8_t subtype = 1;
  static constexpr std::uint16_t function_id = 1;
  static constexpr RepeatClass repeat_class = RepeatClass::idempotent;
  static constexpr milliseconds timeout{10000};  ///< accepted -> not started any more


  void encode(OctetWriter& out) const;
  [[nodiscard]] Octets encoded() const;

  [[nodiscard]] static Result<TickCounterClear, ArgumentError> decode(OctetView octets);
  [[nodiscard]] static Result<TickCounterClear, ArgumentError> decode_one(OctetReader& in);
  friend bool operator==(const TickCounterClear&, const TickCounterClear&) = default;
};

/// Telecommand tick_counter.set_start: Keep a value
struct TickCounterSetStart {
  static constexpr std::string_view name = "tick_counter.set_start";
  static constexpr std::uint16_t apid = 64;
  static constexpr std::uint8_t service = 8;
  static constexpr std::uint8_t subtype = 1;
  static constexpr std::uint16_t function_id = 2;
  static constexpr RepeatClass repeat_class = RepeatClass::idempotent;
  static constexpr milliseconds timeout{10000};  ///< accepted -> not started any more

  std::uint32_t value{};  ///< What is kept

  void encode(OctetWriter& out) const;
  [[nodiscard]] Octets encoded() const;

  [[nodiscard]] static Result<TickCounterSetStart, ArgumentError> decode(OctetView octets);
  [[nodiscard]] static Result<TickCounterSetStart, ArgumentError> decode_one(OctetReader& in);
  friend bool operator==(const TickCounterSetStart&, const TickCounterSetStart&) = default;
};

inline void TickCounterHousekeeping::encode(OctetWriter& out) const {
  detail::put(out, cycle);
  detail::put(out, ticks);
  detail::put(out, clears);
}
inline Octets TickCounterHousekeeping::encoded() const {
  OctetWriter out;
  encode(out);
  return out.take();
}

inline std::optional<TickCounterHousekeeping> TickCounterHousekeeping::decode(OctetReader& in) {
  TickCounterHousekeeping value;
  value.cycle = detail::take<std::uint64_t>(in);
  value.ticks = detail::take<std::uint32_t>(in);
  value.clears = detail::take<std::uint32_t>(in);
  if (!in.ok()) return std::nullopt;
  return value;
}
inline std::optional<TickCounterHousekeeping> TickCounterHousekeeping::decode(OctetView octets) {
  OctetReader in(octets);
  const auto value = decode(in);
  return value && in.remaining() == 0 ? value : std::nullopt;
}


inline void TickCounterCountedEvent::encode(OctetWriter& out) const {
  detail::put(out, ticks);
}
inline Octets TickCounterCountedEvent::encoded() const {
  OctetWriter out;
  encode(out);
  return out.take();
}

inline std::optional<TickCounterCountedEvent> TickCounterCountedEvent::decode(OctetReader& in) {
  TickCounterCountedEvent value;
  value.ticks = detail::take<std::uint32_t>(in);
  if (!in.ok()) return std::nullopt;
  return value;
}
inline std::optional<TickCounterCountedEvent> TickCounterCountedEvent::decode(OctetView octets) {
  OctetReader in(octets);
  const auto value = decode(in);
  return value && in.remaining() == 0 ? value : std::nullopt;
}


inline void TickCounterClear::encode(OctetWriter&) const {
}
inline Octets TickCounterClear::encoded() const {
  OctetWriter out;
  encode(out);
  return out.take();
}

inline Result<TickCounterClear, ArgumentError> TickCounterClear::decode_one(OctetReader&) {
  TickCounterClear value;
  return value;
}
inline Result<TickCounterClear, ArgumentError> TickCounterClear::decode(OctetView octets) {
  OctetReader in(octets);
  auto value = decode_one(in);
  if (value && in.remaining() != 0) return Err(ArgumentError{0});
  return value;
}

inline void TickCounterSetStart::encode(OctetWriter& out) const {
  detail::put(out, value);
}
inline Octets TickCounterSetStart::encoded() const {
  OctetWriter out;
  encode(out);
  return out.take();
}

inline Result<TickCounterSetStart, ArgumentError> TickCounterSetStart::decode_one(OctetReader& in) {
  TickCounterSetStart value;
  value.value = detail::take<std::uint32_t>(in);
  if (!in.ok()) return Err(ArgumentError{0});
  if (!(value.value >= 1 && value.value <= 1000000)) return Err(ArgumentError{1});
  return value;
}
inline Result<TickCounterSetStart, ArgumentError> TickCounterSetStart::decode(OctetView octets) {
  OctetReader in(octets);
  auto value = decode_one(in);
  if (value && in.remaining() != 0) return Err(ArgumentError{0});
  return value;
}


}  // namespace srfs::mission