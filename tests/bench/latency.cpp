// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <csignal>
#include <cstring>
#include <functional>
#include <stdexcept>
#include <thread>

#include <arpa/inet.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/fd.hpp"
#include "ros/client.hpp"
#include "ros/datagram_seal.hpp"
#include "ros/publisher.hpp"
#include "ros/service.hpp"
#include "tests/bench/measures.hpp"
#include "tests/bench/raw_dds.hpp"
#include "tests/dds_domain.hpp"
#include "tests/signal_child.hpp"

namespace srfs::bench {
namespace {

/// Request and reply with the size of the topic's message, for our code and the peer alike.
struct Echo {
  using Request = Probe;
  using Response = Probe;
};

const ros::Topic<Probe> there_topic{"/bench/there", {.depth = 8}, ros::Priority::time};
const ros::Topic<Probe> back_topic{"/bench/back", {.depth = 8}, ros::Priority::time};
constexpr const char* raw_there = "bench_raw/there";
constexpr const char* raw_back = "bench_raw/back";

Probe probe(std::uint32_t number) {
  return {.sent_ns = monotonic_now().ns(), .number = number};
}

/// The answer to a probe that has just arrived.
Probe echo_of(const Probe& p) {
  const std::int64_t now = monotonic_now().ns();
  return {.sent_ns = now, .there_ns = now - p.sent_ns, .number = p.number};
}

sockaddr_in loopback(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

[[noreturn]] void echo_udp(int s) {
  std::array<char, sizeof(Probe)> buffer{};
  sockaddr_in from{};
  while (true) {
    socklen_t length = sizeof from;
    const ssize_t n =
        recvfrom(s, buffer.data(), buffer.size(), 0, reinterpret_cast<sockaddr*>(&from), &length);
    if (n != static_cast<ssize_t>(sizeof(Probe))) continue;
    Probe p;
    std::memcpy(&p, buffer.data(), sizeof p);
    p = echo_of(p);
    sendto(s, &p, sizeof p, 0, reinterpret_cast<sockaddr*>(&from), length);
  }
}

[[noreturn]] void echo_process(int domain, int udp_socket) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  ros::Executor executor;
  const auto participant = ros::Participant::create({.domain = domain, .executor = &executor}).value();
  ros::Publisher<Probe> back(*participant, back_topic);
  const ros::Subscription<Probe> there(
      executor, *participant, there_topic,
      [&](const Probe& p, const ros::MessageInfo&) { back.publish(echo_of(p)); });
  const ros::Service<Echo> service(executor, *participant, "/bench/echo", {}, ros::Priority::liveness,
                                   [](const Probe& request, Probe& response) { response = request; });
  const auto raw = raw_participant(domain);
  RawWriter<Probe> raw_out(*raw, raw_back, there_topic.qos);
  const RawReader<Probe> raw_in(
      *raw, raw_there, there_topic.qos,
      [&](const Probe& p, const ros::dds::SampleInfo&) { raw_out.write(echo_of(p)); });
  const RawService raw_service(*raw, "bench_raw/echo");
  const std::jthread udp(echo_udp, udp_socket);
  executor.spin();
  _exit(0);
}

/// Measurements of one transport, in microseconds.
struct Samples {
  std::vector<double> there;
  std::vector<double> back;
  int lost = 0;
  void add(const Probe& echo, MonotonicTime arrived) {
    there.push_back(static_cast<double>(echo.there_ns) / 1e3);
    back.push_back(static_cast<double>(arrived.ns() - echo.sent_ns) / 1e3);
  }
  /// Both directions, in the order of measurement.
  [[nodiscard]] std::vector<double> one_way() const {
    std::vector<double> all;
    for (std::size_t i = 0; i < there.size(); ++i) all.insert(all.end(), {there[i], back[i]});
    return all;
  }
  [[nodiscard]] Json json() const {
    return {
        {"one_way", summary(one_way())}, {"there", summary(there)}, {"back", summary(back)}, {"lost", lost}};
  }
};

/// Our side: topic and service over lib/ros, on this thread's executor.
class Ours {
 public:
  explicit Ours(int domain)
      : participant_(ros::Participant::create({.domain = domain, .executor = &executor_}).value()),
        there_(*participant_, there_topic),
        back_(executor_, *participant_, back_topic,
              [this](const Probe& p, const ros::MessageInfo&) {
                arrived_ = monotonic_now();
                echo_ = p;
              }),
        client_(executor_, *participant_, "/bench/echo", {}, ros::Priority::liveness) {}

  bool wait_for_peer() {
    return executor_.spin_until(
        [&] { return client_.is_ready() && there_.subscription_count() > 0 && back_.publisher_count() > 0; },
        monotonic_now() + seconds(20));
  }
  void topic(std::uint32_t n, Samples& samples) {
    there_.publish(probe(n));
    if (spin_while([&] { return echo_.number != n; }))
      samples.add(echo_, arrived_);
    else
      ++samples.lost;
  }
  void service(std::uint32_t n, std::vector<double>& round_trips) {
    std::optional<MonotonicTime> answered;
    const MonotonicTime sent = monotonic_now();
    const auto id = client_.call(probe(n), seconds(1), 1, [&](const Result<Probe, ros::CallError>& reply) {
      if (reply) answered = monotonic_now();
    });
    spin_while([&] { return !answered; });
    client_.forget(id);
    if (answered) round_trips.push_back(static_cast<double>((*answered - sent).count()) / 1e3);
  }

 private:
  /// Waits like a node until input arrives. @return whether the wait ended within a second
  template <class Waiting>
  bool spin_while(Waiting waiting) {
    const MonotonicTime give_up = monotonic_now() + seconds(1);
    while (waiting()) {
      if (monotonic_now() > give_up) return false;
      executor_.spin_once(nanoseconds::max());
    }
    return true;
  }

  ros::Executor executor_;
  ros::Timer look_again_ = executor_.add_timer(monotonic_now(), milliseconds(500), [] {});
  std::unique_ptr<ros::Participant> participant_;
  ros::Publisher<Probe> there_;
  ros::Subscription<Probe> back_;
  ros::Client<Echo> client_;
  Probe echo_;
  MonotonicTime arrived_;
};

/// The same on raw Fast DDS: listeners take the samples, and this thread only waits for them.
class Raw {
 public:
  explicit Raw(int domain)
      : participant_(raw_participant(domain)),
        out_(*participant_, raw_there, there_topic.qos),
        in_(*participant_, raw_back, there_topic.qos,
            [this](const Probe& p, const ros::dds::SampleInfo&) {
              const MonotonicTime now = monotonic_now();
              const std::lock_guard lock(mutex_);
              arrived_ = now;
              echo_ = p;
              changed_.notify_one();
            }),
        client_(*participant_, "bench_raw/echo") {}

  [[nodiscard]] bool is_ready() const { return out_.is_matched() && in_.is_matched() && client_.is_ready(); }
  void topic(std::uint32_t n, Samples& samples) {
    out_.write(probe(n));
    std::unique_lock lock(mutex_);
    if (changed_.wait_for(lock, seconds(1), [&] { return echo_.number == n; }))
      samples.add(echo_, arrived_);
    else
      ++samples.lost;
  }
  void service(std::uint32_t n, std::vector<double>& round_trips) {
    const MonotonicTime sent = monotonic_now();
    if (const auto answered = client_.call(n, seconds(1)))
      round_trips.push_back(static_cast<double>((*answered - sent).count()) / 1e3);
  }

 private:
  std::unique_ptr<ros::Participant> participant_;
  std::mutex mutex_;
  std::condition_variable changed_;
  Probe echo_;
  MonotonicTime arrived_;
  RawWriter<Probe> out_;
  RawReader<Probe> in_;
  RawClient client_;
};

/// The lower bound: one datagram in each direction.
class Udp {
 public:
  Udp() : ours_(open_socket()), peer_(open_socket()) {}
  [[nodiscard]] int peer_socket() const { return peer_.get(); }
  void topic(std::uint32_t n, Samples& samples) {
    sockaddr_in to{};
    socklen_t length = sizeof to;
    getsockname(peer_.get(), reinterpret_cast<sockaddr*>(&to), &length);
    Probe p = probe(n);
    sendto(ours_.get(), &p, sizeof p, 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
    if (recv(ours_.get(), &p, sizeof p, 0) == static_cast<ssize_t>(sizeof p) && p.number == n)
      samples.add(p, monotonic_now());
    else
      ++samples.lost;
  }

 private:
  static Fd open_socket() {
    Fd fd(socket(AF_INET, SOCK_DGRAM, 0));
    const sockaddr_in me = loopback(0);
    if (bind(fd.get(), reinterpret_cast<const sockaddr*>(&me), sizeof me) != 0)
      throw std::runtime_error("bind: " + errno_text(errno));
    const timeval limit{1, 0};
    setsockopt(fd.get(), SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    return fd;
  }
  Fd ours_;
  Fd peer_;
};

struct Results {
  Samples ours;
  Samples raw;
  Samples udp;
  std::vector<double> our_service;
  std::vector<double> raw_service;
};

void run_rounds(const LatencyOptions& options, Ours& ours, Raw& raw, Udp& udp, Results& results) {
  std::uint32_t n = 1;
  std::vector<std::function<void()>> ways{
      [&] { ours.topic(n, results.ours); }, [&] { raw.topic(n, results.raw); },
      [&] { ours.service(n, results.our_service); }, [&] { raw.service(n, results.raw_service); },
      [&] { udp.topic(n, results.udp); }};
  constexpr int warm_up = 50;
  for (int round = -warm_up; round < options.rounds; ++round) {
    if (round == 0) results = {};
    std::rotate(ways.begin(), ways.begin() + 1, ways.end());  // no transport always follows the same one
    for (const auto& way : ways) {
      if (options.pause > milliseconds(0)) std::this_thread::sleep_for(options.pause);
      ++n;
      way();
    }
  }
}

}  // namespace

Json measure_latency(const LatencyOptions& options) {
  if (options.fifo_priority > 0) {
    if (const std::string why = set_fifo(options.fifo_priority); !why.empty()) throw std::runtime_error(why);
  }
  if (options.sealed) ros::seal_datagrams({ros::SealKey{1, 2, 3}}, [] { return std::nullopt; });
  const int domain = testing_support::own_domain();
  Udp udp;
  const pid_t echo = fork();
  if (echo < 0) throw std::runtime_error("fork failed");
  if (echo == 0) {
    if (options.pinned) pin(1);
    echo_process(domain, udp.peer_socket());
  }
  if (options.pinned) pin(0);
  Results results;
  bool ready = false;
  {
    Ours ours(domain);
    Raw raw(domain);
    ready = ours.wait_for_peer();
    for (int i = 0; ready && i < 2000 && !raw.is_ready(); ++i) std::this_thread::sleep_for(milliseconds(10));
    if (ready) run_rounds(options, ours, raw, udp, results);
  }
  testing_support::signal_child(echo, SIGKILL);
  waitpid(echo, nullptr, 0);
  if (!ready) throw std::runtime_error("the echoing process was not found");
  return {{"unit", "us"},
          {"octets", ros::encoded_size(Probe{})},
          {"pause_ms", options.pause.count()},
          {"pinned", options.pinned},
          {"scheduling",
           options.fifo_priority > 0 ? "SCHED_FIFO " + std::to_string(options.fifo_priority) : "normal"},
          {"topic",
           {{"srfs", results.ours.json()},
            {"raw", results.raw.json()},
            {"udp", results.udp.json()},
            {"ratio", ratio(results.ours.one_way(), results.raw.one_way())}}},
          {"service",
           {{"srfs", summary(results.our_service)},
            {"raw", summary(results.raw_service)},
            {"ratio", ratio(results.our_service, results.raw_service)}}}};
}

}  // namespace srfs::bench
