// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// A method of image processing in OpenCV, as a node of its own: what moves against the stars, by background
// subtraction (motion.hpp), told in its own telemetry and events (dictionary.yaml).
#include <memory>

#include <opencv2/core/utility.hpp>

#include "motion.hpp"
#include "motion_structures.hpp"
#include "suite/image_topics.hpp"
#include "suite/mission_time.hpp"
#include "suite/node.hpp"
#include "suite/run_node.hpp"

namespace {

using namespace srfs;

constexpr std::size_t most_waiting = 2;  // frames of megabytes
constexpr std::size_t longest_frame_name = 32;

class ImageMotionNode : public suite::Node {
 public:
  explicit ImageMotionNode(suite::NodeContext& context) : Node(context) {
    cv::setNumThreads(1);  // the worker, with the image lane's priority; no threads of OpenCV's own
    declare_parameter("least_snr", std::int64_t{8}, ros::ParameterRange{4, 1000},
                      "SNR from which on a pixel counts");
  }

  [[nodiscard]] bool is_at_rest() const override {
    if (!worker_) return true;
    const ros::WorkerProgress progress = worker_->progress();
    return !progress.busy && progress.waiting == 0;
  }

 protected:
  ros::CallbackReturn on_configure() override {
    if (!worker_) worker_ = create_worker("motion", most_waiting);
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
    auto found = std::make_shared<std::optional<Motion>>();
    const auto snr = static_cast<float>(least_snr());
    const bool taken = worker_->post(
        [this, copy, found, snr] { *found = motion_of(*copy, snr); },
        [this, copy, found] { on_measured(copy->header.frame_id.substr(0, longest_frame_name), *found); });
    if (!taken) ++counters_.frames_dropped;
  }

  /// On the worker, which alone uses the finder. OpenCV throws where memory is short; the frame is lost then.
  [[nodiscard]] std::optional<Motion> motion_of(const sensor_msgs::msg::Image& frame, float snr) {
    try {
      finder_.set_least_snr(snr);
      return finder_.on_frame(OctetView(frame.data), frame.width, frame.height);
    } catch (const cv::Exception&) {
      finder_ = MotionFinder();
      return std::nullopt;
    }
  }

  void on_measured(const std::string& frame, const std::optional<Motion>& found) {
    if (!found) {
      ++counters_.frames_malformed;
      return;
    }
    ++counters_.frames;
    if (found->compared) ++counters_.frames_compared;
    counters_.movers = found->movers;
    counters_.shift_x = found->shift_x_px;
    counters_.shift_y = found->shift_y_px;
    if (found->movers == 0) return;
    raise(mission::MotionFoundEvent{.frame = frame,
                                    .movers = found->movers,
                                    .x = found->x_px,
                                    .y = found->y_px,
                                    .snr = found->snr,
                                    .length = found->length_px});
  }

  [[nodiscard]] std::uint16_t least_snr() const {
    return static_cast<std::uint16_t>(get_parameter<std::int64_t>("least_snr"));
  }

  void publish_housekeeping() {
    counters_.cycle = time_.cycle();
    counters_.least_snr = least_snr();
    publish_telemetry(suite::telemetry_message(name(), counters_, time_.cycle(), time_.utc_at(now()),
                                               time_.valid(), now()));
  }

  MotionFinder finder_;                  ///< the worker's
  std::shared_ptr<ros::Worker> worker_;  ///< from the first configuring on
  std::shared_ptr<ros::Subscription<sensor_msgs::msg::Image>> frames_;
  std::shared_ptr<ros::Subscription<srfs_msgs::msg::TimeTick>> ticks_;
  ros::Timer housekeeping_timer_;
  suite::MissionTime time_;
  mission::ImageMotionHousekeeping counters_;
};

}  // namespace

int main(int argc, char** argv) {
  return suite::run_node<ImageMotionNode>(argc, argv, mission::fragment_tables);
}
