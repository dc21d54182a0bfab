// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "ros/graph.hpp"
#include "ros/isolation.hpp"

namespace srfs::ros {

/// A sample of a writer.
struct SampleId {
  Gid writer{};
  std::int64_t sequence = 0;
  friend bool operator==(const SampleId&, const SampleId&) = default;
};

/// One DATA or DATA_FRAG submessage of an RTPS message (RTPS 2.2, 9.4.5.3 and 9.4.5.4).
struct AnnouncedSample {
  SampleId id;
  std::uint64_t octets = 0;  ///< of the whole sample, as it claims to be
  bool is_fragment = false;
  /// It holds what it says it holds. Fast DDS 2.9 does not look, and copies what lies behind the datagram.
  bool is_sound = false;
};

/// What a datagram says before any memory is taken for it, read as Fast DDS reads it. Octets that are no RTPS
/// message: what was read up to there.
class RtpsDatagram {
 public:
  explicit RtpsDatagram(OctetView datagram);

  /// The participant that sent it; nullopt: no RTPS message.
  [[nodiscard]] const std::optional<GuidPrefix>& sender() const { return sender_; }
  /// Calls @p visit for each sample, and for each other participant that it speaks for (INFO_SRC).
  void for_each(const std::function<void(const AnnouncedSample&)>& sample,
                const std::function<void(const GuidPrefix&)>& speaks_for) const;

 private:
  OctetView datagram_;
  std::optional<GuidPrefix> sender_;
};

/// Where the kernel cannot sort datagrams by their sender (SortedSockets): how long foreign traffic may hold
/// the work thread at a stretch. While the socket was not found empty for `longest_behind`, what participants
/// outside the suite send is dropped unread, and for `pause` afterwards. The suite's own datagrams wait in
/// the same socket and are always read. Pure.
class LoadShedder {
 public:
  static constexpr nanoseconds longest_behind = milliseconds(50);
  static constexpr nanoseconds pause = milliseconds(50);

  /// @param behind for so long each read has left something in the socket
  [[nodiscard]] bool shed(MonotonicTime now, nanoseconds behind) {
    if (behind > longest_behind) until_ = now + pause;
    return until_ && now < *until_;
  }

 private:
  std::optional<MonotonicTime> until_;
};

/// Octets of samples above this are counted against what strangers may send.
inline constexpr std::uint64_t small_sample = 8U << 10;

/// How many octets of large samples strangers may send: so many at once, and so many a second. What finds
/// none left is dropped, and reliable writers send it again. Pure.
class OctetBudget {
 public:
  static constexpr std::uint64_t at_once = 4U << 20;
  static constexpr std::uint64_t a_second = 4U << 20;

  [[nodiscard]] bool take(std::uint64_t octets, MonotonicTime now) {
    const double refilled = std::chrono::duration<double>(now - at_).count() * static_cast<double>(a_second);
    left_ = std::min(left_ + refilled, static_cast<double>(at_once));
    at_ = now;
    if (left_ < static_cast<double>(octets)) return false;
    left_ -= static_cast<double>(octets);
    return true;
  }

 private:
  double left_ = at_once;
  MonotonicTime at_;
};

/// The large samples of strangers that take memory. Fast DDS takes at the first fragment what the sample
/// claims, and keeps it until the sample has been taken by the node, or its writer is gone: what never
/// becomes whole stays. Bounded: so many samples, and so many octets that they claim together; one that
/// claims more passes when it is alone. Further fragments need no room, in any order, as often as they are
/// sent. Pure.
class HeldSamples {
 public:
  static constexpr std::size_t most = 64;
  static constexpr std::uint64_t most_octets = 4U << 20;
  /// A reliable writer repeats within seconds (3 s in ROS 2): who sends nothing for so long has stopped.
  static constexpr nanoseconds longest_pause = seconds(10);

  HeldSamples() { held_.reserve(most); }

  /// @param samples of one datagram. @return false: there is no room for those that are new
  [[nodiscard]] bool admit(std::span<const AnnouncedSample> samples, MonotonicTime now);
  /// The one that has got nothing for longest, if that is too long.
  [[nodiscard]] std::optional<SampleId> stalled(MonotonicTime now) const;
  /// Looks at it as if it had got something now.
  void be_patient_with(const SampleId& id, MonotonicTime now);
  void drop(const SampleId& id);
  /// The writer's samples up to this one take no memory any longer.
  void release(const Gid& writer, std::int64_t up_to);
  [[nodiscard]] bool empty() const { return held_.empty(); }

 private:
  struct Held {
    SampleId id;
    std::uint64_t octets;
    MonotonicTime touched;
  };
  [[nodiscard]] Held* find(const SampleId& id);

  std::vector<Held> held_;
};

/// Decides which datagrams reach Fast DDS: a sample that claims to be larger than the reader of its topic
/// takes is dropped before memory is set aside for it, and foreign participants are dropped where the
/// deployment says so, while the work thread is behind, or when their large samples are too many. Any thread.
class DatagramFilter {
 public:
  enum class Verdict : std::uint8_t { pass, malformed, foreign, shed };

  /// @param is_foreign asked for each datagram @param drop_foreign always, not only while behind
  DatagramFilter(std::function<bool(const GuidPrefix&)> is_foreign, bool drop_foreign)
      : is_foreign_(std::move(is_foreign)), drop_foreign_(drop_foreign) {}

  /// A writer feeds a reader that takes samples of at most @p octets; @p refused counts those that claim
  /// more, or do not hold what they say.
  void matched(const Gid& writer, const Gid& reader, std::uint64_t octets,
               std::shared_ptr<std::atomic<std::uint64_t>> refused);
  void unmatched(const Gid& writer, const Gid& reader);
  /// The reader has ended, and with it all that it held.
  void ended(const Gid& reader);
  /// The node took a sample of the writer from the reader: those before it have been taken, too, or are lost.
  void taken(const SampleId& sample, const Gid& reader);
  /// False: taken() has nothing to do.
  [[nodiscard]] bool holds_any() const { return holds_any_; }

  /// @param shedding the work thread is behind: nothing foreign passes
  [[nodiscard]] Verdict judge(OctetView datagram, bool shedding, MonotonicTime now);

  /// Of discovery's port, where no reader of the node listens. Discovery's own readers have no bound, and
  /// what Fast DDS says there fits into one datagram: fragments are dropped.
  [[nodiscard]] Verdict judge_discovery(OctetView datagram);

  /// A participant to be forgotten, until it announces itself again: its sample was left unfinished, while
  /// there was no room for another one. Each is returned once.
  [[nodiscard]] std::optional<GuidPrefix> next_stalled();

  /// So many datagrams of foreign participants found their socket full. @param next the one read after them
  void unread(OctetView next, std::uint64_t count);

  /// Datagrams of foreign participants that were dropped, and the last one of them.
  [[nodiscard]] std::uint64_t dropped_foreign() const { return dropped_foreign_; }
  [[nodiscard]] std::optional<GuidPrefix> last_dropped() const;

 private:
  struct Match {
    Gid writer;
    Gid reader;
    std::uint64_t octets;
    std::shared_ptr<std::atomic<std::uint64_t>> refused;
    std::int64_t taken = 0;  ///< newest sample, while any are held
  };
  [[nodiscard]] bool refuses(const AnnouncedSample& sample);
  [[nodiscard]] bool has_room(const RtpsDatagram& datagram, MonotonicTime now);
  [[nodiscard]] bool give_up_one(MonotonicTime now);
  [[nodiscard]] bool is_matched(const Gid& writer) const;
  [[nodiscard]] std::int64_t taken_by_all(const Gid& writer) const;
  [[nodiscard]] std::optional<GuidPrefix> foreign_sender(const RtpsDatagram& datagram) const;
  [[nodiscard]] Verdict drop(const GuidPrefix& who, Verdict verdict);
  void matches_changed();

  const std::function<bool(const GuidPrefix&)> is_foreign_;
  const bool drop_foreign_;
  std::atomic<std::uint64_t> smallest_{
      std::numeric_limits<std::uint64_t>::max()};  // nothing below is looked up
  std::atomic<std::uint64_t> dropped_foreign_{0};
  std::atomic<bool> holds_any_{false};
  mutable std::mutex mutex_;  // guards what follows
  OctetBudget large_;
  HeldSamples held_;
  std::vector<GuidPrefix> stalled_;  // at most as many as are held
  std::vector<Match> matches_;
  std::optional<GuidPrefix> last_dropped_;
};

}  // namespace srfs::ros
