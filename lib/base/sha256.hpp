// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <string>

#include "base/octets.hpp"

namespace srfs {

/// SHA-256 taken piece by piece.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(Sha256&&) noexcept;
  Sha256& operator=(Sha256&&) noexcept;
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;

  void update(OctetView data);
  using Digest = std::array<std::uint8_t, 32>;
  /// Nothing may follow.
  [[nodiscard]] Digest finish();

 private:
  struct Context;
  std::unique_ptr<Context> context_;
};

/// 64 lower-case digits
[[nodiscard]] std::string to_digits(const Sha256::Digest& digest);
[[nodiscard]] Sha256::Digest sha256_of(OctetView data);

/// HMAC with SHA-256 (RFC 2104).
[[nodiscard]] Sha256::Digest hmac_sha256(OctetView key, OctetView data);
/// The same with a key that is taken up once, for many short messages. Any thread.
class HmacSha256 {
 public:
  explicit HmacSha256(OctetView key);
  /// @param parts  of one message
  [[nodiscard]] Sha256::Digest of(std::initializer_list<OctetView> parts) const;

 private:
  struct State;
  std::shared_ptr<const State> state_;
};
/// Takes as long wherever they differ.
[[nodiscard]] bool equal_secrets(OctetView a, OctetView b);

}  // namespace srfs
