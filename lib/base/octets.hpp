// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace srfs {

using Octets = std::vector<std::uint8_t>;
using OctetView = std::span<const std::uint8_t>;

/// Appends big-endian fields to a bounded buffer. Past the bound nothing is written and ok() turns false.
class OctetWriter {
 public:
  explicit OctetWriter(std::size_t limit = 65536) : limit_(limit) {}

  void u8(std::uint8_t v) { put(v, 1); }
  void u16(std::uint16_t v) { put(v, 2); }
  void u24(std::uint32_t v) { put(v, 3); }
  void u32(std::uint32_t v) { put(v, 4); }
  void u64(std::uint64_t v) { put(v, 8); }
  void f32(float v) { put(std::bit_cast<std::uint32_t>(v), 4); }
  void f64(double v) { put(std::bit_cast<std::uint64_t>(v), 8); }
  /// The @p octets (1-8) low octets of @p v.
  void put(std::uint64_t v, std::size_t octets) {
    if (!reserve(octets)) return;
    for (std::size_t i = octets; i-- > 0;) out_.push_back(static_cast<std::uint8_t>(v >> (8 * i)));
  }
  void bytes(OctetView data) {
    if (reserve(data.size())) out_.insert(out_.end(), data.begin(), data.end());
  }

  [[nodiscard]] bool ok() const { return ok_; }
  [[nodiscard]] std::size_t size() const { return out_.size(); }
  [[nodiscard]] OctetView view() const { return out_; }
  [[nodiscard]] Octets take() { return std::move(out_); }

 private:
  bool reserve(std::size_t n) {
    ok_ = ok_ && out_.size() + n <= limit_;
    return ok_;
  }
  Octets out_;
  std::size_t limit_;
  bool ok_ = true;
};

/// Big-endian.
[[nodiscard]] inline Octets octets_of_u16(std::uint16_t value) {
  return {static_cast<std::uint8_t>(value >> 8), static_cast<std::uint8_t>(value)};
}

/// Reads big-endian fields. Past the end every read gives zero (or an empty view) and ok() turns false.
class OctetReader {
 public:
  explicit OctetReader(OctetView data) : data_(data) {}

  std::uint8_t u8() { return static_cast<std::uint8_t>(get(1)); }
  std::uint16_t u16() { return static_cast<std::uint16_t>(get(2)); }
  std::uint32_t u24() { return static_cast<std::uint32_t>(get(3)); }
  std::uint32_t u32() { return static_cast<std::uint32_t>(get(4)); }
  std::uint64_t u64() { return get(8); }
  float f32() { return std::bit_cast<float>(static_cast<std::uint32_t>(get(4))); }
  double f64() { return std::bit_cast<double>(get(8)); }
  std::uint64_t get(std::size_t octets) {
    if (!advance(octets)) return 0;
    std::uint64_t v = 0;
    for (std::size_t i = position_ - octets; i < position_; ++i) v = v << 8 | data_[i];
    return v;
  }
  OctetView bytes(std::size_t n) { return advance(n) ? data_.subspan(position_ - n, n) : OctetView{}; }
  OctetView rest() { return bytes(remaining()); }

  [[nodiscard]] bool ok() const { return ok_; }
  [[nodiscard]] std::size_t remaining() const { return ok_ ? data_.size() - position_ : 0; }

 private:
  bool advance(std::size_t n) {
    ok_ = ok_ && data_.size() - position_ >= n;
    if (ok_) position_ += n;
    return ok_;
  }
  OctetView data_;
  std::size_t position_ = 0;
  bool ok_ = true;
};

/// "1801c016", lower case, no separators.
[[nodiscard]] inline std::string to_hex(OctetView data) {
  static constexpr std::string_view digits = "0123456789abcdef";
  std::string text;
  text.reserve(data.size() * 2);
  for (const std::uint8_t octet : data) {
    text += digits[octet >> 4];
    text += digits[octet & 0x0f];
  }
  return text;
}

/// Reads what to_hex writes (upper case too); nullopt for an odd length or another character.
[[nodiscard]] inline std::optional<Octets> from_hex(std::string_view text) {
  if (text.size() % 2 != 0) return std::nullopt;
  const auto digit = [](char c) -> int {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
  };
  Octets out;
  out.reserve(text.size() / 2);
  for (std::size_t i = 0; i < text.size(); i += 2) {
    const int high = digit(text[i]);
    const int low = digit(text[i + 1]);
    if (high < 0 || low < 0) return std::nullopt;
    out.push_back(static_cast<std::uint8_t>(high << 4 | low));
  }
  return out;
}

}  // namespace srfs
