// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>

#include "base/fd.hpp"
#include "nodes/ttc/command/journal_log.hpp"

namespace srfs {

/// The segments of a journal as two files `<path>.0` and `<path>.1` of fixed size: written in place, so that
/// a sync has no metadata to write and a full disk changes nothing for a journal that exists.
class JournalFile final : public JournalMedium {
 public:
  explicit JournalFile(std::filesystem::path path) : path_(std::move(path)) {}

  [[nodiscard]] Octets read(unsigned segment) override;
  Result<void, FileError> write(unsigned segment, std::size_t offset, OctetView octets) override;
  Result<void, FileError> sync(unsigned segment) override;

 private:
  [[nodiscard]] std::filesystem::path path_of(unsigned segment) const;
  Result<void, FileError> open_file(unsigned segment);
  FileError fail(unsigned segment, const char* what, int error);

  std::filesystem::path path_;
  std::array<Fd, segments> files_;
};

}  // namespace srfs
