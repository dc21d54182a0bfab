// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/station.hpp"

#include <algorithm>
#include <utility>

#include <mission/structures.hpp>

#include "ground/arming.hpp"
#include "wire/space_packet.hpp"

namespace srfs::ground {
namespace {

constexpr milliseconds line_ahead{20};  ///< of file data in the driver; a telecommand waits no longer

}  // namespace

Station::Station(const mission::Dictionary& dictionary, const suite::LinkSettings& link, Port port,
                 Uplink uplink, StationOutput output, wire::FopSettings fop)
    : dictionary_(dictionary),
      port_(std::move(port)),
      downlink_(link),
      uplink_(std::move(uplink)),
      commanding_(dictionary),
      ad_(uplink_.vc(), fop),
      octet_time_ns_(10e9 / static_cast<double>(link.baud)),  // 8N1
      output_(std::move(output)) {}

Result<wire::RequestId, std::string> Station::send(const std::string& command,
                                                   const std::vector<std::string>& arguments,
                                                   std::optional<milliseconds> patience, std::uint64_t tag) {
  const auto encoded = dictionary_.encode(command, arguments);
  if (!encoded) return Err(encoded.error().message);
  return dispatch(*encoded, patience, tag, std::nullopt);
}

Result<wire::RequestId, std::string> Station::send_at(UtcTime release, const std::string& command,
                                                      const std::vector<std::string>& arguments,
                                                      std::optional<milliseconds> patience,
                                                      std::uint64_t tag) {
  const auto encoded = dictionary_.encode(command, arguments);
  if (!encoded) return Err(encoded.error().message);
  const auto made = uplink_.make_packet(*encoded);
  if (!made) return Err(made.error());
  constexpr int decimals = 9;
  const auto insertion =
      dictionary_.encode(mission::ScheduleInsert::name,
                         {"release=" + to_iso8601(release, decimals), "request=" + to_hex(made->packet)});
  if (!insertion) return Err(insertion.error().message);
  const auto left = std::chrono::ceil<milliseconds>(release - system_utc_now());
  const milliseconds wait =
      std::max(left, milliseconds(0)) + patience.value_or(encoded->command->timeout + report_margin);
  return dispatch(*insertion, std::nullopt, tag, Scheduled{made->request, encoded->command, wait});
}

void Station::follow(const wire::RequestId& insertion, const std::optional<Scheduled>& scheduled,
                     std::uint64_t tag, MonotonicTime now) {
  if (!scheduled) return;
  if (insertions_.size() == max_insertions) insertions_.erase(insertions_.begin());
  insertions_[insertion] = scheduled->request;
  commanding_.follow_scheduled(scheduled->request, *scheduled->command, scheduled->patience, tag, now);
}

void Station::on_insertion(const StageReport& report, MonotonicTime now) {
  const wire::RequestId telecommand = insertions_.at(report.request);
  if (!report.is_final()) return;
  insertions_.erase(report.request);
  if (report.outcome == Outcome::timed_out) return;  // it may be there all the same
  const auto inserted = commanding_.on_inserted(telecommand, report.is_completed(), now);
  if (inserted && output_.stage) output_.stage(*inserted);
}

Result<wire::RequestId, std::string> Station::dispatch(const mission::EncodedCommand& encoded_command,
                                                       std::optional<milliseconds> patience,
                                                       std::uint64_t tag,
                                                       const std::optional<Scheduled>& scheduled) {
  const mission::EncodedCommand* const encoded = &encoded_command;
  const bool retrieves = encoded->command->service == mission::StorageRetrieve::service &&
                         encoded->command->subtype == mission::StorageRetrieve::subtype;
  if (retrieves && retrievals_.size() == max_retrievals)
    return Err(std::string("too many retrievals are in progress"));
  const milliseconds wait = patience.value_or(encoded->command->timeout + report_margin);
  const auto expect_packets = [&] {
    if (!retrieves) return;
    const auto request = mission::StorageRetrieve::decode(encoded->data);
    if (request) retrievals_.emplace_back(tag, request->front().store);
  };
  if (encoded->command->name == mission::TtcSelectKeys::name &&
      asked_keys_.size() < Commanding::max_outstanding) {
    const auto select = mission::TtcSelectKeys::decode(OctetView(encoded->data).subspan(2));
    if (select && select->vc == uplink_.vc())
      asked_keys_[tag] =
          select->set == mission::KeySet::b ? suite::AssociationSet::b : suite::AssociationSet::a;
  }
  if (ad_.phase() != AdPhase::off) {
    const auto request = send_by_ad(*encoded, wait, tag, monotonic_now());
    if (request) {
      expect_packets();
      follow(*request, scheduled, tag, monotonic_now());
    }
    handle_ad();
    return request;
  }
  auto telecommand = uplink_.make(*encoded);
  if (!telecommand) return Err(telecommand.error());
  if (const auto written = port_.write(telecommand->cltu, write_patience); !written)
    return Err(written.error());
  const MonotonicTime now = monotonic_now();
  expect_packets();
  follow(telecommand->request, scheduled, tag, now);
  on_stage(commanding_.sent(telecommand->request, *encoded->command, wait, tag, now), now);
  return telecommand->request;
}

Result<wire::RequestId, std::string> Station::send_by_ad(const mission::EncodedCommand& command,
                                                         milliseconds patience, std::uint64_t tag,
                                                         MonotonicTime now) {
  auto made = uplink_.make_packet(command);
  if (!made) return Err(made.error());
  const std::uint64_t number = next_ad_number_++;
  ad_telecommands_[number] = {made->request, command.command, patience, tag};
  if (!ad_.request(number, std::move(made->packet), now)) {
    ad_telecommands_.erase(number);
    return Err(std::string("too many telecommands are waiting for the AD service"));
  }
  return made->request;
}

Result<wire::RequestId, std::string> Station::arm(const std::string& command,
                                                  const std::vector<std::string>& arguments,
                                                  std::optional<milliseconds> patience, std::uint64_t tag,
                                                  std::optional<UtcTime> release) {
  const auto encoded = dictionary_.encode(command, arguments);
  if (!encoded) return Err(encoded.error().message);
  const TelecommandText arming = arming_of(*encoded);
  return release ? send_at(*release, arming.name, arming.arguments, patience, tag)
                 : send(arming.name, arming.arguments, patience, tag);
}

void Station::start_ad() {
  ad_.start(monotonic_now());
  handle_ad();
}

void Station::stop_ad() {
  ad_.stop(monotonic_now());
  handle_ad();
}

void Station::unlock() {
  ad_.unlock(monotonic_now());
  handle_ad();
}

void Station::set_vr(std::uint8_t vr) {
  ad_.set_vr(vr, monotonic_now());
  handle_ad();
}

void Station::handle_ad() {
  using Kind = AdSignal::Kind;
  while (const auto signal = ad_.next_signal()) {
    const MonotonicTime now = monotonic_now();
    const auto telecommand = ad_telecommands_.find(signal->tag);
    switch (signal->kind) {
      case Kind::transmit_ad:
      case Kind::transmit_bc:
        transmit_ad(*signal);
        break;
      case Kind::delivered:
      case Kind::undelivered:  // it may have arrived: its reports or its patience decide
        if (telecommand == ad_telecommands_.end()) break;
        commanding_.extend(telecommand->second.request, now);
        ad_telecommands_.erase(telecommand);
        break;
      case Kind::not_sent: {
        if (telecommand == ad_telecommands_.end()) break;
        StageReport report;
        report.request = telecommand->second.request;
        report.command = telecommand->second.command;
        report.tag = telecommand->second.tag;
        report.outcome = Outcome::not_sent;
        report.failure_text = "the AD service ended before the telecommand was transmitted";
        ad_telecommands_.erase(telecommand);
        on_stage(report, now);
        break;
      }
      case Kind::changed:
        if (output_.cop) output_.cop(ad_.report());
        break;
    }
  }
}

void Station::transmit_ad(const AdSignal& signal) {
  const auto complain = [this](const std::string& problem) {
    if (output_.problem) output_.problem(problem);
  };
  Result<Octets, std::string> cltu = signal.kind == AdSignal::Kind::transmit_bc
                                         ? uplink_.make_bc_cltu(signal.control)
                                         : uplink_.make_ad_cltu(signal.sequence, signal.packet);
  bool written = false;
  if (!cltu) {
    complain(cltu.error());
  } else if (const auto put = port_.write(*cltu, write_patience); !put) {
    complain(put.error());
  } else {
    written = true;
  }
  const MonotonicTime now = monotonic_now();
  const auto telecommand = ad_telecommands_.find(signal.tag);
  if (written && signal.kind == AdSignal::Kind::transmit_ad && telecommand != ad_telecommands_.end()) {
    AdTelecommand& t = telecommand->second;
    if (std::exchange(t.transmitted, true)) {
      commanding_.extend(t.request, now);
    } else {
      on_stage(commanding_.sent(t.request, *t.command, t.patience, t.tag, now), now);
    }
  }
  ad_.on_transmitted(signal.kind, written, now);
}

Result<void, std::string> Station::on_readable() {
  const auto octets = port_.read();
  if (!octets) return Err(octets.error());
  const MonotonicTime now = monotonic_now();
  const auto packets = downlink_.push(*octets);
  for (const std::uint32_t word : downlink_.take_control_words()) {
    ad_.on_control_word(word, now);
    handle_ad();
  }
  for (const auto& received : packets) on_packet(received, now);
  const auto pdus = downlink_.take_file_pdus();
  if (files_) {
    for (const Octets& pdu : pdus) files_->on_pdu(pdu, now);
    move_files(now);
  }
  return {};
}

void Station::carry_files(std::unique_ptr<cfdp::TransferFolders> transfer_folders) {
  files_ = std::move(transfer_folders);
  files_->scan();
  files_->on_contact(monotonic_now());
}

void Station::move_files(MonotonicTime now) {
  if (!files_) return;
  const std::size_t octets_max = uplink_.packet_octets_max() - wire::packet_header_octets;
  while (line_free_at_ <= now + line_ahead) {
    const auto pdu = files_->next_pdu(octets_max, now);
    if (!pdu || !send_pdu(*pdu)) break;
  }
  files_->entity().advance(now);
  for (const cfdp::News& news : files_->take_news()) {
    if (output_.file) output_.file(news);
  }
}

bool Station::send_pdu(OctetView pdu) {
  const Octets packet = wire::encode_space_packet({.type = wire::PacketType::telecommand,
                                                   .apid = wire::cfdp_apid,
                                                   .sequence_count = file_sequence_count_},
                                                  pdu);
  file_sequence_count_ = static_cast<std::uint16_t>((file_sequence_count_ + 1) & 0x3FFF);
  const auto cltu = uplink_.make_file_cltu(packet);
  const auto written =
      cltu ? port_.write(*cltu, write_patience) : Result<void, std::string>(Err(cltu.error()));
  const MonotonicTime now = monotonic_now();
  // The PDU is lost, as on the line; not at once the next one too.
  if (!written) {
    line_free_at_ = now + seconds(1);
    if (output_.problem) output_.problem(written.error());
    return false;
  }
  line_free_at_ = std::max(line_free_at_, now) +
                  nanoseconds(static_cast<std::int64_t>(static_cast<double>(cltu->size()) * octet_time_ns_));
  return true;
}

void Station::on_packet(const ReceivedPacket& received, MonotonicTime now) {
  for (auto& retrieval : retrievals_) {
    if (received.vc == tm_channel::playback) commanding_.extend(retrieval.tag(), now);
    if (retrieval.on_packet(received, now)) break;
  }
  if (received.vc != tm_channel::playback) {
    if (const auto report = commanding_.on_packet(received.packet, now)) {
      on_stage(*report, now);
      return;
    }
  }
  const TelemetryReport report = decode_telemetry(dictionary_, received);
  if (report.kind == TelemetryKind::beacon && received.vc == tm_channel::live) {
    follow_counters(report);
  }
  if (output_.telemetry) output_.telemetry(report);
  end_retrievals(now);
}

/// Of the spacecraft's associations, as its beacon reports them.
void Station::follow_counters(const TelemetryReport& beacon) {
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
    if (warning && output_.problem) output_.problem(*warning);
  }
  const auto spi = static_cast<std::uint16_t>(*number("sdls_spi.bd"));
  if (const auto set = uplink_.set_of(spi)) follow_keys(*set, "the beacon");
}

void Station::on_stage(const StageReport& stage, MonotonicTime now) {
  StageReport report = stage;
  report.insertion = insertions_.contains(report.request);
  if (output_.stage) output_.stage(report);
  if (report.insertion) on_insertion(report, now);
  for (auto& retrieval : retrievals_) retrieval.on_stage(report, now);
  if (const auto asked = asked_keys_.find(report.tag); asked != asked_keys_.end() && report.is_final()) {
    // Even if it could not be stored, it holds until the spacecraft's next restart; the beacon shows it.
    if (report.is_completed()) follow_keys(asked->second, "ttc.select_keys");
    asked_keys_.erase(report.tag);
  }
  end_retrievals(now);
}

void Station::follow_keys(suite::AssociationSet set, const std::string& why) {
  const auto changed = uplink_.select(set);
  if (!changed && output_.problem) output_.problem(changed.error());
  if (changed && *changed && output_.keys) output_.keys(set, why);
}

void Station::end_retrievals(MonotonicTime now) {
  std::vector<Retrieval> over;
  std::erase_if(retrievals_, [&](const Retrieval& r) {
    if (r.is_over(now)) over.push_back(r);
    return r.is_over(now);
  });
  for (const auto& retrieval : over) {
    if (output_.retrieval_over) output_.retrieval_over(retrieval);
  }
}

void Station::on_time() {
  const MonotonicTime now = monotonic_now();
  ad_.on_time(now);
  handle_ad();
  for (const auto& report : commanding_.on_time(now)) on_stage(report, now);
  end_retrievals(now);
  move_files(now);
}

std::optional<MonotonicTime> Station::next_deadline() const {
  auto deadline = commanding_.next_deadline();
  if (const auto ad = ad_.deadline(); ad && (!deadline || *ad < *deadline)) deadline = ad;
  if (!retrievals_.empty()) {
    const MonotonicTime look = monotonic_now() + milliseconds(200);
    if (!deadline || look < *deadline) deadline = look;
  }
  if (files_) {
    if (const auto due = files_->entity().next_due(monotonic_now())) {
      const MonotonicTime at = std::max(*due, line_free_at_ - line_ahead);
      if (!deadline || at < *deadline) deadline = at;
    }
  }
  return deadline;
}

}  // namespace srfs::ground
