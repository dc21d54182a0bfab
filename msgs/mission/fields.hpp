// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "wire/cuc.hpp"
#include "wire/space_packet.hpp"

namespace srfs::mission {

/// What holds where a crash falls between an act and its record; values as in srfs_msgs/Telecommand.
enum class RepeatClass : std::uint8_t {
  idempotent = 1,    ///< doing it twice is doing it once
  by_id = 2,         ///< the peripheral drops repeats of the same telecommand id
  at_most_once = 3,  ///< never repeated: after a crash it is reported as interrupted
};

/// Severity of an event; values as in srfs_msgs/Event and as the subtype of the PUS report.
enum class EventSeverity : std::uint8_t { info = 1, low = 2, medium = 3, high = 4 };

/// Encoded arguments that are not what the dictionary says.
struct ArgumentError {
  std::uint8_t parameter = 0;  ///< number of the offending argument, from 1; 0: the length is wrong
  friend bool operator==(const ArgumentError&, const ArgumentError&) = default;
};

/// Bounds of what a mission has.
inline constexpr std::size_t most_payloads = 16;  ///< bound of srfs_msgs/TaskFlags.flags
inline constexpr std::size_t most_nodes = 32;

/// The elements of a field per payload or per node. Their number is the mission's: who fills the field sets
/// it.
template <class T, std::size_t most>
class List {
 public:
  explicit List(std::size_t size) { resize(size); }
  /// At most @p most.
  void resize(std::size_t size) { size_ = std::min(size, most); }
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] T& operator[](std::size_t i) { return elements_.at(i); }
  [[nodiscard]] const T& operator[](std::size_t i) const { return elements_.at(i); }
  [[nodiscard]] auto begin() { return elements_.begin(); }
  [[nodiscard]] auto end() { return elements_.begin() + static_cast<std::ptrdiff_t>(size_); }
  [[nodiscard]] auto begin() const { return elements_.begin(); }
  [[nodiscard]] auto end() const { return elements_.begin() + static_cast<std::ptrdiff_t>(size_); }
  friend bool operator==(const List& a, const List& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end());
  }

 private:
  std::array<T, most> elements_{};
  std::size_t size_ = 0;
};

/// How one field stands on the link: big-endian; bool as u8 0/1; text as u8 length and octets; time as the
/// link's CUC with its P-field, 8 octets.
namespace detail {

/// The argument just read is bad: it ended early (0) or its content is (@p number).
[[nodiscard]] inline ArgumentError argument_error(const OctetReader& in, std::uint8_t number) {
  return {in.ok() ? number : std::uint8_t{0}};
}

inline void put_time(OctetWriter& out, TaiTime time) {
  out.bytes(wire::encode_cuc(time));
}

/// @return false if the octets end early or the P-field is another
[[nodiscard]] inline bool take_time(OctetReader& in, TaiTime& time) {
  const auto decoded = wire::decode_cuc(in.bytes(wire::cuc_octets));
  if (!decoded) return false;
  time = *decoded;
  return true;
}

/// Cuts after @p max octets.
inline void put_text(OctetWriter& out, const std::string& text, std::size_t max) {
  const std::size_t size = std::min(text.size(), max);
  out.u8(static_cast<std::uint8_t>(size));
  out.bytes({reinterpret_cast<const std::uint8_t*>(text.data()), size});
}

/// @return false if the octets end early or the text is longer than @p max
[[nodiscard]] inline bool take_text(OctetReader& in, std::string& text, std::size_t max) {
  const std::size_t size = in.u8();
  if (size > max) return false;
  const OctetView octets = in.bytes(size);
  text.assign(octets.begin(), octets.end());
  return in.ok();
}

/// A whole space packet: its header gives the length.
/// @return false if the octets end early or the packet is longer than @p max
[[nodiscard]] inline bool take_packet(OctetReader& in, Octets& packet, std::size_t max) {
  const OctetView header = in.bytes(wire::packet_header_octets);
  if (!in.ok()) return false;
  const std::size_t size = wire::packet_octets(header);
  if (size > max) return false;
  const OctetView data = in.bytes(size - header.size());
  packet.assign(header.begin(), header.end());
  packet.insert(packet.end(), data.begin(), data.end());
  return in.ok();
}

template <class T>
void put(OctetWriter& out, T value) {
  if constexpr (std::is_same_v<T, TaiTime>) {
    put_time(out, value);
  } else if constexpr (std::is_same_v<T, float>) {
    out.f32(value);
  } else if constexpr (std::is_same_v<T, double>) {
    out.f64(value);
  } else if constexpr (std::is_enum_v<T>) {
    put(out, static_cast<std::underlying_type_t<T>>(value));
  } else {
    out.put(static_cast<std::uint64_t>(value), sizeof(T));
  }
}

template <class T>
[[nodiscard]] T take(OctetReader& in) {
  if constexpr (std::is_same_v<T, float>) {
    return in.f32();
  } else if constexpr (std::is_same_v<T, double>) {
    return in.f64();
  } else if constexpr (std::is_same_v<T, bool>) {
    return in.u8() != 0;
  } else {
    return static_cast<T>(in.get(sizeof(T)));
  }
}

/// Engineering value to the integer on the link, rounded and saturated. Not a number becomes @p unknown,
/// which no other value becomes (a neighbour is taken), or 0 without one.
template <class Raw>
[[nodiscard]] Raw to_raw(float value, double offset, double scale, std::optional<std::int64_t> unknown) {
  static_assert(sizeof(Raw) <= 4, "a calibrated field has at most 32 bits");
  if (std::isnan(value)) return static_cast<Raw>(unknown.value_or(0));
  const double lowest = static_cast<double>(std::numeric_limits<Raw>::lowest());
  const double highest = static_cast<double>(std::numeric_limits<Raw>::max());
  const double raw = std::round((static_cast<double>(value) - offset) / scale);
  const auto result = static_cast<std::int64_t>(std::clamp(raw, lowest, highest));
  if (unknown && result == *unknown) {
    return static_cast<Raw>(result == static_cast<std::int64_t>(lowest) ? result + 1 : result - 1);
  }
  return static_cast<Raw>(result);
}

template <class Raw>
[[nodiscard]] float from_raw(Raw raw, double offset, double scale, std::optional<std::int64_t> unknown) {
  if (unknown && static_cast<std::int64_t>(raw) == *unknown) return std::numeric_limits<float>::quiet_NaN();
  return static_cast<float>(offset + scale * static_cast<double>(raw));
}

}  // namespace detail
}  // namespace srfs::mission
