// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/lossless.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include <fitsio.h>

#include "image/product/frame_strips.hpp"
#include "tests/sky/sky_frame.hpp"

namespace srfs::bench {
namespace {

using Json = nlohmann::ordered_json;
using Clock = std::chrono::steady_clock;

/// A frame of a small 12-bit camera (full well 11000 e, read noise 3.3 e) with 1000 stars per megapixel.
image::Frame night_frame(int width, int height, double background_e, std::uint64_t seed) {
  hw_sim::SkyScene scene;
  scene.width = width;
  scene.height = height;
  scene.fwhm_px = 2.2;
  scene.background_e = background_e;
  scene.gradient = 0.2;
  scene.read_noise_e = 3.3;
  scene.gain_e_per_adu = 2.7;
  scene.bias_adu = 60;
  scene.prnu = 0.008;
  scene.column_pattern_adu = 0.3;
  scene.saturation_adu = 4095;
  const double megapixels = width * height / 1e6;
  scene.hot_pixels = static_cast<int>(200 * megapixels);
  scene.cosmic_rays = static_cast<int>(30 * megapixels);
  scene.seed = seed;
  hw_sim::SkyRandom random(seed + 1);
  std::vector<hw_sim::SkyStar> stars;
  for (int i = 0; i < static_cast<int>(1000 * megapixels); ++i) {
    const double x = random.uniform(0, width - 1);
    const double y = random.uniform(0, height - 1);
    stars.push_back({x, y, hw_sim::flux_for_snr(scene, x, y, std::min(3000.0, 4 / (1 - random.uniform())))});
  }
  image::Frame frame;
  frame.pixels = image::Plane(width, height);
  const std::vector<float> adu = hw_sim::render_sky(scene, stars, {});
  std::copy(adu.begin(), adu.end(), frame.pixels.cells().begin());
  return frame;
}

/// The compressed result and the time needed.
struct Packed {
  std::size_t octets = 0;
  double ms = std::numeric_limits<double>::infinity();
};

template <class F>
double ms_of(const F& work) {
  const auto begin = Clock::now();
  work();
  return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

/// Writes a FITS file in memory, with Rice tiles of one row, cfitsio's default.
std::size_t pack_by_cfitsio(const std::vector<std::uint16_t>& pixels, int width, int height) {
  int status = 0;
  fitsfile* file = nullptr;
  long size[2] = {width, height};
  fits_create_file(&file, "mem://", &status);
  fits_set_compression_type(file, RICE_1, &status);
  fits_create_img(file, USHORT_IMG, 2, size, &status);
  std::vector<std::uint16_t> copy = pixels;  // cfitsio takes no const data
  fits_write_img(file, TUSHORT, 1, static_cast<LONGLONG>(copy.size()), copy.data(), &status);
  fits_flush_file(file, &status);
  LONGLONG header = 0;
  LONGLONG begin = 0;
  LONGLONG end = 0;
  fits_get_hduaddrll(file, &header, &begin, &end, &status);
  int ignored = 0;
  fits_close_file(file, &ignored);
  if (status != 0) throw std::runtime_error("cfitsio: status " + std::to_string(status));
  return static_cast<std::size_t>(end);
}

Json result_of(const Packed& packed, std::size_t pixels) {
  const double wanted = static_cast<double>(pixels) * 1.5;
  return {{"ratio_to_12_bits", std::round(1000 * wanted / static_cast<double>(packed.octets)) / 1000},
          {"ms", std::round(100 * packed.ms) / 100}};
}

Json measure_sky(int width, int height, double background_e, int frames, std::uint64_t seed) {
  Packed ours;
  Packed peer;
  double unpack_ms = std::numeric_limits<double>::infinity();
  bool identical = true;
  for (int i = 0; i < frames; ++i) {
    const image::Frame frame = night_frame(width, height, background_e, seed + static_cast<std::uint64_t>(i));
    std::vector<std::uint16_t> pixels;
    for (const float v : frame.pixels.cells()) pixels.push_back(static_cast<std::uint16_t>(v));
    Octets strips;
    constexpr int times = 3;
    for (int k = 0; k < times; ++k) {
      ours.ms = std::min(ours.ms, ms_of([&] { strips = image::encode_strips(frame).value(); }));
      std::size_t octets = 0;
      peer.ms = std::min(peer.ms, ms_of([&] { octets = pack_by_cfitsio(pixels, width, height); }));
      if (k == 0) ours.octets += strips.size(), peer.octets += octets;
    }
    image::StripsFound found;
    unpack_ms = std::min(unpack_ms, ms_of([&] { found = image::decode_strips(strips).value(); }));
    identical = identical && found.missing.empty() && found.frame.pixels.cells() == frame.pixels.cells();
  }
  const std::size_t pixels =
      static_cast<std::size_t>(frames) * static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  Json ours_json = result_of(ours, pixels);
  ours_json["unpack_ms"] = std::round(100 * unpack_ms) / 100;
  ours_json["identical"] = identical;
  return {{"background_e", background_e},
          {"frames", frames},
          {"srfs", ours_json},
          {"cfitsio_rice", result_of(peer, pixels)},
          {"size_beside_cfitsio",
           std::round(1000 * static_cast<double>(ours.octets) / static_cast<double>(peer.octets)) / 1000},
          {"time_beside_cfitsio", std::round(1000 * ours.ms / peer.ms) / 1000}};
}

}  // namespace

Json measure_lossless(int width, int height, int frames, std::uint64_t seed) {
  return {{"width", width},
          {"height", height},
          {"night", measure_sky(width, height, 40, frames, seed)},
          {"bright_sky", measure_sky(width, height, 400, frames, seed)}};
}

}  // namespace srfs::bench
