// Who belongs to the suite, over real DDS.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ros/publisher.hpp"
#include "tests/dds_domain.hpp"

namespace srfs::ros {
namespace {

using srfs_msgs::msg::TaskFlags;

const Topic<TaskFlags> flags_topic{"/test/flags", {.depth = 4}, Priority::time};

/// A process of the suite, another one, and a stranger, on one topic.
class IsolationTest : public testing::Test {
 protected:
  bool wait(const std::function<bool()>& condition) {
    return executor_.spin_until(condition, monotonic_now() + seconds(20));
  }
  static std::unique_ptr<Participant> member(const std::string& node, bool drop_foreign) {
    return Participant::create({testing_support::own_domain(),
                                {"127.0.0.1"},
                                nullptr,
                                SuiteIdentity{"suite", node, 1},
                                drop_foreign})
        .value();
  }
  /// @return the cycles that the subscriber's callback got, in order of arrival
  std::vector<std::uint64_t> run(bool drop_foreign) {
    const auto stranger = Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value();
    const auto listener = member("listener", drop_foreign);
    const auto friendly = member("talker", drop_foreign);
    std::vector<std::uint64_t> got;
    Publisher<TaskFlags> ours(*friendly, flags_topic);
    Publisher<TaskFlags> foreign(*stranger, flags_topic);
    Subscription<TaskFlags> subscription(
        executor_, *listener, flags_topic,
        [&](const TaskFlags& m, const MessageInfo&) { got.push_back(m.cycle); });
    EXPECT_TRUE(wait([&] { return ours.subscription_count() == 1 && foreign.subscription_count() == 1; }));
    TaskFlags m;
    m.cycle = 1;
    foreign.publish(m);
    EXPECT_TRUE(wait([&] { return subscription.stats().foreign == 1; }));
    m.cycle = 2;
    ours.publish(m);
    EXPECT_TRUE(wait([&] { return !got.empty() && got.back() == 2; }));
    EXPECT_EQ(subscription.stats().foreign, 1U);
    EXPECT_NE(subscription.reader().lock()->last_foreign().find("'/' at 127.0.0.1"), std::string::npos)
        << subscription.reader().lock()->last_foreign();
    return got;
  }
  Executor executor_;
};

TEST_F(IsolationTest, SamplesFromOutsideTheSuiteAreCountedAndAccepted) {
  EXPECT_THAT(run(false), testing::ElementsAre(1, 2));
}

TEST_F(IsolationTest, ANodeThatHearsItselfIsNoStranger) {
  const auto node = member("ttc", true);
  std::vector<std::uint64_t> got;
  Publisher<TaskFlags> publisher(*node, flags_topic);
  Subscription<TaskFlags> subscription(
      executor_, *node, flags_topic, [&](const TaskFlags& m, const MessageInfo&) { got.push_back(m.cycle); });
  ASSERT_TRUE(wait([&] { return publisher.subscription_count() == 1; }));
  publisher.publish({});
  EXPECT_TRUE(wait([&] { return got.size() == 1; }));
  EXPECT_EQ(subscription.stats().foreign, 0U);
}

TEST_F(IsolationTest, WhereTheDeploymentSaysSoTheyAreDropped) {
  EXPECT_THAT(run(true), testing::ElementsAre(2));
}

}  // namespace
}  // namespace srfs::ros
