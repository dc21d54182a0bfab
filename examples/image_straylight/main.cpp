// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// A method of image processing as a node of its own: it hears the frames that the camera takes, measures the
// sky of each on a worker, and tells of it in its own telemetry (dictionary.yaml).
#include <cmath>
#include <memory>

#include "straylight.hpp"
#include "straylight_structures.hpp"
#include "suite/image_topics.hpp"
#include "suite/mission_time.hpp"
#include "suite/node.hpp"
#include "suite/run_node.hpp"

namespace {

using namespace srfs;

constexpr std::size_t most_waiting = 2;  // frames of megabytes
constexpr std::size_t longest_frame_name = 32;

class ImageStraylightNode : public suite::Node {
 public:
  explicit ImageStraylightNode(suite::NodeContext& context) : Node(context) {
    counters_.sky_adu = std::nanf("");
    declare_parameter("sky_limit_adu", std::int64_t{4000}, ros::ParameterRange{1, 65535},
                      "Sky above which a frame counts as bright");
  }

  [[nodiscard]] bool is_at_rest() const override {
    if (!worker_) return true;
    const ros::WorkerProgress progress = worker_->progress();
    return !progress.busy && progress.waiting == 0;
  }

 protected:
  ros::CallbackReturn on_configure() override {
    if (!worker_) worker_ = create_worker("sky", most_waiting);
    ticks_ = create_subscription(suite::topics::time_tick,
                                 [this](const srfs_msgs::msg::TimeTick& tick) { time_.on_tick(tick); });
    housekeeping_timer_ = create_timer(
        seconds(5), [this] { publish_housekeeping(); }, "housekeeping");
    return ros::CallbackReturn::success;
  }
  ros::CallbackReturn on_activate() override {
    frames_ = create_subscription(suite::topics::image_raw,
                                  [this](const sensor_msgs::msg::Image& frame) { on_frame(frame); });
    return ros::CallbackReturn::success;
  }
  ros::CallbackReturn on_deactivate() override {
    frames_.reset();
    return ros::CallbackReturn::success;
  }
  ros::CallbackReturn on_cleanup() override {
    frames_.reset();
    housekeeping_timer_.reset();
    ticks_.reset();
    return ros::CallbackReturn::success;
  }
  ros::CallbackReturn on_shutdown() override { return on_cleanup(); }
  ros::CallbackReturn on_error() override { return on_cleanup(); }

 private:
  void on_frame(const sensor_msgs::msg::Image& frame) {
    if (frame.encoding != "mono16" || frame.is_bigendian != 0 || frame.step != 2 * frame.width) {
      ++counters_.frames_malformed;
      return;
    }
    auto copy = std::make_shared<const sensor_msgs::msg::Image>(frame);
    auto found = std::make_shared<std::optional<Straylight>>();
    const bool taken = worker_->post(
        [copy, found] { *found = measure_straylight(OctetView(copy->data), copy->width, copy->height); },
        [this, copy, found] { on_measured(copy->header.frame_id.substr(0, longest_frame_name), *found); });
    if (!taken) ++counters_.frames_dropped;
  }

  void on_measured(const std::string& frame, const std::optional<Straylight>& found) {
    if (!found) {
      ++counters_.frames_malformed;
      return;
    }
    ++counters_.frames;
    counters_.sky_adu = found->sky_adu;
    counters_.gradient_adu = found->gradient_adu;
    counters_.saturated_fraction = found->saturated_fraction;
    const auto change = sky_.on_sky(found->sky_adu, static_cast<float>(limit_adu()));
    if (sky_.is_bright()) ++counters_.bright_frames;
    if (change == BrightSky::Change::bright)
      raise(mission::StraylightBrightSkyEvent{
          .frame = frame, .sky_adu = found->sky_adu, .gradient_adu = found->gradient_adu});
    if (change == BrightSky::Change::dark) raise(mission::StraylightDarkSkyEvent{.frame = frame});
  }

  [[nodiscard]] std::uint16_t limit_adu() const {
    return static_cast<std::uint16_t>(get_parameter<std::int64_t>("sky_limit_adu"));
  }

  void publish_housekeeping() {
    counters_.cycle = time_.cycle();
    counters_.limit_adu = limit_adu();
    publish_telemetry(suite::telemetry_message(name(), counters_, time_.cycle(), time_.utc_at(now()),
                                               time_.valid(), now()));
  }

  std::shared_ptr<ros::Worker> worker_;  ///< from the first configuring on
  std::shared_ptr<ros::Subscription<sensor_msgs::msg::Image>> frames_;
  std::shared_ptr<ros::Subscription<srfs_msgs::msg::TimeTick>> ticks_;
  ros::Timer housekeeping_timer_;
  suite::MissionTime time_;
  BrightSky sky_;
  mission::ImageStraylightHousekeeping counters_;
};

}  // namespace

int main(int argc, char** argv) {
  return suite::run_node<ImageStraylightNode>(argc, argv, mission::fragment_tables);
}
