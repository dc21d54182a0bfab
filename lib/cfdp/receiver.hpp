// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cfdp/gap_list.hpp"
#include "cfdp/transaction.hpp"

namespace srfs::cfdp {

/// What a crash must not take from a receiver.
struct ReceiveState {
  enum class Stage : std::uint8_t {
    receiving,
    checking,  ///< everything is there: checksums, then the name
    finished,  ///< until Finished is acknowledged
  };
  struct FileInfo {  // of the Metadata PDU
    std::string source_file;
    std::string destination_file;
    std::uint64_t octets = 0;  ///< 0: not given
    std::uint8_t checksum_type = 0;
    std::optional<Sha256::Digest> sha256;
    friend bool operator==(const FileInfo&, const FileInfo&) = default;
  };
  struct End {  // of the EOF PDU
    std::uint32_t checksum = 0;
    std::uint64_t octets = 0;
    friend bool operator==(const End&, const End&) = default;
  };

  CfdpHeader header;
  std::optional<FileInfo> file;
  std::optional<End> eof;
  std::uint64_t gaps_end = 0;
  std::vector<CfdpSegment> gaps;
  Stage stage = Stage::receiving;
  Outcome outcome;  ///< finished: what the Finished PDU reports
  Rest rest = Rest::none;
  friend bool operator==(const ReceiveState&, const ReceiveState&) = default;
};

/// Class 2 receiver of one file (CCSDS 727.0-B-5, 4.6). Gaps are asked for as they are seen and, after EOF,
/// until the NAK limit; the complete file is checked, gets its name, and Finished repeats until acknowledged.
class Receiver {
 public:
  /// The first PDU of an unknown transaction came.
  Receiver(Context& context, const CfdpHeader& header, MonotonicTime now);
  /// Of a checkpoint. Without its temporary file the transfer begins again, unless the file has its name
  /// already.
  /// @return nullopt: the gap list makes no sense with these settings
  [[nodiscard]] static std::optional<Receiver> restore(Context& context, ReceiveState state,
                                                       MonotonicTime now);

  void on_pdu(const CfdpBody& body, MonotonicTime now);
  /// Timers, and one step of checking the file.
  void advance(MonotonicTime now);
  [[nodiscard]] std::optional<Outgoing> next_pdu(std::size_t octets_max, MonotonicTime now);
  /// When advance() or next_pdu() has something to do; @p now or before: already.
  [[nodiscard]] std::optional<MonotonicTime> next_due(MonotonicTime now) const;

  void cancel(CfdpCondition condition, MonotonicTime now);
  void suspend(Rest rest);
  void resume(MonotonicTime now);
  void restart_timers(MonotonicTime now);
  /// Since when a file was awaited of which not one octet came, and nothing more came of its sender until a
  /// limit was reached; nullopt otherwise. That a contact made it go on does not matter.
  [[nodiscard]] std::optional<MonotonicTime> in_vain_since() const;
  /// Ends it without notice, for another that needs its place.
  void abandon();

  /// Set: the transaction is over.
  [[nodiscard]] const std::optional<Outcome>& ended() const { return ended_; }
  /// Makes the file's octets durable first, so that the gap list of the result is true after a crash.
  [[nodiscard]] ReceiveState durable_state();
  [[nodiscard]] TransactionId id() const;
  [[nodiscard]] Report report() const;
  /// Of the file that is not yet under its name.
  [[nodiscard]] std::uint64_t stored_octets() const;
  [[nodiscard]] bool is_checking() const { return state_.stage == ReceiveState::Stage::checking; }

 private:
  using Stage = ReceiveState::Stage;
  void on_metadata(const wire::CfdpMetadata& metadata, MonotonicTime now);
  void on_file_data(const wire::CfdpFileData& data, MonotonicTime now);
  void on_eof(const wire::CfdpEof& eof, MonotonicTime now);
  void on_ack(const wire::CfdpAck& ack);
  void on_prompt(const wire::CfdpPrompt& prompt, MonotonicTime now);
  void store(const wire::CfdpFileData& data, MonotonicTime now);
  /// @return whether a check begins now; the next checkpoint records it
  [[nodiscard]] bool begin_check_if_complete();
  void begin_check_when_complete();
  void check(MonotonicTime now);
  void judge_digest(MonotonicTime now);
  void commit(MonotonicTime now);
  void start_over(MonotonicTime now);
  void finish(const Outcome& outcome);
  void end(const Outcome& outcome);
  void end_in_silence(CfdpCondition condition);
  void fault(CfdpCondition condition, MonotonicTime now, std::optional<FileFault> why = std::nullopt);
  void advance_receiving(MonotonicTime now);
  [[nodiscard]] bool metadata_to_ask(MonotonicTime now) const;
  [[nodiscard]] bool may_repeat() const { return state_.eof.has_value() || heard_since_nak_; }
  [[nodiscard]] std::optional<MonotonicTime> nak_due() const;
  [[nodiscard]] std::optional<Outgoing> nak(std::size_t octets_max, MonotonicTime now);
  [[nodiscard]] bool owns_temporary() const { return state_.stage != Stage::finished && !ended_; }
  [[nodiscard]] std::uint64_t octets_max() const;

  Context* context_;
  ReceiveState state_;  // without the gaps, which are in gaps_
  GapList gaps_;
  bool temporary_made_ = false;
  bool dirty_ = false;                // octets written since the last sync
  std::uint64_t octets_unsaved_ = 0;  // since the last checkpoint
  std::optional<FileDigest> digest_;  // while checking
  bool check_named_file_ = false;     // a crash fell between its naming and the record of it
  bool checksum_ignored_ = false;     // by the fault handler

  bool ack_due_ = false;
  bool finished_due_ = false;
  bool keep_alive_due_ = false;
  bool nak_forced_ = false;  // prompted: also an empty one
  MonotonicTime heard_at_;
  MonotonicTime sender_heard_at_;    // other than heard_at_ not set anew by a contact
  bool rested_since_heard_ = false;  // by a fault
  bool heard_since_nak_ = true;
  MonotonicTime metadata_ask_at_;
  MonotonicTime nak_not_before_;
  MonotonicTime nak_round_at_;  // of NAKs after EOF that brought nothing
  unsigned nak_rounds_ = 0;
  unsigned attempts_ = 0;                  // of Finished
  std::optional<MonotonicTime> deadline_;  // of its ACK
  std::optional<Outcome> ended_;
};

}  // namespace srfs::cfdp
