// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// A package of sources as received from the line; a package with an arbitrary but signed manifest; a stream
// of compressed files; and a package with a signed hash.
#include <algorithm>
#include <cstdlib>

#include "base/sha256.hpp"
#include "update/deflate.hpp"
#include "update/package.hpp"

namespace {

using namespace srfs;
using namespace srfs::update;

constexpr SigningSeed seed{1};

void check(OctetView package) {
  static const PublicKey key = public_key_of(seed);
  const auto verified = verify_package(package, key, [](std::string_view) { return 5U; });
  if (!verified) return;
  const Manifest& manifest = verified->manifest;
  if (manifest.files.size() != verified->contents.size() || manifest.counter <= 5) std::abort();
  for (std::size_t i = 0; i < manifest.files.size(); ++i) {
    const std::string& path = manifest.files[i].path;
    if (verified->contents[i].size() != manifest.files[i].octets) std::abort();
    if (path.starts_with('/') || path.find("..") != std::string::npos) {
      // Two dots inside a path component do not leave the folder; a component that begins with a dot is
      // refused.
      if (path.starts_with('.') || path.starts_with('/') || path.find("/.") != std::string::npos)
        std::abort();
    }
  }
}

/// Input: a manifest, a zero octet, and the octets of the files.
void check_manifest(OctetView rest) {
  const auto end = std::find(rest.begin(), rest.end(), 0);
  const std::string manifest(rest.begin(), end);
  const Octets files(end == rest.end() ? end : end + 1, rest.end());
  const auto decoded = decode_manifest(manifest);
  if (decoded && decode_manifest(encode(*decoded)) != *decoded) std::abort();
  check(make_package(manifest, {files}, seed));
  check(seal_package(2, manifest, files, seed));
}

/// Input: two octets with the expected size, then the stream.
void check_stream(OctetView rest) {
  if (rest.size() < 2) return;
  const std::size_t octets = static_cast<std::size_t>(rest[0]) << 8U | rest[1];
  const OctetView stream = rest.subspan(2);
  const auto expanded = expand(stream, octets);
  if (expanded && expanded->size() != octets) std::abort();
  if (expanded && expand(shrink(*expanded), octets) != *expanded) std::abort();

  Manifest manifest{.node = "payload_eps", .counter = 6};
  manifest.files = {{.path = "main.cpp",
                     .octets = octets,
                     .sha256 = to_digits(expanded ? sha256_of(*expanded) : sha256_of(stream))}};
  manifest.stream = PackageStream{stream.size(), to_digits(sha256_of(stream))};
  const Octets package = seal_package(2, encode(manifest), stream, seed);
  const auto verified = verify_package(package, public_key_of(seed), [](std::string_view) { return 5U; });
  if (verified.has_value() != expanded.has_value()) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const OctetView rest(data + 1, size - 1);
  if (data[0] == 0) {
    check(rest);
  } else if (data[0] == 2) {
    check_stream(rest);
  } else {
    check_manifest(rest);
  }
  return 0;
}
