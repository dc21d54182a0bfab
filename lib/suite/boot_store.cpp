// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/boot_store.hpp"

namespace srfs::suite {
namespace {

constexpr StateCodec<wire::BootRecord> codec{
    .encode = [](const wire::BootRecord& record) { return wire::encode_boot_record(record); },
    .decode = [](std::string_view text) -> std::optional<wire::BootRecord> {
      auto record = wire::decode_boot_record(std::string(text));
      return record ? std::optional(std::move(*record)) : std::nullopt;
    },
    .is_newer = [](const wire::BootRecord& record,
                   const wire::BootRecord& than) { return record.revision > than.revision; },
};

}  // namespace

BootStore::BootStore(const std::filesystem::path& folder)
    : StateFile(folder / "record_a", folder / "record_b", codec) {}

}  // namespace srfs::suite
