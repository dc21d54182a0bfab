// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Compares the schedule and its journal with a model without a disk, for power loss at any point.
#include <map>
#include <random>
#include <set>

#include <gtest/gtest.h>

#include "nodes/ttc/services/schedule_service.hpp"
#include "nodes/ttc/test/simulated_medium.hpp"
#include "tests/build_kind.hpp"
#include "wire/cuc.hpp"

namespace srfs {
namespace {

using testing_support::PowerLoss;
using testing_support::SimulatedMedium;

constexpr seconds late_max{60};
const TaiTime day = to_tai(UtcTime(seconds(1'795'000'000)));

/// The operator's view of the schedule: no disk, no ids.
struct Model {
  struct Entry {
    TaiTime release;
    std::uint8_t group = 0;
    friend bool operator==(const Entry&, const Entry&) = default;
  };
  std::map<std::uint16_t, Entry> scheduled;  ///< by sequence count of the request
  std::map<std::uint8_t, bool> groups;
  bool enabled = true;
  friend bool operator==(const Model&, const Model&) = default;

  [[nodiscard]] bool is_enabled(const Entry& e) const {
    return enabled && (!groups.contains(e.group) || groups.at(e.group));
  }
};

Model seen(const TimeSchedule& schedule) {
  Model model;
  for (const auto& [id, activity] : schedule.activities())
    model.scheduled[activity.request.sequence] = {activity.release, activity.group};
  model.groups = schedule.groups();
  model.enabled = schedule.enabled();
  return model;
}

Octets request_packet(std::uint16_t sequence) {
  wire::TcPacket packet;
  packet.apid = 17;
  packet.sequence_count = sequence;
  packet.service = 8;
  packet.subtype = 1;
  packet.application = {0, 1, 2, 1};
  return wire::make_tc_packet(packet);
}

/// One request of service 11 and its effect on the model.
struct Order {
  std::uint8_t subtype = 0;
  Octets arguments;
  std::function<bool(Model&, TaiTime now, bool valid)> carry_out;  ///< false: refused, nothing changes
};

class Orders {
 public:
  explicit Orders(std::uint64_t seed) : random_(seed) {}

  Order next(const Model& model, TaiTime now) {
    switch (random_() % 12) {
      case 0:
      case 1:
      case 2:
      case 3:
        return insertion(model, now);
      case 4:
        return deletion(model);
      case 5:
        return deletion_of_period(now);
      case 6:
      case 7:
        return shift(model);
      case 8:
        return switching(random_() % 4 != 0);
      case 9:
        return random_() % 8 == 0 ? reset() : switching(true);
      default:
        return group_order(model);
    }
  }
  std::uint64_t number(std::uint64_t below) { return random_() % below; }

 private:
  Order insertion(const Model& model, TaiTime now) {
    std::vector<std::pair<std::uint16_t, Model::Entry>> entries;
    OctetWriter out;
    const std::uint64_t count = 1 + number(3);
    out.u16(static_cast<std::uint16_t>(count));
    for (std::uint64_t i = 0; i < count; ++i) {
      // Sometimes reuse a sequence count that is or was scheduled.
      const bool old = number(20) == 0 && next_sequence_ > 1;
      const auto sequence = static_cast<std::uint16_t>(old ? number(next_sequence_) : next_sequence_++);
      const Model::Entry entry{now + seconds(static_cast<int>(number(130)) - 4),
                               static_cast<std::uint8_t>(number(3) == 0 ? number(4) : 0)};
      if (old && !model.scheduled.contains(sequence)) {  // would give two requests one sequence count
        return switching(true);
      }
      out.u8(entry.group);
      out.bytes(wire::encode_cuc(entry.release));
      out.bytes(request_packet(sequence));
      entries.emplace_back(sequence, entry);
    }
    return {4, out.take(), [entries](Model& m, TaiTime at, bool valid) {
              Model after = m;
              for (const auto& [sequence, entry] : entries) {
                if (entry.group != 0 && !m.groups.contains(entry.group)) return false;
                if (valid && entry.release <= at) return false;
                if (!after.scheduled.emplace(sequence, entry).second) return false;
              }
              if (after.scheduled.size() > TimeSchedule::max_activities) return false;
              m = after;
              return true;
            }};
  }
  /// A scheduled sequence count, if there is one.
  std::uint16_t some(const Model& model) {
    if (model.scheduled.empty() || number(10) == 0)
      return static_cast<std::uint16_t>(number(next_sequence_ + 1U));
    return std::next(model.scheduled.begin(), static_cast<std::ptrdiff_t>(number(model.scheduled.size())))
        ->first;
  }
  static void write_id(OctetWriter& out, std::uint16_t sequence) {
    out.u16(1);
    out.u16(0);
    out.u16(17);
    out.u16(sequence);
  }
  Order deletion(const Model& model) {
    const std::uint16_t sequence = some(model);
    OctetWriter out;
    write_id(out, sequence);
    return {5, out.take(), [sequence](Model& m, TaiTime, bool) { return m.scheduled.erase(sequence) == 1; }};
  }
  Order deletion_of_period(TaiTime now) {
    const TaiTime from = now + seconds(number(60));
    const TaiTime to = from + seconds(number(20));
    OctetWriter out;
    out.u8(1);
    out.bytes(wire::encode_cuc(from));
    out.bytes(wire::encode_cuc(to));
    out.u16(0);
    return {6, out.take(), [from, to](Model& m, TaiTime, bool) {
              std::erase_if(m.scheduled, [&](const auto& e) {
                return e.second.release >= from && e.second.release <= to;
              });
              return true;
            }};
  }
  Order shift(const Model& model) {
    const seconds offset(static_cast<int>(number(60)) - 20);
    const bool all = number(2) == 0;
    const std::uint16_t sequence = some(model);
    OctetWriter out;
    out.u32(static_cast<std::uint32_t>(offset.count()));
    if (!all) write_id(out, sequence);
    return {static_cast<std::uint8_t>(all ? 15 : 7), out.take(), [=](Model& m, TaiTime at, bool valid) {
              if (!all && !m.scheduled.contains(sequence)) return false;
              Model after = m;
              for (auto& [s, entry] : after.scheduled) {
                if (!all && s != sequence) continue;
                entry.release += offset;
                if (valid && entry.release <= at) return false;
              }
              m = after;
              return true;
            }};
  }
  static Order switching(bool on) {
    return {static_cast<std::uint8_t>(on ? 1 : 2), {}, [on](Model& m, TaiTime, bool) {
              m.enabled = on;
              return true;
            }};
  }
  static Order reset() {
    return {3, {}, [](Model& m, TaiTime, bool) {
              m.enabled = false;
              m.scheduled.clear();
              for (auto& [group, enabled] : m.groups) enabled = true;
              return true;
            }};
  }
  Order group_order(const Model& model) {
    const auto group = static_cast<std::uint8_t>(1 + number(3));
    OctetWriter out;
    out.u16(1);
    out.u8(group);
    if (!model.groups.contains(group)) {
      out.u8(1);
      return {22, out.take(),
              [group](Model& m, TaiTime, bool) { return m.groups.emplace(group, true).second; }};
    }
    const auto subtype = static_cast<std::uint8_t>(23 + number(3));
    return {subtype, out.take(), [=](Model& m, TaiTime, bool) {
              if (!m.groups.contains(group)) return false;
              if (subtype != 23) {
                m.groups[group] = subtype == 24;
                return true;
              }
              for (const auto& [s, entry] : m.scheduled) {
                if (entry.group == group) return false;
              }
              return m.groups.erase(group) == 1;
            }};
  }

  std::mt19937_64 random_;
  std::uint16_t next_sequence_ = 0;
};

/// The part of ttc under test: journal, schedule and disk.
class Process {
 public:
  explicit Process(JournalMedium& medium)
      : log_(medium), journal_("boot", seconds(60), 4096), schedule_(journal_, report_queue_, late_max) {
    for (const JournalRecord& record : log_.load().records) journal_.apply(record);
    journal_.begin({}, 1, {});
  }
  void write() {
    while (journal_.wants_write() || journal_.wants_sync()) {
      const JournalBatch batch = journal_.take_batch(true);
      const bool ok = batch.snapshot ? log_.snapshot(*batch.snapshot).has_value()
                                     : log_.append(batch.records, batch.sync).has_value();
      ASSERT_TRUE(ok);
      journal_.on_written(batch, ok, log_.used_octets());
      schedule_.on_written(batch.revision, ok);
    }
  }
  /// Accepts a telecommand and stores it on disk.
  std::uint64_t accept(const Octets& packet, std::uint64_t activity = 0) {
    UplinkedPacket uplinked;
    uplinked.packet = packet;
    mission::Command command;
    command.node = activity == 0 ? "ttc" : "payload_eps";
    return journal_.accept(
        {.origin = {.request = wire::peek_request_id(packet).value()}, .command = &command}, uplinked, {},
        activity);
  }
  /// Carries out a request of service 11. @return whether it was refused
  bool carry_out(std::uint64_t id, std::uint8_t subtype, const Octets& arguments) {
    mission::Command command;
    command.service = ScheduleService::service_type;
    command.subtype = subtype;
    schedule_.execute({.origin = {.id = id}, .command = &command, .arguments = arguments}, {});
    const bool refused = report_queue_.counters().failed > failed_;
    failed_ = report_queue_.counters().failed;
    for (const StageReached& stage : report_queue_.take_stages()) journal_.on_stage(stage);
    write();
    for (const StageReached& stage : report_queue_.take_stages()) journal_.on_stage(stage);
    static_cast<void>(report_queue_.take());
    return !refused;
  }
  AcceptanceJournal& journal() { return journal_; }
  ScheduleService& schedule() { return schedule_; }
  ReportQueue& report_queue() { return report_queue_; }

 private:
  JournalLog log_;
  AcceptanceJournal journal_;
  ReportQueue report_queue_;
  ScheduleService schedule_;
  std::uint32_t failed_ = 0;
};

/// A mission that spans many processes.
class Mission {
 public:
  explicit Mission(std::uint64_t seed) : medium_(seed), orders_(seed / 8) {}

  SimulatedMedium& medium() { return medium_; }
  std::uint64_t number(std::uint64_t below) { return orders_.number(below); }
  [[nodiscard]] std::size_t executed() const { return executions_.size(); }

  /// Runs a process until the power is lost, for at most @p steps steps.
  /// @return whether the power was lost
  bool run(int steps) {
    try {
      Process process(medium_);
      come_up(process);
      for (int i = 0; i < steps && !testing::Test::HasFatalFailure(); ++i) step(process);
    } catch (const PowerLoss&) {
      return true;
    }
    return false;
  }

 private:
  /// Checks that each activity is in its state before or after the previous process' last step.
  void come_up(Process& process) {
    for (const AcceptedTelecommand* t : process.journal().known()) {
      if (t->activity != 0) note_execution(*t);
    }
    const Model found = seen(process.schedule().schedule());
    for (const auto& [sequence, entry] : found.scheduled) {
      ASSERT_TRUE(before_.scheduled.contains(sequence) || after_.scheduled.contains(sequence))
          << sequence << " comes from nowhere";
      ASSERT_FALSE(executions_.contains(sequence)) << sequence << " was executed and is there again";
    }
    for (const auto& [sequence, entry] : after_.scheduled) {
      const bool was_there = before_.scheduled.contains(sequence);
      ASSERT_TRUE(!was_there || found.scheduled.contains(sequence)) << sequence << " is lost";
    }
    for (const std::uint16_t sequence : releasing_) {
      ASSERT_NE(found.scheduled.contains(sequence), executions_.contains(sequence))
          << sequence << " is lost, or there twice";
    }
    releasing_.clear();
    // An accepted request continues, as after a kill. Of earlier requests only the end may be missing on
    // disk.
    process.schedule().on_time(now_, valid_);
    bool carried_out = false;
    std::vector<TelecommandOrigin> open;
    for (const AcceptedTelecommand* t : process.journal().known()) {
      if (t->activity == 0 && !t->end) open.push_back(t->origin);
    }
    for (const TelecommandOrigin& origin : open) {
      const bool is_last = order_ && (origin.request.packet_sequence_control & 0x3FFF) == last_order_number();
      const bool applied = process.schedule().schedule().has_applied(origin.id);
      carried_out = carried_out || is_last;
      if (applied || !is_last) {
        process.journal().on_stage({.id = origin.id, .stage = Stage::completion, .data = {}});
      } else {
        ASSERT_EQ(found, before_) << "not carried out, and something is changed";
        process.carry_out(origin.id, order_->subtype, order_->arguments);
      }
    }
    const Model now = seen(process.schedule().schedule());
    ASSERT_TRUE(!order_ || now == after_ || (!carried_out && now == before_)) << "half an order";
    process.write();
    before_ = after_ = now;
    order_.reset();
  }

  [[nodiscard]] std::uint64_t last_order_number() const { return (order_number_ - 1) & 0x3FFF; }

  void step(Process& process) {
    if (orders_.number(3) == 0) return pass_time(process);
    order_ = orders_.next(before_, now_);
    process.schedule().on_time(now_, valid_);
    after_ = before_;
    const bool good = order_->carry_out(after_, now_, valid_);
    wire::TcPacket packet;
    packet.apid = 1;
    packet.sequence_count = static_cast<std::uint16_t>(order_number_++ & 0x3FFF);
    packet.service = 11;
    packet.subtype = order_->subtype;
    packet.application = order_->arguments;
    const std::uint64_t id = process.accept(wire::make_tc_packet(packet));
    process.write();
    ASSERT_EQ(process.carry_out(id, order_->subtype, order_->arguments), good) << int{order_->subtype};
    ASSERT_EQ(seen(process.schedule().schedule()), after_) << int{order_->subtype};
    order_.reset();
    before_ = after_;
  }

  /// Time advances, steps back, or becomes invalid; then due activities are released.
  void pass_time(Process& process) {
    const std::uint64_t what = orders_.number(12);
    if (what == 0) {
      now_ += seconds(static_cast<int>(orders_.number(200)) - 60);
    } else if (what == 1) {
      valid_ = !valid_;
    } else {
      now_ += seconds(orders_.number(8));
    }
    process.schedule().on_time(now_, valid_);
    after_ = before_;
    std::set<std::uint16_t> due;
    std::set<std::uint16_t> dropped;
    for (const auto& [sequence, entry] : before_.scheduled) {
      if (!valid_ || entry.release > now_) continue;
      const bool is_due = before_.is_enabled(entry) && now_ - entry.release <= late_max;
      (is_due ? due : dropped).insert(sequence);
      after_.scheduled.erase(sequence);
    }
    process.schedule().drop_overdue();
    std::set<std::uint16_t> told;
    for (const auto& event : process.schedule().take_dropped()) told.insert(event.sequence);
    ASSERT_EQ(told, dropped);
    Model dropped_only = before_;
    for (const std::uint16_t sequence : dropped) dropped_only.scheduled.erase(sequence);
    std::swap(after_, dropped_only);
    process.write();
    std::swap(after_, dropped_only);
    before_ = dropped_only;

    releasing_ = due;
    std::vector<std::uint64_t> ids;
    TaiTime last;
    while (const ScheduledActivity* activity = process.schedule().due()) {
      ASSERT_TRUE(due.erase(activity->request.sequence) == 1) << "released, and not due";
      ASSERT_LE(last, activity->release) << "out of order";
      last = activity->release;
      ids.push_back(process.accept(activity->packet, activity->id));
    }
    ASSERT_TRUE(due.empty()) << "due, and not released";
    process.write();
    for (const AcceptedTelecommand* t : process.journal().known()) {
      if (t->activity != 0) note_execution(*t);
    }
    for (const std::uint64_t id : ids)
      process.journal().on_stage({.id = id, .stage = Stage::completion, .data = {}});
    ASSERT_EQ(seen(process.schedule().schedule()), after_);
    releasing_.clear();
    before_ = after_;
  }

  /// Notes that the packet is on disk under this telecommand id, which means that it is executed.
  void note_execution(const AcceptedTelecommand& t) {
    const auto sequence = static_cast<std::uint16_t>(t.origin.request.packet_sequence_control & 0x3FFF);
    const auto [entry, is_new] = executions_.emplace(sequence, t.origin.id);
    ASSERT_TRUE(is_new || entry->second == t.origin.id) << sequence << " is executed twice";
  }

  SimulatedMedium medium_;
  Orders orders_;
  Model before_;
  Model after_;
  std::optional<Order> order_;
  std::set<std::uint16_t> releasing_;
  std::map<std::uint16_t, std::uint64_t> executions_;
  TaiTime now_ = day;
  bool valid_ = true;
  std::uint64_t order_number_ = 0;
};

TEST(ScheduleProperties, EveryOrderHoldsOnceAndEveryActivityIsExecutedOnceWhereverThePowerIsLost) {
  std::uint64_t losses = 0;
  std::size_t executed = 0;
  constexpr unsigned step = testing_support::slow ? 3 : 1;
  for (std::uint64_t lose_at = 0; lose_at < 160; lose_at += step) {
    SCOPED_TRACE(testing::Message() << "power lost in call " << lose_at);
    Mission mission(lose_at);
    mission.medium().lose_at = lose_at;
    for (int process = 0; process < 4; ++process) {
      losses += mission.run(120) ? 1 : 0;
      ASSERT_FALSE(HasFatalFailure());
      mission.medium().lose_at = mission.medium().calls + mission.number(150);
    }
    mission.medium().lose_at = UINT64_MAX;
    ASSERT_FALSE(mission.run(0));
    ASSERT_FALSE(HasFatalFailure());
    executed += mission.executed();
  }
  EXPECT_GT(losses, testing_support::slow ? 100U : 350U);
  EXPECT_GT(executed, testing_support::slow ? 100U : 400U);
}

TEST(ScheduleProperties, AMissionWithoutLossesFollowsTheModel) {
  for (std::uint64_t seed = 0; seed < (testing_support::slow ? 1 : 4); ++seed) {
    Mission mission(seed * 8);
    ASSERT_FALSE(mission.run(800));
    ASSERT_FALSE(HasFatalFailure()) << seed;
    EXPECT_GT(mission.executed(), 10U);
  }
}

TEST(ScheduleOnDisk, ASnapshotOfTheOlderVersionHasNoSchedule) {
  AcceptanceJournal journal("boot", seconds(60));
  OctetWriter old;
  old.u8(1);
  old.u8(4);
  for (const char c : std::string("boot")) old.u8(static_cast<std::uint8_t>(c));
  old.u64(7);
  old.u64(1);
  old.u64(1);
  write_link_state(old, {});
  old.u16(0);
  EXPECT_TRUE(journal.apply({.kind = journal_snapshot_kind, .payload = old.take()}));
  EXPECT_TRUE(journal.schedule().empty());
  EXPECT_TRUE(journal.schedule().enabled());
  EXPECT_EQ(journal.next_id(), 7U);
}

TEST(ScheduleOnDisk, TheLargestScheduleFitsAndIsReadAgain) {
  TimeSchedule schedule;
  ScheduleChange change;
  for (std::uint64_t id = 1; id <= TimeSchedule::max_activities; ++id) {
    ScheduledActivity activity;
    activity.id = id;
    activity.release = day + seconds(id);
    activity.request.sequence = static_cast<std::uint16_t>(id);
    activity.packet = Octets(TimeSchedule::max_octets / TimeSchedule::max_activities, 7);
    change.inserted.push_back(activity);
  }
  for (std::uint8_t group = 1; group <= TimeSchedule::max_groups; ++group)
    change.groups.emplace_back(group, ScheduleChange::GroupState::disabled);
  schedule.apply(change);
  EXPECT_EQ(schedule.activities().size(), TimeSchedule::max_activities);
  EXPECT_EQ(schedule.octets(), TimeSchedule::max_octets);

  OctetWriter out;
  schedule.write(out);
  OctetReader in(out.view());
  EXPECT_EQ(TimeSchedule::read(in), schedule);
  EXPECT_EQ(in.remaining(), 0U);
  for (std::size_t octets = 0; octets < out.size(); octets += 97) {
    OctetReader cut(out.view().first(octets));
    EXPECT_FALSE(TimeSchedule::read(cut)) << octets;
  }
}

}  // namespace
}  // namespace srfs
