// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/fd.hpp"
#include "base/octets.hpp"
#include "base/result.hpp"

namespace srfs {

/// Why a call failed.
struct SegmentError {
  std::string message;      ///< path, what was tried and the system's reason, ready to print
  bool is_missing = false;  ///< there is no such file, or no folder
};

/// The disk as one packet store sees it: numbered files, of which one is open for writing. All calls may
/// block on the disk. What sync() has returned for survives power loss; of everything written later any part
/// may be missing.
class SegmentFiles {
 public:
  SegmentFiles() = default;
  SegmentFiles(const SegmentFiles&) = delete;
  SegmentFiles& operator=(const SegmentFiles&) = delete;
  virtual ~SegmentFiles() = default;

  /// The numbers that are there, ascending. Makes the folder if it is missing.
  [[nodiscard]] virtual Result<std::vector<std::uint32_t>, SegmentError> list() = 0;
  /// @param octets_max  a longer file is refused
  [[nodiscard]] virtual Result<Octets, SegmentError> read(std::uint32_t number, std::size_t octets_max) = 0;
  [[nodiscard]] virtual bool exists(std::uint32_t number) = 0;
  [[nodiscard]] virtual Result<void, SegmentError> cut(std::uint32_t number, std::size_t octets) = 0;
  [[nodiscard]] virtual Result<void, SegmentError> remove(std::uint32_t number) = 0;

  /// A new file with @p header becomes the open one; its name is durable.
  [[nodiscard]] virtual Result<void, SegmentError> create(std::uint32_t number, OctetView header) = 0;
  [[nodiscard]] virtual Result<void, SegmentError> open(std::uint32_t number) = 0;
  [[nodiscard]] virtual bool is_open() const = 0;
  /// An error where somebody has removed the open file: what is written there is lost.
  [[nodiscard]] virtual Result<void, SegmentError> check_open() = 0;
  /// At @p offset of the open file. On an error the file ends there again.
  [[nodiscard]] virtual Result<void, SegmentError> write(std::size_t offset, OctetView octets) = 0;
  [[nodiscard]] virtual Result<void, SegmentError> sync() = 0;
  virtual void close() = 0;
};

/// `<folder>/<number, 8 hex digits>.seg`.
class PosixSegmentFiles final : public SegmentFiles {
 public:
  explicit PosixSegmentFiles(std::filesystem::path folder) : folder_(std::move(folder)) {}

  Result<std::vector<std::uint32_t>, SegmentError> list() override;
  Result<Octets, SegmentError> read(std::uint32_t number, std::size_t octets_max) override;
  bool exists(std::uint32_t number) override;
  Result<void, SegmentError> cut(std::uint32_t number, std::size_t octets) override;
  Result<void, SegmentError> remove(std::uint32_t number) override;
  Result<void, SegmentError> create(std::uint32_t number, OctetView header) override;
  Result<void, SegmentError> open(std::uint32_t number) override;
  [[nodiscard]] bool is_open() const override { return static_cast<bool>(file_); }
  Result<void, SegmentError> check_open() override;
  Result<void, SegmentError> write(std::size_t offset, OctetView octets) override;
  Result<void, SegmentError> sync() override;
  void close() override { file_.reset(); }

 private:
  [[nodiscard]] std::filesystem::path path_of(std::uint32_t number) const;

  std::filesystem::path folder_;
  Fd file_;
  std::uint32_t open_number_ = 0;
};

}  // namespace srfs
