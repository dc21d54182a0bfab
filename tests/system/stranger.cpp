// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// stranger DOMAIN ROLE: a participant outside the suite that floods its topics until it is killed, or its
// parent ends. It prints how many samples it has sent, ten times a second. Roles:
//   huge    samples of 1 to 64 MiB, ten a second each on /event and /timing/tick
//   random  5,000 samples a second of random octets, on topics that nodes decide by
//   events  20,000 well-formed events a second
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string_view>
#include <thread>

#include <sys/prctl.h>
#include <csignal>

#include "ros/publisher.hpp"
#include "ros/serialized.hpp"
#include "suite/topics.hpp"

namespace {

using namespace srfs;
using namespace srfs::ros;
namespace topics = suite::topics;

/// A sample without a bound, under the name of another type.
template <class M>
struct Huge {
  static constexpr const char* dds_type_name = M::dds_type_name;
  std::vector<std::uint8_t> octets;
  template <class Self, class V>
  static void visit(Self& s, V& v) {
    v.sequence(s.octets, 0, 0);
  }
};

/// Calls @p send at its rate for ever; what it is late it makes up for, at most a second of it.
template <class F>
[[noreturn]] void at_rate(double a_second, F send) {
  const auto period = nanoseconds(static_cast<std::int64_t>(1e9 / a_second));
  std::uint64_t sent = 0;
  MonotonicTime due = monotonic_now();
  MonotonicTime told = due;
  while (true) {
    const MonotonicTime now = monotonic_now();
    if (now - told >= milliseconds(100)) {
      std::printf("%llu\n", static_cast<unsigned long long>(sent));
      std::fflush(stdout);
      told = now;
    }
    if (now < due) {
      std::this_thread::sleep_for(std::min<nanoseconds>(due - now, milliseconds(1)));
      continue;
    }
    due = std::max(due + period, now - seconds(1));
    send();
    ++sent;
  }
}

template <class M>
class HugePublisher {
 public:
  HugePublisher(Participant& participant, const Topic<M>& topic)
      : writer_(participant, topic_dds_name(topic.name), ros::dds::TypeSupport(new TypeSupport<Huge<M>>),
                {.depth = 1}) {}
  void send(std::size_t octets) {
    message_.octets.resize(octets, 1);
    writer_.write(&message_);
  }

 private:
  WriterEndpoint writer_;
  Huge<M> message_;
};

[[noreturn]] void send_huge(Participant& participant) {
  HugePublisher ticks(participant, topics::time_tick);
  HugePublisher events(participant, topics::event);
  std::size_t mib = 1;
  at_rate(10, [&] {
    ticks.send(mib << 20);
    events.send(mib << 20);
    mib = mib == 64 ? 1 : 2 * mib;
  });
}

[[noreturn]] void send_random(Participant& participant) {
  std::vector<std::unique_ptr<SerializedPublisher>> publishers;
  const auto add = [&]<class M>(const Topic<M>& topic) {
    publishers.push_back(std::make_unique<SerializedPublisher>(participant, topic.name,
                                                               ros_type_name(M::dds_type_name), topic.qos));
  };
  add(topics::time_tick);
  add(topics::task_flags);
  add(topics::bus_status);
  add(topics::telecommand);
  add(topics::telecommand_report);
  add(topics::event);
  add(topics::liveness);
  add(topics::mode);
  std::mt19937_64 random(20260911);
  Octets octets;
  std::size_t next = 0;
  at_rate(5000, [&] {
    octets.resize(4 + random() % 600);
    for (std::uint8_t& octet : octets) octet = static_cast<std::uint8_t>(random());
    if (random() % 4 != 0) std::fill_n(octets.begin(), 4, std::uint8_t{0});
    octets[1] = static_cast<std::uint8_t>(random() % 2);
    publishers[next++ % publishers.size()]->publish(octets);
  });
}

[[noreturn]] void send_events(Participant& participant) {
  Publisher<srfs_msgs::msg::Event> publisher(participant, topics::event);
  srfs_msgs::msg::Event event;
  event.source = "timing";
  event.event_id = 1;
  event.severity = srfs_msgs::msg::Event::INFO;
  at_rate(20'000, [&] {
    ++event.monotonic_ns;
    publisher.publish(event);
  });
}

}  // namespace

int main(int argc, char** argv) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);  // never outlives who started it
  if (argc != 3) return 2;
  const auto participant = Participant::create({std::atoi(argv[1]), {"127.0.0.1"}});
  if (!participant) return 1;
  const std::string_view role = argv[2];
  if (role == "huge") send_huge(**participant);
  if (role == "random") send_random(**participant);
  if (role == "events") send_events(**participant);
  return 2;
}
