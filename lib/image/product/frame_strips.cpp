// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/product/frame_strips.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <libaec.h>

#include "base/crc32c.hpp"
#include "base/text.hpp"
#include "image/simd.hpp"

namespace srfs::image {
namespace {

constexpr std::string_view marker = "SRFSTRIP";
constexpr std::uint8_t version = 1;
constexpr std::size_t usual_strip_pixels = 32768;  // about 16 KB on the link
constexpr std::uint32_t strips_max = 65536;
constexpr double nan_d = std::numeric_limits<double>::quiet_NaN();
constexpr float nan_f = std::numeric_limits<float>::quiet_NaN();

// Part of the format.
constexpr unsigned block_samples = 64;
constexpr unsigned segment_blocks = 64;

struct StripHeader {
  std::uint8_t bits = 0;
  std::uint8_t shift = 0;
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint32_t rows = 0;
  std::uint32_t index = 0;
  double time_s = nan_d;
  float saturation_adu = nan_f;
  std::uint32_t length = 0;

  [[nodiscard]] std::uint32_t strips() const { return (height + rows - 1) / rows; }
  [[nodiscard]] std::uint32_t first_row() const { return index * rows; }
  [[nodiscard]] std::uint32_t rows_here() const { return std::min(rows, height - first_row()); }
  [[nodiscard]] std::size_t samples() const { return std::size_t{rows_here()} * width; }
  [[nodiscard]] int most() const { return (1 << bits) - 1; }
  [[nodiscard]] bool same_frame(const StripHeader& o) const {
    return bits == o.bits && shift == o.shift && width == o.width && height == o.height && rows == o.rows &&
           std::bit_cast<std::uint64_t>(time_s) == std::bit_cast<std::uint64_t>(o.time_s) &&
           std::bit_cast<std::uint32_t>(saturation_adu) == std::bit_cast<std::uint32_t>(o.saturation_adu);
  }
};

/// Samples of up to 8 bits take one octet each, others two.
aec_stream stream_of(unsigned bits) {
  aec_stream stream{};
  stream.bits_per_sample = bits;
  stream.block_size = block_samples;
  stream.rsi = segment_blocks;
  if constexpr (std::endian::native == std::endian::big) stream.flags |= AEC_DATA_MSB;
  return stream;
}

// --- prediction: differences from what the neighbours say, as whole numbers of the same bits (CCSDS
// 121.0-B, 4.2.2)

/// @param most  largest sample
inline unsigned mapped(int value, int predicted, int most) {
  const int difference = value - predicted;
  const int size = std::abs(difference);
  const int both_ways = std::min(predicted, most - predicted);
  return static_cast<unsigned>(size <= both_ways ? 2 * size - (difference < 0 ? 1 : 0) : both_ways + size);
}

/// The inverse; out of range for what mapped() does not give.
inline int unmapped(int code, int predicted, int most) {
  const int both_ways = std::min(predicted, most - predicted);
  if (code <= 2 * both_ways) return predicted + (code % 2 == 0 ? code / 2 : -(code + 1) / 2);
  const int size = code - both_ways;
  return predicted == both_ways ? predicted + size : predicted - size;
}

/// Mean of the left neighbour and of the three above.
inline int mean_of(int left, int above_left, int above, int above_right) {
  return (left + above_left + above + above_right + 2) / 4;
}

SRFS_VECTORISED
void map_inner(const std::uint16_t* above, const std::uint16_t* row, std::uint16_t* out, std::size_t n,
               int most) {
  for (std::size_t x = 1; x + 1 < n; ++x)
    out[x] = static_cast<std::uint16_t>(
        mapped(row[x], mean_of(row[x - 1], above[x - 1], above[x], above[x + 1]), most));
}

/// @param above  the row before in the strip; null: there is none
void map_row(const std::uint16_t* above, const std::uint16_t* row, std::uint16_t* out, std::size_t n,
             int most) {
  if (above == nullptr) {
    for (std::size_t x = 0; x < n; ++x)
      out[x] = static_cast<std::uint16_t>(mapped(row[x], x > 0 ? row[x - 1] : 0, most));
    return;
  }
  out[0] = static_cast<std::uint16_t>(mapped(row[0], above[0], most));
  map_inner(above, row, out, n, most);
  if (n > 1)
    out[n - 1] = static_cast<std::uint16_t>(
        mapped(row[n - 1], mean_of(row[n - 2], above[n - 2], above[n - 1], above[n - 1]), most));
}

/// In place. @return whether all are samples
bool unmap_row(const std::uint16_t* above, std::uint16_t* row, std::size_t n, int most) {
  int left = 0;
  bool sound = true;
  for (std::size_t x = 0; x < n; ++x) {
    int predicted = left;
    if (above != nullptr && x == 0) predicted = above[0];
    if (above != nullptr && x > 0)
      predicted = mean_of(left, above[x - 1], above[x], above[std::min(x + 1, n - 1)]);
    const int value = unmapped(row[x], predicted, most);
    sound = sound && value >= 0 && value <= most;
    left = std::clamp(value, 0, most);
    row[x] = static_cast<std::uint16_t>(left);
  }
  return sound;
}

// --- encoding

/// @return all bits that any value has; the highest where one is not a whole number from 0 to 65535
SRFS_VECTORISED
std::uint32_t take_values(const float* in, std::uint16_t* out, std::size_t n) {
  std::uint32_t bits = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const float v = in[i] >= 0.0F && in[i] <= 65535.0F ? in[i] : -1.0F;  // NaN too
    const int whole = static_cast<int>(v);
    const std::uint32_t fraction = static_cast<float>(whole) == v ? 0U : 0x8000'0000U;
    bits |= static_cast<std::uint32_t>(whole) | fraction;
    out[i] = static_cast<std::uint16_t>(whole);
  }
  return bits;
}

SRFS_VECTORISED
void shift_right(std::uint16_t* values, std::size_t n, unsigned shift) {
  for (std::size_t i = 0; i < n; ++i) values[i] = static_cast<std::uint16_t>(values[i] >> shift);
}

void append_header(Octets& out, const StripHeader& h) {
  OctetWriter w(strip_header_octets);
  w.bytes(as_octets(marker));
  w.u8(version);
  w.u8(h.bits);
  w.u8(h.shift);
  w.u8(0);
  w.u32(h.width);
  w.u32(h.height);
  w.u32(h.rows);
  w.u32(h.index);
  w.f64(h.time_s);
  w.f32(h.saturation_adu);
  w.u32(h.length);
  w.u32(crc32c(w.view()));
  const OctetView made = w.view();
  out.insert(out.end(), made.begin(), made.end());
}

/// Memory that is used strip after strip.
struct Workspace {
  std::vector<std::uint16_t> codes;
  Octets narrow;
  Octets packed;
};

/// Appends a strip. @param samples  its rows @return whether there was memory for it
bool append_strip(Octets& out, StripHeader header, const std::uint16_t* samples, Workspace& space) {
  const std::size_t n = header.width;
  space.codes.resize(header.samples());
  for (std::uint32_t y = 0; y < header.rows_here(); ++y)
    map_row(y > 0 ? samples + (y - 1) * n : nullptr, samples + y * n, space.codes.data() + y * n, n,
            header.most());
  const auto* codes = reinterpret_cast<const std::uint8_t*>(space.codes.data());
  if (header.bits <= 8) {
    space.narrow.assign(space.codes.begin(), space.codes.end());
    codes = space.narrow.data();
  }
  Octets& packed = space.packed;
  const std::size_t octets = header.samples() * (header.bits > 8 ? 2 : 1);
  packed.resize(octets + octets / 4 + 1024);  // what has no pattern grows by an eighth at most
  aec_stream stream = stream_of(header.bits);
  stream.next_in = codes;
  stream.avail_in = octets;
  stream.next_out = packed.data();
  stream.avail_out = packed.size();
  if (aec_buffer_encode(&stream) != AEC_OK) return false;
  header.length = static_cast<std::uint32_t>(stream.total_out);
  append_header(out, header);
  const OctetView made(packed.data(), stream.total_out);
  out.insert(out.end(), made.begin(), made.end());
  const std::uint32_t sum = crc32c(made);
  for (int byte = 3; byte >= 0; --byte) out.push_back(static_cast<std::uint8_t>(sum >> (8 * byte)));
  return true;
}

// --- decoding

std::optional<StripHeader> read_header(OctetView at) {
  if (at.size() < strip_overhead_octets) return std::nullopt;
  OctetReader r(at.first(strip_header_octets));
  r.bytes(marker.size());
  StripHeader h;
  const bool known = r.u8() == version;
  h.bits = r.u8();
  h.shift = r.u8();
  r.u8();
  h.width = r.u32();
  h.height = r.u32();
  h.rows = r.u32();
  h.index = r.u32();
  h.time_s = r.f64();
  h.saturation_adu = r.f32();
  h.length = r.u32();
  if (r.u32() != crc32c(at.first(strip_header_octets - 4)) || !known) return std::nullopt;
  const bool sound = h.bits >= 1 && h.bits + h.shift <= 16 && !refuse_size(h.width, h.height) &&
                     h.rows >= 1 && h.rows <= h.height && h.strips() <= strips_max && h.index < h.strips();
  return sound ? std::optional(h) : std::nullopt;
}

/// The strip's pixels into the frame. @return whether the samples are what the header says
bool take_samples(const StripHeader& header, OctetView packed, Plane& pixels) {
  const std::size_t samples = header.samples();
  const bool wide = header.bits > 8;
  std::vector<std::uint16_t> values(samples);
  Octets narrow(wide ? 0 : samples);
  aec_stream stream = stream_of(header.bits);
  stream.next_in = packed.data();
  stream.avail_in = packed.size();
  stream.next_out = wide ? reinterpret_cast<std::uint8_t*>(values.data()) : narrow.data();
  stream.avail_out = samples * (wide ? 2 : 1);
  const std::size_t wanted = stream.avail_out;
  if (aec_buffer_decode(&stream) != AEC_OK || stream.total_out != wanted) return false;
  if (!wide) std::copy(narrow.begin(), narrow.end(), values.begin());
  const std::size_t n = header.width;
  for (std::uint32_t y = 0; y < header.rows_here(); ++y) {
    std::uint16_t* row = values.data() + y * n;
    if (!unmap_row(y > 0 ? row - n : nullptr, row, n, header.most())) return false;
  }
  float* out = pixels.row(static_cast<int>(header.first_row()));
  for (std::size_t i = 0; i < samples; ++i) out[i] = static_cast<float>(unsigned{values[i]} << header.shift);
  return true;
}

class StripReader {
 public:
  Result<StripsFound, Refusal> read(OctetView content) {
    const std::string_view text = as_text(content);
    std::uint64_t used = 0;
    bool marked = false;
    for (std::size_t at = text.find(marker); at != std::string_view::npos;) {
      marked = true;
      const std::size_t octets = take(content.subspan(at));
      used += octets;
      // Behind a strip that is not sound the next one may begin anywhere: octets may be lost in it.
      at = text.find(marker, at + std::max<std::size_t>(octets, 1));
    }
    if (!first_) {
      if (!marked) return Err(Refusal{"no strip begins in this file"});
      return Err(Refusal{fmt::format("none of the strips is sound ({} have sound headers)", found_.damaged)});
    }
    found_.octets_skipped = content.size() - used;
    found_.strips = first_->strips();
    found_.rows = first_->rows;
    for (std::uint32_t i = 0; i < found_.strips; ++i) {
      if (!present_[i]) found_.missing.push_back(i);
    }
    if (std::isfinite(first_->time_s)) found_.frame.time_s = first_->time_s;
    if (std::isfinite(first_->saturation_adu)) found_.frame.saturation_adu = first_->saturation_adu;
    found_.frame.step = static_cast<float>(1U << first_->shift);
    return std::move(found_);
  }

 private:
  /// @return octets of the strip that begins here; 0: it is not sound, or of another frame
  std::size_t take(OctetView at) {
    const auto header = read_header(at);
    if (!header) return 0;
    if (first_ && !first_->same_frame(*header)) return 0;
    const std::size_t all = strip_overhead_octets + header->length;
    if (at.size() < all) {
      ++found_.damaged;
      return 0;
    }
    const OctetView packed = at.subspan(strip_header_octets, header->length);
    OctetReader sum(at.subspan(strip_header_octets + header->length, 4));
    if (sum.u32() != crc32c(packed) || !plausible(*header)) {
      ++found_.damaged;
      return 0;
    }
    if (!first_) {
      found_.frame.pixels = Plane(static_cast<int>(header->width), static_cast<int>(header->height), nan_f);
      present_.assign(header->strips(), false);
    }
    if (!take_samples(*header, packed, found_.frame.pixels)) {
      ++found_.damaged;
      if (!first_) found_.frame.pixels = Plane();
      return 0;
    }
    first_ = first_ ? first_ : header;
    present_[header->index] = true;
    return all;
  }

  /// A segment of zeros takes at least a bit: what announces more is not unpacked.
  static bool plausible(const StripHeader& h) {
    return h.samples() / (block_samples * segment_blocks) <= std::size_t{h.length} * 8;
  }

  std::optional<StripHeader> first_;
  std::vector<bool> present_;
  StripsFound found_;
};

}  // namespace

Result<Octets, Refusal> encode_strips(const Frame& frame) try {
  const Plane& pixels = frame.pixels;
  if (auto refusal = refuse_size(pixels.width(), pixels.height())) return Err(std::move(*refusal));
  auto values = Grid<std::uint16_t>::unset(pixels.width(), pixels.height());
  const std::uint32_t all = take_values(pixels.cells().data(), values.cells().data(), pixels.size());
  if (all > 0xFFFF) return Err(Refusal{"pixels that are not whole numbers from 0 to 65535"});
  StripHeader header;
  header.shift = static_cast<std::uint8_t>(all != 0 ? std::countr_zero(all) : 0);
  header.bits = static_cast<std::uint8_t>(std::max(1, static_cast<int>(std::bit_width(all >> header.shift))));
  header.width = static_cast<std::uint32_t>(pixels.width());
  header.height = static_cast<std::uint32_t>(pixels.height());
  header.rows = std::clamp<std::uint32_t>(static_cast<std::uint32_t>(usual_strip_pixels / header.width), 1,
                                          header.height);
  header.rows = std::max(header.rows, (header.height + strips_max - 1) / strips_max);
  header.time_s = frame.time_s.value_or(nan_d);
  header.saturation_adu = frame.saturation_adu.value_or(nan_f);
  if (header.shift > 0) shift_right(values.cells().data(), values.size(), header.shift);
  Octets out;
  out.reserve(values.size() + header.strips() * strip_overhead_octets);
  Workspace space;
  for (; header.index < header.strips(); ++header.index) {
    const std::uint16_t* samples = values.row(static_cast<int>(header.first_row()));
    if (!append_strip(out, header, samples, space)) return Err(Refusal{"not enough memory for the strips"});
  }
  return out;
} catch (const std::bad_alloc&) {
  return Err(Refusal{"not enough memory for the strips"});
}

Result<StripsFound, Refusal> decode_strips(OctetView content) try {
  return StripReader().read(content);
} catch (const std::bad_alloc&) {
  return Err(Refusal{"not enough memory for this frame"});
}

}  // namespace srfs::image
