// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Types that srfs_generate_interfaces() made of own_interfaces/. Octets of wstring are compared with those of
// Fast CDR itself, which rmw_fastrtps writes them with.

#include <gtest/gtest.h>

#include <limits>

#include <test_interfaces/action/go.hpp>
#include <test_interfaces/msg/every.hpp>
#include <test_interfaces/srv/ask.hpp>

#include "ros/type_support.hpp"

namespace srfs::ros {
namespace {

using test_interfaces::msg::Every;

template <class M>
Octets encode(const M& message) {
  Octets out(encoded_size(message), 0xee);
  encode_into(message, reinterpret_cast<char*>(out.data()), out.size());
  return out;
}

Every example() {
  Every m;
  m.wide = std::u16string(u"\u20ac\0\xd83d\xde80", 4);  // a NUL inside, and a pair of surrogates
  m.narrow = u"abc";
  m.some = {u"", u"x"};
  m.vector = {1.5, -2.5, 0};
  m.pair = {"", "abc"};
  m.part = {.number = 3, .flags = {true, false, true}};
  m.parts = {m.part, {}};
  m.header.frame_id = "f";
  m.class_ = -1;
  return m;
}

TEST(OwnInterfaces, HaveTheNamesThatRos2GivesThem) {
  EXPECT_STREQ(Every::dds_type_name, "test_interfaces::msg::dds_::Every_");
  EXPECT_STREQ(test_interfaces::srv::Ask::Request::dds_type_name, "test_interfaces::srv::dds_::Ask_Request_");
  EXPECT_STREQ(test_interfaces::action::Go::FeedbackMessage::dds_type_name,
               "test_interfaces::action::dds_::Go_FeedbackMessage_");
}

TEST(OwnInterfaces, HaveTheConstantsAndDefaultsOfTheirFile) {
  const Every m;
  EXPECT_EQ(Every::LEAST, 1);
  EXPECT_EQ(Every::QUOTED, "a \"b\"");
  EXPECT_EQ(Every::GREETING, u"Gr\u00fc\u00dfe \u20ac");
  EXPECT_TRUE(m.flag);
  EXPECT_EQ(m.letter, 65);
  EXPECT_EQ(m.lowest, std::numeric_limits<std::int64_t>::min());
  EXPECT_EQ(m.highest, std::numeric_limits<std::uint64_t>::max());
  EXPECT_EQ(m.ratio, 0.5F);
  EXPECT_EQ(m.name, "\xc3\x9c\\\\");
  EXPECT_EQ(m.pair, (std::array<std::string, 2>{"a", "b"}));
  EXPECT_EQ(m.wide, u"n\u00e9");
  EXPECT_EQ(m.numbers, (std::vector<std::int32_t>{1, -2}));
  EXPECT_EQ(m.class_, 7);
}

TEST(OwnInterfaces, SurviveTheRoundTrip) {
  for (const Every& m : {Every(), example()}) {
    Every back;
    EXPECT_TRUE(decode_from(encode(m), back));
    EXPECT_EQ(back, m);
  }
}

TEST(OwnInterfaces, WideStringsAreWrittenAsByFastCdr) {
  test_interfaces::srv::Ask_Response response;
  response.answer = u"\u00e9\u20ac";
  std::array<char, 64> expected{};
  eprosima::fastcdr::FastBuffer buffer(expected.data(), expected.size());
  eprosima::fastcdr::Cdr cdr(buffer, eprosima::fastcdr::Cdr::LITTLE_ENDIANNESS,
                             eprosima::fastcdr::Cdr::DDS_CDR);
  cdr.serialize_encapsulation();
  cdr << std::wstring(L"\u00e9\u20ac");
  const OctetView written(reinterpret_cast<const std::uint8_t*>(expected.data()),
                          cdr.getSerializedDataLength());
  EXPECT_EQ(to_hex(encode(response)), to_hex(written));
}

TEST(OwnInterfaces, WritersRefuseWhatBreaksABound) {
  const auto refused = [](const auto& change) {
    Every m = example();
    change(m);
    EXPECT_THROW(encode(m), CdrError);
  };
  refused([](Every& m) { m.narrow = u"abcd"; });
  refused([](Every& m) { m.some.resize(3); });
  refused([](Every& m) { m.pair[1] = "abcd"; });
  refused([](Every& m) { m.parts.resize(3); });
}

TEST(OwnInterfaces, ReadersRefuseWideStringsThatAreNone) {
  const auto decodes = [](const std::string& hex) {
    test_interfaces::srv::Ask_Response response;
    return decode_from(from_hex("00010000" + hex).value(), response);
  };
  EXPECT_TRUE(
      decodes("02000000"
              "e9000000"
              "ac200000"));
  EXPECT_FALSE(
      decodes("02000000"
              "e9000000"))
      << "longer than the sample";
  EXPECT_FALSE(
      decodes("03000000"
              "610000006200000063000000"))
      << "longer than its bound";
  EXPECT_FALSE(
      decodes("01000000"
              "00000100"))
      << "no unit of UTF-16";
  EXPECT_FALSE(
      decodes("ffffffff"
              "61000000"))
      << "no memory is taken for a claim";
}

TEST(OwnInterfaces, EveryTruncationIsRefusedAndEveryBitFlipIsSurvived) {
  const Octets good = encode(example());
  Every out;
  for (std::size_t length = 0; length + 4 < good.size(); ++length)
    EXPECT_FALSE(decode_from(OctetView(good).first(length), out)) << length;
  for (std::size_t bit = 0; bit < good.size() * 8; ++bit) {
    Octets bad = good;
    bad[bit / 8] = static_cast<std::uint8_t>(bad[bit / 8] ^ (1U << (bit % 8)));
    if (!decode_from(bad, out)) continue;
    EXPECT_LE(out.narrow.size(), 3U);
    EXPECT_LE(out.pair[1].size(), 3U);
    EXPECT_NO_THROW(encode(out)) << "what a reader takes, a writer may send";
  }
}

TEST(OwnInterfaces, ABoundOfTheTypeBoundsItsSamples) {
  test_interfaces::srv::Ask_Response response;
  response.answer = u"ab";
  EXPECT_GE(largest_sample<test_interfaces::srv::Ask_Response>(), encode(response).size());
  EXPECT_LT(largest_sample<test_interfaces::srv::Ask_Response>(), 64U);
  EXPECT_EQ(largest_sample<Every>(), largest_unbounded_payload);
}

}  // namespace
}  // namespace srfs::ros
