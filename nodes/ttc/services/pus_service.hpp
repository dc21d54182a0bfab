// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <utility>

#include <mission/structures.hpp>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "msgs/mission/dictionary.hpp"
#include "nodes/ttc/command/telecommand.hpp"
#include "nodes/ttc/report/report_queue.hpp"
#include "wire/cuc.hpp"

namespace srfs {

/// A service of ECSS-E-ST-70-41C that ttc provides, or functions of service 8. A new one is a class with this
/// interface and an entry in TtcCore's list of services.
class PusService {
 public:
  virtual ~PusService() = default;
  /// Whether this command of ttc is its own.
  [[nodiscard]] virtual bool provides(const mission::Command& command) const = 0;
  /// Beyond what the dictionary checks.
  [[nodiscard]] virtual std::optional<Refusal> why_refused(const Telecommand& /*telecommand*/) const {
    return std::nullopt;
  }
  /// Executes an accepted telecommand whose arguments the dictionary has checked: reports its start and its
  /// end into the report queue, now or later. Never blocks.
  virtual void execute(const Telecommand& telecommand, MonotonicTime now) = 0;
  /// Goes on with one of an earlier process. @return false: not known here, by the general rule it is done
  /// again if that does no harm, else interrupted
  [[nodiscard]] virtual bool restore(const Telecommand& /*telecommand*/,
                                     const TelecommandProgress& /*progress*/, MonotonicTime /*now*/) {
    return false;
  }
};

/// A service whose commands change something that lasts: the change is taken by the caller, stored, and then
/// reported complete. One at a time.
template <class Change>
class StoredChangeService : public PusService {
 public:
  explicit StoredChangeService(ReportQueue& report_queue) : report_queue_(report_queue) {}

  [[nodiscard]] std::optional<Change> take_change() { return std::exchange(change_, std::nullopt); }
  /// It is on disk, or could not be stored; it holds either way.
  void on_stored(const Change& change, bool success) {
    if (success) return report_queue_.success(change.origin, Stage::completion);
    report_queue_.failure(change.origin, Stage::completion, mission::failure::storage_unavailable);
  }

 protected:
  /// @return false: the one before was not taken yet (reported)
  bool start(const TelecommandOrigin& origin) {
    if (change_) {
      report_queue_.failure(origin, Stage::start, mission::failure::busy);
      return false;
    }
    report_queue_.success(origin, Stage::start);
    return true;
  }
  void set_change(Change change) { change_ = std::move(change); }
  [[nodiscard]] ReportQueue& report_queue() { return report_queue_; }

 private:
  ReportQueue& report_queue_;
  std::optional<Change> change_;
};

/// A time of a request. The dictionary has checked it; anything else would be a bug there.
[[nodiscard]] inline TaiTime read_cuc(OctetReader& reader) {
  return wire::decode_cuc(reader.bytes(wire::cuc_octets)).value_or(TaiTime{});
}

}  // namespace srfs
