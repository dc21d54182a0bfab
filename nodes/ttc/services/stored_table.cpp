// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/stored_table.hpp"

#include <algorithm>
#include <utility>

#include "base/crc32c.hpp"

namespace srfs {
namespace {

constexpr std::size_t check_octets = 4;
constexpr std::uint8_t content_version = 1;

}  // namespace

std::string encode_table(const StoredTable& table) {
  OctetWriter out;
  out.u64(table.generation);
  out.bytes(table.content);
  out.u32(crc32c(out.view()));
  const OctetView octets = out.view();
  return {octets.begin(), octets.end()};
}

std::optional<StoredTable> decode_table(std::string_view stored) {
  const OctetView octets(reinterpret_cast<const std::uint8_t*>(stored.data()), stored.size());
  if (octets.size() < sizeof(StoredTable::generation) + check_octets) return std::nullopt;
  const OctetView body = octets.first(octets.size() - check_octets);
  if (OctetReader(octets.subspan(body.size())).u32() != crc32c(body)) return std::nullopt;
  OctetReader in(body);
  StoredTable table;
  table.generation = in.u64();
  const OctetView content = in.rest();
  table.content.assign(content.begin(), content.end());
  return table;
}

StateFile<StoredTable> stored_table_file(const std::filesystem::path& path) {
  constexpr StateCodec<StoredTable> codec{
      .encode = encode_table,
      .decode = decode_table,
      .is_newer = [](const StoredTable& table,
                     const StoredTable& than) { return table.generation > than.generation; },
  };
  return {path.string() + ".0", path.string() + ".1", codec};
}

// ---- service

bool StoredTableService::read(const FoundTable& found) {
  damaged_ = found.damaged;
  if (!found.table) return false;
  generation_ = found.table->generation;  // what is stored next is newer, whatever this is
  OctetReader in(found.table->content);
  bool sound = in.u8() == content_version;
  std::deque<std::uint64_t> applied;
  for (std::size_t count = in.u16(); sound && count > 0 && in.ok(); --count) applied.push_back(in.u64());
  sound = sound && in.ok() && applied.size() <= max_applied && read_table(in);
  if (sound) applied_ = std::move(applied);
  damaged_ = !sound;
  return sound;
}

StoredTable StoredTableService::stored() const {
  OctetWriter out;
  out.u8(content_version);
  out.u16(static_cast<std::uint16_t>(applied_.size()));
  for (const std::uint64_t id : applied_) out.u64(id);
  write_table(out);
  return {.generation = generation_, .content = out.take()};
}

bool StoredTableService::restore(const Telecommand& telecommand, const TelecommandProgress& progress,
                                 MonotonicTime /*now*/) {
  if (std::find(applied_.begin(), applied_.end(), telecommand.origin.id) == applied_.end()) return false;
  if (!progress.started) report_queue_.success(telecommand.origin, Stage::start);
  report_queue_.success(telecommand.origin, Stage::completion);
  return true;
}

void StoredTableService::on_changed(const TelecommandOrigin& origin) {
  report_queue_.success(origin, Stage::start);
  ++generation_;
  applied_.push_back(origin.id);
  if (applied_.size() > max_applied) applied_.pop_front();
  changed_.push_back(origin);
}

std::optional<TableChange> StoredTableService::take_change(MonotonicTime now) {
  const bool again = retry_at_ && *retry_at_ <= now;
  if (changed_.empty() && !again) return std::nullopt;
  retry_at_.reset();
  return TableChange{.origins = std::exchange(changed_, {}), .table = stored()};
}

void StoredTableService::on_stored(const TableChange& change, bool success, MonotonicTime now) {
  retry_at_ = success ? std::nullopt : std::optional(now + retry_period);
  for (const TelecommandOrigin& origin : change.origins) {
    if (success) {
      report_queue_.success(origin, Stage::completion);
    } else {
      report_queue_.failure(origin, Stage::completion, mission::failure::storage_unavailable);
    }
  }
}

}  // namespace srfs
