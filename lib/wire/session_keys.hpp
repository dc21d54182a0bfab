// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/state_file.hpp"
#include "wire/sdls.hpp"

namespace srfs::wire {

/// States of a key (355.1-B 3.3). A destroyed key is not there any more.
enum class KeyState : std::uint8_t {
  pre_active = 0,   ///< came up by OTAR
  active = 1,       ///< an association may take it
  deactivated = 2,  ///< never again
};

enum class KeyRefusal : std::uint8_t {
  unknown_key,    ///< there is no key with this id
  wrong_state,    ///< not from this state of the key
  key_in_use,     ///< an association uses it
  table_full,     ///< no room for another key
  not_a_new_key,  ///< these octets are a key already
};

/// Octets of a key that may be copied; wiped when they end.
class KeyOctets {
 public:
  explicit KeyOctets(const SdlsKey& key) : octets_(key.octets()) {}
  KeyOctets(const KeyOctets&) = default;
  KeyOctets(KeyOctets&&) = default;
  KeyOctets& operator=(const KeyOctets&) = default;
  KeyOctets& operator=(KeyOctets&&) = default;
  ~KeyOctets();
  [[nodiscard]] SdlsKey key() const { return SdlsKey(octets_); }
  [[nodiscard]] OctetView view() const { return octets_; }
  friend bool operator==(const KeyOctets&, const KeyOctets&) = default;

 private:
  std::array<std::uint8_t, sdls_key_octets> octets_;
};

/// Keys that were replaced in flight, and which association (SPI) uses which. Both ends of the link have one:
/// the spacecraft takes frames under the current key and under the next one; the ground sends under the
/// current one. Each change makes a new value, which its owner stores before it counts. Pure.
class SessionKeys {
 public:
  static constexpr std::uint16_t first_id = 128;  ///< below it: key-encryption keys
  static constexpr std::uint16_t last_id = 0xFFFE;
  static constexpr std::uint16_t lost_id = 0xFFFF;  ///< current key of an association that lost it
  static constexpr std::uint16_t file_id = 0;       ///< the key file of the deployment
  static constexpr std::size_t max_keys = 16;
  static constexpr std::size_t max_uses = 16;

  struct Key {
    std::uint16_t id = 0;
    KeyState state = KeyState::pre_active;
    KeyOctets octets;
    friend bool operator==(const Key&, const Key&) = default;
  };
  struct Use {
    std::uint16_t spi = 0;
    std::uint16_t current = file_id;
    std::optional<std::uint16_t> next = {};
    friend bool operator==(const Use&, const Use&) = default;
  };

  [[nodiscard]] std::uint64_t generation() const { return generation_; }
  [[nodiscard]] const std::vector<Key>& keys() const { return keys_; }
  [[nodiscard]] const std::vector<Use>& uses() const { return uses_; }
  [[nodiscard]] const Key* find(std::uint16_t id) const;
  /// nullopt: its file's key, and none to come.
  [[nodiscard]] std::optional<Use> use_of(std::uint16_t spi) const;
  [[nodiscard]] bool is_used(std::uint16_t id) const;
  [[nodiscard]] bool has(OctetView key) const;

  // What changes nothing has the same generation.

  /// OTAR. A key that is still pre-active is replaced: it was sent again.
  [[nodiscard]] Result<SessionKeys, KeyRefusal> uploaded(std::uint16_t id, const SdlsKey& key) const;
  [[nodiscard]] Result<SessionKeys, KeyRefusal> activated(std::uint16_t id) const;
  [[nodiscard]] Result<SessionKeys, KeyRefusal> deactivated(std::uint16_t id) const;
  [[nodiscard]] Result<SessionKeys, KeyRefusal> destroyed(std::uint16_t id) const;
  /// Rekeying: @p id becomes the next key of @p spi; its current one works until confirmed(). No key has two
  /// associations.
  [[nodiscard]] Result<SessionKeys, KeyRefusal> rekeyed(std::uint16_t spi, std::uint16_t id) const;
  /// A frame under key @p id was taken: it is the current one, and the one before it is destroyed. Nothing
  /// changes when @p id is not active any more.
  [[nodiscard]] SessionKeys confirmed(std::uint16_t spi, std::uint16_t id) const;
  /// The stored keys are gone: none of these associations takes a frame before it is rekeyed.
  [[nodiscard]] static SessionKeys lost(const std::vector<std::uint16_t>& spis);

  friend bool operator==(const SessionKeys&, const SessionKeys&) = default;
  friend std::string encode_session_keys(const SessionKeys& keys);
  friend std::optional<SessionKeys> decode_session_keys(std::string_view text);

 private:
  [[nodiscard]] SessionKeys changed() const;
  [[nodiscard]] Key* find_own(std::uint16_t id);
  [[nodiscard]] Use& use(std::uint16_t spi);
  [[nodiscard]] bool is_sound() const;

  std::uint64_t generation_ = 0;
  std::vector<Key> keys_;
  std::vector<Use> uses_;
};

/// One line: generation, "kID:STATE:HEX" for each key, "uSPI=CURRENT" or "uSPI=CURRENT>NEXT" for each use;
/// behind it its checksum.
[[nodiscard]] std::string encode_session_keys(const SessionKeys& keys);
/// nullopt: damaged, or what no sequence of changes leads to.
[[nodiscard]] std::optional<SessionKeys> decode_session_keys(std::string_view text);

/// The spacecraft's folder of them: VAR/keys/session, since only ttc sees VAR/keys.
[[nodiscard]] inline std::filesystem::path session_key_folder(const std::filesystem::path& var) {
  return var / "keys" / "session";
}
inline constexpr const char* session_keys_name =
    "session_keys";  ///< in a folder, without the number of the copy
/// `<path>.0` and `<path>.1`, for their owner alone.
[[nodiscard]] StateFile<SessionKeys> session_key_file(const std::filesystem::path& path);

}  // namespace srfs::wire
