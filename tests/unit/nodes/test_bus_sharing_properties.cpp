// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Model of the complete bus sharing: the switcher's rotation, three payloads with their CAN handles, the
// topics and the bus between them, and all process faults. The flight code makes all decisions.
//
// SRFS_MODEL_SLOTS and SRFS_MODEL_SEED set the number of slots and the first seed.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <queue>
#include <random>
#include <string>
#include <vector>

#include <fmt/format.h>

#include <mission/structures.hpp>

#include "hw/can_bus.hpp"
#include "nodes/can_switcher/task_flag_rotation.hpp"
#include "nodes/can_switcher/tick_holdover.hpp"
#include "nodes/can_switcher/transmit_drain.hpp"
#include "nodes/payload/payload_cycle.hpp"
#include "tests/build_kind.hpp"

namespace srfs {
namespace {

#if defined(__OPTIMIZE__)
constexpr std::uint64_t default_slots = testing_support::slow ? 30'000 : 1'000'000;
#else
constexpr std::uint64_t default_slots = 30'000;
#endif
constexpr std::uint64_t slots_per_world = 5'000;

constexpr std::size_t payload_count = 3;
constexpr std::array<const char*, payload_count> names{"a", "b", "c"};
constexpr nanoseconds tick_period = milliseconds(100);
constexpr nanoseconds frame_time = microseconds(260);
constexpr nanoseconds recall_time = milliseconds(500);
/// The bus must be in use again this long after the last fault: restart, wait, recall, a few slots.
constexpr nanoseconds recovery = seconds(3);

using Random = std::mt19937_64;

std::uint64_t number_from(const char* variable, std::uint64_t fallback) {
  const char* text = std::getenv(variable);
  return text != nullptr ? std::strtoull(text, nullptr, 10) : fallback;
}

const std::vector<Slot>& plan() {
  static const std::vector<Slot> slots{{"a", milliseconds(60), milliseconds(20), milliseconds(40)},
                                       {"b", milliseconds(50), milliseconds(20), milliseconds(30)},
                                       {"c", milliseconds(90), milliseconds(30), milliseconds(25)}};
  return slots;
}

/// Input to a process, or an action of the world itself.
struct Event {
  enum class Kind : std::uint8_t {
    tick,          ///< to the switcher; also the world's own beat
    status,        ///< to the switcher
    fenced,        ///< to the switcher: the process is gone
    drain,         ///< the switcher's timer while it waits for an empty transmit queue
    configure,     ///< configures the unconfigured switcher
    switcher_due,  ///< the switcher's timer
    substitute_due,
    flag,  ///< to a payload; holder 255 means recall
    reset_order,
    payload_due,
    answer,
    processed,
    journal_written,
    power_switched,
    telecommand,
    frame_end,
    start,  ///< of a process
    thaw,
    fault,
  };
  MonotonicTime at{};
  std::uint64_t order = 0;
  Kind kind = Kind::tick;
  std::uint8_t who = 0;       ///< payload index; payload_count: the switcher
  std::uint32_t process = 0;  ///< the only process the event applies to; 0: any
  GrantId grant{};
  std::uint8_t holder = 0;
  MonotonicTime granted{};  ///< of a tick: its due time
  MonotonicTime lease_end{};
  std::uint64_t number = 0;
  std::uint64_t queue = 0;       ///< of an answer: the queue that held its request
  MonotonicTime request_left{};  ///< of an answer: when its request leaves the queue
  BusReport::Kind report = BusReport::Kind::taken;
  std::uint32_t reporter = 0;
  bool yes = false;
};
struct Later {
  bool operator()(const Event& a, const Event& b) const {
    return a.at != b.at ? a.at > b.at : a.order > b.order;
  }
};

constexpr std::uint8_t switcher_index = payload_count;
constexpr std::uint8_t nobody = 255;

class World;

/// One process' handle of the computer's controller. Written frames stay in the controller when the process
/// dies. In send(), a payload may be stopped between its lease check and the write.
class ModelBus : public hw::CanBus {
 public:
  ModelBus(World& world, std::uint8_t who) : world_(world), who_(who) {}
  [[nodiscard]] int fd() const override { return -1; }
  [[nodiscard]] Result<void, hw::CanError> send(const hw::CanFrame& frame) override;
  [[nodiscard]] std::optional<hw::CanFrame> receive() override { return std::nullopt; }
  [[nodiscard]] std::size_t unconfirmed() const override { return unconfirmed_; }
  bool withdraw() override;
  [[nodiscard]] hw::CanController controller() const override { return {}; }
  [[nodiscard]] std::string reason() const override { return {}; }
  [[nodiscard]] const hw::CanCounters& counters() const override { return counters_; }
  void confirm() {
    if (unconfirmed_ > 0) --unconfirmed_;
    ++counters_.echoed;
  }
  void forget() { unconfirmed_ = 0; }

 private:
  World& world_;
  std::uint8_t who_;
  std::size_t unconfirmed_ = 0;
  hw::CanCounters counters_;
};

/// State common to all processes.
struct Process {
  std::uint32_t incarnation = 0;
  bool alive = false;
  bool frozen = false;
  std::deque<Event> inbox;  ///< events that arrived while the process was stopped
};

struct Step {
  PayloadAction action;
  int frames_left = 0;  ///< of the current SendRequest
};

/// A payload's process, with a reduced version of the adapter around its logic (PayloadNode).
struct Payload : Process {
  std::unique_ptr<ModelBus> bus;
  std::unique_ptr<hw::LeasedCanBus> leased;
  std::unique_ptr<PayloadCycle> cycle;
  std::deque<Step> todo;
  bool running = false;
  bool frame_in_hand = false;  ///< stopped between the lease check and the write
  GrantId grant;
  bool awaiting_quiet = false;
  std::uint64_t request = 0;  ///< current request; answers to earlier ones are late
  std::optional<MonotonicTime> armed;
  bool writing = false;
  std::uint64_t journal_wanted = 0;
  std::uint64_t written_revision = 0;
  std::uint32_t believed_switcher = 0;
  std::uint32_t heard_by = 0;  ///< incarnation of the switcher that got its first report
  // These outlive the process:
  Octets disk;
  Octets being_written;
  bool powered = true;
  std::deque<std::uint32_t> known_ids;  ///< request ids that the peripheral remembers
};

struct Switcher : Process {
  std::unique_ptr<TaskFlagRotation> rotation;
  bool configured = false;
  std::unique_ptr<ModelBus> bus;
  std::optional<TransmitDrain> drain;
  std::optional<MonotonicTime> armed;
  TickHoldover holdover;
  std::optional<MonotonicTime> substitute_armed;
  bool heard_a_tick = false;      ///< since activation
  std::optional<Grant> decided;   ///< stopped before it recorded this grant
  std::optional<Grant> recorded;  ///< stopped after the record, before the flag
};

struct Statistics {
  std::uint64_t grants = 0;
  std::uint64_t frames = 0;
  std::uint64_t fences = 0;
  std::uint64_t recalls = 0;
  std::uint64_t resets = 0;
  std::uint64_t kills = 0;
  std::uint64_t freezes = 0;
  std::uint64_t frozen_before_a_write = 0;
  std::uint64_t refused_by_the_handle = 0;
  std::uint64_t completed = 0;
  std::uint64_t interrupted = 0;
  std::uint64_t withdrawn = 0;
  std::uint64_t jams = 0;
  std::uint64_t frames_taken_back = 0;
  std::uint64_t unproven = 0;
  std::uint64_t reconfigured = 0;
  std::uint64_t removed = 0;  ///< payloads removed from the plan
  std::uint64_t substitutes = 0;
  std::uint64_t suite_restarts = 0;
};

class World {
 public:
  World(std::uint64_t seed, Statistics& statistics)
      : random_(seed), statistics_(statistics), may_withdraw_(seed % 3 != 0) {
    for (std::uint8_t i = 0; i <= payload_count; ++i)
      schedule({.at = now_, .kind = Event::Kind::start, .who = i});
    schedule({.at = now_ + tick_period, .kind = Event::Kind::tick});
    schedule({.at = now_ + seconds(1), .kind = Event::Kind::fault});
  }

  void fly(std::uint64_t grants) {
    const std::uint64_t end = statistics_.grants + grants;
    while (statistics_.grants < end && !::testing::Test::HasFatalFailure()) step();
  }
  /// Stops all faults. Every accepted telecommand must then end.
  void settle() {
    faults_on_ = false;
    const MonotonicTime end = now_ + seconds(20);
    while (now_ < end && !::testing::Test::HasFatalFailure()) {
      step();
      if (switcher_.alive) switcher_.rotation->set_plan(plan(), {names.begin(), names.end()});
    }
    if (::testing::Test::HasFatalFailure()) return;
    for (const auto& [id, t] : telecommands_) {
      if (!t.accepted) continue;
      ASSERT_TRUE(t.end) << "telecommand " << id << " was accepted and never ended";
      if (t.end->success && t.function < 16) {
        ASSERT_GE(t.executed, 1U) << "telecommand " << id << " is said to be done";
      }
    }
  }

  [[nodiscard]] MonotonicTime now() const { return now_; }
  bool chance(std::uint64_t one_in) { return random_() % one_in == 0; }
  nanoseconds between(nanoseconds low, nanoseconds high) {
    return low + nanoseconds(static_cast<std::int64_t>(random_() %
                                                       static_cast<std::uint64_t>((high - low).count() + 1)));
  }

  void on_write(std::uint8_t who) {
    if (who == switcher_index) return queue_frame(who, switcher_.incarnation, {});
    Payload& p = payloads_[who];
    if (faults_on_ && chance(4000)) {
      ++statistics_.frozen_before_a_write;
      p.frame_in_hand = true;
      freeze(who);
      return;
    }
    put_on_bus(who);
  }

  /// Appends the frame to the controller's transmit queue.
  void queue_frame(std::uint8_t who, std::uint32_t process, GrantId grant) {
    if (faults_on_ && chance(3000)) {  // the bus is jammed
      trouble();
      ++statistics_.jams;
      bus_free_ = std::max(now_, bus_free_) + between(milliseconds(1), milliseconds(700));
      last_trouble_ = bus_free_;
    }
    bus_free_ = std::max(now_, bus_free_) + frame_time;
    ++in_queue_;
    schedule({.at = bus_free_,
              .kind = Kind::frame_end,
              .who = who,
              .process = process,
              .grant = grant,
              .number = transmit_queue_});
  }

  /// Sets the interface down and up. This discards the transmit queue and starts a new one.
  bool withdraw() {
    if (!may_withdraw_) return false;
    statistics_.frames_taken_back += std::exchange(in_queue_, 0);
    ++transmit_queue_;
    queue_ends_.push_back(now_);
    bus_free_ = now_;
    for (Payload& p : payloads_) {
      if (p.bus) p.bus->forget();
    }
    if (switcher_.bus) switcher_.bus->forget();
    return true;
  }

 private:
  using Kind = Event::Kind;

  // --- time

  void schedule(Event event) {
    event.order = next_order_++;
    queue_.push(event);
  }

  void step() {
    const Event event = queue_.top();
    queue_.pop();
    now_ = event.at;
    switch (event.kind) {
      case Kind::fault:
        return fault();
      case Kind::start:
        return event.who == switcher_index ? start_switcher() : start_payload(event.who);
      case Kind::thaw:
        return thaw(event);
      case Kind::frame_end:
        if (event.number != transmit_queue_) return;
        --in_queue_;
        if (event.who != switcher_index) frame_end(event);
        break;
      case Kind::tick:
        if (event.process == 0) return beat();
        break;
      case Kind::answer:
        if (!peripheral_answers(event)) return;
        break;
      case Kind::fenced:
        if (payloads_[event.holder].alive && payloads_[event.holder].incarnation <= event.reporter)
          kill(event.holder);
        break;
      case Kind::configure:
        return configure_switcher(event);
      case Kind::journal_written:
        // The disk keeps the data even if the process dies.
        if (payloads_[event.who].incarnation == event.process)
          payloads_[event.who].disk = payloads_[event.who].being_written;
        break;
      case Kind::power_switched:
        if (payloads_[event.who].incarnation == event.process && !switch_power(event)) return;
        break;
      default:
        break;
    }
    deliver(event);
  }

  Process& process(std::uint8_t who) {
    return who == switcher_index ? static_cast<Process&>(switcher_) : payloads_[who];
  }

  void deliver(const Event& event) {
    Process& p = process(event.who);
    if (!p.alive || (event.process != 0 && event.process != p.incarnation)) return;
    if (p.frozen) {
      p.inbox.push_back(event);
    } else if (event.who == switcher_index) {
      to_switcher(event);
    } else {
      to_payload(event);
    }
  }

  /// The world's beat: sends the tick and the ground's telecommands, and checks liveness.
  void beat() {
    schedule({.at = now_ + tick_period, .kind = Kind::tick});
    send_tick();
    send_telecommands();
    if (faults_on_ && chance(50) && switcher_.alive && !switcher_.frozen) change_plan();
    if (faults_on_ && chance(400) && switcher_.alive && !switcher_.frozen && switcher_.configured)
      unconfigure_switcher();
    if (now_ - last_trouble_ > recovery) {
      ASSERT_LT(now_ - last_release_, seconds(1)) << "the rotation stands still without a reason";
    }
  }

  /// The timing node also dies, for longer than the rotation may pause. It returns with another phase and
  /// another cycle count.
  void send_tick() {
    if (faults_on_ && chance(300) && now_ >= timing_back_) {
      timing_back_ = now_ + between(milliseconds(100), seconds(4));
      tick_phase_ = between(nanoseconds(0), tick_period - milliseconds(1));
      cycle_ = chance(10) ? 0 : cycle_ + random_() % 1000;
    }
    if (faults_on_ && now_ < timing_back_) {
      if (!switcher_.heard_a_tick) trouble();  // a new switcher needs a first tick
      return;
    }
    ++cycle_;
    const int copies = !faults_on_ ? 1 : chance(300) ? 0 : chance(300) ? 2 : 1;
    for (int i = 0; i < copies; ++i) {
      schedule({.at = now_ + tick_phase_ + between(nanoseconds(0), microseconds(300)),
                .kind = Kind::tick,
                .who = switcher_index,
                .process = switcher_.incarnation,
                .granted = now_ + tick_phase_,
                .number = cycle_});
    }
  }

  // --- processes

  void trouble() { last_trouble_ = now_; }

  void fault() {
    if (!faults_on_) return;
    schedule({.at = now_ + between(milliseconds(10), chance(10) ? seconds(6) : milliseconds(600)),
              .kind = Kind::fault});
    if (chance(30)) {  // the whole suite restarts; the record of the last grant is lost
      ++statistics_.suite_restarts;
      for (std::uint8_t i = 0; i < payload_count; ++i) {
        const Payload& p = payloads_[i];
        if (!p.alive || p.frozen || p.grant != newest_published_ || !p.leased->granted(now_)) continue;
        bus_free_ = std::max(now_, bus_free_) + between(milliseconds(1), milliseconds(700));  // jammed
        last_trouble_ = bus_free_;
        queue_frame(i, p.incarnation, p.grant);
      }
      for (std::uint8_t i = 0; i <= payload_count; ++i) kill(i);
      record_.reset();
      return;
    }
    const auto who = static_cast<std::uint8_t>(random_() % (payload_count + 1));
    if (!process(who).alive) return;
    if (chance(3)) {
      kill(who);
    } else if (!process(who).frozen) {
      freeze(who);
    }
  }

  void freeze(std::uint8_t who) {
    trouble();
    ++statistics_.freezes;
    Process& p = process(who);
    p.frozen = true;
    static constexpr std::array<std::int64_t, 5> longest_ms{3, 30, 120, 400, 1500};
    const nanoseconds time =
        between(microseconds(50), milliseconds(longest_ms[random_() % longest_ms.size()]));
    schedule({.at = now_ + time, .kind = Kind::thaw, .who = who, .process = p.incarnation});
  }

  void thaw(const Event& event) {
    Process& p = process(event.who);
    if (!p.alive || p.incarnation != event.process || !p.frozen) return;
    trouble();
    p.frozen = false;
    if (event.who == switcher_index) {
      if (switcher_.recorded) publish_flag(*std::exchange(switcher_.recorded, std::nullopt));
      if (switcher_.decided) give(*std::exchange(switcher_.decided, std::nullopt));
      arm_switcher();
    } else {
      Payload& payload = payloads_[event.who];
      if (std::exchange(payload.frame_in_hand, false)) put_on_bus(event.who);
      work(event.who);
      if (!payload.frozen) write_what_waits(event.who);
    }
    // Deliver the events that arrived meanwhile; topics have no order between them.
    std::deque<Event> inbox = std::exchange(p.inbox, {});
    if (chance(2)) std::reverse(inbox.begin(), inbox.end());
    for (const Event& e : inbox) deliver(e);
  }

  void kill(std::uint8_t who) {
    Process& p = process(who);
    if (!p.alive) return;
    trouble();
    ++statistics_.kills;
    if (who == switcher_index) {
      switcher_.rotation.reset();
      switcher_.bus.reset();
      switcher_.drain.reset();
      switcher_.decided.reset();
      switcher_.recorded.reset();
    } else {
      Payload& payload = payloads_[who];
      // The file may be complete although its writer never reported it.
      if (payload.writing && chance(2)) payload.disk = payload.being_written;
      payload.todo.clear();
      payload.cycle.reset();
      payload.leased.reset();
      payload.bus.reset();
      payload.frame_in_hand = false;
    }
    p.alive = p.frozen = false;
    p.inbox.clear();
    ++p.incarnation;  // voids events for the old process; start() counts on from here
    schedule({.at = now_ + between(milliseconds(5), milliseconds(400)), .kind = Kind::start, .who = who});
  }

  void start_switcher() {
    if (switcher_.alive) return;
    trouble();
    ++switcher_.incarnation;
    switcher_.alive = true;
    switcher_.armed.reset();
    switcher_.holdover = {};
    switcher_.heard_a_tick = false;
    switcher_.substitute_armed.reset();
    switcher_.configured = true;
    fencing_ = false;
    switcher_.bus = std::make_unique<ModelBus>(*this, switcher_index);
    switcher_.rotation =
        std::make_unique<TaskFlagRotation>(plan(), switcher_.incarnation, now_, inherited(record_));
    if (!inherited(record_)) switcher_.rotation->await_empty_queue(now_);
    switcher_.rotation->set_recall_time(recall_time);
    switcher_.rotation->resume(now_);
    if (switcher_.rotation->awaits_fence()) drain();
  }

  [[nodiscard]] std::optional<InheritedGrant> inherited(
      const std::optional<TaskFlagRotation::Holder>& holder) const {
    if (!holder) return std::nullopt;
    const Payload& p = payloads_[holder->slot];
    const bool runs = p.alive && (holder->process == 0 || p.incarnation <= holder->process);
    return InheritedGrant{names[holder->slot], runs ? std::optional(p.incarnation) : std::nullopt};
  }

  void unconfigure_switcher() {
    trouble();
    ++statistics_.reconfigured;
    switcher_.configured = false;
    switcher_.rotation->suspend();
    switcher_.holdover.rest();
    switcher_.heard_a_tick = false;
    switcher_.armed.reset();
    switcher_.substitute_armed.reset();
    for (Payload& p : payloads_) p.heard_by = 0;
    schedule({.at = now_ + between(milliseconds(1), milliseconds(300)),
              .kind = Kind::configure,
              .who = switcher_index,
              .process = switcher_.incarnation});
  }

  void configure_switcher(const Event& event) {
    if (!switcher_.alive || event.process != switcher_.incarnation) return;
    trouble();
    if (switcher_.frozen)
      return schedule({.at = now_ + milliseconds(10),
                       .kind = Kind::configure,
                       .who = switcher_index,
                       .process = switcher_.incarnation});
    switcher_.configured = true;
    TaskFlagRotation& rotation = *switcher_.rotation;
    if (rotation.awaits_release()) rotation.inherit(*inherited(rotation.holder()), now_);
    rotation.resume(now_);
    if (rotation.awaits_fence() && !fencing_) drain();
    record();
    arm_switcher();
  }

  void start_payload(std::uint8_t who) {
    Payload& p = payloads_[who];
    if (p.alive) return;
    trouble();
    ++p.incarnation;
    p.alive = true;
    p.bus = std::make_unique<ModelBus>(*this, who);
    p.leased = std::make_unique<hw::LeasedCanBus>(*p.bus);
    TelecommandJournal journal("boot");
    if (!p.disk.empty()) {
      ASSERT_TRUE(journal.restore(p.disk));
    }
    PayloadSettings settings;
    settings.silent_slots_to_power_cycle = 5;
    p.cycle = std::make_unique<PayloadCycle>(settings, decode, std::move(journal));
    p.armed.reset();
    p.running = p.awaiting_quiet = p.writing = false;
    p.journal_wanted = p.written_revision = 0;
    p.believed_switcher = p.heard_by = 0;
    p.grant = {};
    run(who, p.cycle->activate(now_));
  }

  static Result<PayloadCommand, FailureCode> decode(std::uint16_t function, OctetView /*arguments*/) {
    if (function == 16) return ResetPeripheral{};
    if (function == 17) return PowerCyclePeripheral{milliseconds(50)};
    return PeripheralFunction{static_cast<std::uint8_t>(function), {}};
  }

  // --- the switcher (as in CanSwitcherNode)

  void to_switcher(const Event& event) {
    if (event.kind == Kind::fenced) fencing_ = false;
    if (event.kind == Kind::frame_end) switcher_.bus->confirm();
    if (!switcher_.configured) return;
    switch (event.kind) {
      case Kind::tick:
        take_tick(event);
        if (!switcher_.alive || switcher_.frozen) return;
        break;
      case Kind::substitute_due:
        switcher_.substitute_armed.reset();
        tick_missing();
        if (!switcher_.alive || switcher_.frozen) return;
        break;
      case Kind::status:
        take_status(event);
        break;
      case Kind::fenced:
        drain();
        break;
      case Kind::drain:
        step_drain();
        break;
      case Kind::frame_end:
        break;
      default:
        switcher_.armed.reset();
        switcher_deadline();
        break;
    }
    arm_switcher();
  }

  void take_tick(const Event& event) {
    carry_out(switcher_.holdover.on_tick(
        {.cycle = event.number, .due = event.granted, .period = tick_period, .received = event.at}));
    // One with a doubted cycle starts no substitutes.
    switcher_.heard_a_tick = switcher_.holdover.next_substitute().has_value();
  }

  void tick_missing() {
    // take_waiting()
    std::deque<Event> waiting;
    for (auto e = switcher_.inbox.begin(); e != switcher_.inbox.end();) {
      if (e->kind == Kind::tick) {
        waiting.push_back(*e);
        e = switcher_.inbox.erase(e);
      } else {
        ++e;
      }
    }
    for (const Event& e : waiting) {
      if (!switcher_.alive || switcher_.frozen) return;
      take_tick(e);
    }
    if (!switcher_.alive || switcher_.frozen) return;
    carry_out(switcher_.holdover.on_deadline(now_));
  }

  void carry_out(const HoldoverActions& actions) {
    for (const HoldoverAction& action : actions) std::visit([this](const auto& a) { carry_out(a); }, action);
  }
  void carry_out(const ReportTicksMissing& /*action*/) {}
  void carry_out(const ReportTicksBack& /*action*/) {}
  void carry_out(const Beat& beat) {
    if (beat.is_substitute) ++statistics_.substitutes;
    switcher_deadline();
    if (!switcher_.alive || switcher_.frozen) return;
    carry_out(switcher_.rotation->on_tick(now_, switcher_.holdover.cycle(), beat.received));
  }

  void drain() {
    switcher_.drain.emplace();
    step_drain();
  }

  void step_drain() {
    const auto state = switcher_.drain->step(*switcher_.bus, now_);
    if (state == TransmitDrain::State::empty) {
      switcher_.rotation->on_fenced(switcher_.rotation->current()->id, now_);
      record();
      return;
    }
    if (state == TransmitDrain::State::unproven) ++statistics_.unproven;
    schedule({.at = now_ + TransmitDrain::period,
              .kind = Kind::drain,
              .who = switcher_index,
              .process = switcher_.incarnation});
  }

  void take_status(const Event& event) {
    TaskFlagRotation& rotation = *switcher_.rotation;
    const BusReport report{event.report, event.grant, names[event.holder], event.reporter, event.yes};
    const ReportVerdict verdict = rotation.on_bus_status(report, now_);
    if (verdict == ReportVerdict::applied && event.report != BusReport::Kind::taken) last_release_ = now_;
    record();
    carry_out(rotation.on_early_release(now_));
  }

  void switcher_deadline() {
    TaskFlagRotation& rotation = *switcher_.rotation;
    const auto due = rotation.next_deadline();
    if (!due || now_ < *due) return;
    // take_waiting(): handle waiting input before accusing any node.
    std::deque<Event> waiting;
    for (auto e = switcher_.inbox.begin(); e != switcher_.inbox.end();) {
      if (e->kind == Kind::status) {
        waiting.push_back(*e);
        e = switcher_.inbox.erase(e);
      } else {
        ++e;
      }
    }
    for (const Event& e : waiting) {
      if (switcher_.alive && !switcher_.frozen) {
        take_status(e);
      } else if (switcher_.alive) {
        switcher_.inbox.push_back(e);
      }
    }
    if (!switcher_.alive || switcher_.frozen) return;
    carry_out(rotation.on_deadline(now_));
    record();
  }

  void arm_switcher() {
    if (!switcher_.alive || switcher_.frozen || !switcher_.configured) return;
    const auto substitute = switcher_.holdover.next_substitute();
    if (substitute != switcher_.substitute_armed) {
      switcher_.substitute_armed = substitute;
      if (substitute)
        schedule({.at = std::max(now_, *substitute + between(nanoseconds(0), microseconds(200))),
                  .kind = Kind::substitute_due,
                  .who = switcher_index,
                  .process = switcher_.incarnation});
    }
    const auto deadline = switcher_.rotation->next_deadline();
    if (deadline == switcher_.armed) return;
    switcher_.armed = deadline;
    if (!deadline) return;
    schedule({.at = std::max(now_, *deadline + between(nanoseconds(0), microseconds(200))),
              .kind = Kind::switcher_due,
              .who = switcher_index,
              .process = switcher_.incarnation});
  }

  void record() {
    const auto holder = switcher_.rotation->holder();
    record_ = holder;
  }

  void carry_out(const RotationActions& actions) {
    for (const RotationAction& action : actions) std::visit([this](const auto& a) { carry_out(a); }, action);
  }
  void carry_out(const ReportDoubt& /*action*/) {}

  void carry_out(const Grant& grant) {
    if (faults_on_ && chance(2000)) {
      switcher_.decided = grant;
      freeze(switcher_index);
      return;
    }
    give(grant);
  }

  void give(const Grant& grant) {
    if (now_ >= grant.granted + grant.allotted) {
      ++statistics_.withdrawn;
      switcher_.rotation->withdraw(grant.id);
      return;
    }
    record();
    if (faults_on_ && chance(2000)) {
      switcher_.recorded = grant;
      freeze(switcher_index);
      if (chance(4)) kill(switcher_index);
      return;
    }
    publish_flag(grant);
  }

  /// A flag may be lost, duplicated, late, or overtaken by a later one.
  void publish(Event flag) {
    for (std::uint8_t i = 0; i < payload_count; ++i) {
      const int copies = !faults_on_ ? 1 : chance(150) ? 0 : chance(100) ? 2 : 1;
      for (int k = 0; k < copies; ++k) {
        flag.at = now_ + between(microseconds(50),
                                 faults_on_ && chance(200) ? milliseconds(300) : microseconds(900));
        flag.who = i;
        flag.process = payloads_[i].incarnation;
        schedule(flag);
      }
    }
  }

  void publish_flag(const Grant& grant) {
    ASSERT_GT(grant.id, newest_published_);
    newest_published_ = grant.id;
    ++statistics_.grants;
    publish({.kind = Kind::flag,
             .grant = grant.id,
             .holder = static_cast<std::uint8_t>(grant.slot),
             .granted = grant.granted,
             .lease_end = grant.lease_end,
             .number = static_cast<std::uint64_t>(grant.allotted.count())});
  }

  void carry_out(const Recall& recall) {
    ++statistics_.recalls;
    publish({.kind = Kind::flag, .grant = recall.id, .holder = nobody});
  }

  void carry_out(const OrderReset& order) {
    ++statistics_.resets;
    const auto who = static_cast<std::uint8_t>(switcher_.rotation->current()->slot);
    if (faults_on_ && chance(20)) return;
    schedule({.at = now_ + between(microseconds(50), milliseconds(2)),
              .kind = Kind::reset_order,
              .who = who,
              .process = payloads_[who].incarnation,
              .grant = order.id});
  }

  void carry_out(const Fence& f) {
    ++statistics_.fences;
    fencing_ = true;
    const auto who = static_cast<std::uint8_t>(switcher_.rotation->current()->slot);
    ASSERT_EQ(f.payload, names[who]);
    // The SIGKILL arrives even if this switcher dies first. Until then the holder runs on unrestricted.
    schedule({.at = now_ + between(microseconds(100), milliseconds(30)),
              .kind = Kind::fenced,
              .who = switcher_index,
              .process = switcher_.incarnation,
              .grant = f.id,
              .holder = who,
              .reporter = f.process.value_or(UINT32_MAX)});
  }

  void change_plan() {
    if (chance(3)) {
      switcher_.rotation->set_early_handover(chance(2));
      return;
    }
    std::vector<std::string> order{names.begin(), names.end()};
    std::shuffle(order.begin(), order.end(), random_);
    if (chance(3)) order.pop_back();
    std::vector<Slot> slots = plan();
    if (chance(2)) {  // removes nodes whose process has ended; a later change adds them again
      for (std::uint8_t i = 0; i < payload_count; ++i) {
        if (payloads_[i].alive || order.size() == 1) continue;
        slots[i] = {};
        std::erase(order, std::string(names[i]));
        ++statistics_.removed;
      }
    }
    switcher_.rotation->set_plan(slots, order);
  }

  // --- payloads (as in PayloadNode)

  void to_payload(const Event& event) {
    Payload& p = payloads_[event.who];
    switch (event.kind) {
      case Kind::flag:
        on_flag(event);
        break;
      case Kind::reset_order:
        run(event.who, p.cycle->on_peripheral_reset(event.grant, "overrun", now_));
        break;
      case Kind::payload_due:
        p.armed.reset();
        run(event.who, p.cycle->on_deadline(now_));
        break;
      case Kind::answer:
        on_answer(event);
        break;
      case Kind::processed:
        run(event.who, p.cycle->on_processed(now_));
        break;
      case Kind::journal_written:
        p.writing = false;
        p.written_revision = event.number;
        run(event.who, p.cycle->on_journal_written(event.number, true, now_));
        if (!p.frozen) write_what_waits(event.who);
        break;
      case Kind::power_switched:
        run(event.who, p.cycle->on_power_switched(event.holder != 0, true, now_, event.yes));
        break;
      case Kind::telecommand:
        arrive(event);
        break;
      case Kind::frame_end:
        p.bus->confirm();
        check_quiet(event.who);
        break;
      default:
        break;
    }
  }

  void on_flag(const Event& event) {
    Payload& p = payloads_[event.who];
    if (event.grant.incarnation != p.believed_switcher) {
      // The flag must come from the process that holds the switcher's instance lock.
      if (!switcher_.alive || switcher_.incarnation != event.grant.incarnation) return;
      p.believed_switcher = event.grant.incarnation;
    }
    if (event.holder == nobody) return run(event.who, p.cycle->on_recall(event.grant, now_));
    if (event.holder != event.who) return run(event.who, p.cycle->on_foreign_flag(event.grant, now_));
    const PayloadFlag flag{
        .grant = event.grant,
        .cycle = cycle_,
        .granted = event.granted,
        .allotted_end = event.granted + nanoseconds(static_cast<std::int64_t>(event.number)),
        .lease_end = event.lease_end,
        .switcher_reachable = !faults_on_ || !chance(100)};
    run(event.who, p.cycle->on_flag(flag, now_));
  }

  void run(std::uint8_t who, PayloadActions actions) {
    Payload& p = payloads_[who];
    for (PayloadAction& action : actions) {
      const bool request = std::holds_alternative<SendRequest>(action);
      p.todo.push_back({std::move(action), request ? 1 + static_cast<int>(random_() % 3) : 0});
    }
    if (!p.running) work(who);
  }

  /// Carries out the queued actions until the queue is empty or the process is stopped.
  void work(std::uint8_t who) {
    Payload& p = payloads_[who];
    p.running = true;
    while (p.alive && !p.frozen && !p.todo.empty()) {
      if (faults_on_ && chance(5000)) {
        freeze(who);
        break;
      }
      if (p.todo.front().frames_left > 1) {
        --p.todo.front().frames_left;
        send_frame(who);
        continue;
      }
      const Step step = std::move(p.todo.front());
      p.todo.pop_front();
      std::visit([&](const auto& action) { carry_out(who, action); }, step.action);
    }
    p.running = false;
    if (p.alive && !p.frozen) arm_payload(who);
  }

  void arm_payload(std::uint8_t who) {
    Payload& p = payloads_[who];
    const auto deadline = p.cycle->next_deadline();
    if (deadline == p.armed) return;
    p.armed = deadline;
    if (!deadline) return;
    schedule({.at = std::max(now_, *deadline + between(nanoseconds(0), microseconds(200))),
              .kind = Kind::payload_due,
              .who = who,
              .process = p.incarnation});
  }

  bool send_frame(std::uint8_t who) {
    Payload& p = payloads_[who];
    const std::uint64_t grant = std::uint64_t{p.grant.incarnation} << 32U | p.grant.counter;
    if (p.leased->send({}, grant, now_)) return true;
    ++statistics_.refused_by_the_handle;
    return false;
  }

  void carry_out(std::uint8_t who, const PublishStatus& status) {
    if (!switcher_.alive || !switcher_.configured) return;
    Payload& p = payloads_[who];
    Event event{.kind = Kind::status,
                .who = switcher_index,
                .process = switcher_.incarnation,
                .grant = status.grant,
                .holder = who,
                .report = static_cast<BusReport::Kind>(status.kind),
                .reporter = p.incarnation,
                .yes = status.kind == PublishStatus::Kind::released && p.grant != status.grant};
    // On the loopback interface a sent report waits in the switcher's socket at once, and the switcher reads
    // its socket before it accuses (take_waiting). The first report of a process goes to a matched reader, so
    // it is not lost.
    const bool first = p.heard_by != switcher_.incarnation;
    p.heard_by = switcher_.incarnation;
    const int copies = !faults_on_ || first ? 1 : chance(200) ? 0 : chance(100) ? 2 : 1;
    for (int i = 0; i < copies; ++i) {
      event.at = first ? now_ : now_ + between(microseconds(50), microseconds(900));
      schedule(event);
    }
  }
  void carry_out(std::uint8_t who, const OpenBus& open) {
    Payload& p = payloads_[who];
    p.grant = open.grant;
    p.awaiting_quiet = false;
    (void)p.leased->begin(std::uint64_t{open.grant.incarnation} << 32U | open.grant.counter, open.lease_end);
  }
  void carry_out(std::uint8_t who, const CloseBus& /*close*/) {
    payloads_[who].leased->end();
    ++payloads_[who].request;
  }
  void carry_out(std::uint8_t who, const SendRequest& request) {
    Payload& p = payloads_[who];
    ++p.request;
    if (!send_frame(who)) {
      run(who, p.cycle->on_request_failed(RequestFailure::not_sent, "refused", now_));
      return;
    }
    Event answer{.at = bus_free_ + between(microseconds(800), milliseconds(4)),
                 .kind = Kind::answer,
                 .who = who,
                 .process = p.incarnation,
                 .number = p.request,
                 .queue = transmit_queue_,
                 .request_left = bus_free_};
    if (const auto* command = std::get_if<wire::CommandRequest>(&request.body)) {
      answer.holder = 1;
      answer.reporter = command->telecommand_id;
    } else if (std::holds_alternative<wire::ResetRequest>(request.body)) {
      answer.holder = 2;
    }
    answer.yes = !faults_on_ || !chance(answer.holder == 2 ? 4 : 60);  // false: the answer is lost
    schedule(answer);
  }
  void carry_out(std::uint8_t who, const AbortRequest& /*abort*/) { ++payloads_[who].request; }
  void carry_out(std::uint8_t who, const AwaitQuiet& /*await*/) {
    payloads_[who].awaiting_quiet = true;
    check_quiet(who);
  }
  void carry_out(std::uint8_t who, const ProcessMeasurement& /*process*/) {
    schedule({.at = now_ + between(microseconds(100), milliseconds(30)),
              .kind = Kind::processed,
              .who = who,
              .process = payloads_[who].incarnation});
  }
  void carry_out(std::uint8_t who, const WriteTelecommands& write) {
    payloads_[who].journal_wanted = write.revision;
    if (!payloads_[who].writing) write_journal(who);
  }
  void carry_out(std::uint8_t who, const SwitchPower& power) {
    schedule({.at = now_ + between(microseconds(50), milliseconds(2)),
              .kind = Kind::power_switched,
              .who = who,
              .process = payloads_[who].incarnation,
              .holder = static_cast<std::uint8_t>(power.on ? 1 : 0)});
  }
  void carry_out(std::uint8_t who, const StageReport& report) { on_stage(who, report); }
  void carry_out(std::uint8_t who, const WithdrawFrames& /*withdraw*/) {
    if (!payloads_[who].leased->quiet()) (void)payloads_[who].bus->withdraw();
    check_quiet(who);
  }
  void carry_out(std::uint8_t /*who*/, const RememberKeptOff& /*remember*/) {}
  void carry_out(std::uint8_t /*who*/, const RememberIdsLost& /*remember*/) {}
  void carry_out(std::uint8_t /*who*/, const CommandDone& /*done*/) {}
  void carry_out(std::uint8_t /*who*/, const OrdersObeyed& /*obeyed*/) {}
  void carry_out(std::uint8_t /*who*/, const OrderRefused& /*refused*/) {}
  void carry_out(std::uint8_t /*who*/, const PayloadEvent& /*event*/) {}
  void carry_out(std::uint8_t /*who*/, Activity /*activity*/) {}

  void check_quiet(std::uint8_t who) {
    Payload& p = payloads_[who];
    if (!p.awaiting_quiet || !p.leased->quiet()) return;
    p.awaiting_quiet = false;
    run(who, p.cycle->on_bus_quiet(now_));
  }

  void write_what_waits(std::uint8_t who) {
    const Payload& p = payloads_[who];
    if (p.journal_wanted > p.written_revision && !p.writing) write_journal(who);
  }
  void write_journal(std::uint8_t who) {
    Payload& p = payloads_[who];
    p.writing = true;
    p.being_written = p.cycle->journal().encode();
    schedule({.at = now_ + between(microseconds(300), milliseconds(15)),
              .kind = Kind::journal_written,
              .who = who,
              .process = p.incarnation,
              .number = p.cycle->journal().revision()});
  }

  // --- the bus and the peripherals

  void put_on_bus(std::uint8_t who) {
    const Payload& p = payloads_[who];
    ++statistics_.frames;
    ASSERT_EQ(p.grant, newest_published_)
        << "payload " << names[who] << " wrote under " << p.grant.incarnation << "." << p.grant.counter
        << ", the bus was granted as " << newest_published_.incarnation << "." << newest_published_.counter;
    const bool stuck = faults_on_ && chance(20'000);  // the frame's echo never arrives
    if (stuck) trouble();
    queue_frame(who, stuck ? UINT32_MAX : p.incarnation, p.grant);
  }

  void frame_end(const Event& event) {
    ASSERT_GE(event.grant, newest_published_)
        << "a frame of payload " << names[event.who] << " was on the bus in a later slot";
    ASSERT_GE(event.grant, last_frame_) << "frames of two slots interleave";
    last_frame_ = event.grant;
  }

  /// The request has reached the peripheral. @return whether its answer reaches the payload
  bool peripheral_answers(Event event) {
    Payload& p = payloads_[event.who];
    const bool taken_back = event.queue != transmit_queue_ && queue_ends_[event.queue] < event.request_left;
    if (!p.powered || taken_back) return false;
    if (event.holder == 1) execute(event.who, event.reporter);
    return event.yes;
  }

  void execute(std::uint8_t who, std::uint32_t id) {
    auto& known = payloads_[who].known_ids;
    if (std::find(known.begin(), known.end(), id) != known.end()) return;
    known.push_back(id);
    if (known.size() > 16) known.pop_front();
    auto& telecommand = telecommands_[id];
    ++telecommand.executed;
    if (telecommand.repeat != RepeatClass::idempotent) {
      ASSERT_EQ(telecommand.executed, 1U) << "telecommand " << id << " was executed again";
    }
    ASSERT_FALSE(telecommand.end && !telecommand.end->success &&
                 telecommand.end->failure != mission::failure::interrupted)
        << "telecommand " << id << " was executed after it had failed";
  }

  void on_answer(const Event& event) {
    Payload& p = payloads_[event.who];
    if (event.number != p.request) return;  // PeripheralLink drops late answers
    wire::PeripheralResponse response;
    if (event.holder == 1) {
      response.body = wire::CommandResponse{event.reporter, wire::PeripheralResult::done};
    } else if (event.holder == 2) {
      response.body = wire::ResetResponse{};
    } else {
      response.body = wire::WakeUpResponse{wire::PeripheralStatus::ready, 1, {1}};
    }
    run(event.who, p.cycle->on_answer(response, now_));
  }

  bool switch_power(const Event& event) {
    Payload& p = payloads_[event.who];
    const bool on = event.holder != 0;
    const bool before = std::exchange(p.powered, on);
    if (!on) p.known_ids.clear();
    Event told = event;
    told.yes = before;
    deliver(told);
    return false;
  }

  // --- telecommands

  struct Telecommand {
    std::uint8_t target = 0;
    std::uint16_t function = 1;
    RepeatClass repeat = RepeatClass::by_id;
    bool accepted = false;
    bool refused = false;
    std::optional<StageReport> end;
    std::uint32_t executed = 0;
  };

  /// Like ttc, publishes each telecommand repeatedly until it is accepted.
  void send_telecommands() {
    if (faults_on_ && chance(4)) {
      const std::uint32_t id = next_id_++;
      Telecommand& t = telecommands_[id];
      t.target = static_cast<std::uint8_t>(random_() % payload_count);
      t.function = chance(12) ? static_cast<std::uint16_t>(16 + random_() % 2) : std::uint16_t{1};
      t.repeat = t.function >= 16 ? RepeatClass::at_most_once : static_cast<RepeatClass>(1 + random_() % 3);
      waiting_.push_back(id);
    }
    std::erase_if(waiting_, [this](std::uint32_t id) {
      return telecommands_[id].accepted || telecommands_[id].refused;
    });
    for (const std::uint32_t id : waiting_) {
      if (faults_on_ && chance(3)) continue;
      schedule({.at = now_ + between(microseconds(50), milliseconds(90)),
                .kind = Kind::telecommand,
                .who = telecommands_[id].target,
                .number = id});
    }
  }

  void arrive(const Event& event) {
    const Telecommand& t = telecommands_[static_cast<std::uint32_t>(event.number)];
    run(event.who,
        payloads_[event.who].cycle->on_telecommand({event.number, t.function, t.repeat, {}, {}}, now_));
  }

  void on_stage(std::uint8_t /*who*/, const StageReport& report) {
    Telecommand& t = telecommands_[static_cast<std::uint32_t>(report.id)];
    if (report.stage == Stage::acceptance) {
      (report.success ? t.accepted : t.refused) = true;
      return;
    }
    if (report.stage == Stage::start && report.success) return;
    if (t.end) {
      ASSERT_EQ(*t.end, report) << "two different ends of telecommand " << report.id;
      return;
    }
    t.end = report;
    ++(report.success ? statistics_.completed : statistics_.interrupted);
    if (report.success && t.function < 16) {
      ASSERT_GE(t.executed, 1U) << "telecommand " << report.id;
    }
  }

  Random random_;
  Statistics& statistics_;
  MonotonicTime now_{seconds(1)};
  std::priority_queue<Event, std::vector<Event>, Later> queue_;
  std::uint64_t next_order_ = 0;
  MissionCycle cycle_ = 0;
  nanoseconds tick_phase_{0};
  MonotonicTime timing_back_{seconds(1)};
  bool faults_on_ = true;
  MonotonicTime last_trouble_{seconds(1)};
  MonotonicTime last_release_{seconds(1)};

  std::array<Payload, payload_count> payloads_;
  Switcher switcher_;
  std::optional<TaskFlagRotation::Holder> record_;  ///< outlives the switcher

  GrantId newest_published_;
  GrantId last_frame_;
  // The computer's controller
  bool may_withdraw_;  ///< the processes have CAP_NET_ADMIN
  MonotonicTime bus_free_{seconds(1)};
  std::uint64_t transmit_queue_ = 0;  ///< number of the current transmit queue; withdraw() starts a new one
  std::uint64_t in_queue_ = 0;
  std::vector<MonotonicTime> queue_ends_;
  bool fencing_ = false;  ///< the switcher has sent a SIGKILL that has not yet arrived

  std::map<std::uint32_t, Telecommand> telecommands_;
  std::vector<std::uint32_t> waiting_;
  std::uint32_t next_id_ = 1;
};

Result<void, hw::CanError> ModelBus::send(const hw::CanFrame& /*frame*/) {
  ++unconfirmed_;
  world_.on_write(who_);
  return {};
}

bool ModelBus::withdraw() {
  return world_.withdraw();
}

TEST(BusSharing, NoStoppedKilledOrLateProcessEverDisturbsAnothersSlot) {
  const std::uint64_t slots = number_from("SRFS_MODEL_SLOTS", default_slots);
  const std::uint64_t first_seed = number_from("SRFS_MODEL_SEED", 1);
  Statistics s;
  for (std::uint64_t seed = first_seed; s.grants < slots; ++seed) {
    World world(seed, s);
    world.fly(slots_per_world);
    if (!::testing::Test::HasFatalFailure()) world.settle();
    if (::testing::Test::HasFatalFailure()) {
      FAIL() << fmt::format("SRFS_MODEL_SEED={} SRFS_MODEL_SLOTS=1 shows it, at {} s of its time", seed,
                            static_cast<double>(world.now().ns()) / 1e9);
    }
  }
  RecordProperty("slots", std::to_string(s.grants));
  fmt::print(
      "{} slots, {} frames; {} processes stopped ({} of them between the check of the lease and the write), "
      "{} killed; {} "
      "resets ordered, {} fenced, {} recalls, {} flags withheld; {} writes refused by the handle; {} "
      "telecommands completed, {} "
      "failed\n",
      s.grants, s.frames, s.freezes, s.frozen_before_a_write, s.kills, s.resets, s.fences, s.recalls,
      s.withdrawn, s.refused_by_the_handle, s.completed, s.interrupted);
  fmt::print(
      "the bus jammed {} times, {} frames taken back, {} waits for an empty queue in vain; the switcher "
      "reconfigured {} times; {} substitute ticks\n",
      s.jams, s.frames_taken_back, s.unproven, s.reconfigured, s.substitutes);
  if (slots < 30'000) return;
  EXPECT_GT(s.frozen_before_a_write, slots / (slots < 300'000 ? 6000 : 2000))
      << "about one in 1650 slots; a third of it leaves few slots room for chance";
  EXPECT_GT(s.fences, slots / 100);
  EXPECT_GT(s.recalls, slots / 1000);
  EXPECT_GT(s.jams, slots / 2000);
  EXPECT_GT(s.frames_taken_back, slots / 10'000);
  EXPECT_GT(s.unproven, 0U);
  EXPECT_GT(s.reconfigured, slots / 2000);
  EXPECT_GT(s.substitutes, slots / 100);
  EXPECT_GT(s.suite_restarts, slots / 2000);
  EXPECT_GT(s.resets, slots / 200);
  EXPECT_GT(s.withdrawn, 0U);
  if (slots >= 300'000) {
    EXPECT_GT(s.refused_by_the_handle, 0U) << "rare: whoever comes too late is mostly asked first";
  }
  EXPECT_GT(s.completed, slots / 20);
  EXPECT_GT(s.interrupted, 10U);
}

}  // namespace
}  // namespace srfs
