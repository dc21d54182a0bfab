// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

namespace srfs::conformance {

using Octets = std::vector<std::uint8_t>;

/// Writes a payload as ROS 2 sends it, based only on the specification (OMG DDSI-RTPS 2.3, 10; CORBA CDR):
/// encapsulation 00 01 00 00; little endian; each primitive aligned to its size, counted from the end of the
/// encapsulation; string lengths include NUL; the payload is padded to 4 octets.
class Cdr {
 public:
  Cdr& u8(std::uint8_t v) { return put(&v, 1); }
  Cdr& u32(std::uint32_t v) { return put(&v, 4); }
  Cdr& i64(std::int64_t v) { return put(&v, 8); }
  Cdr& u64(std::uint64_t v) { return put(&v, 8); }
  Cdr& f64(double v) { return put(&v, 8); }
  Cdr& str(const std::string& text) {
    u32(static_cast<std::uint32_t>(text.size() + 1));
    body_.insert(body_.end(), text.begin(), text.end());
    body_.push_back(0);
    return *this;
  }
  Cdr& raw(const Octets& octets) {
    body_.insert(body_.end(), octets.begin(), octets.end());
    return *this;
  }
  Cdr& strings(const std::vector<std::string>& list) {
    u32(static_cast<std::uint32_t>(list.size()));
    for (const auto& text : list) str(text);
    return *this;
  }
  [[nodiscard]] Octets payload() const {
    Octets all{0x00, 0x01, 0x00, 0x00};
    all.insert(all.end(), body_.begin(), body_.end());
    while (all.size() % 4 != 0) all.push_back(0);
    return all;
  }

 private:
  Cdr& put(const void* value, std::size_t size) {
    while (body_.size() % size != 0) body_.push_back(0);
    const auto* octets = static_cast<const std::uint8_t*>(value);
    body_.insert(body_.end(), octets, octets + size);
    return *this;
  }
  Octets body_;
};

/// Reads such a payload; throws if it ends early. For messages with unknown content.
class CdrView {
 public:
  explicit CdrView(Octets payload) : payload_(std::move(payload)) {
    if (payload_.size() < 4 || payload_[0] != 0 || payload_[1] != 1) throw std::runtime_error("no CDR_LE");
  }
  std::uint8_t u8() { return take<std::uint8_t>(); }
  std::uint16_t u16() { return take<std::uint16_t>(); }
  std::uint32_t u32() { return take<std::uint32_t>(); }
  std::uint64_t u64() { return take<std::uint64_t>(); }
  Octets raw(std::size_t size) {
    need(size);
    Octets octets(payload_.begin() + at_, payload_.begin() + at_ + static_cast<std::ptrdiff_t>(size));
    at_ += static_cast<std::ptrdiff_t>(size);
    return octets;
  }
  std::string str() {
    const Octets octets = raw(u32());
    if (octets.empty() || octets.back() != 0) throw std::runtime_error("string without end");
    return {octets.begin(), octets.end() - 1};
  }
  /// Whether only the padding to 4 octets is left.
  [[nodiscard]] bool at_end() const {
    return payload_.size() % 4 == 0 && payload_.size() - static_cast<std::size_t>(at_) < 4;
  }

 private:
  void need(std::size_t size) const {
    if (static_cast<std::size_t>(at_) + size > payload_.size()) throw std::runtime_error("payload too short");
  }
  template <class T>
  T take() {
    while ((static_cast<std::size_t>(at_) - 4) % sizeof(T) != 0) ++at_;
    need(sizeof(T));
    T value{};
    std::memcpy(&value, payload_.data() + at_, sizeof value);
    at_ += static_cast<std::ptrdiff_t>(sizeof value);
    return value;
  }
  Octets payload_;
  std::ptrdiff_t at_ = 4;
};

inline std::string hex(const Octets& octets) {
  static constexpr char digits[] = "0123456789abcdef";
  std::string text;
  for (const std::uint8_t octet : octets) {
    text += digits[octet >> 4];
    text += digits[octet & 15];
  }
  return text;
}

}  // namespace srfs::conformance
