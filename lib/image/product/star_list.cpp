// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/product/star_list.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "base/crc32c.hpp"
#include "base/text.hpp"

namespace srfs::image {
namespace {

constexpr std::string_view marker = "SRFSTARS";
constexpr std::uint8_t version = 1;
constexpr double place_units = 1024;
constexpr double flux_units = 256;
constexpr double snr_units = 16;

/// Rounded; what has no room becomes the nearest that has.
std::int64_t units(double value, double factor, std::int64_t least, std::int64_t most) {
  if (!std::isfinite(value)) return least;
  return std::llround(std::clamp(value * factor, static_cast<double>(least), static_cast<double>(most)));
}

std::int32_t signed_24(std::uint32_t v) {
  return static_cast<std::int32_t>(v << 8) >> 8;
}

bool brighter(const ListedStar& a, const ListedStar& b) {
  return a.flux != b.flux ? a.flux > b.flux : (a.frame != b.frame ? a.frame < b.frame : a.x < b.x);
}

}  // namespace

Octets encode_star_list(const std::vector<ListedStar>& stars) {
  OctetWriter body(stars.size() * listed_star_octets);
  for (const ListedStar& s : stars) {
    body.u16(s.frame);
    body.u24(static_cast<std::uint32_t>(units(s.x, place_units, -(1 << 23), (1 << 23) - 1)) & 0xFF'FFFF);
    body.u24(static_cast<std::uint32_t>(units(s.y, place_units, -(1 << 23), (1 << 23) - 1)) & 0xFF'FFFF);
    body.u16(static_cast<std::uint16_t>(units(s.flux > 1 ? std::log2(s.flux) : 0, flux_units, 0, 65535)));
    body.u16(static_cast<std::uint16_t>(units(s.snr, snr_units, 0, 65535)));
  }
  OctetWriter all(star_list_header_octets + body.size());
  all.bytes(as_octets(marker));
  all.u8(version);
  all.u24(0);
  all.u32(crc32c(body.view()));
  all.bytes(body.view());
  return all.take();
}

Result<std::vector<ListedStar>, Refusal> decode_star_list(OctetView content) {
  const auto refuse = [](std::string why) { return Err(Refusal{std::move(why)}); };
  OctetReader r(content);
  const OctetView begin = r.bytes(marker.size());
  if (!r.ok() || !std::equal(begin.begin(), begin.end(), marker.begin()))
    return refuse("not a list of stars");
  if (const auto found = r.u8(); found != version)
    return refuse(fmt::format("a list of stars of version {}; expected {}", found, version));
  r.u24();
  const std::uint32_t sum = r.u32();
  if (!r.ok() || r.remaining() % listed_star_octets != 0)
    return refuse(fmt::format("a truncated list of stars: {} octets", content.size()));
  if (crc32c(content.subspan(star_list_header_octets)) != sum) return refuse("a damaged list of stars");
  std::vector<ListedStar> stars;
  while (r.remaining() > 0) {
    ListedStar s;
    s.frame = r.u16();
    s.x = signed_24(r.u24()) / place_units;
    s.y = signed_24(r.u24()) / place_units;
    s.flux = std::exp2(r.u16() / flux_units);
    s.snr = r.u16() / snr_units;
    stars.push_back(s);
  }
  return stars;
}

void BrightestStars::add(std::uint16_t frame, const std::vector<Star>& stars) {
  for (const Star& s : stars) stars_.push_back({frame, s.x, s.y, s.flux, s.snr});
  if (stars_.size() > most_) cut();
}

const std::vector<ListedStar>& BrightestStars::sorted() {
  std::sort(stars_.begin(), stars_.end(), brighter);
  return stars_;
}

void BrightestStars::cut() {
  std::nth_element(stars_.begin(), stars_.begin() + static_cast<std::ptrdiff_t>(most_), stars_.end(),
                   brighter);
  dropped_ += stars_.size() - most_;
  stars_.resize(most_);
}

}  // namespace srfs::image
