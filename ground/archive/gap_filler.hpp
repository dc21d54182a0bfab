// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "ground/archive/archive.hpp"
#include "ground/commanding.hpp"
#include "msgs/mission/dictionary.hpp"

namespace srfs::ground {

/// Fetches what is missing from the packet stores on board, while there is contact: one retrieval at a time,
/// of each store over the time of a gap. Pure.
class GapFiller {
 public:
  static constexpr seconds contact{10};  ///< since the last live packet
  static constexpr seconds rest{60};     ///< after a retrieval that was not complete
  static constexpr seconds margin{2};    ///< around a gap: times of packets are not quite in order
  static constexpr seconds settles{60};  ///< a younger gap may still grow
  static constexpr std::uint32_t attempts_max = 20;
  static constexpr std::chrono::hours longest{48};  ///< a longer gap is a step of the spacecraft's clock

  explicit GapFiller(const mission::Dictionary& dictionary)
      : dictionary_(dictionary), commanding_(dictionary) {}

  /// Gaps that can be tried now: those that were tried least come first.
  [[nodiscard]] static std::vector<StoredGap> to_try(std::vector<StoredGap> open, UtcTime now);
  [[nodiscard]] static bool is_exhausted(const StoredGap& stored) { return stored.attempts >= attempts_max; }
  /// From before the spacecraft's clock was set: no retrieval by time finds it.
  [[nodiscard]] static bool is_undated(const StoredGap& stored) { return stored.gap.to < earliest; }
  static constexpr UtcTime earliest{seconds(946'684'800)};  ///< 2000-01-01: an unset clock begins in 1970

  void on_packet(const ReceivedPacket& received, MonotonicTime now);
  /// Nothing is under way, and there is contact: next() may have something to order.
  [[nodiscard]] bool is_ready(MonotonicTime now) const;
  /// @param open  in the order of to_try()
  [[nodiscard]] std::optional<TelecommandText> next(const std::vector<StoredGap>& open, MonotonicTime now);
  /// The order was sent. @param request  nullopt: it could not be
  void on_sent(const std::optional<wire::RequestId>& request, const mission::Command& command,
               MonotonicTime now);
  /// The gaps that are being filled.
  [[nodiscard]] const std::vector<std::int64_t>& filling() const { return gaps_; }
  /// What next() returned cannot be ordered. @return the gaps that it was for
  [[nodiscard]] std::vector<std::int64_t> give_up();
  /// @return the gaps of which all stores were retrieved completely
  [[nodiscard]] std::vector<std::int64_t> on_time(MonotonicTime now);

 private:
  void take(const StageReport& report, MonotonicTime now);

  const mission::Dictionary& dictionary_;
  Commanding commanding_;
  std::optional<MonotonicTime> last_live_;
  std::optional<MonotonicTime> resting_until_;
  std::vector<std::int64_t> gaps_;  ///< that are being filled; empty: none
  Period period_;
  std::size_t store_ = 0;  ///< index of the next one to retrieve
  std::optional<Retrieval> retrieval_;
};

}  // namespace srfs::ground
