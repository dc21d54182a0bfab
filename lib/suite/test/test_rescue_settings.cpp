// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <random>

#include <gtest/gtest.h>

#include "base/sha256.hpp"
#include "base/text.hpp"
#include "suite/rescue_settings.hpp"

namespace srfs::suite {
namespace {

RescueSettings example() {
  RescueSettings settings;
  settings.var = "/var/lib/srfs";
  settings.program = "/opt/srfs/bin/srfs";
  settings.deployment = "/etc/srfs/deployment.yaml";
  settings.rs422 = "serial:/dev/ttyS3";
  settings.baud = 921600;
  settings.watchdog = "dev:/dev/watchdog";
  settings.watchdog_timeout_s = 22;
  settings.spacecraft = 0xAB;
  settings.frame_octets = 223;
  settings.associations = {{.spi = 1, .for_ad = false, .key = Octets(32, 7), .key_file = "/var/k"},
                           {.spi = 5, .set = 'c', .key = Octets(32, 9), .key_file = "/var/c"}};
  settings.seal = RescueSettings::Seal{.spi = 16, .key = Octets(32, 11), .key_file = "/var/tm"};
  return settings;
}

/// The text with a digest that fits, so that what is behind it is judged.
std::string with_digest(std::string text) {
  text.resize(text.find("sha256 "));
  return text + "sha256 " + to_digits(sha256_of(as_octets(text))) + "\n";
}

TEST(RescueSettingsFile, IsReadAsItWasWritten) {
  const auto read = decode_rescue_settings(encode(example()));
  ASSERT_TRUE(read) << read.error();
  EXPECT_EQ(*read, example());
}

TEST(RescueSettingsFile, OfALinkWithoutSealsSaysNothingOfThem) {
  RescueSettings settings = example();
  settings.seal.reset();
  EXPECT_EQ(encode(settings).find("seal"), std::string::npos);
  EXPECT_EQ(decode_rescue_settings(encode(settings)), settings);
}

TEST(RescueSettingsFile, NoBitOfItCanChangeUnseen) {
  const std::string text = encode(example());
  for (std::size_t i = 0; i < text.size(); ++i) {
    std::string damaged = text;
    damaged[i] = static_cast<char>(damaged[i] ^ (1U << (i % 8)));
    EXPECT_FALSE(decode_rescue_settings(damaged)) << i;
    EXPECT_FALSE(decode_rescue_settings(text.substr(0, i))) << i;
  }
  EXPECT_FALSE(decode_rescue_settings(text + "\n"));
}

TEST(RescueSettingsFile, RefusesWhatItsOwnWriterWouldNotWrite) {
  const std::string text = encode(example());
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string other = text;
    other.replace(other.find(from), from.size(), to);
    return decode_rescue_settings(with_digest(other));
  };
  EXPECT_EQ(changed("var /var", "var var").error(), "line 2: bad values of 'var'");
  EXPECT_NE(changed("seal 16 ", "seal 0 ").error().find("bad values of 'seal'"), std::string::npos);
  EXPECT_EQ(changed("steps 3 6 9", "steps 3 3 9").error(), "line 11: bad values of 'steps'");
  EXPECT_EQ(changed("deployment", "deploymemt").error(), "line 4: no such key");
  EXPECT_EQ(changed("link 171", "link 1024").error(), "line 7: bad values of 'link'");
  EXPECT_EQ(changed("watchdog dev:/dev/watchdog 22\n", "var /var/lib/srfs\n").error(),
            "line 6: a second 'var'");
  EXPECT_EQ(changed("rs422 serial:/dev/ttyS3 921600\n", "").error(), "no 'rs422'");
}

TEST(RescueSettingsFile, TakesAnyOctetsBehindAFittingDigestWithoutHarm) {
  std::mt19937 random(33);
  const std::string text = encode(example());
  for (int run = 0; run < 20'000; ++run) {
    std::string other = text.substr(0, text.find("sha256 "));
    for (auto changes = 1 + random() % 6; changes > 0; --changes) {
      const std::size_t at = 23 + random() % (other.size() - 23);
      if (random() % 3 == 0) {
        other.erase(at, random() % 9);
      } else if (random() % 2 == 0) {
        other.insert(at, 1, static_cast<char>(random()));
      } else {
        other[at] = static_cast<char>(random());
      }
      if (other.size() < 60) break;
    }
    const auto read = decode_rescue_settings(with_digest(other + "sha256 "));
    if (read) {
      EXPECT_TRUE(decode_rescue_settings(encode(*read))) << "what is taken can be written";
    }
  }
}

}  // namespace
}  // namespace srfs::suite
