// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/key_change.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <set>

#include <fmt/format.h>
#include <sys/file.h>

#include "base/private_file.hpp"
#include "base/text.hpp"

namespace srfs::ground {
namespace {

using wire::SessionKeys;

std::string word(std::string_view name, std::uint64_t value) {
  return fmt::format("{}=0x{:x}", name, value);
}

std::optional<std::uint64_t> number(const TelemetryReport& report, std::string_view name) {
  for (const mission::DecodedField& field : report.fields) {
    if (field.name != name) continue;
    if (const auto* value = std::get_if<std::uint64_t>(&field.value)) return *value;
  }
  return std::nullopt;
}

std::optional<wire::SdlsKey> new_key(Octets drawn) {
  std::array<std::uint8_t, wire::sdls_key_octets> octets{};
  if (drawn.size() != octets.size()) return std::nullopt;
  std::copy(drawn.begin(), drawn.end(), octets.begin());
  std::fill(drawn.begin(), drawn.end(), std::uint8_t{0});
  return wire::SdlsKey(octets);
}

std::string_view why(wire::KeyRefusal refusal) {
  switch (refusal) {
    case wire::KeyRefusal::unknown_key:
      return "the ground has no such session key (ids from 128 to 65534)";
    case wire::KeyRefusal::wrong_state:
      return "the state of the key does not allow this";
    case wire::KeyRefusal::key_in_use:
      return "an association uses the key";
    case wire::KeyRefusal::table_full:
      return "there is no room for another key: destroy one that is not used";
    case wire::KeyRefusal::not_a_new_key:
      return "this key is known already";
  }
  return "?";
}

}  // namespace

// ---- what is sent, and what comes back

TelecommandText otar_command(std::uint16_t master, const wire::SealedKey& sealed) {
  OctetReader in(sealed.iv_block_mac);
  TelecommandText text{.name = std::string(mission::KeysOtar::name),
                       .arguments = {fmt::format("master={}", master)}};
  text.arguments.push_back(word("iv_1", in.u32()));
  text.arguments.push_back(word("iv_2", in.u64()));
  text.arguments.push_back(word("sealed_id", in.u16()));
  for (const char* name : {"sealed_1", "sealed_2", "sealed_3", "sealed_4", "mac_1", "mac_2"})
    text.arguments.push_back(word(name, in.u64()));
  return text;
}

TelecommandText key_command(std::string_view name, std::uint16_t key) {
  return {.name = std::string(name), .arguments = {fmt::format("key={}", key)}};
}

TelecommandText verify_command(std::uint16_t key, const wire::Challenge& challenge) {
  OctetReader in(challenge);
  TelecommandText text = key_command(mission::KeysVerify::name, key);
  text.arguments.push_back(word("challenge_1", in.u64()));
  text.arguments.push_back(word("challenge_2", in.u64()));
  return text;
}

TelecommandText rekey_command(std::uint16_t spi, std::uint16_t key) {
  TelecommandText text = key_command(mission::KeysRekey::name, key);
  text.arguments.push_back(fmt::format("spi={}", spi));
  return text;
}

TelecommandText inventory_command() {
  return {.name = std::string(mission::KeysInventory::name), .arguments = {}};
}

std::optional<Octets> answer_about(std::uint16_t key, const std::vector<TelemetryReport>& reports) {
  for (const TelemetryReport& report : reports) {
    if (report.name != mission::KeyVerification::name || number(report, "key") != key) continue;
    OctetWriter out;
    out.u32(static_cast<std::uint32_t>(number(report, "iv_sender").value_or(0)));
    for (const char* name : {"iv_counter", "answer_1", "answer_2", "mac_1", "mac_2"})
      out.u64(number(report, name).value_or(0));
    return out.take();
  }
  return std::nullopt;
}

Inventory inventory_of(const std::vector<TelemetryReport>& reports) {
  Inventory inventory;
  for (const TelemetryReport& report : reports) {
    const auto key = number(report, "key");
    const auto state = number(report, "state");
    if (report.name == mission::KeyInventory::name && key && state)
      inventory[static_cast<std::uint16_t>(*key)] = static_cast<mission::KeyState>(*state);
  }
  return inventory;
}

// ---- the ground's keys

std::filesystem::path session_keys_of(const std::filesystem::path& state_dir) {
  return state_dir / wire::session_keys_name;
}

Result<KeyRing, std::string> KeyRing::open(const std::filesystem::path& state_dir, bool lock) {
  std::error_code ec;
  std::filesystem::create_directories(state_dir, ec);
  Fd held;
  if (lock) {
    const auto name = state_dir / "session_keys.lock";
    held = open_lock_file(name);
    if (!held) return Err(fmt::format("{}: cannot open: {}", name.string(), errno_text(errno)));
    if (flock(held.get(), LOCK_EX | LOCK_NB) != 0)
      return Err(fmt::format("{}: another srfs-ground changes keys; end it first", name.string()));
  }
  auto file = wire::session_key_file(session_keys_of(state_dir));
  auto found = file.load();
  if (found.existed() && !found.state)
    return Err(fmt::format(
        "{}: both copies are damaged; put a copy of the folder there, or remove them and command with --keys "
        "contingency",
        found.damaged.front().string()));
  return KeyRing(std::move(file), std::move(found.state).value_or(SessionKeys{}), std::move(held));
}

Result<void, std::string> KeyRing::store(const SessionKeys& keys) {
  if (const auto stored = file_.store(keys); !stored.durable()) return Err(stored.problem);
  keys_ = keys;
  return {};
}

// ---- procedures

Exit KeyChange::refused(const std::string& why_not) {
  hands_.fail(why_not);
  return Exit::refused;
}

bool KeyChange::store(Result<SessionKeys, wire::KeyRefusal> after) {
  if (!after) {
    hands_.fail(std::string(why(after.error())));
    return false;
  }
  if (after->generation() == keys_.generation()) return true;
  if (const auto stored = hands_.store(*after); !stored) {
    hands_.fail(stored.error());
    return false;
  }
  keys_ = std::move(*after);
  return true;
}

Exit KeyChange::send_key(std::uint16_t key) {
  const auto* known = keys_.find(key);
  if (known == nullptr || !master_) return refused("there is no key to send, or no key-encryption key");
  const auto sealed =
      wire::seal_key(master_->key, hands_.random(wire::sdls_iv_octets), key, known->octets.key());
  if (!sealed) return refused(std::string(wire::to_string(sealed.error())));
  const Exit sent = hands_.ask(otar_command(master_->id, *sealed));
  if (sent == Exit::done)
    hands_.tell(fmt::format("key {}: on board, under key-encryption key {}", key, master_->id));
  return sent;
}

Exit KeyChange::otar(std::uint16_t key) {
  if (keys_.find(key) == nullptr) {
    const auto made = new_key(hands_.random(wire::sdls_key_octets));
    if (!made) return refused("no random number");
    if (!store(keys_.uploaded(key, *made))) return Exit::refused;
  }
  return send_key(key);
}

Exit KeyChange::activate(std::uint16_t key) {
  const Exit done = hands_.ask(key_command(mission::KeysActivate::name, key));
  if (done != Exit::done) return done;
  hands_.tell(fmt::format("key {}: active", key));
  if (keys_.find(key) == nullptr) return Exit::done;
  return store(keys_.activated(key)) ? Exit::done : Exit::refused;
}

Exit KeyChange::verify(std::uint16_t key) {
  const auto* known = keys_.find(key);
  if (known == nullptr) return refused(std::string(why(wire::KeyRefusal::unknown_key)));
  wire::Challenge challenge{};
  const Octets drawn = hands_.random(challenge.size());
  if (drawn.size() != challenge.size()) return refused("no random number");
  std::copy(drawn.begin(), drawn.end(), challenge.begin());
  const Exit asked = hands_.ask(verify_command(key, challenge));
  if (asked != Exit::done) return asked;
  const auto answer = answer_about(key, hands_.answers());
  if (!answer) return refused(fmt::format("key {}: the answer was lost on the link; verify it again", key));
  if (!wire::is_right_answer(known->octets.key(), challenge, *answer))
    return refused(fmt::format("key {}: NOT VERIFIED, the spacecraft has other octets; it is not used", key));
  hands_.tell(fmt::format("key {}: verified, both ends have the same", key));
  return Exit::done;
}

Exit KeyChange::take_into_use(std::uint16_t spi, std::uint16_t key) {
  if (!store(keys_.activated(key)) || !store(keys_.rekeyed(spi, key))) return Exit::refused;
  const Exit rekeyed = hands_.ask(rekey_command(spi, key));
  if (rekeyed != Exit::done) return rekeyed;
  // The spacecraft takes frames under both keys now, and has proved that its new one is this.
  if (!store(keys_.confirmed(spi, key))) return Exit::refused;
  hands_.tell(fmt::format("association {}: key {} from the next frame on", spi, key));
  return Exit::done;
}

Exit KeyChange::rekey(std::uint16_t spi, std::uint16_t key) {
  const Exit verified = verify(key);
  return verified == Exit::done ? take_into_use(spi, key) : verified;
}

Exit KeyChange::deactivate(std::uint16_t key) {
  if (keys_.is_used(key)) return refused(std::string(why(wire::KeyRefusal::key_in_use)));
  const Exit done = hands_.ask(key_command(mission::KeysDeactivate::name, key));
  if (done != Exit::done) return done;
  hands_.tell(fmt::format("key {}: deactivated", key));
  if (keys_.find(key) == nullptr) return Exit::done;
  return store(keys_.deactivated(key)) ? Exit::done : Exit::refused;
}

Exit KeyChange::destroy(std::uint16_t key) {
  if (keys_.is_used(key)) return refused(std::string(why(wire::KeyRefusal::key_in_use)));
  const Exit done = hands_.ask(key_command(mission::KeysDestroy::name, key));
  if (done != Exit::done) return done;
  hands_.tell(fmt::format("key {}: destroyed", key));
  if (keys_.find(key) == nullptr) return Exit::done;
  return store(keys_.destroyed(key)) ? Exit::done : Exit::refused;
}

Exit KeyChange::ask_inventory(Inventory& on_board) {
  const Exit asked = hands_.ask(inventory_command());
  if (asked == Exit::done) on_board = inventory_of(hands_.answers());
  return asked;
}

Exit KeyChange::inventory() {
  Inventory on_board;
  const Exit asked = ask_inventory(on_board);
  if (asked == Exit::done) hands_.tell(to_lines(keys_, &on_board));
  return asked;
}

// ---- all of them

std::optional<std::uint16_t> KeyChange::key_for(std::uint16_t spi, const Inventory& on_board) {
  const auto use = keys_.use_of(spi);
  if (use && use->next) {
    const auto state = on_board.find(*use->next);
    const bool ended = state != on_board.end() && state->second == mission::KeyState::deactivated;
    if (!ended) return use->next;
  }
  std::uint16_t id = SessionKeys::first_id;
  while (on_board.contains(id) || keys_.find(id) != nullptr) ++id;
  const auto made = new_key(hands_.random(wire::sdls_key_octets));
  if (!made) {
    hands_.fail("no random number");
    return std::nullopt;
  }
  // One write: a key without its use would be forgotten.
  auto after = keys_.uploaded(id, *made);
  if (after) after = after->activated(id);
  if (after) after = after->rekeyed(spi, id);
  if (!store(std::move(after))) return std::nullopt;
  return id;
}

Exit KeyChange::replace(std::uint16_t spi) {
  Inventory on_board;
  if (const Exit asked = ask_inventory(on_board); asked != Exit::done) return asked;
  const auto key = key_for(spi, on_board);
  if (!key) return Exit::refused;
  const auto state = on_board.find(*key);
  const bool is_active = state != on_board.end() && state->second == mission::KeyState::active;
  if (is_active) {
    hands_.tell(fmt::format("key {}: on board and active", *key));
  } else {
    if (const Exit sent = send_key(*key); sent != Exit::done) return sent;
    if (const Exit active = activate(*key); active != Exit::done) return active;
  }
  if (const Exit rekeyed = rekey(spi, *key); rekeyed != Exit::done) return rekeyed;
  // The first frame under the new key, where this association carries it: the old one ends with it.
  const Exit proved = ask_inventory(on_board);
  if (proved == Exit::done) hands_.tell("contact with the new key: proved if this association was used");
  return proved;
}

std::string to_lines(const SessionKeys& keys, const Inventory* on_board) {
  std::set<std::uint16_t> ids;
  for (const auto& key : keys.keys()) ids.insert(key.id);
  if (on_board != nullptr) {
    for (const auto& [id, state] : *on_board) ids.insert(id);
  }
  std::string lines;
  for (const std::uint16_t id : ids) {
    std::string here = keys.find(id) == nullptr ? "not here" : "not in use";
    for (const auto& use : keys.uses()) {
      if (use.current == id) here = fmt::format("association {} sends under it", use.spi);
      if (use.next == id) here = fmt::format("on its way to association {}", use.spi);
    }
    std::string there;
    if (on_board != nullptr) {
      const auto state = on_board->find(id);
      there =
          state == on_board->end() ? "not on board; " : fmt::format("{} on board; ", to_text(state->second));
    }
    lines += fmt::format("{}key {}: {}{}", lines.empty() ? "" : "\n", id, there, here);
  }
  return lines.empty() ? "no session keys: the key files are in use" : lines;
}

}  // namespace srfs::ground
