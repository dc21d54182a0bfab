// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/files/file_exchange.hpp"

#include <algorithm>
#include <iterator>

#include "wire/cfdp_pdu.hpp"
#include "wire/space_packet.hpp"

namespace srfs {

void FileExchange::on_packet(OctetView packet) {
  const auto pdu = cfdp::pdu_in_packet(packet);
  if (!pdu) {
    ++counters_.malformed;
  } else if (received_.size() == received_max) {
    ++counters_.dropped;
  } else {
    ++counters_.received;
    received_.emplace_back(pdu->begin(), pdu->end());
  }
}

std::optional<cfdp::TransferTurn> FileExchange::next_turn(FilesRoom room, MonotonicTime now,
                                                          cfdp::FrameFill frame) {
  const auto due = next_due(room);
  if (!due || now < *due) return std::nullopt;
  running_ = true;
  changed_ = false;
  frame.overhead = wire::packet_header_octets;
  const auto taken = std::min(received_.size(), received_per_turn);
  const auto end = received_.begin() + static_cast<std::ptrdiff_t>(taken);
  cfdp::TransferTurn turn{
      .received = {std::make_move_iterator(received_.begin()), std::make_move_iterator(end)},
      .room_octets = may_send(room) ? room.octets : 0,
      .pdu_octets_max = pdu_octets_max,
      .overhead_octets = wire::packet_header_octets,
      .frame = frame,
      .scan = now >= scan_at_,
      .contact = std::exchange(contact_, false)};
  received_.erase(received_.begin(), end);
  if (turn.scan) scan_at_ = now + scan_period;
  return turn;
}

std::vector<Octets> FileExchange::on_turn(cfdp::TransferTurnResult& result) {
  running_ = false;
  resting_ = result.resting > 0;
  transfer_due_ = result.next_due;
  std::vector<Octets> packets;
  for (const Octets& pdu : std::exchange(result.pdus, {})) {
    packets.push_back(wire::encode_space_packet(
        {.type = wire::PacketType::telemetry, .apid = wire::cfdp_apid, .sequence_count = sequence_count_},
        pdu));
    sequence_count_ = static_cast<std::uint16_t>((sequence_count_ + 1) & 0x3FFF);
    ++counters_.sent;
  }
  return packets;
}

void FileExchange::on_turn_refused(MonotonicTime now) {
  running_ = false;
  resting_ = true;
  not_before_ = now + retry_period;
  scan_at_ = not_before_;
}

bool FileExchange::may_send(FilesRoom room) const {
  return room.queue >= refill_octets_ && room.octets >= pdu_octets_max + wire::packet_header_octets;
}

std::optional<MonotonicTime> FileExchange::next_due(FilesRoom room) const {
  if (running_) return std::nullopt;
  MonotonicTime due = scan_at_;
  if (!received_.empty() || contact_ || changed_) due = MonotonicTime();
  if (transfer_due_ && may_send(room)) due = std::min(due, *transfer_due_);
  return std::max(due, not_before_);
}

}  // namespace srfs
