// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/octets.hpp"
#include "base/state_file.hpp"
#include "nodes/ttc/services/pus_service.hpp"

namespace srfs {

/// The table of a service as it stands on disk, as a whole: a change is there or it is not.
struct StoredTable {
  std::uint64_t generation = 0;  ///< counts the changes; of two copies the higher one holds
  Octets content = {};           ///< the service's own
  friend bool operator==(const StoredTable&, const StoredTable&) = default;
};
[[nodiscard]] std::string encode_table(const StoredTable& table);
/// nullopt: damaged.
[[nodiscard]] std::optional<StoredTable> decode_table(std::string_view stored);
/// PATH.0 and PATH.1, each with CRC-32C.
[[nodiscard]] StateFile<StoredTable> stored_table_file(const std::filesystem::path& path);

// Flags with which the content of a service's table begins.
inline constexpr std::uint8_t function_flag = 1;  ///< the service's function is on
inline constexpr std::uint8_t factory_flag = 2;   ///< the table is the factory set

/// What the start found of a table.
struct FoundTable {
  std::optional<StoredTable> table = {};
  bool damaged = false;  ///< there was one, and no copy is sound
};

/// A table is to be stored.
struct TableChange {
  std::vector<TelecommandOrigin> origins;  ///< of the changes that no write before had; may be none
  StoredTable table;
};

/// A service whose telecommands change a table that lasts. A change holds at once. What came together is
/// stored together, and then reported complete; what could not be stored is reported so and stored later.
/// The table has the ids of the newest requests that changed it: after a restart these are done.
class StoredTableService : public PusService {
 public:
  /// Of the line, for other reports than long ones.
  static constexpr std::size_t room_kept_octets = 16U << 10;
  static constexpr seconds retry_period{10};  ///< after a write that failed
  static constexpr std::size_t max_applied = 256;

  explicit StoredTableService(ReportQueue& report_queue) : report_queue_(report_queue) {}

  [[nodiscard]] bool restore(const Telecommand& telecommand, const TelecommandProgress& progress,
                             MonotonicTime now) override;
  /// nullopt: nothing is to be stored now.
  [[nodiscard]] std::optional<TableChange> take_change(MonotonicTime now);
  void on_stored(const TableChange& change, bool success, MonotonicTime now);
  /// When what could not be stored is to be stored again.
  [[nodiscard]] const std::optional<MonotonicTime>& retry_at() const { return retry_at_; }
  [[nodiscard]] StoredTable stored() const;
  [[nodiscard]] std::uint64_t generation() const { return generation_; }
  /// What was found is no whole table of this version.
  [[nodiscard]] bool is_damaged() const { return damaged_; }

 protected:
  /// Behind the head that all tables have.
  virtual void write_table(OctetWriter& out) const = 0;
  /// @return false: not whole; nothing was taken
  [[nodiscard]] virtual bool read_table(OctetReader& in) = 0;
  /// @return false: there is no sound one
  [[nodiscard]] bool read(const FoundTable& found);
  /// Reports its start.
  void on_changed(const TelecommandOrigin& origin);
  [[nodiscard]] ReportQueue& report_queue() { return report_queue_; }

 private:
  ReportQueue& report_queue_;
  std::uint64_t generation_ = 0;
  std::deque<std::uint64_t> applied_;       ///< ids of telecommands
  std::vector<TelecommandOrigin> changed_;  ///< since the last write
  std::optional<MonotonicTime> retry_at_;
  bool damaged_ = false;
};

}  // namespace srfs
