// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <csignal>
#include <stdexcept>
#include <thread>

#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>
#include <sensor_msgs/msg/image.hpp>

#include "ros/publisher.hpp"
#include "tests/bench/measures.hpp"
#include "tests/bench/raw_dds.hpp"
#include "tests/dds_domain.hpp"
#include "tests/signal_child.hpp"

namespace srfs::bench {
namespace {

using sensor_msgs::msg::Image;

// Like /image/raw: the processing works on one image while the next one arrives.
constexpr ros::Qos image_qos{.depth = 2};
const ros::Topic<Image> image_topic{"/bench/image", image_qos, ros::Priority::bulk};
const ros::Topic<Probe> report_topic{"/bench/image_report", {.depth = 16}, ros::Priority::time};
constexpr const char* raw_topic = "bench_raw/image";

Image image_of(int octets) {
  Image image;
  image.header.frame_id = "camera";
  image.encoding = "mono8";
  image.width = 1024;
  image.height = static_cast<std::uint32_t>(octets / 1024);
  image.step = 1024;
  image.data.assign(static_cast<std::size_t>(octets), 0x5a);
  return image;
}

/// Stores the time of sending in the header: CLOCK_MONOTONIC, not ROS time. Only this benchmark reads it.
void stamp(Image& image) {
  const std::int64_t now = monotonic_now().ns();
  image.header.stamp.sec = static_cast<std::int32_t>(now / 1'000'000'000);
  image.header.stamp.nanosec = static_cast<std::uint32_t>(now % 1'000'000'000);
}

std::int64_t age_ns(const Image& image) {
  return monotonic_now().ns() -
         (std::int64_t{image.header.stamp.sec} * 1'000'000'000 + image.header.stamp.nanosec);
}

/// Reports the latency of each image to the sender.
[[noreturn]] void receiving_process(int domain) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  ros::Executor executor;
  const auto participant = ros::Participant::create({.domain = domain, .executor = &executor}).value();
  ros::Publisher<Probe> reports(*participant, report_topic);
  const ros::Subscription<Image> images(
      executor, *participant, image_topic,
      [&](const Image& image, const ros::MessageInfo&) { reports.publish({.there_ns = age_ns(image)}); });
  const auto raw = raw_participant(domain);
  RawWriter<Probe> raw_reports(*raw, "bench_raw/image_report", report_topic.qos);
  const RawReader<Image> raw_in(*raw, raw_topic, image_qos,
                                [&](const Image& image, const ros::dds::SampleInfo&) {
                                  raw_reports.write({.there_ns = age_ns(image)});
                                });
  executor.spin();
  _exit(0);
}

struct Way {
  std::vector<double> us;
  int sent = 0;
  [[nodiscard]] Json json() const {
    Json out = summary(us);
    out["sent"] = sent;
    out["lost"] = sent - static_cast<int>(us.size());
    return out;
  }
};

}  // namespace

Json measure_images(const ImageOptions& options) {
  const int domain = testing_support::own_domain();
  const pid_t receiver = fork();
  if (receiver < 0) throw std::runtime_error("fork failed");
  if (receiver == 0) receiving_process(domain);
  Way ours;
  Way peer;
  bool ready = false;
  {
    ros::Executor executor;
    const auto participant = ros::Participant::create({.domain = domain, .executor = &executor}).value();
    ros::Publisher<Image> images(*participant, image_topic);
    const ros::Subscription<Probe> reports(executor, *participant, report_topic,
                                           [&](const Probe& p, const ros::MessageInfo&) {
                                             ours.us.push_back(static_cast<double>(p.there_ns) / 1e3);
                                           });
    const auto raw = raw_participant(domain);
    RawWriter<Image> raw_images_out(*raw, raw_topic, image_qos);
    std::mutex mutex;
    const RawReader<Probe> raw_reports(*raw, "bench_raw/image_report", report_topic.qos,
                                       [&](const Probe& p, const ros::dds::SampleInfo&) {
                                         const std::lock_guard lock(mutex);
                                         peer.us.push_back(static_cast<double>(p.there_ns) / 1e3);
                                       });
    ready = executor.spin_until(
        [&] {
          return images.subscription_count() > 0 && reports.publisher_count() > 0 &&
                 raw_images_out.is_matched() && raw_reports.is_matched();
        },
        monotonic_now() + seconds(20));
    Image image = image_of(options.octets);
    const nanoseconds half_period = nanoseconds(seconds(1)) / options.rate_hz / 2;
    MonotonicTime next = monotonic_now();
    const auto wait_until = [&](MonotonicTime t) { executor.spin_until([] { return false; }, t); };
    constexpr int warm_up = 5;
    for (int i = -warm_up; ready && i < options.images; ++i) {
      if (i == 0) {
        const std::lock_guard lock(mutex);
        ours = {};
        peer = {};
      }
      stamp(image);
      ++ours.sent;
      images.publish(image);
      wait_until(next += half_period);
      stamp(image);
      ++peer.sent;
      raw_images_out.write(image);
      wait_until(next += half_period);
    }
    wait_until(monotonic_now() + seconds(1));  // for the last images
  }
  testing_support::signal_child(receiver, SIGKILL);
  waitpid(receiver, nullptr, 0);
  if (!ready) throw std::runtime_error("the receiving process was not found");
  return {{"unit", "us"},
          {"octets", options.octets},
          {"rate_hz", options.rate_hz},
          {"depth", image_qos.depth},
          {"srfs", ours.json()},
          {"raw", peer.json()},
          {"ratio", ratio(ours.us, peer.us)}};
}

}  // namespace srfs::bench
