// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <fstream>
#include <iterator>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <unistd.h>

#include "nodes/ttc/link/packet_maker.hpp"
#include "nodes/ttc/store/packet_store.hpp"
#include "tests/bench/link_measures.hpp"

namespace srfs::bench {
namespace {

namespace fs = std::filesystem;

constexpr nanoseconds between_packets = milliseconds(100);
constexpr std::uint64_t packets_a_commit = 10;
constexpr std::size_t read_octets = 256U << 10;

void require(bool held, const std::string& what) {
  if (!held) throw std::runtime_error(what);
}

std::vector<fs::path> segments_of(const fs::path& folder) {
  std::vector<fs::path> paths;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == ".seg") paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

void flip_bit(const fs::path& file, std::size_t offset) {
  std::fstream stream(file, std::ios::in | std::ios::out | std::ios::binary);
  stream.seekg(static_cast<std::streamoff>(offset));
  const auto octet = static_cast<char>(stream.get() ^ 0x10);
  stream.seekp(static_cast<std::streamoff>(offset));
  stream.put(octet);
  stream.flush();
  require(stream.good(), "cannot damage " + file.string());
}

std::uint64_t packets_in(PacketStore& store) {
  const RetrievalRange all{TaiTime(), TaiTime(nanoseconds(INT64_MAX))};
  RetrievalCursor cursor;
  std::uint64_t packets = 0;
  for (bool finished = false; !finished;) {
    RetrievedPackets batch = store.read(all, cursor, read_octets);
    packets += batch.packets.size();
    cursor = batch.next;
    finished = batch.finished;
  }
  return packets;
}

class Folder {
 public:
  explicit Folder(fs::path path) : path_(std::move(path)) { fs::create_directories(path_); }
  ~Folder() {
    std::error_code ec;
    fs::remove_all(path_, ec);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

}  // namespace

Json measure_store(const StoreOptions& options) {
  const Folder folder(options.folder / ("bench_store_" + std::to_string(getpid())));
  const PacketStoreConfig config{.folder = folder.path(), .quota_octets = 2 * options.octets};
  std::mt19937_64 random(options.seed);
  Octets packet(options.packet_octets);
  for (std::uint8_t& octet : packet) octet = static_cast<std::uint8_t>(random());

  const std::uint64_t packets = options.octets / (packet.size() + record_overhead_octets);
  std::uint64_t written = 0;
  std::vector<double> commit_ms;
  {
    PacketStore store(config);
    require(store.open().has_value(), "cannot open the store");
    TaiTime tai(seconds(2'000'000'000));
    for (std::uint64_t i = 0; i < packets; ++i) {
      tai += between_packets;
      store.append({.tai = tai, .time_valid = true, .boot_id = 1, .monotonic = MonotonicTime()}, packet);
      if (i % packets_a_commit != packets_a_commit - 1 && i + 1 != packets) continue;
      const MonotonicTime begin = monotonic_now();
      require(store.commit().has_value(), "cannot write the store");
      commit_ms.push_back(static_cast<double>((monotonic_now() - begin).count()) * 1e-6);
    }
    written = store.status().counters.written_octets;
  }

  const std::vector<fs::path> segments = segments_of(folder.path());
  require(segments.size() > 2, "the store is too small");
  std::vector<double> clean_ms;
  std::vector<double> damaged_ms;
  const auto recover = [&](std::vector<double>& times) {
    PacketStore store(config);
    const MonotonicTime begin = monotonic_now();
    const bool opened = store.open().has_value();
    times.push_back(static_cast<double>((monotonic_now() - begin).count()) * 1e-6);
    require(opened, "cannot open the store again");
    return packets_in(store);
  };
  for (int round = 0; round < options.rounds; ++round)
    require(recover(clean_ms) == packets, "a whole store lost packets");

  std::uint64_t lost = 0;
  for (int round = 0; round < options.rounds; ++round) {
    // Flip one bit before the last segment and tear off the end of the last record. Each costs one record, in
    // addition to the losses of earlier rounds.
    const fs::path& victim = segments[static_cast<std::size_t>(random() % (segments.size() - 1))];
    flip_bit(victim, static_cast<std::size_t>(random() % fs::file_size(victim)));
    fs::resize_file(segments.back(), fs::file_size(segments.back()) - 7);
    const std::uint64_t left = recover(damaged_ms);
    lost = packets - left;
    require(lost <= 2 * (static_cast<std::uint64_t>(round) + 1),
            "more lost than what was damaged: " + std::to_string(lost));
  }
  return {{"octets", written},
          {"packets", packets},
          {"packet_octets", packet.size()},
          {"overhead_octets_a_record",
           static_cast<double>(written) / static_cast<double>(packets) - static_cast<double>(packet.size())},
          {"commit_ms", summary(commit_ms)},
          {"recovery_ms", summary(clean_ms)},
          {"recovery_damaged_ms", summary(damaged_ms)},
          {"damages", 2 * options.rounds},
          {"records_lost", lost}};
}

Json fill_store(const FillOptions& options) {
  constexpr std::uint16_t apid = 1;
  constexpr std::uint8_t service = 3;
  constexpr std::uint8_t subtype = 25;
  constexpr std::size_t header_octets = 6 + 15;  // packet and secondary header
  constexpr std::size_t crc_octets = 2;
  constexpr UtcTime begin(seconds(1'767'225'600));  // 2026-01-01T00:00:00Z
  require(options.packet_octets > header_octets + crc_octets, "a packet is longer than that");
  fs::create_directories(options.folder);
  require(segments_of(options.folder).empty(), options.folder.string() + " has segments");
  PacketStore store({.folder = options.folder});
  require(store.open().has_value(), "cannot open the store");
  PacketMaker maker;
  // An unknown structure, which the ground shows as octets.
  const Report report{.apid = apid,
                      .service = service,
                      .subtype = subtype,
                      .data = Octets(options.packet_octets - header_octets - crc_octets, 0xFF)};
  TaiTime tai = to_tai(begin);
  for (std::uint64_t i = 0; i < options.packets; ++i) {
    const Octets packet = maker.make(report, tai, TimeReference::locked);
    require(packet.size() == options.packet_octets, "a packet of another length");
    store.append({.tai = tai, .time_valid = true, .boot_id = 1, .monotonic = MonotonicTime()}, packet);
    tai += between_packets;
    if (i % 1000 == 999) require(store.commit().has_value(), "cannot write the store");
  }
  require(store.commit().has_value(), "cannot write the store");
  return {{"packets", options.packets}, {"packet_octets", options.packet_octets}};
}

}  // namespace srfs::bench
