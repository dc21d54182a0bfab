#include "image/frame.hpp"

#include <fmt/format.h>

namespace srfs::image {

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
