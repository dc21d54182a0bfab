// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "nodes/ttc/link/uplink_chain.hpp"
#include "nodes/ttc/services/pus_service.hpp"
#include "wire/session_keys.hpp"

namespace srfs {

/// A key under which session keys come up, and nothing else is sealed.
struct KeyEncryptionKey {
  std::uint16_t id = 0;  ///< 1 to 127
  wire::SdlsKey key;
};

/// Session keys that are to be stored before they count.
struct SessionKeyChange {
  std::optional<TelecommandOrigin> origin;  ///< nullopt: a frame under a new key was accepted
  wire::SessionKeys keys;
  std::optional<std::uint16_t> rekeyed = {};  ///< association that gets another next key
};

/// Service 128: SDLS Extended Procedures (CCSDS 355.1-B) for the uplink's keys. A change is stored before it
/// holds and before its end is reported; what cannot be stored is not done. One write at a time; requests
/// that come meanwhile wait. Pure.
///
/// What always holds: whichever frames the ground may have reason to send under an association's old or new
/// key are taken by it. The old key ends with the first frame that was accepted under the new one, not
/// before.
///
/// A counter that was raised is written with the next state of the link, after its end was reported: a power
/// cut in between takes it back.
class KeyManagementService final : public PusService {
 public:
  static constexpr std::uint8_t service_type = 128;
  static constexpr std::size_t max_waiting = 4;  ///< requests beside the one that is written
  /// How far a counter may be raised: milliseconds of a day on a strict link.
  static constexpr std::uint64_t max_arsn_step = 86'400'000;

  /// @param keys    as stored; @p uplink has them already
  /// @param uplink  outlives this, as @p report_queue; not used before the first request
  KeyManagementService(wire::SessionKeys keys, std::vector<KeyEncryptionKey> masters,
                       std::vector<std::uint16_t> rekeyable, UplinkChain& uplink, ReportQueue& report_queue)
      : keys_(std::move(keys)),
        masters_(std::move(masters)),
        rekeyable_(std::move(rekeyable)),
        uplink_(uplink),
        report_queue_(report_queue) {}

  [[nodiscard]] bool provides(const mission::Command& command) const override {
    return command.service == service_type;
  }
  void execute(const Telecommand& telecommand, MonotonicTime now) override;
  /// The first frames under new keys were accepted.
  void on_confirmed(const std::vector<UplinkChain::KeyConfirmed>& confirmed);
  /// nullopt: nothing is to be stored now.
  [[nodiscard]] std::optional<SessionKeyChange> take_change();
  void on_stored(const SessionKeyChange& change, bool stored);
  [[nodiscard]] const wire::SessionKeys& keys() const { return keys_; }

 private:
  struct Failure {
    std::uint16_t code = 0;
    std::optional<std::uint16_t> parameter = {};
  };
  [[nodiscard]] static Failure failure_of(wire::KeyRefusal refusal, std::uint16_t id);
  void begin(const Telecommand& telecommand);
  /// What a request makes of the keys.
  [[nodiscard]] Result<wire::SessionKeys, Failure> change(std::uint8_t subtype, OctetReader& in) const;
  [[nodiscard]] Result<wire::SessionKeys, Failure> upload(OctetReader& in) const;
  [[nodiscard]] Result<wire::SessionKeys, Failure> rekey(std::uint16_t spi, std::uint16_t id) const;
  /// The association that took a frame under key @p id, while that is not stored yet.
  [[nodiscard]] std::optional<std::uint16_t> confirmed_by(std::uint16_t id) const;
  void verify(const TelecommandOrigin& origin, OctetReader& in);
  void report_inventory(const TelecommandOrigin& origin, OctetReader& in);
  void report_arsn(const TelecommandOrigin& origin, std::uint16_t spi);
  void set_arsn(const TelecommandOrigin& origin, OctetReader& in);
  void fail(const TelecommandOrigin& origin, const Failure& failure);
  void put(const TelecommandOrigin& origin, std::uint8_t subtype, OctetView content);

  wire::SessionKeys keys_;
  std::vector<KeyEncryptionKey> masters_;
  std::vector<std::uint16_t> rekeyable_;
  UplinkChain& uplink_;
  ReportQueue& report_queue_;
  std::optional<SessionKeyChange> wanted_;  ///< not taken yet
  bool writing_ = false;
  std::vector<UplinkChain::KeyConfirmed> confirmed_;  ///< not stored yet
  std::deque<Telecommand> waiting_;
};

}  // namespace srfs
