// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/isolation.hpp"

#include <algorithm>
#include <string_view>

#include <fmt/format.h>

#include "base/text.hpp"

namespace srfs::ros {
namespace {

constexpr std::size_t most_known = 64;
constexpr std::string_view suite_key = ";srfs=";

/// What may stand in one part of the value: ';' ends it, '/' separates the parts.
std::string as_part(const std::string& text) {
  std::string part = text.empty() ? "_" : text;
  for (char& c : part) {
    if (c == ';' || c == '/' || static_cast<unsigned char>(c) < 0x20) c = '_';
  }
  return part;
}

}  // namespace

Octets participant_user_data(const std::optional<SuiteIdentity>& identity) {
  std::string text = "enclave=/;";
  if (identity)
    text += fmt::format("srfs={}/{}/{};", as_part(identity->deployment), as_part(identity->node),
                        identity->incarnation);
  Octets octets(text.begin(), text.end());
  octets.push_back(0);  // as rmw_fastrtps sends it
  return octets;
}

std::optional<SuiteIdentity> find_identity(OctetView user_data) {
  const std::string text(user_data.begin(), user_data.end());
  const std::size_t key = text.find(suite_key);
  if (key == std::string::npos) return std::nullopt;
  const std::size_t begin = key + suite_key.size();
  const std::size_t end = text.find(';', begin);
  if (end == std::string::npos) return std::nullopt;
  const std::string_view value = std::string_view(text).substr(begin, end - begin);
  const std::size_t first = value.find('/');
  const std::size_t last = value.rfind('/');
  if (first == std::string_view::npos || first == last) return std::nullopt;
  SuiteIdentity identity{std::string(value.substr(0, first)),
                         std::string(value.substr(first + 1, last - first - 1)), 0};
  const auto incarnation = to_number<decltype(identity.incarnation)>(value.substr(last + 1));
  if (!incarnation) return std::nullopt;
  identity.incarnation = *incarnation;
  return identity;
}

KnownParticipants::KnownParticipants(std::optional<SuiteIdentity> own) : own_(std::move(own)) {}

void KnownParticipants::make_room() {
  if (known_.size() < most_known) return;
  auto oldest = std::find_if(known_.begin(), known_.end(), [](const Known& k) { return !k.here; });
  if (oldest == known_.end())
    oldest = std::find_if(known_.begin(), known_.end(), [](const Known& k) { return !k.ours; });
  known_.erase(oldest == known_.end() ? known_.begin() : oldest);
}

void KnownParticipants::discovered(const GuidPrefix& prefix, OctetView user_data, const std::string& name,
                                   const std::string& address) {
  if (!own_) return;
  const auto identity = find_identity(user_data);
  const bool ours = identity && identity->deployment == as_part(own_->deployment);
  const std::lock_guard lock(mutex_);
  std::erase_if(known_, [&](const Known& k) { return k.prefix == prefix; });
  make_room();
  known_.push_back({prefix, ours, true, name.substr(0, 64), address, ours ? *identity : SuiteIdentity{}});
}

void KnownParticipants::gone(const GuidPrefix& prefix) {
  const std::lock_guard lock(mutex_);
  for (Known& known : known_) {
    if (known.prefix == prefix) known.here = false;
  }
}

bool KnownParticipants::is_foreign(const GuidPrefix& prefix) const {
  if (!own_) return false;
  const std::lock_guard lock(mutex_);
  return std::none_of(known_.begin(), known_.end(),
                      [&](const Known& k) { return k.prefix == prefix && k.ours; });
}

std::vector<GuidPrefix> KnownParticipants::ours() const {
  std::vector<GuidPrefix> ours;
  const std::lock_guard lock(mutex_);
  for (const Known& known : known_) {
    if (known.ours) ours.push_back(known.prefix);
  }
  return ours;
}

std::vector<KnownParticipants::Member> KnownParticipants::members() const {
  std::vector<Member> members;
  const std::lock_guard lock(mutex_);
  for (const Known& known : known_) {
    if (known.ours && known.here && known.identity.node != as_part(own_->node))
      members.push_back({known.prefix, known.identity});
  }
  return members;
}

std::string KnownParticipants::describe(const GuidPrefix& prefix) const {
  const std::string guid = to_hex(OctetView(prefix.data(), prefix.size()));
  const std::lock_guard lock(mutex_);
  for (const Known& known : known_) {
    if (known.prefix == prefix) return fmt::format("'{}' at {} ({})", known.name, known.address, guid);
  }
  return fmt::format("unknown ({})", guid);
}

}  // namespace srfs::ros
