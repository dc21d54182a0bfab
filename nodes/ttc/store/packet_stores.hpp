// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "msgs/mission/dictionary.hpp"
#include "nodes/ttc/store/packet_store.hpp"

namespace srfs {

/// One packet to be stored.
struct StoreItem {
  std::uint16_t store = 0;
  RecordStamp stamp;
  Octets packet;
};

/// How the stores stand, for housekeeping and beacon.
struct PacketStoresStatus {
  std::vector<std::pair<std::uint16_t, PacketStoreStatus>> stores;  ///< in dictionary order
  std::uint32_t free_mib = 0;                                       ///< of the file system they are on
  std::string failure;                                              ///< of the last commit; empty: fine
};

/// The packet stores of the mission dictionary, `<folder>/<name>/`. Blocks on the disk: worker thread only.
class PacketStores {
 public:
  PacketStores(const mission::Dictionary& dictionary, std::filesystem::path folder);
  /// On other disks. @param make  is called for each store of the dictionary
  using MakeStore = std::function<PacketStore(const mission::PacketStore& store)>;
  PacketStores(const mission::Dictionary& dictionary, const MakeStore& make);

  /// Recovers all stores; what fails is tried again at the next commit.
  void open();
  void append(const StoreItem& item);
  /// Those in @p bounded take nothing more when they are full, the others drop their oldest segment.
  void set_bounded(const std::vector<std::uint16_t>& bounded);
  /// Writes and syncs everything appended.
  void commit();
  /// nullopt: no such store, or it cannot be read
  [[nodiscard]] std::optional<RetrievedPackets> read(std::uint16_t store, const RetrievalRange& range,
                                                     const RetrievalCursor& cursor, std::size_t limit_octets);
  [[nodiscard]] PacketStoresStatus status() const;

 private:
  [[nodiscard]] PacketStore* find(std::uint16_t store);
  std::filesystem::path folder_;
  std::vector<std::pair<std::uint16_t, PacketStore>> stores_;
  std::string failure_;
};

/// The store that takes reports of @p service; 0: none does.
[[nodiscard]] std::uint16_t store_of_service(const mission::Dictionary& dictionary, std::uint8_t service);

}  // namespace srfs
