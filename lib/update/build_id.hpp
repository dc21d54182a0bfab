// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace srfs::update {

/// The linker's build id (note NT_GNU_BUILD_ID) of a 64-bit ELF file, in lower-case digits; empty: no such
/// file, or it has none that can be read. Reads its headers alone. Blocks on the disk.
[[nodiscard]] std::string build_id_of(const std::filesystem::path& file);

/// Two ids of different builds: nearly every octet differs. Damage in the id itself changes a few.
[[nodiscard]] bool is_another_build(std::string_view id, std::string_view other);

}  // namespace srfs::update
