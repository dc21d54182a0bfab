// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/ring/membership.hpp"

#include <algorithm>
#include <cstdio>

#include <fmt/format.h>

#include "base/crc32c.hpp"
#include "base/file.hpp"
#include "base/text.hpp"

namespace srfs::suite {
namespace {

constexpr std::string_view head = "srfs ring membership 1\n";
constexpr std::string_view generation_key = "generation ";
constexpr std::string_view checksum_key = "crc32c ";
constexpr std::size_t longest_file = 4096;

/// Takes one line off; nullopt when none is left.
std::optional<std::string_view> take_line(std::string_view& text) {
  const auto end = text.find('\n');
  if (end == std::string_view::npos) return std::nullopt;
  const auto line = text.substr(0, end);
  text.remove_prefix(end + 1);
  return line;
}

}  // namespace

std::optional<std::size_t> Membership::position_of(std::string_view node) const {
  const auto found = std::find(members.begin(), members.end(), node);
  if (found == members.end()) return std::nullopt;
  return static_cast<std::size_t>(found - members.begin());
}

std::string to_text(const Membership& membership) {
  std::string text = fmt::format("{}{}{}\n", head, generation_key, membership.generation);
  for (const std::string& member : membership.members) text += member + "\n";
  return text + fmt::format("{}{:08x}\n", checksum_key, crc32c(as_octets(text)));
}

Result<Membership, std::string> membership_from_text(std::string_view text) {
  if (!text.starts_with(head)) return Err(std::string("not a ring membership"));
  const auto sum_begin = text.rfind(checksum_key);
  if (sum_begin == std::string_view::npos || text.back() != '\n') return Err(std::string("cut off"));
  const auto sum = to_number<std::uint32_t>(text.substr(sum_begin + checksum_key.size(), 8), 16);
  const bool ends_there = text.size() == sum_begin + checksum_key.size() + 9;
  if (!sum || !ends_there || *sum != crc32c(as_octets(text.substr(0, sum_begin))))
    return Err(std::string("wrong checksum"));
  std::string_view rest = text.substr(head.size(), sum_begin - head.size());
  const auto generation_line = take_line(rest);
  if (!generation_line || !generation_line->starts_with(generation_key))
    return Err(std::string("no generation"));
  const auto generation = to_number<std::uint32_t>(generation_line->substr(generation_key.size()));
  if (!generation || *generation == 0) return Err(std::string("no generation"));
  Membership membership{*generation, {}};
  while (const auto line = take_line(rest)) {
    if (membership.members.size() == Membership::most_members) return Err(std::string("too many members"));
    membership.members.emplace_back(*line);
  }
  return membership;
}

Membership cleaned(Membership membership, const Deployment& deployment, std::vector<std::string>& problems) {
  Membership clean{membership.generation, {}};
  for (std::string& member : membership.members) {
    if (deployment.find(member) == nullptr) {
      problems.push_back(fmt::format("'{}' is not a node of the deployment: ignored", member.substr(0, 32)));
    } else if (clean.position_of(member)) {
      problems.push_back(fmt::format("'{}' appears twice: the first place counts", member));
    } else {
      clean.members.push_back(std::move(member));
    }
  }
  return clean;
}

Membership with_added_nodes(Membership membership, const Deployment& deployment) {
  membership.generation += deployment.added_revision;
  auto& members = membership.members;
  for (const AddedNode& node : deployment.added) {
    if (membership.position_of(node.name) || members.size() == Membership::most_members) continue;
    const auto before = std::find(members.begin(), members.end(), node.ring_after);
    members.insert(before == members.end() ? before : before + 1, node.name);
  }
  return membership;
}

std::filesystem::path membership_file(const VarPaths& var) {
  return var.state("ring") / "membership";
}

MembershipReading read_membership(const VarPaths& var, const Deployment& deployment) {
  const auto file = membership_file(var);
  const auto fall_back = [&](std::vector<std::string> problems) {
    return MembershipReading{with_added_nodes({1, deployment.ring.members}, deployment), std::move(problems)};
  };
  std::error_code ec;
  if (!std::filesystem::exists(file, ec) && !ec) return fall_back({});
  const auto text = read_file(file, longest_file);
  if (!text) return fall_back({text.error().message + "; using the deployment's ring"});
  auto membership = membership_from_text(*text);
  if (!membership)
    return fall_back({fmt::format("{}: {}; using the deployment's ring", file.string(), membership.error())});
  MembershipReading reading;
  reading.membership = cleaned(std::move(*membership), deployment, reading.problems);
  reading.membership = with_added_nodes(std::move(reading.membership), deployment);
  for (std::string& problem : reading.problems) problem = fmt::format("{}: {}", file.string(), problem);
  return reading;
}

Result<void, std::string> write_membership(const VarPaths& var, const Membership& membership) {
  const auto written = write_file_atomically(membership_file(var), to_text(membership));
  if (!written) return Err(written.error().message);
  return {};
}

}  // namespace srfs::suite
