#include "image/frame.hpp"

#include <algorithm>

#include <sys/mman.h>

#include <fmt/format.h>

namespace srfs::image {

void* allocate_frame_memory(std::size_t octets) {
  constexpr std::size_t page = std::size_t{2} << 20;
  if (octets < page) {
    void* memory = std::malloc(std::max<std::size_t>(1, octets));
    if (memory == nullptr) throw std::bad_alloc();
    return memory;
  }
  if (octets > SIZE_MAX - page) throw std::bad_alloc();
  const std::size_t whole = (octets + page - 1) / page * page;
  void* memory = std::aligned_alloc(page, whole);
  if (memory == nullptr) throw std::bad_alloc();
  madvise(memory, whole, MADV_HUGEPAGE);  // where the kernel has none it is as before
  return memory;
}

std::optional<Refusal> refuse_size(std::int64_t width, std::int64_t height) {
  if (width < 1 || height < 1)
    return Refusal{fmt::format("{} x {} pixels: there is no image", width, height)};
  if (width > frame_pixels_max || height > frame_pixels_max || width * height > frame_pixels_max) {
    return Refusal{
        fmt::format("{} x {} pixels: more than {} million", width, height, frame_pixels_max / 1'000'000)};
  }
  return std::nullopt;
}

}  // namespace srfs::image
