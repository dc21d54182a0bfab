// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "base/result.hpp"
#include "base/time.hpp"
#include "cfdp/transfer_folders.hpp"

namespace srfs::ground {

/// The ground's end of the file link: STATE/files holds what came and, in outbox, what is to go up;
/// STATE/cfdp what is under way. The error is ready to print. Blocks on the disk.
[[nodiscard]] Result<std::unique_ptr<cfdp::TransferFolders>, std::string> open_files(
    const std::filesystem::path& state_dir, UtcTime utc, MonotonicTime now);

/// Why a file cannot be called so on board, ready to print; nullopt: it can.
[[nodiscard]] std::optional<std::string> wrong_name_on_board(const std::string& name);

/// Puts a copy of @p file into the outbox, to be called @p name on board. The error is ready to print.
/// Blocks on the disk.
[[nodiscard]] Result<cfdp::TransactionId, std::string> put_file(cfdp::TransferFolders& transfer_folders,
                                                                const std::filesystem::path& file,
                                                                const std::string& name);

/// As put_file; but when an interrupted run left the same octets under way by this name, these go on.
[[nodiscard]] Result<cfdp::TransactionId, std::string> put_or_resume(cfdp::TransferFolders& transfer_folders,
                                                                     const std::filesystem::path& file,
                                                                     const std::string& name);

/// "2:17": entity of the sender and number.
[[nodiscard]] std::string to_text(cfdp::TransactionId id);
[[nodiscard]] std::optional<cfdp::TransactionId> parse_transaction(const std::string& text);
/// It is over and the file arrived whole.
[[nodiscard]] bool has_arrived(const cfdp::News& news);

/// {"type": "file", id, direction, name, octets, progress, missing, state}
[[nodiscard]] nlohmann::json to_json(const cfdp::Report& report);
/// The same with event, success, condition, reaction, problem.
[[nodiscard]] nlohmann::json to_json(const cfdp::News& news);
/// "up   1:17  image.fits  [#####.....]  52 %  104000 of 200000 octets, 950 missing, suspended"
[[nodiscard]] std::string to_line(const cfdp::Report& report);
[[nodiscard]] std::string to_line(const cfdp::News& news);

}  // namespace srfs::ground
