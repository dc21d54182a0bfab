// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "wire/sdls.hpp"

namespace srfs::wire {

/// Security header of a TM frame: SPI and sequence number (CCSDS 355.0-B-2, 3.3; no initialisation vector, no
/// padding).
inline constexpr std::size_t tm_sdls_number_octets = 6;
inline constexpr std::size_t tm_sdls_header_octets = 2 + tm_sdls_number_octets;
inline constexpr std::size_t tm_sdls_mac_octets = 16;
/// What authentication takes of a frame.
inline constexpr std::size_t tm_sdls_overhead_octets = tm_sdls_header_octets + tm_sdls_mac_octets;
inline constexpr std::uint64_t tm_sdls_number_max = (std::uint64_t{1} << (8 * tm_sdls_number_octets)) - 1;

using TmMac = std::array<std::uint8_t, tm_sdls_mac_octets>;

/// AES-256-CMAC under one key (NIST SP 800-38B, an algorithm of CCSDS 352.0-B-2). A MAC needs no vector that
/// is used once: a number that was used twice costs nothing but the order of two frames. Moves, never copies.
/// Not thread-safe.
class TmAuthenticator {
 public:
  /// nullopt: the library refuses to work (no memory).
  [[nodiscard]] static std::optional<TmAuthenticator> create(SdlsKey key);
  /// Of both parts, one after the other. nullopt: the library failed.
  [[nodiscard]] std::optional<TmMac> mac(OctetView first, OctetView second);

 private:
  struct End {
    void operator()(void* context) const;
  };
  TmAuthenticator(SdlsKey key, void* context) : key_(std::move(key)), context_(context) {}
  SdlsKey key_;
  std::unique_ptr<void, End> context_;  ///< wipes its copy of the key
};

/// The association that a spacecraft authenticates its frames with. Without an authenticator (its key cannot
/// be used) frames have the same layout and a MAC of zeros, which nobody verifies.
struct TmSeal {
  std::uint16_t spi = 0;
  std::optional<TmAuthenticator> authenticator;
};

enum class TmSdlsError : std::uint8_t {
  too_short,           ///< has no room for security fields and a packet
  wrong_spi,           ///< another security association
  bad_mac,             ///< not made with this key, or altered
  bad_header_pointer,  ///< authentic, but points behind its data
  cipher_failed,       ///< the library refused to work
};
[[nodiscard]] std::string_view to_string(TmSdlsError error);

struct TmFrame;

/// A TM frame whose data field has a security header before the data and a MAC behind them (CCSDS 355.0-B-2,
/// 4.2; 132.0-B-3, 6). The MAC covers the primary header, the security header, the data and, beyond the
/// standard, the operational control field: a stranger writes no CLCW into an authentic frame.
/// @param frame   its data field alone, without security fields; not empty
/// @param number  to tm_sdls_number_max, higher than that of every frame before
[[nodiscard]] Octets encode_tm_frame(const TmFrame& frame, TmSeal& seal, std::uint64_t number);

/// Verifies a frame and takes the security fields out of its data field. Says nothing about replay.
/// @param octets  the whole frame. @param frame  as decode_tm_frame() has read them; unchanged by an error
/// @return its sequence number
[[nodiscard]] Result<std::uint64_t, TmSdlsError> tm_sdls_open(OctetView octets, TmFrame& frame,
                                                              std::uint16_t spi,
                                                              TmAuthenticator& authenticator);

/// Takes the security fields out of a data field without verifying anything: for people who look at a
/// spacecraft that lost its key. @return false: there is no room for them, or the first header pointer points
/// behind what is left
[[nodiscard]] bool tm_sdls_strip(TmFrame& frame);

}  // namespace srfs::wire
