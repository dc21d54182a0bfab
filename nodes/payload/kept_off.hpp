// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "base/time.hpp"

namespace srfs {

/// What state/<payload>/peripheral_kept_off says: until when, on the clock of this boot. Pure.
[[nodiscard]] std::string kept_off_text(MonotonicTime until, std::string_view boot_id);

/// When the peripheral is tried again; nullopt: not kept off, for @p text is of another boot (whose power
/// cycle was the peripheral's, too) or cannot be read.
[[nodiscard]] std::optional<MonotonicTime> kept_off_until(std::string_view text, std::string_view boot_id);

}  // namespace srfs
