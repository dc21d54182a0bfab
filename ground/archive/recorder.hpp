// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "cfdp/transfer_folders.hpp"
#include "ground/archive/archive.hpp"
#include "ground/archive/gap_filler.hpp"
#include "ground/station_link.hpp"
#include "msgs/mission/dictionary.hpp"

namespace srfs::ground {

/// Puts into the archive what the server sees and does. A failing archive never stops the station: it is
/// reported once, and again when something was recorded, with the number of packets that were not.
class Recorder {
 public:
  using Log = std::function<void(const std::string&)>;
  Recorder(std::unique_ptr<Archive> archive, const mission::Dictionary& dictionary, Log log)
      : archive_(std::move(archive)), dictionary_(dictionary), log_(std::move(log)) {}

  /// @return the packet's number in the archive; 0: a copy of one that is there, or the archive fails
  std::int64_t on_packet(const ReceivedPacket& packet, UtcTime now);
  /// Before it is written to the line; it is in the archive when this returns without an error.
  Archive::Outcome on_telecommand(const TelecommandOrder& order, const wire::RequestId& request,
                                  bool scheduled, UtcTime now);
  /// Nothing of it went up: an order with this token is a new one from now on.
  void on_not_sent(const std::string& token);
  void on_file(const cfdp::News& news, UtcTime now);
  /// @return an error when that packet is no event, or the archive fails
  [[nodiscard]] Archive::Outcome acknowledge(std::int64_t packet, const Acknowledgement& acknowledgement);
  /// What was recorded before survives the process's death when this has returned. Before anything of it is
  /// shown.
  void commit();
  /// Makes the aggregates of one minute that is over, if any. @return whether there was one
  bool make_minute(UtcTime now);

  /// An error: it is not known. Ready to print.
  [[nodiscard]] Result<std::optional<wire::RequestId>, std::string> request_of(const std::string& token);
  /// Packets that came after one, in order, at most so many.
  void packets_after(std::int64_t id, std::size_t most, const std::function<void(const StoredPacket&)>& take);
  /// Why what comes is not recorded; empty: it is.
  [[nodiscard]] const std::string& problem() const { return problem_; }
  [[nodiscard]] Archive& archive() { return *archive_; }
  /// From now on, gaps are filled from the packet stores on board.
  void fill_gaps() {
    if (!filler_) filler_.emplace(dictionary_);
  }
  /// Sends what the filler orders, if anything. @param link  no AD service is used
  void fill(StationLink& link, MonotonicTime now);

 private:
  /// Of writing: an error takes with it what was recorded since the last commit.
  void judge(const Archive::Outcome& written);
  /// Of reading.
  void report_unreadable(const std::string& error);
  [[nodiscard]] Archive::Outcome commit_all();
  void close_gaps(const std::vector<std::int64_t>& gaps);
  std::unique_ptr<Archive> archive_;
  const mission::Dictionary& dictionary_;
  Log log_;
  bool failing_ = false;
  std::string problem_;
  bool told_unreadable_ = false;
  std::uint64_t pending_ = 0;     ///< packets since the last commit
  std::uint64_t unrecorded_ = 0;  ///< packets, while it fails
  std::optional<UtcTime> minute_failed_;
  std::optional<GapFiller> filler_;
  MonotonicTime next_fill_;
  std::uint64_t fills_ = 0;
};

/// Values of a parameter, at most @p most points: each value as it came, or of spans of time their count,
/// minimum, mean, maximum and worst limit. The error is ready to print.
[[nodiscard]] Result<std::vector<Point>, std::string> history(Archive& archive,
                                                              const mission::Dictionary& dictionary,
                                                              const std::string& parameter,
                                                              const Period& period, std::size_t most);

}  // namespace srfs::ground
