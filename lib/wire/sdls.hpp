// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "wire/tc_frame.hpp"

namespace srfs::wire {

inline constexpr std::size_t sdls_key_octets = 32;
inline constexpr std::size_t sdls_iv_octets = 12;
inline constexpr std::size_t sdls_mac_octets = 16;
/// Security header: SPI and initialisation vector (CCSDS 355.0-B-2, 3.3).
inline constexpr std::size_t sdls_header_octets = 2 + sdls_iv_octets;
/// What security adds to a frame.
inline constexpr std::size_t sdls_overhead_octets = sdls_header_octets + sdls_mac_octets;
/// Longest packet that fits into one secured frame.
inline constexpr std::size_t sdls_packet_octets_max = tc_data_octets_max - 1 - sdls_overhead_octets;

/// AES-256 key of a security association. Moves, never copies; wiped when it ends; has no text form.
class SdlsKey {
 public:
  explicit SdlsKey(const std::array<std::uint8_t, sdls_key_octets>& key) : key_(key) {}
  /// 64 hexadecimal digits with nothing around them; nullopt for anything else.
  [[nodiscard]] static std::optional<SdlsKey> from_hex(std::string_view text);
  ~SdlsKey();
  SdlsKey(SdlsKey&& other) noexcept;
  SdlsKey& operator=(SdlsKey&& other) noexcept;
  SdlsKey(const SdlsKey&) = delete;
  SdlsKey& operator=(const SdlsKey&) = delete;

  /// For the cipher only.
  [[nodiscard]] const std::array<std::uint8_t, sdls_key_octets>& octets() const { return key_; }

 private:
  std::array<std::uint8_t, sdls_key_octets> key_;
};

enum class SdlsError : std::uint8_t {
  too_short,      ///< does not hold segment header, security header, one octet and MAC
  too_long,       ///< the packet does not fit into a secured frame
  wrong_spi,      ///< another security association
  bad_mac,        ///< not made with this key, or altered
  cipher_failed,  ///< the library refused to work (no memory)
};
[[nodiscard]] std::string_view to_string(SdlsError error);

/// The primary header of a TC frame as the MAC covers it; the choice is the authentication bit mask of the
/// association (CCSDS 355.0-B-2).
class SdlsHeader {
 public:
  /// Mask 00 00 FC 00 00, the baseline of 355.0-B: the virtual channel alone, so that a frame may be secured
  /// before FOP-1 has numbered it, and repeated under another N(S).
  SdlsHeader(std::uint8_t vc)
      : octets_{0, 0, static_cast<std::uint8_t>(vc << 2), 0, 0} {}  // NOLINT(google-explicit-constructor)
  /// Mask FF FF FF FF FF: flags, spacecraft, channel, length and N(S).
  explicit SdlsHeader(const TcFrameHeader& whole) : octets_(whole) {}
  [[nodiscard]] const TcFrameHeader& octets() const { return octets_; }

 private:
  TcFrameHeader octets_;
};

/// What one transmission is secured with. AD and BD frames use separate associations.
struct SdlsSeal {
  const SdlsKey& key;
  std::uint16_t spi = 0;
  std::uint64_t counter = 0;  ///< low 64 bits of the initialisation vector
  /// High 32 bits, the fixed field of NIST SP 800-38D 8.2.1: two senders with different ones never use the
  /// same vector. Sender and counter together are never used twice with one key.
  std::uint32_t sender = 0;
};

/// A frame data field that passed verification.
struct SdlsOpened {
  std::uint16_t spi = 0;
  std::uint64_t counter = 0;
  std::uint32_t sender = 0;
  std::uint8_t segment_header = 0;
  Octets packet;
};

/// Frame data field of an AD or BD frame: segment header, SPI, IV, encrypted packet, MAC (CCSDS 355.0-B-2,
/// AES-256-GCM of 352.0-B). Authenticated besides the packet, 20 octets: primary header as masked, segment
/// header, SPI, twelve zero octets in the IV's place.
/// @param packet 1 to sdls_packet_octets_max octets
[[nodiscard]] Result<Octets, SdlsError> sdls_apply(const SdlsSeal& seal, const SdlsHeader& header,
                                                   std::uint8_t segment_header, OctetView packet);

/// Verifies and decrypts the data field of an AD or BD frame. Says nothing about replay: see is_fresh.
/// @param spi the association the key belongs to
[[nodiscard]] Result<SdlsOpened, SdlsError> sdls_open(const SdlsKey& key, std::uint16_t spi,
                                                      const SdlsHeader& header, OctetView data);

/// The SPI a data field claims, to choose the association by, before anything is verified; nullopt if too
/// short.
[[nodiscard]] std::optional<std::uint16_t> sdls_claimed_spi(OctetView data);

/// Anti-replay decision on an authenticated counter: any higher one is fresh (no upper window: a lost ground
/// counter is healed by jumping ahead). The caller advances and persists the counter when FARM-1 has accepted
/// the frame.
/// @param last_accepted nullopt: none was ever accepted
[[nodiscard]] constexpr bool is_fresh(std::optional<std::uint64_t> last_accepted, std::uint64_t counter) {
  return !last_accepted || counter > *last_accepted;
}

}  // namespace srfs::wire
