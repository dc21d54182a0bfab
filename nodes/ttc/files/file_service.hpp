// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "msgs/mission/dictionary.hpp"
#include "nodes/ttc/files/file_order.hpp"
#include "nodes/ttc/services/pus_service.hpp"

namespace srfs {

/// The PUS service 23 (ECSS-E-ST-70-41C 6.23): takes requests, gives them one after another to the worker
/// that owns the disk, and reports what became of each: start failure when nothing was done, completion when
/// all was. Every request ends in its time, whatever the disk does. Pure.
class FileService final : public PusService {
 public:
  static constexpr std::uint8_t service_type = 23;
  static constexpr std::size_t max_waiting = 16;
  static constexpr milliseconds shortest_interval{1000};  ///< of the status of copies
  static constexpr milliseconds retry_period{1000};       ///< of a worker without room

  /// @param apid the reports come from. @param report_queue outlives this
  FileService(ReportQueue& report_queue, std::uint16_t apid) : report_queue_(report_queue), apid_(apid) {}

  [[nodiscard]] bool provides(const mission::Command& command) const override {
    return command.service == service_type;
  }
  void execute(const Telecommand& telecommand, MonotonicTime now) override;

  /// The order to carry out next; then on_outcome() or on_refused().
  [[nodiscard]] std::optional<FileOrder> next_order(MonotonicTime now);
  void on_outcome(const FileOutcome& outcome, MonotonicTime now);
  /// The worker has no room.
  void on_refused(MonotonicTime now);
  /// Ends what is overdue.
  void on_time(MonotonicTime now);
  /// When next_order() or on_time() has something without another input.
  [[nodiscard]] std::optional<MonotonicTime> next_due() const;

 private:
  struct Request {
    TelecommandOrigin origin;
    FileOrder order;
    MonotonicTime expiry;
    bool started = false;
  };
  void set_status_interval(const TelecommandOrigin& origin, milliseconds interval, MonotonicTime now);
  void end_overdue(Request& request);

  ReportQueue& report_queue_;
  std::uint16_t apid_;
  std::deque<Request> waiting_;
  bool at_worker_ = false;
  std::optional<Request> current_;  ///< at the worker, or to be continued; none while it was given up
  std::uint64_t next_number_ = 1;
  MonotonicTime not_before_;
  std::optional<milliseconds> status_interval_;
  std::uint16_t status_destination_ = 0;
  MonotonicTime status_at_;
  bool status_running_ = false;  ///< the order at the worker is the periodic status
};

/// The order that the arguments of a command of service 23 ask for; nullopt: they are not what the dictionary
/// says, or the command asks nothing of the disk.
[[nodiscard]] std::optional<FileOrder> file_order_of(const mission::Command& command, OctetView arguments);

}  // namespace srfs
