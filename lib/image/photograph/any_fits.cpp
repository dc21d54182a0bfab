// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <chrono>
#include <cmath>
#include <limits>

#include <fitsio.h>

#include "image/file/fits.hpp"
#include "image/photograph/decoders.hpp"

namespace srfs::image {
namespace {

std::string fits_reason(int status) {
  std::array<char, FLEN_STATUS> text{};
  fits_get_errstatus(status, text.data());
  fits_clear_errmsg();
  return fmt::format("FITS: {} (cfitsio {})", text.data(), status);
}

struct FitsFile {
  fitsfile* handle = nullptr;
  FitsFile() = default;
  FitsFile(const FitsFile&) = delete;
  FitsFile& operator=(const FitsFile&) = delete;
  ~FitsFile() {
    int status = 0;
    if (handle != nullptr) fits_close_file(handle, &status);
    fits_clear_errmsg();
  }
};

/// Moves to the first HDU with an image. @return its axes, or why there is none
Result<std::array<long, 3>, Refusal> find_image(fitsfile* file) {
  int status = 0;
  int hdus = 0;
  if (fits_get_num_hdus(file, &hdus, &status) != 0) return Err(Refusal{fits_reason(status)});
  for (int hdu = 1; hdu <= hdus; ++hdu) {
    int type = 0;
    int axes = 0;
    std::array<long, 3> size{1, 1, 1};
    if (fits_movabs_hdu(file, hdu, &type, &status) != 0) return Err(Refusal{fits_reason(status)});
    if (type != IMAGE_HDU && fits_is_compressed_image(file, &status) == 0) continue;
    if (fits_get_img_dim(file, &axes, &status) != 0) return Err(Refusal{fits_reason(status)});
    if (axes == 0) continue;
    if (axes > 3) return refuse("FITS: an image of {} axes; expected 2, or 3 with up to 3 colours", axes);
    if (fits_get_img_size(file, 3, size.data(), &status) != 0) return Err(Refusal{fits_reason(status)});
    if (axes < 2) size[1] = 1;
    if (axes < 3) size[2] = 1;
    if (size[2] < 1 || size[2] > 3) return refuse("FITS: {} planes; expected 1, or up to 3 colours", size[2]);
    return size;
  }
  return refuse("FITS: no image in the file");
}

/// Seconds of DATE-OBS, else of MJD-OBS, on whatever scale the file keeps.
std::optional<double> fits_time(fitsfile* file) {
  int status = 0;
  std::array<char, FLEN_VALUE> text{};
  if (fits_read_key(file, TSTRING, "DATE-OBS", text.data(), nullptr, &status) == 0) {
    int year = 0, month = 0, day = 0, hour = 0, minute = 0;
    double second = 0;
    if (fits_str2time(text.data(), &year, &month, &day, &hour, &minute, &second, &status) == 0 && year > 0) {
      const auto date = std::chrono::year{year} / std::chrono::month{static_cast<unsigned>(month)} /
                        std::chrono::day{static_cast<unsigned>(day)};
      if (date.ok())
        return 86400.0 * static_cast<double>(std::chrono::sys_days{date}.time_since_epoch().count()) +
               3600.0 * hour + 60.0 * minute + second;
    }
  }
  status = 0;
  double days = 0;
  if (fits_read_key(file, TDOUBLE, "MJD-OBS", &days, nullptr, &status) == 0 && std::isfinite(days))
    return 86400 * days;
  return std::nullopt;
}

constexpr std::size_t fits_block = 2880;

}  // namespace

Result<Frame, Refusal> decode_any_fits(OctetView content) {
  // cfitsio reads whole blocks, beyond the end of a file that was cut within one.
  Octets padded;
  if (const std::size_t over = content.size() % fits_block; over != 0) {
    padded.reserve(content.size() + fits_block - over);
    padded.assign(content.begin(), content.end());
    padded.resize(content.size() + fits_block - over);
    content = padded;
  }
  FitsFile file;
  int status = 0;
  void* memory = const_cast<std::uint8_t*>(content.data());  // only read: READONLY
  std::size_t size = content.size();
  if (fits_open_memfile(&file.handle, "frame", READONLY, &memory, &size, 0, nullptr, &status) != 0)
    return Err(Refusal{fits_reason(status)});
  const auto axes = find_image(file.handle);
  if (!axes) return Err(axes.error());
  const auto [width, height, planes] = *axes;
  if (auto refusal = refuse_size(width, height)) return Err(std::move(*refusal));
  int bits = 0;
  if (fits_get_img_type(file.handle, &bits, &status) != 0) return Err(Refusal{fits_reason(status)});
  const bool compressed = fits_is_compressed_image(file.handle, &status) != 0;
  const std::uint64_t octets = static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height) *
                               static_cast<std::uint64_t>(planes) *
                               static_cast<std::uint64_t>(std::abs(bits) / 8);
  LONGLONG header_at = 0;
  LONGLONG pixels_at = 0;
  LONGLONG end_at = 0;
  if (fits_get_hduaddrll(file.handle, &header_at, &pixels_at, &end_at, &status) != 0)
    return Err(Refusal{fits_reason(status)});
  if (!compressed && static_cast<std::uint64_t>(pixels_at) + octets > content.size())
    return refuse("FITS: the header announces {} octets of pixels, the file has {}", octets, content.size());
  // A tile that decodes to more than a thousand times its octets does not come from a camera.
  if (compressed && octets / 1000 > content.size())
    return refuse("FITS: the header announces {} octets of pixels in a file of {}", octets, content.size());

  Frame frame;
  frame.pixels = Plane::unset(static_cast<int>(width), static_cast<int>(height));
  const auto count = static_cast<LONGLONG>(frame.pixels.size());
  std::vector<float> plane(planes > 1 ? frame.pixels.size() : 0);
  for (long p = 0; p < planes; ++p) {
    float null = std::numeric_limits<float>::quiet_NaN();
    int any = 0;
    float* out = p == 0 ? frame.pixels.cells().data() : plane.data();
    if (fits_read_img(file.handle, TFLOAT, p * count + 1, count, &null, out, &any, &status) != 0)
      return Err(Refusal{fits_reason(status)});
    for (std::size_t i = 0; p > 0 && i < plane.size(); ++i) frame.pixels.cells()[i] += plane[i];
  }
  if (planes > 1) {
    for (float& v : frame.pixels.cells()) v /= static_cast<float>(planes);
  }
  double scale = 1;
  if (fits_read_key(file.handle, TDOUBLE, "BSCALE", &scale, nullptr, &status) != 0) status = 0, scale = 1;
  if (bits > 0) frame.step = static_cast<float>(std::abs(scale)) / static_cast<float>(planes);
  float saturation = 0;
  if (fits_read_key(file.handle, TFLOAT, "SATURATE", &saturation, nullptr, &status) == 0 &&
      std::isfinite(saturation))
    frame.saturation_adu = saturation;
  frame.time_s = fits_time(file.handle);
  status = 0;
  double exposure_s = 0;
  if (fits_read_key(file.handle, TDOUBLE, "EXPTIME", &exposure_s, nullptr, &status) == 0 && exposure_s >= 0)
    frame.exposure_s = exposure_s;
  status = 0;
  double gain = 0;
  if (fits_read_key(file.handle, TDOUBLE, "GAIN", &gain, nullptr, &status) == 0 && std::isfinite(gain))
    frame.gain = gain;
  status = 0;
  double celsius = 0;
  if (fits_read_key(file.handle, TDOUBLE, "CCD-TEMP", &celsius, nullptr, &status) == 0 &&
      std::isfinite(celsius))
    frame.temperature_k = celsius + ice_point_k;
  fits_clear_errmsg();
  return frame;
}

}  // namespace srfs::image
