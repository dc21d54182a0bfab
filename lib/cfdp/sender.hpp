// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cfdp/gap_list.hpp"
#include "cfdp/transaction.hpp"

namespace srfs::cfdp {

/// What a crash must not take from a sender.
struct SendState {
  CfdpHeader header;
  std::string source_file;
  std::string destination_file;
  wire::CfdpChecksumType checksum_type = wire::CfdpChecksumType::modular;
  bool prepared = false;  ///< stamp, checksum and hash are those of the file
  FileStamp stamp;
  std::uint32_t checksum = 0;
  Sha256::Digest sha256{};
  /// Octets that may have left. A restored sender goes on behind them: what did not leave after all, the
  /// receiver asks for. So a crash makes nothing travel twice.
  std::uint64_t reserved = 0;
  bool eof_acknowledged = false;
  CfdpCondition cancelled = CfdpCondition::no_error;
  Rest rest = Rest::none;
  std::uint64_t operation = 0;  ///< the user's own number
  friend bool operator==(const SendState&, const SendState&) = default;
};

/// Class 2 sender of one file (CCSDS 727.0-B-5, 4.6). Stages: the file is read once for its checksums; then
/// metadata, data, EOF, what NAKs ask for; then it waits for Finished.
class Sender {
 public:
  /// @param state of a new transaction, or of a checkpoint
  Sender(Context& context, SendState state);

  void on_pdu(const CfdpBody& body, MonotonicTime now);
  /// Timers, and one step of the first reading of the file.
  void advance(MonotonicTime now);
  [[nodiscard]] std::optional<Outgoing> next_pdu(std::size_t octets_max, const FrameFill& frame,
                                                 MonotonicTime now);
  /// When advance() or next_pdu() has something to do; @p now or before: already.
  [[nodiscard]] std::optional<MonotonicTime> next_due(MonotonicTime now) const;

  void cancel(CfdpCondition condition);
  void suspend(Rest rest);
  void resume();
  void restart_timers(MonotonicTime now);

  /// Set: the transaction is over.
  [[nodiscard]] const std::optional<Outcome>& outcome() const { return outcome_; }
  [[nodiscard]] const SendState& state() const { return state_; }
  [[nodiscard]] TransactionId id() const;
  [[nodiscard]] Report report() const;

 private:
  void prepare();
  void on_ack(const wire::CfdpAck& ack, MonotonicTime now);
  void on_nak(const wire::CfdpNak& nak);
  void on_finished(const wire::CfdpFinished& finished);
  void on_keep_alive(const wire::CfdpKeepAlive& keep_alive);
  void on_deadline();
  void fault(CfdpCondition condition, std::optional<FileFault> why = std::nullopt);
  void end(const Outcome& outcome);
  [[nodiscard]] bool cancelling() const { return state_.cancelled != CfdpCondition::no_error; }
  [[nodiscard]] bool has_output() const;
  [[nodiscard]] bool all_sent() const { return state_.prepared && sent_ == state_.stamp.octets; }
  /// The file is no longer the one whose checksum was taken: the condition that reports it.
  [[nodiscard]] std::optional<CfdpCondition> file_changed(std::optional<FileFault>& why);
  [[nodiscard]] Outgoing metadata() const;
  [[nodiscard]] Outgoing eof(MonotonicTime now);
  [[nodiscard]] std::optional<Outgoing> file_data(std::size_t octets_max, const FrameFill& frame,
                                                  MonotonicTime now);

  Context& context_;
  SendState state_;
  std::optional<FileDigest> digest_;  // while preparing
  std::uint64_t sent_ = 0;            // new octets handed out
  std::uint64_t sent_before_ = 0;     // of them, before a restart: how much of them was lost says nothing
  SegmentSet retransmit_;
  bool metadata_due_ = true;
  bool eof_due_ = false;
  unsigned attempts_ = 0;   // of EOF since the peer was heard
  unsigned reminders_ = 0;  // of the receiver that acknowledged EOF and then said nothing useful
  std::optional<MonotonicTime> deadline_;  // of the ACK of EOF, then of Finished
  Octets data_;                            // of the File Data PDU handed out last
  std::optional<Outcome> outcome_;
};

}  // namespace srfs::cfdp
