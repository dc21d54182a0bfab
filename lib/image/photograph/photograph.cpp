// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/photograph/photograph.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <new>
#include <string_view>
#include <utility>

#include "base/text.hpp"
#include "image/file/frame_file.hpp"
#include "image/photograph/decoders.hpp"

namespace srfs::image {
namespace {

using namespace std::string_view_literals;

/// Ours first, as on board; cfitsio for what ours does not read: other kinds of FITS, and a time as MJD-OBS.
Result<Frame, Refusal> decode_each_fits(OctetView content) {
  auto frame = decode_fits(content);
  if (frame && frame->time_s) return frame;
  auto any = decode_any_fits(content);
  return any || !frame ? any : frame;
}

constexpr std::array<std::pair<std::string_view, FrameDecoder>, 7> formats{{{"SIMPLE  =", decode_each_fits},
                                                                            {"\x89PNG\r\n\x1a\n", decode_png},
                                                                            {"\xff\xd8\xff", decode_jpeg},
                                                                            {"II*\0"sv, decode_tiff},
                                                                            {"MM\0*"sv, decode_tiff},
                                                                            {"II+\0"sv, decode_tiff},
                                                                            {"MM\0+"sv, decode_tiff}}};

FrameDecoder decoder_of(OctetView content) {
  const std::string_view text = as_text(content);
  const auto* const found = std::find_if(formats.begin(), formats.end(),
                                         [&](const auto& format) { return text.starts_with(format.first); });
  return found != formats.end() ? found->second : nullptr;
}

template <class Pixels>
Result<void, Refusal> write(const std::filesystem::path& path, const Pixels& pixels) {
  const auto content = encode_png(pixels);
  if (!content) return refuse("{}: {}", path.string(), content.error().reason);
  return write_octets(path, *content);
}

}  // namespace

bool is_photograph(OctetView content) {
  return decoder_of(content) != nullptr;
}

Result<Frame, Refusal> decode_photograph(OctetView content) try {
  if (content.empty()) return refuse("the file is empty");
  const FrameDecoder decode = decoder_of(content);
  return decode != nullptr ? decode(content) : refuse("neither FITS, TIFF, PNG nor JPEG");
} catch (const std::bad_alloc&) {
  return refuse("not enough memory for this frame");
}

Frame in_16_bits(Frame frame) {
  constexpr float highest = 65535;
  float low = std::numeric_limits<float>::infinity();
  float high = -low;
  for (const float v : frame.pixels.cells()) {
    if (!std::isfinite(v)) continue;
    low = std::min(low, v);
    high = std::max(high, v);
  }
  if (low > high) low = high = 0;
  const bool whole = frame.step > 0 && low >= 0 && high <= highest;
  const float zero = whole ? 0 : low;
  const float factor = whole || high <= low ? 1 : highest / (high - low);
  const auto value = [&](float v) {
    if (!std::isfinite(v)) v = low;
    return std::floor(std::clamp((v - zero) * factor + 0.5F, 0.0F, highest));
  };
  for (float& v : frame.pixels.cells()) v = value(v);
  if (frame.saturation_adu) frame.saturation_adu = value(*frame.saturation_adu);
  frame.step = 1;
  return frame;
}

Result<void, Refusal> write_png(const std::filesystem::path& path, const Grid<std::uint8_t>& pixels) {
  return write(path, pixels);
}

Result<void, Refusal> write_png(const std::filesystem::path& path, const Colours& colours) {
  return write(path, colours);
}

}  // namespace srfs::image
