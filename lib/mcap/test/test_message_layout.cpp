// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "mcap/message_definition.hpp"
#include "mcap/message_layout.hpp"

namespace srfs::mcap {
namespace {

const std::string next_type = std::string(80, '=') + "\nMSG: ";

/// As JSON; "none": the sample is no such message. @param hex of the sample behind its encapsulation header
std::string shown(const std::string& definition, const std::string& hex, std::size_t most = 8,
                  const std::string& header = "00010000") {
  const auto layout = MessageLayout::parse("own/msg/Own", definition);
  if (!layout) return "refused: " + layout.error();
  return layout->to_json(from_hex(header + hex).value(), most).value_or("none");
}

TEST(MessageLayout, ShowsEveryPrimitiveWithItsAlignment) {
  EXPECT_EQ(shown("bool flag\nbyte b\nint8 i\nuint16 u16\nint16 i16\nuint32 u32\nint32 i32\n",
                  "0102ff00"
                  "0300feff"
                  "04000000"
                  "fbffffff"),
            R"({"flag":true,"b":2,"i":-1,"u16":3,"i16":-2,"u32":4,"i32":-5})");
  EXPECT_EQ(shown("uint8 first\nuint64 u64\nint64 i64\n",
                  "0100000000000000"
                  "ffffffffffffffff"
                  "ffffffffffffffff"),
            R"({"first":1,"u64":18446744073709551615,"i64":-1})");
  EXPECT_EQ(shown("float32 f\nfloat64 d\nfloat32 n\n",
                  "cdcccc3d00000000"
                  "9a9999999999b93f"
                  "0000c07f"),
            R"({"f":0.1,"d":0.1,"n":null})");
}

TEST(MessageLayout, ShowsBothByteOrders) {
  EXPECT_EQ(shown("uint8 a\nuint32 b\n", "0100000000000002", 8, "00000000"), R"({"a":1,"b":2})");
}

TEST(MessageLayout, ShowsTexts) {
  EXPECT_EQ(shown("string<=8 s\nwstring w\n",
                  "04000000"
                  "22c3a900"
                  "03000000"
                  "e90000003dd8000080de0000"),
            "{\"s\":\"\\\"\u00e9\",\"w\":\"\u00e9\U0001f680\"}");
  EXPECT_EQ(shown("string s\n", "00000000"), R"({"s":""})") << "as some writers send an empty one";
  EXPECT_EQ(shown("string s\n", "02000000ff00"), "{\"s\":\"\ufffd\"}") << "what is not UTF-8";
}

TEST(MessageLayout, ShowsArraysAndTheBeginOfLongOnes) {
  const std::string pair = "uint8[2] pair\nuint16[] many\nbool[<=3] some\n";
  EXPECT_EQ(shown(pair,
                  "0102000003000000"
                  "040005000600"
                  "0000"
                  "00000000"),
            R"({"pair":[1,2],"many":[4,5,6],"some":[]})");
  EXPECT_EQ(shown(pair,
                  "0102000003000000"
                  "040005000600"
                  "0000"
                  "00000000",
                  2),
            R"({"pair":[1,2],"many":[4,5,"..."],"some":[]})");
}

TEST(MessageLayout, ShowsPartsInTheirOrder) {
  const std::string definition =
      "# a comment\nuint8 LEAST=1\nPart part  # of the same package\nother/Part[] "
      "others\nNothing nothing\n" +
      next_type + "own/Part\nuint16 number 7\n" + next_type + "other/Part\nstring name\n" + next_type +
      "own/Nothing\nuint8 ONE=1\n";
  EXPECT_EQ(shown(definition,
                  "0500"
                  "0000"
                  "01000000"
                  "02000000"
                  "6100"
                  "00"),
            R"({"part":{"number":5},"others":[{"name":"a"}],"nothing":{}})");
}

TEST(MessageLayout, RefusesDefinitionsThatCannotMeanAMessage) {
  EXPECT_EQ(shown("Part part\n", ""), "refused: the definition lacks own/Part");
  EXPECT_EQ(shown("Own own\n", ""), "refused: own/Own has itself as a part");
  EXPECT_EQ(shown("time at\n", ""), "refused: time is no type of ROS 2");
  EXPECT_EQ(shown("uint8[0] none\n", ""), "refused: '[0]' is no length of an array");
  EXPECT_EQ(shown("uint8[x] none\n", ""), "refused: '[x]' is no length of an array");
  std::string deep = "P0 p\n";
  for (int i = 0; i < 100; ++i)
    deep += next_type + "own/P" + std::to_string(i) + "\nP" + std::to_string(i + 1) + " p\n";
  EXPECT_TRUE(shown(deep, "").ends_with("is too deep inside"));
}

TEST(MessageLayout, RefusesWhatIsNoSuchMessage) {
  EXPECT_EQ(shown("uint32 x\n", "010203"), "none");
  EXPECT_EQ(shown("string s\n", "ffffffff61"), "none");
  EXPECT_EQ(shown("wstring s\n", "ffffffff61000000"), "none");
  EXPECT_EQ(shown("uint8[] s\n", "ffffffff61"), "none");
  EXPECT_EQ(shown("uint8[18446744073709551615] s\n", "61"), "none");
  EXPECT_EQ(shown("uint8 x\n", "01", 8, "00060000"), "none") << "XCDR2";
  EXPECT_EQ(shown("uint8 x\n", "", 8, "00"), "none");
}

TEST(MessageLayout, OfThisProjectsMessagesIsWhole) {
  const std::vector<std::filesystem::path> folders{SRFS_SOURCE_DIR "/msgs",
                                                   SRFS_SOURCE_DIR "/msgs/interfaces"};
  std::size_t count = 0;
  for (const auto& folder : folders) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
      if (entry.path().extension() != ".msg") continue;
      const std::filesystem::path package = entry.path().parent_path().parent_path().filename();
      const std::string type = package.string() + "/msg/" + entry.path().stem().string();
      const auto definition = message_definition(type, folders);
      ASSERT_TRUE(definition) << type;
      EXPECT_TRUE(MessageLayout::parse(type, *definition)) << type;
      ++count;
    }
  }
  EXPECT_GT(count, 30U);
}

}  // namespace
}  // namespace srfs::mcap
