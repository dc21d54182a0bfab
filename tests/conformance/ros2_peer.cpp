// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/conformance/ros2_peer.hpp"

#include <chrono>
#include <stdexcept>
#include <thread>

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/dds/core/status/StatusMask.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>

namespace srfs::conformance {
namespace {

constexpr std::chrono::seconds patience{15};

/// A type with a known name but unknown content.
class PayloadType : public dds::TopicDataType {
 public:
  explicit PayloadType(const std::string& name) {
    setName(name.c_str());
    m_typeSize = 1024;
    m_isGetKeyDefined = false;
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }
  bool serialize(void* data, rtps::SerializedPayload_t* payload) override {
    const auto& octets = *static_cast<Octets*>(data);
    if (octets.size() > payload->max_size) return false;
    std::copy(octets.begin(), octets.end(), payload->data);
    payload->encapsulation = CDR_LE;
    payload->length = static_cast<std::uint32_t>(octets.size());
    return true;
  }
  bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
    static_cast<Octets*>(data)->assign(payload->data, payload->data + payload->length);
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<std::uint32_t>(static_cast<Octets*>(data)->size()); };
  }
  void* createData() override { return new Octets; }
  void deleteData(void* data) override { delete static_cast<Octets*>(data); }
  bool getKey(void*, rtps::InstanceHandle_t*, bool) override { return false; }
};

template <class Qos>
void as_rmw_fastrtps(Qos& qos, bool transient_local) {
  qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  qos.durability().kind =
      transient_local ? dds::TRANSIENT_LOCAL_DURABILITY_QOS : dds::VOLATILE_DURABILITY_QOS;
  qos.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = 1000;
  qos.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  qos.data_sharing().off();
}

template <class ProxyData>
SeenEndpoint describe(const ProxyData& data, bool is_reader) {
  SeenEndpoint seen;
  seen.guid = data.guid();
  seen.is_reader = is_reader;
  seen.topic = data.topicName().to_string();
  seen.type = data.typeName().to_string();
  const auto& qos = data.m_qos;
  const auto infinite = eprosima::fastrtps::c_TimeInfinite;
  seen.reliable = qos.m_reliability.kind == dds::RELIABLE_RELIABILITY_QOS;
  seen.transient_local = qos.m_durability.kind == dds::TRANSIENT_LOCAL_DURABILITY_QOS;
  seen.automatic_liveliness = qos.m_liveliness.kind == dds::AUTOMATIC_LIVELINESS_QOS;
  seen.infinite_liveliness_lease = qos.m_liveliness.lease_duration == infinite;
  seen.infinite_deadline = qos.m_deadline.period == infinite;
  seen.shared_ownership = qos.m_ownership.kind == dds::SHARED_OWNERSHIP_QOS;
  if (qos.m_lifespan.duration != infinite)
    seen.lifespan_s = static_cast<double>(qos.m_lifespan.duration.to_ns()) / 1e9;
  seen.keyed = data.topicKind() == rtps::WITH_KEY;
  seen.with_type_description = data.has_type() || data.has_type_id() || data.has_type_information();
  return seen;
}

}  // namespace

bool wait_for(const std::function<bool()>& condition) {
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

Octets gid_of(const rtps::GUID_t& guid) {
  Octets gid(guid.guidPrefix.value, guid.guidPrefix.value + 12);
  gid.insert(gid.end(), guid.entityId.value, guid.entityId.value + 4);
  return gid;
}

Ros2Peer::Ros2Peer(int domain) {
  dds::DomainParticipantQos qos;
  qos.name("/");
  const std::string enclave("enclave=/;\0", 11);
  qos.user_data().setValue({enclave.begin(), enclave.end()});
  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList = {"127.0.0.1"};
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(udp);
  participant_ = dds::DomainParticipantFactory::get_instance()->create_participant(
      static_cast<std::uint32_t>(domain), qos, this, dds::StatusMask::none());
  if (participant_ == nullptr) throw std::runtime_error("no participant");
  publisher_ = participant_->create_publisher(dds::PUBLISHER_QOS_DEFAULT);
  subscriber_ = participant_->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT);
}

Ros2Peer::~Ros2Peer() {
  participant_->set_listener(nullptr);
  participant_->delete_contained_entities();
  dds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
}

std::vector<SeenParticipant> Ros2Peer::participants() const {
  const std::lock_guard lock(mutex_);
  std::vector<SeenParticipant> all;
  for (const auto& entry : participants_) all.push_back(entry.second);
  return all;
}

std::vector<SeenEndpoint> Ros2Peer::endpoints_of(const rtps::GUID_t& participant) const {
  const std::lock_guard lock(mutex_);
  std::vector<SeenEndpoint> found;
  for (const auto& [guid, endpoint] : endpoints_) {
    if (guid.guidPrefix == participant.guidPrefix) found.push_back(endpoint);
  }
  return found;
}

dds::Topic* Ros2Peer::topic(const std::string& name, const std::string& type) {
  if (auto* found = participant_->lookup_topicdescription(name)) return dynamic_cast<dds::Topic*>(found);
  if (participant_->find_type(type).empty()) {
    dds::TypeSupport(new PayloadType(type)).register_type(participant_);
  }
  return participant_->create_topic(name, type, dds::TOPIC_QOS_DEFAULT);
}

void Ros2Peer::on_participant_discovery(dds::DomainParticipant*, rtps::ParticipantDiscoveryInfo&& info) {
  using Info = rtps::ParticipantDiscoveryInfo;
  const std::lock_guard lock(mutex_);
  if (info.status == Info::DISCOVERED_PARTICIPANT) {
    participants_[info.info.m_guid] = {info.info.m_guid, info.info.m_participantName.to_string(),
                                       info.info.m_userData.getValue()};
  } else if (info.status != Info::CHANGED_QOS_PARTICIPANT) {
    participants_.erase(info.info.m_guid);
  }
}

void Ros2Peer::on_subscriber_discovery(dds::DomainParticipant*, rtps::ReaderDiscoveryInfo&& info) {
  const std::lock_guard lock(mutex_);
  if (info.status == rtps::ReaderDiscoveryInfo::DISCOVERED_READER) {
    endpoints_[info.info.guid()] = describe(info.info, true);
  } else if (info.status == rtps::ReaderDiscoveryInfo::REMOVED_READER) {
    endpoints_.erase(info.info.guid());
  }
}

void Ros2Peer::on_publisher_discovery(dds::DomainParticipant*, rtps::WriterDiscoveryInfo&& info) {
  const std::lock_guard lock(mutex_);
  if (info.status == rtps::WriterDiscoveryInfo::DISCOVERED_WRITER) {
    endpoints_[info.info.guid()] = describe(info.info, false);
  } else if (info.status == rtps::WriterDiscoveryInfo::REMOVED_WRITER) {
    endpoints_.erase(info.info.guid());
  }
}

RawReader::RawReader(Ros2Peer& peer, const std::string& topic, const std::string& type, bool transient_local)
    : peer_(peer) {
  dds::DataReaderQos qos = dds::DATAREADER_QOS_DEFAULT;
  as_rmw_fastrtps(qos, transient_local);
  reader_ = peer_.subscriber().create_datareader(peer_.topic(topic, type), qos, this);
  if (reader_ == nullptr) throw std::runtime_error("no reader for " + topic);
}

RawReader::~RawReader() {
  reader_->set_listener(nullptr);
  peer_.subscriber().delete_datareader(reader_);
}

void RawReader::on_data_available(dds::DataReader* reader) {
  Octets payload;
  dds::SampleInfo info;
  while (reader->take_next_sample(&payload, &info) == ReturnCode_t::RETCODE_OK) {
    if (!info.valid_data) continue;
    const std::lock_guard lock(mutex_);
    samples_.push_back({payload, info.sample_identity, info.related_sample_identity});
    came_.notify_all();
  }
}

void RawReader::on_subscription_matched(dds::DataReader*, const dds::SubscriptionMatchedStatus& status) {
  const std::lock_guard lock(mutex_);
  matched_ = status.current_count;
}

int RawReader::matched() const {
  const std::lock_guard lock(mutex_);
  return matched_;
}

bool RawReader::heard(const std::function<void()>& provoke) {
  return wait_for([&] {
    provoke();
    const std::lock_guard lock(mutex_);
    return !samples_.empty();
  });
}

std::optional<ReceivedSample> RawReader::next(const std::function<bool(const ReceivedSample&)>& wanted) {
  std::unique_lock lock(mutex_);
  std::optional<ReceivedSample> found;
  came_.wait_for(lock, patience, [&] {
    while (!samples_.empty() && !found) {
      if (wanted(samples_.front())) found = samples_.front();
      samples_.erase(samples_.begin());
    }
    return found.has_value();
  });
  return found;
}

RawWriter::RawWriter(Ros2Peer& peer, const std::string& topic, const std::string& type) : peer_(peer) {
  dds::DataWriterQos qos = dds::DATAWRITER_QOS_DEFAULT;
  as_rmw_fastrtps(qos, false);
  qos.publish_mode().kind = dds::SYNCHRONOUS_PUBLISH_MODE;
  writer_ = peer_.publisher().create_datawriter(peer_.topic(topic, type), qos, this);
  if (writer_ == nullptr) throw std::runtime_error("no writer for " + topic);
}

RawWriter::~RawWriter() {
  writer_->set_listener(nullptr);
  peer_.publisher().delete_datawriter(writer_);
}

rtps::SampleIdentity RawWriter::write(Octets payload, const rtps::SampleIdentity& related) {
  rtps::WriteParams params;
  params.related_sample_identity(related);
  if (!writer_->write(&payload, params)) throw std::runtime_error("not written");
  return params.sample_identity();
}

int RawWriter::matched() const {
  const std::lock_guard lock(mutex_);
  return matched_;
}

void RawWriter::on_publication_matched(dds::DataWriter*, const dds::PublicationMatchedStatus& status) {
  const std::lock_guard lock(mutex_);
  matched_ = status.current_count;
}

RawClient::RawClient(Ros2Peer& peer, const std::string& service, const std::string& type)
    : replies(peer, "rr" + service + "Reply", type + "_Response_"),
      requests(peer, "rq" + service + "Request", type + "_Request_") {}

std::uint64_t RawClient::send(const Octets& request) {
  rtps::SampleIdentity related;
  related.writer_guid(replies.guid());
  return requests.write(request, related).sequence_number().to64long();
}

Octets RawClient::call(const Octets& request) {
  if (!wait_for([&] { return ready(); })) return {};
  const std::uint64_t sequence = send(request);
  const auto reply = replies.next([&](const ReceivedSample& sample) {
    return sample.related.writer_guid() == replies.guid() &&
           sample.related.sequence_number().to64long() == sequence;
  });
  return reply ? reply->payload : Octets{};
}

}  // namespace srfs::conformance
