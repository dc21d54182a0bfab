// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "msgs/mission/dictionary.hpp"

namespace srfs::mission {

/// A dictionary as octets that are read some twenty times as fast as its files. Their layout is that of this
/// build of the library alone: for caches that know what they were made of and by whom, never for exchange.
[[nodiscard]] Octets image_of(Dictionary& dictionary);
/// nullopt: not such an image. Octets that were altered may give any dictionary: a digest guards them.
[[nodiscard]] std::optional<Dictionary> dictionary_of(OctetView image);

}  // namespace srfs::mission
