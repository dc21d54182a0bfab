// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/file.hpp"
#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"

namespace srfs::update {

/// A package of sources that becomes a node's program (README.md: its octets). Verified whole before anything
/// of it is written anywhere.
using SigningSeed = std::array<std::uint8_t, 32>;  ///< Ed25519 private key (RFC 8032), on the ground alone
using PublicKey = std::array<std::uint8_t, 32>;
using Signature = std::array<std::uint8_t, 64>;

[[nodiscard]] PublicKey public_key_of(const SigningSeed& seed);
/// Ed25519 over "SRFS-NODE-V1\0" and the SHA-256 of @p content.
[[nodiscard]] Signature sign(OctetView content, const SigningSeed& seed);
[[nodiscard]] bool is_signed(OctetView content, const Signature& signature, const PublicKey& key);

struct PackageLimits {
  static constexpr std::size_t package_octets = 4U << 20;
  static constexpr std::size_t manifest_octets = 64U << 10;
  static constexpr std::size_t files = 256;
  static constexpr std::size_t file_octets = 1U << 20;
  static constexpr std::size_t path_octets = 120;
  static constexpr std::size_t path_parts = 8;
};

enum class PackageRefusal : std::uint8_t {
  too_large,
  cut_off,  ///< shorter than it says, or no package at all
  unknown_format,
  wrong_key,        ///< made for another public key
  wrong_signature,  ///< the manifest is not what was signed
  bad_manifest,     ///< a field is missing, unknown, or out of its range
  bad_option,       ///< a build option that is not allowed
  old_counter,      ///< not above the counter of what was accepted before
  too_many_files,
  bad_path,  ///< absolute, "..", hidden, odd characters, twice, or below another file: would leave its folder
  link,      ///< an entry that is no ordinary file
  wrong_size,  ///< the files are not as long as the manifest says, or octets follow them
  wrong_hash,  ///< a file, or the stream of all, is not what was signed
  bad_stream,  ///< compressed files that are damaged, or more than the manifest says (a bomb)
};
[[nodiscard]] std::string_view to_text(PackageRefusal refusal);

struct PackageFailure {
  PackageRefusal refusal;
  std::string detail;  ///< for people: which field or file
};
/// "a path that is not allowed: ../main.cpp"
[[nodiscard]] std::string to_text(const PackageFailure& failure);

enum class PackageKind : std::uint8_t { replace, add };

struct PackageFile {
  std::string path = {};  ///< relative, of plain parts
  std::uint64_t octets = 0;
  std::string sha256 = {};

  friend bool operator==(const PackageFile&, const PackageFile&) = default;
};

/// The files as they lie in a package of format 2: one DEFLATE stream, signed too, so that nothing made by a
/// stranger is ever expanded.
struct PackageStream {
  std::uint64_t octets = 0;
  std::string sha256;

  friend bool operator==(const PackageStream&, const PackageStream&) = default;
};

/// A place in the CAN plan (launch_config: slots).
struct SlotRequest {
  std::optional<std::string> payload;  ///< nullopt: the package's node
  milliseconds allotted{0};            ///< 1 ms to 60 s
  milliseconds overrun{0};             ///< 0 to 60 s
  milliseconds reset{0};               ///< 1 ms to 60 s
  std::string after;                   ///< the payload whose slot comes before

  friend bool operator==(const SlotRequest&, const SlotRequest&) = default;
};

struct Manifest {
  std::string node = {};
  PackageKind kind = PackageKind::replace;
  std::uint64_t counter = 0;  ///< goes up with each package of the node
  std::vector<PackageFile> files = {};
  std::optional<PackageStream> stream = {};       ///< format 2; nullopt: format 1, the files as they are
  std::vector<std::string> options = {};          ///< of the compiler, of allowed_options()
  std::optional<std::string> binary_sha256 = {};  ///< of what the ground built, to compare
  std::optional<std::string> ring_after = {};     ///< member of the ring that checks a new node
  std::optional<std::string> deployment = {};     ///< entry of a new node, JSON
  std::optional<std::string> dictionary = {};     ///< which of the files is the dictionary's fragment, YAML
  std::optional<SlotRequest> slot = {};
  seconds self_test{10};  ///< deadline
  seconds probation{300};

  friend bool operator==(const Manifest&, const Manifest&) = default;
};
[[nodiscard]] const std::vector<std::string>& allowed_options();

/// JSON, as README.md has it.
[[nodiscard]] std::string encode(const Manifest& manifest);
/// Strict: an unknown key is refused.
[[nodiscard]] Result<Manifest, PackageFailure> decode_manifest(std::string_view json);

/// A package that the ground sends (format 2), verified as on board. @p manifest needs no sizes, hashes and
/// stream: they follow from @p contents, from its files in their order. The same input gives the same octets
/// with the same zlib.
[[nodiscard]] Result<Octets, PackageFailure> make_package(Manifest manifest,
                                                          const std::vector<Octets>& contents,
                                                          const SigningSeed& seed);
/// Format 1, or any other, whatever the manifest says; for tests. @param rest  what follows the signature
[[nodiscard]] Octets make_package(std::string_view manifest, const std::vector<Octets>& contents,
                                  const SigningSeed& seed);
[[nodiscard]] Octets seal_package(std::uint16_t format, std::string_view manifest, OctetView rest,
                                  const SigningSeed& seed);

using KeyId = std::array<std::uint8_t, 8>;
/// Names a key in packages; proves nothing.
[[nodiscard]] KeyId key_id_of(const PublicKey& key);

/// A package opened, nothing of it proven: views into its octets.
struct PackageParts {
  std::uint16_t format = 0;
  KeyId key{};
  std::string_view manifest;
  Signature signature{};
  OctetView rest;  ///< the files, or their stream
};
[[nodiscard]] Result<PackageParts, PackageFailure> open_package(OctetView package);

/// A package that may be unpacked.
struct VerifiedPackage {
  Manifest manifest;
  std::vector<OctetView> contents;  ///< of the manifest's files; into the package's octets, or into expanded
  std::unique_ptr<const Octets> expanded = nullptr;  ///< of format 2
};
/// Signature first, then everything else; what is compressed is expanded last, into as much memory as its
/// signed manifest says, package_octets at most. Pure. @param last_counter  of the node's last accepted
/// package; asked with the signed name
[[nodiscard]] Result<VerifiedPackage, PackageFailure> verify_package(
    OctetView package, const PublicKey& key,
    const std::function<std::uint64_t(std::string_view node)>& last_counter);

/// Writes the files below @p folder, which must not be there. No link is followed and nothing replaced, so
/// nothing outside the folder changes. Blocks on the disk.
[[nodiscard]] Result<void, FileError> unpack(const VerifiedPackage& package,
                                             const std::filesystem::path& folder);

}  // namespace srfs::update
