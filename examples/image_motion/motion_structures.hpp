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
inline constexpr std::uint16_t image_motion = 35;  ///< Motion against the stars, by background subtraction
}  // namespace apid

/// Structure ids of the PUS service 3.
namespace structure {
inline constexpr std::uint16_t image_motion = 1035;
}  // namespace structure

/// The last frame's motion, and counters
struct ImageMotionHousekeeping {
  static constexpr std::string_view name = "image_motion";
  static constexpr std::uint16_t structure_id = 1035;
  static constexpr std::uint16_t apid = 35;
  static constexpr milliseconds default_interval{5000};
  static constexpr std::size_t max_size = 38;

  std::uint64_t cycle{};  ///< Mission cycle [ticks]
  std::uint32_t frames{};  ///< Frames measured since the start
  std::uint32_t frames_compared{};  ///< Of these, the ones that show the same stars as the frame before
  std::uint32_t frames_dropped{};  ///< Frames that came while two were waiting
  std::uint32_t frames_malformed{};  ///< Frames whose size or encoding is not what their head says
  std::uint32_t movers{};  ///< Moving objects in the last frame
  float shift_x{};  ///< How far the stars moved since the frame before [px]
  float shift_y{};  ///< The same, along the column [px]
  std::uint16_t least_snr{};  ///< SNR from which on a pixel counts

  void encode(OctetWriter& out) const;
  [[nodiscard]] Octets encoded() const;

  /// Reads the fields and nothing more; nullopt when the octets end early.
  [[nodiscard]] static std::optional<ImageMotionHousekeeping> decode(OctetReader& in);
  [[nodiscard]] static std::optional<ImageMotionHousekeeping> decode(OctetView octets);

  friend bool operator==(const ImageMotionHousekeeping&, const ImageMotionHousekeeping&) = default;
};

// Every translation unit has its own: no library of one mission may use those of another.
constexpr std::array<GuardedParameter, 0> fragment_guarded_parameters{{
}};
constexpr std::array<WorkThreadStructure, 0> fragment_work_threads{{
}};
constexpr NodeTables fragment_tables{fragment_guarded_parameters, fragment_work_threads};

/// Event ids of the PUS service 5.
namespace event {
inline constexpr std::uint16_t motion_found = 1951;  ///< frame {frame}: {movers} moving objects, the brightest at {x} {y}, SNR {snr}, {length} px long
}  // namespace event

/// Event 1951, info: frame {frame}: {movers} moving objects, the brightest at {x} {y}, SNR {snr}, {length} px long
struct MotionFoundEvent {
  static constexpr std::uint16_t event_id = 1951;
  static constexpr EventSeverity severity = EventSeverity::info;
  static constexpr std::size_t max_size = 53;

  std::string frame{};  ///< TASK/NUMBER
  std::uint32_t movers{};  ///< How many
  float x{};  ///< Middle of the brightest [px]
  float y{};  ///< Middle of the brightest [px]
  float snr{};  ///< Of its brightest pixel
  float length{};  ///< Longer side of the rectangle around it [px]

  void encode(OctetWriter& out) const;
  [[nodiscard]] Octets encoded() const;

  /// Reads the fields and nothing more; nullopt when the octets end early.
  [[nodiscard]] static std::optional<MotionFoundEvent> decode(OctetReader& in);
  [[nodiscard]] static std::optional<MotionFoundEvent> decode(OctetView octets);

  friend bool operator==(const MotionFoundEvent&, const MotionFoundEvent&) = default;
};

inline void ImageMotionHousekeeping::encode(OctetWriter& out) const {
  detail::put(out, cycle);
  detail::put(out, frames);
  detail::put(out, frames_compared);
  detail::put(out, frames_dropped);
  detail::put(out, frames_malformed);
  detail::put(out, movers);
  detail::put(out, shift_x);
  detail::put(out, shift_y);
  detail::put(out, least_snr);
}
inline Octets ImageMotionHousekeeping::encoded() const {
  OctetWriter out;
  encode(out);
  return out.take();
}

inline std::optional<ImageMotionHousekeeping> ImageMotionHousekeeping::decode(OctetReader& in) {
  ImageMotionHousekeeping value;
  value.cycle = detail::take<std::uint64_t>(in);
  value.frames = detail::take<std::uint32_t>(in);
  value.frames_compared = detail::take<std::uint32_t>(in);
  value.frames_dropped = detail::take<std::uint32_t>(in);
  value.frames_malformed = detail::take<std::uint32_t>(in);
  value.movers = detail::take<std::uint32_t>(in);
  value.shift_x = detail::take<float>(in);
  value.shift_y = detail::take<float>(in);
  value.least_snr = detail::take<std::uint16_t>(in);
  if (!in.ok()) return std::nullopt;
  return value;
}
inline std::optional<ImageMotionHousekeeping> ImageMotionHousekeeping::decode(OctetView octets) {
  OctetReader in(octets);
  const auto value = decode(in);
  return value && in.remaining() == 0 ? value : std::nullopt;
}


inline void MotionFoundEvent::encode(OctetWriter& out) const {
  detail::put_text(out, frame, 32);
  detail::put(out, movers);
  detail::put(out, x);
  detail::put(out, y);
  detail::put(out, snr);
  detail::put(out, length);
}
inline Octets MotionFoundEvent::encoded() const {
  OctetWriter out;
  encode(out);
  return out.take();
}

inline std::optional<MotionFoundEvent> MotionFoundEvent::decode(OctetReader& in) {
  MotionFoundEvent value;
  if (!detail::take_text(in, value.frame, 32)) return std::nullopt;
  value.movers = detail::take<std::uint32_t>(in);
  value.x = detail::take<float>(in);
  value.y = detail::take<float>(in);
  value.snr = detail::take<float>(in);
  value.length = detail::take<float>(in);
  if (!in.ok()) return std::nullopt;
  return value;
}
inline std::optional<MotionFoundEvent> MotionFoundEvent::decode(OctetView octets) {
  OctetReader in(octets);
  const auto value = decode(in);
  return value && in.remaining() == 0 ? value : std::nullopt;
}



}  // namespace srfs::mission