// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "base/time.hpp"
#include "ros/isolation.hpp"

namespace srfs::ros {

/// Which sealed datagrams came in at one port, by their sender and the time in their seal, which no two
/// datagrams of one process have in common: what comes again is not new. A datagram may overtake others, as
/// those of two threads of one process do.
///
/// Of each sender the newest `least` to `most` times are known; older ones count as heard. So does what was
/// sealed before the port was opened, which nobody could have sent to it. Of a sender that was forgotten
/// nothing is new up to the newest that came from any forgotten one. Pure.
class HeardTimes {
 public:
  static constexpr std::size_t least = 128;
  static constexpr std::size_t most = 2 * least;
  static constexpr std::size_t most_senders = 64;  ///< the one that was silent longest is forgotten

  enum class Verdict : std::uint8_t {
    first,    ///< it did not come before
    again,    ///< it did
    too_old,  ///< that is not known any longer, or it was made before the port was opened
  };

  /// @param opened  before the port's socket is bound
  explicit HeardTimes(MonotonicTime opened) : forgotten_(opened) {}

  [[nodiscard]] Verdict look(const GuidPrefix& sender, MonotonicTime sealed) const;
  /// Notes it when it is the first.
  Verdict add(const GuidPrefix& sender, MonotonicTime sealed);

 private:
  struct Sender {
    GuidPrefix prefix;
    MonotonicTime floor;               ///< not new up to here
    std::vector<MonotonicTime> times;  ///< ascending
  };
  [[nodiscard]] Verdict verdict(const Sender& sender, MonotonicTime sealed) const;
  Sender& remember(const GuidPrefix& prefix);

  MonotonicTime forgotten_;
  std::vector<Sender> senders_;  ///< the one heard last in front
};

}  // namespace srfs::ros
