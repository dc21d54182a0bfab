// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>
#include <string_view>

#include "image/fits.hpp"
#include "image/simd.hpp"

namespace srfs::image {
namespace {

constexpr std::size_t card_octets = 80;
constexpr std::size_t block_octets = 2880;
constexpr float nan_f = std::numeric_limits<float>::quiet_NaN();

/// What a header says that matters here.
struct Header {
  std::size_t octets = 0;  ///< of the header, with its padding
  int bitpix = 0;
  int axes = -1;
  std::array<std::int64_t, 3> size{0, 0, 1};
  double scale = 1;
  double zero = 0;
  std::optional<std::int64_t> blank;
  std::optional<double> saturation;
  std::optional<double> mjd;
  std::string_view date;
};

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  return text;
}

template <class T>
std::optional<T> number(std::string_view text) {
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  if constexpr (std::is_floating_point_v<T>) {
    if (!std::isfinite(value)) return std::nullopt;
  }
  return value;
}

/// Keys whose value is not a text.
constexpr std::array<std::string_view, 11> numbers{"SIMPLE", "BITPIX",   "NAXIS",  "NAXIS1",
                                                   "NAXIS2", "NAXIS3",   "BSCALE", "BZERO",
                                                   "BLANK",  "SATURATE", "MJD-OBS"};

/// @return false where the card is not understood
bool take_card(std::string_view card, Header& header) {
  const std::string_view key = trimmed(card.substr(0, 8));
  if (card.substr(8, 2) != "= ") return true;  // a comment
  std::string_view value = card.substr(10);
  if (const auto quote = value.find('\'');
      quote != std::string_view::npos && trimmed(value.substr(0, quote)).empty()) {
    const auto end = value.find('\'', quote + 1);
    if (end == std::string_view::npos) return false;
    if (key == "DATE-OBS") header.date = value.substr(quote + 1, end - quote - 1);
    return std::find(numbers.begin(), numbers.end(), key) == numbers.end();
  }
  value = trimmed(value.substr(0, value.find('/')));
  const auto set = [](auto& to, auto&& found) {
    if (found) to = *found;
    return found.has_value();
  };
  if (key == "SIMPLE") return value == "T";
  if (key == "BITPIX") return set(header.bitpix, number<int>(value));
  if (key == "NAXIS") return set(header.axes, number<int>(value));
  if (key == "NAXIS1") return set(header.size[0], number<std::int64_t>(value));
  if (key == "NAXIS2") return set(header.size[1], number<std::int64_t>(value));
  if (key == "NAXIS3") return set(header.size[2], number<std::int64_t>(value));
  if (key == "BSCALE") return set(header.scale, number<double>(value));
  if (key == "BZERO") return set(header.zero, number<double>(value));
  if (key == "BLANK") return set(header.blank, number<std::int64_t>(value));
  if (key == "SATURATE") return set(header.saturation, number<double>(value));
  if (key == "MJD-OBS") return set(header.mjd, number<double>(value));
  return true;
}

std::optional<Header> read_header(OctetView content) {
  Header header;
  const std::string_view text(reinterpret_cast<const char*>(content.data()), content.size());
  for (std::size_t at = 0; at + card_octets <= text.size(); at += card_octets) {
    const std::string_view card = text.substr(at, card_octets);
    if (trimmed(card) == "END") {
      header.octets = (at + card_octets + block_octets - 1) / block_octets * block_octets;
      return header;
    }
    if (!take_card(card, header)) return std::nullopt;
  }
  return std::nullopt;
}

/// Seconds of a date as FITS writes it: 2026-11-22T07:52:30.25.
std::optional<double> seconds_of(std::string_view text) {
  if (text.size() < 19 || text[4] != '-' || text[7] != '-' || text[10] != 'T' || text[13] != ':' ||
      text[16] != ':')
    return std::nullopt;
  const auto year = number<int>(text.substr(0, 4));
  const auto month = number<unsigned>(text.substr(5, 2));
  const auto day = number<unsigned>(text.substr(8, 2));
  const auto hour = number<int>(text.substr(11, 2));
  const auto minute = number<int>(text.substr(14, 2));
  const auto second = number<double>(trimmed(text.substr(17)));
  if (!year || !month || !day || !hour || !minute || !second) return std::nullopt;
  const auto date = std::chrono::year{*year} / std::chrono::month{*month} / std::chrono::day{*day};
  if (!date.ok()) return std::nullopt;
  const auto days = static_cast<double>(std::chrono::sys_days{date}.time_since_epoch().count());
  return 86400 * days + 3600 * *hour + 60 * *minute + *second;
}

/// Big-endian values, scaled.
struct Scale {
  float factor;
  float zero;
};

SRFS_VECTORISED
void take_16(const std::uint8_t* in, float* out, std::size_t n, Scale scale) {
  for (std::size_t i = 0; i < n; ++i) {
    const int v = static_cast<std::int16_t>(static_cast<std::uint16_t>((in[2 * i] << 8) | in[2 * i + 1]));
    out[i] = static_cast<float>(v) * scale.factor + scale.zero;
  }
}

template <class T>
T big_endian(const std::uint8_t* in) {
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i) bits = (bits << 8) | in[i];
  if constexpr (sizeof(T) == 1) return static_cast<T>(bits);
  if constexpr (sizeof(T) == 2) return std::bit_cast<T>(static_cast<std::uint16_t>(bits));
  if constexpr (sizeof(T) == 4) return std::bit_cast<T>(static_cast<std::uint32_t>(bits));
  if constexpr (sizeof(T) == 8) return std::bit_cast<T>(bits);
}

template <class T>
void take(const Header& header, const std::uint8_t* in, std::size_t n, float* out) {
  for (std::size_t i = 0; i < n; ++i) {
    const T v = big_endian<T>(in + i * sizeof(T));
    if constexpr (std::is_integral_v<T>) {
      if (header.blank && std::int64_t{v} == *header.blank) {
        out[i] = nan_f;
        continue;
      }
    }
    out[i] = static_cast<float>(double(v) * header.scale + header.zero);
  }
}

void take_plane(const Header& header, const std::uint8_t* in, std::size_t n, float* out) {
  switch (header.bitpix) {
    case 8:
      return take<std::uint8_t>(header, in, n, out);
    case 16:
      // Exact in float where scale and zero are whole numbers.
      if (!header.blank && header.scale == 1 && header.zero == std::round(header.zero) &&
          std::abs(header.zero) < 1e6)
        return take_16(in, out, n, {1, static_cast<float>(header.zero)});
      return take<std::int16_t>(header, in, n, out);
    case 32:
      return take<std::int32_t>(header, in, n, out);
    case -32:
      return take<float>(header, in, n, out);
    default:
      return take<double>(header, in, n, out);
  }
}

bool is_plain(const Header& h, std::size_t file_octets) {
  if (h.bitpix != 8 && h.bitpix != 16 && h.bitpix != 32 && h.bitpix != -32 && h.bitpix != -64) return false;
  if (h.axes != 2 && h.axes != 3) return false;
  if (refuse_size(h.size[0], h.size[1]) || h.size[2] < 1 || h.size[2] > 3) return false;
  const std::uint64_t octets = static_cast<std::uint64_t>(h.size[0]) * static_cast<std::uint64_t>(h.size[1]) *
                               static_cast<std::uint64_t>(h.size[2]) *
                               static_cast<std::uint64_t>(std::abs(h.bitpix) / 8);
  return h.octets <= file_octets && octets <= file_octets - h.octets;
}

}  // namespace

std::optional<Frame> decode_plain_fits(OctetView content) {
  const auto header = read_header(content);
  if (!header || !is_plain(*header, content.size())) return std::nullopt;
  Frame frame;
  frame.pixels = Plane::unset(static_cast<int>(header->size[0]), static_cast<int>(header->size[1]));
  const std::size_t n = frame.pixels.size();
  const std::size_t plane_octets = n * static_cast<std::size_t>(std::abs(header->bitpix) / 8);
  take_plane(*header, content.data() + header->octets, n, frame.pixels.cells().data());
  const auto planes = static_cast<std::size_t>(header->axes == 3 ? header->size[2] : 1);
  std::vector<float> plane(planes > 1 ? n : 0);
  for (std::size_t p = 1; p < planes; ++p) {
    take_plane(*header, content.data() + header->octets + p * plane_octets, n, plane.data());
    for (std::size_t i = 0; i < n; ++i) frame.pixels.cells()[i] += plane[i];
  }
  if (planes > 1) {
    for (float& v : frame.pixels.cells()) v /= static_cast<float>(planes);
  }
  if (header->bitpix > 0)
    frame.step = static_cast<float>(std::abs(header->scale)) / static_cast<float>(planes);
  if (header->saturation) frame.saturation_adu = static_cast<float>(*header->saturation);
  frame.time_s = seconds_of(header->date);
  if (!frame.time_s && header->mjd) frame.time_s = 86400 * *header->mjd;
  return frame;
}

}  // namespace srfs::image
