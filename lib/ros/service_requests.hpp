// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include <fastdds/rtps/common/SampleIdentity.h>

#include "base/time.hpp"

namespace srfs::ros {

using eprosima::fastrtps::rtps::GUID_t;
using eprosima::fastrtps::rtps::SampleIdentity;

[[nodiscard]] inline eprosima::fastrtps::rtps::SequenceNumber_t sequence_number(std::int64_t number) {
  return {static_cast<std::int32_t>(number >> 32), static_cast<std::uint32_t>(number)};
}

/// Names a request at its service until it is answered. Never repeats within a service.
enum class Ticket : std::uint64_t {};

/// A service's memory of its requests: which wait for their answer, and which were answered lately, so that a
/// repeated request is answered again instead of executed twice. Pure: never reads a clock. Not thread-safe.
///
/// A repeat is a new sample with a new sequence number. Our clients write into its related sample identity
/// the sequence number of the first attempt, where ROS 2 leaves it unknown and never looks. So a request is
/// known by {client, sequence of its first attempt}.
class ServiceRequests {
 public:
  using Response = std::shared_ptr<const void>;

  enum class Verdict : std::uint8_t {
    execute,       ///< new: execute it, then answer() its ticket
    answer_again,  ///< a repeat of an answered request: send `response` once more
    wait,          ///< a repeat of a request that is being executed: its answer will serve
    refuse,        ///< most_pending requests are waiting: dropped and counted
  };
  struct Judgement {
    Verdict verdict;
    Ticket ticket{};         ///< with execute
    Response response = {};  ///< with answer_again
  };
  struct Counters {
    std::uint64_t repeats = 0;  ///< requests not executed because they were repeats
    std::uint64_t refused = 0;  ///< no room
    std::uint64_t dropped = 0;  ///< pending requests whose client vanished
  };
  static constexpr std::size_t most_pending = 64;
  static constexpr std::size_t most_answered = 32;  ///< responses kept for repeats; the oldest makes room
  static constexpr seconds longest_memory{10};      ///< a response older than this is not kept
  static constexpr seconds longest_to_match{
      3};  ///< for a client's reader to appear: lost discovery comes again after 1 s

  /// @param request identity the answer will carry: client and sequence number of this sample
  /// @param first_sequence of the first attempt, when this one says that it is a repeat
  /// @param within_reach the client's reader is matched already
  [[nodiscard]] Judgement judge(const SampleIdentity& request, std::optional<std::int64_t> first_sequence,
                                bool within_reach, MonotonicTime now);
  /// Ends a pending request and keeps the response for repeats.
  /// @return the request to answer; nullopt when the ticket was answered or dropped before
  [[nodiscard]] std::optional<SampleIdentity> answer(Ticket ticket, Response response, MonotonicTime now);
  /// Drops a pending request without an answer; a repeat of it is executed.
  void forget(Ticket ticket);
  /// Drops pending requests of clients that were within reach, or had time to be, and are not.
  /// @return their tickets
  [[nodiscard]] std::vector<Ticket> drop_vanished(const std::function<bool(const GUID_t&)>& within_reach,
                                                  MonotonicTime now);
  /// Client of a pending request; unknown GUID for any other ticket.
  [[nodiscard]] GUID_t client(Ticket ticket) const;
  [[nodiscard]] std::size_t pending() const { return pending_.size(); }
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  struct Pending {
    Ticket ticket;
    SampleIdentity first;  // of the first attempt: the request's name
    SampleIdentity reply_to;
    MonotonicTime since;
    bool client_seen = false;
  };
  struct Answered {
    SampleIdentity first;
    MonotonicTime at;
    Response response;
  };
  void forget_old(MonotonicTime now);

  std::vector<Pending> pending_;
  std::deque<Answered> answered_;  // oldest first
  std::uint64_t next_ticket_ = 1;
  Counters counters_;
};

}  // namespace srfs::ros
