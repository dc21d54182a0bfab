// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <future>
#include <random>
#include <thread>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include "base/file.hpp"
#include "suite/step_down.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::suite {
namespace {

const StepPolicy policy;  // 3, 6, 9

wire::BootRecord boot_before(std::uint32_t count, bool healthy) {
  wire::BootRecord record;
  record.count = count;
  record.healthy = healthy;
  return record;
}

/// Starts that never become healthy, their measures taken.
StepRecord after_starts(std::uint32_t starts, StepRecord record = {}) {
  for (std::uint32_t i = 0; i < starts; ++i) {
    record = on_start(std::move(record), boot_before(i, false), policy);
    while (const auto step = next_measures(record, policy)) record = on_measures_taken(record, *step);
  }
  return record;
}

TEST(StepDown, TheThirdTheSixthAndTheNinthUnhealthyStartStepDown) {
  EXPECT_EQ(after_starts(3).step, BootStep::normal) << "two were unhealthy, the third is being made";
  EXPECT_EQ(after_starts(4).step, BootStep::last_good);
  EXPECT_EQ(after_starts(6).step, BootStep::last_good);
  EXPECT_EQ(after_starts(7).step, BootStep::golden);
  EXPECT_EQ(after_starts(10).step, BootStep::rescue);
  EXPECT_EQ(after_starts(10).cause, StepCause::unhealthy_starts);
}

TEST(StepDown, MeasuresAreTakenOnceInARowTheShallowOnesFirst) {
  StepRecord record = after_starts(6);
  record = on_start(record, std::nullopt, policy);

  ASSERT_EQ(next_measures(record, policy), BootStep::golden);
  EXPECT_EQ(next_measures(on_measures_taken(record, BootStep::golden), policy), std::nullopt);

  StepRecord cut = on_start(StepRecord{.starts = 6}, std::nullopt, policy);
  EXPECT_EQ(next_measures(cut, policy), BootStep::last_good) << "those of an earlier start were cut off";
  EXPECT_EQ(next_measures(on_measures_taken(cut, BootStep::last_good), policy), BootStep::golden);
}

TEST(StepDown, AHealthyBootEndsTheRowAndKeepsTheStep) {
  const StepRecord down = after_starts(7);

  const StepRecord next = on_start(down, boot_before(40, true), policy);

  EXPECT_EQ(next.step, BootStep::golden);
  EXPECT_EQ(next.starts, 1U);
  EXPECT_EQ(next_measures(next, policy), std::nullopt) << "nothing is set aside again by a plain start";
}

TEST(StepDown, TheRecordOfOneHealthyBootCountsOnce) {
  StepRecord record = on_start({}, boot_before(7, true), policy);
  for (int i = 0; i < 3; ++i) record = on_start(record, boot_before(7, true), policy);

  EXPECT_EQ(record.step, BootStep::last_good) << "the suite wrote no record since boot 7";
}

TEST(StepDown, OneStepUpAfterTheCalmTimeAndAllByCommand) {
  const StepRecord down = after_starts(7);

  EXPECT_EQ(on_calm(down).step, BootStep::last_good);
  EXPECT_EQ(on_calm(on_calm(down)).step, BootStep::normal);
  EXPECT_EQ(on_calm(on_calm(down)).cause, StepCause::calm);
  EXPECT_EQ(on_commanded(down, BootStep::normal).step, BootStep::normal);
  EXPECT_EQ(on_commanded(down, BootStep::rescue).step, BootStep::golden) << "rescue is no step to start in";
  EXPECT_FALSE(on_commanded(down, BootStep::normal).reported);
}

TEST(StepDown, WithoutContactTheSuiteGetsOneTryAtATime) {
  StepRecord record = after_starts(10);
  for (int day = 0; day < 100; ++day) {
    ASSERT_EQ(record.step, BootStep::rescue);
    record = on_start(on_no_contact(record, policy), boot_before(3, false), policy);
    ASSERT_EQ(record.step, BootStep::golden) << "one try";
    ASSERT_EQ(next_measures(record, policy), std::nullopt) << "what was set aside is not set aside daily";
    record = on_start(record, boot_before(3, false), policy);
  }
}

TEST(StepDown, AnOrderIntoRescueOutlivesHealthRestartsAndAnOrderedEnd) {
  StepRecord record = on_order_into_rescue(on_start({}, boot_before(4, true), policy));
  EXPECT_FALSE(record.reported);

  record = on_calm(on_healthy(record));
  for (std::uint32_t boot = 4; boot < 30; ++boot) {
    record = on_start(record, boot_before(boot, boot < 8), policy);
    ASSERT_EQ(record.step, BootStep::rescue);
    ASSERT_EQ(record.cause, StepCause::commanded);
    ASSERT_EQ(next_measures(record, policy), std::nullopt) << "the suite was not tried";
  }
}

TEST(StepDown, OutOfAnOrderedRescueTheSuiteRunsAsItDidBefore) {
  const StepRecord in_rescue = on_start(on_order_into_rescue({}), boot_before(4, true), policy);

  for (const StepRecord& back :
       {on_commanded(in_rescue, BootStep::normal), on_no_contact(in_rescue, policy)}) {
    const StepRecord next = on_start(back, boot_before(5, false), policy);
    EXPECT_EQ(next.step, BootStep::normal);
    EXPECT_EQ(next.starts, 1U);
    EXPECT_EQ(next_measures(next, policy), std::nullopt);
  }
  EXPECT_EQ(on_no_contact(in_rescue, policy).cause, StepCause::no_contact);
}

TEST(StepDown, WhateverHappensRescueComesWithinTheBoundAndHealthAlwaysEndsTheRow) {
  std::mt19937 random(20261126);
  const auto one_of = [&](unsigned n) { return static_cast<std::uint32_t>(random() % n); };
  for (int run = 0; run < 2000; ++run) {
    StepPolicy own{.last_good = 1 + one_of(4)};
    own.golden = own.last_good + 1 + one_of(4);
    own.rescue = own.golden + 1 + one_of(4);
    ASSERT_TRUE(own.is_sound());
    StepRecord record{.step = static_cast<BootStep>(one_of(4)), .starts = one_of(20)};
    std::uint32_t count = 1;
    for (int i = 0; i < 30; ++i) {
      const StepRecord before = record;
      switch (one_of(6)) {
        case 0:
          record = on_healthy(record);
          ASSERT_EQ(record.starts, 0U);
          break;
        case 1:
          record = on_calm(record);
          ASSERT_LE(record.step, before.step);
          break;
        case 5:
          record = on_order_into_rescue(record);
          ASSERT_EQ(record.step, BootStep::rescue);
          break;
        case 2:
          record = on_commanded(record, static_cast<BootStep>(one_of(4)));
          ASSERT_NE(record.step, BootStep::rescue);
          break;
        default:
          record = on_start(record, boot_before(++count, one_of(4) == 0), own);
          ASSERT_GE(record.starts, 1U);
          ASSERT_GE(record.step, step_after(record.unhealthy_starts(), own));
      }
      ASSERT_EQ(decode_step_record(encode(record)), record);
    }
    for (std::uint32_t i = 0; i <= own.rescue; ++i) record = on_start(record, std::nullopt, own);
    ASSERT_EQ(record.step, BootStep::rescue);
  }
}

TEST(StepRecordText, NothingButWhatWasWrittenIsRead) {
  StepRecord record = after_starts(8);
  record.detail = "srfs up: exit code 3\nand a line  ";
  const std::string text = encode(record);
  const auto read = decode_step_record(text);
  ASSERT_TRUE(read);
  EXPECT_EQ(read->detail, "srfs up: exit code 3?and a line");

  for (std::size_t i = 0; i < text.size(); ++i) {
    for (unsigned bit = 0; bit < 8; ++bit) {
      std::string damaged = text;
      damaged[i] = static_cast<char>(damaged[i] ^ (1U << bit));
      EXPECT_FALSE(decode_step_record(damaged)) << "octet " << i << ", bit " << bit;
    }
    EXPECT_FALSE(decode_step_record(text.substr(0, i)));
  }
}

/// Not a TemporaryFolder itself, which is locked as long as it lives.
class BootFolder {
 public:
  BootFolder() { std::filesystem::create_directories(path()); }
  [[nodiscard]] std::filesystem::path path() const { return folder_.path() / "boot"; }

 private:
  testing_support::TemporaryFolder folder_;
};

TEST(StepStore, OneDamagedCopyCostsNothingAndTwoAreReported) {
  const BootFolder folder;
  StepStore store(folder.path());
  ASSERT_EQ(store.change([](StepRecord r) { return on_start(std::move(r), std::nullopt, policy); }), "");
  EXPECT_EQ(StepStore(folder.path()).read().starts, 1U);

  ASSERT_TRUE(write_file_atomically(folder.path() / "step_a", "rubbish"));
  EXPECT_EQ(StepStore(folder.path()).read().starts, 1U);

  ASSERT_TRUE(write_file_atomically(folder.path() / "step_b", "rubbish"));
  EXPECT_EQ(StepStore(folder.path()).read().cause, StepCause::record_damaged);
  EXPECT_EQ(StepStore(folder.path()).read().starts, 0U);
}

TEST(StepStore, AChangeWaitsForAnotherThatIsUnderWay) {
  const BootFolder folder;
  std::promise<void> began;
  std::thread other;
  const auto problem = StepStore(folder.path()).change([&](StepRecord r) {
    other = std::thread([&] {
      began.set_value();
      EXPECT_EQ(StepStore(folder.path()).change([](StepRecord o) {
        ++o.starts;
        return o;
      }),
                "");
    });
    began.get_future().wait();
    r.set_aside = 7;
    return r;
  });
  other.join();
  EXPECT_EQ(problem, "");
  EXPECT_EQ(StepStore(folder.path()).read().starts, 1U);
  EXPECT_EQ(StepStore(folder.path()).read().set_aside, 7U);
}

TEST(StepStore, OneThatHangsDoesNotKeepTheOthersFromAChange) {
  const BootFolder folder;
  const Fd hung(open(folder.path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  ASSERT_EQ(flock(hung.get(), LOCK_EX), 0);
  ASSERT_EQ(StepStore(folder.path()).change([](StepRecord r) { return on_order_into_rescue(std::move(r)); }),
            "");
  EXPECT_EQ(StepStore(folder.path()).read().step, BootStep::rescue);
}

TEST(StepStore, WhereNoFileCanBeMadeTheOlderCopyIsOverwritten) {
  const BootFolder folder;
  const auto one_more_start = [&] {
    return StepStore(folder.path()).change([](StepRecord r) {
      r.detail = "srfs up: exit code 3";
      return on_start(std::move(r), std::nullopt, policy);
    });
  };
  ASSERT_EQ(one_more_start(), "");
  const std::string first = read_file(folder.path() / "step_b").value_or("");
  // What stands in the place of the temporary files, as a full disk does.
  for (const char* copy : {"step_a", "step_b"})
    std::filesystem::create_directories(folder.path() /
                                        (std::string(copy) + "." + std::to_string(getpid()) + ".tmp") / "x");

  ASSERT_EQ(one_more_start(), "");
  EXPECT_EQ(StepStore(folder.path()).read().starts, 2U);
  EXPECT_EQ(read_file(folder.path() / "step_b").value_or(""), first) << "the other copy stays whole";

  ASSERT_EQ(one_more_start(), "");
  EXPECT_EQ(StepStore(folder.path()).read().starts, 3U);
  EXPECT_NE(read_file(folder.path() / "step_b").value_or(""), first) << "now it is the older one";
}

}  // namespace
}  // namespace srfs::suite
