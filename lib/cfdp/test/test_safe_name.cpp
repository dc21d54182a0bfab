// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "cfdp/safe_name.hpp"

#include <gtest/gtest.h>

#include <set>

namespace srfs::cfdp {
namespace {

TEST(SafeName, LeavesOrdinaryNamesAlone) {
  for (const char* name :
       {"image_001_0000000005_findings.json", "payload_eps_7.report", "a/b/c-1.2+x=y,z@~", ""})
    EXPECT_EQ(safe_name(name), name);
}

TEST(SafeName, WritesEverythingElseAsItsOctets) {
  EXPECT_EQ(safe_name("a\x1b[2J\n"), "a%1B%5B2J%0A");
  EXPECT_EQ(safe_name("two words"), "two%20words");
  EXPECT_EQ(safe_name("ä"), "%C3%A4");
  EXPECT_EQ(safe_name("a\\b:c*d?e\"f<g>h|i'$(x)`&;"),
            "a%5Cb%3Ac%2Ad%3Fe%22f%3Cg%3Eh%7Ci%27%24%28x%29%60%26%3B");
  EXPECT_EQ(safe_name("-rf"), "%2Drf") << "no option of a program";
  EXPECT_EQ(safe_name("a/-rf/b-c"), "a/%2Drf/b-c");
}

TEST(SafeName, GivesNoFileALibrarysName) {
  EXPECT_EQ(safe_name("libfmt.so"), "libfmt%2Eso");
  EXPECT_EQ(safe_name("a/libfmt.so.9.1"), "a/libfmt%2Eso.9.1");
  EXPECT_EQ(safe_name("x.so.so"), "x%2Eso%2Eso");
  EXPECT_EQ(safe_name("d.so/f"), "d%2Eso/f");
  EXPECT_EQ(safe_name("a.song"), "a.song");
  EXPECT_NE(safe_name("x%2Eso"), safe_name("x.so"));
}

TEST(SafeName, KeepsDifferentNamesDifferent) {
  std::set<std::string> names;
  for (int octet = 1; octet < 256; ++octet) names.insert(safe_name(std::string(1, static_cast<char>(octet))));
  EXPECT_EQ(names.size(), 255U);
  EXPECT_NE(safe_name("a%20b"), safe_name("a b"));
  const std::string once = safe_name("a b");
  EXPECT_NE(safe_name(once), once) << "a name that looks like a written one is another name";
}

}  // namespace
}  // namespace srfs::cfdp
