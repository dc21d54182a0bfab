#pragma once

namespace srfs::testing_support {

/// Whether this is a build under AddressSanitizer or ThreadSanitizer: several times slower, and with
/// terabytes of shadow memory.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool sanitized = true;
#else
constexpr bool sanitized = false;
#endif

}  // namespace srfs::testing_support
