// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "update/golden_manifest.hpp"

#include <algorithm>
#include <array>

#include "base/sha256.hpp"
#include "base/text.hpp"
#include "update/build_id.hpp"
#include "update/json_line.hpp"

namespace srfs::update {
namespace {

constexpr std::array kind_names{"program", "version", "text"};
constexpr std::string_view format_name = "srfs golden 1";
constexpr std::size_t build_digits = 16;

auto place(std::vector<GoldenFile>& files, std::string_view path) {
  return std::lower_bound(files.begin(), files.end(), path,
                          [](const GoldenFile& file, std::string_view p) { return file.path < p; });
}

/// Throws Json::exception.
std::optional<GoldenFile> file_of(const Json& json) {
  GoldenFile file;
  const auto kind = std::find(kind_names.begin(), kind_names.end(), json.at("kind").get<std::string>());
  if (kind == kind_names.end()) return std::nullopt;
  file.kind = static_cast<ScrubKind>(kind - kind_names.begin());
  file.path = json.at("path").get<std::string>();
  file.sha256 = json.at("sha256").get<std::string>();
  file.octets = json.at("octets").get<std::uint64_t>();
  file.modified_ns = json.at("modified_ns").get<std::int64_t>();
  file.mode = json.at("mode").get<std::uint32_t>();
  file.build_id = json.at("build_id").get<std::string>();
  return file;
}

}  // namespace

ScrubVerdict judge(const GoldenFile& golden, const std::optional<FoundFile>& found) {
  if (!found) return ScrubVerdict::damaged;
  if (found->sha256 == golden.sha256) return ScrubVerdict::good;
  if (golden.kind == ScrubKind::version) return ScrubVerdict::damaged;
  if (!found->settled) return ScrubVerdict::unsettled;
  if (found->octets == 0) return ScrubVerdict::damaged;
  const bool written = golden.kind == ScrubKind::program && !golden.build_id.empty()
                           ? is_another_build(golden.build_id, found->build_id)
                           : found->modified_ns != golden.modified_ns;
  return written ? ScrubVerdict::changed : ScrubVerdict::damaged;
}

const GoldenFile* GoldenManifest::find(std::string_view path) const {
  const auto found = place(const_cast<std::vector<GoldenFile>&>(files), path);
  return found != files.end() && found->path == path ? &*found : nullptr;
}

void GoldenManifest::put(GoldenFile file) {
  const auto found = place(files, file.path);
  if (found != files.end() && found->path == file.path) {
    *found = std::move(file);
  } else {
    files.insert(found, std::move(file));
  }
}

std::string GoldenManifest::build() const {
  std::string ids;
  for (const GoldenFile& file : files) {
    if (file.kind == ScrubKind::program && !file.build_id.empty()) ids += file.build_id + "\n";
  }
  if (ids.empty()) return {};
  return to_digits(sha256_of(as_octets(ids))).substr(0, build_digits);
}

std::string encode(const GoldenManifest& manifest) {
  Json files = Json::array();
  for (const GoldenFile& file : manifest.files) {
    files.push_back({{"path", file.path},
                     {"kind", kind_names.at(static_cast<std::size_t>(file.kind))},
                     {"sha256", file.sha256},
                     {"octets", file.octets},
                     {"modified_ns", file.modified_ns},
                     {"mode", file.mode},
                     {"build_id", file.build_id}});
  }
  return to_checked_line({{"format", format_name}, {"revision", manifest.revision}, {"files", files}});
}

std::optional<GoldenManifest> decode_golden(std::string_view text) {
  const auto read = from_checked_line(text);
  if (!read) return std::nullopt;
  const Json& json = *read;
  GoldenManifest manifest;
  try {
    if (json.at("format").get<std::string>() != format_name) return std::nullopt;
    manifest.revision = json.at("revision").get<std::uint64_t>();
    const Json& files = json.at("files");
    if (!files.is_array() || files.size() > GoldenManifest::most_files) return std::nullopt;
    for (const Json& entry : files) {
      auto file = file_of(entry);
      if (!file) return std::nullopt;
      manifest.put(std::move(*file));
    }
  } catch (const Json::exception&) {
    return std::nullopt;
  }
  return manifest;
}

}  // namespace srfs::update
