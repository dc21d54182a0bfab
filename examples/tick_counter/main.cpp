// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Connects the logic to the suite: translates, calls, sends. It decides nothing.
#include "suite/commanding/commanded_node.hpp"
#include "suite/mission_time.hpp"
#include "suite/run_node.hpp"

#include "tick_counter.hpp"

namespace {

using namespace srfs;

class TickCounterNode : public CommandedNode {
 public:
  explicit TickCounterNode(suite::NodeContext& context) : CommandedNode(context) {
    declare_parameter("report_every", std::int64_t{600}, ros::ParameterRange{1, 1000000},
                      "Ticks between two events");
  }

 protected:
  ros::CallbackReturn on_configure() override {
    open_commanding();
    ticks_ = create_subscription(suite::topics::time_tick,
                                 [this](const srfs_msgs::msg::TimeTick& tick) { on_tick(tick); });
    housekeeping_timer_ = create_timer(
        seconds(1), [this] { publish_housekeeping(); }, "housekeeping");
    return ros::CallbackReturn::success;
  }
  ros::CallbackReturn on_activate() override {
    resume_commanding();
    return ros::CallbackReturn::success;
  }
  ros::CallbackReturn on_deactivate() override { return ros::CallbackReturn::success; }
  ros::CallbackReturn on_cleanup() override {
    housekeeping_timer_.reset();
    ticks_.reset();
    close_commanding();
    return ros::CallbackReturn::success;
  }
  ros::CallbackReturn on_shutdown() override { return on_cleanup(); }
  ros::CallbackReturn on_error() override { return on_cleanup(); }

  [[nodiscard]] FailureCode check(std::uint16_t function, OctetView arguments) const override {
    return TickCounter::Commands::check(function, arguments);
  }
  void execute(const StoredTelecommand& telecommand) override {
    finished(TickCounter::Commands::execute(logic_, telecommand.function, telecommand.arguments));
  }

 private:
  void on_tick(const srfs_msgs::msg::TimeTick& tick) {
    time_.on_tick(tick);
    if (!is_active()) return;
    const auto report_every = static_cast<std::uint32_t>(get_parameter<std::int64_t>("report_every"));
    if (const auto event = logic_.on_tick(report_every)) raise(*event);
  }

  void publish_housekeeping() {
    publish_telemetry(suite::telemetry_message(name(), logic_.housekeeping(time_.cycle()), time_.cycle(),
                                               time_.utc_at(now()), time_.valid(), now()));
  }

  std::shared_ptr<ros::Subscription<srfs_msgs::msg::TimeTick>> ticks_;
  ros::Timer housekeeping_timer_;
  suite::MissionTime time_;
  TickCounter logic_;
};

}  // namespace

int main(int argc, char** argv) {
  return suite::run_node<TickCounterNode>(argc, argv, mission::fragment_tables);
}
