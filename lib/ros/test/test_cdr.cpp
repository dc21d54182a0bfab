// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <lifecycle_msgs/srv/change_state.hpp>
#include <lifecycle_msgs/srv/get_state.hpp>
#include <rcl_interfaces/msg/parameter.hpp>
#include <srfs_msgs/msg/payload_telemetry.hpp>
#include <srfs_msgs/msg/task_flags.hpp>

#include "ros/type_support.hpp"

namespace srfs::ros {
namespace {

template <class M>
Octets encode(const M& message) {
  Octets out(encoded_size(message));
  encode_into(message, reinterpret_cast<char*>(out.data()), out.size());
  return out;
}

template <class M>
M decoded(const Octets& data) {
  M message;
  EXPECT_TRUE(decode_from(data, message));
  return message;
}

srfs_msgs::msg::TaskFlags example_flags() {
  srfs_msgs::msg::TaskFlags m;
  m.cycle = 0x0102030405060708;
  m.switcher_incarnation = 3;
  m.flags = {false, true, false};
  m.holder = "payload_eps";
  m.lease_end_ns = 77;
  return m;
}

TEST(Cdr, AnEmptyRequestIsEightOctetsAsInRos2) {
  EXPECT_EQ(to_hex(encode(lifecycle_msgs::srv::GetState_Request{})), "0001000000000000");
}

TEST(Cdr, LaysOutFieldsAsXcdr1WithAlignmentFromTheBody) {
  lifecycle_msgs::srv::ChangeState_Request request;
  request.transition.id = 3;
  request.transition.label = "activate";
  // id, padding to 4, length with NUL, text, padding to 4
  EXPECT_EQ(to_hex(encode(request)),
            "00010000"
            "03000000"
            "09000000"
            "616374697661746500"
            "000000");
}

TEST(Cdr, PaddingIsZeroWhateverTheBufferHeldBefore) {
  Octets out(encoded_size(example_flags()), 0xee);
  encode_into(example_flags(), reinterpret_cast<char*>(out.data()), out.size());
  EXPECT_EQ(to_hex(out), to_hex(encode(example_flags())));
}

TEST(Cdr, MessagesSurviveTheRoundTrip) {
  EXPECT_EQ(decoded<srfs_msgs::msg::TaskFlags>(encode(example_flags())), example_flags());
  rcl_interfaces::msg::Parameter p;
  p.name = "x";
  p.value.type = 9;
  p.value.string_array_value = {"a", "", "ccc"};
  p.value.double_array_value = {1.5, -2.5};
  EXPECT_EQ(decoded<rcl_interfaces::msg::Parameter>(encode(p)), p);
}

TEST(Cdr, ATextWithANulInsideIsNotCutShort) {
  auto m = example_flags();
  m.holder = std::string("a\0b", 3);
  EXPECT_EQ(decoded<srfs_msgs::msg::TaskFlags>(encode(m)), m);
}

TEST(Cdr, WritersRefuseWhatBreaksABound) {
  auto m = example_flags();
  m.flags.assign(17, false);
  EXPECT_THROW(encode(m), CdrError);
  m = example_flags();
  m.holder.assign(33, 'x');
  EXPECT_THROW(encode(m), CdrError);
}

TEST(Cdr, ReadersRefuseLengthsBeyondBoundOrSampleBeforeTakingMemory) {
  srfs_msgs::msg::PayloadTelemetry m;
  m.data.assign(64, 1);
  Octets good = encode(m);
  // The last 68 octets contain the length of `data`.
  Octets lying = good;
  lying[lying.size() - 68] = 0xff;
  lying[lying.size() - 65] = 0x7f;
  srfs_msgs::msg::PayloadTelemetry out;
  EXPECT_TRUE(decode_from(good, out));
  EXPECT_FALSE(decode_from(lying, out));
}

TEST(Cdr, EveryTruncationIsRefusedAndEveryBitFlipIsSurvived) {
  const Octets good = encode(example_flags());
  srfs_msgs::msg::TaskFlags out;
  for (std::size_t length = 0; length + 4 < good.size(); ++length) {
    EXPECT_FALSE(decode_from(OctetView(good).first(length), out)) << length;
  }
  for (std::size_t bit = 0; bit < good.size() * 8; ++bit) {
    Octets bad = good;
    bad[bit / 8] = static_cast<std::uint8_t>(bad[bit / 8] ^ (1U << (bit % 8)));
    (void)decode_from(bad, out);  // may decode to another valid message, but must not crash or grow
    EXPECT_LE(out.flags.size(), 16U);
    EXPECT_LE(out.holder.size(), 64U);
  }
}

TEST(Cdr, ReadsBigEndianSendersToo) {
  const auto data = from_hex(
                        "0000000000000000"
                        "0000002a"
                        "00000000")
                        .value();  // encapsulation 00 00: big-endian
  std::uint64_t first = 0;
  Octets bytes = data;
  eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(bytes.data()), bytes.size());
  eprosima::fastcdr::Cdr cdr(buffer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN, eprosima::fastcdr::Cdr::DDS_CDR);
  cdr.read_encapsulation();
  cdr >> first;
  EXPECT_EQ(first, 0x2aU);
}

}  // namespace
}  // namespace srfs::ros
