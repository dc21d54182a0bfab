// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// A message definition from any file and a sample from any peer, as `srfs echo` reads them. Input: the
// definition, a NUL, the sample. Checks that what is shown is JSON and no more than the sample can hold.

#include <algorithm>
#include <cstdlib>

#include <nlohmann/json.hpp>

#include "mcap/message_layout.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
  const std::uint8_t* const end = std::find(input, input + size, 0);
  const std::string definition(input, end);
  const auto layout = srfs::mcap::MessageLayout::parse("own/msg/Own", definition);
  if (!layout || end == input + size) return 0;
  const srfs::OctetView sample(end + 1, input + size);
  const auto json = layout->to_json(sample, 4);
  if (json && !nlohmann::json::accept(*json)) std::abort();
  return 0;
}
