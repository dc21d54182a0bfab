// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/fd.hpp"
#include "base/file.hpp"
#include "base/time.hpp"

namespace srfs::update {

/// The disk as a version store sees it: the files of one folder. Every call may block on the disk. What has
/// been written and not synced, and names whose folder has not been synced, may be gone after a power loss.
class VersionFiles {
 public:
  struct Digest {
    std::string sha256;
    std::uint64_t octets = 0;
  };

  VersionFiles() = default;
  VersionFiles(const VersionFiles&) = delete;
  VersionFiles& operator=(const VersionFiles&) = delete;
  virtual ~VersionFiles() = default;

  /// Empty when there is no folder yet.
  [[nodiscard]] virtual std::vector<std::string> names() const = 0;
  [[nodiscard]] virtual Result<std::string, FileError> read(const std::string& name) const = 0;
  [[nodiscard]] virtual Result<Digest, FileError> digest(const std::string& name) const = 0;
  /// The octets are durable on return, the name is not.
  [[nodiscard]] virtual Result<void, FileError> write(const std::string& name, const std::string& text) = 0;
  /// The same with a program from elsewhere; read-only and executable. Refuses more than largest_program.
  [[nodiscard]] virtual Result<Digest, FileError> copy_in(const std::filesystem::path& source,
                                                          const std::string& name) = 0;
  [[nodiscard]] virtual Result<void, FileError> rename(const std::string& from, const std::string& to) = 0;
  [[nodiscard]] virtual Result<void, FileError> remove(const std::string& name) = 0;
  [[nodiscard]] virtual Result<void, FileError> sync_names() = 0;

  static constexpr std::uint64_t largest_program = 256U << 20;
};

class PosixVersionFiles final : public VersionFiles {
 public:
  explicit PosixVersionFiles(std::filesystem::path folder) : folder_(std::move(folder)) {}

  std::vector<std::string> names() const override;
  Result<std::string, FileError> read(const std::string& name) const override;
  Result<Digest, FileError> digest(const std::string& name) const override;
  Result<void, FileError> write(const std::string& name, const std::string& text) override;
  Result<Digest, FileError> copy_in(const std::filesystem::path& source, const std::string& name) override;
  Result<void, FileError> rename(const std::string& from, const std::string& to) override;
  Result<void, FileError> remove(const std::string& name) override;
  Result<void, FileError> sync_names() override;

  /// The right to change the folder, which is made when it is missing; freed with the descriptor.
  [[nodiscard]] Result<Fd, FileError> lock(milliseconds patience);

 private:
  std::filesystem::path folder_;
};

/// SHA-256 and size of a file. Blocks on the disk.
[[nodiscard]] Result<VersionFiles::Digest, FileError> digest_of(const std::filesystem::path& file);

}  // namespace srfs::update
