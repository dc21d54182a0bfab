// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <cstdlib>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/file.hpp"
#include "suite/ring/fault_ledger.hpp"

namespace srfs::suite {
namespace {

FaultRecord record(const std::string& subject) {
  FaultRecord r;
  r.utc = UtcTime(seconds(1'800'000'000) + microseconds(250));
  r.monotonic = MonotonicTime(nanoseconds(12'345'678));
  r.boot = "c0ffee";
  r.observer = "timing";
  r.subject = subject;
  r.fault = FaultClass::silent;
  r.misses = 3;
  r.detail = "work thread stands for 0.4 s";
  r.cause = "SIGABRT by the observer";
  r.kernel_state = 'R';
  r.old_incarnation = 4;
  r.new_incarnation = 5;
  r.outcome = RestartOutcome::What::restarted;
  r.version = 2;
  r.failed_version = 3;
  r.last_turn_age = milliseconds(400);
  r.judged = milliseconds(300);
  r.killed = milliseconds(20);
  r.started = milliseconds(30);
  return r;
}

class FaultLedgerTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (std::filesystem::temp_directory_path() / "srfs_ledger_XXXXXX").string();
    var_.root = mkdtemp(pattern.data());
  }
  ~FaultLedgerTest() override {
    std::filesystem::remove_all(var_.memory());
    std::filesystem::remove_all(var_.root);
  }
  void add(const std::string& subject) {
    const auto sequence = ledger().append(record(subject));
    ASSERT_TRUE(sequence) << sequence.error();
  }
  [[nodiscard]] FaultLedger ledger() const { return FaultLedger(var_); }
  [[nodiscard]] std::vector<std::uint64_t> sequences() const {
    std::vector<std::uint64_t> all;
    for (const FaultRecord& r : ledger().read().records) all.push_back(r.sequence);
    return all;
  }

  VarPaths var_;
};

TEST(FaultRecordText, IsReadBackAsItWas) {
  FaultRecord original = record("payload_eps");
  original.sequence = 77;
  EXPECT_EQ(decode_fault(encode(original)), original);
  original.kind = FaultRecord::Kind::active;
  original.active = milliseconds(150);
  original.killed.reset();
  EXPECT_EQ(decode_fault(encode(original)), original);
}

TEST(FaultRecordText, NoticesEveryChangedOctet) {
  const std::string line = encode(record("ttc"));
  for (std::size_t i = 0; i < line.size(); ++i) {
    std::string damaged = line;
    damaged[i] = static_cast<char>(damaged[i] ^ 2);
    EXPECT_FALSE(decode_fault(damaged)) << i;
    EXPECT_FALSE(decode_fault(line.substr(0, i))) << i;
  }
}

TEST(FaultRecordText, HasALongestLineWhateverTheTextsHold) {
  FaultRecord r = record(std::string(5000, '"'));
  r.detail = std::string(5000, '\x01');
  r.cause = std::string(5000, '\\');
  r.reason = "\xff\xfe\n\t" + std::string(5000, '"');
  r.observer = r.boot = std::string(5000, '\\');
  const std::string line = encode(r);
  EXPECT_LT(line.size(), FaultLedger::longest_line);
  EXPECT_EQ(line.find('\n'), std::string::npos);
  EXPECT_TRUE(decode_fault(line));
}

TEST_F(FaultLedgerTest, NumbersItsLinesAcrossWritersAndFiles) {
  for (int i = 0; i < 3; ++i) add("a");
  EXPECT_THAT(sequences(), testing::ElementsAre(1, 2, 3));
}

TEST_F(FaultLedgerTest, SkipsATornTailAndDamagedLinesAndGoesOn) {
  add("a");
  add("b");
  add("c");
  const auto file = ledger().file();
  std::string text = *read_file(file);
  text[text.find('\n') + 20] ^= 1;  // in the second line
  text.resize(text.size() - 10);    // in the third line
  std::ofstream(file, std::ios::trunc) << text;
  add("d");
  const auto content = ledger().read();
  EXPECT_EQ(content.damaged, 2U);
  ASSERT_EQ(content.records.size(), 2U);
  EXPECT_EQ(content.records[0].subject, "a");
  EXPECT_EQ(content.records[1].subject, "d");
  EXPECT_EQ(content.records[1].sequence, 2U) << "after the last line that can be read";
}

TEST_F(FaultLedgerTest, IsBoundedAndKeepsTheNewest) {
  FaultRecord longest = record("a");
  longest.sequence = 9999;
  const std::size_t line = encode(longest).size() + 1;
  const std::size_t enough = 3 * FaultLedger::largest_file / line;
  // Write the files directly, because each append would wait for the medium.
  std::filesystem::create_directories(ledger().file().parent_path());
  std::uint64_t sequence = 0;
  for (int file = 0; file < 2; ++file) {
    std::ofstream out(ledger().file(), std::ios::trunc);
    for (std::size_t i = 0; i < enough / 3 - 1; ++i) {
      FaultRecord r = record("a");
      r.sequence = ++sequence;
      out << encode(r) << "\n";
    }
    out.close();
    for (int i = 0; i < 12; ++i) {
      add("b");
      ++sequence;
    }
  }
  const auto base = ledger().file();
  EXPECT_LE(std::filesystem::file_size(base), FaultLedger::largest_file);
  EXPECT_LE(std::filesystem::file_size(base.string() + ".1"), FaultLedger::largest_file);
  const auto content = ledger().read();
  EXPECT_EQ(content.damaged, 0U);
  EXPECT_EQ(content.records.back().sequence, sequence);
  for (std::size_t i = 1; i < content.records.size(); ++i)
    EXPECT_EQ(content.records[i].sequence, content.records[i - 1].sequence + 1);
}

TEST_F(FaultLedgerTest, TakesLinesOfManyProcessesAtOnce) {
  constexpr int writers = 4;
  constexpr int lines = 10;
  std::vector<pid_t> children;
  for (int w = 0; w < writers; ++w) {
    children.push_back(fork());
    if (children.back() == 0) {
      int written = 0;
      for (int i = 0; i < lines; ++i) written += ledger().append(record("w" + std::to_string(w))) ? 1 : 0;
      _exit(written == lines ? 0 : 1);
    }
  }
  for (const pid_t child : children) {
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_EQ(status, 0);
  }
  const auto content = ledger().read();
  EXPECT_EQ(content.damaged, 0U);
  EXPECT_EQ(content.records.size(), static_cast<std::size_t>(writers * lines));
}

TEST_F(FaultLedgerTest, SaysWhyALineIsNotWritten) {
  std::ofstream(var_.root / "state") << "a file where a folder should be";
  const auto sequence = ledger().append(record("a"));
  ASSERT_FALSE(sequence);
  EXPECT_THAT(sequence.error(), testing::HasSubstr("faults.log"));
}

}  // namespace
}  // namespace srfs::suite
