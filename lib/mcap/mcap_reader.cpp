// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "mcap/mcap_reader.hpp"

#include <algorithm>

#include <zlib.h>
#include <zstd.h>

namespace srfs::mcap {
namespace {

/// Reads little-endian fields. Past the end every read gives zero and ok() turns false.
class FieldReader {
 public:
  explicit FieldReader(OctetView octets) : octets_(octets) {}
  std::uint16_t u16() { return static_cast<std::uint16_t>(get(2)); }
  std::uint32_t u32() { return static_cast<std::uint32_t>(get(4)); }
  std::uint64_t u64() { return get(8); }
  OctetView bytes(std::uint64_t count) {
    if (!ok_ || octets_.size() - at_ < count) {
      ok_ = false;
      return {};
    }
    at_ += static_cast<std::size_t>(count);
    return octets_.subspan(at_ - static_cast<std::size_t>(count), static_cast<std::size_t>(count));
  }
  std::string string() {
    const OctetView text = bytes(u32());
    return {text.begin(), text.end()};
  }
  OctetView rest() { return bytes(octets_.size() - at_); }
  [[nodiscard]] bool ok() const { return ok_; }
  [[nodiscard]] bool at_end() const { return at_ == octets_.size(); }

 private:
  std::uint64_t get(std::size_t count) {
    const OctetView octets = bytes(count);
    std::uint64_t v = 0;
    for (std::size_t i = octets.size(); i-- > 0;) v = v << 8 | octets[i];
    return v;
  }
  OctetView octets_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

constexpr std::size_t record_header = 9;

}  // namespace

Result<std::optional<Reader::Record>, std::string> Reader::next_record() {
  std::array<std::uint8_t, record_header> header{};
  if (!file_.read(reinterpret_cast<char*>(header.data()), header.size())) return std::nullopt;
  FieldReader fields(OctetView(header).subspan(1));
  const std::uint64_t length = fields.u64();
  if (length > most_octets) return Err(std::string("a record claims more than 256 MiB: the file is damaged"));
  Record record{static_cast<Opcode>(header[0]), Octets(static_cast<std::size_t>(length))};
  if (!file_.read(reinterpret_cast<char*>(record.content.data()), static_cast<std::streamsize>(length)))
    return std::nullopt;
  return record;
}

std::optional<std::string> Reader::open_chunk(OctetView content) {
  FieldReader fields(content);
  (void)fields.u64();  // begin
  (void)fields.u64();  // end
  const std::uint64_t size = fields.u64();
  const std::uint32_t crc = fields.u32();
  const std::string compression = fields.string();
  const OctetView records = fields.bytes(fields.u64());
  if (!fields.ok() || size > most_octets) return "a chunk is damaged";
  if (compression.empty()) {
    chunk_.assign(records.begin(), records.end());
  } else if (compression == "zstd") {
    chunk_.resize(static_cast<std::size_t>(size));
    const std::size_t found = ZSTD_decompress(chunk_.data(), chunk_.size(), records.data(), records.size());
    if (ZSTD_isError(found) != 0 || found != size) return "a chunk cannot be decompressed";
  } else {
    return "a chunk has the compression '" + compression + "'; only zstd can be read";
  }
  if (crc != 0 && crc != crc32_z(0, chunk_.data(), chunk_.size())) return "a chunk has a wrong checksum";
  chunk_at_ = 0;
  return std::nullopt;
}

std::optional<std::string> Reader::take(Opcode opcode, OctetView content, std::optional<Message>& message) {
  FieldReader f(content);
  if (opcode == Opcode::schema) {
    const std::uint16_t id = f.u16();
    Schema schema{f.string(), f.string(), f.string()};
    if (f.ok() && id != 0) schemas_.insert_or_assign(id, std::move(schema));
  } else if (opcode == Opcode::channel) {
    const std::uint16_t id = f.u16();
    Channel channel{f.u16(), f.string(), f.string(), {}};
    FieldReader map(f.bytes(f.u32()));
    while (map.ok() && !map.at_end()) {
      std::string key = map.string();
      channel.metadata[std::move(key)] = map.string();
    }
    if (!map.ok()) return "a channel is damaged";
    if (f.ok()) channels_.insert_or_assign(id, std::move(channel));
  } else if (opcode == Opcode::message) {
    Message found{f.u16(), f.u32(), f.u64(), f.u64(), {}};
    const OctetView data = f.rest();
    if (!channels_.contains(found.channel)) return "a message is of no channel";
    found.data.assign(data.begin(), data.end());
    if (f.ok()) message = std::move(found);
  }
  if (!f.ok()) return "a record is damaged";
  return std::nullopt;
}

Result<std::optional<Message>, std::string> Reader::next() {
  if (!has_begun_) {
    std::array<std::uint8_t, magic.size()> found{};
    if (!file_.read(reinterpret_cast<char*>(found.data()), found.size()) || found != magic)
      return Err(std::string("no MCAP file (https://mcap.dev)"));
    has_begun_ = true;
  }
  std::optional<Message> message;
  while (!message && !is_whole_) {
    if (chunk_at_ < chunk_.size()) {
      FieldReader fields(OctetView(chunk_).subspan(chunk_at_));
      const OctetView opcode = fields.bytes(1);
      const std::uint64_t length = fields.u64();
      const OctetView content = fields.bytes(length);
      if (!fields.ok()) return Err(std::string("a chunk is damaged"));
      chunk_at_ += record_header + static_cast<std::size_t>(length);
      if (auto error = take(static_cast<Opcode>(opcode[0]), content, message)) return Err(*error);
      continue;
    }
    const auto record = next_record();
    if (!record) return Err(record.error());
    if (!*record) return std::nullopt;
    const auto& [opcode, content] = **record;
    is_whole_ = opcode == Opcode::data_end || opcode == Opcode::footer;
    const auto error = opcode == Opcode::chunk ? open_chunk(content) : take(opcode, content, message);
    if (error) return Err(*error);
  }
  return message;
}

}  // namespace srfs::mcap
