// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "update/scrubber.hpp"

#include <cstring>
#include <fstream>

#include <elf.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "base/file.hpp"
#include "tests/temporary_folder.hpp"
#include "update/build_id.hpp"

namespace srfs::update {
namespace {

using std::filesystem::path;
using testing::HasSubstr;
using testing::IsEmpty;
using What = ScrubFinding::What;

const UtcTime now(seconds(1'800'000'000));

/// An ELF file with only a build id and content.
std::string program(char build, const std::string& content) {
  Elf64_Ehdr header{};
  std::memcpy(header.e_ident, ELFMAG, SELFMAG);
  header.e_ident[EI_CLASS] = ELFCLASS64;
  header.e_phoff = sizeof header;
  header.e_phnum = 1;
  Elf64_Phdr part{};
  part.p_type = PT_NOTE;
  part.p_offset = sizeof header + sizeof part;
  Elf64_Nhdr note{4, 20, NT_GNU_BUILD_ID};
  part.p_filesz = sizeof note + 4 + 20;
  std::string text(reinterpret_cast<const char*>(&header), sizeof header);
  text.append(reinterpret_cast<const char*>(&part), sizeof part);
  text.append(reinterpret_cast<const char*>(&note), sizeof note);
  return text + std::string("GNU\0", 4) + std::string(20, build) + content;
}
constexpr std::size_t place_of_build_id = sizeof(Elf64_Ehdr) + sizeof(Elf64_Phdr) + sizeof(Elf64_Nhdr) + 4;

class ScrubberTest : public testing::Test {
 protected:
  void SetUp() override {
    write("bin/node", program('1', std::string(5000, 'n')), 0755);
    write("lib/base.so", program('2', std::string(3000, 'b')), 0644);
    write("versions/node.1", "a script, say", 0555);
    write("keys/uplink", std::string(64, 'k'), 0600);
    write("sim.yaml", "deployment: sim", 0644);
  }
  [[nodiscard]] path at(const std::string& name) const { return folder_.path() / name; }
  [[nodiscard]] std::string text(const std::string& name) const {
    return read_file(at(name)).value_or("(none)");
  }
  /// Writes a file with a unique modification time, at least one hour ago.
  void write(const std::string& name, const std::string& content, mode_t mode) {
    std::filesystem::create_directories(at(name).parent_path());
    std::filesystem::remove(at(name));
    std::ofstream(at(name)) << content;
    ASSERT_EQ(chmod(at(name).c_str(), mode), 0);
    touch(name, 3600 + ++writes_);
  }
  void touch(const std::string& name, int age_s) const {
    const timespec time{1'800'000'000 - age_s, 77};
    const timespec times[] = {time, time};
    ASSERT_EQ(utimensat(AT_FDCWD, at(name).c_str(), times, 0), 0);
  }
  /// Changes one octet without a write access, as when the medium decays.
  void rot(const path& file, std::size_t place) const {
    struct stat status {};
    ASSERT_EQ(stat(file.c_str(), &status), 0);
    ASSERT_EQ(chmod(file.c_str(), 0600), 0);
    std::fstream stream(file, std::ios::in | std::ios::out | std::ios::binary);
    stream.seekg(static_cast<std::streamoff>(place));
    const char octet = static_cast<char>(stream.get());
    stream.seekp(static_cast<std::streamoff>(place));
    stream.put(static_cast<char>(octet ^ 4));
    stream.close();
    const timespec times[] = {status.st_mtim, status.st_mtim};
    ASSERT_EQ(utimensat(AT_FDCWD, file.c_str(), times, 0), 0);
    ASSERT_EQ(chmod(file.c_str(), status.st_mode & 07777), 0);
  }
  [[nodiscard]] path copy_of(const std::string& name) const { return at("golden") / digest(name); }
  [[nodiscard]] std::string digest(const std::string& name) const {
    const std::string content = text(name);
    return to_digits(sha256_of({reinterpret_cast<const std::uint8_t*>(content.data()), content.size()}));
  }

  std::vector<ScrubFinding> round(ScrubMode mode = ScrubMode::watch) {
    std::vector<ScrubFile> files{{at("bin/node"), ScrubKind::program, {}},
                                 {at("lib/base.so"), ScrubKind::program, {}},
                                 {at("keys/uplink"), ScrubKind::text, {}},
                                 {at("sim.yaml"), ScrubKind::text, {}}};
    if (has_version_) files.push_back({at("versions/node.1"), ScrubKind::version, version_sha_});
    scrubber_->begin(std::move(files), mode, now);
    while (scrubber_->step(now)) ++steps_;
    return scrubber_->take_findings();
  }
  void restart() { scrubber_ = std::make_unique<Scrubber>(settings()); }
  [[nodiscard]] Scrubber::Settings settings() const {
    return {at("golden"), 1000, std::chrono::minutes(2), 0};
  }
  [[nodiscard]] const ScrubStatus& status() const { return scrubber_->status(); }
  static std::vector<What> kinds(const std::vector<ScrubFinding>& findings) {
    std::vector<What> all;
    for (const auto& finding : findings) all.push_back(finding.what);
    return all;
  }

  testing_support::TemporaryFolder folder_;
  int writes_ = 0;
  std::size_t steps_ = 0;
  bool has_version_ = true;
  const std::string version_sha_ = to_digits(
      sha256_of({reinterpret_cast<const std::uint8_t*>("a script, say"), std::strlen("a script, say")}));
  std::unique_ptr<Scrubber> scrubber_ = std::make_unique<Scrubber>(settings());
};

const std::vector<std::string> every_kind{"bin/node", "lib/base.so", "versions/node.1", "keys/uplink",
                                          "sim.yaml"};

TEST_F(ScrubberTest, TakesWhatItFindsFirstAndThenFindsAllWell) {
  EXPECT_THAT(round(ScrubMode::start), IsEmpty());
  EXPECT_EQ(status().files, 5U);
  EXPECT_EQ(status().taken, 5U);
  EXPECT_EQ(status().checked, 5U);
  EXPECT_EQ(status().build.size(), 16U);
  EXPECT_EQ(std::filesystem::status(at("golden")).permissions(), std::filesystem::perms::owner_all);
  EXPECT_GT(steps_, 20U) << "in slices";
  EXPECT_THAT(round(), IsEmpty());
  restart();
  EXPECT_THAT(round(ScrubMode::start), IsEmpty());
  EXPECT_EQ(status().taken, 0U);
  EXPECT_EQ(status().rounds, 1U);
}

TEST_F(ScrubberTest, MendsADamagedOctetOfEveryKindOfFileAsItWas) {
  (void)round(ScrubMode::start);
  for (const ScrubMode mode : {ScrubMode::watch, ScrubMode::start}) {
    for (const std::string& name : every_kind) {
      const std::string before = text(name);
      struct stat was {};
      ASSERT_EQ(stat(at(name).c_str(), &was), 0);
      rot(at(name), before.size() - 3);
      ASSERT_NE(text(name), before);
      const auto findings = round(mode);
      EXPECT_THAT(kinds(findings), testing::ElementsAre(What::damaged, What::mended)) << name;
      EXPECT_EQ(findings.front().path, at(name).string());
      EXPECT_EQ(text(name), before);
      struct stat is {};
      ASSERT_EQ(stat(at(name).c_str(), &is), 0);
      EXPECT_EQ(is.st_mode, was.st_mode);
      EXPECT_EQ(is.st_mtim.tv_nsec, was.st_mtim.tv_nsec);
      EXPECT_THAT(round(mode), IsEmpty());
    }
  }
  EXPECT_EQ(status().mended, 2 * every_kind.size());
  EXPECT_THAT(status().last_damaged, HasSubstr("sim.yaml"));
}

TEST_F(ScrubberTest, MendsWhatIsGoneAndWhatIsEmpty) {
  (void)round(ScrubMode::start);
  for (const std::string& name : every_kind) {
    const std::string before = text(name);
    std::filesystem::remove(at(name));
    EXPECT_THAT(kinds(round()), testing::ElementsAre(What::damaged, What::mended)) << name;
    EXPECT_EQ(text(name), before);
    std::filesystem::permissions(at(name), std::filesystem::perms::owner_all);
    std::ofstream(at(name), std::ios::trunc);
    touch(name, 300);
    EXPECT_THAT(kinds(round()), testing::ElementsAre(What::damaged, What::mended)) << name;
    EXPECT_EQ(text(name), before);
  }
}

TEST_F(ScrubberTest, MendsADamagedOrMissingCopyFromTheFile) {
  (void)round(ScrubMode::start);
  for (const std::string& name : every_kind) {
    rot(copy_of(name), 2);
    const auto findings = round();
    EXPECT_THAT(kinds(findings), testing::ElementsAre(What::damaged, What::mended)) << name;
    EXPECT_THAT(findings.front().why, HasSubstr("copy"));
    std::filesystem::remove(copy_of(name));
    EXPECT_THAT(kinds(round()), testing::ElementsAre(What::damaged, What::mended)) << name;
    EXPECT_THAT(round(), IsEmpty());
  }
}

TEST_F(ScrubberTest, ReportsAndLeavesWhatIsDamagedInBothPlaces) {
  (void)round(ScrubMode::start);
  for (const std::string& name : every_kind) {
    rot(copy_of(name), 1);
    rot(at(name), text(name).size() - 1);
  }
  const auto damaged = text("bin/node");
  const auto findings = round();
  EXPECT_EQ(status().lost, every_kind.size());
  EXPECT_EQ(status().mended, 0U);
  ASSERT_EQ(findings.size(), 2 * every_kind.size());
  EXPECT_EQ(findings[1].what, What::left);
  EXPECT_EQ(text("bin/node"), damaged);
  restart();
  (void)round(ScrubMode::start);
  EXPECT_EQ(status().lost, every_kind.size()) << "a start does not make it good";
  EXPECT_EQ(text("bin/node"), damaged);
}

TEST_F(ScrubberTest, LeavesAnotherBuildAsItIsAndTakesItAtTheNextStart) {
  (void)round(ScrubMode::start);
  const std::string build = status().build;
  const std::string installed = program('7', std::string(5100, 'N'));
  write("bin/node", installed, 0755);
  std::filesystem::remove(at("lib/base.so"));
  const auto findings = round();
  EXPECT_THAT(kinds(findings), testing::ElementsAre(What::left, What::left));
  EXPECT_EQ(text("bin/node"), installed);
  EXPECT_FALSE(std::filesystem::exists(at("lib/base.so"))) << "an old file among new ones";
  EXPECT_EQ(status().unmended, 2U);
  EXPECT_EQ(status().damaged, 0U);

  write("lib/base.so", program('8', "new"), 0644);
  write("sim.yaml", "deployment: sim # new", 0644);
  restart();
  EXPECT_THAT(round(ScrubMode::start), IsEmpty());
  EXPECT_EQ(status().taken, 3U);
  EXPECT_NE(status().build, build);
  const std::size_t copies = static_cast<std::size_t>(std::distance(
      std::filesystem::directory_iterator(at("golden")), std::filesystem::directory_iterator()));
  EXPECT_EQ(copies, 5U + 2U) << "those of the old build are gone";
  rot(at("bin/node"), 4000);
  EXPECT_THAT(kinds(round()), testing::ElementsAre(What::damaged, What::mended));
  EXPECT_EQ(text("bin/node"), installed);
}

TEST_F(ScrubberTest, DamageInTheBuildIdItselfIsNoOtherBuild) {
  (void)round(ScrubMode::start);
  rot(at("bin/node"), place_of_build_id + 5);
  EXPECT_THAT(kinds(round(ScrubMode::start)), testing::ElementsAre(What::damaged, What::mended));
}

TEST_F(ScrubberTest, LeavesATextThatSomebodyWroteUntilTheNextStartOrTheCommand) {
  (void)round(ScrubMode::start);
  write("keys/uplink", std::string(64, 'K'), 0600);
  const auto findings = round();
  EXPECT_THAT(kinds(findings), testing::ElementsAre(What::left));
  EXPECT_THAT(findings.front().why, HasSubstr("on purpose"));
  EXPECT_EQ(text("keys/uplink"), std::string(64, 'K'));
  EXPECT_THAT(round(ScrubMode::retake), IsEmpty());
  EXPECT_EQ(status().taken, 1U);
  rot(at("keys/uplink"), 7);
  EXPECT_THAT(kinds(round()), testing::ElementsAre(What::damaged, What::mended));
  EXPECT_EQ(text("keys/uplink"), std::string(64, 'K'));

  write("sim.yaml", "deployment: other", 0644);
  restart();
  EXPECT_THAT(round(ScrubMode::start), IsEmpty());
  EXPECT_EQ(text("sim.yaml"), "deployment: other");
}

TEST_F(ScrubberTest, WaitsUntilAFileHasSettled) {
  (void)round(ScrubMode::start);
  std::filesystem::permissions(at("bin/node"), std::filesystem::perms::owner_all);
  std::ofstream(at("bin/node"), std::ios::trunc) << "half of";
  touch("bin/node", 60);
  EXPECT_THAT(round(), IsEmpty());
  EXPECT_EQ(text("bin/node"), "half of");
  touch("bin/node", 121);
  EXPECT_THAT(kinds(round()), testing::ElementsAre(What::damaged, What::mended));
}

TEST_F(ScrubberTest, GivesUpVersionsThatAreNoMoreAndNeverTakesADamagedOne) {
  (void)round(ScrubMode::start);
  has_version_ = false;
  EXPECT_THAT(round(), IsEmpty());
  EXPECT_FALSE(std::filesystem::exists(copy_of("versions/node.1")));
  has_version_ = true;
  rot(at("versions/node.1"), 3);
  EXPECT_THAT(kinds(round()), testing::ElementsAre(What::left));
  EXPECT_EQ(status().lost, 1U);
  EXPECT_THAT(kinds(round(ScrubMode::retake)), testing::ElementsAre(What::left));
}

TEST_F(ScrubberTest, OneGoodManifestIsEnoughAndMendsTheOther) {
  (void)round(ScrubMode::start);
  for (const char* copy : {"golden/manifest_a", "golden/manifest_b"}) {
    rot(at(copy), 30);
    rot(at("keys/uplink"), 1);
    restart();
    const auto findings = round(ScrubMode::start);
    EXPECT_THAT(kinds(findings),
                testing::ElementsAre(What::damaged, What::damaged, What::mended, What::mended));
    EXPECT_EQ(text("keys/uplink"), std::string(64, 'k'));
    EXPECT_TRUE(decode_golden(text(copy)));
  }
  rot(at("golden/manifest_a"), 30);
  rot(at("golden/manifest_b"), 30);
  restart();
  EXPECT_THAT(kinds(round(ScrubMode::start)), testing::ElementsAre(What::damaged, What::damaged, What::left));
  EXPECT_EQ(status().taken, 5U);
}

TEST_F(ScrubberTest, SaysWhenTheMediumTakesNoMendedFile) {
  (void)round(ScrubMode::start);
  rot(at("bin/node"), 300);
  std::filesystem::create_directory(at("bin/node.mend"));  // blocks the repair, even for root
  EXPECT_THAT(kinds(round()), testing::ElementsAre(What::damaged, What::left));
  EXPECT_EQ(status().unmended, 1U);
  std::filesystem::remove(at("bin/node.mend"));
  EXPECT_THAT(kinds(round()), testing::ElementsAre(What::damaged, What::mended));
}

TEST_F(ScrubberTest, ARoundThatIsCutOffAnywhereLeavesNothingHalfDone) {
  for (std::size_t cut = 0; cut < 60; ++cut) {
    if (cut % 3 == 0) std::filesystem::remove_all(at("golden"));
    restart();
    scrubber_->begin({{at("bin/node"), ScrubKind::program, {}}, {at("keys/uplink"), ScrubKind::text, {}}},
                     ScrubMode::start, now);
    for (std::size_t i = 0; i < cut; ++i) (void)scrubber_->step(now);
    restart();
    const bool was_taken = decode_golden(text("golden/manifest_a")).has_value();
    if (was_taken) rot(at("bin/node"), 2000);
    EXPECT_THAT(round(ScrubMode::start), testing::SizeIs(was_taken ? 2 : 0)) << cut;
    EXPECT_EQ(text("bin/node"), program('1', std::string(5000, 'n'))) << cut;
  }
}

TEST(GoldenManifestTest, IsReadAsWrittenAndNotWithADamagedOctet) {
  GoldenManifest manifest;
  manifest.revision = 3;
  manifest.put({"/b", ScrubKind::program, std::string(64, 'a'), 12, -5, 0755, "0011"});
  manifest.put({"/a", ScrubKind::text, std::string(64, 'b'), 0, 7, 0600, ""});
  const std::string text = encode(manifest);
  EXPECT_EQ(decode_golden(text), manifest);
  EXPECT_EQ(manifest.files.front().path, "/a");
  for (std::size_t i = 0; i < text.size(); ++i) {
    std::string damaged = text;
    damaged[i] = static_cast<char>(damaged[i] ^ 1);
    EXPECT_FALSE(decode_golden(damaged)) << i;
    EXPECT_FALSE(decode_golden(text.substr(0, i))) << i;
  }
}

TEST(BuildIdTest, IsThatOfThisProgramAndOfNothingElse) {
  EXPECT_EQ(build_id_of("/proc/self/exe").size(), 40U);
  EXPECT_EQ(build_id_of("/proc/self/status"), "");
  EXPECT_EQ(build_id_of("/nowhere"), "");
  const std::string one(40, '1');
  std::string near = one;
  near[3] = 'f';
  EXPECT_FALSE(is_another_build(one, one));
  EXPECT_FALSE(is_another_build(one, near));
  EXPECT_FALSE(is_another_build(one, ""));
  EXPECT_TRUE(is_another_build(one, std::string(40, '2')));
}

}  // namespace
}  // namespace srfs::update
