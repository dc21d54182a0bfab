// Latency of the ROS 2 layer beside raw Fast DDS (same transport and QoS, listener callback) and a bare UDP
// socket, two processes, one run, rounds interleaved so that all of them meet the same machine. Prints one
// JSON object.

#include <algorithm>
#include <condition_variable>
#include <cstdio>
#include <cstring>
#include <functional>
#include <map>
#include <mutex>
#include <thread>

#include <arpa/inet.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "ros/client.hpp"
#include "ros/publisher.hpp"
#include "ros/service.hpp"
#include "srfs_msgs/msg/peripheral_reset.hpp"
#include "srfs_msgs/srv/check_alive.hpp"
#include "tests/dds_domain.hpp"

namespace srfs {
namespace {

using Json = nlohmann::ordered_json;
using srfs_msgs::srv::CheckAlive;
// A message whose payload is 64 octets on the wire: header 4, two u32, two strings.
using Probe = srfs_msgs::msg::PeripheralReset;

const ros::Topic<Probe> ping_topic{"/bench/ping", {.depth = 8}, ros::Priority::time};
const ros::Topic<Probe> pong_topic{"/bench/pong", {.depth = 8}, ros::Priority::time};

Probe probe(std::uint32_t n) {
  Probe p;
  p.grant_counter = n;
  p.payload = "payload_eps_0123";
  p.reason = "0123456789012345";
  return p;
}

Json percentiles(std::vector<double> us) {
  std::sort(us.begin(), us.end());
  const auto at = [&](double q) {
    return us[std::min(us.size() - 1, static_cast<std::size_t>(q * static_cast<double>(us.size())))];
  };
  return {{"p50_us", at(0.50)}, {"p99_us", at(0.99)}, {"max_us", us.back()}, {"samples", us.size()}};
}

/// One way of sending a probe there and back. round_trip blocks until the echo came, or returns false after 1
/// s.
struct Path {
  std::function<bool(std::uint32_t)> round_trip;
  std::vector<double> us;
};

// --- raw Fast DDS: listener callbacks on the receive thread, the least a Fast DDS user can do
// -----------------------------

class RawListener : public ros::dds::DataReaderListener {
 public:
  std::function<void(const Probe&)> on_probe;
  void on_data_available(ros::dds::DataReader* reader) override {
    ros::Sample<Probe> sample;
    ros::dds::SampleInfo info;
    while (reader->take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK) {
      if (info.valid_data && sample.well_formed) on_probe(sample.message);
    }
  }
};

struct RawDds {
  RawListener listener;
  ros::dds::DataWriter* writer;
  ros::dds::DataReader* reader;
  RawDds(ros::Participant& participant, const char* out, const char* in)
      : writer(participant.create_writer(out, ros::dds::TypeSupport(new ros::TypeSupport<Probe>),
                                         {.depth = 8}, nullptr)),
        reader(nullptr) {
    reader = participant.create_reader(in, ros::dds::TypeSupport(new ros::TypeSupport<Probe>), {.depth = 8},
                                       &listener);
  }
};

// --- the echoing process
// ---------------------------------------------------------------------------------------------------

/// As the deployment pins a time-critical node: all threads of a process on one CPU.
void pin(int cpu) {
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(static_cast<unsigned>(cpu), &set);
  sched_setaffinity(0, sizeof set, &set);
}

[[noreturn]] void echo_process(int domain, int udp_port, bool pinned) {
  if (pinned) pin(1);
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  ros::Executor executor;
  auto ros_participant = ros::Participant::create({domain, {"127.0.0.1"}, &executor}).value();
  auto raw_participant = ros::Participant::create({domain, {"127.0.0.1"}}).value();
  ros::Publisher<Probe> pong(*ros_participant, pong_topic);
  const ros::Subscription<Probe> ping(executor, *ros_participant, ping_topic,
                                      [&](const Probe& p, const ros::MessageInfo&) { pong.publish(p); });
  const ros::Service<CheckAlive> service(
      executor, *ros_participant, "/bench/check", {}, ros::Priority::liveness,
      [](const CheckAlive::Request& q, CheckAlive::Response& r) { r.nonce = q.nonce; });
  RawDds raw(*raw_participant, "bench_raw_pong", "bench_raw_ping");
  raw.listener.on_probe = [&](const Probe& p) { raw.writer->write(const_cast<Probe*>(&p)); };
  RawDds raw_service(*raw_participant, "bench_raw_reply", "bench_raw_request");
  raw_service.listener.on_probe = [&](const Probe& p) { raw_service.writer->write(const_cast<Probe*>(&p)); };
  std::thread udp([udp_port] {
    const int s = socket(AF_INET, SOCK_DGRAM, 0);
    sockaddr_in me{};
    me.sin_family = AF_INET;
    me.sin_port = htons(static_cast<std::uint16_t>(udp_port));
    me.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    bind(s, reinterpret_cast<sockaddr*>(&me), sizeof me);
    char buffer[256];
    sockaddr_in from{};
    while (true) {
      socklen_t length = sizeof from;
      const ssize_t n = recvfrom(s, buffer, sizeof buffer, 0, reinterpret_cast<sockaddr*>(&from), &length);
      if (n > 0)
        sendto(s, buffer, static_cast<std::size_t>(n), 0, reinterpret_cast<sockaddr*>(&from), length);
    }
  });
  executor.spin();
  _exit(0);
}

// --- the measuring process
// -------------------------------------------------------------------------------------------------

/// A raw Fast DDS user who waits for an echo: condition variable between listener and main thread.
class RawEcho {
 public:
  RawEcho(ros::Participant& participant, const char* out, const char* in) : dds_(participant, out, in) {
    dds_.listener.on_probe = [this](const Probe& p) {
      const std::lock_guard lock(mutex_);
      last_ = p.grant_counter;
      arrived_at_ = monotonic_now();
      changed_.notify_one();
    };
  }
  bool round_trip(std::uint32_t n, MonotonicTime& arrived) {
    const Probe p = probe(n);
    dds_.writer->write(const_cast<Probe*>(&p));
    std::unique_lock lock(mutex_);
    const bool came = changed_.wait_for(lock, seconds(1), [&] { return last_ == n; });
    arrived = arrived_at_;
    return came;
  }

 private:
  RawDds dds_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::uint32_t last_ = 0;
  MonotonicTime arrived_at_;
};

int measure(int rounds, milliseconds pause, bool pinned) {
  const int domain = testing_support::own_domain();
  const int udp_port = 20000 + getpid() % 20000;
  const pid_t echo = fork();
  if (echo == 0) echo_process(domain, udp_port, pinned);
  if (pinned) pin(0);

  ros::Executor executor;
  auto ros_participant = ros::Participant::create({domain, {"127.0.0.1"}, &executor}).value();
  auto raw_participant = ros::Participant::create({domain, {"127.0.0.1"}}).value();
  std::uint32_t echoed = 0;
  MonotonicTime arrived;
  ros::Publisher<Probe> ping(*ros_participant, ping_topic);
  const ros::Subscription<Probe> pong(executor, *ros_participant, pong_topic,
                                      [&](const Probe& p, const ros::MessageInfo&) {
                                        arrived = monotonic_now();
                                        echoed = p.grant_counter;
                                      });
  ros::Client<CheckAlive> client(executor, *ros_participant, "/bench/check", {}, ros::Priority::liveness);
  RawEcho raw(*raw_participant, "bench_raw_ping", "bench_raw_pong");
  RawEcho raw_request(*raw_participant, "bench_raw_request", "bench_raw_reply");
  const int udp = socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<std::uint16_t>(udp_port));
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const timeval limit{1, 0};
  setsockopt(udp, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);

  std::map<std::string, Path> paths;
  paths["srfs_topic"].round_trip = [&](std::uint32_t n) {
    ping.publish(probe(n));
    while (echoed != n) {
      if (!executor.spin_once(seconds(1))) return false;
    }
    return true;
  };
  paths["raw_topic"].round_trip = [&](std::uint32_t n) { return raw.round_trip(n, arrived); };
  paths["srfs_service"].round_trip = [&](std::uint32_t n) {
    CheckAlive::Request request;
    request.nonce = n;
    bool done = false;
    client.call(request, seconds(1), 1, [&](const Result<CheckAlive::Response, ros::CallError>& r) {
      arrived = monotonic_now();
      done = r.has_value();
    });
    while (!done) {
      if (!executor.spin_once(seconds(1))) return false;
    }
    return true;
  };
  paths["raw_service"].round_trip = [&](std::uint32_t n) { return raw_request.round_trip(n, arrived); };
  paths["udp"].round_trip = [&](std::uint32_t n) {
    char buffer[64] = {};
    std::memcpy(buffer, &n, sizeof n);
    sendto(udp, buffer, sizeof buffer, 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
    const bool came = recv(udp, buffer, sizeof buffer, 0) > 0;
    arrived = monotonic_now();
    return came;
  };

  executor.spin_until(
      [&] { return client.is_ready() && ping.subscription_count() > 0 && pong.publisher_count() > 0; },
      monotonic_now() + seconds(10));
  std::uint32_t n = 1;
  for (auto& [name, path] : paths) {
    for (int i = 0; i < 50; ++i) path.round_trip(n++);  // warm-up, also waits for the raw endpoints' match
  }
  std::vector<Path*> order;
  for (auto& [name, path] : paths) order.push_back(&path);
  for (int round = 0; round < rounds; ++round) {
    // Each path is first after the pause equally often: whoever is, finds the CPU asleep.
    std::rotate(order.begin(), order.begin() + 1, order.end());
    for (Path* path : order) {
      const MonotonicTime sent = monotonic_now();
      if (path->round_trip(n++)) path->us.push_back(static_cast<double>((arrived - sent).count()) / 1000.0);
    }
    if (pause > milliseconds(0))
      std::this_thread::sleep_for(pause);  // the rate of the flight topics, not a test
  }
  kill(echo, SIGKILL);
  waitpid(echo, nullptr, 0);

  Json out{{"benchmark", "ros_latency"},
           {"payload_octets", ros::encoded_size(probe(1))},
           {"pinned", pinned},
           {"unit", "round trip, microseconds; one way is half"}};
  for (auto& [name, path] : paths) out[name] = percentiles(path.us);
  const auto ratio = [&](const char* ours, const char* peer, const char* q) {
    return out[ours][q].get<double>() / out[peer][q].get<double>();
  };
  out["ratio_topic_to_raw"] = {{"p50", ratio("srfs_topic", "raw_topic", "p50_us")},
                               {"p99", ratio("srfs_topic", "raw_topic", "p99_us")}};
  out["ratio_service_to_raw"] = {{"p50", ratio("srfs_service", "raw_service", "p50_us")},
                                 {"p99", ratio("srfs_service", "raw_service", "p99_us")}};
  std::printf("%s\n", out.dump().c_str());
  return 0;
}

}  // namespace
}  // namespace srfs

int main(int argc, char** argv) {
  CLI::App app{"Topic and service latency of lib/ros beside raw Fast DDS and a UDP socket"};
  int rounds = 3000;
  int pause_ms = 1;
  app.add_option("--rounds", rounds)->check(CLI::Range(10, 1000000))->capture_default_str();
  app.add_option("--pause-ms", pause_ms, "Between rounds")->check(CLI::Range(0, 1000))->capture_default_str();
  bool pinned = false;
  app.add_flag("--pinned", pinned, "Each process on one CPU, as the deployment pins time-critical nodes");
  CLI11_PARSE(app, argc, argv);
  return srfs::measure(rounds, srfs::milliseconds(pause_ms), pinned);
}
