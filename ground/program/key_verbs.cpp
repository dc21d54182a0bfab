// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cstdio>

#include <fmt/format.h>

#include "base/random_octets.hpp"
#include "ground/key_change.hpp"
#include "ground/program/verbs.hpp"
#include "ground/uplink.hpp"

namespace srfs::ground::program {
namespace {

/// None where the operating system has none.
Octets drawn(std::size_t octets) {
  Octets random(octets);
  if (!fill_random(random)) random.clear();
  return random;
}

/// The key-encryption key of --master, or the deployment's first. nullopt: it names none.
Result<std::optional<KeyChange::Master>, std::string> master_of(const Operation& operation,
                                                                const suite::LinkSettings& link) {
  const unsigned wanted = operation.arguments.master;
  for (const suite::KeyEncryptionKeyFile& entry : link.key_encryption_keys) {
    if (wanted != 0 && static_cast<unsigned>(entry.id) != wanted) continue;
    auto key = read_link_key(operation.var_dir / entry.key_file);
    if (!key) return Err(key.error());
    return std::optional(
        KeyChange::Master{.id = static_cast<std::uint16_t>(entry.id), .key = std::move(*key)});
  }
  if (wanted != 0)
    return Err(fmt::format("the deployment has no key-encryption key {} (link.key_encryption_keys)", wanted));
  return std::optional<KeyChange::Master>();
}

struct Action {
  std::string_view name;
  std::size_t numbers;  ///< that it needs; replace: one at least
  bool sends_key;
};
constexpr std::array<Action, 9> actions{{{"list", 0, false},
                                         {"inventory", 0, false},
                                         {"replace", 1, true},
                                         {"otar", 1, true},
                                         {"activate", 1, false},
                                         {"verify", 1, false},
                                         {"rekey", 2, false},
                                         {"deactivate", 1, false},
                                         {"destroy", 1, false}}};

Exit carry_out(KeyChange& change, const std::string& action, const std::vector<std::uint16_t>& numbers) {
  if (action == "inventory") return change.inventory();
  if (action == "otar") return change.otar(numbers[0]);
  if (action == "activate") return change.activate(numbers[0]);
  if (action == "verify") return change.verify(numbers[0]);
  if (action == "rekey") return change.rekey(numbers[0], numbers[1]);
  if (action == "deactivate") return change.deactivate(numbers[0]);
  if (action == "destroy") return change.destroy(numbers[0]);
  for (const std::uint16_t spi : numbers) {
    if (const Exit exit = change.replace(spi); exit != Exit::done) return exit;
  }
  return Exit::done;
}

namespace verbs {

Exit keys(const Operation& operation) {
  const Arguments& a = operation.arguments;
  const auto action =
      std::find_if(actions.begin(), actions.end(), [&](const Action& each) { return each.name == a.action; });
  std::vector<std::uint16_t> numbers;
  for (const std::int64_t value : a.values) numbers.push_back(static_cast<std::uint16_t>(value));
  const bool fits = action->name == "replace" ? !numbers.empty() : numbers.size() == action->numbers;
  if (!fits) return fail(a, "keys " + a.action + ": wrong number of values (--help)");
  auto ring = KeyRing::open(operation.state_dir, action->name != "list");
  if (!ring) return fail(a, ring.error());
  if (action->name == "list") {
    std::puts(to_lines(ring->keys(), nullptr).c_str());
    return Exit::done;
  }
  const auto link = link_of(a);
  auto master = action->sends_key ? master_of(operation, link)
                                  : Result<std::optional<KeyChange::Master>, std::string>(std::nullopt);
  if (!master) return fail(a, master.error());
  if (action->sends_key && !*master)
    return fail(a, "the deployment names no key-encryption key (link.key_encryption_keys)");
  return with_console(operation, link, {}, [&](Console& console) {
    KeyChange change(
        ring->keys(), std::move(*master),
        {.ask = [&](const TelecommandText& text) { return console.ask(text, duration(a.timeout_s)); },
         .answers = [&]() -> const std::vector<TelemetryReport>& { return console.answers(); },
         .store = [&](const wire::SessionKeys& keys) { return ring->store(keys); },
         .random = drawn,
         .tell = [&](const std::string& text) { console.tell(text); },
         .fail = [&](const std::string& text) { console.tell_failure(text); }});
    return carry_out(change, a.action, numbers);
  });
}

}  // namespace verbs
}  // namespace

void define_keys(CLI::App& app, Arguments& a) {
  CLI::App& keys = add(app, a, "keys", "Replace link keys in flight (SDLS Extended Procedures)", verbs::keys);
  std::vector<std::string> names;
  for (const Action& action : actions) names.emplace_back(action.name);
  keys.add_option(
          "action", a.action,
          "list | inventory | replace SPI... | otar KEY | activate KEY | verify KEY | rekey SPI KEY | "
          "deactivate KEY | destroy KEY")
      ->check(CLI::IsMember(names))
      ->capture_default_str();
  keys.add_option("values", a.values, "Associations (SPI) and keys (128 to 65534)")
      ->check(CLI::Range(std::int64_t{1}, std::int64_t{wire::SessionKeys::last_id}));
  keys.add_option("--master", a.master, "Key-encryption key (default: the deployment's first)")
      ->check(CLI::Range(1U, 127U));
  add_timeout(keys, a);
}

}  // namespace srfs::ground::program
