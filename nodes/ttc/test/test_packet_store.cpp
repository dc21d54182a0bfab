// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/store/packet_store.hpp"

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "base/crc32c.hpp"
#include "tests/temporary_folder.hpp"
#include "wire/cuc.hpp"

namespace srfs {
namespace {

namespace fs = std::filesystem;

/// A disk of which the kernel reports an error once: what it could not write then, no later sync writes.
class FailingDisk final : public SegmentFiles {
 public:
  explicit FailingDisk(const fs::path& folder) : files_(folder) {}

  void fail_next_sync() { fails_ = true; }
  /// What is there after a power cut now.
  [[nodiscard]] const Octets& medium(std::uint32_t number) { return medium_[number]; }

  Result<std::vector<std::uint32_t>, SegmentError> list() override { return files_.list(); }
  Result<Octets, SegmentError> read(std::uint32_t number, std::size_t octets_max) override {
    return files_.read(number, octets_max);
  }
  bool exists(std::uint32_t number) override { return files_.exists(number); }
  Result<void, SegmentError> cut(std::uint32_t number, std::size_t octets) override {
    medium_[number].resize(octets);
    return files_.cut(number, octets);
  }
  Result<void, SegmentError> remove(std::uint32_t number) override { return files_.remove(number); }
  Result<void, SegmentError> create(std::uint32_t number, OctetView header) override {
    open_ = number;
    written_ = {{0, {header.begin(), header.end()}}};
    return files_.create(number, header);
  }
  Result<void, SegmentError> open(std::uint32_t number) override {
    open_ = number;
    return files_.open(number);
  }
  [[nodiscard]] bool is_open() const override { return files_.is_open(); }
  Result<void, SegmentError> check_open() override { return files_.check_open(); }
  Result<void, SegmentError> write(std::size_t offset, OctetView octets) override {
    written_.push_back({offset, {octets.begin(), octets.end()}});
    return files_.write(offset, octets);
  }
  Result<void, SegmentError> sync() override {
    const auto written = std::exchange(written_, {});
    if (std::exchange(fails_, false)) return Err(SegmentError{"input/output error"});
    for (const auto& [offset, octets] : written) {
      Octets& medium = medium_[open_];
      medium.resize(std::max(medium.size(), offset + octets.size()));
      std::copy(octets.begin(), octets.end(), medium.begin() + static_cast<std::ptrdiff_t>(offset));
    }
    return files_.sync();
  }
  void close() override { files_.close(); }

 private:
  struct Write {
    std::size_t offset;
    Octets octets;
  };
  PosixSegmentFiles files_;
  std::map<std::uint32_t, Octets> medium_;
  std::vector<Write> written_;
  std::uint32_t open_ = 0;
  bool fails_ = false;
};

class PacketStoreOnDisk : public testing::Test {
 protected:
  [[nodiscard]] PacketStoreConfig config() const {
    return {.folder = folder_ / "store",
            .quota_octets = 64U << 20,
            .segment_octets = 4096,
            .pending_octets = 3000};
  }
  static Octets packet(int second) {
    Octets octets(50, 0xAA);
    octets[0] = static_cast<std::uint8_t>(second >> 8);
    octets[1] = static_cast<std::uint8_t>(second);
    return octets;
  }
  static RecordStamp at(int second) {
    return {.tai = TaiTime(seconds(second)),
            .time_valid = true,
            .boot_id = 3,
            .monotonic = MonotonicTime(seconds(second))};
  }
  /// Records one packet per second and commits after every ten.
  static void fill(PacketStore& store, int first, int last) {
    for (int s = first; s <= last; ++s) {
      store.append(at(s), packet(s));
      if (s % 10 == 0 || s == last) {
        ASSERT_TRUE(store.commit());
      }
    }
  }
  static std::vector<Octets> read_all(PacketStore& store, int from, int to, std::size_t batch = 300) {
    std::vector<Octets> all;
    RetrievalCursor cursor;
    const RetrievalRange range{.from = TaiTime(seconds(from)), .to = TaiTime(seconds(to))};
    while (true) {
      auto got = store.read(range, cursor, batch);
      all.insert(all.end(), got.packets.begin(), got.packets.end());
      if (got.finished) return all;
      cursor = got.next;
    }
  }
  [[nodiscard]] std::vector<fs::path> segments() const {
    std::vector<fs::path> found;
    for (const auto& entry : fs::directory_iterator(folder_ / "store")) found.push_back(entry.path());
    std::sort(found.begin(), found.end());
    return found;
  }
  static void flip(const fs::path& file, std::streamoff offset) {
    std::fstream f(file, std::ios::in | std::ios::out | std::ios::binary);
    f.seekg(offset);
    const char octet = static_cast<char>(f.get() ^ 0x10);
    f.seekp(offset);
    f.put(octet);
  }
  const testing_support::TemporaryFolder temporary_;
  const fs::path folder_ = temporary_.path();
};

TEST(Crc32c, GivesTheValueOfRfc3720) {
  const std::string digits = "123456789";
  const OctetView view(reinterpret_cast<const std::uint8_t*>(digits.data()), digits.size());
  EXPECT_EQ(crc32c(view), 0xE3069283U);
  EXPECT_EQ(crc32c(view.subspan(4), crc32c(view.first(4))), 0xE3069283U);
}

TEST(StoreRecord, ComesBackWithItsStamp) {
  Octets log;
  const RecordStamp stamp{.tai = TaiTime(seconds(2'000'000'000) + milliseconds(500)),
                          .time_valid = true,
                          .boot_id = 7,
                          .monotonic = MonotonicTime(milliseconds(12'340))};
  append_record(log, 42, stamp, Octets{1, 2, 3});

  const auto record = decode_record(log);

  ASSERT_TRUE(record);
  EXPECT_EQ(log.size(), 3 + record_overhead_octets);
  EXPECT_EQ(record->sequence, 42U);
  EXPECT_EQ(record->stamp.tai, stamp.tai);
  EXPECT_TRUE(record->stamp.time_valid);
  EXPECT_EQ(record->stamp.boot_id, 7);
  EXPECT_EQ(record->stamp.monotonic, stamp.monotonic);
  EXPECT_EQ(Octets(record->packet.begin(), record->packet.end()), (Octets{1, 2, 3}));
}

TEST_F(PacketStoreOnDisk, GivesBackThePacketsOfAPeriodUnchangedAndInOrder) {
  PacketStore store(config());
  ASSERT_TRUE(store.open());
  fill(store, 1, 300);

  const auto got = read_all(store, 100, 199);

  ASSERT_EQ(got.size(), 100U);
  for (int s = 100; s < 200; ++s) EXPECT_EQ(got[static_cast<std::size_t>(s - 100)], packet(s));
}

TEST_F(PacketStoreOnDisk, APeriodThatBeginsAtThePacketsOwnTimeHasThePacket) {
  PacketStore store(config());
  ASSERT_TRUE(store.open());
  std::mt19937_64 random(1);
  for (int i = 0; i < 500; ++i) {
    RecordStamp stamp = at(50 + i);
    // Also next to a limit of what the record keeps, where the packet's time is rounded up.
    stamp.tai = stamp.tai + nanoseconds(i % 2 == 0 ? (random() % 65'536) * 1'000'000'000 / 65'536
                                                   : random() % 1'000'000'000);
    const TaiTime told = *wire::decode_cuc(wire::encode_cuc(stamp.tai));
    store.append(stamp, packet(i));
    EXPECT_EQ(store.read({.from = told, .to = told}, {}, 1000).packets.size(), 1U) << told.ns();
    if (i % 10 == 9) {
      ASSERT_TRUE(store.commit());
      EXPECT_EQ(store.read({.from = told, .to = told}, {}, 1000).packets.size(), 1U) << told.ns();
    }
  }
}

TEST_F(PacketStoreOnDisk, KeepsEverythingAcrossARestartAndGoesOnNumbering) {
  {
    PacketStore store(config());
    ASSERT_TRUE(store.open());
    fill(store, 1, 120);
  }
  PacketStore store(config());
  ASSERT_TRUE(store.open());
  EXPECT_EQ(store.next_sequence(), 120U);
  EXPECT_EQ(store.status().records, 120U);
  EXPECT_EQ(store.status().counters.damaged, 0U);
  fill(store, 121, 130);
  EXPECT_EQ(read_all(store, 0, 1000).size(), 130U);
}

TEST_F(PacketStoreOnDisk, CutsOnlyTheIncompleteTailOfTheLastSegment) {
  {
    PacketStore store(config());
    ASSERT_TRUE(store.open());
    fill(store, 1, 120);
  }
  const fs::path last = segments().back();
  fs::resize_file(last, fs::file_size(last) - 5);

  PacketStore store(config());
  ASSERT_TRUE(store.open());

  EXPECT_EQ(store.status().records, 119U);
  EXPECT_EQ(store.status().counters.cut_octets, 50 + record_overhead_octets - 5);
  fill(store, 120, 125);
  EXPECT_EQ(read_all(store, 0, 1000).size(), 125U);
}

TEST_F(PacketStoreOnDisk, SkipsAFlippedBitInTheMiddleAndLosesNothingElse) {
  {
    PacketStore store(config());
    ASSERT_TRUE(store.open());
    fill(store, 1, 120);
  }
  flip(segments().front(), 16 + 10 * 74 + 40);  // inside a packet
  flip(segments().front(),
       16 + 20 * 74 + 2);  // in a length field: the record seems to overlap the next ones

  PacketStore store(config());
  ASSERT_TRUE(store.open());

  EXPECT_EQ(store.status().records, 118U);
  EXPECT_EQ(store.status().counters.damaged, 2U);
  EXPECT_EQ(store.status().counters.cut_octets, 0U);
  EXPECT_EQ(read_all(store, 0, 1000).size(), 118U);
}

TEST_F(PacketStoreOnDisk, DropsTheOldestSegmentToKeepItsQuota) {
  PacketStoreConfig small = config();
  small.quota_octets = std::size_t{5} * 4096;
  PacketStore store(small);
  ASSERT_TRUE(store.open());

  fill(store, 1, 1000);

  EXPECT_LE(store.status().octets, small.quota_octets);
  const auto got = read_all(store, 0, 2000);
  EXPECT_EQ(got.size() + store.status().counters.overwritten, 1000U);
  EXPECT_EQ(got.back(), packet(1000));
}

TEST_F(PacketStoreOnDisk, AnEmptyPeriodIsFinishedAtOnce) {
  PacketStore store(config());
  ASSERT_TRUE(store.open());
  fill(store, 1, 20);

  const auto got = store.read({.from = TaiTime(seconds(500)), .to = TaiTime(seconds(600))}, {}, 1000);

  EXPECT_TRUE(got.finished);
  EXPECT_TRUE(got.packets.empty());
}

TEST_F(PacketStoreOnDisk, ABoundedStoreStopsWhenItIsFullAndKeepsWhatItHas) {
  PacketStoreConfig small = config();
  small.quota_octets = 8192;
  PacketStore store(small);
  ASSERT_TRUE(store.open());
  store.set_bounded(true);
  fill(store, 0, 299);
  const PacketStoreStatus full = store.status();
  EXPECT_TRUE(full.full);
  EXPECT_LE(full.octets, small.quota_octets);
  EXPECT_GT(full.octets, small.quota_octets - 100);
  EXPECT_EQ(full.counters.overwritten, 0U);
  EXPECT_EQ(full.records + full.counters.full, 300U);
  EXPECT_EQ(read_all(store, 0, 1000).front(), packet(0));

  store.set_bounded(false);
  fill(store, 300, 399);
  EXPECT_FALSE(store.status().full);
  EXPECT_GT(store.status().counters.overwritten, 0U);
  EXPECT_EQ(read_all(store, 0, 1000).back(), packet(399));
}

TEST_F(PacketStoreOnDisk, ReadsOnlyRecordsBehindASequence) {
  PacketStore store(config());
  ASSERT_TRUE(store.open());
  fill(store, 0, 199);
  RetrievalCursor cursor{.begin_sequence = 150};
  const RetrievalRange all{.from = TaiTime(seconds(0)), .to = TaiTime(seconds(1000))};
  std::vector<Octets> got;
  while (true) {
    RetrievedPackets batch = store.read(all, cursor, 500);
    got.insert(got.end(), batch.packets.begin(), batch.packets.end());
    EXPECT_EQ(batch.next_sequence, 150 + got.size());
    EXPECT_EQ(batch.next.end_sequence, 200U);
    if (batch.finished) break;
    cursor = batch.next;
  }
  ASSERT_EQ(got.size(), 50U);
  EXPECT_EQ(got.front(), packet(150));
}

TEST_F(PacketStoreOnDisk, ARetrievalEndsThoughPacketsKeepComing) {
  PacketStore store(config());
  ASSERT_TRUE(store.open());
  fill(store, 1, 40);
  const RetrievalRange range{.from = TaiTime(seconds(0)), .to = TaiTime(seconds(100'000))};
  std::size_t packets = 0;
  RetrievalCursor cursor;
  int next = 41;

  for (int batches = 0; batches < 100; ++batches) {
    const auto got = store.read(range, cursor, 100);
    packets += got.packets.size();
    if (got.finished) break;
    cursor = got.next;
    fill(store, next, next + 9);
    next += 10;
  }

  EXPECT_EQ(packets, 40U);
}

TEST_F(PacketStoreOnDisk, OneUnreadableSegmentCostsOnlyItself) {
  {
    PacketStore store(config());
    ASSERT_TRUE(store.open());
    fill(store, 1, 120);
  }
  const fs::path last = segments().back();
  fs::remove(last);
  fs::create_directory(last);  // unreadable for every user

  PacketStore store(config());
  ASSERT_TRUE(store.open());
  fill(store, 121, 130);

  EXPECT_EQ(store.status().counters.unreadable, 1U);
  EXPECT_GT(segments().back(), last) << "its number stays taken";
  const auto got = store.read({.from = TaiTime(seconds(0)), .to = TaiTime(seconds(1000))}, {}, 1U << 20);
  EXPECT_TRUE(got.finished);
  EXPECT_TRUE(got.damaged);
  EXPECT_EQ(got.packets.back(), packet(130));
  EXPECT_GT(got.packets.size(), 50U);
}

TEST_F(PacketStoreOnDisk, AFolderRemovedAtRunTimeIsMadeAgain) {
  PacketStore store(config());
  ASSERT_TRUE(store.open());
  fill(store, 1, 20);
  fs::remove_all(folder_ / "store");

  store.append(at(21), packet(21));
  EXPECT_FALSE(store.commit());
  EXPECT_TRUE(store.commit());

  EXPECT_EQ(read_all(store, 0, 1000), std::vector<Octets>{packet(21)});
}

TEST_F(PacketStoreOnDisk, AMissingDiskIsCountedAndTakenUpAgainWhenItIsBack) {
  { std::ofstream(folder_ / "store") << "a file where the folder should be"; }
  PacketStore store(config());
  EXPECT_FALSE(store.open());
  store.append(at(1), packet(1));
  EXPECT_FALSE(store.commit());
  EXPECT_TRUE(store.status().failing);

  fs::remove(folder_ / "store");

  EXPECT_TRUE(store.commit());
  EXPECT_FALSE(store.status().failing);
  EXPECT_EQ(read_all(store, 0, 10).size(), 1U);
}

TEST_F(PacketStoreOnDisk, AFullDiskLosesTheNewestPacketsAndLeavesNoHalfRecord) {
  PacketStore store(config());
  ASSERT_TRUE(store.open());
  fill(store, 1, 20);
  // A file size limit simulates a full disk: writes past it fail with EFBIG.
  rlimit old{};
  getrlimit(RLIMIT_FSIZE, &old);
  const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit tight{.rlim_cur = 16 + 20 * 74 + 30, .rlim_max = old.rlim_max};
  setrlimit(RLIMIT_FSIZE, &tight);
  for (int s = 21; s <= 100; ++s) store.append(at(s), packet(s));
  const auto failed = store.commit();
  setrlimit(RLIMIT_FSIZE, &old);
  std::signal(SIGXFSZ, old_handler);

  EXPECT_FALSE(failed);
  EXPECT_EQ(store.status().counters.write_failures, 1U);
  EXPECT_EQ(store.status().counters.refused, 40U);  // 40 of 80 fit into the pending octets
  EXPECT_EQ(fs::file_size(segments().front()), 16U + 20 * 74);
  EXPECT_TRUE(store.commit());
  EXPECT_EQ(read_all(store, 0, 1000).size(), 60U);
}

TEST_F(PacketStoreOnDisk, WhatASyncCouldNotWriteIsWrittenAgain) {
  auto files = std::make_unique<FailingDisk>(folder_ / "store");
  FailingDisk& disk = *files;
  PacketStore store(config(), std::move(files));
  ASSERT_TRUE(store.open());
  disk.fail_next_sync();  // the first, so that the segment's header is in it
  store.append(at(1), packet(1));
  EXPECT_FALSE(store.commit());
  EXPECT_EQ(store.status().counters.stored, 0U);
  EXPECT_EQ(read_all(store, 0, 10), std::vector<Octets>{packet(1)}) << "it is not lost to who asks";
  EXPECT_TRUE(store.commit());
  for (int s = 2; s <= 60; ++s) {  // over the end of a segment of 4096 octets
    store.append(at(s), packet(s));
    if (s % 7 == 0) disk.fail_next_sync();
    if (s % 5 == 0) read_all(store, s, s);  // writes without a sync
    if (s % 3 == 0) static_cast<void>(store.commit());
  }
  ASSERT_TRUE(store.commit());

  EXPECT_EQ(store.status().counters.stored, 60U);
  const auto all = read_all(store, 0, 100);
  EXPECT_EQ(all.size(), 60U) << "each is there once";
  for (std::uint32_t number = 0; number < store.status().segments; ++number) {
    const auto seen = PosixSegmentFiles(folder_ / "store").read(number, 1U << 20);
    ASSERT_TRUE(seen);
    EXPECT_EQ(disk.medium(number), *seen) << "segment " << number;
  }
}

TEST_F(PacketStoreOnDisk, AVanishedSegmentCostsNothingOfAnotherThatIsNotSyncedYet) {
  auto files = std::make_unique<FailingDisk>(folder_ / "store");
  FailingDisk& disk = *files;
  PacketStore store(config(), std::move(files));
  ASSERT_TRUE(store.open());
  fill(store, 1, 60);
  ASSERT_EQ(segments().size(), 2U);
  store.append(at(61), packet(61));
  read_all(store, 61, 61);  // written without a sync
  fs::remove(segments().front());
  read_all(store, 0, 10);  // sees it
  disk.fail_next_sync();
  EXPECT_FALSE(store.commit());
  EXPECT_TRUE(store.commit());

  EXPECT_EQ(read_all(store, 61, 61), std::vector<Octets>{packet(61)});
  const auto seen = PosixSegmentFiles(folder_ / "store").read(1, 1U << 20);
  ASSERT_TRUE(seen);
  EXPECT_EQ(disk.medium(1), *seen);
}

}  // namespace
}  // namespace srfs
