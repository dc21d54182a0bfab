// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Lists of stars as received from the link. The result is the stars or a reason; a decoded list stays the
// same when it is written again.
#include <cstdlib>

#include "base/crc32c.hpp"
#include "image/product/star_list.hpp"

namespace {

using srfs::Octets;
using srfs::OctetView;

void decode(OctetView content) {
  const auto stars = srfs::image::decode_star_list(content);
  if (!stars) {
    if (stars.error().reason.empty()) std::abort();
    return;
  }
  if (srfs::image::encode_star_list(*stars).size() != content.size()) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const OctetView content(data, size);
  decode(content);
  constexpr std::size_t header = srfs::image::star_list_header_octets;
  if (size < header) return 0;
  Octets list(content.begin(), content.end());
  const std::uint32_t sum = srfs::crc32c(OctetView(list).subspan(header));
  for (std::size_t i = 0; i < 4; ++i) list[header - 4 + i] = static_cast<std::uint8_t>(sum >> (24 - 8 * i));
  decode(list);
  return 0;
}
