// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ground/pass/pass_finder.hpp"

namespace srfs::ground::pass {
namespace {

using ::testing::HasSubstr;

Sgp4 orbit_of(const std::string& lines) {
  return *Sgp4::of(*parse_tle(lines));
}

const std::string low_orbit =
    "1 06251U 62025E   06176.82412014  .00008885  00000-0  12808-3 0  3985\n"
    "2 06251  58.0579  54.0425 0030035 139.1568 221.1854 15.56387291  6774\n";
const std::string polar_orbit =
    "1 28057U 03049A   06177.78615833  .00000060  00000-0  35940-4 0  1836\n"
    "2 28057  98.4283 247.6961 0000884  88.1964 271.9322 14.35478080140550\n";
const UtcTime begin = *from_iso8601("2006-06-27T00:00:00Z");

SightAt sight_from(const Sgp4& orbit, const Geodetic& station) {
  return [=](UtcTime time) -> std::optional<Sight> {
    const auto state = orbit.at(time);
    if (!state) return std::nullopt;
    return sight_of(to_earth_fixed(state->position_km, time), station);
  };
}

TEST(PassFinder, FindsExactlyThePassesThatASearchSecondBySecondFinds) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> latitude(-80, 80);
  std::uniform_real_distribution<double> longitude(-180, 180);
  for (int turn = 0; turn < 6; ++turn) {
    const Geodetic station{latitude(random), longitude(random), 300};
    const double lowest = turn % 3 == 0 ? 0 : 5.0 * turn;
    const auto sight = sight_from(orbit_of(turn % 2 == 0 ? low_orbit : polar_orbit), station);
    const UtcTime end = begin + std::chrono::hours(24);

    const auto found = find_passes(sight, lowest, begin, end);

    std::vector<std::pair<UtcTime, UtcTime>> seen;
    bool above = false;
    for (UtcTime time = begin - std::chrono::minutes(30); time < end + std::chrono::minutes(30);
         time += seconds(1)) {
      const bool now = sight(time)->elevation_deg >= lowest;
      if (now && !above) seen.emplace_back(time, time);
      if (now) seen.back().second = time;
      above = now;
    }
    std::erase_if(seen, [&](const auto& pass) { return pass.second <= begin || pass.first >= end; });
    // One that lasts for less than a second may be missed second by second.
    std::vector<PassTimes> long_enough = found.passes;
    std::erase_if(long_enough, [](const PassTimes& pass) { return pass.duration() < seconds(2); });
    std::erase_if(seen, [](const auto& pass) { return pass.second - pass.first < seconds(2); });
    ASSERT_EQ(long_enough.size(), seen.size())
        << "station " << station.latitude_deg << " " << station.longitude_deg;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      EXPECT_LT(std::abs((long_enough[i].rise - seen[i].first).count()), 1'100'000'000);
      EXPECT_LT(std::abs((long_enough[i].set - seen[i].second).count()), 1'100'000'000);
    }
    EXPECT_FALSE(found.unknown_from);
  }
}

TEST(PassFinder, HasTheHighestElevationBetweenRiseAndSet) {
  const Geodetic station{47.4, 8.5, 450};
  const auto sight = sight_from(orbit_of(polar_orbit), station);
  const auto found = find_passes(sight, 10, begin, begin + std::chrono::hours(72));
  ASSERT_GT(found.passes.size(), 6U);
  for (const PassTimes& pass : found.passes) {
    EXPECT_NEAR(sight(pass.rise)->elevation_deg, 10, 0.01);
    EXPECT_NEAR(sight(pass.set)->elevation_deg, 10, 0.01);
    ASSERT_TRUE(pass.highest);
    EXPECT_LT(pass.rise, pass.highest->time);
    EXPECT_LT(pass.highest->time, pass.set);
    for (UtcTime time = pass.rise; time < pass.set; time += seconds(5))
      EXPECT_LE(sight(time)->elevation_deg, pass.highest->sight.elevation_deg + 1e-6);
  }
}

TEST(PassFinder, KeepsAPassThatIsUnderWay) {
  const auto sight = sight_from(orbit_of(polar_orbit), {47.4, 8.5, 450});
  const auto all = find_passes(sight, 10, begin, begin + std::chrono::hours(24));
  ASSERT_FALSE(all.passes.empty());
  const PassTimes& pass = all.passes.front();
  const auto later = find_passes(sight, 10, pass.set - seconds(1), begin + std::chrono::hours(24));
  ASSERT_EQ(later.passes.size(), all.passes.size());
  EXPECT_LT(std::abs((later.passes.front().rise - pass.rise).count()), 100'000'000);
}

TEST(PassFinder, SaysFromWhenTheOrbitIsNotKnown) {
  const auto sight =
      sight_from(orbit_of("1 28872U 05037B   05333.02012661  .25992681  00000-0  24476-3 0  1534\n"
                          "2 28872  96.4736 157.9986 0303955 244.0492 110.6523 16.46015938 10708\n"),
                 {0, 0, 0});
  const UtcTime epoch = *from_iso8601("2005-11-29T00:28:58Z");
  const auto found = find_passes(sight, 10, epoch, epoch + std::chrono::hours(24));
  ASSERT_TRUE(found.unknown_from);
  EXPECT_LT(*found.unknown_from, epoch + std::chrono::hours(2));
}

TEST(PassTimes, AreReadFromAList) {
  const auto list = parse_pass_times(
      "# of the station\n"
      "2026-11-27T08:00:00Z 2026-11-27T08:09:30Z  # the high one\n"
      "\n"
      "2026-11-27T09:36:00Z 2026-11-27T09:41:00Z\n");
  ASSERT_TRUE(list);
  ASSERT_EQ(list->size(), 2U);
  EXPECT_EQ(list->front().duration(), seconds(570));
  EXPECT_FALSE(list->front().highest);
}

TEST(PassTimes, OfABadLineAreRefusedWithItsNumber) {
  for (const char* bad : {"2026-11-27T08:00:00Z", "2026-11-27T08:00:00Z 2026-11-27T07:00:00Z", "a b",
                          "2026-11-27T08:00:00Z 2026-11-27T08:09:30Z more"}) {
    const auto list = parse_pass_times(std::string("# comment\n") + bad + "\n");
    ASSERT_FALSE(list) << bad;
    EXPECT_THAT(list.error(), HasSubstr("line 2"));
  }
  EXPECT_FALSE(
      parse_pass_times("2026-11-27T08:00:00Z 2026-11-27T08:09:30Z\n"
                       "2026-11-27T08:09:00Z 2026-11-27T08:12:00Z\n"));
}

}  // namespace
}  // namespace srfs::ground::pass
