// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/direct_link.hpp"

#include <algorithm>
#include <utility>

#include <mission/structures.hpp>

#include "ground/files.hpp"
#include "wire/space_packet.hpp"

namespace srfs::ground {
namespace {

constexpr milliseconds line_ahead{20};  ///< of file data in the driver; a telecommand waits no longer

auto unrecorded() {
  return Err(OrderError{OrderError::Kind::unrecorded, "it cannot be recorded in the archive"});
}

}  // namespace

DirectLink::DirectLink(const mission::Dictionary& dictionary, const suite::LinkSettings& link, Port port,
                       Uplink uplink, wire::FopSettings fop, FrameTrust trust)
    : dictionary_(dictionary),
      port_(std::move(port)),
      downlink_(link, std::move(trust.verifier), trust.unverified),
      floor_file_(std::move(trust.floor_file)),
      uplink_(std::move(uplink)),
      ad_(uplink_.vc(), fop),
      octet_time_ns_(10e9 / static_cast<double>(link.baud)) {}  // 8N1

void DirectLink::replace_port(Port port) {
  port_ = std::move(port);
}

Result<void, std::string> DirectLink::write(OctetView octets) {
  return write_line(octets);
}

Result<void, std::string> DirectLink::write_line(OctetView octets) {
  return queues_ ? port_.queue(octets, monotonic_now()) : port_.write(octets, write_patience);
}

Uplink& DirectLink::uplink_now() {
  uplink_.on_time(system_utc_now());
  return uplink_;
}

Result<wire::RequestId, OrderError> DirectLink::send(const TelecommandOrder& order) {
  if (order.again) return not_known("without a server no archive knows whether it was sent before");
  if (order.ad) {
    auto made = uplink_now().make_packet(order.command);
    if (!made) return refused(made.error());
    if (made_ && !made_(order, made->request, false)) {
      unsent_(order);
      return unrecorded();
    }
    if (!ad_.request(order.number, std::move(made->packet), monotonic_now())) {
      unsent_(order);
      return refused("too many telecommands are waiting for the AD service");
    }
    return made->request;
  }
  const auto telecommand = uplink_now().make(order.command, order.keys);
  if (!telecommand) return refused(telecommand.error());
  if (made_ && !made_(order, telecommand->request, false)) {
    unsent_(order);
    return unrecorded();
  }
  if (const auto written = write_line(telecommand->cltu); !written) {
    unsent_(order);
    return refused(written.error());
  }
  return telecommand->request;
}

Result<TelecommandPacket, OrderError> DirectLink::make_packet(const TelecommandOrder& order) {
  auto made = uplink_now().make_packet(order.command);
  if (!made) return refused(made.error());
  if (made_ && !made_(order, made->request, true)) return unrecorded();
  return std::move(*made);
}

Result<void, OrderError> DirectLink::start_ad() {
  ad_.start(monotonic_now());
  handle_ad();
  return {};
}

Result<void, OrderError> DirectLink::stop_ad() {
  ad_.stop(monotonic_now());
  handle_ad();
  return {};
}

Result<void, OrderError> DirectLink::unlock() {
  ad_.unlock(monotonic_now());
  handle_ad();
  return {};
}

Result<void, OrderError> DirectLink::set_vr(std::uint8_t vr) {
  ad_.set_vr(vr, monotonic_now());
  handle_ad();
  return {};
}

void DirectLink::handle_ad() {
  using Kind = AdSignal::Kind;
  const auto tell = [this](std::uint64_t number, AdProgress progress) {
    if (output_.ad) output_.ad(number, progress);
  };
  while (const auto signal = ad_.next_signal()) {
    switch (signal->kind) {
      case Kind::transmit_ad:
      case Kind::transmit_bc:
        transmit_ad(*signal);
        break;
      case Kind::delivered:
        tell(signal->tag, AdProgress::delivered);
        break;
      case Kind::undelivered:
        tell(signal->tag, AdProgress::undelivered);
        break;
      case Kind::not_sent:
        tell(signal->tag, AdProgress::not_sent);
        break;
      case Kind::changed:
        if (output_.cop) output_.cop(ad_.report());
        break;
    }
  }
}

void DirectLink::transmit_ad(const AdSignal& signal) {
  Result<Octets, std::string> cltu = signal.kind == AdSignal::Kind::transmit_bc
                                         ? uplink_now().make_bc_cltu(signal.control)
                                         : uplink_now().make_ad_cltu(signal.sequence, signal.packet);
  bool written = false;
  if (!cltu) {
    report_problem(cltu.error());
  } else if (const auto put = write_line(*cltu); !put) {
    report_problem(put.error());
  } else {
    written = true;
  }
  if (written && signal.kind == AdSignal::Kind::transmit_ad && output_.ad)
    output_.ad(signal.tag, AdProgress::transmitted);
  ad_.on_transmitted(signal.kind, written, monotonic_now());
}

Result<void, std::string> DirectLink::on_readable() {
  const auto octets = port_.read();
  if (!octets) return Err(octets.error());
  if (octets_) octets_(*octets);
  const MonotonicTime now = monotonic_now();
  downlink_.on_time(system_utc_now());
  const auto packets = downlink_.push(*octets);
  note_frames(now);
  for (const std::uint32_t word : downlink_.take_control_words()) {
    ad_.on_control_word(word, now);
    handle_ad();
  }
  for (const auto& received : packets) on_packet(received);
  const auto pdus = downlink_.take_file_pdus();
  if (files_) {
    for (const Octets& pdu : pdus) files_->on_pdu(pdu, now);
    move_files(now);
  }
  return {};
}

void DirectLink::note_frames(MonotonicTime now) {
  const FrameVerifier* const verifier = downlink_.verifier();
  if (verifier == nullptr) return;
  if (floor_file_ && verifier->floor() != stored_floor_) {
    const auto written = floor_file_->write(verifier->floor());
    if (!written && !floor_fails_) report_problem(written.error());
    floor_fails_ = !written;
    stored_floor_ = verifier->floor();
  }
  if (const std::string news = refused_frames_.take(verifier->counters(), now); !news.empty())
    report_problem(news);
}

void DirectLink::on_packet(const ReceivedPacket& received) {
  const bool is_ours = received.authenticity != Authenticity::unverified;
  if (is_ours && received.vc == tm_channel::live && received.packet.service == 3 &&
      received.packet.subtype == 25) {
    const TelemetryReport report = decode_telemetry(dictionary_, received);
    if (report.kind == TelemetryKind::beacon) follow_counters(report);
  }
  if (output_.packet) output_.packet(received);
}

void DirectLink::follow_counters(const TelemetryReport& beacon) {
  const auto number = [&beacon](std::string_view name) -> std::optional<std::uint64_t> {
    for (const mission::DecodedField& field : beacon.fields) {
      if (field.name != name) continue;
      if (const auto* value = std::get_if<std::uint64_t>(&field.value)) return *value;
    }
    return std::nullopt;
  };
  for (const std::string of : {"bd", "ad"}) {
    const auto spi = number("sdls_spi." + of);
    const auto counter = number("sdls_counter." + of);
    if (!spi || !counter) return;
    const auto warning = uplink_.on_spacecraft_counter(static_cast<std::uint16_t>(*spi), *counter);
    if (warning) report_problem(*warning);
  }
  const auto spi = static_cast<std::uint16_t>(*number("sdls_spi.bd"));
  const auto set = uplink_.set_of(spi);
  if (!set) return;
  if (const auto selected = select_keys(*set, "the beacon"); !selected) report_problem(selected.error().text);
}

Result<void, OrderError> DirectLink::select_keys(suite::AssociationSet set, const std::string& why) {
  const auto changed = uplink_.select(set);
  if (!changed) return refused(changed.error());
  if (*changed && output_.keys) output_.keys(set, why);
  return {};
}

void DirectLink::carry_files(std::unique_ptr<cfdp::TransferFolders> transfer_folders) {
  files_ = std::move(transfer_folders);
  files_->scan();
  files_->on_contact(monotonic_now());
}

Result<cfdp::TransactionId, OrderError> DirectLink::put(const std::filesystem::path& file,
                                                        const std::string& name, bool resume) {
  const auto put = resume ? put_or_resume(*files_, file, name) : put_file(*files_, file, name);
  if (!put) return refused(put.error());
  return *put;
}

std::vector<cfdp::Report> DirectLink::transfers() const {
  return files_ == nullptr ? std::vector<cfdp::Report>{} : files_->entity().transactions();
}

Result<bool, OrderError> DirectLink::order_transfer(cfdp::TransactionId id, TransferOrder order) {
  if (files_ == nullptr) return false;
  const MonotonicTime now = monotonic_now();
  switch (order) {
    case TransferOrder::suspend:
      return files_->entity().suspend(id);
    case TransferOrder::resume:
      return files_->entity().resume(id, now);
    case TransferOrder::cancel:
      return files_->entity().cancel(id, now);
  }
  return false;
}

void DirectLink::move_files(MonotonicTime now) {
  if (!files_) return;
  const std::size_t octets_max = uplink_.packet_octets_max() - wire::packet_header_octets;
  // Behind a line that stalls telecommands alone wait.
  while (line_free_at_ <= now + line_ahead && !port_.has_waiting()) {
    const auto pdu = files_->next_pdu(octets_max, now);
    if (!pdu || !send_pdu(*pdu)) break;
  }
  files_->entity().advance(now);
  for (const cfdp::News& news : files_->take_news()) {
    if (output_.file) output_.file(news);
  }
}

bool DirectLink::send_pdu(OctetView pdu) {
  const Octets packet = wire::encode_space_packet({.type = wire::PacketType::telecommand,
                                                   .apid = wire::cfdp_apid,
                                                   .sequence_count = file_sequence_count_},
                                                  pdu);
  file_sequence_count_ = static_cast<std::uint16_t>((file_sequence_count_ + 1) & 0x3FFF);
  const auto cltu = uplink_now().make_file_cltu(packet);
  const auto written = cltu ? write_line(*cltu) : Result<void, std::string>(Err(cltu.error()));
  const MonotonicTime now = monotonic_now();
  // The PDU is lost, as on the line; not at once the next one too.
  if (!written) {
    line_free_at_ = now + seconds(1);
    report_problem(written.error());
    return false;
  }
  line_free_at_ = std::max(line_free_at_, now) +
                  nanoseconds(static_cast<std::int64_t>(static_cast<double>(cltu->size()) * octet_time_ns_));
  return true;
}

Result<void, std::string> DirectLink::on_time() {
  const MonotonicTime now = monotonic_now();
  if (const auto flushed = port_.flush(now); !flushed) report_problem(flushed.error());
  ad_.on_time(now);
  handle_ad();
  move_files(now);
  if (floor_file_) floor_file_->sync(now);
  return {};
}

std::optional<MonotonicTime> DirectLink::next_deadline() const {
  auto deadline = ad_.deadline();
  if (files_ && !port_.has_waiting()) {
    if (const auto due = files_->entity().next_due(monotonic_now())) {
      const MonotonicTime at = std::max(*due, line_free_at_ - line_ahead);
      if (!deadline || at < *deadline) deadline = at;
    }
  }
  return deadline;
}

}  // namespace srfs::ground
