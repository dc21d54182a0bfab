// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "ground/ad_service.hpp"
#include "ground/commanding.hpp"
#include "ground/downlink.hpp"
#include "hw_sim/gps_receiver.hpp"
#include "nodes/ttc/link/uplink_chain.hpp"
#include "tests/simulation/ground_files.hpp"
#include "tests/simulation/ttc.hpp"
#include "wire/tc_uplink.hpp"

namespace srfs::simulation {

/// What became of every telecommand, from all places where something of it can be seen: the operator's
/// packet, ttc's publication, the peripheral that carried it out, the reports on the line. Its functions
/// check what the classes of telecommands promise.
class CommandRecord final : public TtcWitness {
 public:
  /// @param truth, stores  outlive it
  CommandRecord(Kernel& kernel, const suite::LinkSettings& link, const sim::TrueTime& truth,
                StoreLedger& stores);

  void on_sent(const wire::RequestId& request, const mission::Command& command);
  /// It stands in @p insertion, to be released at @p release.
  void on_scheduled(const wire::RequestId& request, const mission::Command& command,
                    const wire::RequestId& insertion, UtcTime release);
  /// An operator has ordered to empty the schedule: what is in it, or soon will be, is not followed.
  void on_schedule_reset();
  /// FARM-1 acknowledged the frame with it.
  void on_delivered(const wire::RequestId& request);
  void on_published(const Telecommand& telecommand) override;
  void on_storage_lost() override;
  void on_cadu(const Octets& cadu) override;
  void on_mode(std::uint32_t change) override;
  void on_time(UtcTime utc, bool valid) override;
  /// A peripheral has carried it out.
  void on_executed(std::uint32_t telecommand_id);
  enum class Answer : std::uint8_t { none, refused, failed, completed };
  /// How it ended, as far as that has left the spacecraft.
  [[nodiscard]] Answer answer(const wire::RequestId& request) const;
  /// At the end of a calm: what was acknowledged or accepted before it has its end.
  void check_ends(MonotonicTime sent_before);
  /// The same: the mode in force has been reported, and why.
  void check_mode() const;
  void set_listener(std::function<void(const Octets& cadu)> listener) { listener_ = std::move(listener); }

  struct Counters {
    std::uint64_t sent = 0;
    std::uint64_t accepted = 0;
    std::uint64_t refused = 0;
    std::uint64_t completed = 0;
    std::uint64_t failed = 0;
    std::uint64_t executed = 0;
    std::uint64_t delivered = 0;
    std::uint64_t released = 0;  ///< by the schedule
    std::uint64_t dropped = 0;   ///< the same, reported
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  struct Life {
    const mission::Command* command = nullptr;
    MonotonicTime sent;
    bool delivered = false;
    std::set<std::uint64_t> ids;  ///< that ttc gave it
    bool accepted = false;
    bool refused = false;
    bool completed = false;
    std::optional<std::uint16_t> failed{};  ///< code
    int executed = 0;
    std::optional<MonotonicTime> ended{};
    /// The journal did not reach the disk while it was under way. Without storage recovery commands run and
    /// frames are acknowledged all the same, so its end is not promised.
    bool unstored = false;
    std::optional<std::uint64_t> insertion{};  ///< key of the telecommand that schedules it
    UtcTime release{};
    bool dropped = false;
    std::optional<MonotonicTime> published{};
  };
  using Key = std::uint64_t;  ///< APID and sequence count
  void on_event(const wire::TmPacket& packet);
  void on_housekeeping(const wire::TmPacket& packet);
  void note_farm(std::uint32_t control_word);
  enum class ScheduleState : std::uint8_t { sent, in_schedule, released, dropped, refused };
  void note_schedule(Key key, ScheduleState state);
  /// The spacecraft's clock is right to the second.
  [[nodiscard]] bool has_right_time() const;
  void check_schedule(const Life& life) const;
  void on_report(const wire::TmPacket& packet);
  [[nodiscard]] static Key key_of(const wire::RequestId& request);
  /// What is reported as certainly not executed was not.
  static void check_not_executed(const Life& life);
  [[nodiscard]] static std::string describe(const Life& life);

  Kernel& kernel_;
  const sim::TrueTime& truth_;
  StoreLedger& stores_;
  std::optional<MonotonicTime> time_since_;  ///< the spacecraft's clock is right and valid
  MonotonicTime time_at_;                    ///< that it was looked at
  MonotonicTime reset_until_;                ///< the schedule may be emptied until then
  ground::Downlink receiver_;                ///< hears everything that leaves the spacecraft
  std::function<void(const Octets& cadu)> listener_;
  std::map<Key, Life> lives_;
  std::map<std::uint64_t, Key> by_id_;
  MonotonicTime last_lost_;
  std::optional<std::uint32_t> mode_change_;  ///< in force
  MonotonicTime mode_since_;
  std::optional<std::uint32_t> told_change_;  ///< that the ground was told last
  Counters counters_;
};

/// The ground: its real AD service, decoders and verification, the line with its losses, and an operator who
/// sends telecommands by chance, repeats some, forgets some, sends some with wrong arguments.
class Station {
 public:
  Station(Kernel& kernel, const mission::Dictionary& dictionary, const suite::LinkSettings& link,
          const wire::SdlsKey& key, CommandRecord& record, FileRecord& files, const sim::TrueTime& truth,
          std::function<void(const Octets&)> to_spacecraft);

  /// Share of CLTUs and CADUs that are lost, and of those that have a wrong octet.
  struct Line {
    std::uint64_t lost_per_1000 = 0;
    std::uint64_t spoiled_per_1000 = 0;
    bool cut = false;
  };
  void set_line(Line line) { line_ = line; }
  [[nodiscard]] const Line& line() const { return line_; }
  void set_operator(bool works);
  /// The operator does nothing by itself from now on.
  void silence() { works_ = false; }
  [[nodiscard]] bool works() const { return works_; }
  /// Sends one telecommand at once, as a BD frame.
  wire::RequestId order(std::string_view name, const std::vector<std::string>& arguments);
  [[nodiscard]] std::vector<std::string> files_under_way() { return files_.under_way(); }

 private:
  struct Queued {
    wire::RequestId request;
    const mission::Command* command;
    Octets packet;
  };
  void work();
  void work_on_files();
  void send_something();
  void send_list();
  void send_scheduled();
  void send_retrieval();
  void send(const Queued& telecommand);
  [[nodiscard]] Queued make(std::string_view name, const std::vector<std::string>& arguments, bool spoiled);
  [[nodiscard]] UtcTime utc() const { return truth_.utc(kernel_.now()); }
  void send_bd(const Queued& telecommand);
  MonotonicTime uplink(Octets cltu);
  void on_cadu(const Octets& cadu);
  void handle_ad();
  void note_ad();
  std::uint64_t next_counter();
  [[nodiscard]] std::optional<Octets> frame(wire::TcFrameType type, std::uint8_t sequence, OctetView packet);
  [[nodiscard]] std::optional<Octets> control_frame(wire::ControlCommand command);
  [[nodiscard]] bool passes_line(Octets& octets, Random& random);

  Kernel& kernel_;
  const mission::Dictionary& dictionary_;
  const sim::TrueTime& truth_;
  Random operator_;
  Random files_operator_;
  Random list_operator_;
  Random noise_;
  wire::TcUplinkChannel channel_;
  const wire::SdlsKey& key_;
  CommandRecord& record_;
  std::function<void(const Octets&)> to_spacecraft_;
  ground::Downlink downlink_;
  ground::Commanding commanding_;
  ground::AdService ad_;
  Line line_;
  bool works_ = true;
  std::uint64_t counter_ = 0;
  std::map<std::uint16_t, std::uint16_t> sequence_;
  std::uint64_t next_tag_ = 1;
  std::map<std::uint64_t, Queued> by_ad_;  ///< by tag
  std::vector<Queued> recent_;             ///< to repeat
  MonotonicTime up_free_;
  MonotonicTime down_free_;
  Deadline ad_timer_;
  FileRecord& file_record_;
  GroundFiles files_;
};

}  // namespace srfs::simulation
