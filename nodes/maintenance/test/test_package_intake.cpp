// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/package_intake.hpp"

#include <filesystem>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <mission/structures.hpp>

#include "base/file.hpp"
#include "base/sha256.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

using testing::HasSubstr;

const std::string source = "int main() {}\n";

struct PackageIntakeTest : testing::Test {
  testing_support::TemporaryFolder folder;
  update::SigningSeed seed{1, 2, 3};
  IntakeRules rules{folder.path() / "files", folder.path() / "package.pub", {"payload_eps", "ttc"}, {}};
  LaneFolders folders{
      "srfs-lane", "/opt/srfs", folder.path() / "update" / "job", folder.path() / "update" / "lane", {}};
  update::UpdateJournal journal;

  PackageIntakeTest() {
    std::string digits;
    for (const std::uint8_t octet : update::public_key_of(seed)) digits += fmt::format("{:02x}", octet);
    EXPECT_TRUE(write_file_atomically(rules.public_key, digits + "\n"));
  }
  static update::Manifest manifest() {
    update::Manifest m;
    m.node = "payload_eps";
    m.counter = 3;
    m.files = {{"main.cpp", source.size(), to_digits(sha256_of(Octets(source.begin(), source.end())))}};
    m.options = {"-O2"};
    return m;
  }
  void put(const std::string& name, const update::Manifest& m) const {
    const Octets package = update::make_package(encode(m), {Octets(source.begin(), source.end())}, seed);
    EXPECT_TRUE(write_file_atomically(rules.files / name,
                                      {reinterpret_cast<const char*>(package.data()), package.size()}));
  }
  [[nodiscard]] auto take_in(const std::string& name) const {
    return take_in_package(rules, name, journal, folders);
  }
};

TEST_F(PackageIntakeTest, a_good_package_is_unpacked_into_a_work_folder_made_anew) {
  put("packages/eps.pkg", manifest());
  std::filesystem::create_directories(folders.work / "left over");
  const auto intake = take_in("packages/eps.pkg");
  ASSERT_TRUE(intake) << intake.error().reason;
  EXPECT_EQ(intake->update.node, "payload_eps");
  EXPECT_EQ(intake->update.counter, 3U);
  EXPECT_EQ(*read_file(folders.sources() / "main.cpp"), source);
  EXPECT_TRUE(std::filesystem::is_directory(folders.lane));
  EXPECT_FALSE(std::filesystem::exists(folders.work / "left over"));
}

TEST_F(PackageIntakeTest, a_package_cannot_shorten_the_time_in_which_the_operator_has_to_confirm_it) {
  update::Manifest m = manifest();
  m.probation = seconds(60);
  put("eps.pkg", m);
  EXPECT_EQ(take_in("eps.pkg")->update.probation, seconds(60));
  rules.ring.confirmed = {"payload_eps"};
  EXPECT_EQ(take_in("eps.pkg")->update.probation, update::VersionTable::default_confirmed_probation);
}

TEST_F(PackageIntakeTest, a_name_that_leads_elsewhere_is_not_found) {
  put("eps.pkg", manifest());
  std::filesystem::create_symlink(rules.files / "eps.pkg", rules.files / "link.pkg");
  std::filesystem::create_directory(rules.files / "folder");
  for (const char* name : {"", "nothing.pkg", "../package.pub", "/etc/passwd", "link.pkg", "folder"}) {
    const auto intake = take_in(name);
    ASSERT_FALSE(intake) << name;
    EXPECT_EQ(intake.error().code, mission::failure::package_not_found)
        << name << ": " << intake.error().reason;
  }
}

TEST_F(PackageIntakeTest,
       a_package_that_cannot_be_verified_is_refused_with_the_reason_and_nothing_is_unpacked) {
  EXPECT_TRUE(write_file_atomically(rules.files / "text", "no package"));
  auto intake = take_in("text");
  ASSERT_FALSE(intake);
  EXPECT_EQ(intake.error().code, mission::failure::package_refused);
  EXPECT_THAT(intake.error().reason, HasSubstr(to_text(update::PackageRefusal::cut_off)));
  seed = {9};
  put("other_key", manifest());
  EXPECT_FALSE(take_in("other_key"));
  EXPECT_TRUE(write_file_atomically(rules.public_key, "no key"));
  intake = take_in("other_key");
  ASSERT_FALSE(intake);
  EXPECT_THAT(intake.error().reason, HasSubstr("64 hexadecimal digits"));
  EXPECT_FALSE(std::filesystem::exists(folders.sources()));
}

TEST_F(PackageIntakeTest, the_kind_has_to_fit_the_suite) {
  auto m = manifest();
  m.node = "payload_impact";
  put("p", m);
  auto intake = take_in("p");
  ASSERT_FALSE(intake);
  EXPECT_THAT(intake.error().reason, HasSubstr("no node 'payload_impact' to replace"));
  m = manifest();
  m.kind = update::PackageKind::add;
  m.deployment = R"({"name": "payload_eps"})";
  put("p", m);
  intake = take_in("p");
  ASSERT_FALSE(intake);
  EXPECT_THAT(intake.error().reason, HasSubstr("already"));
}

TEST_F(PackageIntakeTest, an_old_counter_is_refused_but_the_last_package_itself_may_come_again) {
  put("p", manifest());
  const auto first = take_in("p");
  ASSERT_TRUE(first);
  ASSERT_TRUE(journal.begin(first->update));
  EXPECT_TRUE(take_in("p"));
  auto m = manifest();
  m.probation = seconds(7);  // another package with the same counter
  put("q", m);
  const auto second = take_in("q");
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error().reason, HasSubstr(to_text(update::PackageRefusal::old_counter)));
}

}  // namespace
}  // namespace srfs
