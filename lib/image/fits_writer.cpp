// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/fits_writer.hpp"

#include <new>

#include "image/fits.hpp"
#include "image/fits_library.hpp"

namespace srfs::image {

Result<Octets, Refusal> encode_packed_fits(const Grid<std::uint16_t>& pixels,
                                           std::span<const FitsCard> cards) {
  static const FitsFunction function = fits_function("srfs_encode_packed_fits");
  if (function.address == nullptr) return Err(Refusal{function.problem});
  if (pixels.empty()) return Err(Refusal{"FITS: a frame without pixels"});
  Result<Octets, Refusal> encoded = Octets{};
  try {
    reinterpret_cast<decltype(&srfs_encode_packed_fits)>(function.address)(pixels, cards, encoded);
  } catch (const std::bad_alloc&) {
    return Err(Refusal{"FITS: no memory"});
  }
  return encoded;
}

}  // namespace srfs::image
