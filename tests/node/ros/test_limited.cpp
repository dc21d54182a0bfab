// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// A limited member of a suite (an uplinked node) that says what it may and what it may not, in a process of
// its own, over real DDS.

#include <poll.h>
#include <sys/prctl.h>
#include <csignal>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <lifecycle_msgs/srv/change_state.hpp>
#include <srfs_msgs/srv/check_alive.hpp>

#include "base/fd.hpp"
#include "ros/datagram_seal.hpp"
#include "ros/lifecycle_node.hpp"
#include "suite/topics.hpp"
#include "tests/dds_domain.hpp"
#include "tests/signal_child.hpp"

namespace srfs::ros {
namespace {

using lifecycle_msgs::srv::ChangeState;
using srfs_msgs::msg::Event;
using srfs_msgs::msg::TaskFlags;
using srfs_msgs::msg::TimeTick;
using srfs_msgs::srv::CheckAlive;

constexpr SealKey suite_key{1, 2, 3};
const std::string uplinked = "payload_eps";
const Topic<Event> own_topic{"/payload_eps/said", {}};
const Topic<Event> anothers_topic{"/payload_adcs/said", {}};

std::unique_ptr<Participant> make(const std::string& node, Executor& executor) {
  return Participant::create(
             {testing_support::own_domain(), {"127.0.0.1"}, &executor, SuiteIdentity{"suite", node, 1}})
      .value();
}

Event event_of(const std::string& source) {
  Event event;
  event.source = source;
  return event;
}

/// Does it all again every 20 ms. Tells what it was answered and heard, a line each.
[[noreturn]] void be_uplinked(int out) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  seal_datagrams({limited_seal_key(suite_key, uplinked), uplinked, seal_key_among_limited(suite_key)},
                 [] { return std::nullopt; });
  const auto tell = [out](const std::string& line) {
    [[maybe_unused]] const ssize_t ignored = write(out, (line + "\n").data(), line.size() + 1);
  };
  Executor executor;
  const auto participant = make(uplinked, executor);
  Publisher<TimeTick> ticks(*participant, suite::topics::time_tick);
  Publisher<Event> events(*participant, suite::topics::event);
  Publisher<Event> own(*participant, own_topic);
  Publisher<Event> anothers(*participant, anothers_topic);
  const auto answer = [](std::uint64_t more) {
    return [more](const CheckAlive::Request& q, CheckAlive::Response& r) { r.nonce = q.nonce + more; };
  };
  const Service<CheckAlive> own_service(executor, *participant, "/payload_eps/check_alive", Qos{},
                                        Priority::normal, answer(1));
  const Service<CheckAlive> liar(executor, *participant, "/ttc/check_alive", Qos{}, Priority::normal,
                                 answer(1000));
  const Subscription<TaskFlags> flags(
      executor, *participant, suite::topics::task_flags,
      [&](const TaskFlags& m, const MessageInfo&) { tell("flags of " + m.holder); });
  Client<ChangeState> orders(executor, *participant, "/timing/change_state", Qos{}, Priority::normal);
  ChangeState::Request configure;
  configure.transition.id = 1;
  const Timer ordering = executor.add_timer(monotonic_now(), milliseconds(500), [&] {
    orders.call(configure, milliseconds(400), 1, [&](const auto& answered) {
      if (answered) tell(answered->success ? "obeyed" : "refused");
    });
  });
  const Timer timer = executor.add_timer(monotonic_now(), milliseconds(20), [&] {
    ticks.publish({});
    events.publish(event_of("timing"));
    events.publish(event_of(uplinked));
    own.publish(event_of(uplinked));
    anothers.publish(event_of(uplinked));
    for (const auto& member : participant->known_participants().members())
      (void)participant->announce_departure(member.prefix);
  });
  executor.spin();
  _exit(0);
}

class LimitedMember : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    (void)testing_support::own_domain();
    int ends[2] = {-1, -1};
    ASSERT_EQ(pipe(ends), 0);
    child_ = fork();
    if (child_ == 0) be_uplinked(ends[1]);
    close(ends[1]);
    told_ = Fd(ends[0]);
    seal_datagrams({suite_key}, [] { return std::nullopt; });
    executor_ = std::make_unique<Executor>();
    timing_ = make("timing", *executor_);
    ttc_ = make("ttc", *executor_);
  }
  static void TearDownTestSuite() {
    testing_support::signal_child(child_, SIGKILL);
    waitpid(child_, nullptr, 0);
    timing_.reset();
    ttc_.reset();
    executor_.reset();
  }
  bool wait(const std::function<bool()>& condition) {
    return executor_->spin_until(condition, monotonic_now() + seconds(20));
  }
  /// Whether the uplinked one told this.
  static bool has_told(const std::string& line) {
    pollfd entry{told_.get(), POLLIN, 0};
    char text[256];
    while (poll(&entry, 1, 0) > 0) {
      const ssize_t n = read(told_.get(), text, sizeof text);
      if (n <= 0) break;
      all_told_.append(text, static_cast<std::size_t>(n));
    }
    return all_told_.find(line + "\n") != std::string::npos;
  }

  const Topic<TaskFlags> own_flags_{"/test/limited", {}};
  static inline pid_t child_ = 0;
  static inline Fd told_;
  static inline std::string all_told_;
  static inline std::unique_ptr<Executor> executor_;
  static inline std::unique_ptr<Participant> timing_;
  static inline std::unique_ptr<Participant> ttc_;
};

TEST_F(LimitedMember, IsBelievedForItselfAlone) {
  std::set<std::string> sources;
  std::uint64_t ticks = 0;
  std::uint64_t own = 0;
  std::uint64_t anothers = 0;
  const Subscription<Event> events(*executor_, *ttc_, suite::topics::event,
                                   [&](const Event& m, const MessageInfo&) { sources.insert(m.source); });
  const Subscription<TimeTick> tick(*executor_, *ttc_, suite::topics::time_tick,
                                    [&](const TimeTick&, const MessageInfo&) { ++ticks; });
  const Subscription<Event> below(*executor_, *ttc_, own_topic,
                                  [&](const Event&, const MessageInfo&) { ++own; });
  const Subscription<Event> elsewhere(*executor_, *ttc_, anothers_topic,
                                      [&](const Event&, const MessageInfo&) { ++anothers; });
  ASSERT_TRUE(wait([&] {
    return own >= 10 && events.stats().foreign >= 10 && tick.stats().foreign >= 10 &&
           elsewhere.stats().foreign >= 10;
  }));
  EXPECT_EQ(sources, (std::set<std::string>{uplinked}));
  EXPECT_EQ(ticks, 0U);
  EXPECT_EQ(anothers, 0U);
  EXPECT_EQ(below.stats().foreign, 0U);
  EXPECT_THAT(tick.reader().lock()->last_foreign(), testing::StartsWith("payload_eps, "));
}

TEST_F(LimitedMember, AnswersForItselfAlone) {
  Client<CheckAlive> own(*executor_, *ttc_, "/payload_eps/check_alive", Qos{}, Priority::normal);
  Client<CheckAlive> anothers(*executor_, *timing_, "/ttc/check_alive", Qos{}, Priority::normal);
  CheckAlive::Request request;
  request.nonce = 7;
  std::optional<std::uint64_t> answer;
  std::optional<bool> lie;
  own.call(request, seconds(10), 1, [&](const auto& a) { answer = a ? a->nonce : 0; });
  ASSERT_TRUE(wait([&] { return anothers.is_ready(); }));
  anothers.call(request, milliseconds(500), 2, [&](const auto& a) { lie = a.has_value(); });
  ASSERT_TRUE(wait([&] { return answer && lie; }));
  EXPECT_EQ(*answer, 8U);
  EXPECT_FALSE(*lie);
}

TEST_F(LimitedMember, OrdersNothing) {
  LifecycleNode node({.names = NodeNames("timing"),
                      .executor = *executor_,
                      .participant = *timing_,
                      .obeys_foreign = false});
  ASSERT_TRUE(wait([&] { return has_told("refused") || has_told("obeyed"); }));
  EXPECT_TRUE(has_told("refused"));
  EXPECT_EQ(node.state(), State::unconfigured);
}

TEST_F(LimitedMember, BelievesTheOthers) {
  Publisher<TaskFlags> flags(*timing_, suite::topics::task_flags);
  TaskFlags m;
  m.holder = "payload_thermal";
  ASSERT_TRUE(wait([&] { return flags.subscription_count() > 0; }));
  ASSERT_TRUE(wait([&] {
    flags.publish(m);
    return has_told("flags of payload_thermal");
  }));
}

TEST_F(LimitedMember, SaysNoGoodbyeForOthers) {
  Publisher<TaskFlags> flags(*timing_, own_flags_);
  const Subscription<TaskFlags> heard(*executor_, *ttc_, own_flags_,
                                      [](const TaskFlags&, const MessageInfo&) {});
  ASSERT_TRUE(wait([&] { return flags.subscription_count() > 0; }));
  const auto before = datagram_seal()->forged();
  ASSERT_TRUE(wait([&] { return datagram_seal()->forged().beyond >= before.beyond + 20; }));
  EXPECT_EQ(flags.subscription_count(), 1U);
  const auto after = datagram_seal()->forged();
  EXPECT_EQ(after.all() - before.all(), after.beyond - before.beyond) << "nothing else is wrong with it";
}

}  // namespace
}  // namespace srfs::ros
