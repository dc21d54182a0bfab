// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

#include "tests/conformance/octets.hpp"

namespace srfs::conformance {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

/// A participant as announced by discovery.
struct SeenParticipant {
  rtps::GUID_t guid;
  std::string name;
  Octets user_data;
};

/// An endpoint as announced by discovery.
struct SeenEndpoint {
  rtps::GUID_t guid;
  bool is_reader = false;
  std::string topic;
  std::string type;
  bool reliable = false;
  bool transient_local = false;
  bool automatic_liveliness = false;
  bool infinite_liveliness_lease = false;
  bool infinite_deadline = false;
  bool shared_ownership = false;
  double lifespan_s = 0;  ///< 0: infinite, or the endpoint is a reader
  bool keyed = false;
  bool with_type_description = false;  ///< TypeObject, TypeIdentifier or TypeInformation
};

/// The GUID as 16 octets: prefix, entity id.
[[nodiscard]] Octets gid_of(const rtps::GUID_t& guid);

/// A participant as rmw_fastrtps creates it with ROS_LOCALHOST_ONLY=1 (participant.cpp of
/// rmw_fastrtps_shared_cpp in Humble), but without the shared memory transport. Stores everything that
/// discovery announces.
class Ros2Peer : public dds::DomainParticipantListener {
 public:
  explicit Ros2Peer(int domain);
  ~Ros2Peer() override;
  Ros2Peer(const Ros2Peer&) = delete;
  Ros2Peer& operator=(const Ros2Peer&) = delete;

  [[nodiscard]] std::vector<SeenParticipant> participants() const;
  /// The endpoints of one participant.
  [[nodiscard]] std::vector<SeenEndpoint> endpoints_of(const rtps::GUID_t& participant) const;
  [[nodiscard]] dds::DomainParticipant& participant() { return *participant_; }
  [[nodiscard]] dds::Topic* topic(const std::string& name, const std::string& type);
  [[nodiscard]] dds::Publisher& publisher() { return *publisher_; }
  [[nodiscard]] dds::Subscriber& subscriber() { return *subscriber_; }

  void on_participant_discovery(dds::DomainParticipant*, rtps::ParticipantDiscoveryInfo&& info) override;
  void on_subscriber_discovery(dds::DomainParticipant*, rtps::ReaderDiscoveryInfo&& info) override;
  void on_publisher_discovery(dds::DomainParticipant*, rtps::WriterDiscoveryInfo&& info) override;

 private:
  mutable std::mutex mutex_;
  std::map<rtps::GUID_t, SeenParticipant> participants_;
  std::map<rtps::GUID_t, SeenEndpoint> endpoints_;
  dds::DomainParticipant* participant_ = nullptr;
  dds::Publisher* publisher_ = nullptr;
  dds::Subscriber* subscriber_ = nullptr;
};

struct ReceivedSample {
  Octets payload;  ///< including the encapsulation header
  rtps::SampleIdentity identity;
  rtps::SampleIdentity related;  ///< PID 0x800f
};

/// A reader of serialised payloads.
class RawReader : public dds::DataReaderListener {
 public:
  RawReader(Ros2Peer& peer, const std::string& topic, const std::string& type, bool transient_local = false);
  ~RawReader() override;
  RawReader(const RawReader&) = delete;
  RawReader& operator=(const RawReader&) = delete;

  /// Waits for a sample that @p wanted accepts; earlier arrivals count. Takes it and all samples before it.
  /// @return nullopt after 15 s
  [[nodiscard]] std::optional<ReceivedSample> next(const std::function<bool(const ReceivedSample&)>& wanted =
                                                       [](const ReceivedSample&) { return true; });
  /// Provokes samples until one arrives. A match on this side does not mean that the writer has matched too.
  /// @return false after 15 s
  [[nodiscard]] bool heard(const std::function<void()>& provoke);
  [[nodiscard]] int matched() const;
  [[nodiscard]] rtps::GUID_t guid() const { return reader_->guid(); }

  void on_data_available(dds::DataReader*) override;
  void on_subscription_matched(dds::DataReader*, const dds::SubscriptionMatchedStatus& status) override;

 private:
  Ros2Peer& peer_;
  mutable std::mutex mutex_;
  std::condition_variable came_;
  std::vector<ReceivedSample> samples_;
  int matched_ = 0;
  dds::DataReader* reader_ = nullptr;
};

/// A writer of serialised payloads.
class RawWriter : public dds::DataWriterListener {
 public:
  RawWriter(Ros2Peer& peer, const std::string& topic, const std::string& type);
  ~RawWriter() override;
  RawWriter(const RawWriter&) = delete;
  RawWriter& operator=(const RawWriter&) = delete;

  /// @param related goes into PID 0x800f if it is known. @return the sample's identity
  rtps::SampleIdentity write(Octets payload, const rtps::SampleIdentity& related = {});
  [[nodiscard]] int matched() const;
  [[nodiscard]] rtps::GUID_t guid() const { return writer_->guid(); }

  void on_publication_matched(dds::DataWriter*, const dds::PublicationMatchedStatus& status) override;

 private:
  Ros2Peer& peer_;
  mutable std::mutex mutex_;
  int matched_ = 0;
  dds::DataWriter* writer_ = nullptr;
};

/// A service client as rmw_fastrtps creates it.
class RawClient {
 public:
  /// @param service "/probe/get_state"; @param type "lifecycle_msgs::srv::dds_::GetState"
  RawClient(Ros2Peer& peer, const std::string& service, const std::string& type);

  /// Whether both halves are matched, the condition of rmw_service_server_is_available.
  [[nodiscard]] bool ready() const { return replies.matched() == 1 && requests.matched() == 1; }
  /// Sends with the GUID of the reply reader in PID 0x800f. @return the request's sequence number
  std::uint64_t send(const Octets& request);
  /// Waits until ready, sends the request and waits for its reply. @return empty after 15 s
  Octets call(const Octets& request);

  RawReader replies;
  RawWriter requests;
};

/// Waits for a condition that other threads fulfil. @return false after 15 s
[[nodiscard]] bool wait_for(const std::function<bool()>& condition);

}  // namespace srfs::conformance
