// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <filesystem>

#include <gtest/gtest.h>
#include <unistd.h>

#include "base/file.hpp"
#include "suite/ring/node_record.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::suite {
namespace {

/// Orders of an operator: held, or a state other than Active.
class Orders : public testing::Test {
 protected:
  Orders() {
    const auto file = folder_.path() / "d.yaml";
    EXPECT_TRUE(write_file_atomically(file,
                                      "deployment: t\n"
                                      "ring: {critical: [clock], command_path_limit_ms: 5000}\n"
                                      "nodes:\n"
                                      "  - {name: clock, executable: clock_node}\n"
                                      "  - {name: radio, executable: /opt/srfs/bin/ttc_node}\n"
                                      "  - {name: eps, executable: payload_eps_node}\n"));
    plan_ = Deployment::load(file);
  }
  ~Orders() override { reset(); }
  /// Simulates a reset of the computer, which loses the contents of tmpfs.
  void reset() const { std::filesystem::remove_all(var_.memory()); }
  [[nodiscard]] ros::State desired(const std::string& node, MonotonicTime now) const {
    return desired_state(var_, plan_, node, now).state;
  }

  const testing_support::TemporaryFolder folder_;
  const VarPaths var_{folder_.path()};
  Deployment plan_;
  const MonotonicTime now_{seconds(1000)};
};

TEST_F(Orders, AStandInsRecordNamesNoProcessThatItsAuthorCouldNotEnd) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root";
  ASSERT_TRUE(write_stand_in(var_, "eps", "maintenance", now_));
  const auto record = read_stand_in(var_, "eps");
  ASSERT_TRUE(record);
  EXPECT_TRUE(find_overrun(var_, *record, now_)) << "this process, by root's own record";
  EXPECT_FALSE(find_overrun(var_, *record, now_ - seconds(1))) << "within its lease";
  ASSERT_EQ(chown(var_.root.c_str(), 65534, 65534), 0);
  EXPECT_FALSE(find_overrun(var_, *record, now_)) << "a user's record would have root kill root's process";
  ASSERT_EQ(chown(var_.root.c_str(), 0, 0), 0);  // the folder in memory is root's
}

TEST_F(Orders, TheCommandPathIsWhatTheWatchdogNeedsAndWhatTelecommandsPassThrough) {
  EXPECT_TRUE(plan_.on_command_path("clock")) << "critical";
  EXPECT_TRUE(plan_.on_command_path("radio")) << "by its program";
  EXPECT_FALSE(plan_.on_command_path("eps"));
  EXPECT_FALSE(plan_.on_command_path("nobody"));
}

TEST_F(Orders, TheCommandPathMayBeStatedAndCannotLeaveOutTtc) {
  const auto load = [this](const std::string& ring) {
    const auto file = folder_.path() / "stated.yaml";
    EXPECT_TRUE(write_file_atomically(file, "deployment: t\nring: {" + ring +
                                                "}\n"
                                                "nodes:\n"
                                                "  - {name: clock, executable: timing_node}\n"
                                                "  - {name: radio, executable: ttc_node}\n"
                                                "  - {name: eps, executable: payload_eps_node}\n"));
    return Deployment::load(file);
  };
  const Deployment stated = load("command_path: [radio, eps]");
  EXPECT_TRUE(stated.on_command_path("eps"));
  EXPECT_FALSE(stated.on_command_path("clock"));
  EXPECT_TRUE(load("command_path: [radio], critical: [clock]").on_command_path("clock"));
  EXPECT_THROW(load("command_path: [clock, eps]"), ConfigError) << "without the radio";
  EXPECT_THROW(load("command_path: [radio, nobody]"), ConfigError);
}

TEST_F(Orders, ToAnyOtherNodeStandUntilTheyAreLifted) {
  ASSERT_TRUE(hold(var_, plan_, "eps", "it disturbs", now_));
  ASSERT_TRUE(set_desired_state(var_, plan_, "eps", ros::State::inactive, now_));
  reset();
  EXPECT_EQ(held_because(var_, plan_, "eps", now_ + seconds(1'000'000)), "it disturbs");
  EXPECT_EQ(desired("eps", now_ + seconds(1'000'000)), ros::State::inactive);
  ASSERT_TRUE(release(var_, "eps", milliseconds(0)));
  ASSERT_TRUE(set_desired_state(var_, plan_, "eps", ros::State::active, now_));
  EXPECT_FALSE(held_because(var_, plan_, "eps", now_));
  EXPECT_EQ(desired("eps", now_), ros::State::active);
}

TEST_F(Orders, ToTheCommandPathEndByThemselves) {
  for (const std::string node : {"clock", "radio"}) {
    ASSERT_TRUE(hold(var_, plan_, node, "to look at it", now_));
    ASSERT_TRUE(set_desired_state(var_, plan_, node, ros::State::inactive, now_));
    EXPECT_EQ(held_because(var_, plan_, node, now_ + milliseconds(4999)), "to look at it");
    EXPECT_EQ(desired(node, now_ + milliseconds(4999)), ros::State::inactive);
    EXPECT_EQ(desired_state(var_, plan_, node, now_).until, now_ + seconds(5));
    EXPECT_FALSE(held_because(var_, plan_, node, now_ + seconds(5)));
    EXPECT_EQ(desired(node, now_ + seconds(5)), ros::State::active);
  }
}

TEST_F(Orders, ToTheCommandPathDoNotOutliveAReset) {
  ASSERT_TRUE(hold(var_, plan_, "radio", "", now_));
  ASSERT_TRUE(set_desired_state(var_, plan_, "radio", ros::State::unconfigured, now_));
  EXPECT_TRUE(held_because(var_, plan_, "radio", now_)) << "also without a reason";
  reset();
  EXPECT_FALSE(held_because(var_, plan_, "radio", now_));
  EXPECT_EQ(desired("radio", now_), ros::State::active);
}

TEST_F(Orders, ToTheCommandPathAreLifted) {
  ASSERT_TRUE(hold(var_, plan_, "radio", "a while", now_));
  ASSERT_TRUE(set_desired_state(var_, plan_, "radio", ros::State::inactive, now_));
  ASSERT_TRUE(release(var_, "radio", milliseconds(0)));
  ASSERT_TRUE(set_desired_state(var_, plan_, "radio", ros::State::active, now_));
  EXPECT_FALSE(held_because(var_, plan_, "radio", now_));
  EXPECT_EQ(desired("radio", now_), ros::State::active);
}

TEST_F(Orders, OnDiskToTheCommandPathFromAnOlderVersionMeanNothing) {
  ASSERT_TRUE(write_file_atomically(var_.state("radio") / "hold", "for ever\n"));
  ASSERT_TRUE(write_file_atomically(var_.state("radio") / "desired_state", "inactive\n"));
  EXPECT_FALSE(held_because(var_, plan_, "radio", now_));
  EXPECT_EQ(desired("radio", now_), ros::State::active);
}

}  // namespace
}  // namespace srfs::suite
