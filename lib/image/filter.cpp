#include "image/filter.hpp"

#include <algorithm>
#include <cmath>

namespace srfs::image {

Plane gaussian_filter(const Plane& in, float sigma_px) {
  const int radius = std::max(1, static_cast<int>(std::ceil(2.7F * sigma_px)));
  std::vector<float> taps(static_cast<std::size_t>(radius) + 1);
  float squares = 0;
  for (int i = 0; i <= radius; ++i) {
    const float u = static_cast<float>(i) / sigma_px;
    const float v = std::exp(-0.5F * u * u);
    taps[static_cast<std::size_t>(i)] = v;
    squares += (i == 0 ? 1.0F : 2.0F) * v * v;
  }
  for (float& t : taps) t /= std::sqrt(squares);
  const int width = in.width();
  const int height = in.height();
  Plane out(width, height);
  std::vector<float> sums(static_cast<std::size_t>(width + 2 * radius), 0.0F);
  float* line = sums.data() + radius;  // with zeros on both sides
  for (int y = 0; y < height; ++y) {
    const float* centre = in.row(y);
    for (int x = 0; x < width; ++x) line[x] = taps[0] * centre[x];
    for (int i = 1; i <= radius; ++i) {
      const float t = taps[static_cast<std::size_t>(i)];
      const float* above = y - i >= 0 ? in.row(y - i) : nullptr;
      const float* below = y + i < height ? in.row(y + i) : nullptr;
      if (above != nullptr && below != nullptr) {
        for (int x = 0; x < width; ++x) line[x] += t * (above[x] + below[x]);
      } else if (const float* only = above != nullptr ? above : below; only != nullptr) {
        for (int x = 0; x < width; ++x) line[x] += t * only[x];
      }
    }
    float* to = out.row(y);
    for (int x = 0; x < width; ++x) to[x] = taps[0] * line[x];
    for (int i = 1; i <= radius; ++i) {
      const float t = taps[static_cast<std::size_t>(i)];
      for (int x = 0; x < width; ++x) to[x] += t * (line[x - i] + line[x + i]);
    }
  }
  return out;
}

}  // namespace srfs::image
