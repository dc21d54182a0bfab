// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "base/time.hpp"
#include "ground/telemetry.hpp"
#include "msgs/mission/dictionary.hpp"

namespace srfs::ground {

/// The reports that one telecommand orders down (`reports` in the dictionary): which packets they are, and
/// when all of them have come. Pure.
class ReportOrder {
 public:
  /// How long the first may come after the telecommand's completion.
  static constexpr milliseconds patience{5000};
  /// The same where there may be none: what there is comes before the completion.
  static constexpr milliseconds patience_with_none{1000};
  /// The last of several is there when no other came for this long.
  static constexpr milliseconds gap{500};

  /// nullopt: the telecommand orders none.
  [[nodiscard]] static std::optional<ReportOrder> of(const mission::Dictionary& dictionary,
                                                     const mission::EncodedCommand& command);
  /// Live packets of one structure, several of them.
  [[nodiscard]] static ReportOrder of_structure(const mission::Structure& structure);

  /// @return whether the packet is one of them
  [[nodiscard]] bool take(const TelemetryReport& report, MonotonicTime now);
  /// The telecommand was completed.
  void on_completed(MonotonicTime now) { completed_ = now; }
  /// Nothing more is waited for.
  [[nodiscard]] bool is_over(MonotonicTime now) const;
  /// When is_over may change without a packet.
  [[nodiscard]] std::optional<MonotonicTime> deadline() const;

  [[nodiscard]] bool came() const { return last_.has_value(); }
  /// None of them came, and that may be as it should.
  [[nodiscard]] bool may_be_none() const { return ordered_.may_be_none; }
  /// "packet of structure node_version", "TM 11,10"
  [[nodiscard]] std::string what() const;

 private:
  explicit ReportOrder(mission::OrderedReports ordered) : ordered_(std::move(ordered)) {}

  mission::OrderedReports ordered_;  ///< its argument is resolved into its structure
  std::optional<MonotonicTime> completed_;
  std::optional<MonotonicTime> last_;
};

}  // namespace srfs::ground
