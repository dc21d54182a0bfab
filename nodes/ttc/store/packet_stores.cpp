// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/store/packet_stores.hpp"

#include "base/saturate.hpp"

#include <algorithm>

namespace srfs {

PacketStores::PacketStores(const mission::Dictionary& dictionary, std::filesystem::path folder)
    : PacketStores(dictionary, [&folder](const mission::PacketStore& store) {
        PacketStoreConfig config;
        config.folder = folder / store.name;
        config.quota_octets = std::size_t{store.quota_mib} << 20;
        return PacketStore(std::move(config));
      }) {
  folder_ = std::move(folder);
}

PacketStores::PacketStores(const mission::Dictionary& dictionary, const MakeStore& make) {
  for (const mission::PacketStore& store : dictionary.stores()) stores_.emplace_back(store.id, make(store));
}

void PacketStores::open() {
  failure_.clear();
  for (auto& [id, store] : stores_) {
    if (const auto opened = store.open(); !opened) failure_ = opened.error().message;
  }
}

void PacketStores::append(const StoreItem& item) {
  if (PacketStore* store = find(item.store)) store->append(item.stamp, item.packet);
}

void PacketStores::set_bounded(const std::vector<std::uint16_t>& bounded) {
  for (auto& [id, store] : stores_)
    store.set_bounded(std::find(bounded.begin(), bounded.end(), id) != bounded.end());
}

void PacketStores::commit() {
  failure_.clear();
  for (auto& [id, store] : stores_) {
    if (const auto done = store.commit(); !done) failure_ = done.error().message;
  }
}

std::optional<RetrievedPackets> PacketStores::read(std::uint16_t store, const RetrievalRange& range,
                                                   const RetrievalCursor& cursor, std::size_t limit_octets) {
  PacketStore* found = find(store);
  if (found == nullptr || !found->is_open()) return std::nullopt;
  return found->read(range, cursor, limit_octets);
}

PacketStoresStatus PacketStores::status() const {
  PacketStoresStatus status;
  status.failure = failure_;
  for (const auto& [id, store] : stores_) status.stores.emplace_back(id, store.status());
  std::error_code ec;
  const auto space = std::filesystem::space(folder_, ec);
  if (!ec) status.free_mib = as_u32(space.available >> 20);
  return status;
}

PacketStore* PacketStores::find(std::uint16_t store) {
  for (auto& [id, found] : stores_) {
    if (id == store) return &found;
  }
  return nullptr;
}

std::uint16_t store_of_service(const mission::Dictionary& dictionary, std::uint8_t service) {
  for (const mission::PacketStore& store : dictionary.stores()) {
    if (std::find(store.services.begin(), store.services.end(), service) != store.services.end())
      return store.id;
  }
  return 0;
}

}  // namespace srfs
