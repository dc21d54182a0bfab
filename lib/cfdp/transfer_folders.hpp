// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cfdp/entity.hpp"
#include "cfdp/posix_file_store.hpp"

namespace srfs::cfdp {

/// Something happened to a file.
struct News {
  Event event;
  Report file;  ///< as it was last known
};

/// An entity with its folder. What lies in ROOT/outbox goes to the peer under its name there, in the order of
/// names, and is removed when the peer has it; what cannot be sent is moved to ROOT/unsent. What comes stands
/// below ROOT. Put a file into the outbox by renaming it: a file that changes while it is sent is not sent.
/// The outbox is the queue, so it survives everything. Blocks on the disk.
class TransferFolders {
 public:
  static constexpr std::size_t sending_max = 8;          ///< at once; the rest stays in the outbox
  static constexpr std::size_t outbox_files_max = 1024;  ///< read by one scan()

  /// @param checkpoint file of the entity's checkpoint; a damaged one is a fresh start (damaged() reports it)
  [[nodiscard]] static Result<std::unique_ptr<TransferFolders>, FileError> open(
      const std::filesystem::path& root, const std::filesystem::path& checkpoint, const Settings& settings,
      std::uint64_t first_sequence, MonotonicTime now);
  /// On another disk. @param checkpoint  as save_checkpoint() had it last; empty: the first start
  TransferFolders(std::shared_ptr<FileStore> store, OctetView checkpoint, const Settings& settings,
                  std::uint64_t first_sequence, MonotonicTime now);

  [[nodiscard]] Entity& entity() { return entity_; }
  [[nodiscard]] const Entity& entity() const { return entity_; }
  [[nodiscard]] const std::filesystem::path& outbox() const { return outbox_; }
  [[nodiscard]] const std::optional<CheckpointError>& damaged() const { return damaged_; }
  /// Reads what is in the outbox. Names that begin with a dot are not files to send.
  void scan();
  /// Sends any file below the root, at once. As Entity::put().
  [[nodiscard]] Result<TransactionId, PutError> send(const std::string& source_file,
                                                     const std::string& destination_file,
                                                     std::uint64_t operation);
  /// One PDU of the peer.
  void on_pdu(OctetView pdu, MonotonicTime now);
  [[nodiscard]] std::optional<Octets> next_pdu(std::size_t octets_max, MonotonicTime now,
                                               const FrameFill& frame = {});
  /// The peer is there: what rests since it was not goes on.
  void on_contact(MonotonicTime now);
  /// Since the last call, oldest first. Files that were sent leave the outbox here.
  [[nodiscard]] std::vector<News> take_news();
  /// The transaction that sends the file of the outbox.
  [[nodiscard]] std::optional<TransactionId> sending(const std::string& name) const;

 private:
  void look_at_transactions();
  void leave_outbox(const std::string& source_file, bool sent);

  std::filesystem::path outbox_;  // for outbox()
  std::shared_ptr<FileStore> store_;
  Entity entity_;
  std::optional<CheckpointError> damaged_;
  std::map<TransactionId, Report> known_;  // under way, and ended since take_news()
  std::vector<News> refused_;              // never became a transaction
};

/// What a worker does in one go for an owner that must not block.
struct TransferTurn {
  std::vector<Octets> received = {};
  std::size_t room_octets = 0;  ///< for PDUs, each with its overhead
  std::size_t pdu_octets_max = 0;
  std::size_t overhead_octets = 0;  ///< of one PDU on the link
  FrameFill frame = {};             ///< where the first PDU comes to lie
  bool scan = false;
  bool contact = false;
};
struct TransferTurnResult {
  std::vector<Octets> pdus = {};
  std::vector<News> news = {};
  std::optional<MonotonicTime> next_due = {};
  Counters counters = {};
  std::size_t transactions = 0;
  std::size_t resting = 0;
};
[[nodiscard]] TransferTurnResult take_turn(TransferFolders& transfer_folders, const TransferTurn& turn,
                                           MonotonicTime now);

/// The PDU in a Space Packet of APID 2045; nullopt: another packet, or a malformed one.
[[nodiscard]] std::optional<OctetView> pdu_in_packet(OctetView packet);
/// Whether a Space Packet is of APID 2045, however its rest looks.
[[nodiscard]] bool is_pdu_packet(OctetView packet);

}  // namespace srfs::cfdp
