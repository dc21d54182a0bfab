// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/boot_store.hpp"

#include <array>

#include "base/log.hpp"

namespace srfs::suite {
namespace {

constexpr std::array copies{"record_a", "record_b"};

}  // namespace

std::optional<wire::BootRecord> BootStore::load() const {
  std::optional<wire::BootRecord> newest;
  for (const char* copy : copies) {
    const auto file = folder_ / copy;
    if (!std::filesystem::exists(file)) continue;
    constexpr std::size_t longest = 4096;
    const auto text = read_file(file, longest);
    const auto record = text ? wire::decode_boot_record(*text) : Err(wire::BootRecordError::damaged);
    if (!record) {
      log::error("{} is damaged", file.string());
    } else if (!newest || record->revision > newest->revision) {
      newest = *record;
    }
  }
  return newest;
}

Result<void, FileError> BootStore::save(const wire::BootRecord& record) const {
  const std::string text = wire::encode_boot_record(record);
  for (const char* copy : copies) {
    if (auto written = write_file_atomically(folder_ / copy, text); !written) return written;
  }
  return {};
}

}  // namespace srfs::suite
