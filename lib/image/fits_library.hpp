// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace srfs::image {

/// A function of the library around cfitsio, or why there is none. cfitsio brings GnuTLS, Kerberos and LDAP
/// into a process: its library is loaded when a file needs it, once.
struct FitsFunction {
  void* address = nullptr;
  std::string problem;
};
[[nodiscard]] FitsFunction fits_function(const char* name);

}  // namespace srfs::image
