// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Every cause of mode safe, in every mode, with every node dead or none.
#include <array>

#include <gtest/gtest.h>

#include "tests/build_kind.hpp"
#include "tests/simulation/orders.hpp"
#include "tests/simulation/spacecraft.hpp"

namespace srfs::simulation {
namespace {

constexpr std::array modes{"nominal", "low_power", "commissioning", "pass"};
constexpr std::size_t nodes = 9;
constexpr nanoseconds limit = seconds(5);  ///< from the cause to safe
constexpr nanoseconds step = milliseconds(20);
constexpr seconds loss_time{30};
constexpr unsigned shed_loads = 0b1100;  ///< camera and transmitter

enum class Cause : std::uint8_t {
  nothing,
  command,
  event_action,
  battery,
  tumbling,
  node_lost,
  command_loss,
  damaged
};

SpacecraftSettings settings_for(Cause cause) {
  SpacecraftSettings settings;
  settings.modes.lost = seconds(5);  // as launch_config/sim_mission.yaml has them
  settings.modes.silence = seconds(10);
  if (cause == Cause::command_loss) settings.command_loss = loss_time;
  return settings;
}

class Flight {
 public:
  Flight(Cause cause, const char* mode, std::optional<Lane> dead)
      : cause_(cause), mode_(mode), dead_(dead), spacecraft_(kernel_, settings_for(cause)) {}

  /// In the mode, with everything switched on; the cause is about to come.
  void prepare() {
    spacecraft_.station().silence();
    wait(seconds(12));
    order("eps.switch_load", {"load=3", "state=on"});
    order("eps.switch_load", {"load=2", "state=on"});
    if (cause_ == Cause::event_action) {
      order("event_action.add", {"event=ttc.armed", "request=ttc.set_mode mode=safe"});
      order("event_action.enable", {"event=ttc.armed"});
    }
    wait(seconds(3));
    order("ttc.set_mode", {std::string("mode=") + mode_});
    wait(seconds(5));
  }
  [[nodiscard]] bool all_are_in(const std::string& mode) {
    std::size_t following = 0;
    for (std::size_t node = 0; node < nodes; ++node) {
      const auto in_force = spacecraft_.mode_of(static_cast<Lane>(node));
      if (!in_force) continue;
      ++following;
      if (in_force->name != mode) return false;
    }
    return following > 0;
  }

  /// @return from the cause until all living nodes are in safe and the loads are off; nullopt: not within it
  std::optional<nanoseconds> bring_about() {
    if (dead_) spacecraft_.ring().keep_down(spacecraft_.host(*dead_));
    begin();
    const MonotonicTime due = kernel_.now() + delay();
    while (kernel_.now() <= due + limit) {
      if (all_are_in("safe") && is_shed()) return std::max(kernel_.now() - due, nanoseconds(0));
      wait(step);
    }
    return std::nullopt;
  }

 private:
  [[nodiscard]] bool is_dead(Lane lane) const {
    return dead_ == lane || (cause_ == Cause::node_lost && lane == Lane::can_switcher);
  }
  [[nodiscard]] bool has_bus() const { return !is_dead(Lane::timing) && !is_dead(Lane::can_switcher); }

  void begin() {
    switch (cause_) {
      case Cause::command:
        return order("ttc.set_mode", {"mode=safe"});
      case Cause::event_action:
        return arm();
      case Cause::battery:
        return spacecraft_.world().power().set_charge(0.3);
      case Cause::tumbling:
        return spacecraft_.world().attitude().set_rate(Eigen::Vector3d(0, 0, 2.5));
      case Cause::node_lost:
        return spacecraft_.ring().keep_down(spacecraft_.host(Lane::can_switcher));
      case Cause::command_loss:
      case Cause::nothing:
        return;
      case Cause::damaged: {
        if (is_dead(Lane::ttc)) return;  // nobody is heard
        srfs_msgs::msg::SystemMode nonsense;
        nonsense.name = "nonsense";
        return spacecraft_.topics().mode.publish(spacecraft_.host(Lane::ttc), std::move(nonsense));
      }
    }
  }

  /// How long it takes by its rule until the cause is there.
  [[nodiscard]] nanoseconds delay() const {
    const suite::ModeSettings modes_flown = settings_for(cause_).modes;
    if (is_dead(Lane::ttc)) return modes_flown.silence;
    const bool measured = cause_ == Cause::battery || cause_ == Cause::tumbling;
    const Lane source = cause_ == Cause::battery ? Lane::payload_eps : Lane::payload_adcs;
    if (cause_ == Cause::node_lost || (measured && !has_bus())) return modes_flown.lost;
    if (measured && is_dead(source)) return modes_flown.causes.front().stale;
    if (cause_ == Cause::command_loss) return loss_time - (kernel_.now() - last_order_);
    return nanoseconds(0);
  }

  /// A damaged sample is followed by a good one before all orders are out.
  [[nodiscard]] bool is_shed() {
    if (cause_ == Cause::damaged || !has_bus() || is_dead(Lane::payload_eps)) return true;
    return (spacecraft_.world().power().state().switches & shed_loads) == 0;
  }

  /// Its event releases the action.
  void arm() {
    const mission::Dictionary& dictionary = Spacecraft::dictionary();
    const Order arming =
        arming_of(dictionary, {dictionary.command("eps.power_cycle_peripheral"), {"off_ms=200"}});
    order(arming.command->name, arming.arguments);
  }
  void order(const std::string& name, const std::vector<std::string>& arguments) {
    spacecraft_.station().order(name, arguments);
    last_order_ = kernel_.now();
  }
  void wait(nanoseconds time) { kernel_.run_until(kernel_.now() + time); }

  Cause cause_;
  const char* mode_;
  std::optional<Lane> dead_;
  Kernel kernel_{28};
  Spacecraft spacecraft_;
  MonotonicTime last_order_;
};

void fly_all(Cause cause, nanoseconds& slowest) {
  for (const char* mode : modes) {
    if (testing_support::slow && mode != modes[0]) continue;  // the release build flies them all
    for (std::size_t dead = 0; dead <= nodes; ++dead) {
      const auto lane = dead == nodes ? std::nullopt : std::optional(static_cast<Lane>(dead));
      if (testing_support::slow && lane && dead % 4 != 0) continue;
      SCOPED_TRACE(std::string(mode) + ", dead: " + (lane ? to_text(*lane) : "none"));
      Flight flight(cause, mode, lane);
      flight.prepare();
      ASSERT_TRUE(flight.all_are_in(mode));
      const auto took = flight.bring_about();
      ASSERT_TRUE(took) << "safe is not reached in time";
      slowest = std::max(slowest, *took);
    }
  }
}

class ModeMatrix : public testing::TestWithParam<Cause> {};

TEST_P(ModeMatrix, SafeIsReachedWithinFiveSecondsInEveryModeWithAnyNodeDead) {
  nanoseconds slowest{0};
  ASSERT_NO_FATAL_FAILURE(fly_all(GetParam(), slowest));
  RecordProperty("slowest_ms", static_cast<int>(slowest / milliseconds(1)));
}

INSTANTIATE_TEST_SUITE_P(EveryCause, ModeMatrix,
                         testing::Values(Cause::command, Cause::event_action, Cause::battery, Cause::tumbling,
                                         Cause::node_lost, Cause::command_loss, Cause::damaged));

TEST(ModeMatrixCheck, FailsWhereNothingCausesSafe) {
  Flight flight(Cause::nothing, "nominal", std::nullopt);
  flight.prepare();
  EXPECT_TRUE(flight.all_are_in("nominal"));
  EXPECT_FALSE(flight.bring_about());
}

}  // namespace
}  // namespace srfs::simulation
