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
inline constexpr std::uint16_t image_straylight = 34;  ///< Stray light in the frames of the camera
}  // namespace apid

/// Structure ids of the PUS service 3.
namespace structure {
inline constexpr std::uint16_t image_straylight = 1034;
}  // namespace structure

/// Sky of the last frame, and counters
struct ImageStraylightHousekeeping {
  static constexpr std::string_view name = "image_straylight";
  static constexpr std::uint16_t structure_id = 1034;
  static constexpr std::uint16_t apid = 34;
  static constexpr milliseconds default_interval{5000};
  static constexpr std::size_t max_size = 38;

  std::uint64_t cycle{};  ///< Mission cycle [ticks]
  std::uint32_t frames{};  ///< Frames measured since the start
  std::uint32_t frames_dropped{};  ///< Frames that came while two were waiting
  std::uint32_t frames_malformed{};  ///< Frames whose size or encoding is not what their head says
  std::uint32_t bright_frames{};  ///< Frames with a sky above the limit
  float sky_adu{};  ///< Median of the last frame; not a number: none was seen [ADU]
  float gradient_adu{};  ///< Brightest less darkest of its 16 by 16 blocks, each by its median [ADU]
  float saturated_fraction{};  ///< Part of its pixels at full scale
  std::uint16_t limit_adu{};  ///< Sky above which a frame counts as bright [ADU]

  void encode(OctetWriter& out) const;
  [[nodiscard]] Octets encoded() const;

  /// Reads the fields and nothing more; nullopt when the octets end early.
  [[nodiscard]] static std::optional<ImageStraylightHousekeeping> decode(OctetReader& in);
  [[nodiscard]] static std::optional<ImageStraylightHousekeeping> decode(OctetView octets);

  friend bool operator==(const ImageStraylightHousekeeping&, const ImageStraylightHousekeeping&) = default;
};

// Every translation unit has its own: no library of one mission may use those of another.
constexpr std::array<GuardedParameter, 0> fragment_guarded_parameters{{
}};
constexpr std::array<WorkThreadStructure, 0> fragment_work_threads{{
}};
constexpr NodeTables fragment_tables{fragment_guarded_parameters, fragment_work_threads};

/// Event ids of the PUS service 5.
namespace event {
inline constexpr std::uint16_t straylight_bright_sky = 1911;  ///< frame {frame}: sky of {sky_adu} ADU, gradient {gradient_adu}
inline constexpr std::uint16_t straylight_dark_sky = 1912;  ///< frame {frame}: the sky is below the limit again
}  // namespace event

/// Event 1911, low: frame {frame}: sky of {sky_adu} ADU, gradient {gradient_adu}
struct StraylightBrightSkyEvent {
  static constexpr std::uint16_t event_id = 1911;
  static constexpr EventSeverity severity = EventSeverity::low;
  static constexpr std::size_t max_size = 41;

  std::string frame{};  ///< TASK/NUMBER
  float sky_adu{};  ///< Median [ADU]
  float gradient_adu{};  ///< Brightest less darkest block [ADU]

  void encode(OctetWriter& out) const;
  [[nodiscard]] Octets encoded() const;

  /// Reads the fields and nothing more; nullopt when the octets end early.
  [[nodiscard]] static std::optional<StraylightBrightSkyEvent> decode(OctetReader& in);
  [[nodiscard]] static std::optional<StraylightBrightSkyEvent> decode(OctetView octets);

  friend bool operator==(const StraylightBrightSkyEvent&, const StraylightBrightSkyEvent&) = default;
};

/// Event 1912, info: frame {frame}: the sky is below the limit again
struct StraylightDarkSkyEvent {
  static constexpr std::uint16_t event_id = 1912;
  static constexpr EventSeverity severity = EventSeverity::info;
  static constexpr std::size_t max_size = 33;

  std::string frame{};  ///< TASK/NUMBER

  void encode(OctetWriter& out) const;
  [[nodiscard]] Octets encoded() const;

  /// Reads the fields and nothing more; nullopt when the octets end early.
  [[nodiscard]] static std::optional<StraylightDarkSkyEvent> decode(OctetReader& in);
  [[nodiscard]] static std::optional<StraylightDarkSkyEvent> decode(OctetView octets);

  friend bool operator==(const StraylightDarkSkyEvent&, const StraylightDarkSkyEvent&) = default;
};

inline void ImageStraylightHousekeeping::encode(OctetWriter& out) const {
  detail::put(out, cycle);
  detail::put(out, frames);
  detail::put(out, frames_dropped);
  detail::put(out, frames_malformed);
  detail::put(out, bright_frames);
  detail::put(out, sky_adu);
  detail::put(out, gradient_adu);
  detail::put(out, saturated_fraction);
  detail::put(out, limit_adu);
}
inline Octets ImageStraylightHousekeeping::encoded() const {
  OctetWriter out;
  encode(out);
  return out.take();
}

inline std::optional<ImageStraylightHousekeeping> ImageStraylightHousekeeping::decode(OctetReader& in) {
  ImageStraylightHousekeeping value;
  value.cycle = detail::take<std::uint64_t>(in);
  value.frames = detail::take<std::uint32_t>(in);
  value.frames_dropped = detail::take<std::uint32_t>(in);
  value.frames_malformed = detail::take<std::uint32_t>(in);
  value.bright_frames = detail::take<std::uint32_t>(in);
  value.sky_adu = detail::take<float>(in);
  value.gradient_adu = detail::take<float>(in);
  value.saturated_fraction = detail::take<float>(in);
  value.limit_adu = detail::take<std::uint16_t>(in);
  if (!in.ok()) return std::nullopt;
  return value;
}
inline std::optional<ImageStraylightHousekeeping> ImageStraylightHousekeeping::decode(OctetView octets) {
  OctetReader in(octets);
  const auto value = decode(in);
  return value && in.remaining() == 0 ? value : std::nullopt;
}


inline void StraylightBrightSkyEvent::encode(OctetWriter& out) const {
  detail::put_text(out, frame, 32);
  detail::put(out, sky_adu);
  detail::put(out, gradient_adu);
}
inline Octets StraylightBrightSkyEvent::encoded() const {
  OctetWriter out;
  encode(out);
  return out.take();
}

inline std::optional<StraylightBrightSkyEvent> StraylightBrightSkyEvent::decode(OctetReader& in) {
  StraylightBrightSkyEvent value;
  if (!detail::take_text(in, value.frame, 32)) return std::nullopt;
  value.sky_adu = detail::take<float>(in);
  value.gradient_adu = detail::take<float>(in);
  if (!in.ok()) return std::nullopt;
  return value;
}
inline std::optional<StraylightBrightSkyEvent> StraylightBrightSkyEvent::decode(OctetView octets) {
  OctetReader in(octets);
  const auto value = decode(in);
  return value && in.remaining() == 0 ? value : std::nullopt;
}


inline void StraylightDarkSkyEvent::encode(OctetWriter& out) const {
  detail::put_text(out, frame, 32);
}
inline Octets StraylightDarkSkyEvent::encoded() const {
  OctetWriter out;
  encode(out);
  return out.take();
}

inline std::optional<StraylightDarkSkyEvent> StraylightDarkSkyEvent::decode(OctetReader& in) {
  StraylightDarkSkyEvent value;
  if (!detail::take_text(in, value.frame, 32)) return std::nullopt;
  if (!in.ok()) return std::nullopt;
  return value;
}
inline std::optional<StraylightDarkSkyEvent> StraylightDarkSkyEvent::decode(OctetView octets) {
  OctetReader in(octets);
  const auto value = decode(in);
  return value && in.remaining() == 0 ? value : std::nullopt;
}



}  // namespace srfs::mission