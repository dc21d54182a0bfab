// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <vector>

#include "mcap/mcap_format.hpp"

namespace srfs::mcap {

/// Makes the octets of an MCAP file: chunks compressed with zstd, each with the index of its messages, and a
/// summary at the end. Each part is to be appended whole to what came before. A file that ends anywhere, for
/// instance because the recorder was killed, holds all chunks that it has whole; only the index at the end is
/// missing, which readers build anew. Pure.
///
/// Bounds: 65,535 schemas and channels; a chunk is to be ended at `chunk_octets`; the summary grows by less
/// than 100 octets and 10 a channel with each chunk.
class Writer {
 public:
  static constexpr std::size_t chunk_octets = 1U << 20;  ///< uncompressed; one message more at most

  /// @param profile "ros2"
  [[nodiscard]] Octets begin(const std::string& profile);
  /// @return its id; the same for an equal one; nullopt: no number is left
  [[nodiscard]] std::optional<std::uint16_t> add_schema(const Schema& schema);
  [[nodiscard]] std::optional<std::uint16_t> add_channel(const Channel& channel);
  /// @pre the channel was added
  void add(std::uint16_t channel, std::uint32_t sequence, std::uint64_t log_time, std::uint64_t publish_time,
           OctetView data);
  [[nodiscard]] bool chunk_is_full() const { return records_.size() >= chunk_octets; }
  /// The chunk with what was added since the one before; empty when nothing was.
  [[nodiscard]] Octets end_chunk();
  /// The last chunk, the summary and the end of the file. Nothing may follow.
  [[nodiscard]] Octets finish();

  [[nodiscard]] std::uint64_t messages() const { return message_count_; }
  /// Octets of the file so far.
  [[nodiscard]] std::uint64_t size() const { return size_; }

 private:
  struct Times {
    std::uint64_t first = 0;
    std::uint64_t last = 0;
    void add(std::uint64_t time, bool is_first);
  };
  struct IndexEntry {
    std::uint64_t time;
    std::uint64_t offset;
  };
  struct ChunkIndex {
    Times times;
    std::uint64_t offset;
    std::uint64_t length;
    std::map<std::uint16_t, std::uint64_t> message_index_offsets;
    std::uint64_t message_index_length;
    std::string compression;
    std::uint64_t compressed;
    std::uint64_t uncompressed;
  };
  void append_statistics(Octets& out) const;
  static void append_chunk_index(Octets& out, const ChunkIndex& chunk);
  [[nodiscard]] Octets summary(std::uint64_t begin) const;

  std::uint64_t size_ = 0;
  std::vector<Schema> schemas_;    // id 1 and up
  std::vector<Channel> channels_;  // id 0 and up
  Octets records_;                 // of the chunk
  Times chunk_times_;
  std::map<std::uint16_t, std::vector<IndexEntry>> index_;  // of the chunk
  std::vector<ChunkIndex> chunks_;
  std::map<std::uint16_t, std::uint64_t> counts_;
  std::uint64_t message_count_ = 0;
  Times times_;
};

}  // namespace srfs::mcap
