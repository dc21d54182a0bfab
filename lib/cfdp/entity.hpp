// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "cfdp/checkpoint.hpp"
#include "cfdp/receiver.hpp"
#include "cfdp/sender.hpp"
#include "cfdp/transaction.hpp"

namespace srfs::cfdp {

enum class PutError : std::uint8_t {
  no_room,        ///< as many transactions as there may be
  name_too_long,  ///< more than 255 octets, or none
  file_refused,   ///< no such file, not readable, outside the root
  file_too_large,
};
[[nodiscard]] std::string_view to_string(PutError error);

/// One end of the file link (CCSDS 727.0-B-5, class 2): several transactions in both directions with one
/// peer. Time and PDUs are arguments; the disk is a FileStore, so calls may block on it. The link pulls PDUs
/// and so sets the pace. Files are sent in the order of their put(); what one waits for, the next one uses.
///
/// Use: after every call and at next_due(), next_pdu() while the link has room, then take_events(). `now`
/// never goes back.
class Entity final : private Context {
 public:
  /// The longest PDU other than file data and NAK; next_pdu() needs so much room.
  static constexpr std::size_t pdu_octets_min = 640;

  /// @param first_sequence  number of the first own transaction, when no checkpoint says better; above all
  ///                        that were ever used
  Entity(const Settings& settings, FileStore& files, std::uint64_t first_sequence);

  /// Goes on where @p checkpoint stood; empty: the first start. Before all other calls. On an error the
  /// entity is empty and works. Temporary files that belong to no transaction are removed.
  [[nodiscard]] Result<void, CheckpointError> restore(OctetView checkpoint, MonotonicTime now);

  /// Sends a file of the own store. @param destination_file name in the peer's store
  /// @param operation  the user's own number for it, kept with the transaction over restarts; 0: none
  [[nodiscard]] Result<TransactionId, PutError> put(std::string_view source_file,
                                                    std::string_view destination_file,
                                                    std::uint64_t operation = 0);
  /// What the link brought: one PDU.
  void on_pdu(OctetView octets, MonotonicTime now);
  /// Timers, and one step of reading files for their checksums. next_pdu() includes it.
  void advance(MonotonicTime now);
  /// The next PDU for the link, at most @p octets_max (pdu_octets_min or more). @param frame where it will
  /// lie: while frames are lost, data ends with a frame
  [[nodiscard]] std::optional<Octets> next_pdu(std::size_t octets_max, MonotonicTime now,
                                               const FrameFill& frame = {});
  /// When advance() or next_pdu() has something to do; @p now or before: already. nullopt: only another call
  /// changes that.
  [[nodiscard]] std::optional<MonotonicTime> next_due(MonotonicTime now) const;

  /// Each false when there is no such transaction. suspend() rests until resume(), also over a restart.
  bool cancel(TransactionId id, MonotonicTime now);
  bool suspend(TransactionId id);
  bool resume(TransactionId id, MonotonicTime now);
  /// Loss and acquisition of signal: without link nothing goes out and no timer runs. Starts with a link.
  void set_link(bool available, MonotonicTime now);

  /// Since the last call, oldest first.
  [[nodiscard]] std::vector<Event> take_events();
  [[nodiscard]] std::vector<Report> transactions() const;
  /// How a transaction ended, while it is remembered.
  [[nodiscard]] std::optional<Outcome> outcome_of(TransactionId id) const;
  [[nodiscard]] const Counters& counts() const { return counters; }

 private:
  [[nodiscard]] Context& context() { return *this; }
  void report(const Event& event) override;
  void save_checkpoint() override;
  [[nodiscard]] std::uint64_t receiving_octets() const override;

  void to_sender(const wire::CfdpPdu& pdu, MonotonicTime now);
  void to_receiver(const wire::CfdpPdu& pdu, MonotonicTime now);
  void to_unknown_receiver(const wire::CfdpPdu& pdu, MonotonicTime now);
  void reply(const CfdpHeader& header, const CfdpBody& body);
  void settle();
  void remember(TransactionId id, Role role, const Outcome& outcome);
  [[nodiscard]] const Ended* ended(TransactionId id) const;
  [[nodiscard]] Sender* sender(TransactionId id);
  [[nodiscard]] Receiver* receiver(TransactionId id);
  [[nodiscard]] bool has_room() const;
  [[nodiscard]] bool has_room_to_receive() const;
  /// Makes room for a new file by ending the one that was awaited in vain for longest, if there is one.
  void make_room_to_receive();
  [[nodiscard]] std::optional<Outgoing> next_outgoing(std::size_t octets_max, const FrameFill& frame,
                                                      MonotonicTime now);

  std::vector<std::unique_ptr<Sender>> senders_;  // in the order of their put()
  std::vector<std::unique_ptr<Receiver>> receivers_;
  std::deque<Ended> history_;
  std::deque<Outgoing> replies_;  // of transactions that are over, or unknown
  std::deque<Event> events_;
  std::uint64_t next_sequence_;
  bool link_available_ = true;
};

}  // namespace srfs::cfdp
