// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <mission/structures.hpp>

#include "base/fd.hpp"
#include "base/octets.hpp"
#include "base/result.hpp"
#include "ground/commanding.hpp"
#include "ground/exit.hpp"
#include "ground/telemetry.hpp"
#include "wire/sdls_procedures.hpp"
#include "wire/session_keys.hpp"

namespace srfs::ground {

// ---- what is sent, and what comes back

[[nodiscard]] TelecommandText otar_command(std::uint16_t master, const wire::SealedKey& sealed);
/// keys.activate, keys.deactivate or keys.destroy.
[[nodiscard]] TelecommandText key_command(std::string_view name, std::uint16_t key);
[[nodiscard]] TelecommandText verify_command(std::uint16_t key, const wire::Challenge& challenge);
[[nodiscard]] TelecommandText rekey_command(std::uint16_t spi, std::uint16_t key);
[[nodiscard]] TelecommandText inventory_command();
/// wire::ChallengeAnswer::octets about @p key; nullopt: there is none among the reports.
[[nodiscard]] std::optional<Octets> answer_about(std::uint16_t key,
                                                 const std::vector<TelemetryReport>& reports);
using Inventory = std::map<std::uint16_t, mission::KeyState>;
[[nodiscard]] Inventory inventory_of(const std::vector<TelemetryReport>& reports);

/// The ground's session keys, STATE/session_keys.0 and .1: two checksummed copies, for their owner alone.
class KeyRing {
 public:
  /// @param lock  no other process changes them meanwhile. The error is ready to print
  [[nodiscard]] static Result<KeyRing, std::string> open(const std::filesystem::path& state_dir, bool lock);
  [[nodiscard]] const wire::SessionKeys& keys() const { return keys_; }
  /// Blocks on the disk.
  [[nodiscard]] Result<void, std::string> store(const wire::SessionKeys& keys);

 private:
  KeyRing(StateFile<wire::SessionKeys> file, wire::SessionKeys keys, Fd lock)
      : file_(std::move(file)), keys_(std::move(keys)), lock_(std::move(lock)) {}
  StateFile<wire::SessionKeys> file_;
  wire::SessionKeys keys_;
  Fd lock_;
};
/// STATE/session_keys, without the number of the copy.
[[nodiscard]] std::filesystem::path session_keys_of(const std::filesystem::path& state_dir);

/// Replaces keys of the link in flight, by the procedures of CCSDS 355.1-B. A key is in the ground's files
/// before anything of it is sent. The ground sends under the old key until the spacecraft has answered a
/// challenge under the new one and has reported that it takes frames under both; so each step may end
/// anywhere, on both ends, and be done again. Pure but for its hands.
class KeyChange {
 public:
  /// What it does things with. Exit is that of the program.
  struct Hands {
    std::function<Exit(const TelecommandText&)> ask;  ///< until its end; armed before where that is needed
    std::function<const std::vector<TelemetryReport>&()> answers;  ///< to that
    std::function<Result<void, std::string>(const wire::SessionKeys&)> store;
    std::function<Octets(std::size_t octets)> random;
    std::function<void(const std::string&)> tell;
    std::function<void(const std::string&)> fail;
  };
  struct Master {
    std::uint16_t id = 0;
    wire::SdlsKey key;
  };
  /// @param master  nullopt: nothing is sent by OTAR
  KeyChange(wire::SessionKeys keys, std::optional<Master> master, Hands hands)
      : keys_(std::move(keys)), master_(std::move(master)), hands_(std::move(hands)) {}

  // One procedure each. @return Exit::done, or why not: it was said.
  [[nodiscard]] Exit otar(std::uint16_t key);
  [[nodiscard]] Exit activate(std::uint16_t key);
  [[nodiscard]] Exit verify(std::uint16_t key);
  /// Verifies it before.
  [[nodiscard]] Exit rekey(std::uint16_t spi, std::uint16_t key);
  [[nodiscard]] Exit deactivate(std::uint16_t key);
  [[nodiscard]] Exit destroy(std::uint16_t key);
  /// Both ends' keys.
  [[nodiscard]] Exit inventory();
  /// All of them in their order with a new key for @p spi, or from where it was left.
  [[nodiscard]] Exit replace(std::uint16_t spi);

  [[nodiscard]] const wire::SessionKeys& keys() const { return keys_; }

 private:
  [[nodiscard]] Exit ask_inventory(Inventory& on_board);
  /// The key that is on its way to @p spi, or a new one, which is stored; nullopt: said why not.
  [[nodiscard]] std::optional<std::uint16_t> key_for(std::uint16_t spi, const Inventory& on_board);
  [[nodiscard]] Exit send_key(std::uint16_t key);
  [[nodiscard]] Exit take_into_use(std::uint16_t spi, std::uint16_t key);
  [[nodiscard]] bool store(Result<wire::SessionKeys, wire::KeyRefusal> after);
  Exit refused(const std::string& why);

  wire::SessionKeys keys_;
  std::optional<Master> master_;
  Hands hands_;
};

/// Lines for people: the ground's keys, never their octets. @param on_board  nullptr: not asked
[[nodiscard]] std::string to_lines(const wire::SessionKeys& keys, const Inventory* on_board);

}  // namespace srfs::ground
