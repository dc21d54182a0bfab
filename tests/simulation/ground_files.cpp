// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/ground_files.hpp"

#include "wire/space_packet.hpp"

namespace srfs::simulation {
namespace {

constexpr milliseconds line_ahead{20};
/// As ground::open_files().
const cfdp::Settings settings{.own_entity = 1,
                              .peer_entity = 2,
                              .transactions_max = 32,
                              .receiving_max = 16,
                              .receiving_octets_max = std::uint64_t{4} << 30,
                              .safe_names = true};

}  // namespace

GroundFiles::GroundFiles(Kernel& kernel, FileRecord& record, std::size_t packet_octets_max, SendPacket send)
    : kernel_(kernel),
      record_(record),
      packet_octets_max_(packet_octets_max),
      send_(std::move(send)),
      timer_(
          kernel,
          [&kernel](nanoseconds delay, Kernel::Event event) { kernel.later(delay, std::move(event)); },
          [this] { move(); }) {
  restart();
}

void GroundFiles::restart() {
  const auto& disk = record_.disk(FileRecord::End::ground);
  folders_.reset();
  record_.on_process_end(FileRecord::End::ground);
  folders_ = std::make_unique<cfdp::TransferFolders>(disk, disk->checkpoint, settings,
                                                     first_transaction(kernel_.now()), kernel_.now());
  if (folders_->damaged()) throw Violation{"L12", "the ground's checkpoint cannot be read"};
  folders_->scan();
  on_contact();
}

void GroundFiles::on_pdu(OctetView pdu) {
  folders_->on_pdu(pdu, kernel_.now());
}

void GroundFiles::on_contact() {
  folders_->on_contact(kernel_.now());
  move();
}

void GroundFiles::put(Random& random) {
  (void)record_.put(FileRecord::End::ground, random);
  folders_->scan();
  move();
}

void GroundFiles::move() {
  const MonotonicTime now = kernel_.now();
  while (line_free_at_ <= now + line_ahead) {
    const auto pdu = folders_->next_pdu(packet_octets_max_ - wire::packet_header_octets, now);
    if (!pdu) break;
    line_free_at_ = send_(wire::encode_space_packet(
        {.type = wire::PacketType::telecommand, .apid = wire::cfdp_apid, .sequence_count = sequence_count_},
        *pdu));
    sequence_count_ = static_cast<std::uint16_t>((sequence_count_ + 1) & 0x3FFF);
  }
  folders_->entity().advance(now);
  for (const cfdp::News& news : folders_->take_news()) record_.on_news(FileRecord::End::ground, news);
  const auto due = folders_->entity().next_due(now);
  timer_.arm(due ? std::optional(std::max(*due, line_free_at_ - line_ahead)) : std::nullopt);
}

}  // namespace srfs::simulation
