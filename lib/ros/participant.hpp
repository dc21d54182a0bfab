// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>

#include "base/result.hpp"
#include "ros/cdr.hpp"
#include "ros/datagram_filter.hpp"
#include "ros/graph.hpp"
#include "ros/isolation.hpp"
#include "ros/qos.hpp"
#include "ros/topic_directory.hpp"
#include "ros/transport.hpp"

namespace srfs::ros {

namespace dds = eprosima::fastdds::dds;

struct ParticipantOptions {
  int domain = 42;  ///< 0..232; above 101 the kernel gives these ports to any process
  std::vector<std::string> interfaces = {"127.0.0.1"};  ///< transports are confined to these addresses
  /// Reads user traffic on its work thread (transport.hpp); outlives the participant. nullptr: Fast DDS' own
  /// receive threads do.
  Executor* executor = nullptr;
  std::optional<SuiteIdentity> identity = std::nullopt;  ///< none: a process that belongs to no suite
  /// Ignore foreign participants: on a work thread none of their datagrams is read, requests included;
  /// elsewhere what they publish on flight topics is dropped. Else it is counted.
  bool drop_foreign = false;
  /// A participant not heard for so long is forgotten. Longer than any stop a process is to outlive: two that
  /// forgot each other at different times may not find each other again.
  std::chrono::milliseconds lease{2000};
  bool remember_topics = false;  ///< of the domain (Participant::topics)
  /// What foreign participants send waits in a socket of its own and is read slowly (transport.hpp). Not for
  /// a recorder that is to hear them, too.
  bool bound_foreign = true;
};

/// Whether a reader keeps the memory of a sample for the next one: what is small, or a picture.
[[nodiscard]] constexpr bool keeps_memory(std::size_t largest_octets) {
  return largest_octets <= small_sample || largest_octets > largest_unbounded_payload;
}

/// The RTPS message by which a participant announces that it is gone.
[[nodiscard]] Octets departure_message(const GuidPrefix& prefix);

[[nodiscard]] Gid to_gid(const eprosima::fastrtps::rtps::GUID_t& guid);

/// One DDS participant: UDPv4 on the given interfaces only, shared memory and data-sharing off (they do not
/// survive kill -9 of a peer), leases so that a dead peer is forgotten. Everything is created here
/// with the house's QoS. Thread-safe as far as Fast DDS is; make endpoints on the work thread.
class Participant {
 public:
  [[nodiscard]] static Result<std::unique_ptr<Participant>, std::string> create(
      const ParticipantOptions& options);
  ~Participant();
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  /// @param topic DDS name ("rt/timing/tick"). Registers type and topic when new. nullptr when Fast DDS
  /// refuses.
  [[nodiscard]] dds::DataWriter* create_writer(const std::string& topic, dds::TypeSupport type,
                                               const Qos& qos, dds::DataWriterListener* listener);
  [[nodiscard]] dds::DataReader* create_reader(const std::string& topic, dds::TypeSupport type,
                                               const Qos& qos, dds::DataReaderListener* listener);
  void destroy(dds::DataWriter* writer);
  void destroy(dds::DataReader* reader);

  /// When the kernel had the sample: what a busy work thread let it wait is not hidden. A step of the system
  /// clock in between costs at most one second of error. @param now not before the reception
  [[nodiscard]] MonotonicTime received_at(const dds::SampleInfo& info, MonotonicTime now) const;
  /// What the kernel holds already reaches the readers' histories now. On the work thread.
  void receive_waiting() const { transport_->receive_waiting(); }
  [[nodiscard]] TransportStats transport_stats() const {
    TransportStats stats = transport_->stats;
    stats.foreign = filter_->dropped_foreign();
    return stats;
  }

  /// The others in the domain, ours and foreign ones.
  [[nodiscard]] const KnownParticipants& known_participants() const { return known_; }
  /// Whether an endpoint belongs to a process outside this suite.
  [[nodiscard]] bool is_foreign(const eprosima::fastrtps::rtps::GUID_t& guid) const;
  /// Whether it may order transitions and parameters: it is of the suite, and no limited member of it.
  [[nodiscard]] bool may_order(const eprosima::fastrtps::rtps::GUID_t& guid) const;
  /// The name of the limited member (datagram_seal.hpp) that the endpoint is of, which is believed for itself
  /// alone; empty: of another one, or foreign.
  [[nodiscard]] std::string limited_name(const eprosima::fastrtps::rtps::GUID_t& guid) const;
  [[nodiscard]] bool drops_foreign() const { return drop_foreign_; }
  /// What the others publish and subscribe to. Empty unless ParticipantOptions::remember_topics.
  [[nodiscard]] const TopicDirectory& topics() const { return directory_; }
  /// Called on discovery's thread when a participant came or went; an empty function: no call.
  void on_peers_changed(std::function<void()> callback);
  /// Announces to the whole domain that a participant is gone, as it would have itself (the disposal of its
  /// SPDP data; RTPS 2.2, 8.5.3). @pre its process has ended. @return false: nothing could be sent
  bool announce_departure(const GuidPrefix& prefix) const;

  // This process' entry in the ROS graph; every endpoint that is made here is in it.
  [[nodiscard]] ParticipantGraph graph() const;
  void set_node(std::optional<std::string> name, const std::string& name_space = "/");
  /// A writer feeds a reader here, which takes samples of at most @p octets. @param refused counts those that
  /// claim more and are dropped before Fast DDS sees them (transport of the work thread)
  void on_writer_matched(const Gid& writer, const Gid& reader, std::size_t octets,
                         std::shared_ptr<std::atomic<std::uint64_t>> refused) {
    filter_->matched(writer, reader, octets, std::move(refused));
  }
  void on_writer_unmatched(const Gid& writer, const Gid& reader) { filter_->unmatched(writer, reader); }
  /// A reader gave this sample to the node.
  void on_taken(const eprosima::fastrtps::rtps::SampleIdentity& sample,
                const eprosima::fastrtps::rtps::GUID_t& reader) {
    if (!filter_->holds_any()) return;
    const auto sequence = static_cast<std::int64_t>(sample.sequence_number().to64long());
    filter_->taken({to_gid(sample.writer_guid()), sequence}, to_gid(reader));
  }
  /// The sender of the last datagram that was dropped as foreign, for people.
  [[nodiscard]] std::string last_dropped() const {
    const auto prefix = filter_->last_dropped();
    return prefix ? known_.describe(*prefix) : std::string();
  }

  /// Called after every change, on the thread that made it; an empty function: no call.
  void on_graph_change(std::function<void()> callback);

 private:
  class Discovery;
  explicit Participant(const ParticipantOptions& options);
  dds::Topic* topic(const std::string& name, dds::TypeSupport& type);
  /// A reader that learns of a writer's end before it has read what came drops it: the end waits for the
  /// acknowledgements, all ends of a second together at most 50 ms.
  void let_last_words_be_heard(dds::DataWriter& writer);
  void change_graph(const std::function<bool(ParticipantGraph&)>& change);

  KnownParticipants known_;
  TopicDirectory directory_;
  const int number_;  // in this process
  const int domain_;
  const std::vector<std::string> interfaces_;
  const bool drop_foreign_;
  const std::shared_ptr<DatagramFilter> filter_;
  const std::shared_ptr<TransportState> transport_ = std::make_shared<TransportState>();
  std::unique_ptr<Discovery> discovery_;  // outlives the DDS participant
  mutable std::mutex graph_mutex_;
  ParticipantGraph graph_;
  std::function<void()> graph_change_;
  MonotonicTime linger_began_;
  dds::DomainParticipant* participant_ = nullptr;
  dds::Publisher* publisher_ = nullptr;
  dds::Subscriber* subscriber_ = nullptr;
};

}  // namespace srfs::ros
