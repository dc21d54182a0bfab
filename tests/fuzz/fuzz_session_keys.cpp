// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Session keys as they stand on disk. What is read is within its bounds, and is written as it was read.
#include <cstdlib>
#include <string_view>

#include "base/checked_text.hpp"
#include "wire/session_keys.hpp"

namespace {

using namespace srfs::wire;

void read(std::string_view text) {
  const auto keys = decode_session_keys(text);
  if (!keys) return;
  const bool bounded =
      keys->keys().size() <= SessionKeys::max_keys && keys->uses().size() <= SessionKeys::max_uses;
  if (!bounded || decode_session_keys(encode_session_keys(*keys)) != *keys) std::abort();
  for (const auto& use : keys->uses()) {
    const bool own = use.current != SessionKeys::file_id && use.current != SessionKeys::lost_id;
    if (own && keys->find(use.current) == nullptr) std::abort();
    if (use.next && keys->find(*use.next) == nullptr) std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  read(text);
  read(srfs::with_check(text));  // else only the checksum is tried
  return 0;
}
