// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <istream>
#include <map>
#include <optional>
#include <string>

#include "base/result.hpp"
#include "mcap/mcap_format.hpp"

namespace srfs::mcap {

/// Reads an MCAP file from begin to end, also one that a killed recorder left without an end: every chunk
/// that is whole is read. Bounded: records of 256 MiB, compressed or not.
class Reader {
 public:
  static constexpr std::uint64_t most_octets = 256U << 20;

  explicit Reader(std::istream& file) : file_(file) {}

  /// The next message. @return nullopt at the end of what can be read; an error where the file is no MCAP
  /// file, has a compression other than zstd, or is damaged
  [[nodiscard]] Result<std::optional<Message>, std::string> next();
  /// Of the messages so far.
  [[nodiscard]] const std::map<std::uint16_t, Channel>& channels() const { return channels_; }
  [[nodiscard]] const std::map<std::uint16_t, Schema>& schemas() const { return schemas_; }
  /// The file has its end: its recorder was not killed.
  [[nodiscard]] bool is_whole() const { return is_whole_; }

 private:
  struct Record {
    Opcode opcode;
    Octets content;
  };
  [[nodiscard]] Result<std::optional<Record>, std::string> next_record();
  [[nodiscard]] std::optional<std::string> open_chunk(OctetView content);
  [[nodiscard]] std::optional<std::string> take(Opcode opcode, OctetView content,
                                                std::optional<Message>& message);

  std::istream& file_;
  bool has_begun_ = false;
  bool is_whole_ = false;
  Octets chunk_;
  std::size_t chunk_at_ = 0;
  std::map<std::uint16_t, Channel> channels_;
  std::map<std::uint16_t, Schema> schemas_;
};

}  // namespace srfs::mcap
