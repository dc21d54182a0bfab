// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "base/state_file.hpp"
#include "wire/boot_record.hpp"

namespace srfs::suite {

/// The boot record on disk: two copies, each replaced atomically, one after the other. Written by
/// timing alone, whose BootRecorder decides what stands in it. Blocks on the disk: at start, at the end and
/// in a worker thread only.
class BootStore : public StateFile<wire::BootRecord> {
 public:
  explicit BootStore(const std::filesystem::path& folder);
};

}  // namespace srfs::suite
