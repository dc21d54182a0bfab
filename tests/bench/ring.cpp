// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <sys/file.h>

#include <fcntl.h>
#include <csignal>
#include <ctime>
#include <numeric>
#include <sstream>
#include <stdexcept>

#include "base/cpu_wait.hpp"
#include "base/file.hpp"
#include "ros/publisher.hpp"
#include "suite/ring/process_cpu.hpp"
#include "suite/topics.hpp"
#include "tests/bench/measures.hpp"
#include "tests/bench/suite.hpp"

namespace srfs::bench {
namespace {

namespace fs = std::filesystem;

/// Signals the start and the end like `srfs up` and `srfs down`: the ring neither misses nodes that are not
/// yet started nor restarts nodes that were ended.
class UpAndDown {
 public:
  explicit UpAndDown(const Suite& suite) : suite_(suite) {
    fs::create_directories(suite.var().run());
    lock_ = Fd(open(suite.var().starting_lock().c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644));
    if (!lock_ || flock(lock_.get(), LOCK_EX) != 0) throw std::runtime_error("no lock for the start");
  }
  void all_are_up() { lock_.reset(); }
  void end() { (void)write_file_atomically(suite_.var().stopping_flag(), "bench\n"); }

 private:
  const Suite& suite_;
  Fd lock_;
};

/// Running nodes with the ring.
struct RingNodes {
  RingNodes(const fs::path& bin, int count)
      : suite(bin, count, 0, Suite::Ring::on), up_and_down(suite), nodes(start_nodes(suite, 0, count)) {
    up_and_down.all_are_up();
  }
  ~RingNodes() { up_and_down.end(); }
  RingNodes(const RingNodes&) = delete;
  RingNodes& operator=(const RingNodes&) = delete;

  Suite suite;
  UpAndDown up_and_down;
  std::vector<Child> nodes;
};

struct RawNodes {
  enum class Asks : bool { nobody, the_next };
  RawNodes(const fs::path& bin, int count, Endpoints endpoints, Asks asks) : suite(bin, count, 0) {
    for (int i = 0; i < count; ++i) {
      std::vector<int> asked;
      if (asks == Asks::the_next) asked.push_back((i + 1) % count);
      nodes.push_back(suite.start_raw(i, endpoints.writers, endpoints.readers, asked));
    }
    for (int i = 0; i < count; ++i) {
      if (!RawStateClient(suite.domain(), Suite::name(i)).ask())
        throw std::runtime_error("a raw peer did not come up");
    }
  }
  /// Ends the nodes. @return the numbers of their requests and answers
  Json end() {
    for (Child& node : nodes) node.end(SIGTERM);
    std::ifstream log(suite.folder() / "bench.log");
    std::uint64_t asked = 0;
    std::uint64_t answered = 0;
    for (std::string line; std::getline(log, line);) {
      std::istringstream words(line);
      std::string name;
      std::string verb;
      std::uint64_t a = 0;
      std::uint64_t b = 0;
      if (words >> name >> verb >> a && verb == "asked" && words >> verb >> b) {
        asked += a;
        answered += b;
      }
    }
    return {{"asked", asked}, {"answered", answered}};
  }

  Suite suite;
  std::vector<Child> nodes;
};

/// Collects the ring's reports about itself for @p time.
Json listen_to_the_ring(int domain, seconds time) {
  ros::Executor executor;
  const auto participant = ros::Participant::create({.domain = domain, .executor = &executor}).value();
  std::uint64_t alive = 0;
  std::uint64_t misses = 0;
  std::uint64_t others = 0;
  std::optional<MonotonicTime> first;
  MonotonicTime last;
  const ros::Subscription<srfs_msgs::msg::LivenessReport> reports(
      executor, *participant, suite::topics::liveness,
      [&](const srfs_msgs::msg::LivenessReport& r, const ros::MessageInfo&) {
        if (!first) first = monotonic_now();
        last = monotonic_now();
        using Report = srfs_msgs::msg::LivenessReport;
        ++(r.verdict == Report::ALIVE ? alive : r.verdict == Report::MISS ? misses : others);
      });
  executor.spin_until([] { return false; }, monotonic_now() + time);
  const double heard_s = first ? ms(last - *first) / 1000 : 0;
  return {{"checks_answered_per_s", heard_s > 0 ? static_cast<double>(alive) / heard_s : 0},
          {"misses", misses},
          {"other_verdicts", others}};
}

/// CPU time of this thread.
nanoseconds own_time() {
  timespec used{};
  if (clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used) != 0) throw std::runtime_error("no clock of CPU time");
  return seconds(used.tv_sec) + nanoseconds(used.tv_nsec);
}

/// Mean of many calls, in microseconds of CPU time.
template <class F>
double cost_us(F&& read) {
  constexpr int calls = 2000;
  const nanoseconds begin = own_time();
  for (int i = 0; i < calls; ++i) read();
  return ms(own_time() - begin) * 1000 / calls;
}

/// Cost of the kernel's evidence about CPU use (decision 0022) while no node is in doubt. Each node reads its
/// own data and the next node's in each round, and the next node's threads and /proc/stat each second.
Json measure_evidence(pid_t pid, int nodes) {
  auto process = suite::ProcessCpu::open(pid);
  if (!process) throw std::runtime_error("this kernel does not tell who waits for a CPU");
  const double read_us = cost_us([&] { (void)process->read(false, monotonic_now()); });
  const double doubt_us = cost_us([&] { (void)process->read(true, monotonic_now()); });
  const double threads_us = cost_us([&] { (void)process->count_busy_threads(monotonic_now()); });
  StolenTime stolen;
  const double stat_us =
      cost_us([&] { (void)stolen.on_reading(read_file("/proc/stat", 1U << 20U).value_or("")); });
  const double rounds_per_s = 1000.0 / static_cast<double>(check_period.count());
  const double node_us = 2 * rounds_per_s * read_us + threads_us + stat_us;
  return {{"read_us", read_us},
          {"read_in_doubt_us", doubt_us},
          {"threads_us", threads_us},
          {"proc_stat_us", stat_us},
          {"percent_together", nodes * node_us / 1e4}};
}

std::vector<std::uint32_t> incarnations(const Suite& suite, int nodes) {
  std::vector<std::uint32_t> numbers;
  for (int i = 0; i < nodes; ++i) {
    const auto instance = suite::find_instance(suite.var(), Suite::name(i));
    numbers.push_back(instance ? instance->incarnation : 0);
  }
  return numbers;
}

}  // namespace

Json measure_ring(const fs::path& bin, int nodes, seconds duration) {
  RingNodes with_ring(bin, nodes);
  const Suite idle_suite(bin, nodes, 0);
  const std::vector<Child> without_ring = start_nodes(idle_suite, 0, nodes);
  const Endpoints endpoints = endpoints_of(idle_suite.domain(), Suite::name(0));
  // Like the ring while no node is in doubt.
  RawNodes raw(bin, nodes, endpoints, RawNodes::Asks::the_next);
  const RawNodes raw_idle(bin, nodes, endpoints, RawNodes::Asks::nobody);
  std::this_thread::sleep_for(seconds(5));  // lets the clients' leases and first announcements end

  const std::vector<std::pair<const char*, const std::vector<Child>*>> kinds{{"ring", &with_ring.nodes},
                                                                             {"no_ring", &without_ring},
                                                                             {"raw", &raw.nodes},
                                                                             {"raw_idle", &raw_idle.nodes}};
  const auto started_as = incarnations(with_ring.suite, nodes);
  std::vector<std::vector<nanoseconds>> before;
  for (const auto& [name, processes] : kinds) before.push_back(cpu_times_of(*processes));
  const MonotonicTime begun = monotonic_now();
  std::this_thread::sleep_for(duration);
  const double elapsed_ms = ms(monotonic_now() - begun);
  Json percent;
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    const auto after = cpu_times_of(*kinds[k].second);
    double together = 0;
    for (std::size_t i = 0; i < after.size(); ++i) together += 100 * ms(after[i] - before[k][i]) / elapsed_ms;
    percent[kinds[k].first] = together;
  }
  const Json evidence = measure_evidence(with_ring.nodes.front().pid(), nodes);
  const Json heard = listen_to_the_ring(with_ring.suite.domain(), seconds(3));
  const bool nobody_died = started_as == incarnations(with_ring.suite, nodes);

  const auto of = [&](const char* kind) { return percent[kind].get<double>(); };
  const double ring = of("ring") - of("no_ring");
  const double requests = of("raw") - of("raw_idle");
  return {{"nodes", nodes},
          {"period_ms", check_period.count()},
          {"duration_s", duration.count()},
          {"cpu_percent_together", percent},
          {"ring_cpu_percent", ring},
          {"raw_cpu_percent", requests},
          {"ratio", ring / requests},
          {"ratio_whole_processes", of("ring") / of("raw")},
          {"evidence", evidence},
          {"heard", heard},
          {"raw_requests", raw.end()},
          {"nobody_died", nobody_died}};
}

}  // namespace srfs::bench
