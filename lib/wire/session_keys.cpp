// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/session_keys.hpp"

#include <openssl/crypto.h>

#include <algorithm>
#include <charconv>
#include <set>

#include <fmt/format.h>

#include "base/checked_text.hpp"

namespace srfs::wire {
namespace {

/// Takes @p mark and a number off the front. nullopt: they are not there.
template <class Number>
std::optional<Number> take(std::string_view& text, std::string_view mark) {
  if (!text.starts_with(mark)) return std::nullopt;
  text.remove_prefix(mark.size());
  Number number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc()) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return number;
}

std::optional<SessionKeys::Key> take_key(std::string_view& text) {
  constexpr std::size_t digits = 2 * sdls_key_octets;
  const auto id = take<std::uint16_t>(text, " k");
  const auto state = take<std::uint8_t>(text, ":");
  if (!id || !state || *state > static_cast<std::uint8_t>(KeyState::deactivated)) return std::nullopt;
  if (text.size() < 1 + digits || text.front() != ':') return std::nullopt;
  const auto key = SdlsKey::from_hex(text.substr(1, digits));
  if (!key) return std::nullopt;
  text.remove_prefix(1 + digits);
  return SessionKeys::Key{.id = *id, .state = static_cast<KeyState>(*state), .octets = KeyOctets(*key)};
}

std::optional<SessionKeys::Use> take_use(std::string_view& text) {
  const auto spi = take<std::uint16_t>(text, " u");
  const auto current = take<std::uint16_t>(text, "=");
  if (!spi || !current) return std::nullopt;
  SessionKeys::Use use{.spi = *spi, .current = *current};
  if (!text.starts_with('>')) return use;
  use.next = take<std::uint16_t>(text, ">");
  if (!use.next) return std::nullopt;
  return use;
}

}  // namespace

KeyOctets::~KeyOctets() {
  OPENSSL_cleanse(octets_.data(), octets_.size());
}

// ---- what there is

const SessionKeys::Key* SessionKeys::find(std::uint16_t id) const {
  const auto found = std::find_if(keys_.begin(), keys_.end(), [id](const Key& k) { return k.id == id; });
  return found == keys_.end() ? nullptr : &*found;
}

SessionKeys::Key* SessionKeys::find_own(std::uint16_t id) {
  const auto found = std::find_if(keys_.begin(), keys_.end(), [id](const Key& k) { return k.id == id; });
  return found == keys_.end() ? nullptr : &*found;
}

std::optional<SessionKeys::Use> SessionKeys::use_of(std::uint16_t spi) const {
  const auto found = std::find_if(uses_.begin(), uses_.end(), [spi](const Use& u) { return u.spi == spi; });
  if (found == uses_.end()) return std::nullopt;
  return *found;
}

SessionKeys::Use& SessionKeys::use(std::uint16_t spi) {
  const auto found = std::find_if(uses_.begin(), uses_.end(), [spi](const Use& u) { return u.spi == spi; });
  return found != uses_.end() ? *found : uses_.emplace_back(Use{.spi = spi});
}

bool SessionKeys::is_used(std::uint16_t id) const {
  return std::any_of(uses_.begin(), uses_.end(),
                     [id](const Use& u) { return u.current == id || u.next == id; });
}

bool SessionKeys::has(OctetView key) const {
  return std::any_of(keys_.begin(), keys_.end(), [key](const Key& k) {
    return std::equal(key.begin(), key.end(), k.octets.view().begin(), k.octets.view().end());
  });
}

// ---- changes

SessionKeys SessionKeys::changed() const {
  SessionKeys after = *this;
  ++after.generation_;
  return after;
}

Result<SessionKeys, KeyRefusal> SessionKeys::uploaded(std::uint16_t id, const SdlsKey& key) const {
  if (id < first_id || id > last_id) return Err(KeyRefusal::unknown_key);
  const KeyOctets octets(key);
  const Key* const known = find(id);
  if (known != nullptr && known->octets == octets && known->state != KeyState::deactivated) return *this;
  if (known != nullptr && known->state != KeyState::pre_active) return Err(KeyRefusal::wrong_state);
  if (has(octets.view())) return Err(KeyRefusal::not_a_new_key);
  SessionKeys after = changed();
  if (Key* const replaced = after.find_own(id); replaced != nullptr) {
    replaced->octets = octets;
    return after;
  }
  if (keys_.size() == max_keys) return Err(KeyRefusal::table_full);
  after.keys_.push_back({.id = id, .state = KeyState::pre_active, .octets = octets});
  return after;
}

Result<SessionKeys, KeyRefusal> SessionKeys::activated(std::uint16_t id) const {
  const Key* const key = find(id);
  if (key == nullptr) return Err(KeyRefusal::unknown_key);
  if (key->state == KeyState::active) return *this;
  if (key->state != KeyState::pre_active) return Err(KeyRefusal::wrong_state);
  SessionKeys after = changed();
  after.find_own(id)->state = KeyState::active;
  return after;
}

Result<SessionKeys, KeyRefusal> SessionKeys::deactivated(std::uint16_t id) const {
  const Key* const key = find(id);
  if (key == nullptr) return Err(KeyRefusal::unknown_key);
  if (key->state == KeyState::deactivated) return *this;
  if (is_used(id)) return Err(KeyRefusal::key_in_use);
  SessionKeys after = changed();
  after.find_own(id)->state = KeyState::deactivated;
  return after;
}

Result<SessionKeys, KeyRefusal> SessionKeys::destroyed(std::uint16_t id) const {
  const Key* const key = find(id);
  if (key == nullptr) return Err(KeyRefusal::unknown_key);
  if (is_used(id)) return Err(KeyRefusal::key_in_use);
  SessionKeys after = changed();
  std::erase_if(after.keys_, [id](const Key& k) { return k.id == id; });
  return after;
}

Result<SessionKeys, KeyRefusal> SessionKeys::rekeyed(std::uint16_t spi, std::uint16_t id) const {
  const Key* const key = find(id);
  if (key == nullptr) return Err(KeyRefusal::unknown_key);
  if (key->state != KeyState::active) return Err(KeyRefusal::wrong_state);
  const Use before = use_of(spi).value_or(Use{.spi = spi});
  if (before.next == id || (before.current == id && !before.next)) return *this;
  if (is_used(id) && before.current != id) return Err(KeyRefusal::key_in_use);
  if (!use_of(spi) && uses_.size() == max_uses) return Err(KeyRefusal::table_full);
  SessionKeys after = changed();
  Use& use = after.use(spi);
  use.next = use.current == id ? std::nullopt : std::optional(id);
  return after;
}

SessionKeys SessionKeys::confirmed(std::uint16_t spi, std::uint16_t id) const {
  const auto before = use_of(spi);
  const Key* const key = find(id);
  if (!before || key == nullptr || key->state != KeyState::active || before->current == id) return *this;
  SessionKeys after = changed();
  Use& use = after.use(spi);
  use.current = id;
  if (use.next == id) use.next.reset();
  std::erase_if(after.keys_, [&](const Key& k) { return k.id == before->current; });
  return after;
}

SessionKeys SessionKeys::lost(const std::vector<std::uint16_t>& spis) {
  SessionKeys keys;
  keys.generation_ = 1;
  for (const std::uint16_t spi : spis) {
    if (keys.uses_.size() < max_uses) keys.uses_.push_back({.spi = spi, .current = lost_id});
  }
  return keys;
}

// ---- on disk

bool SessionKeys::is_sound() const {
  std::set<std::uint16_t> ids;
  for (const Key& key : keys_) {
    const bool twice =
        std::count_if(keys_.begin(), keys_.end(), [&](const Key& k) { return k.octets == key.octets; }) != 1;
    if (key.id < first_id || key.id > last_id || !ids.insert(key.id).second || twice) return false;
  }
  std::set<std::uint16_t> spis;
  std::set<std::uint16_t> used;
  const auto may_use = [&](std::uint16_t id) {
    const Key* const key = find(id);
    return key != nullptr && key->state == KeyState::active && used.insert(id).second;
  };
  for (const Use& use : uses_) {
    const bool own = use.current != file_id && use.current != lost_id;
    if (!spis.insert(use.spi).second || (own && !may_use(use.current))) return false;
    if (use.next && !may_use(*use.next)) return false;
  }
  return keys_.size() <= max_keys && uses_.size() <= max_uses;
}

std::string encode_session_keys(const SessionKeys& keys) {
  std::string text = fmt::format("{}", keys.generation_);
  for (const SessionKeys::Key& key : keys.keys_)
    text += fmt::format(" k{}:{}:{}", key.id, static_cast<unsigned>(key.state), to_hex(key.octets.view()));
  for (const SessionKeys::Use& use : keys.uses_) {
    text += fmt::format(" u{}={}", use.spi, use.current);
    if (use.next) text += fmt::format(">{}", *use.next);
  }
  return with_check(text);
}

std::optional<SessionKeys> decode_session_keys(std::string_view text) {
  const auto whole = without_check(text);
  if (!whole) return std::nullopt;
  std::string_view rest = *whole;
  SessionKeys keys;
  const auto generation = take<std::uint64_t>(rest, "");
  if (!generation) return std::nullopt;
  keys.generation_ = *generation;
  while (!rest.empty()) {
    if (rest.starts_with(" k")) {
      auto key = take_key(rest);
      if (!key || keys.keys_.size() == SessionKeys::max_keys) return std::nullopt;
      keys.keys_.push_back(std::move(*key));
    } else {
      const auto use = take_use(rest);
      if (!use || keys.uses_.size() == SessionKeys::max_uses) return std::nullopt;
      keys.uses_.push_back(*use);
    }
  }
  if (!keys.is_sound()) return std::nullopt;
  return keys;
}

StateFile<SessionKeys> session_key_file(const std::filesystem::path& path) {
  constexpr StateCodec<SessionKeys> codec{
      .encode = encode_session_keys,
      .decode = decode_session_keys,
      .is_newer = [](const SessionKeys& keys,
                     const SessionKeys& than) { return keys.generation() > than.generation(); },
  };
  return {path.string() + ".0", path.string() + ".1", codec, StateFile<SessionKeys>::Writes::both,
          Access::owner};
}

}  // namespace srfs::wire
