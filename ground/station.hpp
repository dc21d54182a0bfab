// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/fd.hpp"
#include "ground/ad_service.hpp"
#include "ground/commanding.hpp"
#include "ground/downlink.hpp"
#include "ground/files.hpp"
#include "ground/link.hpp"
#include "ground/telemetry.hpp"
#include "ground/time_tag.hpp"
#include "ground/uplink.hpp"

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
};

/// The operator's end of the link: sends telecommands, decodes telemetry, follows verification. Telecommands
/// go as BD frames, or by the AD service once start_ad was called. One thread.
class Station {
 public:
  static constexpr milliseconds write_patience{5000};
  /// Waited beyond a telecommand's own timeout: its last report must still come down.
  static constexpr milliseconds report_margin{2000};
  static constexpr std::size_t max_retrievals = 16;

  Station(const mission::Dictionary& dictionary, const suite::LinkSettings& link, Port port, Uplink uplink,
          StationOutput output, wire::FopSettings fop = {});

  /// Checks, secures and writes one telecommand; its stages come through the output. Blocks until the octets
  /// are written. With the AD service it is queued first: stage sent comes with its first transmission, and
  /// its patience begins anew with every other one and with its delivery.
  /// @param patience until the final report, of a retrieval anew with every packet; nullopt: as the
  /// dictionary says, and report_margin
  /// @param tag the caller's own, comes back in every report
  [[nodiscard]] Result<wire::RequestId, std::string> send(const std::string& command,
                                                          const std::vector<std::string>& arguments,
                                                          std::optional<milliseconds> patience,
                                                          std::uint64_t tag);
  /// The same for a telecommand that the spacecraft releases at @p release: it goes up in an insertion into
  /// the schedule (11,4), whose stages come first, marked as such. Then its own: scheduled, and from its
  /// release on as of any other.
  /// @param patience from the release on
  [[nodiscard]] Result<wire::RequestId, std::string> send_at(UtcTime release, const std::string& command,
                                                             const std::vector<std::string>& arguments,
                                                             std::optional<milliseconds> patience,
                                                             std::uint64_t tag);
  /// Sends what arms a hazardous telecommand with these arguments (see arming_of); as send, with @p release
  /// as send_at.
  [[nodiscard]] Result<wire::RequestId, std::string> arm(const std::string& command,
                                                         const std::vector<std::string>& arguments,
                                                         std::optional<milliseconds> patience,
                                                         std::uint64_t tag,
                                                         std::optional<UtcTime> release = std::nullopt);
  /// The AD service (see AdService); news comes through the output.
  void start_ad();
  void stop_ad();
  void unlock();
  void set_vr(std::uint8_t vr);
  [[nodiscard]] CopReport cop() const { return ad_.report(); }

  /// From now on files are carried in both directions; they go up at the line's rate, telecommands between
  /// them. Blocks on the disk, as all that follows.
  void carry_files(std::unique_ptr<cfdp::TransferFolders> transfer_folders);
  /// nullptr: no files are carried. After an order to it: on_time().
  [[nodiscard]] cfdp::TransferFolders* files() { return files_.get(); }

  /// Reads what is there and reports what it means. An error: the link is gone.
  [[nodiscard]] Result<void, std::string> on_readable();
  /// Ends what is overdue.
  void on_time();
  /// When on_time has something to do, at the latest.
  [[nodiscard]] std::optional<MonotonicTime> next_deadline() const;

  [[nodiscard]] int fd() const { return port_.fd(); }
  [[nodiscard]] DownlinkCounters counters() const { return downlink_.counters(); }
  [[nodiscard]] bool locked() const { return downlink_.locked(); }
  [[nodiscard]] std::optional<std::uint32_t> clcw() const { return downlink_.clcw(); }
  [[nodiscard]] std::uint64_t telecommands_sent() const { return uplink_.sent(); }
  /// No telecommand and no retrieval is under way.
  [[nodiscard]] bool idle() const {
    return commanding_.outstanding() == 0 && retrievals_.empty() && ad_telecommands_.empty() &&
           !ad_starting();
  }
  /// The AD service is neither on nor off yet.
  [[nodiscard]] bool ad_starting() const {
    return ad_.phase() == AdPhase::seeking || ad_.phase() == AdPhase::initiating;
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
  [[nodiscard]] Result<wire::RequestId, std::string> dispatch(const mission::EncodedCommand& command,
                                                              std::optional<milliseconds> patience,
                                                              std::uint64_t tag,
                                                              const std::optional<Scheduled>& scheduled);
  void follow(const wire::RequestId& insertion, const std::optional<Scheduled>& scheduled, std::uint64_t tag,
              MonotonicTime now);
  void on_insertion(const StageReport& report, MonotonicTime now);
  [[nodiscard]] Result<wire::RequestId, std::string> send_by_ad(const mission::EncodedCommand& command,
                                                                milliseconds patience, std::uint64_t tag,
                                                                MonotonicTime now);
  void handle_ad();
  void transmit_ad(const AdSignal& signal);
  void on_packet(const ReceivedPacket& received, MonotonicTime now);
  void on_stage(const StageReport& report, MonotonicTime now);
  void end_retrievals(MonotonicTime now);
  /// The spacecraft reports that it takes these keys.
  void follow_counters(const TelemetryReport& beacon);
  void follow_keys(suite::AssociationSet set, const std::string& why);
  void move_files(MonotonicTime now);
  [[nodiscard]] bool send_pdu(OctetView pdu);

  const mission::Dictionary& dictionary_;
  Port port_;
  Downlink downlink_;
  Uplink uplink_;
  Commanding commanding_;
  AdService ad_;
  std::map<std::uint64_t, AdTelecommand> ad_telecommands_;  // by number; bounded by AD queue and window
  std::uint64_t next_ad_number_ = 1;
  std::map<wire::RequestId, wire::RequestId> insertions_;  // insertion -> its telecommand; bounded
  static constexpr std::size_t max_insertions = Commanding::max_outstanding;
  std::vector<Retrieval> retrievals_;
  std::map<std::uint64_t, suite::AssociationSet> asked_keys_;  ///< by the tag of ttc.select_keys
  std::unique_ptr<cfdp::TransferFolders> files_;
  double octet_time_ns_;
  MonotonicTime line_free_at_;  ///< of file data; a pty would take it at any rate
  std::uint16_t file_sequence_count_ = 0;
  StationOutput output_;
};

}  // namespace srfs::ground
