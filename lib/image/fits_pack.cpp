// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdlib>
#include <cstring>

#include <fitsio.h>
#include <fmt/format.h>

#include "image/fits.hpp"

namespace srfs::image {
namespace {

constexpr std::size_t size_octets = alignof(std::max_align_t);  // before the block: its size

/// realloc that gives zeros: cfitsio 4.2 reads the descriptors of tiles before it writes them.
void* reallocate_zeroed(void* block, std::size_t size) {
  auto* const made = static_cast<std::uint8_t*>(std::calloc(1, size + size_octets));
  if (made == nullptr) return nullptr;
  std::memcpy(made, &size, sizeof size);
  if (block == nullptr) return made + size_octets;
  auto* const old = static_cast<std::uint8_t*>(block) - size_octets;
  std::size_t old_size = 0;
  std::memcpy(&old_size, old, sizeof old_size);
  std::memcpy(made + size_octets, block, std::min(size, old_size));
  std::free(old);
  return made + size_octets;
}

/// The file as it grows; cfitsio reallocates it.
struct Memory {
  void* start = nullptr;
  std::size_t size = 0;
  Memory() = default;
  Memory(const Memory&) = delete;
  Memory& operator=(const Memory&) = delete;
  ~Memory() {
    if (start != nullptr) std::free(static_cast<std::uint8_t*>(start) - size_octets);
  }
};

tl::unexpected<Refusal> failure(int status) {
  std::array<char, FLEN_STATUS> text{};
  fits_get_errstatus(status, text.data());
  fits_clear_errmsg();
  return Err(Refusal{fmt::format("FITS: {} (cfitsio {})", text.data(), status)});
}

void write_card(fitsfile* file, const FitsCard& card, int& status) {
  const char* const comment = card.comment.empty() ? nullptr : card.comment.c_str();
  if (const bool* flag = std::get_if<bool>(&card.value)) {
    fits_write_key_log(file, card.key.c_str(), *flag ? 1 : 0, comment, &status);
  } else if (const std::int64_t* number = std::get_if<std::int64_t>(&card.value)) {
    fits_write_key_lng(file, card.key.c_str(), *number, comment, &status);
  } else if (const double* real = std::get_if<double>(&card.value)) {
    fits_write_key_dbl(file, card.key.c_str(), *real, -9, comment, &status);
  } else {
    fits_write_key_str(file, card.key.c_str(), std::get<std::string>(card.value).c_str(), comment, &status);
  }
}

/// Writes image and cards. @return octets of the file
LONGLONG write_all(fitsfile* file, const Grid<std::uint16_t>& pixels, std::span<const FitsCard> cards,
                   int& status) {
  std::array<long, 2> axes{pixels.width(), pixels.height()};
  fits_set_compression_type(file, RICE_1, &status);
  fits_create_img(file, USHORT_IMG, 2, axes.data(), &status);
  for (const FitsCard& card : cards) write_card(file, card, status);
  // As a whole: fits_write_img() would unpack each tile before it packs it.
  std::array<long, 2> first{1, 1};
  fits_write_subset(file, TUSHORT, first.data(), axes.data(),
                    const_cast<std::uint16_t*>(pixels.cells().data()), &status);
  fits_flush_file(file, &status);
  LONGLONG header_at = 0;
  LONGLONG pixels_at = 0;
  LONGLONG end_at = 0;
  fits_get_hduaddrll(file, &header_at, &pixels_at, &end_at, &status);
  return end_at;
}

Result<Octets, Refusal> encode(const Grid<std::uint16_t>& pixels, std::span<const FitsCard> cards) {
  constexpr std::size_t header_octets = 5U * 2880U;
  const std::size_t growth = pixels.size() + header_octets;  // eight bits a pixel is what noise packs to
  Memory memory;  // empty: what it has at first would be taken for a file
  int status = 0;
  fitsfile* file = nullptr;
  if (fits_create_memfile(&file, &memory.start, &memory.size, growth, reallocate_zeroed, &status) != 0)
    return failure(status);
  const LONGLONG octets = write_all(file, pixels, cards, status);
  int close_status = 0;
  fits_close_file(file, &close_status);
  if (status != 0 || close_status != 0) return failure(status != 0 ? status : close_status);
  if (octets <= 0 || static_cast<std::size_t>(octets) > memory.size)
    return Err(Refusal{fmt::format("FITS: {} octets written to {} of memory", octets, memory.size)});
  const auto* const first = static_cast<const std::uint8_t*>(memory.start);
  return Octets(first, first + octets);
}

}  // namespace
}  // namespace srfs::image

void srfs_encode_packed_fits(const srfs::image::Grid<std::uint16_t>& pixels,
                             std::span<const srfs::image::FitsCard> cards,
                             srfs::Result<srfs::Octets, srfs::image::Refusal>& encoded) {
  encoded = srfs::image::encode(pixels, cards);
}
