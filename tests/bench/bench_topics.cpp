// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Subscribes to the mission topics of the running suite and receives them like a node (lib/ros, one work
// thread, SCHED_FIFO on request). For each sample it records two times on this computer's system clock: the
// publication, which is the source time stamp that DDS gives as in ROS 2, and the moment at which the
// callback would begin. Writes CSV at the end and nothing to disk before. `./run experiment fig13` runs and
// evaluates it.

#include <cstdio>
#include <exception>
#include <fstream>
#include <stdexcept>

#include <CLI/CLI.hpp>

#include "ros/endpoint.hpp"
#include "ros/executor.hpp"
#include "suite/topics.hpp"
#include "tests/bench/process.hpp"

namespace srfs::bench {
namespace {

namespace topics = suite::topics;

constexpr std::size_t most_records = 1U << 20;  // 24 MiB; two hours of a flight
constexpr seconds longest_search{10};
constexpr seconds settling{1};  // between discovery and the first record

struct Record {
  std::size_t topic = 0;
  UtcTime published;
  UtcTime received;
};

/// The received samples, up to a bound; later samples are only counted. The memory is touched before the
/// first record.
class Records {
 public:
  void start() { recording_ = true; }
  void add(const Record& record) {
    if (!recording_) return;
    if (count_ == rows_.size()) {
      ++dropped_;
      return;
    }
    rows_[count_++] = record;
  }
  [[nodiscard]] std::size_t count() const { return count_; }
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }
  void write(const std::string& path, const std::vector<std::string>& names) const {
    std::ofstream out(path);
    out << "topic,published_ns,received_ns\n";
    for (std::size_t i = 0; i < count_; ++i)
      out << names[rows_[i].topic] << ',' << rows_[i].published.ns() << ',' << rows_[i].received.ns() << '\n';
    if (!out.flush()) throw std::runtime_error(path + " cannot be written");
  }

 private:
  bool recording_ = false;
  std::size_t count_ = 0;
  std::uint64_t dropped_ = 0;
  std::vector<Record> rows_ = std::vector<Record>(most_records);
};

/// A subscription that records the time instead of running a callback.
template <class M>
class StampedReader final : public ros::ReaderEndpoint {
 public:
  StampedReader(ros::Executor& executor, const ros::Topic<M>& topic, Records& records, std::size_t number)
      : ReaderEndpoint(executor, topic.priority), records_(records), number_(number) {}

  void listen(ros::Participant& participant, const ros::Topic<M>& topic) {
    open(participant, ros::topic_dds_name(topic.name), ros::dds::TypeSupport(new ros::TypeSupport<M>),
         topic.qos, ros::largest_octets<M>(topic.qos));
  }

  bool dispatch_one(MonotonicTime) override {
    ros::dds::SampleInfo info;
    if (reader_ == nullptr || reader_->take_next_sample(&sample_, &info) != ReturnCode_t::RETCODE_OK)
      return false;
    const UtcTime received = system_utc_now();
    if (!info.valid_data) return true;
    count_gap(info.sample_identity);
    ++(sample_.well_formed ? stats_.received : stats_.malformed);
    records_.add({number_, UtcTime(nanoseconds(info.source_timestamp.to_ns())), received});
    return true;
  }

 private:
  Records& records_;
  std::size_t number_;
  ros::Sample<M> sample_;
};

struct Options {
  int domain = 0;
  int fifo_priority = 0;
  double duration_s = 60;
  std::vector<std::string> payloads;
  std::vector<std::string> nodes;
  std::string out;
};

/// Offset of the system clock from the monotonic clock. A step of the system clock spoils the latencies.
nanoseconds clock_offset() {
  return system_utc_now().since_epoch() - monotonic_now().since_epoch();
}

class Probe {
 public:
  explicit Probe(const Options& options) : options_(options) {
    auto made = ros::Participant::create({.domain = options.domain, .executor = &executor_});
    if (!made) throw std::runtime_error(made.error());
    participant_ = std::move(*made);
    listen(topics::time_tick);
    listen(topics::task_flags);
    listen(topics::bus_status);
    listen(topics::telecommand);
    listen(topics::telecommand_report);
    for (const std::string& name : options.payloads) listen(topics::activity(name));
    for (const std::string& name : options.nodes) listen(topics::telemetry(name));
  }
  ~Probe() {
    for (const auto& reader : readers_) reader->close();
  }
  Probe(const Probe&) = delete;
  Probe& operator=(const Probe&) = delete;

  Json run() {
    const auto has_publisher = [](const auto& reader) { return reader->matched_count() > 0; };
    const auto all_matched = [&] { return std::ranges::all_of(readers_, has_publisher); };
    if (!executor_.spin_until(all_matched, monotonic_now() + longest_search))
      throw std::runtime_error("nobody publishes " + names_[first_without(has_publisher)]);
    spin_for(settling);
    const nanoseconds offset = clock_offset();
    const std::uint64_t lost_before = sum(&ros::InputStats::lost);
    records_.start();
    spin_for(nanoseconds(static_cast<std::int64_t>(options_.duration_s * 1e9)));
    const nanoseconds moved = clock_offset() - offset;
    records_.write(options_.out, names_);
    return {{"samples", records_.count()},
            {"dropped", records_.dropped()},
            {"lost", sum(&ros::InputStats::lost) - lost_before},
            {"malformed", sum(&ros::InputStats::malformed)},
            {"clock_moved_us", static_cast<double>(moved.count()) / 1e3}};
  }

 private:
  template <class M>
  void listen(const ros::Topic<M>& topic) {
    const auto reader = std::make_shared<StampedReader<M>>(executor_, topic, records_, names_.size());
    names_.push_back(topic.name);
    readers_.push_back(reader);
    reader->listen(*participant_, topic);
  }
  void spin_for(nanoseconds duration) {
    executor_.spin_until([] { return false; }, monotonic_now() + duration);
  }
  [[nodiscard]] std::size_t first_without(const auto& condition) const {
    return static_cast<std::size_t>(std::ranges::find_if_not(readers_, condition) - readers_.begin());
  }
  [[nodiscard]] std::uint64_t sum(std::uint64_t ros::InputStats::*count) const {
    std::uint64_t all = 0;
    for (const auto& reader : readers_) all += reader->stats().*count;
    return all;
  }

  Options options_;
  Records records_;
  ros::Executor executor_;
  std::unique_ptr<ros::Participant> participant_;
  std::vector<std::shared_ptr<ros::ReaderEndpoint>> readers_;
  std::vector<std::string> names_;
};

}  // namespace
}  // namespace srfs::bench

int main(int argc, char** argv) {
  using namespace srfs::bench;
  CLI::App app{"When samples of the flying suite were published and received; CSV, and one JSON object"};
  Options options;
  app.add_option("--domain", options.domain, "DDS domain of the suite")
      ->required()
      ->check(CLI::Range(0, 232));
  app.add_option("--fifo", options.fifo_priority,
                 "SCHED_FIFO with this priority, as a deployment sets it; 0: normal")
      ->check(CLI::Range(0, 99));
  app.add_option("--duration", options.duration_s, "s")
      ->check(CLI::Range(0.1, 7200.0))
      ->capture_default_str();
  app.add_option("--payload", options.payloads, "Whose activity is listened to");
  app.add_option("--node", options.nodes, "Whose telemetry is listened to");
  app.add_option("--out", options.out, "The CSV file")->required();
  CLI11_PARSE(app, argc, argv);
  try {
    if (options.fifo_priority > 0) {
      // Before the participant is created, because its threads inherit this thread's scheduling.
      if (const std::string why = set_fifo(options.fifo_priority); !why.empty())
        throw std::runtime_error(why);
    }
    std::printf("%s\n", Probe(options).run().dump().c_str());
    return 0;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "bench_topics: %s\n", e.what());
    return 1;
  }
}
