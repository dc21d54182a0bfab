// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <csignal>

#include <gtest/gtest.h>

#include "update/build_lane.hpp"

namespace srfs::update {
namespace {

const NodeBuild installation{.flags = {"-std=c++20"},
                             .include = {"/opt/srfs/include/srfs"},
                             .readable = {"/opt/srfs/lib"},
                             .library_folder = "/opt/srfs/lib",
                             .libraries = {"srfs_ros", "fmt"}};

bool has(const std::vector<std::string>& words, const std::string& word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

Ended ended_with(int exit_code) {
  Ended ended;
  ended.exit_code = exit_code;
  return ended;
}
Ended ended_by(int signal) {
  Ended ended;
  ended.signal = signal;
  return ended;
}

TEST(NodeBuildTest, PathsAreBelowThePrefixUnlessTheyAreAbsolute) {
  const auto build = decode_node_build(
      R"({"format": "srfs node build 1", "flags": ["-O2"], "include": ["include/srfs", "/tree/lib"], "readable": ["lib"],
          "library_folder": "lib", "libraries": ["srfs_ros"], "version": "0.1.0"})",
      "/opt/srfs");
  ASSERT_TRUE(build) << build.error();
  EXPECT_EQ(build->include, (std::vector<std::filesystem::path>{"/opt/srfs/include/srfs", "/tree/lib"}));
  EXPECT_EQ(build->library_folder, "/opt/srfs/lib");
  EXPECT_TRUE(build->where_installed.empty());
  EXPECT_FALSE(decode_node_build("{}", "/opt/srfs"));
  EXPECT_FALSE(decode_node_build("", "/opt/srfs"));
}

TEST(BuildPlanTest, LinksTheLibrariesThatAreWhereTheInstallationSays) {
  const auto build = decode_node_build(
      R"({"format": "srfs node build 1", "flags": [], "include": [], "readable": [], "library_folder": "lib",
          "libraries": ["fmt"], "where_installed": ["/usr/lib/libopencv_core.so"]})",
      "/opt/srfs");
  ASSERT_TRUE(build) << build.error();

  const auto words = plan_build(*build, {"main.cpp"}, {}, "/w", std::nullopt).link.words;

  const auto needed = std::find(words.begin(), words.end(), "-Wl,--as-needed,-rpath,/opt/srfs/lib");
  EXPECT_NE(std::find(needed, words.end(), "/usr/lib/libopencv_core.so"), words.end());
}

TEST(BuildPlanTest, TheStructsOfTheMissionThatFliesComeBeforeThoseOfTheInstallation) {
  NodeBuild build = installation;
  build.structures = "/srv/mission/structures";

  const BuildPlan plan = plan_build(build, {"main.cpp"}, {}, "/w", std::nullopt);

  ASSERT_EQ(plan.compile.size(), 2U);
  EXPECT_TRUE(has(plan.compile[1].words, "/srv/mission/structures/mission/structures.cpp"));
  EXPECT_TRUE(has(plan.link.words, "/w/1.o"));
  const auto& words = plan.compile[0].words;
  const auto own = std::find(words.begin(), words.end(), "/srv/mission/structures");
  ASSERT_NE(own, words.end());
  EXPECT_EQ(*(own - 1), "-isystem");
  EXPECT_NE(std::find(own, words.end(), installation.include.front()), words.end());
}

TEST(BuildPlanTest, CompilesEachSourceWithTheOptionsAndLinksAllObjects) {
  const BuildPlan plan =
      plan_build(installation, {"a/main.cpp", "a/x.hpp", "b.cpp", "notes.txt"}, {"-O3"}, "/w", std::nullopt);

  ASSERT_EQ(plan.compile.size(), 2U);
  EXPECT_EQ(plan.compile[1].title, "compile 2/2 b.cpp");
  EXPECT_TRUE(has(plan.compile[0].words, "-O3"));
  EXPECT_TRUE(has(plan.compile[0].words, "-I/w/src"));
  EXPECT_TRUE(has(plan.compile[0].words, "./a/main.cpp"));
  EXPECT_FALSE(has(plan.compile[0].words, "-include"));
  EXPECT_EQ(plan.link.words.front(), compiler);
  for (const char* word :
       {"/w/0.o", "/w/1.o", "-lsrfs_ros", "/w/program", "-Wl,--as-needed,-rpath,/opt/srfs/lib"})
    EXPECT_TRUE(has(plan.link.words, word)) << word;
}

TEST(BuildPlanTest, ThePrecompiledHeaderComesFirstInEverySource) {
  const BuildPlan plan = plan_build(installation, {"main.cpp"}, {}, "/w", "/h/node.hpp");
  EXPECT_TRUE(has(plan.compile[0].words, "/h/node.hpp"));
}

TEST(BuildPlanTest, ThePrecompiledHeaderIsNotLinked) {
  EXPECT_TRUE(has(plan_header(installation, {}, "/w").words, "-c"));
}

TEST(BuildPlanTest, FortifyIsTakenBackWhereNothingIsOptimised) {
  const auto takes_it_back = [](const std::vector<std::string>& options) {
    return has(plan_build(installation, {"a.cpp"}, options, "/w", std::nullopt).compile[0].words,
               "-U_FORTIFY_SOURCE");
  };
  EXPECT_FALSE(takes_it_back({"-O2"}));
  EXPECT_FALSE(takes_it_back({"-O0", "-Os", "-g"}));
  EXPECT_TRUE(takes_it_back({"-O2", "-O0"}));
  EXPECT_TRUE(takes_it_back({"-g"}));
  EXPECT_TRUE(takes_it_back({}));
}

TEST(MakeRuleTest, ListsTheFiles) {
  EXPECT_EQ(files_of_rule("a.o: a.cpp \\\n /usr/b.hpp c\\ d.hpp\n"),
            (std::vector<std::string>{"a.cpp", "/usr/b.hpp", "c d.hpp"}));
  EXPECT_TRUE(files_of_rule("").empty());
}

TEST(BuildJudgementTest, NamesTheLimitThatWasReached) {
  const Limits limits{.cpu = seconds(10)};
  const auto judge = [&](const Ended& ended, std::string_view log = "") {
    return judge_build(ended, log, limits);
  };

  EXPECT_EQ(judge(ended_with(0)), BuildOutcome::built);
  EXPECT_EQ(judge(ended_with(1), "a.cpp:1: error: x"), BuildOutcome::compiler_failed);
  EXPECT_EQ(judge(ended_with(1), "cc1plus: out of memory allocating 65536 bytes"),
            BuildOutcome::memory_limit);
  EXPECT_EQ(judge(ended_with(1), "fatal error: error writing to /tmp/x.s: No space left on device"),
            BuildOutcome::quota);
  EXPECT_EQ(judge(ended_with(1), "File size limit exceeded signal terminated program as"),
            BuildOutcome::output_too_large);
  EXPECT_EQ(judge(ended_by(SIGXCPU)), BuildOutcome::cpu_limit);
  EXPECT_EQ(
      judge(ended_with(1), "g++: fatal error: CPU time limit exceeded signal terminated program cc1plus"),
      BuildOutcome::cpu_limit);

  Ended ended = ended_with(1);
  ended.out_of_memory = true;
  EXPECT_EQ(judge(ended), BuildOutcome::memory_limit);
  ended = ended_with(1);
  ended.cpu_s = 10.1;
  EXPECT_EQ(judge(ended), BuildOutcome::cpu_limit);
  ended = ended_with(1);
  ended.too_many_processes = true;
  EXPECT_EQ(judge(ended), BuildOutcome::process_limit);
  for (const auto& [stop, outcome] : {std::pair(Ended::Stop::wall_time, BuildOutcome::time_limit),
                                      std::pair(Ended::Stop::quota, BuildOutcome::quota),
                                      std::pair(Ended::Stop::cancelled, BuildOutcome::cancelled)}) {
    ended = ended_with(0);
    ended.stop = stop;
    EXPECT_EQ(judge(ended), outcome);
  }
}

TEST(SelfTestJudgementTest, TellsTheVerdictFromTheCrash) {
  const Limits limits;
  EXPECT_EQ(judge_self_test(ended_with(0), limits), SelfTestOutcome::passed);
  EXPECT_EQ(judge_self_test(ended_with(self_test_failed), limits), SelfTestOutcome::failed);
  EXPECT_EQ(judge_self_test(ended_with(1), limits), SelfTestOutcome::crashed);
  EXPECT_EQ(judge_self_test(ended_by(SIGSEGV), limits), SelfTestOutcome::crashed);
  EXPECT_EQ(judge_self_test(ended_by(SIGXCPU), limits), SelfTestOutcome::cpu_limit);

  Ended ended = ended_by(SIGKILL);
  ended.stop = Ended::Stop::wall_time;
  EXPECT_EQ(judge_self_test(ended, limits), SelfTestOutcome::hung);
  ended.too_many_processes = true;
  EXPECT_EQ(judge_self_test(ended, limits), SelfTestOutcome::process_limit);
  ended = ended_by(SIGKILL);
  ended.out_of_memory = true;
  EXPECT_EQ(judge_self_test(ended, limits), SelfTestOutcome::memory_limit);
  ended.too_many_processes = true;
  EXPECT_EQ(judge_self_test(ended, limits), SelfTestOutcome::process_limit);
}

TEST(LaneExitTest, SaysWhoIsToBlame) {
  EXPECT_EQ(exit_of(BuildOutcome::built), LaneExit::done);
  EXPECT_EQ(exit_of(BuildOutcome::compiler_failed), LaneExit::to_blame);
  EXPECT_EQ(exit_of(BuildOutcome::quota), LaneExit::limit);
  EXPECT_EQ(exit_of(BuildOutcome::sandbox_failed), LaneExit::environment);
  EXPECT_EQ(exit_of(SelfTestOutcome::hung), LaneExit::to_blame);
  EXPECT_EQ(exit_of(SelfTestOutcome::memory_limit), LaneExit::limit);
}

TEST(LayerTest, EveryNameIsFoundAgain) {
  for (std::size_t i = 0; i < layer_count; ++i) {
    const auto layer = static_cast<Layer>(i);
    EXPECT_EQ(layer_of(to_text(layer)), layer);
  }
  EXPECT_EQ(layer_of("nothing"), std::nullopt);
}

TEST(HeadAndTailTest, KeepsBothEndsAndSaysWhatIsMissing) {
  HeadAndTail text(8);
  text.append("abcd");
  text.append("efgh");
  EXPECT_EQ(text.text(), "abcdefgh");
  for (char c = 'i'; c <= 'z'; ++c) text.append(std::string(1, c));
  EXPECT_EQ(text.text(), "abcd\n[... 18 octets left out ...]\nwxyz");
}

TEST(LastLinesTest, AreWhole) {
  EXPECT_EQ(last_lines("one\ntwo\nthree\n", 100), "one\ntwo\nthree\n");
  EXPECT_EQ(last_lines("one\ntwo\nthree\n", 8), "three\n");
}

}  // namespace
}  // namespace srfs::update
