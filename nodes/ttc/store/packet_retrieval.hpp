// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "base/time.hpp"
#include "nodes/ttc/services/pus_service.hpp"
#include "nodes/ttc/store/packet_store.hpp"

namespace srfs {

/// A period of one packet store.
struct StorePeriod {
  std::uint16_t store = 0;
  RetrievalRange range;
};

/// One period whose packets are all on their way.
struct RetrievalDone {
  std::uint16_t store = 0;
  std::uint32_t packets = 0;
  std::uint64_t octets = 0;
};

/// Playback of stored packets, one request after another (ECSS-E-ST-70-41C 6.15.3.6, by-time-range
/// retrieval): asks for batches while the playback channel has room; reports the start with the first batch,
/// completion when the last packet has been framed.
class PacketRetrieval final : public PusService {
 public:
  static constexpr std::uint8_t service_type = 15;
  static constexpr std::uint8_t retrieve = 9;
  static constexpr std::uint8_t abort_retrieval = 17;
  static constexpr std::size_t max_requests = 5;  ///< the running one and those that wait
  static constexpr std::size_t max_periods = 8;   ///< of one request
  static constexpr std::size_t batch_octets = 4096;
  /// The playback channel takes a batch when it has room for this much: a batch may be one packet too long.
  static constexpr std::size_t room_for_batch = batch_octets + max_stored_packet_octets;

  struct Batch {
    StorePeriod period;
    RetrievalCursor cursor;
    std::uint64_t request = 0;  ///< goes back with the packets; those of an ended request are dropped
  };

  explicit PacketRetrieval(ReportQueue& report_queue) : report_queue_(report_queue) {}

  [[nodiscard]] bool provides(const mission::Command& command) const override {
    return command.service == service_type &&
           (command.subtype == retrieve || command.subtype == abort_retrieval);
  }
  void execute(const Telecommand& telecommand, MonotonicTime now) override;

  /// @param periods 1 to max_periods. @return false: too many wait
  [[nodiscard]] bool request(const TelecommandOrigin& origin, std::vector<StorePeriod> periods);
  /// Ends the requests that name @p store; each gets its 1,8 with @p code.
  void abort(std::uint16_t store, std::uint16_t code);
  /// Ends the running request, whose store cannot be read at all.
  void fail(std::uint64_t request);

  /// The batch to read next, if the playback channel has room for one and none is being read.
  [[nodiscard]] std::optional<Batch> next_batch(std::size_t room_octets);
  /// @return the packets to send, unchanged
  [[nodiscard]] std::vector<Octets> on_batch(std::uint64_t request, RetrievedPackets batch);
  /// The store took no batch (its worker is full): ask again.
  void on_batch_refused() { reading_ = false; }
  /// @param playback_empty whether the playback channel has framed everything
  void on_playback(bool playback_empty);

  [[nodiscard]] std::vector<RetrievalDone> take_done() { return std::exchange(done_, {}); }
  /// Retrievals that ended with 1,8 because a part could not be read.
  [[nodiscard]] std::uint64_t incomplete() const { return incomplete_; }
  [[nodiscard]] bool busy() const { return !requests_.empty(); }
  /// Whether a request that runs or waits has a period of @p store.
  [[nodiscard]] bool names(std::uint16_t store) const;

 private:
  struct Request {
    TelecommandOrigin origin;
    std::deque<StorePeriod> periods;  // the first one runs
    bool started = false;
    bool damaged = false;  // a part of it could not be read
  };
  [[nodiscard]] static bool names(const Request& request, std::uint16_t store);
  void end_period();

  ReportQueue& report_queue_;
  std::uint64_t incomplete_ = 0;
  std::deque<Request> requests_;  // the first one runs
  RetrievalCursor cursor_;
  RetrievalDone running_;
  std::uint64_t number_ = 0;
  bool reading_ = false;
  bool read_all_ = false;
  std::vector<RetrievalDone> done_;
};

}  // namespace srfs
