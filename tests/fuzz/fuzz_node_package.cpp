// A package of sources as it comes from the line; and one whose manifest is signed, whatever stands in it.
#include <algorithm>
#include <cstdlib>

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
      // Two dots inside a part are no way out; a part that begins with one is refused.
      if (path.starts_with('.') || path.starts_with('/') || path.find("/.") != std::string::npos)
        std::abort();
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const OctetView rest(data + 1, size - 1);
  if (data[0] == 0) {
    check(rest);
    return 0;
  }
  // A manifest, a zero, what stands for the files.
  const auto end = std::find(rest.begin(), rest.end(), 0);
  const std::string manifest(rest.begin(), end);
  const Octets files(end == rest.end() ? end : end + 1, rest.end());
  const auto decoded = decode_manifest(manifest);
  if (decoded && decode_manifest(encode(*decoded)) != *decoded) std::abort();
  check(make_package(manifest, {files}, seed));
  return 0;
}
