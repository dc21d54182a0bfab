// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Real processes die, hang or are stopped; the restarter restarts each exactly once.

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <thread>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/mount.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/file.hpp"
#include "suite/command_keys.hpp"
#include "suite/node_versions.hpp"
#include "suite/ring/heartbeat_page.hpp"
#include "suite/ring/node_record.hpp"
#include "suite/ring/restarter.hpp"
#include "tests/build_kind.hpp"
#include "tests/signal_child.hpp"

namespace srfs::suite {
namespace {

using What = RestartOutcome::What;
using testing_support::sanitized;
using testing_support::signal_child;

constexpr seconds patience{30};
const std::string probe = SRFS_BINARY_DIR "/tests/restart_probe";

bool wait_until(const std::function<bool()>& condition) {
  const MonotonicTime deadline = monotonic_now() + patience;
  while (!condition()) {
    if (monotonic_now() > deadline) return false;
    poll(nullptr, 0, 2);
  }
  return true;
}

/// A restarter on a machine without CPU pressure, whatever the pressure is where the test runs: starts are
/// not spaced.
class CalmRestarter : public Restarter {
 public:
  template <class... Arguments>
  explicit CalmRestarter(Arguments&&... arguments) : Restarter(std::forward<Arguments>(arguments)...) {
    set_pressure_source([] { return std::optional<double>(); });
  }
};

class Restarting : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (std::filesystem::temp_directory_path() / "srfs_restart_XXXXXX").string();
    folder_ = mkdtemp(pattern.data());
    var_.root = folder_ / "var";
    std::filesystem::create_directories(var_.run());
    use_programs(probe, probe);
  }
  void TearDown() override {
    for (const NodeEntry& node : plan_.nodes) {
      if (const auto starting = find_starting(var_, node.name)) starting->process.signal(SIGKILL);
      while (const auto process = open_instance(var_, node.name)) {
        process->signal(SIGKILL);
        process->signal(SIGCONT);
        if (!process->wait_for_exit(patience)) break;
      }
    }
    EXPECT_TRUE(wait_until([&] { return processes().empty(); })) << "left behind";
    forget_command_keys(var_);
    std::filesystem::remove_all(var_.memory());
    std::filesystem::remove_all(folder_);
  }
  void use_programs(const std::string& one, const std::string& other) {
    ASSERT_TRUE(write_file_atomically(
        folder_ / "d.yaml",
        "deployment: t\nring: { restarts: 3, first_wait_ms: 100, longest_wait_ms: 400,\n"
        "        window_ms: 3600000, quarantine_deaths: 5, deaf_interval_ms: 3600000 }\n"
        "nodes:\n  - { name: one, executable: " +
            one + " }\n  - { name: other, executable: " + other + " }\n"));
    plan_ = Deployment::load(folder_ / "d.yaml");
  }
  /// Adds a script as a version of node "one". @return the version number
  update::VersionNumber add_version(const std::string& script) {
    const auto file = folder_ / "script";
    std::ofstream(file, std::ios::trunc) << "#!/bin/sh\n" << script << "\n";
    update::VersionNumber number = 0;
    const auto added =
        change_versions(var_, "one", [&](update::VersionStore& store) -> Result<void, std::string> {
          number = store.add(file, "a test", system_utc_now()).value_or(0);
          return {};
        });
    EXPECT_TRUE(added) << added.error();
    EXPECT_NE(number, 0U);
    return number;
  }
  /// Changes only the version table; running processes continue.
  void make_active(update::VersionNumber number, milliseconds probation = std::chrono::hours(1)) {
    const auto used = change_versions(
        var_, "one", [&](update::VersionStore& store) { return store.use(number, probation, ""); });
    ASSERT_TRUE(used) << used.error();
  }
  void commit(update::VersionNumber number) {
    ASSERT_TRUE(
        change_versions(var_, "one", [&](update::VersionStore& store) { return store.commit(number); }));
  }
  [[nodiscard]] update::VersionTable table() const { return read_versions(var_, "one").table; }
  /// The table on disk, regardless of the copy in tmpfs.
  [[nodiscard]] update::VersionTable table_on_disk() const {
    update::PosixVersionFiles files(versions_folder(var_, "one"));
    return update::VersionStore(files, "one").read().table;
  }
  [[nodiscard]] std::filesystem::path program_of(update::VersionNumber number) const {
    return versions_folder(var_, "one") / ("one." + std::to_string(number));
  }
  void behave(const std::string& node, const std::string& how) const {
    ASSERT_TRUE(write_file_atomically(var_.run() / (node + ".behaviour"), how));
  }

  /// Waits until the node's process has identified itself.
  RunningInstance running(const std::string& node = "one", std::uint32_t above = 0) const {
    RunningInstance instance{0, 0, ""};
    EXPECT_TRUE(wait_until([&] {
      const auto now = find_instance(var_, node);
      if (!now || now->incarnation <= above) return false;
      instance = *now;
      return true;
    })) << node
        << " does not run";
    return instance;
  }
  RunningInstance start(const std::string& node = "one") {
    const auto pid = launch({plan_, var_, "/nowhere", "up"}, *plan_.find(node));
    EXPECT_TRUE(pid) << pid.error();
    return running(node);
  }
  void end(pid_t pid, int signal_number) const {
    const auto process = Process::open(pid);
    signal_child(pid, signal_number);
    ASSERT_TRUE(process && process->wait_for_exit(patience));
  }
  static Accusation accuse(const RunningInstance& who, FaultClass fault, const std::string& node = "one") {
    Accusation a;
    a.subject = node;
    a.fault = fault;
    a.pid = who.pid;
    a.incarnation = who.incarnation;
    a.misses = 3;
    a.first_evidence = a.decided = monotonic_now();
    return a;
  }
  static Accusation absent(const std::string& node = "one") {
    return accuse({0, 0, ""}, FaultClass::absent, node);
  }

  /// Waits for a line of the node's log.
  [[nodiscard]] bool says(const std::string& node, const std::string& line) const {
    return wait_until(
        [&] { return read_file(var_.log(node)).value_or("").find(line + "\n") != std::string::npos; });
  }

  /// Repeats the request until the outcome is neither back-off nor quarantine.
  static RestartOutcome insist(Restarter& restarter, const Accusation& accusation) {
    RestartOutcome outcome;
    EXPECT_TRUE(wait_until([&] {
      outcome = restarter.restart(accusation);
      return outcome.what != What::backing_off && outcome.what != What::quarantined;
    }));
    return outcome;
  }
  /// The ledger after all records are written.
  std::vector<FaultRecord> ledger(Restarter& restarter) const {
    EXPECT_TRUE(restarter.flush(std::chrono::duration_cast<milliseconds>(seconds(patience))));
    return FaultLedger(var_).read().records;
  }

  /// Probe processes in this test's folder, without zombies.
  [[nodiscard]] std::set<pid_t> processes() const {
    std::set<pid_t> found;
    for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
      const pid_t pid = std::atoi(entry.path().filename().c_str());
      if (pid <= 0 || pid == getpid()) continue;
      const auto command = read_file(entry.path() / "cmdline", 4096);
      if (!command || command->find(folder_.string()) == std::string::npos) continue;
      if (process_state(pid).value_or('Z') != 'Z') found.insert(pid);
    }
    return found;
  }

  std::filesystem::path folder_;
  VarPaths var_;
  Deployment plan_;
};

pid_t parent_of(pid_t pid) {
  const std::string stat = read_file("/proc/" + std::to_string(pid) + "/stat", 4096).value_or("() ? -1");
  std::istringstream in(stat.substr(stat.rfind(')') + 1));
  char state = 0;
  pid_t parent = 0;
  in >> state >> parent;
  return parent;
}

TEST_F(Restarting, StartsANodeThatWasKilledAsNobodysChildWithAHigherIncarnation) {
  const auto old = start();
  end(old.pid, SIGKILL);
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  const auto outcome = restarter.restart(accuse(old, FaultClass::exited));
  ASSERT_EQ(outcome.what, What::restarted) << outcome.reason;
  const auto renewed = running("one", old.incarnation);
  EXPECT_EQ(renewed.pid, outcome.pid);
  EXPECT_EQ(renewed.incarnation, old.incarnation + 1);
  EXPECT_NE(parent_of(renewed.pid), getpid());

  const auto records = ledger(restarter);
  ASSERT_EQ(records.size(), 1U);
  EXPECT_EQ(records[0].cause, "killed without a word (SIGKILL?)");
  EXPECT_EQ(records[0].observer, "observer");
  EXPECT_EQ(records[0].subject, "one");
  EXPECT_EQ(records[0].fault, FaultClass::exited);
  EXPECT_EQ(records[0].old_incarnation, old.incarnation);
  EXPECT_EQ(records[0].new_incarnation, renewed.incarnation);
  EXPECT_EQ(records[0].outcome, What::restarted);
  EXPECT_TRUE(records[0].killed && records[0].started);
  EXPECT_EQ(read_start_record(var_, "one").restarts, 1U);
}

TEST_F(Restarting, StartsANodeThatNobodySawEnd) {
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  EXPECT_EQ(restarter.restart(absent()).what, What::restarted);
  EXPECT_EQ(running().incarnation, 1U);
}

TEST_F(Restarting, KillsAHungNodeOnlyAfterItSaidWhereItHangs) {
  if (sanitized) GTEST_SKIP() << "a sanitizer has handlers of its own";
  const auto old = start();
  signal_child(old.pid, SIGUSR1);
  ASSERT_TRUE(says("one", "hangs"));
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  const auto outcome = restarter.restart(accuse(old, FaultClass::silent));
  ASSERT_EQ(outcome.what, What::restarted) << outcome.reason;
  EXPECT_FALSE(processes().contains(old.pid));
  running("one", old.incarnation);

  const auto records = ledger(restarter);
  ASSERT_EQ(records.size(), 1U);
  EXPECT_THAT(records[0].cause, testing::HasSubstr("by the observer"));
  const auto report =
      read_file(var_.state("one") / "reports" / (std::to_string(old.incarnation) + ".report"));
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_THAT(*report, testing::HasSubstr("silent"));
  EXPECT_THAT(*report, testing::HasSubstr("incarnation 1 turns"));
  EXPECT_THAT(*report, testing::Not(testing::HasSubstr("incarnation 2 turns"))) << "the successor's log";
  if (records[0].cause.find("ended with signal 6") == std::string::npos) return;  // killed before its report
  EXPECT_THAT(*report, testing::HasSubstr("*** fatal signal 6 (SIGABRT) in thread restart_probe of pid " +
                                          std::to_string(old.pid)));
  EXPECT_THAT(*report, testing::HasSubstr("restart_probe("));
}

TEST_F(Restarting, SparesANodeWhoseWorkThreadTurnsAgain) {
  const auto old = start();
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  const Accusation accusation = accuse(old, FaultClass::silent);
  const auto turns = HeartbeatPage::read(var_, "one")->turns;
  ASSERT_TRUE(wait_until([&] { return HeartbeatPage::read(var_, "one")->turns > turns + 1; }));
  EXPECT_EQ(restarter.restart(accusation).what, What::not_believed);
  EXPECT_EQ(running().pid, old.pid);
}

TEST_F(Restarting, KillsAStoppedNodeWithoutLettingItRunAgain) {
  const auto old = start();
  signal_child(old.pid, SIGSTOP);
  ASSERT_TRUE(wait_until([&] { return process_state(old.pid) == 'T'; }));
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  std::vector<int> sent;
  restarter.set_signaller([&](const Process& process, int number) {
    sent.push_back(number);
    return process.signal(number);
  });
  ASSERT_EQ(restarter.restart(accuse(old, FaultClass::silent)).what, What::restarted);
  EXPECT_THAT(sent, testing::ElementsAre(SIGKILL));
  const auto records = ledger(restarter);
  ASSERT_EQ(records.size(), 1U);
  EXPECT_EQ(records[0].kernel_state, 'T');
}

TEST_F(Restarting, GivesANodeThatCommunicationFailedTimeToEndInOrderAndKillsItWhenItDoesNot) {
  behave("other", "stubborn");
  const auto obedient = start("one");
  const auto stubborn = start("other");
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  ASSERT_EQ(restarter.restart(accuse(obedient, FaultClass::too_large, "one")).what, What::restarted);
  ASSERT_EQ(restarter.restart(accuse(stubborn, FaultClass::too_large, "other")).what, What::restarted);
  const auto records = ledger(restarter);
  ASSERT_EQ(records.size(), 2U);
  // On a loaded machine the process may not end within 50 ms.
  EXPECT_THAT(records[0].cause, testing::AnyOf("SIGTERM by the observer, ended with exit code 0",
                                               testing::HasSubstr("SIGKILL")));
  EXPECT_EQ(records[1].cause, "SIGKILL by the observer");
}

TEST_F(Restarting, IsDeafToAnAccusationOfAnEarlierIncarnation) {
  const auto old = start();
  end(old.pid, SIGKILL);
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  ASSERT_EQ(restarter.restart(accuse(old, FaultClass::exited)).what, What::restarted);
  const auto renewed = running("one", old.incarnation);
  EXPECT_EQ(restarter.restart(accuse(old, FaultClass::exited)).what, What::renewed);
  EXPECT_EQ(restarter.restart(accuse(old, FaultClass::silent)).what, What::renewed);
  EXPECT_EQ(restarter.restart(absent()).what, What::renewed);
  // Same pid, but a different process.
  EXPECT_EQ(restarter.restart(accuse({renewed.pid, old.incarnation, ""}, FaultClass::silent)).what,
            What::renewed);
  EXPECT_EQ(restarter.restart(accuse({renewed.pid, renewed.incarnation + 1, ""}, FaultClass::silent)).what,
            What::not_believed);
  EXPECT_EQ(restarter.restart(accuse(renewed, FaultClass::exited)).what, What::not_believed);
  EXPECT_EQ(running().pid, renewed.pid);
}

TEST_F(Restarting, DoesNotTouchTheProcessThatGotTheNumberOfADeadOne) {
  const pid_t stranger = fork();
  if (stranger == 0) {
    while (true) pause();
  }
  std::ofstream(var_.instance_lock("one")) << stranger << " 7 probe\n";  // left by a dead node
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  const auto outcome = restarter.restart(accuse({stranger, 7, ""}, FaultClass::silent));
  EXPECT_EQ(outcome.what, What::restarted) << outcome.reason;
  EXPECT_EQ(running().incarnation, 8U) << "above what stands in the lock file";
  EXPECT_EQ(waitpid(stranger, nullptr, WNOHANG), 0) << "it lives";
  signal_child(stranger, SIGKILL);
  waitpid(stranger, nullptr, 0);
}

TEST_F(Restarting, OfManyRestartersOneStartsTheNode) {
  for (int round = 0; round < 5; ++round) {
    const auto old = round == 0 ? start() : running();
    end(old.pid, SIGKILL);
    constexpr int observers = 6;
    std::vector<What> outcomes(observers);
    std::vector<std::thread> threads;
    std::atomic<int> waiting = 0;
    ASSERT_TRUE(release(var_, "one", milliseconds(20000)));  // no back-off here
    for (int i = 0; i < observers; ++i) {
      threads.emplace_back([&, i] {
        CalmRestarter restarter(plan_, var_, "observer" + std::to_string(i), "/nowhere");
        ++waiting;
        while (waiting < observers) std::this_thread::yield();
        outcomes[static_cast<std::size_t>(i)] =
            restarter.restart(i % 2 == 0 ? accuse(old, FaultClass::exited) : absent()).what;
      });
    }
    for (auto& thread : threads) thread.join();
    running("one", old.incarnation);
    EXPECT_EQ(std::count(outcomes.begin(), outcomes.end(), What::restarted), 1);
    for (const What what : outcomes)
      EXPECT_TRUE(what == What::restarted || what == What::renewed || what == What::under_way)
          << to_text(what);
    EXPECT_EQ(processes().size(), 1U);
  }
}

TEST_F(Restarting, GoesOnFromWhateverARestarterThatWasKilledLeftBehind) {
  auto old = start();
  std::uint32_t random = 1;
  for (int round = 0; round < 25; ++round) {
    signal_child(old.pid, SIGUSR1);  // hangs, so the kill also takes time
    const pid_t other = fork();
    if (other == 0) {
      CalmRestarter restarter(plan_, var_, "first", "/nowhere");
      (void)restarter.restart(accuse(old, FaultClass::start_overdue));
      _exit(0);
    }
    random = random * 1664525U + 1013904223U;
    const timespec pause{0, static_cast<long>((random >> 8) % 40'000'000)};
    nanosleep(&pause, nullptr);  // sets the moment of the kill, which is the test input
    signal_child(other, SIGKILL);
    waitpid(other, nullptr, 0);

    CalmRestarter restarter(plan_, var_, "second", "/nowhere");
    ASSERT_TRUE(release(var_, "one", milliseconds(20000)));  // no back-off here
    ASSERT_TRUE(wait_until([&] {
      const auto what = restarter.restart(accuse(old, FaultClass::start_overdue)).what;
      return what == What::restarted || what == What::renewed;
    })) << round;
    old = running("one", old.incarnation);
    EXPECT_TRUE(wait_until([&] { return processes().size() == 1; })) << "one that came too late ends";
  }
}

TEST_F(Restarting, WaitsForNobodyWhoHoldsTheRestartLock) {
  const auto old = start();
  const int lock = open(var_.restart_lock("one").c_str(), O_RDWR | O_CLOEXEC);
  ASSERT_EQ(flock(lock, LOCK_EX | LOCK_NB), 0) << "the file that the starter left is no lock";
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  EXPECT_EQ(restarter.restart(accuse(old, FaultClass::silent)).what, What::under_way);
  close(lock);
  EXPECT_EQ(running().pid, old.pid);
}

TEST_F(Restarting, LeavesANodeToWhoStandsInForItUntilTheLeaseEndsAndThenEndsTheStandIn) {
  const auto old = start();
  for (const auto& [lease, outlives] : {std::pair{seconds(3600), true}, {seconds(-1), false}}) {
    const pid_t holder = fork();
    if (holder == 0) {
      const auto lock = RestartLock::take(var_, "one");
      if (lock) write_stand_in(var_, "one", "maintenance", monotonic_now() + lease);
      while (true) pause();  // frozen while it holds the node's restart lock
    }
    ASSERT_TRUE(wait_until([&] {
      const auto stand_in = read_stand_in(var_, "one");
      return stand_in && stand_in->pid == holder;
    }));
    CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
    signal_child(old.pid, SIGUSR1);
    const auto first = restarter.restart(accuse(old, FaultClass::start_overdue));
    EXPECT_EQ(first.what, What::under_way);
    EXPECT_THAT(first.reason, testing::HasSubstr("maintenance"));
    int status = 0;
    if (outlives) {
      EXPECT_EQ(waitpid(holder, &status, WNOHANG), 0) << "within its lease nobody ends it";
      signal_child(holder, SIGKILL);
    }
    ASSERT_EQ(waitpid(holder, &status, 0), holder);
    EXPECT_TRUE(WIFSIGNALED(status));
    if (outlives) continue;
    EXPECT_TRUE(wait_until(
        [&] { return restarter.restart(accuse(old, FaultClass::start_overdue)).what == What::restarted; }));
  }
}

TEST_F(Restarting, StartsNoSecondProcessWhileTheFirstIsOnTheWayToItsInstanceLock) {
  plan_.ring.start_deadline = std::chrono::hours(1);
  behave("one", "slow");
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  const auto first = restarter.restart(absent());
  ASSERT_EQ(first.what, What::restarted) << first.reason;
  EXPECT_EQ(restarter.restart(absent()).what, What::under_way);
  const auto pid = launch({plan_, var_, "/nowhere", "up"}, *plan_.find("one"));
  EXPECT_TRUE(pid && *pid == first.pid) << "for `srfs up` it runs";
  EXPECT_EQ(processes(), std::set<pid_t>{first.pid});
  ASSERT_TRUE(write_file_atomically(var_.run() / "go", ""));
  EXPECT_EQ(running().pid, first.pid);
}

TEST_F(Restarting, ReplacesAProcessThatHangsOnTheWayToItsInstanceLock) {
  plan_.ring.start_deadline = milliseconds(1);  // expired when the first call returns
  behave("one", "slow");
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  const auto first = restarter.restart(absent());
  ASSERT_EQ(first.what, What::restarted) << first.reason;
  ASSERT_TRUE(says("one", "slow"));
  behave("one", "");
  const auto second = restarter.restart(absent());
  ASSERT_EQ(second.what, What::restarted) << second.reason;
  EXPECT_NE(second.pid, first.pid);
  EXPECT_EQ(processes(), std::set<pid_t>{running().pid});
}

TEST_F(Restarting, LeavesTheLockToNoProcessItStarted) {
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  ASSERT_EQ(restarter.restart(absent()).what, What::restarted);
  EXPECT_TRUE(RestartLock::take(var_, "one"));
}

TEST_F(Restarting, LeavesASuiteThatIsBeingStoppedAlone) {
  ASSERT_TRUE(write_file_atomically(var_.stopping_flag(), "down\n"));
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  EXPECT_EQ(restarter.restart(absent()).what, What::stopping);
  EXPECT_TRUE(processes().empty());
}

TEST_F(Restarting, LeavesANodeThatTheOperatorHoldsUntilItIsReleased) {
  ASSERT_TRUE(hold(var_, plan_, "one", "by hand", monotonic_now()));
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  const auto outcome = restarter.restart(absent());
  EXPECT_EQ(outcome.what, What::held);
  EXPECT_EQ(outcome.reason, "by hand");
  ASSERT_TRUE(release(var_, "one", milliseconds(1000)));
  EXPECT_EQ(restarter.restart(absent()).what, What::restarted);
}

TEST_F(Restarting, BelievesNoVerdictOfAnotherGenerationOfTheRing) {
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  restarter.set_generation_source([] { return 8; });
  Accusation accusation = absent();
  accusation.generation = 7;
  EXPECT_EQ(restarter.restart(accusation).what, What::not_believed);
  accusation.generation = 8;
  EXPECT_EQ(restarter.restart(accusation).what, What::restarted);
}

TEST_F(Restarting, BelievesNobodyAboutItselfOrAboutStrangers) {
  CalmRestarter restarter(plan_, var_, "one", "/nowhere");
  EXPECT_EQ(restarter.restart(absent("one")).what, What::not_believed);
  EXPECT_EQ(restarter.restart(absent("stranger")).what, What::not_believed);
  EXPECT_TRUE(processes().empty());
}

TEST_F(Restarting, KillsOneNodeOfTheSuiteForACommunicationFaultPerInterval) {
  const auto one = start("one");
  const auto other = start("other");
  CalmRestarter first(plan_, var_, "first", "/nowhere");
  CalmRestarter second(plan_, var_, "second", "/nowhere");
  EXPECT_EQ(first.restart(accuse(one, FaultClass::deaf, "one")).what, What::restarted);
  EXPECT_EQ(second.restart(accuse(other, FaultClass::deaf, "other")).what, What::communication);
  EXPECT_EQ(second.restart(accuse(running("one", one.incarnation), FaultClass::deaf, "one")).what,
            What::communication);
  EXPECT_EQ(running("other").pid, other.pid);
}

TEST_F(Restarting, OnAMachineUnderPressureStartsOneNodeInATime) {
  const auto one = start("one");
  const auto other = start("other");
  end(one.pid, SIGKILL);
  end(other.pid, SIGKILL);
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  restarter.set_pressure_source([] { return 0.9; });
  const Accusation waiting = accuse(other, FaultClass::exited, "other");
  EXPECT_EQ(restarter.restart(accuse(one, FaultClass::exited)).what, What::restarted);
  const MonotonicTime started = monotonic_now();
  const auto spaced = restarter.restart(waiting);
  if (monotonic_now() - started < Restarter::between_starts / 2) {  // later the wait may have ended
    EXPECT_EQ(spaced.what, What::under_way);
    EXPECT_THAT(spaced.reason, testing::HasSubstr("90 %"));
  }
  EXPECT_TRUE(wait_until([&] { return restarter.restart(waiting).what != What::under_way; }));
  running("other", other.incarnation);
}

TEST_F(Restarting, ADeafNodeThatMayNotBeKilledYetLeavesTheTurnToOthers) {
  const auto one = start("one");
  const auto other = start("other");
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  double pressure = 0.2;
  restarter.set_pressure_source([&pressure] { return pressure; });
  EXPECT_EQ(restarter.restart(accuse(one, FaultClass::deaf, "one")).what, What::restarted);
  const auto again = running("one", one.incarnation);
  pressure = 0.9;
  EXPECT_EQ(restarter.restart(accuse(again, FaultClass::deaf, "one")).what, What::communication);
  end(other.pid, SIGKILL);
  EXPECT_EQ(restarter.restart(accuse(other, FaultClass::exited, "other")).what, What::restarted);
  running("other", other.incarnation);
}

TEST_F(Restarting, WithoutPressureOrAKernelThatTellsItNoStartWaits) {
  for (const std::optional<double> pressure : {std::optional(0.2), std::optional<double>()}) {
    const auto one = start("one");
    const auto other = start("other");
    end(one.pid, SIGKILL);
    end(other.pid, SIGKILL);
    CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
    restarter.set_pressure_source([pressure] { return pressure; });
    EXPECT_EQ(restarter.restart(accuse(one, FaultClass::exited)).what, What::restarted);
    EXPECT_EQ(restarter.restart(accuse(other, FaultClass::exited, "other")).what, What::restarted);
    running("one", one.incarnation);
    running("other", other.incarnation);
  }
}

TEST_F(Restarting, LooksTwiceAtANodeThatDiesAtOnceAndEndsInQuarantineWithASlowRetry) {
  behave("one", "exit 7");
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  // The time from before one start to after the next covers at least the wait between them.
  constexpr std::array<milliseconds, 7> waits{milliseconds(0),   milliseconds(0),   milliseconds(0),
                                              milliseconds(100), milliseconds(200), milliseconds(400),
                                              milliseconds(400)};
  std::set<What> refusals;
  std::size_t attempts = 0;
  MonotonicTime last_start;
  ASSERT_TRUE(wait_until([&] {
    const MonotonicTime before = monotonic_now();
    const auto outcome = restarter.restart(absent());
    if (outcome.what != What::cannot_start) {
      refusals.insert(outcome.what);
      return false;
    }
    ++attempts;
    EXPECT_GE(monotonic_now() - last_start, attempts < waits.size() ? waits[attempts] : waits.back());
    last_start = before;
    return attempts >= 7 && refusals.contains(What::quarantined);
  }));
  behave("one", "");
  ASSERT_EQ(insist(restarter, absent()).what, What::restarted) << "quarantine tries again by itself";
  EXPECT_EQ(running().incarnation, 1U);
}

TEST_F(Restarting, TellsWhenTheNextStartIsAndAReleaseLiftsTheQuarantine) {
  behave("one", "exit 7");
  plan_.ring.first_wait = plan_.ring.longest_wait = std::chrono::hours(1);
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  RestartOutcome outcome;
  const MonotonicTime before = monotonic_now();
  ASSERT_TRUE(wait_until([&] { return (outcome = restarter.restart(absent())).what == What::backing_off; }));
  ASSERT_TRUE(outcome.not_before);
  EXPECT_GT(*outcome.not_before, before + std::chrono::minutes(59));
  behave("one", "");
  EXPECT_EQ(restarter.restart(absent()).what, What::backing_off);
  ASSERT_TRUE(release(var_, "one", milliseconds(1000)));
  EXPECT_EQ(restarter.restart(absent()).what, What::restarted);
}

TEST_F(Restarting, InABackOffKillsWhatHangsAndLeavesWhatStillWorks) {
  plan_.ring.restarts = plan_.ring.quarantine_deaths = 1;
  plan_.ring.longest_wait = std::chrono::hours(1);
  const auto one = start("one");
  const auto other = start("other");
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  EXPECT_EQ(restarter.restart(accuse(other, FaultClass::worker_frozen, "other")).what, What::backing_off);
  EXPECT_EQ(running("other").pid, other.pid);
  signal_child(one.pid, SIGUSR1);
  EXPECT_EQ(restarter.restart(accuse(one, FaultClass::start_overdue, "one")).what, What::quarantined);
  EXPECT_EQ(processes(), std::set<pid_t>{other.pid});
}

TEST_F(Restarting, RecordsARefusalThatRepeatsOnce) {
  behave("one", "exit 7");
  plan_.ring.restarts = plan_.ring.quarantine_deaths = 1;
  plan_.ring.longest_wait = std::chrono::hours(1);
  const auto first = launch({plan_, var_, "/nowhere", "up"}, *plan_.find("one"));
  EXPECT_FALSE(first);
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  for (int i = 0; i < 5; ++i) EXPECT_EQ(restarter.restart(absent()).what, What::quarantined);
  EXPECT_EQ(ledger(restarter).size(), 1U);
}

TEST_F(Restarting, SaysWhatIsWrongWithAProgramThatCannotRun) {
  // Like an installed program, the copy finds its libraries relative to its own location.
  std::filesystem::create_directory_symlink(SRFS_BINARY_DIR "/lib", folder_ / "lib");
  std::filesystem::create_directory(folder_ / "bin");
  const auto program = (folder_ / "bin" / "program").string();
  const auto outcome_of = [&] {
    EXPECT_TRUE(release(var_, "one", milliseconds(1000)));
    CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
    const auto outcome = restarter.restart(absent());
    EXPECT_EQ(outcome.what, What::cannot_start);
    EXPECT_TRUE(processes().empty());
    return outcome.reason;
  };
  use_programs(program, probe);
  EXPECT_THAT(outcome_of(), testing::HasSubstr("ENOENT"));
  std::filesystem::copy_file(probe, program);
  std::filesystem::permissions(program, std::filesystem::perms::owner_read);
  EXPECT_THAT(outcome_of(), testing::HasSubstr("EACCES"));
  std::filesystem::remove(program);
  std::ofstream(program) << "no program at all";
  std::filesystem::permissions(program, std::filesystem::perms::owner_all);
  EXPECT_THAT(outcome_of(), testing::HasSubstr("ENOEXEC"));

  // A missing library only shows after exec.
  std::string image = *read_file(probe, 256U << 20);
  const std::string library = "libsrfs_suite.so";
  const std::size_t at = image.find(library);
  ASSERT_NE(at, std::string::npos);
  image.replace(at, library.size(), "libsrfs_suitx.so");
  std::ofstream(program, std::ios::trunc) << image;
  EXPECT_THAT(outcome_of(), testing::HasSubstr("ended"));
  EXPECT_THAT(*read_file(var_.log("one")), testing::HasSubstr("libsrfs_suitx.so"));

  // The kernel or the dynamic linker ends a truncated program.
  std::ofstream(program, std::ios::trunc) << image.substr(0, 3000);
  (void)outcome_of();

  std::filesystem::remove(program);
  std::filesystem::copy_file(probe, program);
  ASSERT_TRUE(release(var_, "one", milliseconds(1000)));
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  EXPECT_EQ(restarter.restart(absent()).what, What::restarted) << "once it is repaired";
}

TEST_F(Restarting, StartsNoSecondInstanceBesideOneThatCannotBeKilled) {
  const auto old = start();
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  restarter.set_signaller([](const Process&, int) { return 0; });
  const auto outcome = restarter.restart(accuse(old, FaultClass::start_overdue));
  EXPECT_EQ(outcome.what, What::unkillable);
  EXPECT_EQ(outcome.pid, old.pid);
  EXPECT_THAT(outcome.reason, testing::HasSubstr("survived SIGKILL"));
  EXPECT_EQ(processes(), std::set<pid_t>{old.pid});
  restarter.set_signaller([](const Process& process, int number) { return process.signal(number); });
  EXPECT_EQ(restarter.restart(accuse(old, FaultClass::start_overdue)).what, What::restarted);
  const auto records = ledger(restarter);
  ASSERT_EQ(records.size(), 2U);
  EXPECT_EQ(records[0].outcome, What::unkillable);
  EXPECT_EQ(records[1].outcome, What::restarted);
}

TEST_F(Restarting, CallsAProcessInAFrozenGroupUnkillableAndReplacesItOnceItIsGone) {
  // The freezer of control groups version 1 holds a process in state D, SIGKILL or not.
  const auto group = std::filesystem::path("/sys/fs/cgroup/freezer") / folder_.filename();
  std::error_code ec;
  if (!std::filesystem::create_directory(group, ec)) GTEST_SKIP() << "no freezer: " << ec.message();
  const auto old = start();
  std::ofstream(group / "cgroup.procs") << old.pid;
  const auto set = [&](const std::string& state) {
    return wait_until([&] {
      std::ofstream(group / "freezer.state") << state;
      return read_file(group / "freezer.state", 64).value_or("") == state + "\n";
    });
  };
  const bool frozen = set("FROZEN");
  {
    CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
    if (frozen) {
      const auto outcome = restarter.restart(accuse(old, FaultClass::silent));
      EXPECT_EQ(outcome.what, What::unkillable) << outcome.reason;
      EXPECT_EQ(processes(), std::set<pid_t>{old.pid});
      EXPECT_THAT(outcome.reason, testing::HasSubstr("state D"));
    }
    EXPECT_TRUE(set("THAWED"));
    if (frozen) {
      EXPECT_TRUE(wait_until(
          [&] { return restarter.restart(accuse(old, FaultClass::silent)).what == What::restarted; }));
      running("one", old.incarnation);
    }
  }
  EXPECT_TRUE(wait_until([&] { return std::filesystem::remove(group, ec) && !ec; }));
  EXPECT_TRUE(frozen);
}

TEST_F(Restarting, StartsOnAFullDiskWithoutLogAndRecords) {
  std::filesystem::create_directories(var_.root);
  if (mount("none", var_.root.c_str(), "tmpfs", 0, "size=64k") != 0) GTEST_SKIP() << "may not mount";
  const auto old = start();
  {
    std::ofstream filler(var_.root / "filler");
    while (filler << std::string(4096, 'x') << std::flush) {
    }
  }
  std::filesystem::remove(var_.restart_lock("one"));
  end(old.pid, SIGKILL);
  std::uint32_t last = old.incarnation;
  {
    CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
    for (int i = 0; i < 3; ++i) {
      const auto outcome = insist(restarter, absent());
      EXPECT_EQ(outcome.what, What::restarted) << outcome.reason;
      const auto renewed = running("one", last);
      EXPECT_GT(renewed.incarnation, last);
      last = renewed.incarnation;
      end(renewed.pid, SIGKILL);
    }
    EXPECT_TRUE(restarter.flush(milliseconds(20000)));
    EXPECT_GT(restarter.records_lost(), 0U);
  }
  EXPECT_TRUE(wait_until([&] { return processes().empty(); }));
  EXPECT_EQ(umount2(var_.root.c_str(), MNT_DETACH), 0);
}

TEST_F(Restarting, NeedsNoMemoryFolder) {
  // Without the folder there is no history, no turn for deaf nodes, and no heartbeat page.
  std::filesystem::remove_all(var_.memory());
  std::ofstream(var_.memory()) << "a file where a folder should be";
  const auto old = start();
  end(old.pid, SIGKILL);
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  const auto outcome = restarter.restart(accuse(old, FaultClass::exited));
  EXPECT_EQ(outcome.what, What::restarted) << outcome.reason;
  const auto renewed = running("one", old.incarnation);
  EXPECT_EQ(restarter.restart(accuse(renewed, FaultClass::deaf)).what, What::communication);
}

TEST_F(Restarting, AddsTheTimeToActiveToTheLedger) {
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  ASSERT_EQ(restarter.restart(absent()).what, What::restarted);
  restarter.on_recovered("one", 1, monotonic_now());
  const auto records = ledger(restarter);
  ASSERT_EQ(records.size(), 2U);
  EXPECT_EQ(records[1].kind, FaultRecord::Kind::active);
  EXPECT_EQ(records[1].new_incarnation, records[0].new_incarnation);
  EXPECT_TRUE(records[1].active);
}

TEST_F(Restarting, KeepsTheFiveNewestReports) {
  plan_.ring.restarts = plan_.ring.quarantine_deaths = 1000;
  auto now = start();
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  for (int i = 0; i < 7; ++i) {
    end(now.pid, SIGKILL);
    ASSERT_EQ(restarter.restart(accuse(now, FaultClass::exited)).what, What::restarted);
    now = running("one", now.incarnation);
    (void)ledger(restarter);
  }
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(var_.state("one") / "reports"))
    names.insert(entry.path().filename().string());
  EXPECT_EQ(names, (std::set<std::string>{"3.report", "4.report", "5.report", "6.report", "7.report"}));
}

const std::string good = "exec " + probe + R"( "$@")";

TEST_F(Restarting, StartsTheActiveVersionAndTheLastGoodOneAfterADeathInItsProbation) {
  plan_.ring.restarts = 2;  // a second death in a row means a wait of one hour
  plan_.ring.first_wait = plan_.ring.longest_wait = std::chrono::hours(1);
  const auto first = start();
  make_active(add_version(good));
  end(first.pid, SIGKILL);
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  auto outcome = restarter.restart(accuse(first, FaultClass::exited));
  ASSERT_EQ(outcome.what, What::restarted) << outcome.reason;
  EXPECT_EQ(outcome.version, 1U) << "the death of golden is not held against it";
  EXPECT_FALSE(outcome.fallback);
  const auto second = running("one", first.incarnation);
  EXPECT_EQ(last_started(var_, "one")->version, 1U);

  end(second.pid, SIGKILL);
  outcome = restarter.restart(accuse(second, FaultClass::exited));
  ASSERT_EQ(outcome.what, What::restarted) << "at once: " << outcome.reason;
  EXPECT_EQ(outcome.version, update::golden);
  ASSERT_TRUE(outcome.fallback);
  EXPECT_EQ(outcome.fallback->from, 1U);
  EXPECT_THAT(outcome.reason, testing::HasSubstr("in its probation"));
  EXPECT_EQ(table().active(), update::golden);

  const auto records = ledger(restarter);
  ASSERT_EQ(records.size(), 2U);
  EXPECT_EQ(records[0].version, 1U);
  EXPECT_EQ(records[1].version, 0U);
  EXPECT_EQ(records[1].failed_version, 1U);
  EXPECT_EQ(records[1].reason, outcome.reason);
  EXPECT_EQ(table_on_disk().find(1)->state, update::VersionState::failed);

  // The restored version does not inherit the failed version's deaths.
  const auto third = running("one", second.incarnation);
  end(third.pid, SIGKILL);
  EXPECT_EQ(restarter.restart(accuse(third, FaultClass::exited)).what, What::restarted);
}

TEST_F(Restarting, AHangInTheProbationGoesBackToo) {
  make_active(add_version(good));
  const auto old = start();
  signal_child(old.pid, SIGUSR1);
  ASSERT_TRUE(says("one", "hangs"));
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  const auto outcome = restarter.restart(accuse(old, FaultClass::silent));
  ASSERT_EQ(outcome.what, What::restarted) << outcome.reason;
  EXPECT_EQ(outcome.version, update::golden);
}

TEST_F(Restarting, ADeathAfterTheProbationStartsTheSameVersionAndMakesItTheLastGoodOne) {
  make_active(add_version(good), milliseconds(1));
  const auto old = start();
  ASSERT_TRUE(
      wait_until([&] { return monotonic_now() - last_started(var_, "one")->since > milliseconds(1); }));
  end(old.pid, SIGKILL);
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  const auto outcome = restarter.restart(accuse(old, FaultClass::exited));
  ASSERT_EQ(outcome.what, What::restarted) << outcome.reason;
  EXPECT_EQ(outcome.version, 1U);
  (void)ledger(restarter);
  EXPECT_EQ(table_on_disk().last_good(), 1U);
}

TEST_F(Restarting, ANodeOfTheCommandPathGivesWayToGoldenBeforeItIsQuarantined) {
  for (const bool on_command_path : {false, true}) {
    SCOPED_TRACE(on_command_path);
    plan_.ring.restarts = plan_.ring.quarantine_deaths = 3;
    plan_.ring.first_wait = plan_.ring.longest_wait = std::chrono::hours(1);
    if (on_command_path) plan_.ring.critical = {"one"};
    ASSERT_TRUE(release(var_, "one", milliseconds(1000)));  // of the round before
    if (!on_command_path) {
      make_active(add_version(good));
      commit(1);
    }
    auto now = start();
    EXPECT_EQ(last_started(var_, "one")->version, 1U);
    CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
    const auto die = [&] {
      end(now.pid, SIGKILL);
      const auto outcome = restarter.restart(accuse(now, FaultClass::exited));
      if (outcome.what == What::restarted) now = running("one", now.incarnation);
      return outcome;
    };
    for (int death = 1; death < 3; ++death) EXPECT_EQ(die().version, 1U);
    const auto third = die();
    if (!on_command_path) {
      EXPECT_EQ(third.what, What::quarantined);
      continue;
    }
    ASSERT_EQ(third.what, What::restarted) << third.reason;
    EXPECT_EQ(third.version, update::golden);
    ASSERT_TRUE(third.fallback);
    EXPECT_EQ(third.fallback->from, 1U);
    EXPECT_EQ(ledger(restarter).back().failed_version, 1U);
    EXPECT_EQ(table_on_disk().find(1)->state, update::VersionState::failed);
    for (int death = 1; death < 3; ++death) EXPECT_EQ(die().what, What::restarted);
    const auto last = die();
    EXPECT_EQ(last.what, What::quarantined) << "golden is all there is";
    EXPECT_TRUE(last.not_before) << "tried again by itself";
  }
}

TEST_F(Restarting, AVersionThatNobodyConfirmedInTimeIsRolledBackThoughItLivesAndIsHeld) {
  plan_.ring.confirmed = {"one"};
  make_active(add_version(good), milliseconds(1));
  const auto old = start();
  ASSERT_TRUE(
      wait_until([&] { return monotonic_now() - last_started(var_, "one")->since > milliseconds(1); }));
  ASSERT_TRUE(hold(var_, plan_, "one", "by the operator", monotonic_now()));
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  EXPECT_EQ(restarter.restart(accuse(old, FaultClass::silent)).what, What::held);
  const auto outcome = restarter.restart(accuse(old, FaultClass::not_confirmed));
  ASSERT_EQ(outcome.what, What::restarted) << outcome.reason;
  EXPECT_EQ(outcome.version, update::golden);
  EXPECT_THAT(outcome.reason, testing::HasSubstr("not confirmed in time"));
  EXPECT_GT(running("one", old.incarnation).pid, 0);
  const auto records = ledger(restarter);
  EXPECT_EQ(records.back().fault, FaultClass::not_confirmed);
  EXPECT_EQ(records.back().failed_version, 1U);
  EXPECT_EQ(table_on_disk().find(1)->state, update::VersionState::failed);
}

TEST_F(Restarting, ADeathOfAVersionThatNobodyConfirmedGoesBackHoweverLongItLived) {
  plan_.ring.confirmed = {"one"};
  make_active(add_version(good), milliseconds(1));
  const auto old = start();
  ASSERT_TRUE(
      wait_until([&] { return monotonic_now() - last_started(var_, "one")->since > milliseconds(1); }));
  end(old.pid, SIGKILL);
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  EXPECT_EQ(restarter.restart(accuse(old, FaultClass::exited)).version, update::golden);
}

TEST_F(Restarting, AVerdictOnAVersionIsVoidOnceThatIsConfirmedOrWhileItHasTime) {
  plan_.ring.confirmed = {"one"};
  make_active(add_version(good));
  const auto old = start();
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  EXPECT_EQ(restarter.restart(accuse(old, FaultClass::not_confirmed)).what, What::not_believed)
      << "it has time";
  commit(1);
  for (const auto fault : {FaultClass::not_confirmed, FaultClass::limit_violation})
    EXPECT_EQ(restarter.restart(accuse(old, fault)).what, What::not_believed);
  EXPECT_EQ(running().pid, old.pid);
}

TEST_F(Restarting, AThirdStartOfTheSuiteInAProbationStartsTheLastGoodVersion) {
  make_active(add_version(good));
  const auto start_of_the_suite = [&] {
    const LaunchRequest request{plan_, var_, "/nowhere", "up"};
    count_suite_start(request, *plan_.find("one"));
    const auto instance = start();
    const auto version = last_started(var_, "one")->version;
    end(instance.pid, SIGKILL);
    std::filesystem::remove_all(var_.memory());  // a reset of the computer
    return version;
  };
  EXPECT_EQ(start_of_the_suite(), 1U);
  EXPECT_EQ(table_on_disk().find(1)->resets, 1U) << "on disk before the start";
  EXPECT_EQ(start_of_the_suite(), 1U);
  EXPECT_EQ(start_of_the_suite(), update::golden);
  EXPECT_EQ(table_on_disk().find(1)->state, update::VersionState::failed);
  const auto records = FaultLedger(var_).read().records;
  ASSERT_EQ(records.size(), 1U);
  EXPECT_EQ(records[0].failed_version, 1U);
  EXPECT_THAT(records[0].reason, testing::HasSubstr("3 resets"));
}

TEST_F(Restarting, AStartOfTheSuiteThatCannotBeCountedStartsTheLastGoodVersion) {
  make_active(add_version(good));
  for (const char* unfinished : {"table_a.new", "table_b.new"})  // blocks writing, even for root
    std::filesystem::create_directory(versions_folder(var_, "one") / unfinished);
  count_suite_start({plan_, var_, "/nowhere", "up"}, *plan_.find("one"));
  (void)start();
  EXPECT_EQ(last_started(var_, "one")->version, update::golden);
  EXPECT_EQ(table_on_disk().active(), 1U);
  EXPECT_THAT(table().find(1)->reason, testing::HasSubstr("cannot be counted"));
}

TEST_F(Restarting, CommitsTheVersionThatHasProvenItself) {
  make_active(add_version(good));
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  restarter.commit("one", 7);  // a late request for another version
  restarter.commit("one", 1);
  restarter.commit("one", 1);
  EXPECT_TRUE(ledger(restarter).empty());
  EXPECT_EQ(table_on_disk().last_good(), 1U);
  EXPECT_EQ(restarter.records_lost(), 0U);
}

TEST_F(Restarting, AVersionOnProbationThatDoesNotStartIsFollowedByTheLastGoodOneInTheSameAttempt) {
  const auto one = add_version(good);
  make_active(one);
  commit(one);
  make_active(add_version("exit 7"));
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  const auto outcome = restarter.restart(absent());
  ASSERT_EQ(outcome.what, What::restarted) << outcome.reason;
  EXPECT_EQ(outcome.version, one);
  EXPECT_EQ(outcome.fallback->from, 2U);
  const auto records = ledger(restarter);
  ASSERT_EQ(records.size(), 1U);
  EXPECT_THAT(records[0].reason, testing::HasSubstr("ended before it held its instance lock"));
  EXPECT_EQ(table_on_disk().active(), one);
}

TEST_F(Restarting, WhatIsSetAsideWhenNothingStartsIsOnDiskToo) {
  make_active(add_version("exit 7"));
  use_programs((folder_ / "gone").string(), probe);
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  EXPECT_EQ(restarter.restart(absent()).what, What::cannot_start);
  (void)ledger(restarter);
  EXPECT_EQ(table_on_disk().find(1)->state, update::VersionState::failed);
}

TEST_F(Restarting, AGoodVersionThatDoesNotStartStaysActive) {
  const auto one = add_version("exit 7");
  make_active(one);
  commit(one);
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  EXPECT_EQ(restarter.restart(absent()).what, What::cannot_start);
  (void)ledger(restarter);
  EXPECT_EQ(table_on_disk().active(), one);
  EXPECT_EQ(table().active(), one);
}

TEST_F(Restarting, ADamagedProgramOfAGoodVersionIsReplacedByTheNextBest) {
  for (const bool whole_size : {false, true}) {
    const auto number = add_version(good);
    make_active(number);
    commit(number);
    std::filesystem::remove(program_of(number));
    std::string text = "#!/bin/sh\n" + good + "\n";
    if (whole_size) {
      text = "#!/bin/xx" + text.substr(9);  // cannot be executed
    } else {
      text.pop_back();
    }
    std::ofstream(program_of(number)) << text;
    std::filesystem::permissions(program_of(number), std::filesystem::perms(0555));
    ASSERT_TRUE(release(var_, "one", milliseconds(1000)));
    CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
    const auto outcome = restarter.restart(absent());
    ASSERT_EQ(outcome.what, What::restarted) << outcome.reason;
    EXPECT_EQ(outcome.version, update::golden);
    EXPECT_THAT(outcome.reason, testing::HasSubstr(whole_size ? "SHA-256" : "octets instead of"));
    EXPECT_THAT(ledger(restarter).back().reason, testing::HasSubstr("the golden version instead of"));
    EXPECT_EQ(table_on_disk().active(), update::golden);
    EXPECT_EQ(table_on_disk().find(number)->state, update::VersionState::failed);
    end(running().pid, SIGKILL);
  }
}

TEST_F(Restarting, WhatWasGoodOnceIsStartedWhenGoldenIsGone) {
  const auto one = add_version(good);
  make_active(one);
  commit(one);
  make_active(update::golden);
  use_programs((folder_ / "gone").string(), probe);
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  const auto outcome = restarter.restart(absent());
  ASSERT_EQ(outcome.what, What::restarted) << outcome.reason;
  EXPECT_EQ(outcome.version, one);
  EXPECT_THAT(outcome.reason, testing::HasSubstr("ENOENT"));
}

TEST_F(Restarting, AnUnreadableTableMeansGolden) {
  make_active(add_version("exit 7"));
  for (const char* copy : {"table_a", "table_b"})
    std::ofstream(versions_folder(var_, "one") / copy, std::ios::trunc) << "rubbish";
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  const auto outcome = restarter.restart(absent());
  ASSERT_EQ(outcome.what, What::restarted) << outcome.reason;
  EXPECT_EQ(outcome.version, update::golden);
}

TEST_F(Restarting, AFirstStartComparesTheHashAndSaysInTheLedgerWhatItStartedInstead) {
  const auto number = add_version(good);
  make_active(number);
  commit(number);
  std::filesystem::remove(program_of(number));
  std::string text = "#!/bin/sh\n" + good + "\n";
  text.back() = ' ';  // altered, but it would still run
  std::ofstream(program_of(number)) << text;
  std::filesystem::permissions(program_of(number), std::filesystem::perms(0555));
  (void)start();
  EXPECT_EQ(last_started(var_, "one")->version, update::golden);
  const auto records = FaultLedger(var_).read().records;
  ASSERT_EQ(records.size(), 1U);
  EXPECT_EQ(records[0].observer, "launcher");
  EXPECT_EQ(records[0].failed_version, number);
  EXPECT_EQ(table_on_disk().active(), update::golden);
}

TEST_F(Restarting, ARunningNodeIsRestartedInTheVersionThatIsAskedFor) {
  const auto old = start();
  const auto number = add_version(good);
  const LaunchRequest request{plan_, var_, "/nowhere", "test"};
  const auto used = use_version(request, *plan_.find("one"), number, std::chrono::hours(1));
  ASSERT_TRUE(used) << used.error();
  ASSERT_TRUE(*used);
  EXPECT_EQ((*used)->version, number);
  const auto renewed = running("one", old.incarnation);
  EXPECT_EQ(renewed.pid, (*used)->pid);
  const auto again = use_version(request, *plan_.find("one"), number, std::chrono::hours(1));
  ASSERT_TRUE(again);
  EXPECT_FALSE(*again) << "it runs";
  EXPECT_EQ(running().pid, renewed.pid);

  const auto bad = add_version("exit 7");
  const auto fell = use_version(request, *plan_.find("one"), bad, std::chrono::hours(1));
  ASSERT_TRUE(fell) << fell.error();
  EXPECT_EQ((*fell)->version, update::golden) << "version 1 had not proven itself";
  EXPECT_EQ((*fell)->fallback->from, bad);
  EXPECT_EQ(table_on_disk().active(), update::golden);
  EXPECT_FALSE(use_version(request, *plan_.find("one"), 77, seconds(1)));
}

TEST_F(Restarting, AVersionSetAsideIsFailedForEverybodyBeforeTheDiskKnows) {
  const auto number = add_version(good);
  make_active(number);
  ASSERT_TRUE(set_aside(var_, "one", number, "because"));
  EXPECT_EQ(table().active(), update::golden);
  EXPECT_EQ(table_on_disk().active(), number);
  ASSERT_TRUE(settle_versions(var_, "one"));
  EXPECT_EQ(table_on_disk().find(number)->reason, "because");
  make_active(number);
  EXPECT_EQ(table().active(), number) << "an operator may insist";
}

TEST_F(Restarting, TellsTheSignalThatEndedANode) {
  if (sanitized) GTEST_SKIP() << "a sanitizer has handlers of its own";
  struct Death {
    int signal_sent;
    std::string cause;
    std::string in_report;
  };
  CalmRestarter restarter(plan_, var_, "observer", "/nowhere");
  auto now = start();
  for (const Death& death : {Death{SIGUSR2, "signal 11 (SIGSEGV)",
                                   "*** fatal signal 11 (SIGSEGV) in thread restart_probe of pid "},
                             Death{SIGHUP, "signal 6 (SIGABRT)", "nobody catches this"},
                             Death{SIGTERM, "exit code 0", "--- backtrace\nnone\n"}}) {
    ASSERT_TRUE(release(var_, "one", milliseconds(1000)));
    end(now.pid, death.signal_sent);
    ASSERT_EQ(restarter.restart(accuse(now, FaultClass::exited)).what, What::restarted);
    const auto records = ledger(restarter);
    ASSERT_FALSE(records.empty());
    EXPECT_EQ(records.back().cause, death.cause);
    const auto report =
        read_file(var_.state("one") / "reports" / (std::to_string(now.incarnation) + ".report"));
    ASSERT_TRUE(report);
    EXPECT_THAT(*report, testing::HasSubstr(death.in_report));
    now = running("one", now.incarnation);
  }
}

}  // namespace
}  // namespace srfs::suite
