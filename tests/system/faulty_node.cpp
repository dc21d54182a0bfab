// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// A node whose parameters select its faults, for tests of the suite's reaction to a faulty node.

#include <chrono>
#include <cmath>
#include <stdexcept>
#include <thread>

#include <mission/structures.hpp>

#include "suite/node.hpp"
#include "suite/run_node.hpp"

namespace srfs {
namespace {

class FaultyNode : public suite::Node {
 public:
  explicit FaultyNode(suite::NodeContext& context) : Node(context) {
    declare_parameter("configure_ms", std::int64_t{0}, ros::ParameterRange{0, 60000, 10},
                      "How long configuring takes");
    declare_parameter("fault", std::string("none"),
                      std::vector<std::string>{"none", "throw", "raise", "fail_activation", "slow",
                                               "good_battery", "low_battery", "high_event"},
                      "What the working node does wrong");
    declare_parameter("window", std::vector<std::int64_t>{1, 2}, ros::ParameterRange{0, 100},
                      "Only for the next start", true);
  }

 protected:
  ros::CallbackReturn on_configure() override {
    // Blocks the work thread, which no real node may do.
    std::this_thread::sleep_for(milliseconds(get_parameter<std::int64_t>("configure_ms")));
    work_ = create_timer(
        milliseconds(20), [this] { work(); }, "work");
    return ros::CallbackReturn::success;
  }
  ros::CallbackReturn on_activate() override {
    if (get_parameter<std::string>("fault") != "fail_activation") return ros::CallbackReturn::success;
    set_failure_reason("the fault that was asked for");
    return ros::CallbackReturn::failure;
  }
  ros::CallbackReturn on_cleanup() override {
    work_.reset();
    return ros::CallbackReturn::success;
  }
  ros::CallbackReturn on_error() override { return on_cleanup(); }

 private:
  void work() {
    const auto fault = get_parameter<std::string>("fault");
    if (fault.ends_with("battery") || fault == "high_event") report_battery(fault == "low_battery");
    if (fault == "high_event") raise(mission::TimingWatchdogWithheldEvent{});
    if (fault == "slow") std::this_thread::sleep_for(milliseconds(30));
    if (!is_active() || (fault != "throw" && fault != "raise")) return;
    // Inject the fault only once, so that the restarted node works.
    (void)parameters().set_atomically({{"fault", std::string("none")}});
    if (fault == "throw") throw std::runtime_error("the fault that was asked for");
    raise_error("the fault that was asked for");
  }
  void report_battery(bool low) {
    mission::PayloadEpsHousekeeping battery;
    battery.measurement.battery_voltage_v = low ? 5.0F : 7.5F;
    battery.measurement.state_of_charge = 0.8F;
    battery.measurement.battery_temperature_k = 293.0F;
    battery.time_to_empty_s = std::nanf("");
    srfs_msgs::msg::PayloadTelemetry m;
    m.source = name();
    m.apid = battery.apid;
    m.structure_id = battery.structure_id;
    m.data = battery.encoded();
    publish_telemetry(m);
  }
  ros::Timer work_;
};

}  // namespace
}  // namespace srfs

int main(int argc, char** argv) {
  return srfs::suite::run_node<srfs::FaultyNode>(argc, argv);
}
