// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "suite/step_policy.hpp"

namespace srfs::suite {

/// What srfs_rescue must know of a deployment, in a file of lines that it can check and that needs no other
/// file: `srfs rescue prepare` writes it (programs/rescue/README.md lists the keys).
struct RescueSettings {
  struct Association {
    std::uint8_t vc = 0;
    std::uint16_t spi = 0;
    char set = 'a';  ///< a, b, or c: contingency
    bool for_ad = true;
    bool for_bd = true;
    Octets key = {};         ///< 32
    std::string key_file{};  ///< absolute: the key in use now, if it can be read
    friend bool operator==(const Association&, const Association&) = default;
  };
  /// The association of TM frames.
  struct Seal {
    std::uint16_t spi = 0;
    Octets key = {};         ///< 32
    std::string key_file{};  ///< absolute: never restored; the key above is used
    friend bool operator==(const Seal&, const Seal&) = default;
  };
  std::string var;         ///< absolute, as all paths
  std::string program;     ///< srfs
  std::string deployment;  ///< file
  std::string rs422;       ///< device URI
  std::uint32_t baud = 0;
  std::string watchdog = {};  ///< device URI; empty: none
  std::uint32_t watchdog_timeout_s = 0;
  std::uint16_t spacecraft = 0;
  std::uint16_t frame_octets = 0;
  std::uint8_t interleave = 1;
  bool reed_solomon = true;
  bool tm_randomizer = true;
  bool tm_continuous = false;
  bool tc_randomizer = false;
  bool tc_correct_single_bits = true;
  bool tc_strict = false;  ///< as UplinkConfig::strict
  std::vector<Association> associations = {};
  std::optional<Seal> seal = {};                 ///< of TM frames; nullopt: they have no security
  std::vector<std::uint8_t> open_channels = {};  ///< without security: test deployments only
  StepPolicy steps = {};

  static constexpr std::size_t largest_octets = 16384;
  static constexpr std::size_t most_associations = 16;
  friend bool operator==(const RescueSettings&, const RescueSettings&) = default;
};

/// Lines, the last one with the SHA-256 of those before it.
[[nodiscard]] std::string encode(const RescueSettings& settings);
/// @return why not: one line for people, without octets of the file
[[nodiscard]] Result<RescueSettings, std::string> decode_rescue_settings(std::string_view text);

}  // namespace srfs::suite
