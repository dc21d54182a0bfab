// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Recovery and reading of a packet store with arbitrary segments. Input: pieces (kind u8, length u16,
// octets), each a record of these octets, the raw octets, or the start of the next segment. Checks that
// recovery cuts only an incomplete tail, that later records are found, and that a second recovery gives the
// same result.

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "nodes/ttc/store/packet_store.hpp"

namespace {

using namespace srfs;

void require(bool condition) {
  if (!condition) std::abort();
}

/// A folder in memory if possible, because each input needs several synced files.
class Folder {
 public:
  Folder() {
    const char* const parent = ::access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp";
    std::string pattern = std::string(parent) + "/srfs_fuzz_store_XXXXXX";
    require(::mkdtemp(pattern.data()) != nullptr);
    path = pattern;
  }
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  std::filesystem::path path;
};

std::size_t all_packets(PacketStore& store) {
  std::size_t found = 0;
  RetrievalCursor cursor;
  constexpr RetrievalRange everything{TaiTime(), TaiTime(seconds(UINT32_MAX))};
  for (int i = 0; i < 1000; ++i) {
    RetrievedPackets read = store.read(everything, cursor, 4096);
    found += read.packets.size();
    if (read.finished) return found;
    cursor = read.next;
  }
  std::abort();  // the reading does not end
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
  static const Folder folder;
  std::filesystem::remove_all(folder.path);
  std::filesystem::create_directories(folder.path);
  OctetReader in({input, size});
  std::uint32_t sequence = 0;
  std::uint32_t segment = 0;
  std::size_t sound = 0;
  Octets content(16);
  const auto write_segment = [&] {
    std::array<char, 16> name{};
    std::snprintf(name.data(), name.size(), "%08x.seg", segment++);
    std::ofstream(folder.path / name.data(), std::ios::binary)
        .write(reinterpret_cast<const char*>(content.data()), static_cast<std::streamsize>(content.size()));
  };
  while (in.remaining() >= 3) {
    const std::uint8_t what = in.u8();
    const OctetView octets = in.bytes(std::min<std::size_t>(in.u16(), in.remaining()));
    if (what % 4 == 0 && segment < 4) {
      write_segment();
      content.assign(16, 0);
    } else if (what % 4 == 1) {
      content.insert(content.end(), octets.begin(), octets.end());
    } else if (!octets.empty() && octets.size() <= max_stored_packet_octets) {
      append_record(content, sequence++, {.tai = TaiTime(seconds(what)), .monotonic = {}}, octets);
      ++sound;
    }
  }
  write_segment();

  PacketStoreConfig config;
  config.folder = folder.path;
  config.segment_octets = 64U << 10;
  std::size_t found = 0;
  {
    PacketStore store(config);
    require(store.open().has_value());
    found = all_packets(store);
    require(found <= size && store.status().records <= found + sound);
    store.append({.tai = TaiTime(seconds(1000)), .monotonic = {}}, Octets{1, 2, 3});
    require(store.commit().has_value());
    require(all_packets(store) == found + 1);
  }
  PacketStore again(config);
  require(again.open().has_value());
  require(again.status().counters.cut_octets == 0);
  require(all_packets(again) == found + 1);
  return 0;
}
