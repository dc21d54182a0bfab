// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "base/octets.hpp"

namespace srfs::ros {

/// Which process of which suite a DDS participant is. Travels in the participant's USER_DATA as ROS 2's
/// "key=value;" pairs, beside the `enclave` that ROS 2 wants there; ROS 2 skips keys it does not know
/// (parse_key_value in rmw/impl/cpp/key_value.hpp: keys are alphanumeric, values not empty and without ';').
/// A claim, not a proof: it finds mistakes, not attackers.
struct SuiteIdentity {
  std::string deployment;
  std::string node;  ///< without slash; a tool's own name
  std::uint32_t incarnation = 0;
  friend bool operator==(const SuiteIdentity&, const SuiteIdentity&) = default;
};

/// "enclave=/;srfs=sim/timing/7;" and a final NUL, or without the second pair.
[[nodiscard]] Octets participant_user_data(const std::optional<SuiteIdentity>& identity);
/// The identity in a participant's USER_DATA; nullopt when there is none or it is damaged.
[[nodiscard]] std::optional<SuiteIdentity> find_identity(OctetView user_data);

using GuidPrefix = std::array<std::uint8_t, 12>;

/// Which of the participants discovered so far are foreign: not of this suite (its deployment). Filled on
/// discovery's thread, asked on the work thread. Remembers 64 participants; when full, the oldest that has
/// gone is forgotten, else the oldest foreign one. One that is not remembered counts as foreign.
class KnownParticipants {
 public:
  /// @param own of this process; without it no participant is foreign (a process that belongs to no suite)
  explicit KnownParticipants(std::optional<SuiteIdentity> own);

  /// @param name as it calls itself, @param address where it is; for people
  void discovered(const GuidPrefix& prefix, OctetView user_data, const std::string& name,
                  const std::string& address);
  /// Its last samples may still wait in a reader, so it is remembered.
  void gone(const GuidPrefix& prefix);

  [[nodiscard]] bool is_foreign(const GuidPrefix& prefix) const;
  /// All of the suite that are remembered, this process among them.
  [[nodiscard]] std::vector<GuidPrefix> ours() const;
  /// A participant of another node of this suite that is here.
  struct Member {
    GuidPrefix prefix;
    SuiteIdentity identity;
  };
  [[nodiscard]] std::vector<Member> members() const;
  /// "'/' at 127.0.0.1 (010f1234...)", for people.
  [[nodiscard]] std::string describe(const GuidPrefix& prefix) const;

 private:
  struct Known {
    GuidPrefix prefix;
    bool ours;
    bool here;
    std::string name;
    std::string address;
    SuiteIdentity identity;  ///< of ours
  };
  void make_room();

  const std::optional<SuiteIdentity> own_;
  mutable std::mutex mutex_;
  std::vector<Known> known_;  // oldest first
};

}  // namespace srfs::ros
