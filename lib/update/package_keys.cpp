// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "update/package_keys.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdlib>

#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/crypto.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/fd.hpp"
#include "base/known_key.hpp"
#include "base/random_octets.hpp"

namespace srfs::update {
namespace {

constexpr std::size_t key_octets = 32;
using Raw = std::array<std::uint8_t, key_octets>;

tl::unexpected<FileError> problem(const std::filesystem::path& file, std::string_view what) {
  return Err(FileError{fmt::format("{}: {}", file.string(), what)});
}

Result<Raw, FileError> load(const std::filesystem::path& file) {
  auto text = read_file(file, 4096);
  if (!text) return Err(text.error());
  while (!text->empty() && (text->back() == '\n' || text->back() == '\r' || text->back() == ' '))
    text->pop_back();
  auto octets = from_hex(*text);
  OPENSSL_cleanse(text->data(), text->size());
  if (!octets || octets->size() != key_octets) return problem(file, "expected 64 hexadecimal digits");
  Raw raw{};
  std::copy(octets->begin(), octets->end(), raw.begin());
  OPENSSL_cleanse(octets->data(), octets->size());
  return raw;
}

Result<void, FileError> save_new(const std::filesystem::path& file, const Raw& raw, mode_t mode) {
  const Fd fd(open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, mode));
  if (!fd)
    return problem(file, errno == EEXIST ? "exists already; a key is never replaced"
                                         : "cannot create: " + errno_text(errno));
  std::string text = to_hex(raw) + '\n';
  const bool written =
      write(fd.get(), text.data(), text.size()) == static_cast<ssize_t>(text.size()) && fsync(fd.get()) == 0;
  const int error = errno;
  OPENSSL_cleanse(text.data(), text.size());
  if (written) return {};
  unlink(file.c_str());
  return problem(file, "cannot write: " + errno_text(error));
}

}  // namespace

Result<SigningSeed, FileError> load_seed(const std::filesystem::path& file) {
  struct stat info {};
  if (stat(file.c_str(), &info) != 0) return problem(file, "cannot read: " + errno_text(errno));
  if (!S_ISREG(info.st_mode)) return problem(file, "expected a regular file");
  if ((info.st_mode & 077U) != 0)
    return problem(file, fmt::format("expected mode 0600, others may not read a signing key (mode is {:04o})",
                                     info.st_mode & 07777U));
  return load(file);
}

Result<PublicKey, FileError> load_public_key(const std::filesystem::path& file) {
  auto key = load(file);
  if (!key) return key;
  if (const auto known = why_known(*key))
    return problem(file, fmt::format("anyone could sign packages for this key: {}", *known));
  return key;
}

Result<void, FileError> save_new_seed(const std::filesystem::path& file, const SigningSeed& seed) {
  return save_new(file, seed, 0600);
}

Result<void, FileError> save_new_public_key(const std::filesystem::path& file, const PublicKey& key) {
  return save_new(file, key, 0644);
}

SigningSeed new_seed() {
  SigningSeed seed{};
  if (!fill_random(seed)) std::abort();
  return seed;
}

}  // namespace srfs::update
