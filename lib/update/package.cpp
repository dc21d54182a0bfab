// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "update/package.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <memory>
#include <set>

#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/evp.h>
#include <sys/stat.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include "base/fd.hpp"
#include "base/sha256.hpp"
#include "base/text.hpp"
#include "update/deflate.hpp"
#include "update/json_line.hpp"
#include "update/version_table.hpp"

namespace srfs::update {
namespace {

using Json = nlohmann::ordered_json;
using Key = std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)>;
using Context = std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)>;

constexpr std::string_view magic = "SRFSNODE";
constexpr std::uint16_t plain_format = 1;
constexpr std::uint16_t compressed_format = 2;
constexpr std::string_view plain_manifest = "srfs node package 1";
constexpr std::string_view compressed_manifest = "srfs node package 2";
constexpr std::string_view tag("SRFS-NODE-V1\0", 13);
constexpr std::size_t longest_name = 32;
constexpr std::size_t largest_entry = 4096;
constexpr std::size_t longest_key_told = 40;
constexpr int deepest_nesting = 16;
constexpr seconds longest_self_test{60};
constexpr std::uint64_t longest_slot_ms = 60'000;

/// What is signed: the tag keeps the signature from meaning anything elsewhere.
Octets signed_octets(OctetView content) {
  Octets message(tag.begin(), tag.end());
  const auto digest = sha256_of(content);
  message.insert(message.end(), digest.begin(), digest.end());
  return message;
}

tl::unexpected<PackageFailure> refuse(PackageRefusal refusal, std::string detail = {}) {
  return Err(PackageFailure{refusal, std::move(detail)});
}

bool is_hash(std::string_view text) {
  return text.size() == 64 && text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

bool is_node_name(std::string_view name) {
  return !name.empty() && name.size() <= longest_name && name[0] >= 'a' && name[0] <= 'z' &&
         name.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_") == std::string_view::npos;
}

/// Plain relative parts, so that no name leaves the folder, hides, or is taken for an option.
bool is_plain_path(std::string_view path) {
  if (path.empty() || path.size() > PackageLimits::path_octets) return false;
  constexpr std::string_view allowed = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.-/";
  if (path.find_first_not_of(allowed) != std::string_view::npos) return false;
  std::size_t parts = 0;
  while (true) {
    const std::size_t end = std::min(path.find('/'), path.size());
    const std::string_view part = path.substr(0, end);
    if (part.empty() || part[0] == '.' || part[0] == '-' || ++parts > PackageLimits::path_parts) return false;
    if (end == path.size()) return true;
    path.remove_prefix(end + 1);
  }
}

/// No name twice, none a file here and a folder there.
std::optional<std::string> conflict(const std::vector<PackageFile>& files) {
  std::set<std::string, std::less<>> names;
  for (const PackageFile& file : files) {
    if (!names.insert(file.path).second) return file.path;
  }
  for (const PackageFile& file : files) {
    for (std::size_t at = file.path.find('/'); at != std::string::npos; at = file.path.find('/', at + 1)) {
      if (names.contains(std::string_view(file.path).substr(0, at))) return file.path;
    }
  }
  return std::nullopt;
}

/// Watches the parser: nesting is bounded, and a key stands once in its object. Readers of JSON differ in
/// which of two they take, so two programs would see two manifests under one signature.
class StrictParsing {
 public:
  /// @return whether the parser keeps the value
  bool on_event(int depth, Json::parse_event_t event, const Json& parsed) {
    too_deep_ = too_deep_ || depth > deepest_nesting;
    if (too_deep_) return false;
    if (event == Json::parse_event_t::object_start) open_.emplace_back();
    if (event == Json::parse_event_t::object_end) open_.pop_back();
    if (event == Json::parse_event_t::key && !open_.back().insert(parsed.get<std::string>()).second)
      repeated_key_ = parsed.get<std::string>();
    return true;
  }
  [[nodiscard]] bool too_deep() const { return too_deep_; }
  [[nodiscard]] const std::optional<std::string>& repeated_key() const { return repeated_key_; }

 private:
  std::vector<std::set<std::string>> open_;  ///< keys of the objects around
  bool too_deep_ = false;
  std::optional<std::string> repeated_key_;
};

/// Takes the fields of an object one after the other; a field not taken is unknown.
class Fields {
 public:
  explicit Fields(const Json& json) : json_(json) {}

  [[nodiscard]] const Json* take(const char* name) {
    const auto found = json_.find(name);
    if (found == json_.end()) return nullptr;
    ++taken_;
    return &*found;
  }
  [[nodiscard]] std::optional<std::string> text(const char* name) {
    const Json* value = take(name);
    return value != nullptr && value->is_string() ? std::optional(value->get<std::string>()) : std::nullopt;
  }
  [[nodiscard]] std::optional<std::uint64_t> number(const char* name) {
    const Json* value = take(name);
    return value != nullptr && value->is_number_unsigned() ? std::optional(value->get<std::uint64_t>())
                                                           : std::nullopt;
  }
  [[nodiscard]] bool has(const char* name) const { return json_.contains(name); }
  [[nodiscard]] bool all_taken() const { return taken_ == json_.size(); }

 private:
  const Json& json_;
  std::size_t taken_ = 0;
};

Result<PackageFile, PackageFailure> decode_file(const Json& json) {
  if (!json.is_object()) return refuse(PackageRefusal::bad_manifest, "files");
  Fields fields(json);
  const auto path = fields.text("path");
  if (!path) return refuse(PackageRefusal::bad_manifest, "files: path");
  const std::string shown = path->substr(0, PackageLimits::path_octets);
  if (fields.has("type") && fields.text("type") != "file") return refuse(PackageRefusal::link, shown);
  if (!is_plain_path(*path)) return refuse(PackageRefusal::bad_path, shown);
  const auto octets = fields.number("octets");
  const auto sha256 = fields.text("sha256");
  if (!octets || !sha256 || !is_hash(*sha256) || !fields.all_taken())
    return refuse(PackageRefusal::bad_manifest, "files: " + shown);
  if (*octets > PackageLimits::file_octets) return refuse(PackageRefusal::too_large, shown);
  return PackageFile{*path, *octets, *sha256};
}

std::optional<PackageFailure> decode_files(const Json* list, std::vector<PackageFile>& files) {
  if (list == nullptr || !list->is_array() || list->empty())
    return PackageFailure{PackageRefusal::bad_manifest, "files"};
  if (list->size() > PackageLimits::files)
    return PackageFailure{PackageRefusal::too_many_files, std::to_string(list->size())};
  std::uint64_t total = 0;
  for (const Json& entry : *list) {
    auto file = decode_file(entry);
    if (!file) return file.error();
    total += file->octets;
    files.push_back(std::move(*file));
  }
  if (total > PackageLimits::package_octets)
    return PackageFailure{PackageRefusal::too_large, fmt::format("{} octets of files", total)};
  if (auto path = conflict(files)) return PackageFailure{PackageRefusal::bad_path, *path};
  return std::nullopt;
}

std::optional<PackageFailure> decode_options(const Json* list, std::vector<std::string>& options) {
  if (list == nullptr || !list->is_array()) return PackageFailure{PackageRefusal::bad_manifest, "options"};
  const auto& allowed = allowed_options();
  for (const Json& entry : *list) {
    const std::string option = entry.is_string() ? entry.get<std::string>() : "";
    if (std::find(allowed.begin(), allowed.end(), option) == allowed.end())
      return PackageFailure{PackageRefusal::bad_option, option.substr(0, 40)};
    if (std::find(options.begin(), options.end(), option) == options.end()) options.push_back(option);
  }
  return std::nullopt;
}

std::optional<SlotRequest> decode_slot(const Json& json) {
  if (!json.is_object()) return std::nullopt;
  Fields fields(json);
  SlotRequest slot;
  if (fields.has("payload")) {
    slot.payload = fields.text("payload");
    if (!slot.payload || !is_node_name(*slot.payload)) return std::nullopt;
  }
  const auto duration = [&](const char* name, std::uint64_t least) -> std::optional<milliseconds> {
    const auto value = fields.number(name);
    if (!value || *value < least || *value > longest_slot_ms) return std::nullopt;
    return milliseconds(*value);
  };
  const auto allotted = duration("allotted_ms", 1);
  const auto overrun = duration("overrun_ms", 0);
  const auto reset = duration("reset_ms", 1);
  slot.after = fields.text("after").value_or("");
  if (!allotted || !overrun || !reset || !is_node_name(slot.after) || !fields.all_taken())
    return std::nullopt;
  slot.allotted = *allotted;
  slot.overrun = *overrun;
  slot.reset = *reset;
  return slot;
}

Json encode(const SlotRequest& slot) {
  Json json = Json::object();
  if (slot.payload) json["payload"] = *slot.payload;
  json["allotted_ms"] = slot.allotted.count();
  json["overrun_ms"] = slot.overrun.count();
  json["reset_ms"] = slot.reset.count();
  json["after"] = slot.after;
  return json;
}

/// What may stand there or not.
std::optional<PackageFailure> decode_optional(Fields& fields, Manifest& manifest) {
  const auto bad = [](const char* field) { return PackageFailure{PackageRefusal::bad_manifest, field}; };
  if (fields.has("binary_sha256")) {
    manifest.binary_sha256 = fields.text("binary_sha256").value_or("");
    if (!is_hash(*manifest.binary_sha256)) return bad("binary_sha256");
  }
  if (fields.has("ring_after")) {
    manifest.ring_after = fields.text("ring_after").value_or("");
    if (!is_node_name(*manifest.ring_after)) return bad("ring_after");
  }
  if (const Json* entry = fields.take("deployment")) {
    manifest.deployment = entry->dump(-1, ' ', false, Json::error_handler_t::replace);
    if (!entry->is_object() || manifest.deployment->size() > largest_entry) return bad("deployment");
  }
  if ((manifest.kind == PackageKind::add) != manifest.deployment.has_value()) return bad("deployment");
  if (fields.has("dictionary")) {
    manifest.dictionary = fields.text("dictionary").value_or("");
    const bool is_there = std::ranges::any_of(
        manifest.files, [&](const PackageFile& file) { return file.path == *manifest.dictionary; });
    if (!is_there) return bad("dictionary");
  }
  if (const Json* slot = fields.take("slot")) {
    manifest.slot = decode_slot(*slot);
    if (!manifest.slot) return bad("slot");
  }
  return std::nullopt;
}

Result<PackageStream, PackageFailure> decode_stream(const Json* json) {
  if (json == nullptr || !json->is_object()) return refuse(PackageRefusal::bad_manifest, "stream");
  Fields fields(*json);
  const auto octets = fields.number("octets");
  const auto sha256 = fields.text("sha256");
  if (!octets || !sha256 || !is_hash(*sha256) || !fields.all_taken())
    return refuse(PackageRefusal::bad_manifest, "stream");
  if (*octets > PackageLimits::package_octets) return refuse(PackageRefusal::too_large, "stream");
  return PackageStream{*octets, *sha256};
}

std::string_view to_text(DeflateError error) {
  switch (error) {
    case DeflateError::damaged:
      return "incomplete DEFLATE stream";
    case DeflateError::too_long:
      return "it expands to more octets than the files have";
    case DeflateError::too_short:
      return "it expands to fewer octets than the files have";
    case DeflateError::trailing:
      return "octets after its end";
  }
  return "?";
}

/// The files' octets, one behind the other. The memory is bounded: decode_files() has bounded the sum.
Result<Octets, PackageFailure> expand_files(const Manifest& manifest, OctetView rest) {
  if (rest.size() != manifest.stream->octets)
    return refuse(PackageRefusal::wrong_size,
                  fmt::format("stream: {} octets instead of {}", rest.size(), manifest.stream->octets));
  if (to_digits(sha256_of(rest)) != manifest.stream->sha256)
    return refuse(PackageRefusal::wrong_hash, "stream");
  std::uint64_t total = 0;
  for (const PackageFile& file : manifest.files) total += file.octets;
  auto expanded = expand(rest, static_cast<std::size_t>(total));
  if (!expanded) return refuse(PackageRefusal::bad_stream, std::string(to_text(expanded.error())));
  return std::move(*expanded);
}

Octets joined(const std::vector<Octets>& contents) {
  Octets all;
  for (const Octets& content : contents) all.insert(all.end(), content.begin(), content.end());
  return all;
}

Result<void, FileError> write_new(int folder, const std::string& path, OctetView content,
                                  const std::filesystem::path& shown) {
  const auto failed = [&](const char* what) {
    return Err(FileError{fmt::format("{}: cannot {}: {}", (shown / path).string(), what, errno_text(errno))});
  };
  Fd place(fcntl(folder, F_DUPFD_CLOEXEC, 3));
  std::string_view rest = path;
  for (std::size_t end = rest.find('/'); end != std::string_view::npos; end = rest.find('/')) {
    const std::string part(rest.substr(0, end));
    if (mkdirat(place.get(), part.c_str(), 0755) != 0 && errno != EEXIST) return failed("create");
    Fd next(openat(place.get(), part.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
    if (!next) return failed("open");
    place = std::move(next);
    rest.remove_prefix(end + 1);
  }
  const Fd file(openat(place.get(), std::string(rest).c_str(),
                       O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0644));
  if (!file) return failed("create");
  while (!content.empty()) {
    const ssize_t n = write(file.get(), content.data(), content.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return failed("write");
    content = content.subspan(static_cast<std::size_t>(n));
  }
  return {};
}

}  // namespace

PublicKey public_key_of(const SigningSeed& seed) {
  const Key key(EVP_PKEY_new_raw_private_key(EVP_PKEY_ED25519, nullptr, seed.data(), seed.size()),
                EVP_PKEY_free);
  PublicKey raw{};
  std::size_t size = raw.size();
  // Fails for lack of memory only.
  if (!key || EVP_PKEY_get_raw_public_key(key.get(), raw.data(), &size) != 1) std::abort();
  return raw;
}

Signature sign(OctetView content, const SigningSeed& seed) {
  const Octets message = signed_octets(content);
  const Key key(EVP_PKEY_new_raw_private_key(EVP_PKEY_ED25519, nullptr, seed.data(), seed.size()),
                EVP_PKEY_free);
  const Context context(EVP_MD_CTX_new(), EVP_MD_CTX_free);
  Signature signature{};
  std::size_t size = signature.size();
  if (EVP_DigestSignInit(context.get(), nullptr, nullptr, nullptr, key.get()) != 1 ||
      EVP_DigestSign(context.get(), signature.data(), &size, message.data(), message.size()) != 1)
    std::abort();
  return signature;
}

bool is_signed(OctetView content, const Signature& signature, const PublicKey& key) {
  const Octets message = signed_octets(content);
  const Key raw(EVP_PKEY_new_raw_public_key(EVP_PKEY_ED25519, nullptr, key.data(), key.size()),
                EVP_PKEY_free);
  const Context context(EVP_MD_CTX_new(), EVP_MD_CTX_free);
  return raw && context && EVP_DigestVerifyInit(context.get(), nullptr, nullptr, nullptr, raw.get()) == 1 &&
         EVP_DigestVerify(context.get(), signature.data(), signature.size(), message.data(),
                          message.size()) == 1;
}

std::string_view to_text(PackageRefusal refusal) {
  switch (refusal) {
    case PackageRefusal::too_large:
      return "too large";
    case PackageRefusal::cut_off:
      return "truncated, or not a package";
    case PackageRefusal::unknown_format:
      return "unknown format";
    case PackageRefusal::wrong_key:
      return "signed with another key";
    case PackageRefusal::wrong_signature:
      return "wrong signature";
    case PackageRefusal::bad_manifest:
      return "invalid manifest";
    case PackageRefusal::bad_option:
      return "a build option that is not allowed";
    case PackageRefusal::old_counter:
      return "not newer than the last accepted";
    case PackageRefusal::too_many_files:
      return "too many files";
    case PackageRefusal::bad_path:
      return "a path that is not allowed";
    case PackageRefusal::link:
      return "not an ordinary file";
    case PackageRefusal::wrong_size:
      return "not as long as the manifest says";
    case PackageRefusal::wrong_hash:
      return "a file differs from the signed one";
    case PackageRefusal::bad_stream:
      return "compressed files damaged, or too large";
  }
  return "?";
}

std::string to_text(const PackageFailure& failure) {
  const std::string_view text = to_text(failure.refusal);
  return failure.detail.empty() ? std::string(text) : fmt::format("{}: {}", text, failure.detail);
}

const std::vector<std::string>& allowed_options() {
  static const std::vector<std::string> options{"-O0", "-O1", "-O2", "-O3", "-Os", "-g", "-DNDEBUG"};
  return options;
}

std::string encode(const Manifest& manifest) {
  Json files = Json::array();
  for (const PackageFile& file : manifest.files)
    files.push_back({{"path", file.path}, {"octets", file.octets}, {"sha256", file.sha256}});
  Json json{{"format", manifest.stream ? compressed_manifest : plain_manifest},
            {"node", manifest.node},
            {"kind", manifest.kind == PackageKind::add ? "new" : "replace"},
            {"counter", manifest.counter},
            {"files", files},
            {"options", manifest.options},
            {"self_test_s", manifest.self_test.count()},
            {"probation_s", manifest.probation.count()}};
  if (manifest.stream)
    json["stream"] = {{"octets", manifest.stream->octets}, {"sha256", manifest.stream->sha256}};
  if (manifest.binary_sha256) json["binary_sha256"] = *manifest.binary_sha256;
  if (manifest.ring_after) json["ring_after"] = *manifest.ring_after;
  if (manifest.deployment) json["deployment"] = Json::parse(*manifest.deployment, nullptr, false);
  if (manifest.dictionary) json["dictionary"] = *manifest.dictionary;
  if (manifest.slot) json["slot"] = encode(*manifest.slot);
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

Result<Manifest, PackageFailure> decode_manifest(std::string_view text) {
  if (text.size() > PackageLimits::manifest_octets) return refuse(PackageRefusal::too_large, "manifest");
  StrictParsing strict;
  const auto keep = [&](int depth, Json::parse_event_t event, const Json& parsed) {
    return strict.on_event(depth, event, parsed);
  };
  const Json json = Json::parse(text, keep, false);
  if (!json.is_object() || strict.too_deep())
    return refuse(PackageRefusal::bad_manifest, "not a JSON object");
  if (strict.repeated_key())
    return refuse(PackageRefusal::bad_manifest,
                  fmt::format("{} appears twice", plain_text(*strict.repeated_key(), longest_key_told)));
  Fields fields(json);
  const auto bad = [](const char* field) { return refuse(PackageRefusal::bad_manifest, field); };
  const auto format = fields.text("format");
  if (format != plain_manifest && format != compressed_manifest)
    return refuse(PackageRefusal::unknown_format, "manifest");
  Manifest manifest;
  manifest.node = fields.text("node").value_or("");
  if (!is_node_name(manifest.node)) return bad("node");
  const auto kind = fields.text("kind");
  if (kind != "new" && kind != "replace") return bad("kind");
  manifest.kind = kind == "new" ? PackageKind::add : PackageKind::replace;
  manifest.counter = fields.number("counter").value_or(0);
  if (manifest.counter == 0) return bad("counter");
  if (auto failure = decode_files(fields.take("files"), manifest.files)) return Err(*failure);
  if (auto failure = decode_options(fields.take("options"), manifest.options)) return Err(*failure);
  const auto in_range = [](std::optional<std::uint64_t> value, seconds longest) {
    return value && *value > 0 && *value <= static_cast<std::uint64_t>(longest.count());
  };
  const auto self_test = fields.number("self_test_s");
  if (!in_range(self_test, longest_self_test)) return bad("self_test_s");
  const auto probation = fields.number("probation_s");
  if (!in_range(probation, std::chrono::duration_cast<seconds>(VersionTable::longest_probation)))
    return bad("probation_s");
  manifest.self_test = seconds(*self_test);
  manifest.probation = seconds(*probation);
  if (auto failure = decode_optional(fields, manifest)) return Err(*failure);
  if (format == compressed_manifest) {
    auto stream = decode_stream(fields.take("stream"));
    if (!stream) return Err(stream.error());
    manifest.stream = std::move(*stream);
  }
  if (!fields.all_taken()) return bad("unknown key");
  return manifest;
}

KeyId key_id_of(const PublicKey& key) {
  const auto digest = sha256_of(key);
  KeyId id{};
  std::copy_n(digest.begin(), id.size(), id.begin());
  return id;
}

Octets seal_package(std::uint16_t format, std::string_view manifest, OctetView rest,
                    const SigningSeed& seed) {
  OctetWriter out(1024 + manifest.size() + rest.size());
  out.bytes(as_octets(magic));
  out.u16(format);
  out.bytes(key_id_of(public_key_of(seed)));
  out.u32(static_cast<std::uint32_t>(manifest.size()));
  out.bytes(as_octets(manifest));
  out.bytes(sign(as_octets(manifest), seed));
  out.bytes(rest);
  return out.take();
}

Octets make_package(std::string_view manifest, const std::vector<Octets>& contents, const SigningSeed& seed) {
  return seal_package(plain_format, manifest, joined(contents), seed);
}

Result<Octets, PackageFailure> make_package(Manifest manifest, const std::vector<Octets>& contents,
                                            const SigningSeed& seed) {
  if (contents.size() != manifest.files.size()) return refuse(PackageRefusal::wrong_size, "files");
  for (std::size_t i = 0; i < contents.size(); ++i) {
    manifest.files[i].octets = contents[i].size();
    manifest.files[i].sha256 = to_digits(sha256_of(contents[i]));
  }
  const Octets stream = shrink(joined(contents));
  manifest.stream = PackageStream{stream.size(), to_digits(sha256_of(stream))};
  Octets package = seal_package(compressed_format, encode(manifest), stream, seed);
  const std::uint64_t last = manifest.counter - std::min<std::uint64_t>(manifest.counter, 1);
  const auto verified =
      verify_package(package, public_key_of(seed), [last](std::string_view) { return last; });
  if (!verified) return Err(verified.error());
  return package;
}

Result<PackageParts, PackageFailure> open_package(OctetView package) {
  if (package.size() > PackageLimits::package_octets) return refuse(PackageRefusal::too_large);
  const auto take = [&](std::size_t octets) -> std::optional<OctetView> {
    if (package.size() < octets) return std::nullopt;
    const OctetView taken = package.first(octets);
    package = package.subspan(octets);
    return taken;
  };
  PackageParts parts;
  const auto head = take(magic.size());
  if (!head || as_text(*head) != magic) return refuse(PackageRefusal::cut_off, "head");
  const auto version = take(2);
  if (!version) return refuse(PackageRefusal::cut_off, "head");
  parts.format = static_cast<std::uint16_t>((*version)[0] << 8 | (*version)[1]);
  if (parts.format != plain_format && parts.format != compressed_format)
    return refuse(PackageRefusal::unknown_format);
  const auto id = take(parts.key.size());
  const auto length = take(4);
  if (!id || !length) return refuse(PackageRefusal::cut_off, "head");
  std::size_t manifest_octets = 0;
  for (const std::uint8_t octet : *length) manifest_octets = manifest_octets << 8U | octet;
  if (manifest_octets > PackageLimits::manifest_octets) return refuse(PackageRefusal::too_large, "manifest");
  const auto manifest = take(manifest_octets);
  const auto signature = take(parts.signature.size());
  if (!manifest || !signature) return refuse(PackageRefusal::cut_off, "manifest");
  std::ranges::copy(*id, parts.key.begin());
  std::ranges::copy(*signature, parts.signature.begin());
  parts.manifest = as_text(*manifest);
  parts.rest = package;
  return parts;
}

Result<VerifiedPackage, PackageFailure> verify_package(
    OctetView package, const PublicKey& key,
    const std::function<std::uint64_t(std::string_view node)>& last_counter) {
  const auto parts = open_package(package);
  if (!parts) return Err(parts.error());
  if (parts->key != key_id_of(key)) return refuse(PackageRefusal::wrong_key);
  if (!is_signed(as_octets(parts->manifest), parts->signature, key))
    return refuse(PackageRefusal::wrong_signature);
  auto manifest = decode_manifest(parts->manifest);
  if (!manifest) return Err(manifest.error());
  if (manifest->stream.has_value() != (parts->format == compressed_format))
    return refuse(PackageRefusal::unknown_format, "manifest and header differ");
  const std::uint64_t last = last_counter(manifest->node);
  if (manifest->counter <= last)
    return refuse(PackageRefusal::old_counter, fmt::format("{}, the last was {}", manifest->counter, last));

  VerifiedPackage verified;
  OctetView rest = parts->rest;
  if (manifest->stream) {
    auto expanded = expand_files(*manifest, rest);
    if (!expanded) return Err(expanded.error());
    verified.expanded = std::make_unique<const Octets>(std::move(*expanded));
    rest = *verified.expanded;
  }
  for (const PackageFile& file : manifest->files) {
    if (rest.size() < file.octets) return refuse(PackageRefusal::wrong_size, file.path);
    const OctetView content = rest.first(static_cast<std::size_t>(file.octets));
    rest = rest.subspan(content.size());
    if (to_digits(sha256_of(content)) != file.sha256) return refuse(PackageRefusal::wrong_hash, file.path);
    verified.contents.push_back(content);
  }
  if (!rest.empty()) return refuse(PackageRefusal::wrong_size, fmt::format("{} surplus octets", rest.size()));
  verified.manifest = std::move(*manifest);
  return verified;
}

Result<void, FileError> unpack(const VerifiedPackage& package, const std::filesystem::path& folder) {
  if (mkdir(folder.c_str(), 0755) != 0)
    return Err(FileError{fmt::format("{}: cannot create: {}", folder.string(), errno_text(errno))});
  const Fd root(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
  if (!root) return Err(FileError{fmt::format("{}: cannot open: {}", folder.string(), errno_text(errno))});
  for (std::size_t i = 0; i < package.contents.size(); ++i) {
    auto written = write_new(root.get(), package.manifest.files[i].path, package.contents[i], folder);
    if (!written) return written;
  }
  return {};
}

}  // namespace srfs::update
