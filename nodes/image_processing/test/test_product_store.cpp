// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_processing/product_store.hpp"

#include <chrono>

#include <gmock/gmock.h>

#include "base/file.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

using std::filesystem::exists;

class ProductStoreTest : public testing::Test {
 protected:
  static Octets octets(std::size_t n) { return Octets(n, 0x5A); }
  [[nodiscard]] std::filesystem::path product(std::uint32_t task, const std::string& name) const {
    std::string digits = std::to_string(task);
    digits.insert(0, 10 - digits.size(), '0');
    return images_ / "products" / digits / name;
  }
  void fill(ProductStore& store, std::uint32_t task, std::size_t n) {
    store.begin(task, true);
    ASSERT_TRUE(store.put("findings.json", octets(n)));
  }

  testing_support::TemporaryFolder folder_;
  std::filesystem::path images_ = folder_.path() / "images";
};

TEST_F(ProductStoreTest, WritesProductsUnderTheirTask) {
  ProductStore store(images_, 1000);
  store.begin(17, true);
  const auto written = store.put("findings.json", octets(100));
  ASSERT_TRUE(written) << written.error().text;
  EXPECT_EQ(*written, "products/0000000017/findings.json");
  EXPECT_EQ(read_file(images_ / *written)->size(), 100U);
  EXPECT_EQ(store.octets(), 100U);
  ASSERT_TRUE(store.put("findings.json", octets(40)));
  EXPECT_EQ(store.octets(), 40U);
}

TEST_F(ProductStoreTest, TheOldestTasksMakeRoomAndNeverTheOneUnderWay) {
  ProductStore store(images_, 1000);
  fill(store, 3, 400);
  fill(store, 1, 400);
  fill(store, 2, 400);
  EXPECT_FALSE(exists(product(3, "findings.json")));
  EXPECT_TRUE(exists(product(1, "findings.json")));
  EXPECT_EQ(store.removed_tasks(), 1U);

  ASSERT_TRUE(store.put("stars.bin", octets(600)));
  EXPECT_FALSE(exists(product(1, "findings.json")));
  EXPECT_TRUE(exists(product(2, "findings.json")));
  EXPECT_EQ(store.octets(), 1000U);

  const auto refused = store.put("thumbnail.png", octets(1));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().problem, StoreProblem::quota);
  EXPECT_TRUE(exists(product(2, "stars.bin")));
}

TEST_F(ProductStoreTest, ATaskProcessedAgainReplacesItsProductsAndKeepsItsFrames) {
  ProductStore store(images_, 1000);
  store.begin(17, true);
  ASSERT_TRUE(store.put("streak_0003.png", octets(100)));
  store.begin(17, false);
  ASSERT_TRUE(store.put("frame_0001.strips", octets(200)));
  EXPECT_TRUE(exists(product(17, "streak_0003.png")));
  EXPECT_EQ(store.octets(), 300U);

  store.begin(17, true);
  EXPECT_FALSE(exists(product(17, "streak_0003.png")));
  EXPECT_TRUE(exists(product(17, "frame_0001.strips")));
  EXPECT_EQ(store.octets(), 200U);
}

TEST_F(ProductStoreTest, TakesOverWhatIsThereAndRemovesWhatIsHalfWritten) {
  {
    ProductStore store(images_, 1000);
    fill(store, 5, 300);
    fill(store, 4, 300);
  }
  ASSERT_TRUE(write_file_atomically(product(5, "stars.bin.12.tmp"), std::string(900, 'x')));
  ASSERT_TRUE(write_file_atomically(images_ / "products/notes/readme", "not a task"));
  const auto now = std::filesystem::last_write_time(product(4, "findings.json"));
  std::filesystem::last_write_time(product(5, "findings.json"), now - std::chrono::hours(1));

  ProductStore store(images_, 1000);
  EXPECT_EQ(store.octets(), 600U);
  EXPECT_FALSE(exists(product(5, "stars.bin.12.tmp")));
  fill(store, 6, 500);
  EXPECT_FALSE(exists(product(5, "findings.json")));
  EXPECT_TRUE(exists(product(4, "findings.json")));
  EXPECT_TRUE(exists(images_ / "products/notes/readme"));
}

TEST_F(ProductStoreTest, ASmallerQuotaHoldsFromTheStart) {
  {
    ProductStore store(images_, 1000);
    fill(store, 1, 300);
    fill(store, 2, 300);
  }
  const auto now = std::filesystem::last_write_time(product(2, "findings.json"));
  std::filesystem::last_write_time(product(1, "findings.json"), now - std::chrono::hours(1));
  const ProductStore store(images_, 400);
  EXPECT_EQ(store.octets(), 300U);
  EXPECT_FALSE(exists(product(1, "findings.json")));
}

TEST_F(ProductStoreTest, SaysWhatTheDiskDoesNotTake) {
  ASSERT_TRUE(write_file_atomically(images_ / "products", "a file where the folder should be"));
  ProductStore store(images_, 1000);
  store.begin(17, true);
  const auto refused = store.put("findings.json", octets(10));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().problem, StoreProblem::disk);
  EXPECT_EQ(store.octets(), 0U);
}

}  // namespace
}  // namespace srfs
