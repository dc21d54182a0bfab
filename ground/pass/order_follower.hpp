// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/fd.hpp"
#include "ground/latest_values.hpp"
#include "ground/pass/pass_session.hpp"
#include "ground/report_order.hpp"
#include "ground/station.hpp"

namespace srfs::ground::pass {

/// Sends one telecommand at a time and follows it to its end, with the reports that it orders. Keeps the
/// newest values. One thread.
class OrderFollower {
 public:
  struct Output {
    std::function<void(const cfdp::News&)> file;   ///< may be empty
    std::function<void(const std::string&)> note;  ///< ready to print
  };
  OrderFollower(const mission::Dictionary& dictionary, std::unique_ptr<StationLink> link, Output output);

  /// A telecommand; none is followed.
  void send(const PassAction& action);
  struct Ended {
    std::uint64_t tag = 0;
    OrderEnd end;
  };
  /// Of the one that was sent, once.
  [[nodiscard]] std::optional<Ended> take_end();

  /// Waits for the line, a signal (SIGINT, SIGTERM), or until @p wake, and does what is due. @return false:
  /// the link has gone (problem())
  [[nodiscard]] bool wait(MonotonicTime wake);
  [[nodiscard]] bool interrupted() const { return interrupted_; }
  [[nodiscard]] const std::string& problem() const { return problem_; }

  [[nodiscard]] StationLink& link() { return station_.link(); }
  /// Newest values that came.
  [[nodiscard]] const LatestValues& latest() const { return latest_; }

 private:
  struct Followed {
    std::uint64_t tag = 0;
    std::optional<ScriptStep> step = {};
    std::optional<ReportOrder> order = {};
    std::vector<TelemetryReport> reports = {};
    std::optional<OrderEnd> end = {};
  };
  [[nodiscard]] StationOutput station_output();
  void on_telemetry(const TelemetryReport& report);
  void on_stage(const StageReport& report);
  void end(OrderEnd how);

  const mission::Dictionary& dictionary_;
  Output output_;
  Fd signals_;
  Station station_;
  LatestValues latest_;
  std::optional<Followed> followed_;
  bool interrupted_ = false;
  std::string problem_;
};

}  // namespace srfs::ground::pass
