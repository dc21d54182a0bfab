// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/file/master_store.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>

#include <fmt/format.h>

#include "base/file.hpp"
#include "base/octets.hpp"
#include "base/sha256.hpp"
#include "base/text.hpp"

namespace srfs::image {
namespace {

// A file: the mark, kind (1 octet), width, height, frames, defects (4 each), exposure in seconds, gain,
// temperature in K (8 each, NaN: unknown), the pixels (4 each), SHA-256 of all this (32). Big-endian.
constexpr std::string_view file_mark = "SRFSMST1";
constexpr std::size_t head_octets = 8 + 1 + 4 * 4 + 3 * 8;
constexpr std::size_t digest_octets = 32;
constexpr std::string_view master_suffix = ".master";
constexpr std::string_view temporary_suffix = ".tmp";
constexpr std::size_t file_octets_most = 512U << 20;

struct Head {
  MasterKind kind = MasterKind::dark;
  int frames = 0;
  std::uint32_t defects = 0;
  DetectorSetting setting;
};

double number_of(const std::optional<double>& value) {
  return value.value_or(std::numeric_limits<double>::quiet_NaN());
}

std::optional<double> known(double value) {
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

Octets encode_master(const Master& master) {
  OctetWriter out(file_octets_most);
  out.bytes(as_octets(file_mark));
  out.u8(static_cast<std::uint8_t>(master.kind));
  out.u32(static_cast<std::uint32_t>(master.level.width()));
  out.u32(static_cast<std::uint32_t>(master.level.height()));
  out.u32(static_cast<std::uint32_t>(master.frames));
  out.u32(master.defects);
  out.f64(number_of(master.setting.exposure_s));
  out.f64(number_of(master.setting.gain));
  out.f64(number_of(master.setting.temperature_k));
  for (const float v : master.level.cells()) out.f32(v);
  return out.ok() ? out.take() : Octets();
}

Result<Head, Refusal> decode_head(OctetView octets, MasterKind kind, std::uintmax_t file_octets) {
  if (octets.size() < head_octets) return Err(Refusal{"too short"});
  OctetReader in(octets);
  const OctetView mark = in.bytes(file_mark.size());
  if (as_text(mark) != file_mark || in.u8() != static_cast<std::uint8_t>(kind))
    return Err(Refusal{fmt::format("no {}", to_text(kind))});
  const std::uint32_t width = in.u32();
  const std::uint32_t height = in.u32();
  if (auto why = refuse_size(width, height)) return Err(std::move(*why));
  if (file_octets != head_octets + std::uintmax_t{4} * width * height + digest_octets)
    return Err(Refusal{"wrong length"});
  Head head;
  head.kind = kind;
  head.frames = static_cast<int>(in.u32());
  head.defects = in.u32();
  head.setting = {static_cast<int>(width), static_cast<int>(height), known(in.f64()), {}, {}};
  head.setting.gain = known(in.f64());
  head.setting.temperature_k = known(in.f64());
  return head;
}

struct NoHead {
  bool is_broken;  ///< else the disk did not give it: it may be whole
  std::string reason;
};

Result<Head, NoHead> read_head(const std::filesystem::path& path, MasterKind kind) {
  std::error_code failed;
  const std::uintmax_t size = std::filesystem::file_size(path, failed);
  if (failed) return Err(NoHead{false, failed.message()});
  std::array<char, head_octets> octets{};
  std::ifstream file(path, std::ios::binary);
  file.read(octets.data(), octets.size());
  if (!file.is_open() || file.bad()) return Err(NoHead{false, "cannot be read"});
  auto head = decode_head(as_octets({octets.data(), static_cast<std::size_t>(file.gcount())}), kind, size);
  if (!head) return Err(NoHead{true, std::move(head.error().reason)});
  return *std::move(head);
}

std::string why_unused(const std::filesystem::path& path, const NoHead& no_head) {
  return fmt::format("{} {} ({}) and not used", path.filename().string(),
                     no_head.is_broken ? "is broken" : "cannot be read", no_head.reason);
}

/// @return none where there is no folder
Result<std::vector<std::filesystem::path>, Refusal> entries_of(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> entries;
  std::error_code failed;
  for (std::filesystem::directory_iterator it(folder, failed), end; !failed && it != end;
       it.increment(failed))
    entries.push_back(it->path());
  if (!failed || failed == std::errc::no_such_file_or_directory) return entries;
  return Err(Refusal{fmt::format("{} cannot be read: {}", folder.string(), failed.message())});
}

Result<MasterStore::Read, Refusal> decode_master(OctetView file, MasterKind kind) {
  auto head = decode_head(file, kind, file.size());
  if (!head) return Err(head.error());
  const OctetView content = file.first(file.size() - digest_octets);
  const Sha256::Digest digest = sha256_of(content);
  if (!std::equal(digest.begin(), digest.end(), file.end() - digest_octets)) return Err(Refusal{"checksum"});
  MasterStore::Read read;
  read.sha256 = to_digits(digest);
  read.master = {kind, Plane::unset(head->setting.width, head->setting.height), head->frames, head->defects,
                 head->setting};
  OctetReader in(content.subspan(head_octets));
  for (float& v : read.master.level.cells()) v = in.f32();
  return read;
}

}  // namespace

std::filesystem::path MasterStore::path_of(MasterKind kind, std::uint32_t generation) const {
  return folder_ / fmt::format("{}_{:04}{}", to_text(kind), generation, master_suffix);
}

Result<std::vector<MasterStore::File>, Refusal> MasterStore::files_of(MasterKind kind) const {
  const auto entries = entries_of(folder_);
  if (!entries) return Err(entries.error());
  std::vector<File> files;
  const std::string prefix = fmt::format("{}_", to_text(kind));
  for (const auto& path : *entries) {
    const std::string name = path.filename().string();
    if (!name.starts_with(prefix) || !name.ends_with(master_suffix)) continue;
    const auto number = to_number<std::uint32_t>(
        std::string_view(name).substr(prefix.size(), name.size() - prefix.size() - master_suffix.size()));
    if (number) files.push_back({*number, path});
  }
  std::sort(files.begin(), files.end(),
            [](const File& a, const File& b) { return a.generation > b.generation; });
  return files;
}

MasterStore::Listed MasterStore::list(MasterKind kind) const {
  Listed listed;
  const auto files = files_of(kind);
  if (!files) {
    listed.problems.push_back(fmt::format("no {} is used: {}", to_text(kind), files.error().reason));
    return listed;
  }
  for (const File& file : *files) {
    if (auto head = read_head(file.path, kind))
      listed.masters.push_back({kind, file.generation, head->frames, head->defects, head->setting, {}});
    else
      listed.problems.push_back(why_unused(file.path, head.error()));
  }
  return listed;
}

Result<MasterStore::Read, Refusal> MasterStore::read(const StoredMaster& listed) const {
  const auto path = path_of(listed.kind, listed.generation);
  const auto content = read_file(path, file_octets_most);
  auto read =
      content ? decode_master(as_octets(*content), listed.kind) : Err(Refusal{content.error().message});
  if (read) return read;
  return Err(
      Refusal{fmt::format("{} is broken ({}) and not used", path.filename().string(), read.error().reason)});
}

std::vector<std::string> MasterStore::remove_leftovers() const {
  const auto entries = entries_of(folder_);
  if (!entries) return {entries.error().reason};
  std::vector<std::string> problems;
  for (const auto& path : *entries) {
    if (path.extension() != temporary_suffix) continue;
    if (const auto removed = remove_durably(path); !removed) problems.push_back(removed.error().message);
  }
  return problems;
}

std::vector<std::string> MasterStore::remove_superseded(MasterKind kind) const {
  std::vector<std::string> problems;
  std::vector<DetectorSetting> kept;
  const auto files = files_of(kind);
  if (!files) return {files.error().reason};
  for (const File& file : *files) {
    const auto head = read_head(file.path, kind);
    if (!head && !head.error().is_broken) {
      problems.push_back(why_unused(file.path, head.error()));
      continue;
    }
    const auto is_same = [&](const DetectorSetting& s) { return fits(kind, s, head->setting); };
    if (head && kept.size() < masters_most &&
        static_cast<std::size_t>(std::count_if(kept.begin(), kept.end(), is_same)) < generations_kept) {
      kept.push_back(head->setting);
      continue;
    }
    if (const auto removed = remove_durably(file.path); !removed) problems.push_back(removed.error().message);
  }
  return problems;
}

Result<MasterStore::Saved, Refusal> MasterStore::save(const Master& master) const {
  const auto files = files_of(master.kind);
  if (!files) return Err(files.error());
  if (!files->empty() && files->front().generation == std::numeric_limits<std::uint32_t>::max())
    return Err(Refusal{"no generation is left"});
  const std::uint32_t generation = files->empty() ? 1 : files->front().generation + 1;
  Octets content = encode_master(master);
  if (content.empty()) return Err(Refusal{"too large"});
  const Sha256::Digest digest = sha256_of(content);
  content.insert(content.end(), digest.begin(), digest.end());
  Saved saved{{master.kind, generation, master.frames, master.defects, master.setting, to_digits(digest)},
              remove_leftovers()};
  const auto path = path_of(master.kind, generation);
  if (const auto written = write_file_atomically(path, as_text(content)); !written) {
    // It may be in place all the same, where only the folder could not be written: what the caller is told
    // failed is not used later.
    const auto removed = remove_durably(path);
    return Err(Refusal{removed ? written.error().message
                               : written.error().message + "; " + removed.error().message});
  }
  const std::vector<std::string> superseded = remove_superseded(master.kind);
  saved.problems.insert(saved.problems.end(), superseded.begin(), superseded.end());
  return saved;
}

}  // namespace srfs::image
