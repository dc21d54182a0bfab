// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <mission/structures.hpp>

#include "base/grant_id.hpp"
#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "nodes/payload/babble_monitor.hpp"
#include "nodes/payload/standing_orders.hpp"
#include "suite/commanding/telecommand_journal.hpp"
#include "wire/peripheral_protocol.hpp"

namespace srfs {

struct PayloadSettings {
  nanoseconds answer_timeout = milliseconds(25);  ///< of one request; never past the allotted time
  nanoseconds command_time =
      milliseconds(12);  ///< a request is begun only with so much of the allotted time left
  nanoseconds reset_answer_timeout = milliseconds(10);  ///< then the power switch is used
  nanoseconds lease_margin = milliseconds(3);           ///< nothing is awaited in the last part of the lease
  nanoseconds drain_time =
      milliseconds(5);  ///< for the last own frames after the allotted time; then they are taken back
  nanoseconds power_off_time = milliseconds(200);  ///< of a power cycle that no telecommand ordered
  nanoseconds power_retry = milliseconds(500);     ///< until the next try when the switch did not obey
  /// A babbling peripheral is kept off for this long, twice as long after each trial in vain, at most
  /// kept_off_time_max: what no power cycle cured may be over, and without its peripheral a spacecraft ends.
  nanoseconds kept_off_time = std::chrono::minutes(10);
  nanoseconds kept_off_time_max = std::chrono::hours(6);
  std::uint32_t silent_slots_to_power_cycle = 20;  ///< in a row; 0: never
  BabbleMonitor::Settings babble{};
  nanoseconds measurement_period{0};  ///< slots before its end without a telecommand are given back; 0: never
  nanoseconds start_time =
      seconds(2);  ///< after activation, until the first slot: see PayloadCycle::is_starting
};

/// What a telecommand asks of the payload, decoded from the mission dictionary's function id and arguments.
struct PeripheralFunction {
  std::uint8_t function = 0;
  Octets arguments;
};
struct ResetPeripheral {};
struct PowerCyclePeripheral {
  nanoseconds off_time{0};
};
using PayloadCommand = std::variant<PeripheralFunction, ResetPeripheral, PowerCyclePeripheral>;

/// The flag of this payload.
struct PayloadFlag {
  GrantId grant;
  MissionCycle cycle = 0;
  MonotonicTime granted;           ///< the switcher's receipt of the tick
  MonotonicTime allotted_end;      ///< work is planned to end here
  MonotonicTime lease_end;         ///< past it nothing may be written
  bool switcher_reachable = true;  ///< a switcher hears our status; else the flag is not taken
};

/// Use of the slots since the start; part of every housekeeping structure.
struct SlotStatistics {
  std::uint32_t slots_granted = 0;
  std::uint32_t slots_used = 0;
  std::uint32_t slots_failed = 0;
  std::uint32_t slots_handed_back = 0;  ///< unused, because the payload was not active or not up yet
  std::uint32_t peripheral_timeouts = 0;
  nanoseconds last_used{0};
  std::uint32_t telecommands_executed = 0;
  nanoseconds used_total{0};     ///< grant to release, all slots that were begun
  nanoseconds granted_total{0};  ///< allotted time of all flags
  nanoseconds longest_used{0};
};

/// Every standing order was answered since set_orders(), those that count once are carried out or given up.
struct OrdersObeyed {
  std::uint8_t done = 0;  ///< that the peripheral carried out
};
struct OrderRefused {
  std::string order;
  FailureCode why = mission::failure::none;
};

/// Values of srfs_msgs/PayloadActivity: the paper's four states (section VI.B).
enum class Activity : std::uint8_t {
  off = 0,
  occupying_can = 1,
  data_processing = 2,
  other_async_command = 3
};

// What the cycle decides; carried out by the adapter in the given order.

struct PublishStatus {
  enum class Kind : std::uint8_t { taken = 1, released = 2, failed = 3 };
  Kind kind = Kind::taken;
  GrantId grant;
  nanoseconds used{0};
  std::string detail;
};
/// Opens the fence of the CAN handle for this grant.
struct OpenBus {
  GrantId grant;
  MonotonicTime lease_end;
};
/// Closes it and forgets the request under way.
struct CloseBus {};
struct SendRequest {
  std::variant<wire::WakeUpRequest, wire::CommandRequest, wire::ResetRequest> body;
};
/// Forget the request under way; the bus stays open.
struct AbortRequest {};
/// Call on_bus_quiet() as soon as every own frame has left, at once if that is so now.
struct AwaitQuiet {};
/// Take back own frames that did not get the bus, if there are any; what the CAN handle cannot do is left to
/// the fence.
struct WithdrawFrames {};
struct ProcessMeasurement {
  MissionCycle cycle = 0;
  Octets block;
  SlotStatistics statistics;
};
/// The peripheral executed this telecommand.
struct CommandDone {
  PeripheralFunction command;
};
struct WriteTelecommands {
  std::uint64_t revision = 0;
};
/// Answer with on_power_switched().
struct SwitchPower {
  bool on = true;
};
/// Whether the peripheral is kept off is remembered across a restart.
struct RememberKeptOff {
  bool kept_off = false;
  MonotonicTime until;  ///< when it is tried again
};
/// The peripheral loses the ids it knew while the disk lacks what it executed: remembered without the disk,
/// across a restart of the process, until the disk has it.
struct RememberIdsLost {
  bool lost = false;
};
struct PayloadEvent {
  enum class Kind : std::uint8_t {
    peripheral_silent,        ///< number: slots in a row
    peripheral_garbage,       ///< text
    peripheral_back,          ///< number: silent slots before
    peripheral_reset,         ///< text
    peripheral_power_cycled,  ///< text
    peripheral_babbles,       ///< number: power cycles in a row that did not help
    peripheral_kept_off,      ///< number: the same
    telecommand_failed,       ///< id, code
  };
  Kind kind = Kind::peripheral_silent;
  std::uint32_t number = 0;
  std::string text = {};
  std::uint64_t id = 0;
  FailureCode code = mission::failure::none;
};

using PayloadAction =
    std::variant<PublishStatus, OpenBus, CloseBus, SendRequest, AbortRequest, AwaitQuiet, ProcessMeasurement,
                 CommandDone, WriteTelecommands, SwitchPower, WithdrawFrames, RememberKeptOff,
                 RememberIdsLost, PayloadEvent, OrdersObeyed, OrderRefused, StageReport, Activity>;
using PayloadActions = std::vector<PayloadAction>;

/// Why a request got no usable answer.
enum class RequestFailure : std::uint8_t { silent, garbage, not_sent };

/// One payload's work in its slots (paper Figs. 5 and 7, DESIGN section 5): take the flag, wake the
/// peripheral, take its answer, execute stored telecommands, let the last own frame leave, release, process.
/// Whatever goes wrong ends in a release before the lease does, except when own frames are stuck in the
/// controller and cannot be taken back: then only the switcher's fence can prove that they are gone. A
/// peripheral that babbles is switched off and on, and in the end kept off, with a trial now and then, or
/// until a telecommand power-cycles it. Pure: time and all input come by the calls, what to do goes out as
/// actions. One thread.
class PayloadCycle {
 public:
  using CommandDecoder =
      std::function<Result<PayloadCommand, FailureCode>(std::uint16_t function, OctetView arguments)>;

  PayloadCycle(PayloadSettings settings, CommandDecoder decode, TelecommandJournal journal);

  /// An earlier process of this boot kept the peripheral off. Before activate().
  void restore_kept_off(MonotonicTime until) {
    kept_off_ = true;
    kept_off_until_ = until;
  }
  /// The peripheral lost its ids under an earlier process, whose last telecommands are not on the disk.
  void restore_ids_lost() {
    ids_lost_ = true;
    journal_.interrupt_restored();
  }

  /// What the mode holds the peripheral to. They go out behind the telecommands.
  PayloadActions set_orders(std::vector<StandingOrder> once, std::vector<StandingOrder> hold,
                            nanoseconds repeat, MonotonicTime now);

  PayloadActions activate(MonotonicTime now);
  /// Ends a running slot: nothing more is sent, the bus is released as soon as the last own frame has left.
  PayloadActions deactivate(MonotonicTime now);

  PayloadActions on_flag(const PayloadFlag& flag, MonotonicTime now);
  /// Another payload's flag: ours is over, whatever we believe.
  PayloadActions on_foreign_flag(GrantId grant, MonotonicTime now);
  /// The switcher recalls what it, or an earlier one, granted. A running slot ends, and nothing is written
  /// until the next own flag. Each recall is answered once every own frame has left or was taken back.
  PayloadActions on_recall(GrantId id, MonotonicTime now);
  PayloadActions on_peripheral_reset(GrantId grant, const std::string& reason, MonotonicTime now);
  PayloadActions on_answer(const wire::PeripheralResponse& answer, MonotonicTime now);
  PayloadActions on_request_failed(RequestFailure why, const std::string& detail, MonotonicTime now);
  PayloadActions on_bus_quiet(MonotonicTime now);
  /// A frame of the peripheral while it is asked nothing (expects_frames() is false).
  PayloadActions on_unsolicited_frame(MonotonicTime now);
  [[nodiscard]] bool expects_frames() const { return step_ != Step::idle && step_ != Step::draining; }
  PayloadActions on_processed(MonotonicTime now);
  PayloadActions on_telecommand(StoredTelecommand telecommand, MonotonicTime now);
  PayloadActions on_journal_written(std::uint64_t revision, bool ok, MonotonicTime now);
  /// @param was_on  before, where that could be read
  PayloadActions on_power_switched(bool on, bool ok, MonotonicTime now, bool was_on = true);
  /// Frames of the peripheral were waiting to be read. If the answer's deadline passed a while ago, this
  /// thread is the late one: the rest of the answer has the answer timeout once more, within the slot, once
  /// for each request; and an answer that does not come in this time either is no silence of the peripheral.
  /// Before on_deadline().
  void on_frames_waited(MonotonicTime now);
  /// @param own_frames_left  false: the request may not have left; that nobody answers is no silence then
  PayloadActions on_deadline(MonotonicTime now, bool own_frames_left = true);
  [[nodiscard]] std::optional<MonotonicTime> next_deadline() const;

  void change_settings(const PayloadSettings& settings);
  [[nodiscard]] bool peripheral_kept_off() const { return kept_off_; }
  [[nodiscard]] bool holds_bus() const { return step_ != Step::idle; }
  [[nodiscard]] const SlotStatistics& statistics() const { return statistics_; }
  [[nodiscard]] const TelecommandJournal& journal() const { return journal_; }
  [[nodiscard]] Activity activity() const;

  struct Counters {
    std::uint32_t repeated_flags = 0;     ///< flags of a grant seen before
    std::uint32_t stale_flags = 0;        ///< flags whose time was over when they came
    std::uint32_t unreachable_flags = 0;  ///< flags not taken because no switcher would have heard us
    std::uint32_t unexpected_answers = 0;
    std::uint32_t garbage_answers = 0;
    std::uint32_t resets_ordered = 0;
    std::uint32_t stray_reset_orders = 0;
    std::uint32_t power_cycles = 0;
    std::uint32_t stuck_frames = 0;  ///< leases that ended with own frames unconfirmed
    std::uint32_t lost_grants = 0;   ///< slots ended by another payload's flag
    std::uint32_t withdrawals = 0;   ///< slots whose last own frames had to be taken back
    std::uint32_t babble_cuts = 0;   ///< times the peripheral was switched off because it babbled
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  enum class Step : std::uint8_t {
    idle,
    waking,      ///< wake-up sent
    storing,     ///< an at-most-once command waits for the record of its start
    commanding,  ///< command sent
    ordering,    ///< order of the mode sent
    resetting,   ///< reset request sent
    draining,    ///< waits for the echo of the last own frame
  };
  enum class Power : std::uint8_t { on, switching_off, off, switching_on };

  void end_slot_of_another_grant(GrantId grant, const std::string& why, MonotonicTime now);
  void answer_recall();
  template <class A>
  void act(A action) {
    actions_.emplace_back(std::move(action));
  }
  PayloadActions finish();

  void begin_slot(MonotonicTime now);
  void hand_back(const std::string& detail, MonotonicTime now);
  /// A slot of a peripheral that is kept off: telecommands to it fail, but a power cycle gives it another
  /// chance.
  void serve_kept_off(MonotonicTime now);
  /// Activated just now and no slot begun since: a flag that waited for the node to come up, or for the
  /// peripheral's power, says nothing about a slot. Bounded by start_time, so that a node that is late for
  /// ever is reported.
  [[nodiscard]] bool is_starting(MonotonicTime now) const;
  /// No measurement is due and no telecommand waits.
  [[nodiscard]] bool has_nothing_to_say(MonotonicTime now);
  void decline(PublishStatus::Kind kind, const std::string& detail, MonotonicTime now);
  [[nodiscard]] bool next_command_acts_on_peripheral(MonotonicTime now);
  void wake_up(MonotonicTime now);
  void on_woken(const wire::WakeUpResponse& answer, MonotonicTime now);
  void run_next_command(MonotonicTime now);
  void execute(const StoredTelecommand& telecommand, MonotonicTime now);
  void on_command_answer(const wire::CommandResponse& answer, MonotonicTime now);
  void send_order(const StandingOrder& order, MonotonicTime now);
  void on_order_answer(const wire::CommandResponse& answer, MonotonicTime now);
  /// After some tries it gives way to the next one.
  void on_silent_order(FailureCode why, MonotonicTime now);
  void end_command(FailureCode outcome);
  void retry_command(FailureCode why);
  void send_reset(bool ordered, const std::string& reason, MonotonicTime now);
  void on_reset_answered(MonotonicTime now);
  void on_no_answer(RequestFailure why, const std::string& detail, MonotonicTime now);
  void on_silence(const std::string& detail, bool own_frames_left, MonotonicTime now);
  void count_silence(const std::string& detail);
  /// The slot ends in the middle of whatever it was doing.
  void abandon_slot(const std::string& detail, MonotonicTime now);
  void fail_slot(const std::string& detail, MonotonicTime now);
  void drain(MonotonicTime now);
  void release(MonotonicTime now);
  void start_power_cycle(const std::string& reason, nanoseconds off_time, bool by_command);
  void on_power_deadline();
  void on_switched_on(bool ok, MonotonicTime now);
  void end_power_cycle(FailureCode outcome);
  void stop_awaiting_power_off(MonotonicTime now);
  void on_switched_off(bool ok, MonotonicTime now);
  void note_ids_lost(bool lost);
  void keep_off(bool off);
  /// Until the next trial of a peripheral that is kept off.
  [[nodiscard]] nanoseconds kept_off_time() const;
  /// When the own frames must have left, or are taken back.
  [[nodiscard]] MonotonicTime drain_deadline(MonotonicTime now) const;
  [[nodiscard]] MonotonicTime answer_deadline(MonotonicTime now) const;
  void await_answer(Step step, MonotonicTime now);
  [[nodiscard]] bool time_for_request(MonotonicTime now) const;

  PayloadSettings settings_;
  CommandDecoder decode_;
  TelecommandJournal journal_;
  StandingOrders orders_;
  std::uint32_t order_id_ = 0;   ///< of the last one sent
  bool orders_changed_ = false;  ///< since then
  PayloadActions actions_;

  bool active_ = false;
  std::optional<MonotonicTime> starting_since_;  ///< until the first slot is begun
  Step step_ = Step::idle;
  PayloadFlag flag_;                 ///< the running or last own slot
  GrantId newest_;                   ///< highest grant seen, of any payload
  std::optional<GrantId> recalled_;  ///< a recall to be answered once no own frame waits for the bus
  std::optional<PublishStatus> last_status_;
  std::optional<MonotonicTime> deadline_;
  std::optional<std::string> failure_;  ///< of this slot
  std::optional<Octets> block_;
  std::optional<MonotonicTime> measured_;  ///< grant of the slot with the last measurement
  bool stuck_counted_ = false;
  bool withdrawn_ = false;      ///< in this slot
  bool was_late_ = false;       ///< this thread, for the answer under way
  bool reset_ordered_ = false;  ///< the running reset was ordered by the switcher, else by telecommand
  std::string reset_reason_;
  std::optional<nanoseconds> power_command_;  ///< power cycle by telecommand after the release
  bool power_needed_ = false;                 ///< power cycle after the release: silent for too many slots
  bool await_power_off_ = false;              ///< draining: the peripheral is being switched off first
  std::uint32_t silent_in_a_row_ = 0;

  Power power_ = Power::on;
  bool power_by_command_ = false;
  BabbleMonitor babble_;
  bool keep_off_wanted_ = false;  ///< being switched off to stay so
  bool kept_off_ = false;
  MonotonicTime kept_off_until_;
  bool ids_lost_ = false;  ///< remembered
  nanoseconds power_off_time_{0};
  std::string power_reason_;
  std::optional<MonotonicTime> power_deadline_;

  std::uint32_t processing_ = 0;
  std::uint64_t written_or_asked_ = 0;  ///< highest revision given out by WriteTelecommands
  Activity published_ = Activity::off;
  SlotStatistics statistics_;
  Counters counters_;
};

}  // namespace srfs
