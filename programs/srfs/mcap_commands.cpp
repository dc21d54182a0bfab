// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/mcap_commands.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <map>
#include <set>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/epoll.h>
#include <unistd.h>

#include "base/signals.hpp"
#include "mcap/mcap_reader.hpp"
#include "mcap/mcap_writer.hpp"
#include "mcap/message_definition.hpp"
#include "programs/srfs/definition_folders.hpp"
#include "ros/serialized.hpp"
#include "ros/worker.hpp"

namespace srfs::tool {
namespace {

namespace fs = std::filesystem;

constexpr milliseconds look_period{200};  // for new topics
constexpr milliseconds chunk_period{1000};
constexpr std::size_t most_chunks_waiting = 16;  // for the disk
constexpr seconds disk_deadline{60};

/// rosbag2's words for the QoS of a topic (rmw/types.h: history, reliability and durability are numbers).
std::string offered_qos(const ros::TopicEnds& ends) {
  constexpr const char* for_ever = "\n    sec: 9223372036\n    nsec: 854775807";
  return fmt::format(
      "- history: 1\n  depth: 10\n  reliability: {}\n  durability: {}\n  deadline:{}\n  lifespan:{}\n"
      "  liveliness: 1\n  liveliness_lease_duration:{}\n  avoid_ros_namespace_conventions: false",
      ends.best_effort ? 2 : 1, ends.transient_local ? 1 : 2, for_ever, for_ever, for_ever);
}

bool is_hidden(const std::string& topic) {
  return topic.find("/_") != std::string::npos;
}

bool is_wanted(const std::string& topic, const std::vector<std::string>& wanted) {
  return wanted.empty() ? !is_hidden(topic) : std::find(wanted.begin(), wanted.end(), topic) != wanted.end();
}

/// Appends to the file and makes it last. @return what went wrong; empty: nothing
std::string append(int fd, OctetView octets) {
  while (!octets.empty()) {
    const ssize_t n = write(fd, octets.data(), octets.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return std::strerror(errno);
    octets = octets.subspan(static_cast<std::size_t>(n));
  }
  return fdatasync(fd) == 0 ? std::string() : std::strerror(errno);
}

/// Subscribes to what comes into the domain and puts it into the file.
class Recorder {
 public:
  Recorder(ros::Executor& executor, ros::Participant& participant, const McapRecording& recording, Fd file)
      : executor_(executor),
        participant_(participant),
        recording_(recording),
        folders_(definition_folders(recording.interfaces)),
        file_(std::move(file)),
        disk_(executor, "mcap", most_chunks_waiting, disk_deadline) {
    store(writer_.begin("ros2"));
    look_ = executor.add_timer(
        monotonic_now(), look_period, [this] { look(); }, "topics");
    end_chunk_ = executor.add_timer(
        monotonic_now() + chunk_period, chunk_period, [this] { store(writer_.end_chunk()); }, "chunk");
  }

  /// Nothing comes in any longer; the file gets its end.
  void finish() {
    topics_ = subscribed_.size();
    while (!subscribed_.empty()) unsubscribe(subscribed_.begin()->first);
    look_.reset();
    end_chunk_.reset();
    if (failure_.empty()) store(writer_.finish());
    disk_.drain();
  }
  [[nodiscard]] const std::string& failure() const { return failure_; }
  [[nodiscard]] std::uint64_t messages() const { return writer_.messages(); }
  [[nodiscard]] std::uint64_t octets() const { return writer_.size(); }
  [[nodiscard]] std::size_t topics() const { return topics_; }
  [[nodiscard]] std::uint64_t lost() const { return lost_; }

 private:
  struct Subscribed {
    std::string type;
    bool best_effort;
    std::unique_ptr<ros::SerializedSubscription> subscription;
  };

  void look() {
    for (const ros::TopicEnds& ends : participant_.topics().topics()) {
      const std::string type = ros::ros_type_name(ends.type);
      if (ends.publishers == 0 || !ends.topic.starts_with("rt/") || type.empty()) continue;
      const std::string topic = ends.topic.substr(2);
      if (!is_wanted(topic, recording_.topics)) continue;
      const auto known = subscribed_.find(topic);
      if (known == subscribed_.end()) {
        subscribe(topic, type, ends);
      } else if (known->second.type != type) {
        refuse(topic, type);
      } else if (ends.best_effort && !known->second.best_effort) {
        subscribe(topic, type, ends);
      }
    }
  }

  void subscribe(const std::string& topic, const std::string& type, const ros::TopicEnds& ends) {
    const auto definition = mcap::message_definition(type, folders_);
    const auto schema = writer_.add_schema({type, definition ? "ros2msg" : "", definition.value_or("")});
    const auto channel =
        schema ? writer_.add_channel({*schema, topic, "cdr", {{"offered_qos_profiles", offered_qos(ends)}}})
               : std::nullopt;
    if (!channel) return end("the file has 65,535 topics or types");
    const ros::Qos qos{.depth = recording_.largest_mib > 1 ? 8 : 256,
                       .transient_local = ends.transient_local,
                       .largest_octets = static_cast<std::size_t>(recording_.largest_mib << 20),
                       .best_effort = ends.best_effort};
    unsubscribe(topic);
    try {
      subscribed_[topic] = {type, ends.best_effort,
                            std::make_unique<ros::SerializedSubscription>(
                                executor_, participant_, topic, type, qos, ros::Priority::normal,
                                [this, id = *channel](OctetView octets, const ros::MessageInfo& info) {
                                  on_message(id, octets, info);
                                })};
    } catch (const std::runtime_error&) {
      refuse(topic, type);
    }
  }

  /// Another type of the topic is recorded already.
  void refuse(const std::string& topic, const std::string& type) {
    if (refused_.insert(topic + " " + type).second)
      fmt::print(stderr, "srfs record: {} is not recorded as {}: it has two types\n", topic, type);
  }

  /// What it lost stays counted.
  void unsubscribe(const std::string& topic) {
    const auto known = subscribed_.find(topic);
    if (known == subscribed_.end()) return;
    const ros::InputStats stats = known->second.subscription->stats();
    lost_ += stats.lost + stats.malformed;
    subscribed_.erase(known);
  }

  void on_message(std::uint16_t channel, OctetView octets, const ros::MessageInfo& info) {
    const UtcTime at = system_utc_now() - (monotonic_now() - info.received);
    const auto ns = static_cast<std::uint64_t>(at.ns());
    writer_.add(channel, static_cast<std::uint32_t>(info.identity.sequence_number().to64long()), ns, ns,
                octets);
    if (writer_.chunk_is_full()) store(writer_.end_chunk());
    if (writer_.size() >= recording_.most_mib << 20) {
      fmt::print(stderr, "srfs record: {} has its {} MiB (--most-mib)\n", recording_.file,
                 recording_.most_mib);
      executor_.stop();
    }
  }

  void store(Octets octets) {
    if (octets.empty() || !failure_.empty()) return;
    auto kept = std::make_shared<const Octets>(std::move(octets));
    const bool taken = disk_.ask([this, kept] { return append(file_.get(), *kept); },
                                 [this](const std::string& error) {
                                   if (!error.empty()) end(error);
                                 });
    if (!taken) end("the disk is slower than what comes in");
  }

  void end(const std::string& failure) {
    if (failure_.empty()) failure_ = failure;
    executor_.stop();
  }

  ros::Executor& executor_;
  ros::Participant& participant_;
  const McapRecording& recording_;
  const std::vector<fs::path> folders_;
  Fd file_;
  mcap::Writer writer_;
  std::map<std::string, Subscribed> subscribed_;  // by topic
  std::set<std::string> refused_;
  std::string failure_;
  std::size_t topics_ = 0;
  std::uint64_t lost_ = 0;
  ros::Timer look_;
  ros::Timer end_chunk_;
  ros::Worker disk_;
};

ros::Qos qos_of(const mcap::Channel& channel) {
  const auto offered = channel.metadata.find("offered_qos_profiles");
  const std::string text = offered != channel.metadata.end() ? offered->second : "";
  return {.depth = 100,
          .transient_local = text.find("durability: 1") != std::string::npos,
          .best_effort = text.find("reliability: 2") != std::string::npos};
}

/// Publishers for the file's topics, by channel; what cannot be published is reported.
class Player {
 public:
  Player(ros::Participant& participant, const McapPlay& play) : participant_(participant), play_(play) {}

  /// Reads the file once for its topics. @return how many messages it has, or why it cannot be read
  [[nodiscard]] Result<std::uint64_t, std::string> prepare() {
    std::ifstream file(play_.file, std::ios::binary);
    mcap::Reader reader(file);
    std::uint64_t count = 0;
    while (true) {
      auto message = reader.next();
      if (!message) return Err(message.error());
      if (!*message) break;
      ++count;
    }
    for (const auto& [id, channel] : reader.channels()) add(id, channel, reader.schemas());
    if (!reader.is_whole())
      fmt::print(stderr, "srfs play: {} has no end (its recorder was killed): played as far as it goes\n",
                 play_.file);
    return count;
  }
  void publish(const mcap::Message& message) {
    const auto publisher = publishers_.find(message.channel);
    if (publisher == publishers_.end()) return;
    if (publisher->second->publish(message.data)) ++published_;
  }
  [[nodiscard]] std::uint64_t published() const { return published_; }
  [[nodiscard]] bool empty() const { return publishers_.empty(); }

 private:
  void add(std::uint16_t id, const mcap::Channel& channel,
           const std::map<std::uint16_t, mcap::Schema>& schemas) {
    if (!is_wanted(channel.topic, play_.topics)) return;
    const auto schema = schemas.find(channel.schema);
    try {
      if (channel.message_encoding != "cdr" || schema == schemas.end())
        throw std::runtime_error("not of ROS 2 (cdr, with a type)");
      publishers_[id] = std::make_unique<ros::SerializedPublisher>(participant_, channel.topic,
                                                                   schema->second.name, qos_of(channel));
    } catch (const std::runtime_error& e) {
      fmt::print(stderr, "srfs play: {} is left out: {}\n", channel.topic, e.what());
    }
  }

  ros::Participant& participant_;
  const McapPlay& play_;
  std::map<std::uint16_t, std::unique_ptr<ros::SerializedPublisher>> publishers_;
  std::uint64_t published_ = 0;
};

int play_all(ros::Executor& executor, Player& player, const McapPlay& play) {
  std::ifstream file(play.file, std::ios::binary);
  mcap::Reader reader(file);
  std::optional<std::uint64_t> first;
  bool stopped = false;
  const MonotonicTime begin = monotonic_now();
  while (!stopped) {
    const auto message = reader.next();
    if (!message || !*message) break;
    const std::uint64_t at = (*message)->log_time;
    if (!first) first = at;
    const double after_ns = at > *first ? static_cast<double>(at - *first) / play.rate : 0;
    const MonotonicTime due = begin + nanoseconds(static_cast<std::int64_t>(after_ns));
    while (!stopped && monotonic_now() < due)
      stopped = !executor.spin_once(std::max(due - monotonic_now(), nanoseconds(0)));
    if (!stopped) player.publish(**message);
  }
  return stopped ? 1 : 0;
}

}  // namespace

int record_mcap(const Target& target, const McapRecording& recording) {
  const auto domain = recording.domain ? recording.domain : running_domain(target);
  if (!domain) {
    fmt::print(stderr, "srfs record: the suite is not running (no {}); --domain records another domain\n",
               target.var.domain_file().string());
    return 1;
  }
  Fd file(open(recording.file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644));
  if (!file) {
    fmt::print(stderr, "srfs record: {}: {}\n", recording.file, std::strerror(errno));
    return 1;
  }
  const Fd signals = termination_signals();
  ros::Executor executor;
  ros::ParticipantOptions options = participant_options(target, *domain, executor);
  options.remember_topics = true;
  options.bound_foreign = false;
  options.drop_foreign = false;
  auto participant = ros::Participant::create(options);
  if (!participant) {
    fmt::print(stderr, "srfs record: {}\n", participant.error());
    return 1;
  }
  Recorder recorder(executor, **participant, recording, std::move(file));
  const auto watch = executor.add_fd(signals.get(), EPOLLIN, [&](std::uint32_t) { executor.stop(); });
  fmt::print(stderr, "srfs record: domain {} into {}, until Ctrl-C\n", *domain, recording.file);
  if (recording.duration > seconds(0)) {
    executor.spin_until([] { return false; }, monotonic_now() + recording.duration);
  } else {
    executor.spin();
  }
  recorder.finish();
  fmt::print("{} messages of {} topics, {} octets; {} lost before they were taken\n", recorder.messages(),
             recorder.topics(), recorder.octets(), recorder.lost());
  if (recorder.failure().empty()) return 0;
  fmt::print(stderr, "srfs record: {}: {}; what it has is readable\n", recording.file, recorder.failure());
  return 1;
}

int play_mcap(const Target& target, const McapPlay& play) {
  if (running_domain(target) == play.domain) {
    fmt::print(stderr, "srfs play: the suite of {} flies in domain {}: play into another one\n",
               target.var.root.string(), play.domain);
    return 2;
  }
  const Fd signals = termination_signals();
  ros::Executor executor;
  const auto participant = ros::Participant::create({play.domain, target.deployment.interfaces, &executor});
  if (!participant) {
    fmt::print(stderr, "srfs play: {}\n", participant.error());
    return 1;
  }
  Player player(**participant, play);
  const auto count = player.prepare();
  if (!count) {
    fmt::print(stderr, "srfs play: {}: {}\n", play.file, count.error());
    return 1;
  }
  const auto watch = executor.add_fd(signals.get(), EPOLLIN, [&](std::uint32_t) { executor.stop(); });
  (void)executor.spin_until([] { return false; }, monotonic_now() + play.wait);
  const int code = play_all(executor, player, play);
  fmt::print("{} of {} messages published in domain {}\n", player.published(), *count, play.domain);
  return code;
}

}  // namespace srfs::tool
