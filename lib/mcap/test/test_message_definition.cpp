// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "base/file.hpp"
#include "mcap/message_definition.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::mcap {
namespace {

const std::string line(80, '=');

TEST(MessageDefinition, HasEachTypeThatIsUsedOnce) {
  const testing_support::TemporaryFolder folder;
  const auto write = [&](const std::string& file, const std::string& text) {
    ASSERT_TRUE(write_file_atomically(folder.path() / file, text));
  };
  write("a/msg/Top.msg",
        "uint8 ONE=1\nstring<=32 name  # of it\nb/Part[<=4] parts\nOwn own\nb/Part one\nfloat64[3] x");
  write("a/msg/Own.msg", "builtin_interfaces/Time at\n");
  write("b/msg/Part.msg", "bool[] flags\n");
  write("builtin_interfaces/msg/Time.msg", "int32 sec\nuint32 nanosec\n");
  EXPECT_EQ(message_definition("a/msg/Top", {folder.path() / "elsewhere", folder.path()}),
            "uint8 ONE=1\nstring<=32 name  # of it\nb/Part[<=4] parts\nOwn own\nb/Part one\nfloat64[3] x\n" +
                line + "\nMSG: b/Part\nbool[] flags\n" + line + "\nMSG: a/Own\nbuiltin_interfaces/Time at\n" +
                line + "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n");
}

TEST(MessageDefinition, IsNoneWhereAFileIsMissingOrTheNameIsNone) {
  const testing_support::TemporaryFolder folder;
  ASSERT_TRUE(write_file_atomically(folder.path() / "a/msg/A.msg", "b/B b\n"));
  EXPECT_FALSE(message_definition("a/msg/A", {folder.path()}));
  EXPECT_FALSE(message_definition("a/msg/None", {folder.path()}));
  EXPECT_FALSE(message_definition("a/srv/A_Request", {folder.path()}));
  EXPECT_FALSE(message_definition("../a/msg/A", {folder.path()}));
}

TEST(MessageDefinition, OfThisProjectsMessagesIsThere) {
  const std::vector<std::filesystem::path> folders{SRFS_SOURCE_DIR "/msgs",
                                                   SRFS_SOURCE_DIR "/msgs/interfaces"};
  const auto event = message_definition("srfs_msgs/msg/Event", folders);
  ASSERT_TRUE(event);
  EXPECT_NE(event->find("MSG: builtin_interfaces/Time"), std::string::npos);
}

}  // namespace
}  // namespace srfs::mcap
