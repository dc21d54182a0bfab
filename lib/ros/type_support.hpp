// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <fastcdr/FastBuffer.h>
#include <fastdds/dds/topic/TopicDataType.hpp>

#include "base/octets.hpp"
#include "ros/cdr.hpp"

namespace srfs::ros {

/// What a reader gets: the message, or the fact that the octets were none. A reader never fails to take a
/// sample because of its content; the receiver counts it instead.
template <class M>
struct Sample {
  M message;
  bool well_formed = false;
};

/// Octets of a message with its encapsulation header (00 01 00 00, padded to 4), as ROS 2 sends it. Throws
/// CdrError.
template <class M>
[[nodiscard]] std::size_t encoded_size(const M& message) {
  CdrSizer sizer;
  M::visit(message, sizer);
  return 4 + (sizer.size() + 3) / 4 * 4;
}

template <class M>
void encode_into(const M& message, char* out, std::size_t size) {
  using namespace eprosima::fastcdr;
  FastBuffer buffer(out, size);
  Cdr cdr(buffer, Cdr::LITTLE_ENDIANNESS, Cdr::DDS_CDR);
  cdr.serialize_encapsulation();
  CdrEncoder encoder(cdr);
  M::visit(message, encoder);
  for (std::size_t used = cdr.getSerializedDataLength(); used < size; ++used) out[used] = 0;
}

/// @return false when the octets are no such message; @p message is unspecified then
template <class M>
[[nodiscard]] bool decode_from(OctetView data, M& message) {
  using namespace eprosima::fastcdr;
  try {
    // Fast CDR wants a mutable buffer and does not write to it while reading.
    FastBuffer buffer(reinterpret_cast<char*>(const_cast<std::uint8_t*>(data.data())), data.size());
    Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
    cdr.read_encapsulation();
    CdrDecoder decoder(cdr, data.size());
    M::visit(message, decoder);
    return true;
  } catch (const std::exception&) {
    return false;
  }
}

/// Fast DDS' view of a message type. Writers hand over `const M*`, readers a `Sample<M>*`.
template <class M>
class TypeSupport : public eprosima::fastdds::dds::TopicDataType {
 public:
  TypeSupport() {
    setName(M::dds_type_name);
    m_typeSize =
        static_cast<std::uint32_t>(encoded_size(M{})) + 64;  // first allocation; payloads grow as needed
    m_isGetKeyDefined = false;
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }

  bool serialize(void* data, eprosima::fastrtps::rtps::SerializedPayload_t* payload) override {
    try {
      const auto& message = *static_cast<const M*>(data);
      const std::size_t size = encoded_size(message);
      if (size > payload->max_size) return false;
      encode_into(message, reinterpret_cast<char*>(payload->data), size);
      payload->encapsulation = CDR_LE;
      payload->length = static_cast<std::uint32_t>(size);
      return true;
    } catch (const std::exception&) {
      return false;  // a bound of the type is exceeded: the publisher counts and reports it
    }
  }

  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) override {
    auto& sample = *static_cast<Sample<M>*>(data);
    sample.well_formed = payload->length <= largest_payload &&
                         decode_from(OctetView(payload->data, payload->length), sample.message);
    return true;
  }

  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<std::uint32_t>(encoded_size(*static_cast<const M*>(data))); };
  }
  void* createData() override { return new Sample<M>; }
  void deleteData(void* data) override { delete static_cast<Sample<M>*>(data); }
  bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
  bool is_bounded() const override { return false; }
  bool is_plain() const override { return false; }
};

}  // namespace srfs::ros
