// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/product/star_list.hpp"

#include <gmock/gmock.h>

namespace srfs::image {
namespace {

using testing::HasSubstr;

TEST(StarList, GivesBackPlaceFluxAndSignificance) {
  const std::vector<ListedStar> stars{{0, 12.25, 800.5, 1e5, 300}, {255, -0.75, 8191.9, 3, 4.5}};

  const Octets list = encode_star_list(stars);
  const auto found = decode_star_list(list).value();

  EXPECT_EQ(list.size(), star_list_header_octets + 2 * listed_star_octets);
  ASSERT_EQ(found.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(found[i].frame, stars[i].frame);
    EXPECT_NEAR(found[i].x, stars[i].x, 0.001);
    EXPECT_NEAR(found[i].y, stars[i].y, 0.001);
    EXPECT_NEAR(found[i].flux / stars[i].flux, 1, 0.002);
    EXPECT_NEAR(found[i].snr, stars[i].snr, 0.05);
  }
}

TEST(StarList, HasRoomForWhatIsTooLargeToBeTrue) {
  const auto found = decode_star_list(encode_star_list({{1, 1e9, -1e9, -5, 1e9}})).value();
  EXPECT_NEAR(found[0].x, 8192, 0.01);
  EXPECT_NEAR(found[0].y, -8192, 0.01);
  EXPECT_EQ(found[0].flux, 1);
  EXPECT_NEAR(found[0].snr, 4096, 0.1);
}

TEST(StarList, SaysWhatIsWrongWithAFile) {
  Octets list = encode_star_list({{0, 1, 2, 3, 4}});
  EXPECT_THAT(decode_star_list({}).error().reason, HasSubstr("not a list of stars"));
  EXPECT_THAT(decode_star_list(OctetView(list).first(20)).error().reason, HasSubstr("truncated"));
  list.back() ^= 1;
  EXPECT_THAT(decode_star_list(list).error().reason, HasSubstr("damaged"));
  list[8] = 2;
  EXPECT_THAT(decode_star_list(list).error().reason, HasSubstr("version 2"));
}

TEST(BrightestStars, KeepsTheBrightestOfAllFramesInBoundedMemory) {
  BrightestStars brightest(3);
  for (std::uint16_t frame = 0; frame < 20; ++frame)
    brightest.add(frame, {{1, 1, 10.0 + frame, 5, 2}, {2, 2, 5.0 + frame, 4, 2}});

  const auto& stars = brightest.sorted();

  ASSERT_EQ(stars.size(), 3U);
  EXPECT_EQ(stars[0].frame, 19);
  EXPECT_EQ(stars[0].flux, 29);
  EXPECT_EQ(stars[2].flux, 27);
  EXPECT_EQ(brightest.dropped(), 37U);
}

TEST(BrightestStars, OfWhichNoneFitsAreNone) {
  BrightestStars none(0);
  none.add(0, {{1, 1, 10, 5, 2}});
  EXPECT_TRUE(none.sorted().empty());
  EXPECT_EQ(none.dropped(), 1U);
}

}  // namespace
}  // namespace srfs::image
