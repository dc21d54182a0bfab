// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.hpp"
#include "base/time.hpp"

namespace srfs::update {

using VersionNumber = std::uint32_t;
/// The deployment's own executable: nothing here ever writes, replaces or removes it.
constexpr VersionNumber golden = 0;

enum class VersionState : std::uint8_t {
  candidate,  ///< stored, not active; never judged
  probation,  ///< active on trial: a death now goes back to the last good version
  committed,  ///< the last good version
  previous,   ///< was the last good version once
  failed,     ///< fell in its probation, was damaged or vetoed; active again only on request
};
[[nodiscard]] std::string_view to_text(VersionState state);

/// A program of a node, beside the golden one.
struct Version {
  VersionNumber number = 0;
  VersionState state = VersionState::candidate;
  std::string sha256;  ///< of the program, 64 lower-case digits
  std::uint64_t octets = 0;
  std::string origin;  ///< for people: where it comes from
  UtcTime added;
  milliseconds probation{0};        ///< how long its process has to live before it is the last good version
  std::uint64_t good_revision = 0;  ///< of the table, when it became the last good one; 0: never
  std::uint32_t resets = 0;         ///< starts of the suite in its probation
  std::string reason;               ///< why it failed

  friend bool operator==(const Version&, const Version&) = default;
};

/// What can be wrong with a change of the table. Nothing has changed then.
enum class VersionRefusal : std::uint8_t {
  unknown_version,
  in_use,        ///< the active or the last good one, or golden, cannot be removed
  not_on_trial,  ///< there is no probation to end
  no_previous,   ///< nothing to go back to
};
[[nodiscard]] std::string_view to_text(VersionRefusal refusal);

/// The versions of one node and which of them runs. Pure. What always holds: the active version is the last
/// good one, or on probation; the last good one is golden or committed; nothing else is committed or on
/// probation.
class VersionTable {
 public:
  static constexpr std::size_t most_versions = 4;  ///< beside golden
  static constexpr std::size_t longest_text = 200;
  static constexpr std::uint32_t most_resets = 2;  ///< in a probation; with the next one it has failed
  static constexpr milliseconds default_probation = std::chrono::minutes(5);
  /// Of a node whose versions the operator has to confirm.
  static constexpr milliseconds default_confirmed_probation = std::chrono::minutes(30);
  static constexpr milliseconds longest_probation = std::chrono::hours(24 * 30);

  [[nodiscard]] std::uint64_t revision() const { return revision_; }  ///< goes up with each change
  [[nodiscard]] VersionNumber active() const { return active_; }
  [[nodiscard]] VersionNumber last_good() const { return last_good_; }
  [[nodiscard]] const std::vector<Version>& versions() const { return versions_; }  ///< by number
  [[nodiscard]] const Version* find(VersionNumber number) const;
  /// The active version while it is on probation.
  [[nodiscard]] const Version* on_trial() const;
  /// The number that the next added version gets: none is used twice.
  [[nodiscard]] VersionNumber next_number() const { return next_; }
  /// What can be started, best first: active, last good, golden, then versions that were good once, newest
  /// first.
  [[nodiscard]] std::vector<VersionNumber> start_order() const;
  /// Where "the previous version" leads: from a probation to the last good version; else to the one that was
  /// it before, at last golden. nullopt: golden is all there is.
  [[nodiscard]] std::optional<VersionNumber> previous() const;

  /// A candidate. With most_versions there, one makes room: the oldest failed one, else the oldest previous,
  /// else the oldest candidate; active and last good never.
  /// @return its number
  VersionNumber add(std::string sha256, std::uint64_t octets, std::string_view origin, UtcTime now);
  /// Makes it active. On probation, unless it is golden or the last good one: those settle at once, and what
  /// was on probation has failed by veto (@p reason). A probation that another one replaces ends without a
  /// verdict.
  [[nodiscard]] Result<void, VersionRefusal> use(VersionNumber number, milliseconds probation,
                                                 std::string_view reason);
  /// The probation of this version ended well.
  [[nodiscard]] Result<void, VersionRefusal> commit(VersionNumber number);
  /// It fell in its probation, or its program is damaged: never chosen by itself again. If it was active or
  /// the last good one, the best of the others takes its place. Golden cannot fail.
  [[nodiscard]] Result<void, VersionRefusal> fail(VersionNumber number, std::string_view reason);
  /// The suite is about to start, after a reset of the computer or a stop: a probation begins anew with its
  /// process, but not for ever. The version on probation fails when it saw more than most_resets.
  [[nodiscard]] Result<void, VersionRefusal> count_reset();
  [[nodiscard]] Result<void, VersionRefusal> remove(VersionNumber number);

  friend bool operator==(const VersionTable&, const VersionTable&) = default;
  /// One line of JSON and its CRC-32C.
  friend std::string encode(const VersionTable& table);
  /// nullopt: damaged, or of a form that does not hold what always holds.
  friend std::optional<VersionTable> decode_versions(std::string_view text);

 private:
  [[nodiscard]] Version* entry(VersionNumber number);
  void settle(VersionNumber number);
  [[nodiscard]] bool is_sound() const;

  std::uint64_t revision_ = 0;
  VersionNumber next_ = 1;
  VersionNumber active_ = golden;
  VersionNumber last_good_ = golden;
  std::vector<Version> versions_;
};

[[nodiscard]] std::string encode(const VersionTable& table);
[[nodiscard]] std::optional<VersionTable> decode_versions(std::string_view text);

}  // namespace srfs::update
