// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/result.hpp"
#include "msgs/mission/dictionary.hpp"
#include "nodes/ttc/command/command_forwarder.hpp"
#include "nodes/ttc/command/hazard_guard.hpp"
#include "nodes/ttc/files/file_service.hpp"
#include "nodes/ttc/imaging/imaging_scheduler.hpp"
#include "nodes/ttc/link/key_selection.hpp"
#include "nodes/ttc/link/transmitter_switch.hpp"
#include "nodes/ttc/report/event_reporter.hpp"
#include "nodes/ttc/report/report_queue.hpp"
#include "nodes/ttc/services/connection_tester.hpp"
#include "nodes/ttc/services/housekeeping_scheduler.hpp"
#include "nodes/ttc/services/mode_manager.hpp"
#include "nodes/ttc/services/parameter_service.hpp"
#include "nodes/ttc/services/schedule_service.hpp"
#include "nodes/ttc/services/time_reporter.hpp"
#include "nodes/ttc/store/packet_retrieval.hpp"
#include "nodes/ttc/store/store_control.hpp"

namespace srfs {

/// Failure codes of the mission dictionary, looked up by name once. Throws ConfigError for one that is
/// missing.
struct FailureCodes {
  explicit FailureCodes(const mission::Dictionary& dictionary);

  std::uint16_t unknown_apid, bad_length, bad_checksum, unknown_service, unknown_subtype, bad_argument,
      unknown_function, wrong_mode, queue_full, storage_unavailable, unknown_identifier, bad_arguments_length,
      node_unavailable, busy, bad_time_range, store_unreadable, aborted, interrupted, completion_unknown,
      not_armed, not_hazardous;

  [[nodiscard]] ConnectionTester::Codes for_connections() const { return {busy, node_unavailable}; }
  [[nodiscard]] StoreControl::Codes for_stores() const {
    return {busy, unknown_subtype, storage_unavailable};
  }
};

/// A mode change that was commanded: to be stored, then reported with mode_stored().
struct ModeChange {
  TelecommandOrigin origin;
  Mode mode = Mode::safe;
  std::string stored_text;
};

/// Other keys for a channel were commanded: to be stored, then used and reported with key_change_stored().
struct KeyChange {
  TelecommandOrigin origin;
  std::uint8_t vc = 0;
  KeySet set = KeySet::a;
};

/// The transmitter was switched by command: to be stored, then reported with transmitter_stored().
struct TransmitterChange {
  TelecommandOrigin origin;
  seconds off{0};  ///< zero: on
  std::string stored_text;
};

/// A telecommand that was refused, for the event that reports it.
struct RejectedTelecommand {
  std::uint16_t apid = 0;
  std::uint16_t sequence_count = 0;
  std::uint16_t code = 0;
};

/// Why a telecommand is refused (1,2 or 1,10).
struct Refusal {
  std::uint16_t code = 0;
  Octets parameter;
  Stage stage = Stage::acceptance;  ///< routing: no application process can accept it
};

/// A telecommand packet after the decision and before anything is done.
struct JudgedTelecommand {
  TelecommandOrigin origin;                   ///< the id is filled in when it is recorded
  const mission::Command* command = nullptr;  ///< of the dictionary; nullptr: refused
  Octets arguments;
  MonotonicTime expiry;  ///< not begun by its node after this
  Refusal refusal;
  std::uint64_t refusal_serial = 0;  ///< filled in when the refusal is recorded; 0: it is not
};

/// How far a telecommand of an earlier process got.
struct RestoredTelecommand {
  TelecommandOrigin origin;
  OctetView packet;
  MonotonicTime expiry;
  ForwardedProgress progress;
};

/// Decides what one telecommand packet causes: 1,2 with the reason, or 1,1 and then the services of ttc
/// itself or a command for another node. Between the decision (judge) and what it causes (carry_out) the
/// telecommand becomes durable; room in its node's queue is kept for it, and a mode change that waits counts
/// as done for those behind it. Everything it causes is in the report queue, the forwarder, the retrieval, or
/// taken from here. Never blocks.
class TelecommandRouter {
 public:
  static constexpr std::size_t max_rejected = 16;

  /// What it works with; all outlive it.
  struct Parts {
    const mission::Dictionary& dictionary;
    const FailureCodes& codes;
    HousekeepingScheduler& housekeeping;
    EventReporter& events;
    ModeManager& mode;
    CommandForwarder& forwarder;
    PacketRetrieval& retrieval;
    StoreControl& stores;
    FileService& files;
    ParameterService& parameters;
    ReportQueue& report_queue;
    ScheduleService& schedule;
    TimeReporter& time_reports;
    HazardGuard& hazards;
    const AvailableKeySets& key_sets;
    TransmitterSwitch& transmitter;
    ImagingScheduler& imaging;
    ConnectionTester& connections;
  };

  /// @param own_node name of the node whose commands are executed here
  TelecommandRouter(Parts parts, std::string own_node);

  /// @param packet a space packet as it came up
  /// @param room whether an accepted one can be recorded; if not, it is refused (queue_full)
  [[nodiscard]] JudgedTelecommand judge(OctetView packet, MonotonicTime now, bool room = true);
  /// 1,1 and what is asked for, or 1,2. Once for each that judge() gave, in that order; refused ones at any
  /// time.
  /// @param durable whether its record is on disk; if not, only recovery commands run
  void carry_out(const JudgedTelecommand& judged, bool durable, MonotonicTime now);
  /// Goes on with an accepted telecommand of an earlier process. One of ttc itself that may have begun is
  /// done again if it is idempotent and not expired; else it ends as interrupted.
  void restore(const RestoredTelecommand& restored, MonotonicTime now);

  [[nodiscard]] std::optional<ModeChange> take_mode_change() {
    return std::exchange(mode_change_, std::nullopt);
  }
  /// The change is on disk, or could not be stored; it holds either way.
  void mode_stored(const ModeChange& change, bool success);
  [[nodiscard]] std::optional<KeyChange> take_key_change() {
    return std::exchange(key_change_, std::nullopt);
  }
  /// The change is on disk, or could not be stored; it holds either way.
  [[nodiscard]] std::optional<TransmitterChange> take_transmitter_change() {
    return std::exchange(transmitter_change_, std::nullopt);
  }
  void transmitter_stored(const TransmitterChange& change, bool success);
  void key_change_stored(const KeyChange& change, bool success);
  /// Telecommands refused since the last call, at most max_rejected (the newest).
  [[nodiscard]] std::vector<RejectedTelecommand> take_rejected() { return std::exchange(rejected_, {}); }
  /// Ids of recovery commands that ran without storage since the last call.
  [[nodiscard]] std::vector<std::uint64_t> take_unstored_runs() { return std::exchange(unstored_runs_, {}); }

 private:
  struct Request {
    TelecommandOrigin origin;
    const mission::Command* command = nullptr;
    Octets arguments;
    MonotonicTime now;      ///< when it is executed
    bool repeated = false;  ///< may have been done before a restart
  };
  [[nodiscard]] Result<const mission::Command*, Refusal> find_command(const wire::TcPacket& packet) const;
  [[nodiscard]] Result<Request, Refusal> check(const wire::TcPacket& packet, bool room,
                                               MonotonicTime now) const;
  /// @return why an insertion into the schedule is refused; nullopt: it is not, or is another command
  [[nodiscard]] std::optional<Refusal> refuse_insertion(const mission::Command& command,
                                                        OctetView arguments) const;
  [[nodiscard]] std::optional<ScheduleService::RequestError> check_scheduled(OctetView packet) const;
  [[nodiscard]] TelecommandOrigin origin_of(const wire::TcPacket& packet) const;
  [[nodiscard]] static Octets arguments_of(const wire::TcPacket& packet, const mission::Command& command);
  [[nodiscard]] static std::optional<Mode> mode_of(const mission::Command& command, OctetView arguments);
  [[nodiscard]] std::size_t waiting_for(const std::string& node) const;
  void refuse(const TelecommandOrigin& origin, const Refusal& refusal);
  [[nodiscard]] JudgedTelecommand judge_malformed(OctetView packet, wire::TcPacketError error) const;
  void forward(const Request& request, MonotonicTime expiry, MonotonicTime now);
  [[nodiscard]] static ForwardedCommand forwarded(const Request& request, MonotonicTime expiry);
  void execute(const Request& request, MonotonicTime now);
  void execute_test(const Request& request);
  void execute_housekeeping(const Request& request);
  void execute_events(const Request& request);
  void execute_storage(const Request& request);
  void set_mode(const Request& request);
  void arm(const Request& request);
  void select_keys(const Request& request);
  void switch_transmitter(const Request& request, seconds off);
  /// The telecommand that @p arm names, if it is hazardous and allowed now.
  [[nodiscard]] std::optional<Refusal> why_not_armed(const mission::TtcArm& arm) const;
  void complete(const TelecommandOrigin& origin);

  Parts parts_;
  std::string own_node_;
  std::uint16_t own_apid_ = 0;
  std::optional<ModeChange> mode_change_;
  std::optional<KeyChange> key_change_;
  std::optional<TransmitterChange> transmitter_change_;
  std::vector<RejectedTelecommand> rejected_;
  std::vector<std::uint64_t> unstored_runs_;
  std::map<std::string, std::size_t> waiting_;  ///< judged and not carried out, per node
  std::vector<Mode> modes_to_come_;             ///< of mode changes among them, in order
};

}  // namespace srfs
