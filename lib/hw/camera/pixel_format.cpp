// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw/camera/pixel_format.hpp"

#include <algorithm>
#include <array>

namespace srfs::hw {
namespace {

consteval std::uint32_t fourcc(const char (&text)[5]) {
  std::uint32_t code = 0;
  for (unsigned i = 0; i < 4; ++i)
    code |= static_cast<std::uint32_t>(static_cast<unsigned char>(text[i])) << (8 * i);
  return code;
}

using enum PixelPacking;

// include/uapi/linux/videodev2.h; Y12P is younger than Debian 12's headers.
constexpr std::array formats{
    PixelFormat{fourcc("Y16 "), "Y16", 16, words, false},
    PixelFormat{fourcc("BYR2"), "SBGGR16", 16, words, true},
    PixelFormat{fourcc("GB16"), "SGBRG16", 16, words, true},
    PixelFormat{fourcc("GR16"), "SGRBG16", 16, words, true},
    PixelFormat{fourcc("RG16"), "SRGGB16", 16, words, true},
    PixelFormat{fourcc("Y12 "), "Y12", 12, words, false},
    PixelFormat{fourcc("Y12P"), "Y12P", 12, packed_12, false},
    PixelFormat{fourcc("BG12"), "SBGGR12", 12, words, true},
    PixelFormat{fourcc("GB12"), "SGBRG12", 12, words, true},
    PixelFormat{fourcc("BA12"), "SGRBG12", 12, words, true},
    PixelFormat{fourcc("RG12"), "SRGGB12", 12, words, true},
    PixelFormat{fourcc("pBCC"), "SBGGR12P", 12, packed_12, true},
    PixelFormat{fourcc("pGCC"), "SGBRG12P", 12, packed_12, true},
    PixelFormat{fourcc("pgCC"), "SGRBG12P", 12, packed_12, true},
    PixelFormat{fourcc("pRCC"), "SRGGB12P", 12, packed_12, true},
    PixelFormat{fourcc("Y10 "), "Y10", 10, words, false},
    PixelFormat{fourcc("Y10P"), "Y10P", 10, packed_10, false},
    PixelFormat{fourcc("BG10"), "SBGGR10", 10, words, true},
    PixelFormat{fourcc("GB10"), "SGBRG10", 10, words, true},
    PixelFormat{fourcc("BA10"), "SGRBG10", 10, words, true},
    PixelFormat{fourcc("RG10"), "SRGGB10", 10, words, true},
    PixelFormat{fourcc("pBAA"), "SBGGR10P", 10, packed_10, true},
    PixelFormat{fourcc("pGAA"), "SGBRG10P", 10, packed_10, true},
    PixelFormat{fourcc("pgAA"), "SGRBG10P", 10, packed_10, true},
    PixelFormat{fourcc("pRAA"), "SRGGB10P", 10, packed_10, true},
    PixelFormat{fourcc("GREY"), "GREY", 8, octets, false},
    PixelFormat{fourcc("BA81"), "SBGGR8", 8, octets, true},
    PixelFormat{fourcc("GBRG"), "SGBRG8", 8, octets, true},
    PixelFormat{fourcc("GRBG"), "SGRBG8", 8, octets, true},
    PixelFormat{fourcc("RGGB"), "SRGGB8", 8, octets, true},
};

void unpack_row(const PixelFormat& format, const std::uint8_t* in, std::uint16_t* out, int width) {
  const auto mask = static_cast<std::uint16_t>((1U << format.bits) - 1);
  switch (format.packing) {
    case octets:
      std::copy_n(in, width, out);
      return;
    case words:
      for (int x = 0; x < width; ++x)
        out[x] = static_cast<std::uint16_t>((in[2 * x] | in[2 * x + 1] << 8) & mask);
      return;
    case packed_10:
      for (int x = 0; x < width; ++x) {
        const std::uint8_t* const group = in + x / 4 * 5;
        out[x] = static_cast<std::uint16_t>(group[x % 4] << 2 | (group[4] >> (2 * (x % 4)) & 3));
      }
      return;
    case packed_12:
      for (int x = 0; x < width; ++x) {
        const std::uint8_t* const group = in + x / 2 * 3;
        out[x] = static_cast<std::uint16_t>(group[x % 2] << 4 | (group[2] >> (4 * (x % 2)) & 15));
      }
      return;
  }
}

}  // namespace

std::span<const PixelFormat> pixel_formats() {
  return formats;
}

const PixelFormat* find_pixel_format(std::uint32_t code) {
  const auto found = std::find_if(formats.begin(), formats.end(),
                                  [code](const PixelFormat& format) { return format.fourcc == code; });
  return found != formats.end() ? &*found : nullptr;
}

const PixelFormat* find_pixel_format(std::string_view name) {
  const auto found = std::find_if(formats.begin(), formats.end(),
                                  [name](const PixelFormat& format) { return format.name == name; });
  return found != formats.end() ? &*found : nullptr;
}

std::size_t row_octets(const PixelFormat& format, int width) {
  const auto n = static_cast<std::size_t>(width);
  switch (format.packing) {
    case octets:
      return n;
    case words:
      return 2 * n;
    case packed_10:
      return (n + 3) / 4 * 5;
    case packed_12:
      return (n + 1) / 2 * 3;
  }
  return 0;
}

bool unpack_pixels(const PixelFormat& format, OctetView frame, std::size_t row_step,
                   image::Grid<std::uint16_t>& pixels) {
  const std::size_t row = row_octets(format, pixels.width());
  const auto height = static_cast<std::size_t>(pixels.height());
  if (height == 0 || row == 0 || row_step < row || frame.size() < (height - 1) * row_step + row) return false;
  for (int y = 0; y < pixels.height(); ++y)
    unpack_row(format, frame.data() + static_cast<std::size_t>(y) * row_step, pixels.row(y), pixels.width());
  return true;
}

}  // namespace srfs::hw
