// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/ring/membership.hpp"

#include <cstdlib>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/file.hpp"

namespace srfs::suite {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

class RingMembership : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (std::filesystem::temp_directory_path() / "srfs_membership_XXXXXX").string();
    var_.root = mkdtemp(pattern.data());
    const auto file = var_.root / "d.yaml";
    ASSERT_TRUE(write_file_atomically(file,
                                      "deployment: t\nring: {members: [a, b, c]}\nnodes:\n"
                                      "  - {name: a, executable: x}\n  - {name: b, executable: x}\n"
                                      "  - {name: c, executable: x}\n"));
    deployment_ = std::make_unique<Deployment>(Deployment::load(file));
  }
  void TearDown() override { std::filesystem::remove_all(var_.root); }
  void put(const std::string& text) const { ASSERT_TRUE(write_file_atomically(membership_file(var_), text)); }
  [[nodiscard]] MembershipReading read() const { return read_membership(var_, *deployment_); }

  VarPaths var_;
  std::unique_ptr<Deployment> deployment_;
};

TEST_F(RingMembership, IsTheDeploymentsAsGenerationOneWithoutAFile) {
  const auto reading = read();
  EXPECT_EQ(reading.membership, (Membership{1, {"a", "b", "c"}}));
  EXPECT_THAT(reading.problems, IsEmpty());
}

TEST_F(RingMembership, IsReadAsItWasWritten) {
  const Membership written{7, {"c", "a"}};
  ASSERT_TRUE(write_membership(var_, written));
  const auto reading = read();
  EXPECT_EQ(reading.membership, written);
  EXPECT_THAT(reading.problems, IsEmpty());
}

TEST_F(RingMembership, OfADamagedFileIsTheDeploymentsAndTheFileStays) {
  const std::string good = to_text({7, {"c", "a"}});
  // Flip one bit at each place, or remove any part.
  for (std::size_t i = 0; i < good.size(); ++i) {
    std::string flipped = good;
    flipped[i] = static_cast<char>(flipped[i] ^ 4);
    EXPECT_FALSE(membership_from_text(flipped)) << i;
    EXPECT_FALSE(membership_from_text(good.substr(0, i))) << i;
  }
  std::string damaged = good;
  damaged[30] = '#';
  put(damaged);

  const auto reading = read();

  EXPECT_EQ(reading.membership, (Membership{1, {"a", "b", "c"}}));
  EXPECT_THAT(reading.problems, ElementsAre(HasSubstr("wrong checksum")));
  EXPECT_EQ(read_file(membership_file(var_)).value(), damaged);
}

TEST_F(RingMembership, OfAHugeFileIsTheDeployments) {
  put(std::string(100'000, 'x'));
  EXPECT_EQ(read().membership.generation, 1U);
  EXPECT_THAT(read().problems, SizeIs(1));
}

TEST_F(RingMembership, LeavesStrangersOut) {
  put(to_text({3, {"a", "nobody", "c"}}));
  const auto reading = read();
  EXPECT_EQ(reading.membership, (Membership{3, {"a", "c"}}));
  EXPECT_THAT(reading.problems, ElementsAre(HasSubstr("'nobody' is not a node of the deployment")));
}

TEST_F(RingMembership, CountsTheFirstPlaceOfADuplicate) {
  put(to_text({3, {"b", "a", "b", "c"}}));
  const auto reading = read();
  EXPECT_EQ(reading.membership, (Membership{3, {"b", "a", "c"}}));
  EXPECT_THAT(reading.problems, ElementsAre(HasSubstr("'b' appears twice")));
}

TEST_F(RingMembership, MayHaveOneMemberOrNone) {
  put(to_text({4, {"b"}}));
  EXPECT_EQ(read().membership, (Membership{4, {"b"}}));
  put(to_text({5, {}}));
  EXPECT_EQ(read().membership, (Membership{5, {}}));
  EXPECT_THAT(read().problems, IsEmpty());
}

TEST_F(RingMembership, IsBounded) {
  EXPECT_TRUE(membership_from_text(to_text({1, std::vector<std::string>(Membership::most_members, "a")})));
  EXPECT_FALSE(
      membership_from_text(to_text({1, std::vector<std::string>(Membership::most_members + 1, "a")})));
}

TEST(CrcOfARingMembership, IsThatOfTheRfc) {
  // The last line of the file is the CRC-32C of all lines before. Another polynomial would void old files.
  EXPECT_THAT(to_text({1, {"a"}}), testing::EndsWith("crc32c c9c12dca\n"));
}

}  // namespace
}  // namespace srfs::suite
