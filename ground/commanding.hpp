// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <mission/structures.hpp>

#include "base/time.hpp"
#include "ground/downlink.hpp"
#include "msgs/mission/dictionary.hpp"
#include "wire/pus.hpp"

namespace srfs::ground {

/// A telecommand as an operator writes it.
struct TelecommandText {
  std::string name;
  std::vector<std::string> arguments;
};

using Stage = mission::VerificationStage;

/// What became of a telecommand: passed and failed say it of the stage of a PUS 1 report, the others are the
/// ground's own.
enum class Outcome : std::uint8_t {
  sent,
  scheduled,  ///< time-tagged: it is in the schedule on board
  passed,
  failed,
  timed_out,  ///< no further report came in time
  not_sent,   ///< the AD service ended before its first transmission, or it was not scheduled
  unknown,    ///< the server ended: whether it was sent is not known
};

struct StageReport {
  wire::RequestId request;
  const mission::Command* command = nullptr;
  std::uint64_t tag = 0;  ///< the caller's, from sent()
  Outcome outcome = Outcome::sent;
  Stage stage = Stage::acceptance;  ///< that passed or failed
  nanoseconds elapsed{0};           ///< since it was sent
  std::uint8_t step = 0;            ///< of progress
  std::uint16_t failure_code = 0;
  std::string failure_name;
  bool insertion = false;    ///< of the request that schedules a time-tagged telecommand, not of the latter
  std::string failure_text;  ///< with the parameter: "an argument is out of its range: argument 1 'load'"
  std::int64_t archive_id = 0;  ///< of the packet that reports it, as ReceivedPacket
  std::string who = {};         ///< of another user's telecommand; empty: of this one
  bool late = false;            ///< came after it was said to be timed_out

  /// The telecommand, or a step of it, did not succeed.
  [[nodiscard]] bool is_failure() const {
    return outcome == Outcome::failed || outcome == Outcome::timed_out || outcome == Outcome::not_sent ||
           outcome == Outcome::unknown;
  }
  [[nodiscard]] bool is_completed() const { return outcome == Outcome::passed && stage == Stage::completion; }
  /// What became of it is known: no further report comes.
  [[nodiscard]] bool has_ended() const { return is_final() && outcome != Outcome::timed_out; }
  /// No more reports are waited for. After timed_out one may still come, which is late then.
  [[nodiscard]] bool is_final() const {
    return is_completed() || (is_failure() && !(outcome == Outcome::failed && stage == Stage::progress));
  }
};
/// "accepted", "start_failed", "timed_out", ...
[[nodiscard]] std::string_view to_text(const StageReport& report);

/// Follows telecommands from sending to completion by their verification reports. Pure; at most
/// max_outstanding, for a new one the oldest is given up, those that timed out before others. Request ids are
/// used again, by other stations, too: one that timed out is forgotten after late_longest, or when another
/// telecommand with its id is sent.
class Commanding {
 public:
  static constexpr std::size_t max_outstanding = 256;
  static constexpr seconds late_longest{600};

  explicit Commanding(const mission::Dictionary& dictionary) : dictionary_(dictionary) {}

  /// @param patience until the next stage must be final
  StageReport sent(const wire::RequestId& request, const mission::Command& command, milliseconds patience,
                   std::uint64_t tag, MonotonicTime now);
  /// A time-tagged telecommand: it is followed like one that was sent, and does not count as outstanding.
  void follow_scheduled(const wire::RequestId& request, const mission::Command& command,
                        milliseconds patience, std::uint64_t tag, MonotonicTime now);
  /// What became of its insertion. @return scheduled or not_sent; nullopt: it is not followed any more
  [[nodiscard]] std::optional<StageReport> on_inserted(const wire::RequestId& request, bool success,
                                                       MonotonicTime now);
  /// @return nullopt for a packet that is no verification report of an outstanding telecommand
  [[nodiscard]] std::optional<StageReport> on_packet(const wire::TmPacket& packet, MonotonicTime now);
  /// There is news of a telecommand that takes long: its patience begins anew.
  void extend(std::uint64_t tag, MonotonicTime now);
  void extend(const wire::RequestId& request, MonotonicTime now);
  /// Somebody else sent a telecommand with this id.
  void forget_late(const wire::RequestId& request);
  /// The telecommands whose time is over. They are followed on for late_longest: a spacecraft without a CPU
  /// tells their end later.
  [[nodiscard]] std::vector<StageReport> on_time(MonotonicTime now);

  [[nodiscard]] std::size_t outstanding() const;
  [[nodiscard]] std::optional<MonotonicTime> next_deadline() const;

 private:
  struct Outstanding {
    wire::RequestId request;
    const mission::Command* command;
    std::uint64_t tag;
    MonotonicTime sent;
    milliseconds patience;
    MonotonicTime deadline;
    bool scheduled = false;
    bool timed_out = false;
  };
  [[nodiscard]] StageReport report_of(const Outstanding& telecommand, Outcome outcome,
                                      MonotonicTime now) const;
  void read_failure(OctetReader& in, StageReport& report) const;
  void forget_late(MonotonicTime now);
  void make_room();

  const mission::Dictionary& dictionary_;
  std::deque<Outstanding> outstanding_;
};

/// Counts the packets of one retrieval on the playback channel and knows when all have come. The spacecraft
/// plays retrievals one after another: from its own 1,3 to the next one's, the packets are its. Pure.
class Retrieval {
 public:
  /// How long packets may still come after the spacecraft reported that all were sent.
  static constexpr milliseconds patience{2000};

  explicit Retrieval(std::uint64_t tag, std::uint16_t store) : tag_(tag), store_(store) {}

  /// @return whether it was the event that ends this retrieval; no other one must take it then
  bool on_packet(const ReceivedPacket& received, MonotonicTime now);
  /// Stages of all telecommands.
  void on_stage(const StageReport& report, MonotonicTime now);
  /// Nothing more is expected.
  [[nodiscard]] bool is_over(MonotonicTime now) const;
  /// All packets that the spacecraft sent have come.
  [[nodiscard]] bool is_complete() const { return completed_ && expected_ && received_ >= *expected_; }
  [[nodiscard]] std::uint64_t received() const { return received_; }
  /// The number that the spacecraft sent, once it has reported it.
  [[nodiscard]] std::optional<std::uint64_t> expected() const { return expected_; }
  [[nodiscard]] std::uint64_t tag() const { return tag_; }

 private:
  std::uint64_t tag_;
  std::uint16_t store_;
  std::uint64_t received_ = 0;
  std::optional<std::uint64_t> expected_;
  bool started_ = false;
  bool counting_ = false;  // no other retrieval has started since
  bool completed_ = false;
  bool failed_ = false;
  MonotonicTime last_news_;
};

}  // namespace srfs::ground
