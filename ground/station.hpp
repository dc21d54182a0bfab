// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ground/commanding.hpp"
#include "ground/station_link.hpp"
#include "ground/telemetry.hpp"
#include "ground/time_tag.hpp"

namespace srfs::ground {

/// Receives everything that happens. Functions that are not set are not called.
struct StationOutput {
  std::function<void(const TelemetryReport&)> telemetry;
  std::function<void(const StageReport&)> stage;
  std::function<void(const Retrieval&)> retrieval_over;
  std::function<void(const CopReport&)> cop;                                ///< when something of it changed
  std::function<void(const cfdp::News&)> file;                              ///< what became of files
  std::function<void(suite::AssociationSet, const std::string& why)> keys;  ///< other keys are used now
  std::function<void(const std::string&)> problem;                          ///< ready to print
  std::function<void(const std::string&)> note;                             ///< no failure; ready to print
  /// Stages of telecommands of other users of the same server, when the link reports these.
  std::function<void(const StageReport&)> stage_of_other = {};
  std::function<void()> line_opened = {};
  /// Of frames that could not be verified, if the operator wants to see them: for his eyes alone.
  std::function<void(const TelemetryReport&)> unverified = {};
};

/// The operator's end of the link: sends telecommands, decodes telemetry, follows verification. Telecommands
/// go as BD frames, or by the AD service once start_ad was called. One thread.
class Station {
 public:
  /// Waited beyond a telecommand's own timeout: its last report must still come down.
  static constexpr milliseconds report_margin{2000};
  static constexpr std::size_t max_retrievals = 16;

  Station(const mission::Dictionary& dictionary, std::unique_ptr<StationLink> link, StationOutput output);

  /// Checks, secures and writes one telecommand; its stages come through the output. Blocks until the octets
  /// are written. With the AD service it is queued first: stage sent comes with its first transmission, and
  /// its patience begins anew with every other one and with its delivery.
  /// @param patience until the final report, of a retrieval anew with every packet; nullopt: as the
  /// dictionary says, and report_margin
  /// @param tag the caller's own, comes back in every report
  /// @param token  unique: an order whose answer was lost is repeated with it, and not sent again; empty: one
  /// of the link's own
  /// @param again, recorded_alone  as of TelecommandOrder
  /// @return an error of Kind::unknown has no stages
  [[nodiscard]] Result<wire::RequestId, OrderError> send(const std::string& command,
                                                         const std::vector<std::string>& arguments,
                                                         std::optional<milliseconds> patience,
                                                         std::uint64_t tag, const std::string& token = "",
                                                         bool again = false, bool recorded_alone = false);
  /// The same for a telecommand that the spacecraft releases at @p release: it goes up in an insertion into
  /// the schedule (11,4), whose stages come first, marked as such. Then its own: scheduled, and from its
  /// release on as of any other.
  /// @param patience from the release on
  /// @param token, again, recorded_alone  of the insertion
  [[nodiscard]] Result<wire::RequestId, OrderError> send_at(UtcTime release, const std::string& command,
                                                            const std::vector<std::string>& arguments,
                                                            std::optional<milliseconds> patience,
                                                            std::uint64_t tag, const std::string& token = "",
                                                            bool again = false, bool recorded_alone = false);
  /// Sends what arms a hazardous telecommand with these arguments (see arming_of); as send, with @p release
  /// as send_at.
  [[nodiscard]] Result<wire::RequestId, OrderError> arm(const std::string& command,
                                                        const std::vector<std::string>& arguments,
                                                        std::optional<milliseconds> patience,
                                                        std::uint64_t tag,
                                                        std::optional<UtcTime> release = std::nullopt);
  /// The AD service (see AdService); news comes through the output.
  [[nodiscard]] Result<void, OrderError> start_ad() { return link_->start_ad(); }
  [[nodiscard]] Result<void, OrderError> stop_ad() { return link_->stop_ad(); }
  [[nodiscard]] Result<void, OrderError> unlock() { return link_->unlock(); }
  [[nodiscard]] Result<void, OrderError> set_vr(std::uint8_t vr) { return link_->set_vr(vr); }
  [[nodiscard]] CopReport cop() const { return link_->cop(); }
  /// Telecommands of this user in the hands of the AD service.
  [[nodiscard]] std::size_t in_ad() const { return ad_telecommands_.size(); }

  /// Files, counters and state of the line.
  [[nodiscard]] StationLink& link() { return *link_; }

  /// Reads what is there and reports what it means. An error: the link is gone.
  [[nodiscard]] Result<void, std::string> on_readable();
  /// Ends what is overdue. An error: the link is gone.
  [[nodiscard]] Result<void, std::string> on_time();
  /// When on_time has something to do, at the latest.
  [[nodiscard]] std::optional<MonotonicTime> next_deadline() const;

  [[nodiscard]] int fd() const { return link_->fd(); }
  /// No telecommand and no retrieval is under way.
  [[nodiscard]] bool idle() const {
    return commanding_.outstanding() == 0 && retrievals_.empty() && ad_telecommands_.empty() &&
           !ad_starting();
  }
  /// The AD service is neither on nor off yet.
  [[nodiscard]] bool ad_starting() const {
    const AdPhase phase = link_->cop().phase;
    return phase == AdPhase::seeking || phase == AdPhase::initiating;
  }

 private:
  /// A telecommand in the hands of the AD service.
  struct AdTelecommand {
    wire::RequestId request;
    const mission::Command* command;
    milliseconds patience;
    std::uint64_t tag;
    bool transmitted = false;
  };
  /// A time-tagged telecommand while its insertion is under way.
  struct Scheduled {
    wire::RequestId request;
    const mission::Command* command;
    milliseconds patience;
  };
  [[nodiscard]] Result<wire::RequestId, OrderError> dispatch(const mission::EncodedCommand& command,
                                                             const std::vector<std::string>& arguments,
                                                             std::optional<milliseconds> patience,
                                                             std::uint64_t tag, const std::string& token,
                                                             bool again, bool recorded_alone,
                                                             const std::optional<Scheduled>& scheduled);
  void follow(const wire::RequestId& insertion, const std::optional<Scheduled>& scheduled, std::uint64_t tag,
              MonotonicTime now);
  void on_insertion(const StageReport& report, MonotonicTime now);
  void on_ad(std::uint64_t number, AdProgress progress);
  /// The AD service is done with it. @param outcome  nullopt: its reports or its patience decide
  void end_ad(std::map<std::uint64_t, AdTelecommand>::iterator telecommand, std::optional<Outcome> outcome,
              const std::string& why);
  void on_packet(const ReceivedPacket& received, MonotonicTime now);
  void on_stage(const StageReport& report, MonotonicTime now);
  void on_telecommand_of_other(const SeenTelecommand& seen, MonotonicTime now);
  void tell_stage_of_other(StageReport report);
  void end_retrievals(MonotonicTime now);
  const mission::Dictionary& dictionary_;
  std::unique_ptr<StationLink> link_;
  Commanding commanding_;
  Commanding others_;                           ///< telecommands of other users
  std::map<std::uint64_t, std::string> whose_;  ///< of them, by their tag, the oldest first; bounded as these
  std::uint64_t next_other_ = 0;
  std::map<std::uint64_t, AdTelecommand> ad_telecommands_;  // by number; bounded by AD queue and window
  std::uint64_t next_ad_number_ = 1;
  std::map<wire::RequestId, wire::RequestId> insertions_;  // insertion -> its telecommand; bounded
  static constexpr std::size_t max_insertions = Commanding::max_outstanding;
  std::vector<Retrieval> retrievals_;
  std::map<std::uint64_t, suite::AssociationSet> asked_keys_;  ///< by the tag of ttc.select_keys
  StationOutput output_;
};

}  // namespace srfs::ground
