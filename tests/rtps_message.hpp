// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <optional>
#include <string>

#include "base/octets.hpp"
#include "ros/datagram_filter.hpp"

namespace srfs::testing_support {

/// An RTPS message with submessages as written by Fast DDS (RTPS 2.2, 9.4).
class RtpsMessage {
 public:
  struct Fragment {
    std::uint32_t sample_octets;
    std::int64_t sequence = 1;
    std::uint32_t number = 1;  ///< of the first fragment
    std::uint16_t count = 1;
    std::uint16_t octets = 100;                      ///< of each fragment
    std::optional<std::size_t> held = std::nullopt;  ///< in the submessage; none: as declared
    std::uint8_t flags = 0;
  };

  explicit RtpsMessage(const ros::GuidPrefix& sender, bool little = true) : little_(little) {
    for (const char c : std::string("RTPS")) octets_.push_back(static_cast<std::uint8_t>(c));
    octets_.insert(octets_.end(), {2, 3, 1, 15});
    octets_.insert(octets_.end(), sender.begin(), sender.end());
  }
  RtpsMessage& timestamp() { return submessage(0x09, 0, Octets(8)); }
  /// Apart from PAD, the only submessage that may be empty without being the last.
  RtpsMessage& no_timestamp() { return submessage(0x09, 0x02, {}); }
  RtpsMessage& source(const ros::GuidPrefix& prefix) {
    Octets body(8);
    body.insert(body.end(), prefix.begin(), prefix.end());
    return submessage(0x0c, 0, body);
  }
  RtpsMessage& data(const ros::Gid& writer, OctetView sample, std::int64_t sequence = 1) {
    Octets body = ids(16, writer, sequence);
    body.insert(body.end(), sample.begin(), sample.end());
    return submessage(0x15, 0x04, body);
  }
  RtpsMessage& fragment(const ros::Gid& writer, const Fragment& f) {
    Octets body = ids(28, writer, f.sequence);
    number(body, f.number, 4);
    number(body, f.count, 2);
    number(body, f.octets, 2);
    number(body, f.sample_octets, 4);
    const std::uint64_t begin = std::uint64_t{f.octets} * (f.number - 1);
    const std::uint64_t end =
        std::min<std::uint64_t>(f.sample_octets, begin + std::uint64_t{f.octets} * f.count);
    body.resize(body.size() + f.held.value_or(end - begin));
    return submessage(0x16, f.flags, body);
  }
  /// @param length length in the header; none: the length of the body
  RtpsMessage& submessage(std::uint8_t kind, std::uint8_t flags, const Octets& body,
                          std::optional<std::uint16_t> length = std::nullopt) {
    octets_.push_back(kind);
    octets_.push_back(static_cast<std::uint8_t>(flags | (little_ ? 1 : 0)));
    number(octets_, length.value_or(body.size()), 2);
    octets_.insert(octets_.end(), body.begin(), body.end());
    return *this;
  }
  /// The first fields of DATA and DATA_FRAG.
  [[nodiscard]] Octets ids(std::uint16_t to_inline_qos, const ros::Gid& writer, std::int64_t sequence) const {
    Octets body(2);
    number(body, to_inline_qos, 2);
    body.resize(8);  // addresses any reader
    body.insert(body.end(), writer.end() - 4, writer.end());
    number(body, static_cast<std::uint64_t>(sequence) >> 32, 4);
    number(body, static_cast<std::uint64_t>(sequence), 4);
    return body;
  }
  void number(Octets& out, std::uint64_t value, std::size_t octets) const {
    for (std::size_t i = 0; i < octets; ++i)
      out.push_back(static_cast<std::uint8_t>(value >> 8 * (little_ ? i : octets - 1 - i)));
  }
  operator OctetView() const { return octets_; }  // NOLINT(google-explicit-constructor)
  [[nodiscard]] const Octets& octets() const { return octets_; }

 private:
  bool little_;
  Octets octets_;
};

}  // namespace srfs::testing_support
