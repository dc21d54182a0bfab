// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "msgs/mission/dictionary.hpp"
#include "nodes/ttc/services/pus_service.hpp"
#include "nodes/ttc/store/packet_retrieval.hpp"
#include "nodes/ttc/store/packet_store.hpp"

namespace srfs {

/// What was set by telecommands: to be stored, then reported with StoreControl::change_stored().
struct StoreChange {
  std::vector<TelecommandOrigin> origins;
  std::string stored_text;
};

/// What the ground has set for the packet stores, and open retrieval: new packets of a store go down by
/// themselves, in order, those not yet sent first (ECSS-E-ST-70-41C 6.15.3). All of it lasts over restarts;
/// after one, open retrieval may send again what left in the seconds since its place was stored. Pure; one
/// thread.
class StoreControl final : public PusService {
 public:
  /// @param stored  stored_text() of an earlier process; missing or damaged: all stores take packets, are
  ///                circular and have their open retrieval suspended
  /// @param retrieval  outlives it, as @p report_queue does
  StoreControl(const mission::Dictionary& dictionary, std::string_view stored, ReportQueue& report_queue,
               const PacketRetrieval& retrieval);

  /// Service 15 without what is PacketRetrieval's.
  [[nodiscard]] bool provides(const mission::Command& command) const override;
  void execute(const Telecommand& telecommand, MonotonicTime now) override;

  /// Whether @p store takes a packet now; one that it does not take is counted.
  [[nodiscard]] bool take_packet(std::uint16_t store);
  /// The stores that take nothing more when they are full.
  [[nodiscard]] std::vector<std::uint16_t> bounded() const;
  /// @return whether the store is full and bounded, and was not before
  bool on_status(std::uint16_t store, const PacketStoreStatus& status);

  /// A batch of one store for the open retrieval: when there are packets to send, the channel has room and no
  /// period is being retrieved, which goes before.
  [[nodiscard]] std::optional<PacketRetrieval::Batch> next_batch(std::size_t room_octets);
  /// @param batch  nullopt: the store could not be read; tried again after the next on_status()
  /// @return the packets to send, unchanged
  [[nodiscard]] std::vector<Octets> on_batch(std::uint64_t request, std::optional<RetrievedPackets> batch);
  /// The worker of the stores took no batch: ask again.
  void on_batch_refused() { reading_.reset(); }
  /// The packets of on_batch() are in the playback channel. @param pushed_octets  of all packets that ever
  /// were
  void on_pushed(std::uint64_t pushed_octets);
  /// @param left_octets  of them framed so far
  void on_left(std::uint64_t left_octets);

  [[nodiscard]] std::optional<StoreChange> take_change();
  /// The change is on disk, or could not be stored; it holds either way.
  void change_stored(const StoreChange& change, bool success);
  [[nodiscard]] std::string stored_text() const;
  /// Whether open retrieval came further since the last stored_text() that was asked for here.
  [[nodiscard]] bool take_progress() { return std::exchange(progress_, false); }

 private:
  struct Store {
    std::uint16_t id = 0;
    bool enabled = true;
    bool bounded = false;
    bool open = false;  ///< open retrieval is in progress
    TaiTime open_start;
    std::uint32_t sent = 0;  ///< records below this sequence have left
    // Not stored
    RetrievalCursor cursor;  ///< of what is read next
    std::uint32_t read = 0;  ///< records below this sequence were read
    std::uint32_t refused = 0;
    bool full_told = false;
    bool known = false;       ///< a status came
    bool unreadable = false;  ///< until the next status
    PacketStoreStatus status;
  };
  [[nodiscard]] Store* find(std::uint16_t id);
  /// Those that a request names; none named: all.
  [[nodiscard]] std::vector<Store*> named(OctetReader& reader);
  void load(std::string_view stored);
  void set_open_start(const TelecommandOrigin& origin, OctetReader& reader);
  void begin_at(Store& store, std::uint32_t sequence);
  void report_summary(const TelecommandOrigin& origin, const Store& store);
  void report_status(const TelecommandOrigin& origin, const Store& store);
  void put(const TelecommandOrigin& origin, std::uint8_t subtype, Octets data);

  ReportQueue& report_queue_;
  const PacketRetrieval& retrieval_;
  std::vector<Store> stores_;           // in dictionary order
  std::vector<TelecommandOrigin> set_;  // carried out, to be stored
  struct Reading {
    std::uint16_t store = 0;
    std::uint64_t request = 0;
  };
  std::optional<Reading> reading_;
  /// A batch on its way: a batch has one packet at least, so the channel bounds them.
  struct Pushed {
    std::uint16_t store = 0;
    std::uint32_t read = 0;
    std::uint64_t end_octets = 0;
  };
  std::deque<Pushed> pushed_;
  std::optional<std::uint16_t> to_push_;  ///< store of the batch that is about to be pushed
  std::uint64_t requests_ = 0;
  std::size_t turn_ = 0;  ///< index of the store that is checked first
  bool progress_ = false;
};

}  // namespace srfs
