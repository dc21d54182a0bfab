// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "mcap/mcap_writer.hpp"

#include <algorithm>
#include <cassert>

#include <zlib.h>
#include <zstd.h>

namespace srfs::mcap {
namespace {

constexpr int zstd_level = 1;  // the least CPU time
constexpr std::size_t most_ids = 65'535;

/// Appends little-endian fields.
class FieldWriter {
 public:
  explicit FieldWriter(Octets& out) : out_(out) {}
  void u8(std::uint8_t v) { put(v, 1); }
  void u16(std::uint16_t v) { put(v, 2); }
  void u32(std::uint32_t v) { put(v, 4); }
  void u64(std::uint64_t v) { put(v, 8); }
  void bytes(OctetView octets) { out_.insert(out_.end(), octets.begin(), octets.end()); }
  void string(const std::string& text) {
    u32(static_cast<std::uint32_t>(text.size()));
    out_.insert(out_.end(), text.begin(), text.end());
  }

 private:
  void put(std::uint64_t v, int octets) {
    for (int i = 0; i < octets; ++i) out_.push_back(static_cast<std::uint8_t>(v >> 8 * i));
  }
  Octets& out_;
};

/// Appends a record whose content @p fill writes.
template <class F>
void append_record(Octets& out, Opcode opcode, F fill) {
  out.push_back(static_cast<std::uint8_t>(opcode));
  const std::size_t length_at = out.size();
  out.resize(length_at + 8);
  FieldWriter fields(out);
  fill(fields);
  const std::uint64_t length = out.size() - length_at - 8;
  for (std::size_t i = 0; i < 8; ++i) out[length_at + i] = static_cast<std::uint8_t>(length >> 8 * i);
}

/// Appends what @p fill writes behind its length in octets, as arrays and maps have it.
template <class F>
void append_sized(Octets& out, F fill) {
  const std::size_t length_at = out.size();
  out.resize(length_at + 4);
  FieldWriter fields(out);
  fill(fields);
  const std::size_t length = out.size() - length_at - 4;
  for (std::size_t i = 0; i < 4; ++i) out[length_at + i] = static_cast<std::uint8_t>(length >> 8 * i);
}

std::uint32_t crc_of(OctetView octets) {
  return static_cast<std::uint32_t>(crc32_z(0, octets.data(), octets.size()));
}

void append_schema(Octets& out, std::uint16_t id, const Schema& schema) {
  append_record(out, Opcode::schema, [&](FieldWriter& f) {
    f.u16(id);
    f.string(schema.name);
    f.string(schema.encoding);
    f.string(schema.data);
  });
}

void append_channel(Octets& out, std::uint16_t id, const Channel& channel) {
  append_record(out, Opcode::channel, [&](FieldWriter& f) {
    f.u16(id);
    f.u16(channel.schema);
    f.string(channel.topic);
    f.string(channel.message_encoding);
    append_sized(out, [&](FieldWriter& map) {
      for (const auto& [key, value] : channel.metadata) {
        map.string(key);
        map.string(value);
      }
    });
  });
}

/// zstd; without compression where that fails.
Octets compressed(OctetView records, std::string& compression) {
  Octets out(ZSTD_compressBound(records.size()));
  const std::size_t size = ZSTD_compress(out.data(), out.size(), records.data(), records.size(), zstd_level);
  if (ZSTD_isError(size) != 0) {
    compression.clear();
    return {records.begin(), records.end()};
  }
  compression = "zstd";
  out.resize(size);
  return out;
}

}  // namespace

void Writer::Times::add(std::uint64_t time, bool is_first) {
  first = is_first ? time : std::min(first, time);
  last = is_first ? time : std::max(last, time);
}

Octets Writer::begin(const std::string& profile) {
  Octets out(magic.begin(), magic.end());
  append_record(out, Opcode::header, [&](FieldWriter& f) {
    f.string(profile);
    f.string("srfs");
  });
  size_ = out.size();
  return out;
}

std::optional<std::uint16_t> Writer::add_schema(const Schema& schema) {
  const auto known = std::find(schemas_.begin(), schemas_.end(), schema);
  if (known != schemas_.end()) return static_cast<std::uint16_t>(known - schemas_.begin() + 1);
  if (schemas_.size() == most_ids) return std::nullopt;
  schemas_.push_back(schema);
  const auto id = static_cast<std::uint16_t>(schemas_.size());
  append_schema(records_, id, schema);
  return id;
}

std::optional<std::uint16_t> Writer::add_channel(const Channel& channel) {
  const auto known = std::find(channels_.begin(), channels_.end(), channel);
  if (known != channels_.end()) return static_cast<std::uint16_t>(known - channels_.begin());
  if (channels_.size() == most_ids) return std::nullopt;
  const auto id = static_cast<std::uint16_t>(channels_.size());
  channels_.push_back(channel);
  append_channel(records_, id, channel);
  return id;
}

void Writer::add(std::uint16_t channel, std::uint32_t sequence, std::uint64_t log_time,
                 std::uint64_t publish_time, OctetView data) {
  assert(channel < channels_.size());
  chunk_times_.add(log_time, index_.empty());
  times_.add(log_time, message_count_ == 0);
  index_[channel].push_back({log_time, records_.size()});
  ++counts_[channel];
  ++message_count_;
  append_record(records_, Opcode::message, [&](FieldWriter& f) {
    f.u16(channel);
    f.u32(sequence);
    f.u64(log_time);
    f.u64(publish_time);
    f.bytes(data);
  });
}

Octets Writer::end_chunk() {
  if (records_.empty()) return {};
  std::string compression;
  const Octets body = compressed(records_, compression);
  ChunkIndex chunk{chunk_times_, size_, 0, {}, 0, compression, body.size(), records_.size()};
  Octets out;
  append_record(out, Opcode::chunk, [&](FieldWriter& f) {
    f.u64(chunk_times_.first);
    f.u64(chunk_times_.last);
    f.u64(records_.size());
    f.u32(crc_of(records_));
    f.string(compression);
    f.u64(body.size());
    f.bytes(body);
  });
  chunk.length = out.size();
  for (const auto& [channel, entries] : index_) {
    chunk.message_index_offsets[channel] = size_ + out.size();
    append_record(out, Opcode::message_index, [&, id = channel, &list = entries](FieldWriter& f) {
      f.u16(id);
      append_sized(out, [&](FieldWriter& array) {
        for (const IndexEntry& entry : list) {
          array.u64(entry.time);
          array.u64(entry.offset);
        }
      });
    });
  }
  chunk.message_index_length = out.size() - chunk.length;
  chunks_.push_back(std::move(chunk));
  size_ += out.size();
  records_.clear();
  index_.clear();
  chunk_times_ = {};
  return out;
}

void Writer::append_statistics(Octets& out) const {
  append_record(out, Opcode::statistics, [&](FieldWriter& f) {
    f.u64(message_count_);
    f.u16(static_cast<std::uint16_t>(schemas_.size()));
    f.u32(static_cast<std::uint32_t>(channels_.size()));
    f.u32(0);  // attachments
    f.u32(0);  // metadata
    f.u32(static_cast<std::uint32_t>(chunks_.size()));
    f.u64(times_.first);
    f.u64(times_.last);
    append_sized(out, [&](FieldWriter& map) {
      for (const auto& [channel, count] : counts_) {
        map.u16(channel);
        map.u64(count);
      }
    });
  });
}

void Writer::append_chunk_index(Octets& out, const ChunkIndex& chunk) {
  append_record(out, Opcode::chunk_index, [&](FieldWriter& f) {
    f.u64(chunk.times.first);
    f.u64(chunk.times.last);
    f.u64(chunk.offset);
    f.u64(chunk.length);
    append_sized(out, [&](FieldWriter& map) {
      for (const auto& [channel, offset] : chunk.message_index_offsets) {
        map.u16(channel);
        map.u64(offset);
      }
    });
    f.u64(chunk.message_index_length);
    f.string(chunk.compression);
    f.u64(chunk.compressed);
    f.u64(chunk.uncompressed);
  });
}

Octets Writer::summary(std::uint64_t begin) const {
  struct Group {
    Opcode opcode;
    std::uint64_t start;
    std::uint64_t length;
  };
  Octets out;
  std::vector<Group> groups;
  const auto group = [&](Opcode opcode, const auto& fill) {
    const std::uint64_t start = out.size();
    fill();
    if (out.size() > start) groups.push_back({opcode, begin + start, out.size() - start});
  };
  group(Opcode::schema, [&] {
    for (std::size_t i = 0; i < schemas_.size(); ++i)
      append_schema(out, static_cast<std::uint16_t>(i + 1), schemas_[i]);
  });
  group(Opcode::channel, [&] {
    for (std::size_t i = 0; i < channels_.size(); ++i)
      append_channel(out, static_cast<std::uint16_t>(i), channels_[i]);
  });
  group(Opcode::statistics, [&] { append_statistics(out); });
  group(Opcode::chunk_index, [&] {
    for (const ChunkIndex& chunk : chunks_) append_chunk_index(out, chunk);
  });
  const std::uint64_t offsets_at = begin + out.size();
  for (const Group& g : groups) {
    append_record(out, Opcode::summary_offset, [&](FieldWriter& f) {
      f.u8(static_cast<std::uint8_t>(g.opcode));
      f.u64(g.start);
      f.u64(g.length);
    });
  }
  FieldWriter footer(out);  // its checksum has its own length in it
  footer.u8(static_cast<std::uint8_t>(Opcode::footer));
  footer.u64(8 + 8 + 4);
  footer.u64(begin);
  footer.u64(offsets_at);
  footer.u32(crc_of(out));
  return out;
}

Octets Writer::finish() {
  Octets out = end_chunk();
  Octets end;
  append_record(end, Opcode::data_end, [](FieldWriter& f) { f.u32(0); });
  out.insert(out.end(), end.begin(), end.end());
  size_ += end.size();
  const Octets rest = summary(size_);
  out.insert(out.end(), rest.begin(), rest.end());
  out.insert(out.end(), magic.begin(), magic.end());
  size_ += rest.size() + magic.size();
  return out;
}

}  // namespace srfs::mcap
