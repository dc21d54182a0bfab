// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/octets.hpp"
#include "base/sha256.hpp"
#include "base/time.hpp"
#include "ros/heard_times.hpp"
#include "ros/isolation.hpp"

namespace srfs::ros {

class RtpsDatagram;

using SealKey = std::array<std::uint8_t, 32>;

/// What a limited member seals by. Of it neither the suite's key nor that of another limited member can be
/// found.
[[nodiscard]] SealKey limited_seal_key(const SealKey& suite_key, std::string_view name);
/// What limited members of a suite show each other.
[[nodiscard]] SealKey seal_key_among_limited(const SealKey& suite_key);
/// That of a limited member's participant: the vendor's octets, @p random, and in the octets 8 to 11 a mark
/// that follows from its name. In the prefixes that Fast DDS makes a small number stands there, so nobody
/// takes one for that of a full member, or of another limited one, whoever speaks under it first.
[[nodiscard]] GuidPrefix limited_prefix(std::string_view name, const std::array<std::uint8_t, 6>& random);

/// What a process seals by, and knows the others by.
struct SealKeys {
  SealKey key{};  ///< the suite's, which limited members do not have; of one of those limited_seal_key()
  std::string limited_to = {};  ///< the name of a limited member; empty: a member that all believe
  SealKey among_limited = {};   ///< of a limited member: seal_key_among_limited()
  friend bool operator==(const SealKeys&, const SealKeys&) = default;
};

/// Datagrams of the suite, or in a member's name, that are not taken. Each is dropped.
struct ForgedDatagrams {
  std::uint64_t unsealed = 0;    ///< in a member's name, without a seal
  std::uint64_t wrong_seal = 0;  ///< in its name, with one of another key or of other octets
  std::uint64_t repeated = 0;    ///< one that came before
  std::uint64_t about = 0;       ///< in another name, what they tell discovery is about a member
  std::uint64_t beyond = 0;      ///< of a limited member, in the name of another one, or about it
  [[nodiscard]] std::uint64_t all() const { return unsealed + wrong_seal + repeated + about + beyond; }
};

/// Shows of each datagram whether a process of the suite sent it, and thereby which participants are the
/// suite's: SuiteIdentity is a claim, this is the proof. The seal is a submessage behind the header of the
/// RTPS message (RTPS 2.2, 9.4.5.1.1: from 0x80 on they are the vendor's, and ignored by those who do not
/// know them): the sender's CLOCK_MONOTONIC, different in each datagram of a process, and HMAC-SHA-256 over
/// the RTPS header, this time and SHA-256 of all other octets, cut to 16 octets. (Not over the content of the
/// submessage in which Fast DDS counts what it sent.) A participant that has sent a sealed datagram is a
/// member, and speaks by sealed ones alone. All others are foreign, also those of another suite in the same
/// domain, which seal with a key of their own: that is no forgery, as long as they say nothing in a member's
/// name.
///
/// A *limited* member has a key of its own and seals by that, with its name beside it. The others know from
/// it who it is, believe it for itself alone (Participant::limited_name), and add a proof by its key to what
/// they send once they have heard it. Each name has one participant at a time, the newest, whose GUID prefix
/// bears the name's mark (limited_prefix). Limited members know each other by a key that they share: among
/// them a name is a claim.
///
/// What was recorded is worthless: each datagram is taken once at each port (HeardTimes), and none that is
/// older than `longest_age`. Any thread.
class DatagramSeal {
 public:
  static constexpr std::size_t longest_name = 32;
  static constexpr std::size_t most_limited = 16;  ///< the one that was silent longest is forgotten
  static constexpr std::size_t tag_octets = 16;
  /// Of a seal, its header and time with it. Room for it is kept in every message.
  static constexpr std::size_t most_octets = 16 + (1 + most_limited) * tag_octets;
  static_assert(most_octets >= 16 + longest_name + 2 * tag_octets);
  static constexpr nanoseconds longest_age = seconds(60);
  /// All processes have one clock. What is from later shows no member.
  static constexpr nanoseconds longest_ahead = seconds(1);
  static constexpr std::size_t most_members =
      64;  ///< remembered; the one that was silent longest is forgotten
  /// A participant announces itself before it says anything else. What is longer and comes from an unknown
  /// one costs no hash.
  static constexpr std::size_t longest_of_unknown = 8192;
  static constexpr nanoseconds between_readings = seconds(1);

  using ReadKeys = std::function<std::optional<SealKeys>()>;
  /// @param read_keys  called when a seal is of another key, at most once a second: the key changes when its
  ///                   file was lost. Seals of the key before hold, too
  DatagramSeal(SealKeys keys, ReadKeys read_keys);
  ~DatagramSeal();
  DatagramSeal(const DatagramSeal&) = delete;
  DatagramSeal& operator=(const DatagramSeal&) = delete;

  /// @return the message with its seal, in @p out
  void seal(OctetView message, MonotonicTime now, Octets& out);

  enum class Verdict : std::uint8_t {
    member,   ///< sealed
    foreign,  ///< without the suite's seal, and of no member
    forged,   ///< without it, in a member's name or about a member; or one that came before
    stale,  ///< the suite's, but from before: this process stood still, or somebody repeats what he recorded
  };
  /// @param heard  of the port at which it came in; used by no other thread at the same time
  [[nodiscard]] Verdict judge(OctetView datagram, MonotonicTime now, HeardTimes& heard);
  /// A participant of this process: never forgotten.
  void add_own(const GuidPrefix& prefix);
  [[nodiscard]] bool is_member(const GuidPrefix& prefix) const;
  /// nullopt: foreign; empty: a member that all believe; else the name of a limited one.
  [[nodiscard]] std::optional<std::string> limit_of(const GuidPrefix& prefix) const;
  /// Whether this process is a limited member.
  [[nodiscard]] bool is_limited() const;
  [[nodiscard]] ForgedDatagrams forged() const;
  [[nodiscard]] std::uint64_t stale() const { return stale_; }
  /// Changes with the members.
  [[nodiscard]] std::uint64_t revision() const { return revision_; }
  /// The key that this process seals by.
  [[nodiscard]] SealKeys keys() const;

 private:
  struct Parts;
  struct KeyRing;
  struct Tags;
  struct Member {
    GuidPrefix prefix;
    std::string limited_to;
    MonotonicTime since;  ///< in the seal by which it became one
  };
  struct Limited {
    std::string name;
    GuidPrefix prefix;
    HmacSha256 mac;
  };
  struct Proven {
    std::string name = {};  ///< of a limited member; empty: of another one
    std::optional<HmacSha256> mac = {};
    bool is_known = false;  ///< the key is that of before
  };
  [[nodiscard]] MonotonicTime next_time(MonotonicTime now);
  [[nodiscard]] static std::optional<Parts> parts_of(OctetView datagram);
  [[nodiscard]] std::optional<Proven> prove(const Parts& parts, MonotonicTime now);
  [[nodiscard]] std::optional<Proven> prove_with(const KeyRing& ring, const Parts& parts,
                                                 const Sha256::Digest& content) const;
  [[nodiscard]] bool read_again(MonotonicTime now);
  [[nodiscard]] bool oversteps(const Proven& who, const RtpsDatagram& message, OctetView datagram) const;
  [[nodiscard]] Verdict judge_unproven(const RtpsDatagram& message, OctetView datagram,
                                       const std::optional<Parts>& parts);
  [[nodiscard]] Verdict admit(const GuidPrefix& sender, Proven who, MonotonicTime sealed, MonotonicTime now,
                              HeardTimes& heard);
  [[nodiscard]] bool has(const GuidPrefix& prefix) const;
  [[nodiscard]] const Member* find(const GuidPrefix& prefix) const;
  void remember(const GuidPrefix& prefix, const std::string& limited_to, MonotonicTime sealed);
  [[nodiscard]] bool remember_limited(const GuidPrefix& prefix, Proven who, MonotonicTime sealed);
  [[nodiscard]] std::vector<GuidPrefix> others_than(const GuidPrefix& prefix) const;
  void make_tags();
  Verdict forge(std::uint64_t ForgedDatagrams::*reason);

  const ReadKeys read_keys_;
  std::atomic<std::uint64_t> stale_{0};
  std::atomic<std::uint64_t> revision_{0};
  mutable std::mutex mutex_;  // guards what follows, and is held for no hash
  std::shared_ptr<const KeyRing> ring_;
  std::shared_ptr<const KeyRing> before_;
  std::shared_ptr<const Tags> tags_;  // of what is sent
  MonotonicTime key_read_;
  std::vector<GuidPrefix> own_;
  std::vector<Member> members_;   // the one heard last in front
  std::vector<Limited> limited_;  // the same
  ForgedDatagrams forged_;
  std::int64_t last_sealed_ = 0;
};

/// Participants of this process that have an executor seal what they send, and judge what they hear. A
/// process is of one suite. Before its first participant.
void seal_datagrams(SealKeys keys, DatagramSeal::ReadKeys read_keys);
/// nullptr: nothing is sealed.
[[nodiscard]] const std::shared_ptr<DatagramSeal>& datagram_seal();

}  // namespace srfs::ros
