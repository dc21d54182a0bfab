// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/dictionary_cache.hpp"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/file.hpp"
#include "ground/dictionary_json.hpp"
#include "msgs/mission/dictionary_image.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::ground {
namespace {

const std::filesystem::path mission_folder = std::string(SRFS_SOURCE_DIR) + "/mission";

constexpr const char* fragment_text = R"(
apids:
  - { name: comet, apid: 60, node: comet }
events:
  - { name: comet.seen, id: 7000, severity: low, text: "seen", fields: [] }
)";

class Cache : public ::testing::Test {
 protected:
  DictionaryCache cache(const std::vector<mission::Fragment>& fragments = {}) const {
    return {file_, copy_, fragments};
  }
  void SetUp() override {
    std::filesystem::copy(mission_folder, copy_, std::filesystem::copy_options::recursive);
  }
  testing_support::TemporaryFolder folder_;
  std::filesystem::path copy_ = folder_.path() / "mission";
  std::filesystem::path file_ = folder_.path() / "dictionary.cache";
};

TEST(DictionaryImage, IsReadAsTheDictionaryThatItWasMadeOf) {
  auto dictionary = mission::Dictionary::load(mission_folder);
  const Octets image = mission::image_of(dictionary);

  auto read = mission::dictionary_of(image);

  ASSERT_TRUE(read);
  EXPECT_EQ(to_json(*read), to_json(dictionary));
  EXPECT_EQ(read->monitors(), dictionary.monitors());
  EXPECT_EQ(read->event_actions(), dictionary.event_actions());
  EXPECT_EQ(read->nodes(), dictionary.nodes());
  EXPECT_EQ(mission::image_of(*read), image);
  const auto moved = std::move(*read);
  EXPECT_TRUE(moved.encode("eps.switch_load", {"load=2", "state=on"})) << "enumerations are its own";
}

TEST(DictionaryImage, ThatIsCutOrLongerIsNone) {
  auto dictionary = mission::Dictionary::load(mission_folder);
  Octets image = mission::image_of(dictionary);
  for (std::size_t size = 0; size < image.size(); size += 1 + size / 7)
    EXPECT_FALSE(mission::dictionary_of(OctetView(image).first(size))) << size;
  image.push_back(0);
  EXPECT_FALSE(mission::dictionary_of(image));
}

TEST_F(Cache, HasTheDictionaryOfTheNextStart) {
  auto dictionary = mission::Dictionary::load(copy_);
  EXPECT_FALSE(cache().load());
  cache().keep(dictionary);

  const auto kept = cache().load();

  ASSERT_TRUE(kept);
  EXPECT_EQ(to_json(*kept), to_json(dictionary));
}

TEST_F(Cache, OfOtherSourcesIsNotUsed) {
  auto dictionary = mission::Dictionary::load(copy_);
  cache().keep(dictionary);
  EXPECT_FALSE(cache({{"comet", fragment_text}}).load()) << "a fragment came";
  std::ofstream(copy_ / "mission.yaml", std::ios::app) << "# one comment more\n";
  EXPECT_FALSE(cache().load()) << "a file was changed";
}

TEST_F(Cache, HasTheFragmentsOfAddedNodes) {
  const std::vector<mission::Fragment> fragments{{"comet", fragment_text}};
  auto dictionary = mission::Dictionary::load(copy_, fragments);
  cache(fragments).keep(dictionary);

  const auto kept = cache(fragments).load();

  ASSERT_TRUE(kept);
  EXPECT_NE(kept->event("comet.seen"), nullptr);
  EXPECT_FALSE(cache().load()) << "without the fragment it is another dictionary";
}

TEST_F(Cache, ThatIsDamagedIsNotUsed) {
  auto dictionary = mission::Dictionary::load(copy_);
  cache().keep(dictionary);
  const std::string whole = *read_file(file_);
  for (std::size_t at = 0; at < whole.size(); at += 997) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    std::ofstream(file_, std::ios::binary | std::ios::trunc) << damaged;
    EXPECT_FALSE(cache().load()) << at;
  }
  std::ofstream(file_, std::ios::binary | std::ios::trunc) << whole.substr(0, whole.size() / 2);
  EXPECT_FALSE(cache().load());
}

TEST_F(Cache, WithoutAFolderIsNone) {
  auto dictionary = mission::Dictionary::load(copy_);
  const DictionaryCache nowhere(folder_.path() / "none/dictionary.cache", copy_, {});
  nowhere.keep(dictionary);
  EXPECT_FALSE(nowhere.load());
}

}  // namespace
}  // namespace srfs::ground
