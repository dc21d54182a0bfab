// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "ros/isolation.hpp"

namespace srfs::ros {

/// What all processes of a suite share, and nobody else has.
using SealKey = std::array<std::uint8_t, 32>;

/// Datagrams that bear a member's name and are not its own. Each is dropped.
struct ForgedDatagrams {
  std::uint64_t unsealed = 0;    ///< in its name, without a seal
  std::uint64_t wrong_seal = 0;  ///< in its name, with one of another key or of other octets
  std::uint64_t old = 0;         ///< in its name, with a time that is too far away
  std::uint64_t about = 0;       ///< in another name, what they tell discovery is about a member
  [[nodiscard]] std::uint64_t all() const { return unsealed + wrong_seal + old + about; }
};

/// Shows of each datagram whether a process of the suite sent it, and thereby which participants are the
/// suite's: SuiteIdentity is a claim, this is the proof. The seal is a submessage behind the header of the
/// RTPS message (RTPS 2.2, 9.4.5.1.1: from 0x80 on they are the vendor's, and ignored by those who do not
/// know them): the sender's CLOCK_MONOTONIC and HMAC-SHA-256 over all other octets and this time, cut to 16
/// octets. (Not over the content of the submessage in which Fast DDS counts what it sent.) What is older than
/// `longest_age` is not accepted, so that what somebody recorded is worthless soon.
///
/// A participant that has sent a sealed datagram is a member, and speaks by sealed ones alone. All others are
/// foreign, also those of another suite in the same domain, which seal with a key of their own: that is no
/// forgery, as long as they say nothing in a member's name. Any thread.
class DatagramSeal {
 public:
  static constexpr std::size_t octets = 28;
  static constexpr nanoseconds longest_age = seconds(60);
  static constexpr std::size_t most_members =
      64;  ///< remembered; the one that was silent longest is forgotten
  static constexpr nanoseconds between_readings = seconds(1);

  using ReadKey = std::function<std::optional<SealKey>()>;
  /// @param read_key  called when a seal is of another key, at most once a second: the key changes when its
  ///                  file was lost. Seals of the key before hold, too
  DatagramSeal(const SealKey& key, ReadKey read_key);
  ~DatagramSeal();
  DatagramSeal(const DatagramSeal&) = delete;
  DatagramSeal& operator=(const DatagramSeal&) = delete;

  /// @return the message with its seal, in @p out
  void seal(OctetView message, MonotonicTime now, Octets& out);

  enum class Verdict : std::uint8_t {
    member,   ///< sealed
    foreign,  ///< without the suite's seal, and of no member
    forged,   ///< without it, in a member's name or about a member
  };
  [[nodiscard]] Verdict judge(OctetView datagram, MonotonicTime now);
  /// A participant of this process: never forgotten.
  void add_own(const GuidPrefix& prefix);
  [[nodiscard]] bool is_member(const GuidPrefix& prefix) const;
  [[nodiscard]] ForgedDatagrams forged() const;

 private:
  class Mac;
  enum class Seal : std::uint8_t { none, good, wrong, old };
  [[nodiscard]] Seal seal_of(OctetView datagram, MonotonicTime now);
  [[nodiscard]] bool is_genuine(OctetView datagram, MonotonicTime now);
  [[nodiscard]] bool holds(OctetView datagram);
  [[nodiscard]] bool has(const GuidPrefix& prefix) const;
  void remember(const GuidPrefix& prefix);
  Verdict forge(std::uint64_t ForgedDatagrams::*reason);

  const ReadKey read_key_;
  mutable std::mutex mutex_;  // guards what follows
  std::unique_ptr<Mac> mac_;
  std::unique_ptr<Mac> before_;
  MonotonicTime key_read_;
  std::vector<GuidPrefix> own_;
  std::vector<GuidPrefix> members_;  // the one heard last in front
  ForgedDatagrams forged_;
};

/// Participants of this process that have an executor seal what they send, and judge what they hear. A
/// process is of one suite. Before its first participant.
void seal_datagrams(const SealKey& key, DatagramSeal::ReadKey read_key);
/// nullptr: nothing is sealed.
[[nodiscard]] const std::shared_ptr<DatagramSeal>& datagram_seal();

}  // namespace srfs::ros
