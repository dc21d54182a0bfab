// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/stored_table.hpp"

#include "base/crc32c.hpp"

namespace srfs {
namespace {

constexpr std::size_t check_octets = 4;

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

}  // namespace srfs
