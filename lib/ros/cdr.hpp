// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include <fastcdr/Cdr.h>

namespace srfs::ros {

/// A value that its type's bounds forbid, or octets that are no such value. Never leaves this layer.
class CdrError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

template <class T>
inline constexpr bool is_wire_primitive = std::is_arithmetic_v<T>;

/// Largest payload we take or send, octets: a 16 MiB image and its header. Guards every allocation from the
/// wire.
inline constexpr std::size_t largest_payload = (16U << 20) + 4096;

/// Octets a value takes in XCDR1 (OMG DDS-XTypes 1.3, 7.4.1), from an 8-aligned origin after the
/// encapsulation header.
class CdrSizer {
 public:
  template <class T>
  void value(const T& v) {
    if constexpr (is_wire_primitive<T>) {
      primitive(sizeof(T), 1);
    } else {
      T::visit(v, *this);
    }
  }
  void string(const std::string& v, std::size_t) {
    primitive(4, 1);
    size_ += v.size() + 1;
  }
  template <class T>
  void sequence(const std::vector<T>& v, std::size_t, std::size_t string_bound) {
    primitive(4, 1);
    elements(v, string_bound);
  }
  template <class T, std::size_t N>
  void array(const std::array<T, N>& v) {
    elements(v, 0);
  }
  void empty_struct() { size_ += 1; }
  [[nodiscard]] std::size_t size() const { return size_; }

 private:
  void primitive(std::size_t width, std::size_t count) {
    if (count == 0) return;
    size_ = (size_ + width - 1) / width * width + width * count;
  }
  template <class C>
  void elements(const C& v, std::size_t string_bound) {
    using T = typename C::value_type;
    if constexpr (std::is_same_v<T, std::string>) {
      for (const auto& item : v) string(item, string_bound);
    } else if constexpr (is_wire_primitive<T>) {
      primitive(sizeof(T), v.size());
    } else {
      for (const auto& item : v) value(item);
    }
  }
  std::size_t size_ = 0;
};

/// Most octets of a sample of a type without bounds of its own: no sample of ours comes near.
inline constexpr std::size_t largest_unbounded_payload = 1U << 20;

/// The most octets that a value of a type can take, from the bounds of its strings and sequences. Padding is
/// counted at its most, so it is never too few.
class CdrBound {
 public:
  template <class T>
  void value(const T& v) {
    if constexpr (is_wire_primitive<T>) {
      size_ += 2 * sizeof(T) - 1;
    } else {
      T::visit(v, *this);
    }
  }
  void string(const std::string&, std::size_t bound) { add(7 + 1, bound, 1); }
  template <class T>
  void sequence(const std::vector<T>&, std::size_t bound, std::size_t string_bound) {
    add(7, bound, of_element<T>(string_bound));
  }
  template <class T, std::size_t N>
  void array(const std::array<T, N>&) {
    add(0, N, of_element<T>(0));
  }
  void empty_struct() { size_ += 1; }
  /// Of the value alone; nullopt: a string or a sequence in it has no bound.
  [[nodiscard]] std::optional<std::size_t> size() const {
    return bounded_ ? std::optional(size_) : std::nullopt;
  }

 private:
  template <class T>
  std::size_t of_element(std::size_t string_bound) {
    CdrBound element;
    if constexpr (std::is_same_v<T, std::string>) {
      element.string({}, string_bound);
    } else {
      const T item{};
      element.value(item);
    }
    bounded_ = bounded_ && element.bounded_;
    return element.size_;
  }
  void add(std::size_t before, std::size_t count, std::size_t octets) {
    bounded_ = bounded_ && count != 0;
    size_ = std::min(size_ + before + count * octets, largest_payload);
  }
  std::size_t size_ = 0;
  bool bounded_ = true;
};

/// The largest sample of a type that a reader takes when its topic says nothing else.
template <class M>
[[nodiscard]] std::size_t largest_sample() {
  CdrBound bound;
  const M message{};
  M::visit(message, bound);
  return bound.size() ? 8 + *bound.size() : largest_unbounded_payload;
}

/// Writes a value; throws CdrError where a bound of the type is exceeded.
class CdrEncoder {
 public:
  explicit CdrEncoder(eprosima::fastcdr::Cdr& cdr) : cdr_(cdr) {}

  template <class T>
  void value(const T& v) {
    if constexpr (is_wire_primitive<T>) {
      align(sizeof(T));
      cdr_.serialize(v);
    } else {
      T::visit(v, *this);
    }
  }
  void string(const std::string& v, std::size_t bound) {
    if (bound != 0 && v.size() > bound) throw CdrError("string longer than its bound");
    // Not Fast CDR's own way, which ends at the first NUL inside the text.
    align(4);
    cdr_.serialize(static_cast<std::uint32_t>(v.size() + 1));
    cdr_.serializeArray(v.c_str(), v.size() + 1);
  }
  template <class T>
  void sequence(const std::vector<T>& v, std::size_t bound, std::size_t string_bound) {
    if (bound != 0 && v.size() > bound) throw CdrError("sequence longer than its bound");
    align(4);
    cdr_.serialize(static_cast<std::uint32_t>(v.size()));
    if constexpr (std::is_same_v<T, bool>) {
      for (const bool item : v) cdr_.serialize(item);
    } else {
      elements(v, string_bound);
    }
  }
  template <class T, std::size_t N>
  void array(const std::array<T, N>& v) {
    elements(v, 0);
  }
  void empty_struct() { cdr_.serialize(std::uint8_t{0}); }

 private:
  /// Fast CDR skips padding without writing it: what the buffer held before would go out on the wire.
  void align(std::size_t width) {
    constexpr std::size_t encapsulation = 4;
    while ((cdr_.getSerializedDataLength() - encapsulation) % width != 0) cdr_.serialize(std::uint8_t{0});
  }
  template <class C>
  void elements(const C& v, std::size_t string_bound) {
    using T = typename C::value_type;
    if constexpr (std::is_same_v<T, std::string>) {
      for (const auto& item : v) string(item, string_bound);
    } else if constexpr (is_wire_primitive<T>) {
      if (v.empty()) return;
      align(sizeof(T));
      cdr_.serializeArray(v.data(), v.size());
    } else {
      for (const auto& item : v) value(item);
    }
  }
  eprosima::fastcdr::Cdr& cdr_;
};

/// Reads a value from untrusted octets: every length is checked against its bound and against what is left
/// before memory is taken for it. Throws CdrError or a Fast CDR exception.
class CdrDecoder {
 public:
  /// @param size octets behind the encapsulation header's start, as given to the FastBuffer
  CdrDecoder(eprosima::fastcdr::Cdr& cdr, std::size_t size) : cdr_(cdr), size_(size) {}

  template <class T>
  void value(T& v) {
    if constexpr (std::is_same_v<T, bool>) {
      std::uint8_t octet = 0;
      cdr_.deserialize(octet);
      if (octet > 1) throw CdrError("boolean neither 0 nor 1");
      v = octet == 1;
    } else if constexpr (is_wire_primitive<T>) {
      cdr_.deserialize(v);
    } else {
      T::visit(v, *this);
    }
  }
  void string(std::string& v, std::size_t bound) {
    std::uint32_t length = 0;  // counts the final NUL; some writers send 0 for an empty string
    cdr_.deserialize(length);
    if (length > remaining()) throw CdrError("string longer than the sample");
    if (bound != 0 && length > bound + 1) throw CdrError("string longer than its bound");
    v.resize(length);
    if (length == 0) return;
    cdr_.deserializeArray(v.data(), length);
    if (v.back() != '\0') throw CdrError("string without end");
    v.pop_back();
  }
  template <class T>
  void sequence(std::vector<T>& v, std::size_t bound, std::size_t string_bound) {
    std::uint32_t length = 0;
    cdr_.deserialize(length);
    if (bound != 0 && length > bound) throw CdrError("sequence longer than its bound");
    constexpr std::size_t least = is_wire_primitive<T> ? sizeof(T) : std::is_same_v<T, std::string> ? 4 : 1;
    if (length > remaining() / least) throw CdrError("sequence longer than the sample");
    if constexpr (std::is_same_v<T, bool>) {
      v.assign(length, false);
      for (std::size_t i = 0; i < length; ++i) {
        bool item = false;
        value(item);
        v[i] = item;
      }
    } else if constexpr (is_wire_primitive<T>) {
      v.resize(length);
      elements(v, string_bound);
    } else {
      // One by one: a claimed length costs no more memory than the elements that are really there.
      v.clear();
      for (std::size_t i = 0; i < length; ++i) {
        if constexpr (std::is_same_v<T, std::string>) {
          string(v.emplace_back(), string_bound);
        } else {
          value(v.emplace_back());
        }
      }
    }
  }
  template <class T, std::size_t N>
  void array(std::array<T, N>& v) {
    elements(v, 0);
  }
  void empty_struct() {
    std::uint8_t dummy = 0;
    if (remaining() > 0) cdr_.deserialize(dummy);
  }

 private:
  [[nodiscard]] std::size_t remaining() const {
    const std::size_t used = cdr_.getSerializedDataLength();
    return used < size_ ? size_ - used : 0;
  }
  template <class C>
  void elements(C& v, std::size_t string_bound) {
    using T = typename C::value_type;
    if constexpr (std::is_same_v<T, std::string>) {
      for (auto& item : v) string(item, string_bound);
    } else if constexpr (is_wire_primitive<T> && !std::is_same_v<T, bool>) {
      if (!v.empty()) cdr_.deserializeArray(v.data(), v.size());
    } else {
      for (auto& item : v) value(item);
    }
  }
  eprosima::fastcdr::Cdr& cdr_;
  std::size_t size_;
};

}  // namespace srfs::ros
