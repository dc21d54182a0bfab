// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/known_key.hpp"

#include <algorithm>
#include <array>
#include <set>

namespace srfs {
namespace {

constexpr std::size_t fewest_values = 12;  // different octets of a key; a random one has 30

// SP 800-38A F.1.5; Ed25519 public keys of the seeds 0, 00..1F, FF.., 01.. and of RFC 8032, 7.1, tests 1
// to 3.
constexpr std::array<std::string_view, 8> published{
    "603deb1015ca71be2b73aef0857d77811f352c073b6108d72d9810a30914dff4",
    "3b6a27bcceb6a42d62a3a8d02a6f0d73653215771de243a63ac048a18b59da29",
    "03a107bff3ce10be1d70dd18e74bc09967e4d6309ba50d5f1ddc8664125531b8",
    "76a1592044a6e4f511265bca73a604d90b0529d1df602be30a19a9257660d1f5",
    "8a88e3dd7409f195fd52db2d3cba5d72ca6709bf1d94121bf3748801b40f6f5c",
    "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a",
    "3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c",
    "fc51cd8e6218a1a38da47ed00230f0580816ed13ba3303ac5deb911548908025"};

bool steps_evenly(OctetView key) {
  for (std::size_t i = 2; i < key.size(); ++i) {
    if (static_cast<std::uint8_t>(key[i] - key[i - 1]) != static_cast<std::uint8_t>(key[1] - key[0]))
      return false;
  }
  return true;
}

}  // namespace

std::optional<std::string_view> why_known(OctetView key) {
  if (std::all_of(key.begin(), key.end(), [](std::uint8_t o) { return o == 0; })) return "it is zero";
  if (steps_evenly(key)) return "its octets form a sequence, as in published test vectors";
  if (std::set<std::uint8_t>(key.begin(), key.end()).size() < fewest_values)
    return "it has only a few different octets";
  const std::size_t half = key.size() / 2;
  if (std::equal(key.begin(), key.begin() + static_cast<std::ptrdiff_t>(half),
                 key.begin() + static_cast<std::ptrdiff_t>(half), key.end()))
    return "its halves are the same, as in published test vectors";
  for (const std::string_view known : published) {
    const auto octets = from_hex(known);
    if (octets && std::equal(octets->begin(), octets->end(), key.begin(), key.end()))
      return "it appears in a published test vector";
  }
  return std::nullopt;
}

}  // namespace srfs
