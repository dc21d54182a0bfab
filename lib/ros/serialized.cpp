// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/serialized.hpp"

#include <algorithm>

namespace srfs::ros {
namespace {

/// Fast DDS' view of a type that is only a name. Writers hand over `const OctetView*`, readers a
/// `SerializedMessage*`.
class SerializedType final : public dds::TopicDataType {
 public:
  explicit SerializedType(const std::string& name) {
    setName(name.c_str());
    m_typeSize = 256;  // first allocation; payloads grow as needed
    m_isGetKeyDefined = false;
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }
  bool serialize(void* data, eprosima::fastrtps::rtps::SerializedPayload_t* payload) override {
    const auto& octets = *static_cast<const OctetView*>(data);
    if (octets.size() > payload->max_size) return false;
    std::copy(octets.begin(), octets.end(), payload->data);
    payload->encapsulation = octets.size() > 1 && octets[1] == 0 ? CDR_BE : CDR_LE;
    payload->length = static_cast<std::uint32_t>(octets.size());
    return true;
  }
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) override {
    static_cast<SerializedMessage*>(data)->octets.assign(payload->data, payload->data + payload->length);
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<std::uint32_t>(static_cast<const OctetView*>(data)->size()); };
  }
  void* createData() override { return new SerializedMessage; }
  void deleteData(void* data) override { delete static_cast<SerializedMessage*>(data); }
  bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
  bool is_bounded() const override { return false; }
  bool is_plain() const override { return false; }
};

dds::TypeSupport type_support(std::string_view ros_type) {
  const std::string name = dds_type_name(ros_type);
  if (name.empty())
    throw std::runtime_error("no type of a message (package/msg/Name): " + std::string(ros_type));
  return dds::TypeSupport(new SerializedType(name));
}

constexpr std::string_view in_dds = "::dds_::";

}  // namespace

std::string dds_type_name(std::string_view ros_type) {
  const std::size_t first = ros_type.find('/');
  const std::size_t last = ros_type.rfind('/');
  if (first == std::string_view::npos || first == last || first == 0 || last + 1 == ros_type.size())
    return {};
  const std::string_view kind = ros_type.substr(first + 1, last - first - 1);
  if (kind.empty() || kind.find('/') != std::string_view::npos) return {};
  std::string name(ros_type.substr(0, first));
  name.append("::").append(kind).append(in_dds).append(ros_type.substr(last + 1)).append("_");
  return name;
}

std::string ros_type_name(std::string_view dds_type) {
  const std::size_t end = dds_type.find(in_dds);
  const std::size_t first = dds_type.find("::");
  if (end == std::string_view::npos || first == end || !dds_type.ends_with('_')) return {};
  std::string_view name = dds_type.substr(end + in_dds.size());
  name.remove_suffix(1);
  const std::string_view kind = dds_type.substr(first + 2, end - first - 2);
  if (first == 0 || name.empty() || kind.find(':') != std::string_view::npos) return {};
  std::string type(dds_type.substr(0, first));
  type.append("/").append(kind).append("/").append(name);
  return type;
}

SerializedPublisher::SerializedPublisher(Participant& participant, const std::string& topic,
                                         std::string_view type, const Qos& qos)
    : writer_(participant, topic_dds_name(topic), type_support(type), qos) {}

bool SerializedPublisher::publish(OctetView octets) {
  return octets.size() <= largest_payload && writer_.write(&octets);
}

class SerializedSubscription::Reader final : public ReaderEndpoint {
 public:
  Reader(Executor& executor, Priority priority, Callback callback)
      : ReaderEndpoint(executor, priority), callback_(std::move(callback)) {}

  void start(Participant& participant, const std::string& topic, std::string_view type, const Qos& qos) {
    open(participant, topic_dds_name(topic), type_support(type), qos,
         qos.largest_octets != 0 ? qos.largest_octets : largest_unbounded_payload);
  }

  bool dispatch_one(MonotonicTime now) override {
    if (reader_ == nullptr) return false;
    dds::SampleInfo info;
    if (reader_->take_next_sample(&message_, &info) != ReturnCode_t::RETCODE_OK) return false;
    participant_->on_taken(info.sample_identity, reader_->guid());
    if (info.valid_data) {
      (void)count_gap(info.sample_identity);
      ++stats_.received;
      callback_(message_.octets,
                {participant_->received_at(info, now), info.sample_identity, info.related_sample_identity});
    }
    if (!keeps_memory(largest_octets_)) message_ = {};
    return true;
  }

 private:
  Callback callback_;
  SerializedMessage message_;
};

SerializedSubscription::SerializedSubscription(Executor& executor, Participant& participant,
                                               const std::string& topic, std::string_view type,
                                               const Qos& qos, Priority priority, Callback callback)
    : reader_(std::make_shared<Reader>(executor, priority, std::move(callback))) {
  reader_->start(participant, topic, type, qos);
}

SerializedSubscription::~SerializedSubscription() {
  reader_->close();
}

InputStats SerializedSubscription::stats() const {
  return reader_->stats();
}

std::size_t SerializedSubscription::publisher_count() const {
  return reader_->matched_count();
}

}  // namespace srfs::ros
