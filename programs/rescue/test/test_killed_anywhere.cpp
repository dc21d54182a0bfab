// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// A step down is killed before each of its system calls in turn, as a power loss would cut it.
#include <array>
#include <map>

#include <gtest/gtest.h>
#include <sys/ptrace.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "base/fd.hpp"
#include "base/file.hpp"
#include "nodes/ttc/command/journal_file.hpp"
#include "programs/rescue/starter.hpp"
#include "tests/signal_child.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::rescue {
namespace {

namespace fs = std::filesystem;
constexpr std::uint64_t counter = 77'000;
const std::map<std::string, std::string> own_files{
    {"store/events/1", "packets"},     {"versions/ttc/table_a", "rubbish"},
    {"state/ttc/mode", "nominal"},     {"state/payload_eps/parameters.yaml", "values"},
    {"state/timing/incarnation", "7"}, {"state/ttc/key_selection.0", "keys"},
};

/// A suite with counters in its journal alone, six unhealthy starts behind it.
suite::RescueSettings make_suite(const fs::path& folder) {
  suite::RescueSettings settings;
  settings.var = (folder / "var").string();
  settings.program = (folder / "opt/bin/srfs").string();
  settings.deployment = (folder / "etc/deployment.yaml").string();
  for (const auto& [name, text] : own_files) EXPECT_TRUE(write_file_atomically(folder / "var" / name, text));
  AcceptanceJournal journal("boot", milliseconds(0));
  journal.begin({}, 1, MonotonicTime());
  LinkState link;
  link.generation = 3;
  link.associations.push_back({.spi = 1, .counter = counter});
  journal.on_link(link);
  JournalFile file(folder / "var/state/ttc/telecommands");
  JournalLog log(file);
  (void)log.load();
  EXPECT_TRUE(log.snapshot(*journal.take_batch(true).snapshot));
  const auto problem = suite::StepStore(folder / "var/state/boot").change([](suite::StepRecord record) {
    record.starts = 6;
    record.applied = suite::BootStep::last_good;
    return record;
  });
  EXPECT_EQ(problem, "");
  return settings;
}

/// @return whether @p work ended before @p calls system calls were made
template <class Work>
bool kill_after(int calls, Work work) {
  const pid_t pid = fork();
  if (pid == 0) {
    if (freopen("/dev/null", "w", stderr) == nullptr) _exit(3);
    ptrace(PTRACE_TRACEME, 0, nullptr, nullptr);
    raise(SIGSTOP);
    work();
    _exit(0);
  }
  int status = 0;
  waitpid(pid, &status, 0);
  for (int stop = 0; stop < 2 * calls; ++stop) {  // each call stops twice
    if (ptrace(PTRACE_SYSCALL, pid, nullptr, nullptr) != 0) break;
    waitpid(pid, &status, 0);
    if (WIFEXITED(status)) {
      EXPECT_EQ(WEXITSTATUS(status), 0);
      return true;
    }
  }
  testing_support::signal_child(pid, SIGKILL);
  waitpid(pid, &status, 0);
  return false;
}

/// Contents of all files below a folder that have this name, or that name with a number behind it.
std::vector<std::string> contents(const fs::path& folder, const std::string& name) {
  std::vector<std::string> found;
  if (!fs::exists(folder)) return found;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file() && entry.path().filename().string().starts_with(name))
      found.push_back(read_file(entry.path()).value_or(""));
  }
  return found;
}

/// Each file is in its place or aside, once.
void expect_all_aside(const fs::path& var, int calls) {
  for (const auto& [name, text] : own_files) {
    const bool stays = name.ends_with("incarnation") || name.ends_with("key_selection.0");
    EXPECT_EQ(fs::exists(var / name), stays) << name << ", call " << calls;
    const auto found =
        contents(stays ? var / "state" : var / "set_aside", fs::path(name).filename().string());
    EXPECT_EQ(found, std::vector{text}) << name << ", call " << calls;
  }
}

TEST(KilledStepDown, NothingIsLostAndNoCounterGoesBackWhereverItIsCut) {
  int calls = 1;
  for (bool ended = false; !ended; calls += calls < 16 ? 1 : 7) {
    ASSERT_LT(calls, 5000);
    const testing_support::TemporaryFolder folder;
    const auto settings = make_suite(folder.path());
    const fs::path var = settings.var;
    ended = kill_after(calls, [&] { Starter(settings).begin_start(); });
    ASSERT_EQ(LinkStore(var / "state/ttc").load(MonotonicTime()).associations.at(0).counter, counter)
        << "cut before call " << calls;

    Starter next(settings);
    next.begin_start();

    EXPECT_EQ(next.record().step, suite::BootStep::golden) << calls;
    EXPECT_EQ(next.record().applied, suite::BootStep::golden) << calls;
    EXPECT_EQ(LinkStore(var / "state/ttc").load(MonotonicTime()).associations.at(0).counter, counter)
        << calls;
    expect_all_aside(var, calls);
  }
  EXPECT_GT(calls, 100) << "it was cut in the middle, not only at the ends";
}

TEST(KilledStartOfTheSuite, TheOrderedStepIsRecordedOnlyBehindItsMeasures) {
  const RescueEnd order{.kind = RescueEnd::Kind::start_suite, .step = suite::BootStep::golden};
  int calls = 1;
  int in_the_middle = 0;
  for (bool ended = false; !ended; calls += 23) {
    ASSERT_LT(calls, 5000);
    const testing_support::TemporaryFolder folder;
    const auto settings = make_suite(folder.path());
    const fs::path var = settings.var;
    suite::StepStore store(var / "state/boot");
    ASSERT_EQ(store.change([](suite::StepRecord record) {
      record.step = suite::BootStep::rescue;
      return record;
    }),
              "");

    ended = kill_after(calls, [&] { Starter(settings).end_rescue(order); });
    if (store.read().step == suite::BootStep::rescue) {  // the ground sends it again
      in_the_middle += fs::exists(var / "set_aside") ? 1 : 0;
      Starter(settings).end_rescue(order);
    }

    EXPECT_EQ(store.read().step, suite::BootStep::golden) << calls;
    EXPECT_EQ(store.read().cause, suite::StepCause::commanded) << calls;
    expect_all_aside(var, calls);
  }
  EXPECT_GT(in_the_middle, 2);
}

/// As srfs_rescue does it: the counter of each frame is stored, then the frame is executed. The third one is
/// rescue.reset part=schedule.
void take_frames(const suite::RescueSettings& settings, int executed) {
  LinkStore store(fs::path(settings.var) / "state/ttc");
  LinkState link = store.load(MonotonicTime());
  const RecoveryFiles files(settings);
  for (int frame = 1; frame <= 6; ++frame) {
    ++link.generation;
    const std::uint64_t its_counter = ++link.associations.at(0).counter;
    if (!store.store(link)) _exit(4);
    if (write(executed, &its_counter, sizeof its_counter) != sizeof its_counter) _exit(5);
    if (frame == 3 && !files.set_aside(mission::RescuePart::schedule, 1, store)) _exit(6);
  }
}

TEST(KilledReset, NoFrameIsTakenTwiceWhereverTheScheduleIsCutOff) {
  int calls = 1;
  for (bool ended = false; !ended; calls += 11) {
    ASSERT_LT(calls, 5000);
    const testing_support::TemporaryFolder folder;
    const auto settings = make_suite(folder.path());
    const fs::path ttc = fs::path(settings.var) / "state/ttc";
    std::array<int, 2> executed{};
    ASSERT_EQ(pipe(executed.data()), 0);
    const Fd read_end(executed[0]);
    Fd write_end(executed[1]);
    ended = kill_after(calls, [&] { take_frames(settings, executed[1]); });
    write_end.reset();
    std::uint64_t last = counter;
    while (read(read_end.get(), &last, sizeof last) == sizeof last) {
    }

    // Whoever is on the line next: one that knows both places, and ttc without the journal that is aside.
    ASSERT_GE(LinkStore(ttc).load(MonotonicTime()).associations.at(0).counter, last) << "call " << calls;
    LinkStore next(ttc);
    LinkState link = next.load(MonotonicTime());
    ASSERT_TRUE(RecoveryFiles(settings).set_aside(mission::RescuePart::schedule, 2, next));
    ++link.generation;
    const std::uint64_t newest = ++link.associations.at(0).counter;
    ASSERT_TRUE(next.store(link));
    ASSERT_EQ(LinkStore(ttc).load(MonotonicTime()).associations.at(0).counter, newest) << "call " << calls;
  }
  EXPECT_GT(calls, 100) << "it was cut in the middle, not only at the ends";
}

}  // namespace
}  // namespace srfs::rescue
