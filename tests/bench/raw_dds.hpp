// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <mutex>

#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>

#include <srfs_msgs/srv/check_alive.hpp>

#include "ros/participant.hpp"
#include "ros/type_support.hpp"
#include "tests/bench/messages.hpp"

/// The peer of every measure: Fast DDS used directly, with the transport, QoS and serialisation of lib/ros
/// but with Fast DDS' receive threads and listener callbacks. This is the minimum for any user of Fast DDS.
namespace srfs::bench {

using eprosima::fastrtps::rtps::SampleIdentity;
using eprosima::fastrtps::rtps::WriteParams;

/// A participant as created by lib/ros, but read by Fast DDS' threads.
[[nodiscard]] inline std::unique_ptr<ros::Participant> raw_participant(int domain) {
  return ros::Participant::create({.domain = domain}).value();
}

template <class M>
class RawReader final : public ros::dds::DataReaderListener {
 public:
  using Callback = std::function<void(const M&, const ros::dds::SampleInfo&)>;
  /// @param callback runs on Fast DDS' receive thread
  RawReader(ros::Participant& participant, const std::string& topic, ros::Qos qos, Callback callback)
      : participant_(participant), callback_(std::move(callback)) {
    reader_ = participant.create_reader(topic, ros::dds::TypeSupport(new ros::TypeSupport<M>), qos, this);
  }
  ~RawReader() override { participant_.destroy(reader_); }
  [[nodiscard]] bool is_matched() const { return matched_ > 0; }
  [[nodiscard]] auto guid() const { return reader_->guid(); }

  void on_data_available(ros::dds::DataReader* reader) override {
    ros::dds::SampleInfo info;
    while (reader->take_next_sample(&sample_, &info) == ReturnCode_t::RETCODE_OK) {
      if (info.valid_data && sample_.well_formed) callback_(sample_.message, info);
    }
  }
  void on_subscription_matched(ros::dds::DataReader*, const ros::dds::SubscriptionMatchedStatus& s) override {
    matched_ = s.current_count;
  }

 private:
  ros::Participant& participant_;
  Callback callback_;
  ros::Sample<M> sample_;
  std::atomic<int> matched_{0};
  ros::dds::DataReader* reader_ = nullptr;
};

template <class M>
class RawWriter final : public ros::dds::DataWriterListener {
 public:
  RawWriter(ros::Participant& participant, const std::string& topic, ros::Qos qos)
      : participant_(participant) {
    writer_ = participant.create_writer(topic, ros::dds::TypeSupport(new ros::TypeSupport<M>), qos, this);
  }
  ~RawWriter() override { participant_.destroy(writer_); }
  [[nodiscard]] bool is_matched() const { return matched_ > 0; }
  bool write(const M& message) { return writer_->write(const_cast<M*>(&message)); }
  bool write(const M& message, WriteParams& params) {
    return writer_->write(const_cast<M*>(&message), params);
  }
  void on_publication_matched(ros::dds::DataWriter*, const ros::dds::PublicationMatchedStatus& s) override {
    matched_ = s.current_count;
  }

 private:
  ros::Participant& participant_;
  std::atomic<int> matched_{0};
  ros::dds::DataWriter* writer_ = nullptr;
};

/// Answers each request with the request's content. The address follows rmw_fastrtps: {reader of the client's
/// replies, sequence number of the request}.
class RawService {
 public:
  RawService(ros::Participant& participant, const std::string& name);

 private:
  RawWriter<Probe> replies_;
  RawReader<Probe> requests_;
};

/// A client of a RawService; one request at a time.
class RawClient {
 public:
  RawClient(ros::Participant& participant, const std::string& name);
  [[nodiscard]] bool is_ready() const { return requests_.is_matched() && replies_.is_matched(); }
  /// Blocks until the reply arrives. @return its arrival time on the receive thread; nullopt after @p longest
  std::optional<MonotonicTime> call(std::uint32_t number, nanoseconds longest);

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  SampleIdentity answered_;
  MonotonicTime answered_at_;
  RawReader<Probe> replies_;
  RawWriter<Probe> requests_;
};

/// The ring's requests and answers, with the same messages and QoS but without the ring's logic.
class RawChecks {
 public:
  RawChecks(ros::Participant& participant, const std::string& name, const std::vector<std::string>& asked);
  /// Sends one request to each peer.
  void ask();
  [[nodiscard]] std::uint64_t asked() const { return asked_count_; }
  [[nodiscard]] std::uint64_t answered() const { return answered_; }

 private:
  using CheckAlive = srfs_msgs::srv::CheckAlive;
  struct Peer {
    std::unique_ptr<RawReader<CheckAlive::Response>> replies;
    std::unique_ptr<RawWriter<CheckAlive::Request>> requests;
  };
  std::string name_;
  RawWriter<CheckAlive::Response> replies_;
  RawReader<CheckAlive::Request> requests_;
  std::vector<Peer> peers_;
  std::uint64_t asked_count_ = 0;
  std::atomic<std::uint64_t> answered_{0};
};

constexpr milliseconds check_period{100};

/// Stands in for a node: a participant with as many endpoints, and one service. Queries @p asked every
/// check_period. Runs until SIGTERM and then prints the numbers of requests and answers.
int run_raw_node(int domain, const std::string& name, int writers, int readers,
                 const std::vector<std::string>& asked);

}  // namespace srfs::bench
