// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <fstream>
#include <numbers>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ground/pass/sgp4.hpp"
#include "ground/pass/sight.hpp"
#include "ground/pass/tle.hpp"

namespace srfs::ground::pass {
namespace {

using ::testing::HasSubstr;

const std::string iss_like =
    "1 06251U 62025E   06176.82412014  .00008885  00000-0  12808-3 0  3985\n"
    "2 06251  58.0579  54.0425 0030035 139.1568 221.1854 15.56387291  6774\n";

double distance(const Vector& a, const Vector& b) {
  return std::hypot(a[0] - b[0], std::hypot(a[1] - b[1], a[2] - b[2]));
}

TEST(Sgp4, GivesThePublishedStatesOfEveryCaseNearTheEarth) {
  std::ifstream in(std::string(SRFS_SOURCE_DIR) + "/tests/vectors/sgp4.txt");
  std::string first;
  std::optional<Sgp4> orbit;
  std::size_t states = 0;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line.front() == '#') continue;
    if (line.size() >= 69 && line.starts_with("1 ")) {
      first = line;
      continue;
    }
    if (line.size() >= 69 && line.starts_with("2 ")) {
      const auto tle = parse_tle(first + "\n" + line);
      ASSERT_TRUE(tle) << line << ": " << tle.error();
      const auto made = Sgp4::of(*tle);
      ASSERT_TRUE(made) << line;
      orbit = *made;
      continue;
    }
    std::istringstream numbers(line);
    double minutes = 0;
    Sgp4::State expected;
    numbers >> minutes;
    for (double& x : expected.position_km) numbers >> x;
    for (double& v : expected.velocity_km_s) numbers >> v;
    ASSERT_TRUE(numbers) << line;
    const auto state = orbit->after(minutes);
    ASSERT_TRUE(state) << line << ": " << to_text(state.error());
    EXPECT_LT(distance(state->position_km, expected.position_km), 1e-6) << line;
    EXPECT_LT(distance(state->velocity_km_s, expected.velocity_km_s), 1e-8) << line;
    ++states;
  }
  EXPECT_EQ(states, 31U);
}

TEST(Sgp4, CountsTimeFromTheEpochOfTheElements) {
  const auto tle = parse_tle(iss_like);
  ASSERT_TRUE(tle);
  EXPECT_EQ(to_iso8601(tle->epoch, 6), "2006-06-25T19:46:43.980096Z");
  const auto orbit = Sgp4::of(*tle);
  ASSERT_TRUE(orbit);
  EXPECT_EQ(orbit->at(tle->epoch + std::chrono::hours(2))->position_km, orbit->after(120)->position_km);
}

TEST(Sgp4, RefusesWhatIsNotNearTheEarth) {
  const auto tle = parse_tle(
      "1 28129U 03058A   06175.57071136 -.00000104  00000-0  10000-3 0   459\n"
      "2 28129  54.7298 324.8098 0048506 266.2640  93.1663  2.00562768 18443\n");
  ASSERT_TRUE(tle) << tle.error();
  const auto orbit = Sgp4::of(*tle);
  ASSERT_FALSE(orbit);
  EXPECT_EQ(orbit.error(), Sgp4Error::deep_space);
}

TEST(Sgp4, SaysWhenTheSpacecraftHasComeDown) {
  const auto tle = parse_tle(
      "1 28872U 05037B   05333.02012661  .25992681  00000-0  24476-3 0  1534\n"
      "2 28872  96.4736 157.9986 0303955 244.0492 110.6523 16.46015938 10708\n");
  ASSERT_TRUE(tle);
  const auto orbit = Sgp4::of(*tle);
  ASSERT_TRUE(orbit);
  EXPECT_FALSE(orbit->after(55));
  EXPECT_FALSE(orbit->after(100'000));
}

TEST(TwoLineElements, HaveANameAboveThemOrNone) {
  EXPECT_EQ(parse_tle(iss_like)->name, "");
  EXPECT_EQ(parse_tle("DELTA 1 DEB\r\n" + iss_like)->name, "DELTA 1 DEB");
  EXPECT_EQ(parse_tle("0 DELTA 1 DEB\n# of yesterday\n\n" + iss_like)->name, "DELTA 1 DEB");
  EXPECT_EQ(parse_tle(iss_like)->catalogue, "06251");
}

TEST(TwoLineElements, AreRefusedWithAnyDigitChanged) {
  for (std::size_t i = 0; i < iss_like.size(); ++i) {
    if (iss_like[i] < '0' || iss_like[i] > '9') continue;
    std::string changed = iss_like;
    changed[i] = changed[i] == '9' ? '0' : static_cast<char>(changed[i] + 1);
    EXPECT_FALSE(parse_tle(changed)) << i;
  }
}

TEST(TwoLineElements, AreRefusedWhenCutAnywhere) {
  for (std::size_t octets = 0; octets + 1 < iss_like.size(); ++octets)
    EXPECT_FALSE(parse_tle(iss_like.substr(0, octets))) << octets;
}

TEST(TwoLineElements, OfTwoSpacecraftAreNoSet) {
  const auto mixed = parse_tle(
      "1 06251U 62025E   06176.82412014  .00008885  00000-0  12808-3 0  3985\n"
      "2 28057  98.4283 247.6961 0000884  88.1964 271.9322 14.35478080140550\n");
  ASSERT_FALSE(mixed);
  EXPECT_THAT(mixed.error(), HasSubstr("different spacecraft"));
  EXPECT_FALSE(parse_tle(iss_like + iss_like));
}

TEST(SiderealTime, IsThatOfTheBook) {
  // Vallado, Fundamentals of Astrodynamics, example 3-5.
  const auto time = from_iso8601("1992-08-20T12:14:00Z");
  EXPECT_NEAR(sidereal_time_rad(*time) * 180 / std::numbers::pi, 152.578787810, 1e-6);
}

TEST(Geodetic, PositionsAreThosePublishedAndComeBack) {
  // EPSG Guidance Note 7-2, geographic/geocentric conversions, on WGS-84: 53 deg 48' 33.820" N, 2 deg
  // 07' 46.380" E, 73 m, to a millimetre. (Vallado's example 3-1 is on the ellipsoid of EGM-96, 0.7 m
  // smaller.)
  const Vector position = position_km({53 + 48 / 60.0 + 33.820 / 3600, 2 + 7 / 60.0 + 46.380 / 3600, 73});
  EXPECT_NEAR(position[0], 3771.793968, 1e-6);
  EXPECT_NEAR(position[1], 140.253342, 1e-6);
  EXPECT_NEAR(position[2], 5124.304349, 1e-6);
  for (const Geodetic place :
       {Geodetic{47.4, 8.5, 450}, Geodetic{-89.9, -179.5, 600'000}, Geodetic{0, 90, 0}}) {
    const Geodetic back = place_of(position_km(place));
    EXPECT_NEAR(back.latitude_deg, place.latitude_deg, 1e-7);
    EXPECT_NEAR(back.longitude_deg, place.longitude_deg, 1e-9);
    EXPECT_NEAR(back.height_m, place.height_m, 1e-3);
  }
}

TEST(Sight, PointsWhereTheSpacecraftIs) {
  const Geodetic station{45, 10, 0};
  const Sight above = sight_of(position_km({45, 10, 500'000}), station);
  EXPECT_NEAR(above.elevation_deg, 90, 1e-4);
  EXPECT_NEAR(above.range_km, 500, 1e-6);
  const Sight north = sight_of(position_km({50, 10, 500'000}), station);
  EXPECT_NEAR(std::remainder(north.azimuth_deg, 360), 0, 1e-6);
  EXPECT_GT(north.elevation_deg, 0);
  EXPECT_NEAR(sight_of(position_km({45, 12, 500'000}), station).azimuth_deg, 90, 1);
  EXPECT_NEAR(sight_of(position_km({45, 8, 500'000}), station).azimuth_deg, 270, 1);
  EXPECT_LT(sight_of(position_km({-45, -170, 500'000}), station).elevation_deg, -80);
}

TEST(Sight, HasAnAzimuthBelowAFullTurnAlsoJustWestOfNorth) {
  for (int longitude = -180; longitude <= 180; ++longitude) {
    const double place = longitude;
    const double azimuth = sight_of(position_km({50, place, 500'000}), {45, place, 0}).azimuth_deg;
    EXPECT_GE(azimuth, 0) << longitude;
    EXPECT_LT(azimuth, 360) << longitude;
    EXPECT_NEAR(std::remainder(azimuth, 360), 0, 1e-6) << longitude;
  }
}

}  // namespace
}  // namespace srfs::ground::pass
