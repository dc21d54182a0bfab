// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.hpp"
#include "suite/deployment.hpp"
#include "suite/instance.hpp"

namespace srfs::suite {

/// The members of the liveness ring, in its order: each checks the next, the last one the first. An empty
/// list or a single member: no node is checked.
struct Membership {
  std::uint32_t generation = 1;
  std::vector<std::string> members;

  static constexpr std::size_t most_members = 64;

  [[nodiscard]] std::optional<std::size_t> position_of(std::string_view node) const;
  /// The member @p steps behind @p position.
  [[nodiscard]] const std::string& after(std::size_t position, std::size_t steps) const {
    return members[(position + steps) % members.size()];
  }
  friend bool operator==(const Membership&, const Membership&) = default;
};

/// The file's text: a head line, the generation, the members, one a line, and the CRC-32C of all before it.
[[nodiscard]] std::string to_text(const Membership& membership);
/// @return the membership, or what is wrong with the text
[[nodiscard]] Result<Membership, std::string> membership_from_text(std::string_view text);

/// A membership with what is wrong in it taken out: names that are no node of the deployment, and a member's
/// second place. @param problems what was taken out, for people
[[nodiscard]] Membership cleaned(Membership membership, const Deployment& deployment,
                                 std::vector<std::string>& problems);

/// With the nodes that were added (added_nodes.hpp): each behind the member that it names, or behind the last
/// one. One that is a member already stays where it is. The generation counts the changes of their list too.
[[nodiscard]] Membership with_added_nodes(Membership membership, const Deployment& deployment);

/// VAR/state/ring/membership
[[nodiscard]] std::filesystem::path membership_file(const VarPaths& var);

struct MembershipReading {
  Membership membership;
  std::vector<std::string> problems;  ///< for people; empty: all is well
};
/// The file's membership; without a file, or with a damaged one, the deployment's ring as generation 1. A
/// damaged file stays as it is. Added nodes are members too. Blocks on the disk.
[[nodiscard]] MembershipReading read_membership(const VarPaths& var, const Deployment& deployment);
/// Replaces the file. Blocks on the disk. @return what went wrong
[[nodiscard]] Result<void, std::string> write_membership(const VarPaths& var, const Membership& membership);

}  // namespace srfs::suite
