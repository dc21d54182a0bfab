// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "cfdp/transfer_folders.hpp"

#include <algorithm>
#include <set>
#include <utility>

#include "wire/space_packet.hpp"

namespace srfs::cfdp {
namespace {

constexpr std::string_view outbox_prefix = "outbox/";

bool arrived(const Outcome& outcome) {
  return outcome.condition == CfdpCondition::no_error && !outcome.incomplete;
}

}  // namespace

TransferFolders::TransferFolders(std::shared_ptr<FileStore> store, OctetView checkpoint,
                                 const Settings& settings, std::uint64_t first_sequence, MonotonicTime now)
    : store_(std::move(store)), entity_(settings, *store_, first_sequence) {
  if (const auto restored = entity_.restore(checkpoint, now); !restored) damaged_ = restored.error();
  look_at_transactions();
}

Result<std::unique_ptr<TransferFolders>, FileError> TransferFolders::open(
    const std::filesystem::path& root, const std::filesystem::path& checkpoint, const Settings& settings,
    std::uint64_t first_sequence, MonotonicTime now) {
  auto store = PosixFileStore::open(root, checkpoint, settings.free_floor_octets);
  if (!store) return Err(store.error());
  std::error_code ec;
  for (const char* folder : {"outbox", "unsent"}) {
    std::filesystem::create_directory(root / folder, ec);
    if (ec) return Err(FileError{(root / folder).string() + ": " + ec.message()});
  }
  const auto saved = (*store)->load_checkpoint();
  if (!saved) return Err(saved.error());
  auto transfer_folders =
      std::make_unique<TransferFolders>(std::move(*store), *saved, settings, first_sequence, now);
  transfer_folders->outbox_ = root / "outbox";
  return transfer_folders;
}

void TransferFolders::look_at_transactions() {
  for (Report& report : entity_.transactions()) {
    Report& known = known_[report.id];
    known = std::move(report);
  }
}

std::optional<TransactionId> TransferFolders::sending(const std::string& name) const {
  const std::string source = std::string(outbox_prefix) + name;
  for (const Report& report : entity_.transactions()) {
    if (report.role == Role::sending && report.source_file == source) return report.id;
  }
  return std::nullopt;
}

void TransferFolders::scan() {
  std::set<std::string> under_way;
  for (const Report& report : entity_.transactions()) {
    if (report.role == Role::sending) under_way.insert(report.source_file);
  }
  std::vector<std::string> found = store_->list("outbox", outbox_files_max);
  std::erase_if(
      found, [&](const std::string& name) { return under_way.contains(std::string(outbox_prefix) + name); });
  std::sort(found.begin(), found.end());
  for (const std::string& name : found) {
    if (under_way.size() >= sending_max) break;
    const std::string source = std::string(outbox_prefix) + name;
    const auto id = entity_.put(source, name);
    if (id) {
      under_way.insert(source);
      continue;
    }
    if (id.error() == PutError::no_room) break;
    refused_.push_back(
        {.event = {.kind = EventKind::finished,
                   .outcome = {.condition = CfdpCondition::filestore_rejection,
                               .incomplete = true,
                               .file_status = wire::CfdpFileStatus::unreported}},
         .file = {.id = {}, .source_file = source, .destination_file = name, .file_octets = {}}});
    leave_outbox(source, false);
  }
  look_at_transactions();
}

Result<TransactionId, PutError> TransferFolders::send(const std::string& source_file,
                                                      const std::string& destination_file,
                                                      std::uint64_t operation) {
  auto id = entity_.put(source_file, destination_file, operation);
  look_at_transactions();
  return id;
}

void TransferFolders::on_pdu(OctetView pdu, MonotonicTime now) {
  entity_.on_pdu(pdu, now);
  look_at_transactions();
}

std::optional<Octets> TransferFolders::next_pdu(std::size_t octets_max, MonotonicTime now,
                                                const FrameFill& frame) {
  return entity_.next_pdu(octets_max, now, frame);
}

void TransferFolders::on_contact(MonotonicTime now) {
  for (const Report& report : entity_.transactions()) {
    if (report.rest == Rest::by_fault) entity_.resume(report.id, now);
  }
}

std::vector<News> TransferFolders::take_news() {
  look_at_transactions();
  std::vector<News> news = std::exchange(refused_, {});
  for (const Event& event : entity_.take_events()) {
    const auto known = known_.find(event.id);
    news.push_back({.event = event, .file = known == known_.end() ? Report{} : known->second});
    if (event.kind != EventKind::finished || known == known_.end()) continue;
    if (event.role == Role::sending) leave_outbox(known->second.source_file, arrived(event.outcome));
    known_.erase(known);
  }
  return news;
}

void TransferFolders::leave_outbox(const std::string& source_file, bool sent) {
  if (!source_file.starts_with(outbox_prefix)) return;
  if (!sent && store_->rename(source_file, "unsent/" + source_file.substr(outbox_prefix.size()))) return;
  store_->remove(source_file);
}

TransferTurnResult take_turn(TransferFolders& transfer_folders, const TransferTurn& turn, MonotonicTime now) {
  TransferTurnResult result;
  if (turn.contact) transfer_folders.on_contact(now);
  for (const Octets& pdu : turn.received) transfer_folders.on_pdu(pdu, now);
  if (turn.scan) transfer_folders.scan();
  std::size_t room = turn.room_octets;
  FrameFill frame = turn.frame;
  while (room >= turn.pdu_octets_max + turn.overhead_octets) {
    auto pdu = transfer_folders.next_pdu(turn.pdu_octets_max, now, frame);
    if (!pdu) break;
    frame = frame.behind(pdu->size());
    room -= pdu->size() + turn.overhead_octets;
    result.pdus.push_back(std::move(*pdu));
  }
  transfer_folders.entity().advance(now);
  result.news = transfer_folders.take_news();
  result.next_due = transfer_folders.entity().next_due(now);
  result.counters = transfer_folders.entity().counts();
  for (const Report& report : transfer_folders.entity().transactions()) {
    ++result.transactions;
    if (report.rest != Rest::none) ++result.resting;
  }
  return result;
}

bool is_pdu_packet(OctetView packet) {
  return packet.size() >= wire::packet_header_octets &&
         ((packet[0] & 0x07U) << 8U | packet[1]) == wire::cfdp_apid;
}

std::optional<OctetView> pdu_in_packet(OctetView packet) {
  const auto view = wire::decode_space_packet(packet);
  const bool whole = view && view->header.apid == wire::cfdp_apid && !view->header.has_secondary_header &&
                     view->header.grouping == wire::PacketGrouping::unsegmented;
  if (!whole) return std::nullopt;
  return view->data;
}

}  // namespace srfs::cfdp
