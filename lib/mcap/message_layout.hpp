// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/octets.hpp"
#include "base/result.hpp"

namespace srfs::mcap {

/// A message type that this program was not built with, as its definition says: what lies where in a sample.
class MessageLayout {
 public:
  /// @param type "std_msgs/msg/String" @param definition of message_definition()
  /// @return why not: what the definition lacks or cannot mean, or a type that has itself as a part
  [[nodiscard]] static Result<MessageLayout, std::string> parse(const std::string& type,
                                                                std::string_view definition);

  /// A sample as a JSON object in one line, fields in the order of the definition. What is not UTF-8 is
  /// replaced, what is no number of JSON (NaN) is null.
  /// @param sample plain CDR with its encapsulation header, either byte order; from any peer
  /// @param most elements of each array that are shown; "..." stands for the others
  /// @return nullopt: it is no such message
  [[nodiscard]] std::optional<std::string> to_json(OctetView sample, std::size_t most) const;

  enum class Primitive : std::uint8_t {
    boolean,
    octet,
    i8,
    i16,
    i32,
    i64,
    u16,
    u32,
    u64,
    f32,
    f64,
    text,
    wide_text,
    message
  };
  struct Field {
    std::string name;
    Primitive primitive = Primitive::octet;
    std::size_t message = 0;  ///< index of its type
    bool is_array = false;
    std::optional<std::size_t> length;  ///< of an array; nullopt: a sequence, whose length is in the sample
  };
  using Message = std::vector<Field>;

 private:
  explicit MessageLayout(std::vector<Message> messages) : messages_(std::move(messages)) {}
  std::vector<Message> messages_;  // the type itself last; each has only earlier ones as parts
};

}  // namespace srfs::mcap
