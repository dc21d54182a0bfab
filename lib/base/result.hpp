// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tl/expected.hpp>

namespace srfs {

/// An expected failure is a value: either a T or an E that states why not. One error enum (or struct) per
/// class.
template <class T, class E>
using Result = tl::expected<T, E>;

/// The failing half of a Result: `return Err(IsoTpError::timeout);`
template <class E>
[[nodiscard]] constexpr auto Err(E&& error) {
  return tl::unexpected<std::decay_t<E>>(std::forward<E>(error));
}

}  // namespace srfs
