// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <map>
#include <optional>
#include <random>
#include <vector>

#include <mission/structures.hpp>

#include "nodes/payload/payload_cycle.hpp"

namespace srfs {
namespace {

/// The environment of one payload: a switcher that grants and orders resets, a peripheral that answers,
/// answers wrongly or is silent, a bus with late echoes, a slow or failing disk, and repeated telecommands.
/// Checks the invariants.
class World {
 public:
  explicit World(std::uint64_t seed) : random_(seed), cycle_(settings(), decode, TelecommandJournal("boot")) {
    take(cycle_.activate(now_));
  }

  void step() {
    now_ += microseconds(random_() % 12'000);
    if (const auto deadline = cycle_.next_deadline(); deadline && now_ >= *deadline) {
      if (chance(4)) {
        cycle_.on_frames_waited(now_);
        ASSERT_TRUE(!cycle_.expects_frames() || cycle_.next_deadline());
      }
      take(cycle_.on_deadline(now_));
    }
    switch (random_() % 9) {
      case 0:
        grant();
        break;
      case 1:
      case 2:
        answer();
        break;
      case 3:
        if (awaiting_quiet_ && chance(2)) quiet();
        break;
      case 4:
        telecommand();
        break;
      case 5:
        disk();
        break;
      case 6:
        power();
        break;
      case 7:
        if (chance(20)) take(cycle_.on_peripheral_reset({1, counter_}, "overrun", now_));
        if (chance(60)) take(cycle_.on_foreign_flag({1, ++counter_}, now_));
        if (chance(30)) recall();
        if (chance(10) && !cycle_.expects_frames()) {
          for (int i = 0; i < 70; ++i) take(cycle_.on_unsolicited_frame(now_));
        }
        if (processing_ > 0) {
          --processing_;
          take(cycle_.on_processed(now_));
        }
        break;
      default:
        if (chance(40)) {
          take(cycle_.set_orders({}, {StandingOrder{9, {}, "order"}, StandingOrder{8, {}, "order"}},
                                 milliseconds(500), now_));
        }
        if (chance(80)) {
          active_ = !active_;
          take(active_ ? cycle_.activate(now_) : cycle_.deactivate(now_));
        }
        break;
    }
  }

  /// From now on every switch obeys, and no slot is granted.
  void settle() {
    for (int i = 0; i < 100 && !::testing::Test::HasFatalFailure(); ++i) {
      now_ += milliseconds(500);
      if (cycle_.next_deadline()) take(cycle_.on_deadline(now_));
      if (awaiting_quiet_) quiet();
      disk();
      if (!switching_.empty()) switched(true);
    }
    ASSERT_TRUE(switching_.empty());
    ASSERT_TRUE(!active_ || powered_ == !kept_off_) << "what the node believes of the power is not so";
    ASSERT_TRUE(!kept_off_ || cycle_.next_deadline()) << "nothing tries it again";
  }

  std::uint32_t slots = 0;
  std::uint32_t completed = 0;
  std::uint32_t interrupted = 0;
  std::uint32_t kept_off_changes = 0;
  std::uint32_t recalls = 0;
  std::uint32_t late_switches = 0;

 private:
  static PayloadSettings settings() {
    PayloadSettings settings;
    settings.kept_off_time = milliseconds(300);
    settings.kept_off_time_max = seconds(2);
    return settings;
  }
  static Result<PayloadCommand, FailureCode> decode(std::uint16_t function, OctetView /*arguments*/) {
    if (function == 16) return ResetPeripheral{};
    if (function == 17) return PowerCyclePeripheral{milliseconds(50)};
    if (function == 0) return Err(mission::failure::unknown_function);
    return PeripheralFunction{static_cast<std::uint8_t>(function), {}};
  }
  bool chance(std::uint64_t one_in) { return random_() % one_in == 0; }

  void grant() {
    if (open_ && !chance(50)) return;
    const PayloadFlag flag{{1, ++counter_},          counter_,   now_, now_ + milliseconds(60),
                           now_ + milliseconds(120), !chance(50)};
    now_ += microseconds(random_() % (chance(10) ? 130'000 : 2'000));
    take(cycle_.on_flag(flag, now_));
  }

  void answer() {
    if (!request_) return;
    const auto request = *request_;
    if (chance(8)) {
      request_.reset();
      take(cycle_.on_request_failed(chance(2) ? RequestFailure::garbage : RequestFailure::not_sent, "lie",
                                    now_));
      return;
    }
    if (chance(6)) return;
    request_.reset();
    wire::PeripheralResponse response;
    if (std::holds_alternative<wire::WakeUpRequest>(request)) {
      response.body = wire::WakeUpResponse{
          chance(10) ? wire::PeripheralStatus::booting : wire::PeripheralStatus::ready, 1, {1}};
    } else if (const auto* command = std::get_if<wire::CommandRequest>(&request)) {
      response.body = wire::CommandResponse{
          chance(20) ? 0xFFFFFFFF : command->telecommand_id,
          chance(5) ? wire::PeripheralResult::cannot_now : wire::PeripheralResult::done};
    } else {
      response.body = wire::ResetResponse{};
    }
    take(cycle_.on_answer(response, now_));
  }

  void quiet() {
    awaiting_quiet_ = false;
    quiet_ = true;
    take(cycle_.on_bus_quiet(now_));
    quiet_ = false;
  }

  void recall() {
    if (!recalled_ || chance(2)) recalled_ = GrantId{1, ++counter_};
    take(cycle_.on_recall(*recalled_, now_));
  }

  void telecommand() {
    const std::uint64_t id = chance(4) && next_id_ > 5 ? next_id_ - random_() % 5 : ++next_id_;
    static constexpr std::array<std::uint16_t, 8> functions{1, 1, 1, 2, 2, 16, 17, 0};
    const std::uint16_t function = functions[id % functions.size()];
    const auto repeat = function >= 16 ? RepeatClass::at_most_once : static_cast<RepeatClass>(1 + id % 3);
    classes_[id] = repeat;
    take(cycle_.on_telecommand(
        {id, function, repeat, chance(5) ? now_ + milliseconds(50) : MonotonicTime(), {}}, now_));
  }

  void disk() {
    if (!writing_) return;
    const std::uint64_t revision = *writing_;
    writing_.reset();
    take(cycle_.on_journal_written(revision, !chance(20), now_));
  }

  /// One that says nothing in time may obey later.
  void power() {
    if (switching_.empty()) return;
    const bool ok = !chance(10);
    if (!ok && chance(2)) {
      ++late_switches;
      powered_ = switching_.front();
    }
    switched(ok);
  }
  void switched(bool ok) {
    const bool on = switching_.front();
    const bool was_on = powered_;
    switching_.erase(switching_.begin());
    if (ok) powered_ = on;
    take(cycle_.on_power_switched(on, ok, now_, was_on));
  }

  void take(const PayloadActions& actions) {
    for (const PayloadAction& action : actions) {
      std::visit([this](const auto& a) { check(a); }, action);
      if (::testing::Test::HasFatalFailure()) return;
    }
    if (journal_wanted_ && !writing_) writing_ = std::exchange(journal_wanted_, std::nullopt);
  }

  void check(const PublishStatus& status) {
    if (status.grant == recalled_) {
      ASSERT_TRUE(quiet_) << "a recall was answered while own frames could wait for the bus";
      ++recalls;
    }
    if (status.kind == PublishStatus::Kind::taken) {
      if (!open_) taken_ = status.grant;
      ++slots;
    } else {
      ASSERT_FALSE(open_) << "released while the handle was open";
    }
  }
  void check(const OpenBus& bus) {
    ASSERT_EQ(taken_, bus.grant) << "the bus was opened without TAKEN";
    ASSERT_GT(bus.grant, last_opened_) << "a grant was used twice";
    ASSERT_LT(now_, bus.lease_end);
    last_opened_ = bus.grant;
    open_ = true;
    awaiting_quiet_ = false;
  }
  void check(const CloseBus& /*bus*/) {
    open_ = false;
    awaiting_quiet_ = false;
    request_.reset();
  }
  void check(const SendRequest& request) {
    ASSERT_TRUE(open_) << "a request without the bus";
    ASSERT_FALSE(awaiting_quiet_) << "a request after the slot's last one";
    request_ = request.body;
    if (const auto* command = std::get_if<wire::CommandRequest>(&request.body)) {
      const std::uint64_t id = command->telecommand_id;
      ++sent_[id];
      const std::uint32_t allowed = classes_[id] == RepeatClass::at_most_once ? 1 : 3;
      ASSERT_LE(sent_[id], allowed) << "telecommand " << id;
      ASSERT_FALSE(ended_.contains(id));
    }
  }
  void check(const AbortRequest& /*abort*/) { request_.reset(); }
  void check(const AwaitQuiet& /*await*/) { awaiting_quiet_ = true; }
  void check(const WithdrawFrames& /*withdraw*/) {
    ASSERT_FALSE(request_) << "frames were taken back that still had a purpose";
  }
  void check(const RememberIdsLost& /*remember*/) {}
  void check(const RememberKeptOff& remember) {
    ASSERT_NE(remember.kept_off, kept_off_) << "no change";
    kept_off_ = remember.kept_off;
    ++kept_off_changes;
  }
  void check(const ProcessMeasurement& /*process*/) { ++processing_; }
  void check(const CommandDone& /*done*/) {}
  void check(const WriteTelecommands& write) { journal_wanted_ = write.revision; }
  void check(const OrdersObeyed& /*obeyed*/) {}
  void check(const OrderRefused& /*refused*/) {}
  void check(const SwitchPower& power) {
    ASSERT_FALSE(power.on && kept_off_) << "a peripheral that is kept off was switched on";
    switching_.push_back(power.on);
  }
  void check(const PayloadEvent& /*event*/) {}
  void check(const StageReport& report) {
    if (report.stage == Stage::acceptance) return;
    if (report.stage == Stage::start && report.success) return;
    const auto [before, first] = ended_.try_emplace(report.id, report);
    if (!first) {
      ASSERT_EQ(before->second, report) << "two different ends";
      return;
    }
    if (report.success) ++completed;
    if (report.failure == mission::failure::interrupted) ++interrupted;
  }
  void check(Activity activity) {
    ASSERT_EQ(activity == Activity::occupying_can, cycle_.holds_bus());
    ASSERT_NE(activity, last_activity_) << "no change";
    last_activity_ = activity;
  }

  std::mt19937_64 random_;
  PayloadCycle cycle_;
  MonotonicTime now_{seconds(1)};
  bool active_ = true;
  std::uint32_t counter_ = 0;
  GrantId taken_;
  GrantId last_opened_;
  bool open_ = false;
  bool awaiting_quiet_ = false;
  bool quiet_ = false;
  std::optional<GrantId> recalled_;
  bool kept_off_ = false;
  std::optional<decltype(SendRequest::body)> request_;
  std::uint32_t processing_ = 0;
  std::optional<std::uint64_t> writing_;
  std::optional<std::uint64_t> journal_wanted_;
  std::vector<bool> switching_;
  bool powered_ = true;
  std::uint64_t next_id_ = 0;
  std::map<std::uint64_t, RepeatClass> classes_;
  std::map<std::uint64_t, std::uint32_t> sent_;
  std::map<std::uint64_t, StageReport> ended_;
  Activity last_activity_ = Activity::off;
};

TEST(PayloadCycle, NeverSendsWithoutTheBusNorRepeatsAnAtMostOnceCommandInRandomSteps) {
  std::uint32_t slots = 0;
  std::uint32_t completed = 0;
  std::uint32_t interrupted = 0;
  std::uint32_t kept_off_changes = 0;
  std::uint32_t recalls = 0;
  std::uint32_t late_switches = 0;
  for (std::uint64_t seed = 0; seed < 30; ++seed) {
    World world(seed);
    for (int i = 0; i < 10'000; ++i) {
      world.step();
      if (::testing::Test::HasFatalFailure()) FAIL() << "seed " << seed << " step " << i;
    }
    world.settle();
    if (::testing::Test::HasFatalFailure()) FAIL() << "seed " << seed << ", at its end";
    late_switches += world.late_switches;
    slots += world.slots;
    completed += world.completed;
    interrupted += world.interrupted;
    kept_off_changes += world.kept_off_changes;
    recalls += world.recalls;
  }
  EXPECT_GT(slots, 1'000U);
  EXPECT_GT(completed, 500U);
  EXPECT_GT(interrupted, 10U);
  EXPECT_GT(kept_off_changes, 10U);
  EXPECT_GT(recalls, 100U);
  EXPECT_GT(late_switches, 10U);
}

}  // namespace
}  // namespace srfs
