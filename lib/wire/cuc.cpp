// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/cuc.hpp"

#include <algorithm>

namespace srfs::wire {
namespace {

constexpr std::int64_t ns_per_s = 1'000'000'000;
constexpr std::int64_t fraction_steps = std::int64_t{1} << 24;
constexpr std::int64_t time_max = (std::int64_t{1} << 56) - 1;  // in steps of 2^-24 s

}  // namespace

std::string_view to_string(CucError error) {
  switch (error) {
    case CucError::wrong_length:
      return "time is not 8 octets long";
    case CucError::wrong_p_field:
      return "time code is not CUC 4+3 of epoch 1958";
  }
  return "?";
}

std::array<std::uint8_t, cuc_octets> encode_cuc(TaiTime time) {
  const std::int64_t ns = std::max<std::int64_t>(time.ns(), 0);
  const std::int64_t whole = ns / ns_per_s;
  const std::int64_t fraction = ((ns % ns_per_s) * fraction_steps + ns_per_s / 2) / ns_per_s;
  const std::int64_t steps = std::min(whole * fraction_steps + fraction, time_max);
  std::array<std::uint8_t, cuc_octets> out{};
  out[0] = cuc_p_field;
  for (unsigned i = 1; i < cuc_octets; ++i) out[i] = static_cast<std::uint8_t>(steps >> (8 * (7 - i)));
  return out;
}

Result<TaiTime, CucError> decode_cuc(OctetView octets) {
  if (octets.size() != cuc_octets) return Err(CucError::wrong_length);
  OctetReader in(octets);
  if (in.u8() != cuc_p_field) return Err(CucError::wrong_p_field);
  const std::int64_t whole = in.u32();
  const std::int64_t fraction = in.u24();
  return TaiTime(nanoseconds(whole * ns_per_s + (fraction * ns_per_s + fraction_steps / 2) / fraction_steps));
}

}  // namespace srfs::wire
