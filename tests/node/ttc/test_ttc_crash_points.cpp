// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Kills the ttc_node program at every system call between the arrival of a telecommand and its completion
// report.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>
#include <random>
#include <set>
#include <sstream>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/epoll.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <mission/structures.hpp>

#include "base/file.hpp"
#include "ground/downlink.hpp"
#include "ros/datagram_seal.hpp"
#include "suite/command_keys.hpp"
#include "suite/commanding/commanded_node.hpp"
#include "tests/dds_domain.hpp"
#include "tests/signal_child.hpp"
#include "tests/var_folder.hpp"
#include "wire/farm1.hpp"
#include "wire/tc_uplink.hpp"

namespace srfs {
namespace {

constexpr seconds patience{60};
constexpr unsigned sample_seed = 7;
constexpr std::size_t sample_stops = 24;
/// Time limit of a sample; no new stop starts after it. A busy machine tests fewer stops, but at least
/// sample_least.
constexpr seconds sample_time{35};
constexpr std::size_t sample_least = 5;

/// The node that executes the telecommands. It counts executions by setpoint.
class ExecutingNode : public CommandedNode {
 public:
  using CommandedNode::CommandedNode;
  std::map<float, int> executed;

 protected:
  ros::CallbackReturn on_configure() override {
    open_commanding();
    return ros::CallbackReturn::success;
  }
  ros::CallbackReturn on_activate() override {
    resume_commanding();
    return ros::CallbackReturn::success;
  }
  ros::CallbackReturn on_cleanup() override {
    close_commanding();
    return ros::CallbackReturn::success;
  }
  [[nodiscard]] FailureCode check(std::uint16_t function, OctetView arguments) const override {
    return function == mission::ThermalSetSetpoint::function_id &&
                   mission::ThermalSetSetpoint::decode(arguments)
               ? mission::failure::none
               : mission::failure::unknown_function;
  }
  void execute(const StoredTelecommand& telecommand) override {
    ++executed[mission::ThermalSetSetpoint::decode(telecommand.arguments)->setpoint_k];
    finished(mission::failure::none);
  }
};

/// ttc_node as a process under syscall_tracer. Test and tracer exchange text lines.
class TracedTtc {
 public:
  TracedTtc(ros::Executor& executor, const std::filesystem::path& folder, const std::string& domain) {
    std::array<int, 2> in{};
    std::array<int, 2> out{};
    if (pipe2(in.data(), O_CLOEXEC) != 0 || pipe2(out.data(), O_CLOEXEC) != 0) std::abort();
    const std::string tracer = std::string(SRFS_BINARY_DIR) + "/tests/syscall_tracer";
    const std::string program = std::string(SRFS_BINARY_DIR) + "/bin/ttc_node";
    const std::string deployment = (folder / "d.yaml").string();
    const std::string var = folder.string();
    const std::array<const char*, 11> words{tracer.c_str(), program.c_str(),    "--name", "ttc",
                                            "--deployment", deployment.c_str(), "--var",  var.c_str(),
                                            "--domain",     domain.c_str(),     nullptr};
    const std::string log = (folder / "ttc.log").string();
    pid_ = fork();
    if (pid_ == 0) {
      const int to = open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0644);
      dup2(in[0], STDIN_FILENO);
      dup2(out[1], STDOUT_FILENO);
      dup2(to, STDERR_FILENO);
      execv(words[0], const_cast<char**>(words.data()));  // NOLINT(cppcoreguidelines-pro-type-const-cast)
      _exit(127);
    }
    close(in[0]);
    close(out[1]);
    to_ = Fd(in[1]);
    from_ = Fd(out[0]);
    fcntl(from_.get(), F_SETFL, O_NONBLOCK);
    watch_ = executor.add_fd(from_.get(), EPOLLIN, [this](std::uint32_t) { read_lines(); });
  }
  ~TracedTtc() {
    watch_.reset();
    to_.reset();  // end of input ends the tracer and ttc_node
    testing_support::signal_child(pid_, SIGTERM);
    waitpid(pid_, nullptr, 0);
  }
  TracedTtc(const TracedTtc&) = delete;
  TracedTtc& operator=(const TracedTtc&) = delete;

  void order(const std::string& line) {
    const std::string text = line + "\n";
    EXPECT_EQ(write(to_.get(), text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  /// The rest of the tracer's line that starts with @p word; nullopt: no such line yet.
  [[nodiscard]] std::optional<std::string> said(const std::string& word) const {
    for (const std::string& line : lines_) {
      if (line.starts_with(word)) return line.size() > word.size() ? line.substr(word.size() + 1) : "";
    }
    return std::nullopt;
  }

 private:
  void read_lines() {
    std::array<char, 512> text{};
    const ssize_t n = read(from_.get(), text.data(), text.size());
    if (n == 0) {
      watch_.reset();
      lines_.emplace_back("gone");
    }
    if (n <= 0) return;
    part_.append(text.data(), static_cast<std::size_t>(n));
    for (std::size_t end = 0; (end = part_.find('\n')) != std::string::npos; part_.erase(0, end + 1))
      lines_.push_back(part_.substr(0, end));
  }

  pid_t pid_ = 0;
  Fd to_;
  Fd from_;
  ros::Executor::Handle watch_;
  std::string part_;
  std::vector<std::string> lines_;
};

/// The ground and the executing node share one work thread in this process; ttc is a separate process.
class TtcCrashPoints : public testing::Test {
 protected:
  void SetUp() override {
    line_ = Fd(posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK));
    ASSERT_EQ(grantpt(line_.get()), 0);
    ASSERT_EQ(unlockpt(line_.get()), 0);
    std::array<char, 64> name{};
    ASSERT_EQ(ptsname_r(line_.get(), name.data(), name.size()), 0);
    std::filesystem::create_symlink(name.data(), folder_ / "line");
    far_end_ = Fd(open(name.data(), O_RDWR | O_NOCTTY | O_CLOEXEC));  // the line outlives ttc
    std::filesystem::create_directories(folder_ / "keys");
    ASSERT_TRUE(write_file_atomically(folder_ / "keys" / "tc.key", std::string(64, '7') + "\n"));
    ASSERT_EQ(chmod((folder_ / "keys" / "tc.key").c_str(), 0600), 0);
    // Disk delays on a busy machine must not fail this test.
    ASSERT_TRUE(write_file_atomically(folder_ / "d.yaml",
                                      "deployment: t\n"
                                      "devices: { rs422: \"serial:line\" }\n"
                                      "link: { spacecraft_id: 0xAB, tc_channels: [{ vc: 0, security: sdls, "
                                      "spi: 1, key_file: keys/tc.key }] }\n"
                                      "nodes: [{ name: ttc, executable: ttc_node,\n"
                                      "          parameters: { initial_mode: nominal, persist_deadline_ms: "
                                      "60000, repeat_window_ms: 3600000 } },\n"
                                      "        { name: payload_thermal, executable: x }]\n"));
    deployment_ = std::make_unique<suite::Deployment>(suite::Deployment::load(folder_ / "d.yaml"));
    // ttc's process believes this one only if it seals.
    const auto keys = [var = suite::VarPaths::at(folder_)] {
      return ros::SealKeys{suite::suite_seal_key(var).value()};
    };
    ros::seal_datagrams(keys(), keys);
    here_ = ros::Participant::create({testing_support::own_domain(), {"127.0.0.1"}, &executor_}).value();
    context_ = std::make_unique<suite::NodeContext>(
        suite::NodeContext{"payload_thermal", *deployment_, suite::VarPaths{folder_}, 1, executor_, *here_});
    node_ = std::make_unique<ExecutingNode>(*context_);
    ASSERT_TRUE(node_->go_to(ros::State::active));
    downlink_ = std::make_unique<ground::Downlink>(deployment_->link);
    line_watch_ = executor_.add_fd(line_.get(), EPOLLIN, [this](std::uint32_t) { read_line(); });
  }
  void TearDown() override {
    ttc_.reset();
    line_watch_.reset();
    if (node_) {
      node_->go_to(ros::State::unconfigured);
      node_->go_to(ros::State::finalized);
    }
    node_.reset();
    if (HasFailure()) std::fputs(read_file(folder_ / "ttc.log", 1U << 20).value_or("").c_str(), stderr);
    std::filesystem::remove_all(suite::VarPaths{folder_}.memory());  // left behind by the killed process
  }

  void read_line() {
    std::array<std::uint8_t, 4096> octets{};
    const ssize_t n = read(line_.get(), octets.data(), octets.size());
    if (n <= 0) return;
    for (auto& received : downlink_->push(OctetView(octets.data(), static_cast<std::size_t>(n)))) {
      if (received.packet.service == 1) reports_.insert({received.packet.source, received.packet.subtype});
    }
    for (const std::uint32_t word : downlink_->take_control_words()) {
      if (const auto clcw = wire::decode_clcw(word)) acknowledged_ = clcw->report_value;
    }
  }
  bool wait(const std::function<bool()>& condition) {
    return executor_.spin_until(condition, monotonic_now() + patience);
  }
  void start_ttc() {
    ttc_ = std::make_unique<TracedTtc>(executor_, folder_, std::to_string(testing_support::own_domain()));
  }
  /// A telecommand packet that is unique in this test.
  Octets make_packet(std::uint16_t apid, std::uint8_t service, std::uint8_t subtype, Octets data) {
    return wire::make_tc_packet({.apid = apid,
                                 .sequence_count = sequence_++,
                                 .ack_flags = wire::ack::all,
                                 .service = service,
                                 .subtype = subtype,
                                 .application = std::move(data)});
  }
  Octets setpoint(float kelvin) {
    mission::ThermalSetSetpoint command;
    command.heater = 0;
    command.setpoint_k = kelvin;
    OctetWriter data;
    data.u16(command.function_id);
    data.bytes(command.encoded());
    return make_packet(mission::apid::payload_thermal, 8, 1, data.take());
  }
  /// Transmits once, with a new security counter.
  void send(const Octets& packet) { send(packet, wire::TcFrameType::bd, 0); }
  void send(const Octets& packet, wire::TcFrameType type, std::uint8_t sequence) {
    const wire::SdlsSeal seal{key_, 1, ++counter_};
    const Octets cltu =
        wire::make_uplink_cltu({.spacecraft_id = 0xAB, .vc = 0}, type, sequence, &seal, packet).value();
    ASSERT_EQ(write(line_.get(), cltu.data(), cltu.size()), static_cast<ssize_t>(cltu.size()));
  }
  /// Ignores the failure code.
  [[nodiscard]] bool reported(const Octets& packet, std::uint8_t subtype) const {
    return std::any_of(reports_.begin(), reports_.end(), [&](const auto& report) {
      return report.second == subtype && std::equal(packet.begin(), packet.begin() + 4, report.first.begin());
    });
  }
  /// Waits until ttc accepts telecommands. By then ttc has also repeated its reports after a restart.
  void await_answer() {
    for (int attempt = 0; attempt < 30; ++attempt) {
      const Octets ping = make_packet(mission::apid::ttc, 17, 1, {});
      send(ping);
      if (executor_.spin_until([&] { return reported(ping, 7); }, monotonic_now() + seconds(2))) return;
    }
    FAIL() << "ttc does not answer";
  }
  /// Holds ttc's threads. @return false: ptrace is not permitted here
  bool trace(std::uint64_t kill_at) {
    ttc_->order("trace " + std::to_string(kill_at));
    EXPECT_TRUE(wait([&] { return ttc_->said("tracing") || ttc_->said("refused") || ttc_->said("gone"); }));
    return ttc_->said("tracing").has_value();
  }
  void end_ttc() {
    ttc_->order("end");
    ASSERT_TRUE(wait([&] { return ttc_->said("gone").has_value(); }));
  }
  /// Whether ptrace may hold ttc's threads here. No ttc runs afterwards.
  bool can_trace() {
    start_ttc();
    await_answer();
    const bool permitted = trace(0);
    if (permitted) end_ttc();
    return permitted;
  }
  /// Counts ttc's system-call stops from the octets that @p send_all sends until @p done. No ttc runs
  /// afterwards.
  std::uint64_t count_stops(const std::function<void()>& send_all, const std::function<bool()>& done) {
    EXPECT_TRUE(trace(0));
    send_all();
    EXPECT_TRUE(wait(done));
    end_ttc();
    const std::uint64_t counted = std::stoull(ttc_->said("calls").value());
    EXPECT_GT(counted, 20U);
    return counted;
  }
  /// Waits until ttc and the node have discovered each other and a telecommand has ended.
  void await_execution() {
    const Octets packet = setpoint(next_setpoint());
    send(packet);
    ASSERT_TRUE(wait([&] { return ended(packet); }));
  }
  float next_setpoint() { return setpoint_k_ += 0.03125F; }
  [[nodiscard]] bool ended(const Octets& packet) const {
    return reported(packet, 4) || reported(packet, 7) || reported(packet, 8);
  }
  void kill_at(std::uint64_t stop);
  /// Arms a hazardous telecommand. ttc executes this one itself and does not repeat it after a restart.
  Octets arm() {
    mission::TtcArm command;
    command.of_apid = mission::apid::payload_eps;
    command.of_service = 8;
    command.of_subtype = 1;
    command.digest = sequence_;
    OctetWriter data;
    data.u16(command.function_id);
    data.bytes(command.encoded());
    return make_packet(mission::apid::ttc, 8, 1, data.take());
  }
  /// There is no load 9.
  Octets make_refused() { return make_packet(mission::apid::payload_eps, 8, 1, {0, 1, 9, 1}); }
  void kill_at_with_sequenced_frames(std::uint64_t stop);
  /// The system-call stops to kill at, in random order.
  [[nodiscard]] static std::vector<std::uint64_t> choose_stops(std::uint64_t counted);
  void judge(const std::vector<std::uint64_t>& stops, const std::function<void(std::uint64_t)>& kill);

  ros::Executor executor_;
  std::unique_ptr<ros::Participant> here_;
  const testing_support::VarFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
  const wire::SdlsKey key_ = wire::SdlsKey::from_hex(std::string(64, '7')).value();
  Fd line_;
  Fd far_end_;
  std::unique_ptr<suite::Deployment> deployment_;
  std::unique_ptr<suite::NodeContext> context_;
  std::unique_ptr<ExecutingNode> node_;
  std::unique_ptr<ground::Downlink> downlink_;
  ros::Executor::Handle line_watch_;
  std::unique_ptr<TracedTtc> ttc_;
  std::set<std::pair<Octets, std::uint8_t>> reports_;
  std::vector<std::string> killed_;  ///< stop, system-call number, entry or exit
  std::size_t tested_ = 0;
  std::size_t completed_ = 0;
  std::uint8_t acknowledged_ = 0;  ///< V(R) of the newest control word
  std::uint16_t sequence_ = 0;
  std::uint64_t counter_ = 0;
  float setpoint_k_ = 250;
};

/// ttc runs at the beginning and at the end.
void TtcCrashPoints::kill_at(std::uint64_t stop) {
  ASSERT_TRUE(trace(stop));
  const float kelvin = next_setpoint();
  const Octets packet = setpoint(kelvin);
  send(packet);
  ASSERT_TRUE(wait([&] { return ttc_->said("gone") || reported(packet, 7); }));
  if (!ttc_->said("gone")) end_ttc();  // fewer stops than expected in this run
  if (const auto killed = ttc_->said("killed")) killed_.push_back(*killed);
  start_ttc();
  await_answer();

  if (!reported(packet, 1)) {
    // ttc did not report acceptance, so the telecommand must have had no effect. The ground sends it again.
    EXPECT_FALSE(ended(packet));
    EXPECT_EQ(node_->executed[kelvin], 0);
    send(packet);
  }
  ASSERT_TRUE(wait([&] { return ended(packet); })) << "its end was never told";
  EXPECT_FALSE(reported(packet, 8));
  // A very late telecommand may fail instead of starting; then it must not have been executed.
  EXPECT_EQ(node_->executed[kelvin], reported(packet, 7) ? 1 : 0);
  completed_ += reported(packet, 7) ? 1U : 0U;

  send(packet);
  await_execution();
  EXPECT_LE(node_->executed[kelvin], 1) << "sent again after its end";
}

/// Sends one telecommand that ttc refuses and one that ttc executes itself. ttc runs at the beginning and at
/// the end.
void TtcCrashPoints::kill_at_with_sequenced_frames(std::uint64_t stop) {
  const std::uint8_t first = acknowledged_;
  const Octets refused = make_refused();
  const Octets armed = arm();
  ASSERT_TRUE(trace(stop));
  send(refused, wire::TcFrameType::ad, first);
  send(armed, wire::TcFrameType::ad, static_cast<std::uint8_t>(first + 1));
  ASSERT_TRUE(wait([&] { return ttc_->said("gone") || (reported(refused, 2) && reported(armed, 7)); }));
  if (!ttc_->said("gone")) end_ttc();
  if (const auto killed = ttc_->said("killed")) killed_.push_back(*killed);
  const auto before = static_cast<std::uint8_t>(acknowledged_ - first);
  start_ttc();
  await_answer();
  const auto after = static_cast<std::uint8_t>(acknowledged_ - first);

  EXPECT_GE(after, before) << "what was acknowledged is not asked for again";
  EXPECT_LE(after, 2);
  // The ground never repeats an acknowledged telecommand; it waits for the decision.
  EXPECT_EQ(reported(refused, 2), after >= 1) << "V(R) +" << int{before} << ", then +" << int{after};
  EXPECT_EQ(reported(armed, 1), after >= 2);
  if (after < 2) return;
  ASSERT_TRUE(wait([&] { return ended(armed); })) << "its end was never told";
  await_answer();
  EXPECT_NE(reported(armed, 7), reported(armed, 8)) << "one end";
}

std::vector<std::uint64_t> TtcCrashPoints::choose_stops(std::uint64_t counted) {
  const char* wanted = std::getenv("SRFS_CRASH_STOPS");
  const bool all = wanted != nullptr && std::string(wanted) == "all";
  // The number of stops varies between runs, so choose up to 25 % beyond the count. Some runs then end before
  // their stop.
  const std::uint64_t last = counted + counted / 4;
  const std::uint64_t points = all ? last : sample_stops;
  std::mt19937 chance(sample_seed);
  std::vector<std::uint64_t> stops;
  for (std::uint64_t i = 0; i < points; ++i) {
    const std::uint64_t first = 1 + i * last / points;
    const std::uint64_t width = std::max<std::uint64_t>(last / points, 1);
    stops.push_back(first + chance() % width);
  }
  // The shuffle keeps a sample evenly spread even if the time limit cuts it short.
  if (!all) std::shuffle(stops.begin(), stops.end(), chance);
  return stops;
}

/// Tests a sample spread over all stops, or every stop with SRFS_CRASH_STOPS=all.
void TtcCrashPoints::judge(const std::vector<std::uint64_t>& stops,
                           const std::function<void(std::uint64_t)>& kill) {
  const MonotonicTime begun = monotonic_now();
  std::size_t tested = 0;
  for (const std::uint64_t stop : stops) {
    const bool sample = stops.size() == sample_stops;
    if (sample && tested >= sample_least && monotonic_now() - begun > sample_time) break;
    SCOPED_TRACE("stop " + std::to_string(stop));
    kill(stop);
    if (HasFatalFailure()) return;
    ++tested;
  }
  std::printf("%zu stops tested, killed at (stop, system call):\n", tested);
  for (const std::string& killed : killed_) std::printf("  %s\n", killed.c_str());
  // On a busy machine a run waits more and has fewer stops than the counted one.
  EXPECT_GE(killed_.size(), std::min(sample_least, (tested + 1) / 2)) << "the others ended before their stop";
  tested_ = tested;
}

TEST_F(TtcCrashPoints, ATelecommandIsExecutedOnceAndItsEndToldWhereverTtcIsKilled) {
  if (!can_trace()) {
    std::fputs("SKIPPED: ptrace is not permitted here, ttc is not killed at its system calls\n", stderr);
    GTEST_SKIP() << "ptrace is not permitted here";
  }
  start_ttc();
  await_answer();
  await_execution();
  const Octets packet = setpoint(next_setpoint());
  const std::uint64_t counted = count_stops([&] { send(packet); }, [&] { return reported(packet, 7); });
  start_ttc();
  await_answer();
  await_execution();
  judge(choose_stops(counted), [this](std::uint64_t stop) { kill_at(stop); });
  EXPECT_GE(2 * completed_, tested_);
}

TEST_F(TtcCrashPoints, WhatCop1AcknowledgedIsDecidedAndToldWithOneEndWhereverTtcIsKilled) {
  if (!can_trace()) {
    std::fputs("SKIPPED: ptrace is not permitted here, ttc is not killed at its system calls\n", stderr);
    GTEST_SKIP() << "ptrace is not permitted here";
  }
  start_ttc();
  await_answer();
  const Octets refused = make_refused();
  const Octets armed = arm();
  const std::uint64_t counted = count_stops(
      [&] {
        send(refused, wire::TcFrameType::ad, acknowledged_);
        send(armed, wire::TcFrameType::ad, static_cast<std::uint8_t>(acknowledged_ + 1));
      },
      [&] { return reported(refused, 2) && reported(armed, 7); });
  start_ttc();
  await_answer();
  judge(choose_stops(counted), [this](std::uint64_t stop) { kill_at_with_sequenced_frames(stop); });
}

}  // namespace
}  // namespace srfs
