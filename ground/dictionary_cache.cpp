// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/dictionary_cache.hpp"

#include <algorithm>
#include <string_view>

#include <dlfcn.h>
#include <sys/stat.h>

#include "base/config.hpp"
#include "base/file.hpp"
#include "base/version.hpp"
#include "msgs/mission/dictionary_image.hpp"

namespace srfs::ground {
namespace {

OctetView octets_of(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

/// With its length, so that no two lists of parts give the same octets.
void add(Sha256& digest, std::string_view part) {
  digest.update(octets_of(std::to_string(part.size()) + ":"));
  digest.update(octets_of(part));
}

/// What reads the files: another build may read them otherwise, and lays an image out otherwise.
std::string reader() {
  Dl_info self{};
  struct stat library {};
  if (dladdr(reinterpret_cast<const void*>(&mission::dictionary_of), &self) == 0 ||
      self.dli_fname == nullptr || ::stat(self.dli_fname, &library) != 0)
    return "";
  return std::string(version()) + " " + std::to_string(library.st_size) + " " +
         std::to_string(library.st_mtim.tv_sec) + "." + std::to_string(library.st_mtim.tv_nsec);
}

std::optional<Sha256::Digest> digest_of(const std::filesystem::path& dictionary,
                                        const std::vector<mission::Fragment>& fragments) {
  Sha256 digest;
  const std::string by = reader();
  if (by.empty()) return std::nullopt;
  add(digest, by);
  try {
    for (const auto& file : mission::Dictionary::files(dictionary)) {
      const auto text = read_file(file);
      if (!text) return std::nullopt;
      add(digest, file.string());
      add(digest, *text);
    }
  } catch (const ConfigError&) {
    return std::nullopt;  // its loader says what is wrong
  }
  for (const mission::Fragment& fragment : fragments) {
    add(digest, fragment.name);
    add(digest, fragment.text);
  }
  return digest.finish();
}

}  // namespace

DictionaryCache::DictionaryCache(std::filesystem::path file, const std::filesystem::path& dictionary,
                                 const std::vector<mission::Fragment>& fragments)
    : file_(std::move(file)), sources_(digest_of(dictionary, fragments)) {}

// The file: digest of the sources, digest of the image, image.
std::optional<mission::Dictionary> DictionaryCache::load() const {
  constexpr std::size_t digest_octets = Sha256::Digest().size();
  const auto text = sources_ ? read_file(file_, octets_max) : Err(FileError{});
  if (!text || text->size() < 2 * digest_octets) return std::nullopt;
  const OctetView octets = octets_of(*text);
  const OctetView image = octets.subspan(2 * digest_octets);
  const auto found = octets.first(digest_octets);
  if (!std::equal(found.begin(), found.end(), sources_->begin())) return std::nullopt;
  const auto whole = octets.subspan(digest_octets, digest_octets);
  if (!std::ranges::equal(whole, sha256_of(image))) return std::nullopt;
  return mission::dictionary_of(image);
}

void DictionaryCache::keep(mission::Dictionary& dictionary) const {
  std::error_code error;
  if (!sources_ || !std::filesystem::is_directory(file_.parent_path(), error)) return;
  const Octets image = mission::image_of(dictionary);
  const Sha256::Digest whole = sha256_of(image);
  std::string text;
  for (const OctetView part : {OctetView(*sources_), OctetView(whole), OctetView(image)})
    text.append(reinterpret_cast<const char*>(part.data()), part.size());
  static_cast<void>(write_file_atomically(file_, text));
}

}  // namespace srfs::ground
