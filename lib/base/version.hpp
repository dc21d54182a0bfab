// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace srfs {

/// Of the suite, as --version of its programs prints it: "0.2.0".
[[nodiscard]] const char* version();

}  // namespace srfs
