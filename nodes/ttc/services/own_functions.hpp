// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Functions of ttc itself (PUS 8): mode, arming, keys, transmitter.
#pragma once

#include <optional>
#include <string>

#include <mission/structures.hpp>

#include "nodes/ttc/command/hazard_guard.hpp"
#include "nodes/ttc/link/key_selection.hpp"
#include "nodes/ttc/link/transmitter_switch.hpp"
#include "nodes/ttc/services/mode_causes.hpp"
#include "nodes/ttc/services/mode_manager.hpp"
#include "nodes/ttc/services/pus_service.hpp"

namespace srfs {

/// A mode change that was commanded.
struct ModeChange {
  TelecommandOrigin origin;
  MissionMode mode = MissionMode::safe;
  std::string stored_text;
};

/// ttc.set_mode. All parts outlive it, as those of the classes below.
class ModeService final : public StoredChangeService<ModeChange> {
 public:
  /// @param causes  may forbid a mode; nullptr: none does
  ModeService(ModeManager& mode, HazardGuard& hazards, ReportQueue& report_queue,
              const ModeCauses* causes = nullptr)
      : StoredChangeService(report_queue), mode_(mode), hazards_(hazards), causes_(causes) {}
  /// Of what begins now; nullopt: not valid.
  void set_utc(std::optional<UtcTime> utc) { utc_ = utc; }
  /// The mode that @p telecommand orders; nullopt: it is another one.
  [[nodiscard]] static std::optional<MissionMode> mode_of(const Telecommand& telecommand);

  [[nodiscard]] bool provides(const mission::Command& command) const override;
  [[nodiscard]] std::optional<Refusal> why_refused(const Telecommand& telecommand) const override;
  void execute(const Telecommand& telecommand, MonotonicTime now) override;

 private:
  ModeManager& mode_;
  HazardGuard& hazards_;
  const ModeCauses* causes_;
  std::optional<UtcTime> utc_;
};

/// ttc.arm and ttc.disarm.
class ArmingService final : public PusService {
 public:
  ArmingService(const mission::Dictionary& dictionary, const ModeManager& mode, HazardGuard& hazards,
                ReportQueue& report_queue)
      : dictionary_(dictionary), mode_(mode), hazards_(hazards), report_queue_(report_queue) {}

  [[nodiscard]] bool provides(const mission::Command& command) const override;
  void execute(const Telecommand& telecommand, MonotonicTime now) override;

 private:
  /// The telecommand that @p arm names, if it is hazardous and allowed now.
  [[nodiscard]] std::optional<Refusal> why_not_armed(const mission::TtcArm& arm) const;
  void arm(const Telecommand& telecommand, MonotonicTime now);

  const mission::Dictionary& dictionary_;
  const ModeManager& mode_;
  HazardGuard& hazards_;
  ReportQueue& report_queue_;
};

/// Other keys for a channel: used once they are stored.
struct KeyChange {
  TelecommandOrigin origin;
  std::uint8_t vc = 0;
  KeySet set = KeySet::a;
  bool commanded = true;  ///< else by the command-loss timer: nobody waits for it
};

/// ttc.select_keys.
class KeyService final : public StoredChangeService<KeyChange> {
 public:
  KeyService(const AvailableKeySets& available, ReportQueue& report_queue)
      : StoredChangeService(report_queue), available_(available) {}

  [[nodiscard]] bool provides(const mission::Command& command) const override;
  void execute(const Telecommand& telecommand, MonotonicTime now) override;

 private:
  const AvailableKeySets& available_;
};

/// srfs_rescue was ordered to take over.
struct RescueEntry {
  TelecommandOrigin origin;
};

/// rescue.*: what srfs_rescue does in the place of ttc. While ttc runs they are refused, except rescue.enter.
class RescueService final : public StoredChangeService<RescueEntry> {
 public:
  using StoredChangeService::StoredChangeService;

  [[nodiscard]] bool provides(const mission::Command& command) const override;
  void execute(const Telecommand& telecommand, MonotonicTime now) override;
};

/// The transmitter was switched.
struct TransmitterChange {
  TelecommandOrigin origin;
  seconds off{0};  ///< zero: on
  std::string stored_text;
};

/// ttc.transmitter_off and ttc.transmitter_on.
class TransmitterService final : public StoredChangeService<TransmitterChange> {
 public:
  TransmitterService(TransmitterSwitch& transmitter, ReportQueue& report_queue)
      : StoredChangeService(report_queue), transmitter_(transmitter) {}

  [[nodiscard]] bool provides(const mission::Command& command) const override;
  void execute(const Telecommand& telecommand, MonotonicTime now) override;

 private:
  TransmitterSwitch& transmitter_;
};

}  // namespace srfs
