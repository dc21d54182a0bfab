// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/participant.hpp"

#include <algorithm>
#include <set>
#include <typeinfo>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>
#include <fastrtps/xmlparser/XMLProfileManager.h>
#include <fmt/format.h>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/log/Log.hpp>

#include "base/fd.hpp"
#include "base/random_octets.hpp"
#include "ros/datagram_seal.hpp"

namespace srfs::ros {
namespace {

using eprosima::fastrtps::rtps::IPLocator;
using eprosima::fastrtps::rtps::Locator_t;

constexpr std::uint32_t socket_buffer_octets =
    4U << 20;                                    // a 1 MiB image takes 0.7 ms then, 22 ms with Linux' default
constexpr std::uint32_t most_participants = 32;  // unicast announcements go to this many ports of a domain

eprosima::fastrtps::Duration_t duration(double s) {
  return {static_cast<long double>(s)};
}

/// Numbers of this process' participants, from which the ports follow where they are announced to. Left to
/// itself Fast DDS 2.9 counts up and never uses a number twice, while announcements go to the first 32 only.
/// Only the port takes the number: Fast DDS' own participant id goes into the GUID, which must not come
/// twice.
std::mutex numbers_mutex;
std::set<int> numbers_in_use;

int take_number() {
  const std::lock_guard lock(numbers_mutex);
  int number = 0;
  while (numbers_in_use.contains(number)) ++number;
  numbers_in_use.insert(number);
  return number;
}

void give_number_back(int number) {
  const std::lock_guard lock(numbers_mutex);
  numbers_in_use.erase(number);
}

/// RTPS 2.2, 9.6.1.1. Fast DDS goes on to the next number's port where this one is taken by another process.
std::uint16_t discovery_port(int domain, int number) {
  return static_cast<std::uint16_t>(7400 + 250 * domain + 10 + 2 * number);
}

/// Fast DDS hands samples over within a process, in the publisher's thread and past what the wire does for
/// them: one that comes before the match is lost. What a node hears of itself is to prove that the wire
/// works.
void all_by_the_wire() {
  using eprosima::fastrtps::xmlparser::XMLProfileManager;
  static std::once_flag once;
  std::call_once(once, [] {
    auto settings = XMLProfileManager::library_settings();
    settings.intraprocess_delivery = eprosima::fastrtps::INTRAPROCESS_OFF;
    XMLProfileManager::library_settings(settings);
  });
}

dds::DomainParticipantQos participant_qos(const ParticipantOptions& options, int number,
                                          const std::shared_ptr<TransportState>& state) {
  dds::DomainParticipantQos qos;
  qos.name("/");
  qos.user_data().setValue(participant_user_data(options.identity));

  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList = options.interfaces;
  udp->sendBufferSize = socket_buffer_octets;
  udp->receiveBufferSize = socket_buffer_octets;
  udp->maxInitialPeersRange = most_participants;
  if (datagram_seal()) udp->maxMessageSize -= static_cast<std::uint32_t>(DatagramSeal::most_octets);
  qos.transport().use_builtin_transports = false;
  if (options.executor != nullptr) {
    qos.transport().user_transports.push_back(
        work_thread_transport(udp, *options.executor, options.interfaces, state));
  } else {
    qos.transport().user_transports.push_back(udp);
  }
  qos.transport().send_socket_buffer_size = socket_buffer_octets;
  qos.transport().listen_socket_buffer_size = socket_buffer_octets;

  // Else eight of 64 KiB are taken and zeroed at the start; a node hardly ever sends from two threads at
  // once.
  qos.allocation().send_buffers.preallocated_number = 1;
  qos.allocation().send_buffers.dynamic = true;

  auto& wire = qos.wire_protocol();
  auto& discovery = wire.builtin.discovery_config;
  discovery.leaseDuration = duration(static_cast<double>(options.lease.count()) / 1000.0);
  discovery.leaseDuration_announcementperiod = duration(0.5);
  discovery.initial_announcements.count = 10;
  discovery.initial_announcements.period = duration(0.05);
  for (const std::string& address : options.interfaces) {
    Locator_t locator;
    IPLocator::setIPv4(locator, address);
    wire.builtin.initialPeersList.push_back(locator);
    IPLocator::setPhysicalPort(locator, discovery_port(options.domain, number));
    wire.builtin.metatrafficUnicastLocatorList.push_back(locator);
  }
  return qos;
}

/// Of a limited member the prefix shows it. All others have that of Fast DDS.
/// @return false: there are no random numbers
bool set_prefix(dds::DomainParticipantQos& qos, const ParticipantOptions& options) {
  const auto& seal = datagram_seal();
  if (!seal || options.executor == nullptr || !seal->is_limited()) return true;
  std::array<std::uint8_t, 6> random{};
  if (!fill_random(random)) return false;
  const GuidPrefix prefix = limited_prefix(seal->keys().limited_to, random);
  std::copy(prefix.begin(), prefix.end(), qos.wire_protocol().prefix.value);
  return true;
}

double in_seconds(std::chrono::milliseconds time) {
  return std::chrono::duration<double>(time).count();
}

// Histories grow from a few samples to their depth, never further: memory of idle endpoints stays small.
template <class DdsQos>
void set_common(DdsQos& qos, const Qos& ours) {
  qos.reliability().kind =
      ours.best_effort ? dds::BEST_EFFORT_RELIABILITY_QOS : dds::RELIABLE_RELIABILITY_QOS;
  if (ours.keep_all) qos.reliability().max_blocking_time = {0, 1'000'000};
  qos.durability().kind =
      ours.transient_local ? dds::TRANSIENT_LOCAL_DURABILITY_QOS : dds::VOLATILE_DURABILITY_QOS;
  qos.history().kind = ours.keep_all ? dds::KEEP_ALL_HISTORY_QOS : dds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = ours.depth;
  if (ours.lifespan > milliseconds(0)) qos.lifespan().duration = duration(in_seconds(ours.lifespan));
  if (ours.deadline > milliseconds(0)) qos.deadline().period = duration(in_seconds(ours.deadline));
  if (ours.manual_liveliness) qos.liveliness().kind = dds::MANUAL_BY_TOPIC_LIVELINESS_QOS;
  if (ours.liveliness_lease > milliseconds(0)) {
    qos.liveliness().lease_duration = duration(in_seconds(ours.liveliness_lease));
    qos.liveliness().announcement_period = duration(in_seconds(ours.liveliness_lease) / 3);
  }
  qos.resource_limits().max_instances = 1;
  qos.resource_limits().max_samples_per_instance = ours.depth;
  qos.resource_limits().max_samples = ours.depth;
  qos.resource_limits().allocated_samples = 1;
  qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  qos.data_sharing().off();
}

/// A topic has one C++ type in a process: what it is written from and read into.
bool is_same_type(const dds::TopicDataType& one, const dds::TopicDataType& other) {
  return typeid(one) == typeid(other);
}

/// Where datagrams are sealed, the seal counts, and not what it says of itself.
bool is_foreign_prefix(const KnownParticipants& known, const GuidPrefix& prefix) {
  const auto& seal = datagram_seal();
  return seal ? !seal->is_member(prefix) : known.is_foreign(prefix);
}

std::string first_address(const eprosima::fastrtps::rtps::RemoteLocatorList& locators) {
  if (locators.unicast.empty()) return "no address";
  const Locator_t& locator = locators.unicast[0];
  return locator.kind == LOCATOR_KIND_UDPv4 ? IPLocator::toIPv4string(locator) : "no IPv4 address";
}

/// What a participant says of itself. That a limited member is another node counts as nothing said.
Octets believed(const GuidPrefix& prefix, const Octets& user_data) {
  const auto& seal = datagram_seal();
  const auto limit = seal ? seal->limit_of(prefix) : std::nullopt;
  if (!limit || limit->empty()) return user_data;
  const auto identity = find_identity(user_data);
  return identity && identity->node == *limit ? user_data : Octets{};
}

}  // namespace

Gid to_gid(const eprosima::fastrtps::rtps::GUID_t& guid) {
  Gid gid{};
  std::copy_n(guid.guidPrefix.value, 12, gid.begin());
  std::copy_n(guid.entityId.value, 4, gid.begin() + 12);
  return gid;
}

Octets departure_message(const GuidPrefix& prefix) {
  constexpr std::array<std::uint8_t, 4> participant{0, 0, 1, 0xc1};
  constexpr std::array<std::uint8_t, 4> spdp_reader{0, 1, 0, 0xc7};
  constexpr std::array<std::uint8_t, 4> spdp_writer{0, 1, 0, 0xc2};
  OctetWriter out;
  out.bytes(std::array<std::uint8_t, 8>{'R', 'T', 'P', 'S', 2, 2, 1, 15});  // version, vendor eProsima
  out.bytes(prefix);
  out.bytes(std::array<std::uint8_t, 4>{0x15, 0x02, 0, 52});  // DATA, big-endian, inline QoS, no payload
  out.u16(0);
  out.u16(16);  // octets to the inline QoS
  out.bytes(spdp_reader);
  out.bytes(spdp_writer);
  out.u64(INT32_MAX);  // above all that it ever sent
  out.u16(0x0070);     // PID_KEY_HASH: the participant
  out.u16(16);
  out.bytes(prefix);
  out.bytes(participant);
  out.u16(0x0071);  // PID_STATUS_INFO: disposed and unregistered
  out.u16(4);
  out.u32(3);
  out.u16(1);  // PID_SENTINEL
  out.u16(0);
  return out.take();
}

/// Notes the participants and endpoints that come and go. On discovery's thread.
class Participant::Discovery : public dds::DomainParticipantListener {
 public:
  /// @param topics nullptr: endpoints are not noted
  Discovery(KnownParticipants& known, TransportState& transport, TopicDirectory* topics)
      : known_(known), transport_(transport), topics_(topics) {}

  void on_participant_discovery(dds::DomainParticipant*,
                                eprosima::fastrtps::rtps::ParticipantDiscoveryInfo&& info) override {
    using Info = eprosima::fastrtps::rtps::ParticipantDiscoveryInfo;
    GuidPrefix prefix{};
    std::copy_n(info.info.m_guid.guidPrefix.value, prefix.size(), prefix.begin());
    if (info.status == Info::DISCOVERED_PARTICIPANT) {
      known_.discovered(prefix, believed(prefix, info.info.m_userData.getValue()),
                        info.info.m_participantName.to_string(), first_address(info.info.default_locators));
    } else if (info.status == Info::REMOVED_PARTICIPANT || info.status == Info::DROPPED_PARTICIPANT) {
      known_.gone(prefix);
      if (topics_ != nullptr) topics_->remove_all_of(prefix);
    } else {
      return;
    }
    transport_.tell_members_changed();
    const std::lock_guard lock(mutex_);
    if (changed_) changed_();
  }

  void on_publisher_discovery(dds::DomainParticipant*,
                              eprosima::fastrtps::rtps::WriterDiscoveryInfo&& info) override {
    using Info = eprosima::fastrtps::rtps::WriterDiscoveryInfo;
    note_endpoint(info.info, true, info.status == Info::REMOVED_WRITER);
  }
  void on_subscriber_discovery(dds::DomainParticipant*,
                               eprosima::fastrtps::rtps::ReaderDiscoveryInfo&& info) override {
    using Info = eprosima::fastrtps::rtps::ReaderDiscoveryInfo;
    note_endpoint(info.info, false, info.status == Info::REMOVED_READER);
  }

  /// When it returns, the callback before it is not being called.
  void on_change(std::function<void()> callback) {
    const std::lock_guard lock(mutex_);
    changed_ = std::move(callback);
  }

 private:
  template <class EndpointData>
  void note_endpoint(const EndpointData& endpoint, bool is_publisher, bool is_gone) {
    if (topics_ == nullptr) return;
    const Gid gid = to_gid(endpoint.guid());
    if (is_gone) {
      topics_->remove(gid);
      return;
    }
    Qos qos;
    qos.best_effort = endpoint.m_qos.m_reliability.kind == dds::BEST_EFFORT_RELIABILITY_QOS;
    qos.transient_local = endpoint.m_qos.m_durability.kind != dds::VOLATILE_DURABILITY_QOS;
    topics_->add(gid, is_publisher, endpoint.topicName().to_string(), endpoint.typeName().to_string(), qos);
  }

  KnownParticipants& known_;
  TransportState& transport_;
  TopicDirectory* topics_;
  std::mutex mutex_;
  std::function<void()> changed_;
};

Participant::Participant(const ParticipantOptions& options)
    : known_(options.identity),
      number_(take_number()),
      domain_(options.domain),
      interfaces_(options.interfaces),
      drop_foreign_(options.drop_foreign),
      filter_(std::make_shared<DatagramFilter>(
          [this](const GuidPrefix& prefix) { return is_foreign_prefix(known_, prefix); }, drop_foreign_)),
      discovery_(std::make_unique<Discovery>(known_, *transport_,
                                             options.remember_topics ? &directory_ : nullptr)) {}

Result<std::unique_ptr<Participant>, std::string> Participant::create(const ParticipantOptions& options) {
  if (options.domain < 0 || options.domain > 232)
    return Err(fmt::format("DDS domain {} is outside 0..232", options.domain));
  dds::Log::SetVerbosity(dds::Log::Error);
  all_by_the_wire();
  auto* factory = dds::DomainParticipantFactory::get_instance();
  std::unique_ptr<Participant> self(new Participant(options));
  self->transport_->filter = self->filter_;
  if (options.identity && options.bound_foreign) self->transport_->known = &self->known_;
  auto qos = participant_qos(options, self->number_, self->transport_);
  if (!set_prefix(qos, options)) return Err(std::string("no random numbers for a GUID"));
  // Discovery is called outside the mask; everything else goes to the endpoints' own listeners.
  self->participant_ = factory->create_participant(static_cast<std::uint32_t>(options.domain), qos,
                                                   self->discovery_.get(), dds::StatusMask::none());
  self->transport_->discovery.open();
  if (self->participant_ == nullptr) {
    return Err(fmt::format(
        "no DDS participant on domain {}: are the interfaces up and {} participants not exceeded?",
        options.domain, most_participants));
  }
  self->publisher_ = self->participant_->create_publisher(dds::PUBLISHER_QOS_DEFAULT);
  self->subscriber_ = self->participant_->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT);
  if (self->publisher_ == nullptr || self->subscriber_ == nullptr)
    return Err(std::string("no DDS publisher or subscriber"));
  const auto& guid = self->participant_->guid();
  self->graph_.set_participant(to_gid(guid));
  GuidPrefix own{};  // no participant discovers itself, and a node may hear its own messages
  std::copy_n(guid.guidPrefix.value, own.size(), own.begin());
  if (const auto& seal = datagram_seal(); seal && options.executor != nullptr) seal->add_own(own);
  self->known_.discovered(own, participant_user_data(options.identity), "/", "this process");
  self->transport_->tell_members_changed();
  return self;
}

Participant::~Participant() {
  if (participant_ != nullptr) {
    participant_->delete_contained_entities();
    dds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
  }
  give_number_back(number_);
}

void Participant::on_peers_changed(std::function<void()> callback) {
  discovery_->on_change(std::move(callback));
}

bool Participant::announce_departure(const GuidPrefix& prefix) const {
  const Octets departure = departure_message(prefix);
  const auto& seal = datagram_seal();
  const Fd fd(socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!fd) return false;
  bool sent = false;
  for (const std::string& address : interfaces_) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    if (inet_pton(AF_INET, address.c_str(), &to.sin_addr) != 1) continue;
    Octets message = departure;
    // Each port takes a datagram once, from whichever interface it comes.
    if (seal) seal->seal(departure, monotonic_now(), message);
    for (int number = 0; number < static_cast<int>(most_participants); ++number) {
      to.sin_port = htons(discovery_port(domain_, number));
      const ssize_t n = sendto(fd.get(), message.data(), message.size(), 0,
                               reinterpret_cast<const sockaddr*>(&to), sizeof to);
      sent = sent || n == static_cast<ssize_t>(message.size());
    }
  }
  return sent;
}

static GuidPrefix prefix_of(const eprosima::fastrtps::rtps::GUID_t& guid) {
  GuidPrefix prefix{};
  std::copy_n(guid.guidPrefix.value, prefix.size(), prefix.begin());
  return prefix;
}

bool Participant::is_foreign(const eprosima::fastrtps::rtps::GUID_t& guid) const {
  return is_foreign_prefix(known_, prefix_of(guid));
}

bool Participant::may_order(const eprosima::fastrtps::rtps::GUID_t& guid) const {
  const auto& seal = datagram_seal();
  return seal ? seal->limit_of(prefix_of(guid)) == std::string() : !is_foreign(guid);
}

std::string Participant::limited_name(const eprosima::fastrtps::rtps::GUID_t& guid) const {
  const auto& seal = datagram_seal();
  return seal ? seal->limit_of(prefix_of(guid)).value_or("") : std::string();
}

ParticipantGraph Participant::graph() const {
  const std::lock_guard lock(graph_mutex_);
  return graph_;
}

void Participant::set_node(std::optional<std::string> name, const std::string& name_space) {
  change_graph([&](ParticipantGraph& graph) {
    graph.set_node(std::move(name), name_space);
    return true;
  });
}

void Participant::on_graph_change(std::function<void()> callback) {
  const std::lock_guard lock(graph_mutex_);
  graph_change_ = std::move(callback);
}

void Participant::change_graph(const std::function<bool(ParticipantGraph&)>& change) {
  std::function<void()> tell;
  {
    const std::lock_guard lock(graph_mutex_);
    if (change(graph_)) tell = graph_change_;
  }
  if (tell) tell();
}

dds::Topic* Participant::topic(const std::string& name, dds::TypeSupport& type) {
  const dds::TypeSupport known = participant_->find_type(type.get_type_name());
  if (!known.empty() && !is_same_type(*known, *type)) return nullptr;
  if (auto* description = participant_->lookup_topicdescription(name)) {
    const bool is_of_type = description->get_type_name() == type.get_type_name();
    return is_of_type ? dynamic_cast<dds::Topic*>(description) : nullptr;
  }
  if (!known.empty()) {
    type = known;
  } else if (type.register_type(participant_) != ReturnCode_t::RETCODE_OK) {
    return nullptr;
  }
  return participant_->create_topic(name, type.get_type_name(), dds::TOPIC_QOS_DEFAULT);
}

dds::DataWriter* Participant::create_writer(const std::string& name, dds::TypeSupport type, const Qos& ours,
                                            dds::DataWriterListener* listener) {
  auto* dds_topic = topic(name, type);
  if (dds_topic == nullptr) return nullptr;
  dds::DataWriterQos qos = dds::DATAWRITER_QOS_DEFAULT;
  set_common(qos, ours);
  qos.publish_mode().kind = dds::SYNCHRONOUS_PUBLISH_MODE;
  qos.reliable_writer_qos().times.heartbeatPeriod = duration(0.2);
  qos.reliable_writer_qos().times.nackResponseDelay = duration(0.001);
  auto* writer = publisher_->create_datawriter(dds_topic, qos, listener);
  if (writer != nullptr && belongs_to_a_node(name))
    change_graph([&](ParticipantGraph& graph) { return graph.add_writer(to_gid(writer->guid())); });
  return writer;
}

dds::DataReader* Participant::create_reader(const std::string& name, dds::TypeSupport type, const Qos& ours,
                                            dds::DataReaderListener* listener) {
  auto* dds_topic = topic(name, type);
  if (dds_topic == nullptr) return nullptr;
  dds::DataReaderQos qos = dds::DATAREADER_QOS_DEFAULT;
  set_common(qos, ours);
  // A request that came before its reader knew the writer is asked for again soon, not after 70 ms.
  qos.reliable_reader_qos().times.initialAcknackDelay = duration(0.005);
  // What grew in a pool stays there.
  if (!keeps_memory(ours.largest_octets))
    qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::DYNAMIC_RESERVE_MEMORY_MODE;
  auto* reader = subscriber_->create_datareader(dds_topic, qos, listener);
  if (reader != nullptr && belongs_to_a_node(name))
    change_graph([&](ParticipantGraph& graph) { return graph.add_reader(to_gid(reader->guid())); });
  return reader;
}

MonotonicTime Participant::received_at(const dds::SampleInfo& info, MonotonicTime now) const {
  const UtcTime looked_at(nanoseconds(info.reception_timestamp.to_ns()));
  const UtcTime arrived = transport_->arrivals.arrival_of(looked_at);
  return now - std::clamp<nanoseconds>(system_utc_now() - arrived, nanoseconds(0), seconds(1));
}

void Participant::let_last_words_be_heard(dds::DataWriter& writer) {
  constexpr milliseconds longest_linger{50};
  if (monotonic_now() - linger_began_ > seconds(1)) linger_began_ = monotonic_now();
  const eprosima::fastrtps::Duration_t step{0, 1'000'000};
  do {
    receive_waiting();  // acknowledgements come by the socket that this thread reads
    if (writer.wait_for_acknowledgments(step) == ReturnCode_t::RETCODE_OK) return;
  } while (monotonic_now() - linger_began_ < longest_linger);
}

void Participant::destroy(dds::DataWriter* writer) {
  if (writer == nullptr) return;
  let_last_words_be_heard(*writer);
  const Gid gid = to_gid(writer->guid());
  change_graph([&](ParticipantGraph& graph) { return graph.remove_writer(gid); });
  writer->set_listener(nullptr);
  publisher_->delete_datawriter(writer);
}

void Participant::destroy(dds::DataReader* reader) {
  if (reader == nullptr) return;
  const Gid gid = to_gid(reader->guid());
  change_graph([&](ParticipantGraph& graph) { return graph.remove_reader(gid); });
  reader->set_listener(nullptr);
  subscriber_->delete_datareader(reader);
  filter_->ended(gid);
}

}  // namespace srfs::ros
