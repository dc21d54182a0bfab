// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace srfs::ros {

/// A `wstring` field: UTF-16. On the wire as rmw_fastrtps writes it by Fast CDR 1: the number of units, then
/// four octets for each, without a NUL; that is, as a sequence of uint32.
/// @tparam bound most units; 0: no bound
template <std::size_t bound>
struct WideString : std::u16string {
  using std::u16string::u16string;
  WideString() = default;
  WideString(std::u16string text) : std::u16string(std::move(text)) {}  // as a text is one

  /// What a decoder finds must be units of UTF-16, else it throws.
  template <class Self, class V>
  static void visit(Self& self, V& v) {
    std::vector<std::uint32_t> units(self.begin(), self.end());
    v.sequence(units, bound, 0);
    if constexpr (!std::is_const_v<Self>) {
      self.clear();
      for (const std::uint32_t unit : units) {
        if (unit > 0xffff) throw std::invalid_argument("no unit of UTF-16");
        self.push_back(static_cast<char16_t>(unit));
      }
    }
  }
};

}  // namespace srfs::ros
