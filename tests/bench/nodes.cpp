// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <csignal>
#include <map>
#include <numeric>
#include <stdexcept>
#include <thread>

#include <fmt/format.h>

#include "ros/publisher.hpp"
#include "tests/bench/measures.hpp"
#include "tests/bench/suite.hpp"

namespace srfs::bench {

namespace fs = std::filesystem;

Json measure_start(const fs::path& bin, int rounds, int others) {
  const Suite suite(bin, others + 1, 0);
  const std::vector<Child> nodes = start_nodes(suite, 1, others);
  const Endpoints endpoints = endpoints_of(suite.domain(), Suite::name(1));
  StateClient client(suite.domain(), Suite::name(0));
  RawStateClient raw_client(suite.domain(), Suite::name(0));
  std::vector<double> ours;
  std::vector<double> raw;
  int unanswered = 0;
  for (int i = 0; i < rounds; ++i) {
    Child node = suite.start_node(0);
    if (const auto answered = client.ask())
      ours.push_back(ms(*answered - node.started()));
    else
      ++unanswered;
    node.end(SIGTERM);
    client.wait_until_gone();
    Child peer = suite.start_raw(0, endpoints.writers, endpoints.readers);
    if (const auto answered = raw_client.ask()) raw.push_back(ms(*answered - peer.started()));
    peer.end(SIGTERM);
    raw_client.wait_until_gone();
  }
  return {{"unit", "ms"},
          {"others", others},
          {"endpoints", endpoints.writers + endpoints.readers},
          {"unanswered", unanswered},
          {"srfs", summary(ours)},
          {"raw", summary(raw)},
          {"ratio", ratio(ours, raw)},
          {"series", {{"srfs", ours}, {"raw", raw}}}};
}

Json measure_idle(const fs::path& bin, int nodes, seconds duration) {
  // Two domains, so that nine nodes of each kind discover nine participants, not eighteen.
  const Suite ours(bin, nodes, 0);
  const Suite peers(bin, nodes, 0);
  const std::vector<Child> our_nodes = start_nodes(ours, 0, nodes);
  const Endpoints endpoints = endpoints_of(ours.domain(), Suite::name(0));
  std::vector<Child> raw_nodes;
  for (int i = 0; i < nodes; ++i)
    raw_nodes.push_back(peers.start_raw(i, endpoints.writers, endpoints.readers));
  for (int i = 0; i < nodes; ++i) RawStateClient(peers.domain(), Suite::name(i)).ask();
  std::this_thread::sleep_for(seconds(5));  // lets the clients' leases and first announcements end
  const auto before = cpu_times_of(our_nodes);
  const auto raw_before = cpu_times_of(raw_nodes);
  const MonotonicTime begun = monotonic_now();
  std::this_thread::sleep_for(duration);
  const double elapsed_ms = ms(monotonic_now() - begun);
  const auto after = cpu_times_of(our_nodes);
  const auto raw_after = cpu_times_of(raw_nodes);
  const auto json = [&](const std::vector<Child>& processes, const auto& from, const auto& to) {
    std::vector<double> pss;
    std::vector<double> own;
    std::vector<double> percent;
    for (std::size_t i = 0; i < processes.size(); ++i) {
      const Memory memory = memory_of(processes[i].pid());
      pss.push_back(memory.pss_kb / 1024);
      own.push_back(memory.private_dirty_kb / 1024);
      percent.push_back(100 * ms(to[i] - from[i]) / elapsed_ms);
    }
    return Json{{"pss_mib", spread(pss)},
                {"private_dirty_mib", spread(own)},
                {"cpu_percent", spread(percent)},
                {"cpu_percent_together", std::accumulate(percent.begin(), percent.end(), 0.0)},
                {"threads", threads_of(processes[0].pid())}};
  };
  const Json a = json(our_nodes, before, after);
  const Json b = json(raw_nodes, raw_before, raw_after);
  const auto together = [](const Json& j) { return j["cpu_percent_together"].get<double>(); };
  return {{"nodes", nodes},
          {"duration_s", duration.count()},
          {"writers", endpoints.writers},
          {"readers", endpoints.readers},
          {"srfs", a},
          {"raw", b},
          {"ratio_cpu", together(a) / together(b)},
          {"ratio_pss", a["pss_mib"]["median"].get<double>() / b["pss_mib"]["median"].get<double>()}};
}

namespace {

/// Growth in 1000 cycles, from a least-squares fit over (cycle, value).
double growth_in_1000(const std::vector<std::pair<int, double>>& points) {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (const auto& [cycle, value] : points) {
    n += 1;
    x += cycle;
    y += value;
    xx += static_cast<double>(cycle) * cycle;
    xy += cycle * value;
  }
  const double divisor = n * xx - x * x;
  return divisor == 0 ? 0 : 1000 * (n * xy - x * y) / divisor;
}

/// Kills and restarts one node while other nodes survive. All nodes share one topic and report on it which
/// nodes they hear.
class Cycles {
 public:
  Cycles(const fs::path& bin, int survivors)
      : suite_(bin, survivors + 1, 100),
        participant_(ros::Participant::create({.domain = suite_.domain(), .executor = &executor_}).value()),
        beats_(executor_, *participant_, beat_topic,
               [this](const Beat& beat, const ros::MessageInfo&) { last_[beat.source.name] = beat; }),
        survivors_(start_nodes(suite_, 1, survivors)),
        raw_server_(suite_.start_raw(0, 1, 1)),
        victim_(suite_.start_node(0)) {
    if (!RawStateClient(suite_.domain(), Suite::name(0)).ask())
      throw std::runtime_error("the raw server is not up");
    if (!wait_until_linked(0)) throw std::runtime_error("the nodes did not find each other");
    files_before_ = files();
    for (const Child& node : survivors_) descriptors_before_.push_back(descriptors_of(node.pid()));
  }

  void run(int cycles) {
    const int every = std::max(1, cycles / 50);
    for (int cycle = 0; cycle < cycles; ++cycle) {
      const std::uint32_t before = last_[Suite::name(0)].source.incarnation;
      victim_.end(SIGKILL);
      ask_survivor(1 + cycle % static_cast<int>(survivors_.size()));
      ask_raw_server();
      victim_ = suite_.start_node(0);
      if (wait_until_linked(before))
        linked_ms_.push_back(ms(monotonic_now() - victim_.started()));
      else
        ++lost_links_;
      if (cycle % every == 0 || cycle + 1 == cycles) weigh(cycle);
    }
    done_ = cycles;
  }

  Json judge() {
    const bool settled =
        executor_.spin_until([this] { return counts_are_right(); }, monotonic_now() + longest_wait);
    Json descriptors = Json::array();
    for (std::size_t i = 0; i < survivors_.size(); ++i) {
      const auto now = static_cast<int>(descriptors_of(survivors_[i].pid()));
      descriptors.push_back(now - static_cast<int>(descriptors_before_[i]));
    }
    std::vector<std::string> leaked;
    const auto now = files();
    std::set_difference(now.begin(), now.end(), files_before_.begin(), files_before_.end(),
                        std::back_inserter(leaked));
    return {{"unit", "ms"},
            {"cycles", done_},
            {"survivors", survivors_.size()},
            {"lost_links", lost_links_},
            {"matched_counts_right_after_the_last", settled},
            {"leaked_files", leaked},
            {"descriptors_more", descriptors},
            {"own_memory_growth_kb_in_1000", growth(private_kb_)},
            {"raw_own_memory_growth_kb_in_1000", growth({raw_kb_})[0]},
            {"pss_growth_kb_in_1000", growth(pss_kb_)},
            {"fresh_client",
             {{"srfs", summary(fresh_ms_)},
              {"raw", summary(fresh_raw_ms_)},
              {"ratio", ratio(fresh_ms_, fresh_raw_ms_)},
              {"unanswered", unanswered_}}},
            {"exec_to_linked", summary(linked_ms_)},
            {"series", {{"fresh_client", fresh_ms_}, {"own_memory_kb", private_kb_}}}};
  }

 private:
  using Weights = std::vector<std::vector<std::pair<int, double>>>;

  /// A survivor that has seen all kills must still answer a new process.
  void ask_survivor(int i) {
    const MonotonicTime begun = monotonic_now();
    StateClient client(suite_.domain(), Suite::name(i));
    if (const auto answered = client.ask())
      fresh_ms_.push_back(ms(*answered - begun));
    else
      ++unanswered_;
  }
  void ask_raw_server() {
    const MonotonicTime begun = monotonic_now();
    RawStateClient client(suite_.domain(), Suite::name(0));
    if (const auto answered = client.ask()) fresh_raw_ms_.push_back(ms(*answered - begun));
  }

  static std::uint32_t heard(const Beat& beat, const std::string& name) {
    for (const Heard& h : beat.heard) {
      if (h.name == name) return h.incarnation;
    }
    return 0;
  }
  /// Waits until the victim's new incarnation hears every survivor and every survivor hears it.
  bool wait_until_linked(std::uint32_t before) {
    return executor_.spin_until(
        [&] {
          const Beat& victim = last_[Suite::name(0)];
          if (victim.source.incarnation <= before) return false;
          for (std::size_t i = 1; i <= survivors_.size(); ++i) {
            const std::string name = Suite::name(static_cast<int>(i));
            if (heard(last_[name], Suite::name(0)) != victim.source.incarnation || heard(victim, name) == 0)
              return false;
          }
          return true;
        },
        monotonic_now() + longest_wait);
  }
  /// Whether no endpoint is still matched with a dead process: each node counts the publishers of all nodes,
  /// including its own, and their subscribers plus that of this process.
  bool counts_are_right() {
    const std::size_t all = survivors_.size() + 1;
    return std::all_of(last_.begin(), last_.end(), [&](const auto& entry) {
      return entry.second.publishers == all && entry.second.subscribers == all + 1;
    });
  }
  /// Files in the suite's folder, and files that a middleware could leave elsewhere.
  [[nodiscard]] std::vector<std::string> files() const {
    std::vector<std::string> all = files_below(suite_.folder(), true);
    for (const char* shared : {"/dev/shm", "/tmp"}) {
      for (const std::string& file : files_below(shared, false)) {
        if (file.find("fast") != std::string::npos) all.push_back(file);
      }
    }
    std::sort(all.begin(), all.end());
    return all;
  }
  void weigh(int cycle) {
    raw_kb_.emplace_back(cycle, memory_of(raw_server_.pid()).private_dirty_kb);
    pss_kb_.resize(survivors_.size());
    private_kb_.resize(survivors_.size());
    for (std::size_t i = 0; i < survivors_.size(); ++i) {
      const Memory memory = memory_of(survivors_[i].pid());
      pss_kb_[i].emplace_back(cycle, memory.pss_kb);
      private_kb_[i].emplace_back(cycle, memory.private_dirty_kb);
    }
  }
  /// Growth of each survivor, without the first quarter, in which pools reach their size.
  static Json growth(const Weights& weights) {
    Json out = Json::array();
    for (auto points : weights) {
      points.erase(points.begin(), points.begin() + static_cast<std::ptrdiff_t>(points.size() / 4));
      out.push_back(growth_in_1000(points));
    }
    return out;
  }

  Suite suite_;
  ros::Executor executor_;
  std::unique_ptr<ros::Participant> participant_;
  std::map<std::string, Beat> last_;
  ros::Subscription<Beat> beats_;
  std::vector<Child> survivors_;
  Child raw_server_;
  Child victim_;
  std::vector<std::string> files_before_;
  std::vector<std::size_t> descriptors_before_;
  int done_ = 0;
  int lost_links_ = 0;
  int unanswered_ = 0;
  std::vector<double> fresh_ms_;
  std::vector<double> fresh_raw_ms_;
  std::vector<double> linked_ms_;
  Weights pss_kb_;
  Weights private_kb_;
  std::vector<std::pair<int, double>> raw_kb_;
};

}  // namespace

Json measure_cycles(const fs::path& bin, int cycles, int survivors) {
  Cycles measurement(bin, survivors);
  measurement.run(cycles);
  return measurement.judge();
}

}  // namespace srfs::bench
