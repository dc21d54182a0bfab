// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.hpp"
#include "suite/deployment.hpp"
#include "suite/instance.hpp"
#include "wire/boot_record.hpp"

namespace srfs::suite {

/// What operators have left behind may be why the suite does not become healthy: holds, desired states, kept
/// parameters. After RingSettings::unhealthy_starts starts in a row without a healthy boot they are set
/// aside, on disk: the suite starts as the deployment has it. ring.restore_orders puts orders back (of
/// several of one kind the newest), parameters.restore values.

/// Starts of the suite in a row, each of which followed another one that ended neither healthy nor in order.
struct StartCount {
  std::uint32_t starts = 0;
  std::uint32_t healthy_boot = 0;  ///< number of the last boot that is known to have become healthy

  friend bool operator==(const StartCount&, const StartCount&) = default;
};
/// One more start. @param last  boot record of the boot before; nullopt: none. Pure.
[[nodiscard]] StartCount next_start(StartCount before, const std::optional<wire::BootRecord>& last);
[[nodiscard]] std::string encode(const StartCount& count);
/// nullopt: damaged.
[[nodiscard]] std::optional<StartCount> decode_start_count(std::string_view text);

/// Something of an operator's that the next start of a node would use.
struct Leftover {
  enum class Kind : std::uint8_t { hold, desired_state, parameters };
  std::string node;
  Kind kind = Kind::hold;

  friend bool operator==(const Leftover&, const Leftover&) = default;
};
[[nodiscard]] std::string_view to_text(Leftover::Kind kind);
/// Blocks on the disk, as all below.
[[nodiscard]] std::vector<Leftover> find_leftovers(const VarPaths& var, const Deployment& deployment);
/// Sets one aside. After a power loss at any instant it is there as before, or set aside; then nothing is
/// left to do. @param saved  now, UTC, for people. @return what went wrong
[[nodiscard]] Result<void, std::string> set_aside(const VarPaths& var, const Leftover& leftover,
                                                  const std::string& saved);
/// Puts back hold and desired state of a node, where no newer order stands. @return whether there was one; or
/// what went wrong
[[nodiscard]] Result<bool, std::string> restore_orders(const VarPaths& var, const std::string& node);

/// What was set aside and is not reported yet.
struct SetAsideNote {
  std::uint32_t starts = 0;
  std::string what;  ///< for people
};
[[nodiscard]] std::optional<SetAsideNote> read_set_aside_note(const VarPaths& var);
[[nodiscard]] Result<void, std::string> remove_set_aside_note(const VarPaths& var);

/// Before `srfs up` starts the first node of a suite of which none runs: counts the start, and sets aside
/// what is left behind once there were too many. What cannot be done is logged; the suite starts all the
/// same.
void begin_suite_start(const VarPaths& var, const Deployment& deployment);
/// The suite ended in order, or has become healthy: the count of starts begins anew.
void forget_suite_starts(const VarPaths& var);

}  // namespace srfs::suite
