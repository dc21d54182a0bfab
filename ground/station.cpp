#include "ground/station.hpp"

#include <algorithm>

#include <mission/structures.hpp>

namespace srfs::ground {

Station::Station(const mission::Dictionary& dictionary, const ros::LinkSettings& link, Port port,
                 Uplink uplink, StationOutput output)
    : dictionary_(dictionary),
      port_(std::move(port)),
      downlink_(link),
      uplink_(std::move(uplink)),
      commanding_(dictionary),
      output_(std::move(output)) {}

Result<wire::RequestId, std::string> Station::send(const std::string& command,
                                                   const std::vector<std::string>& arguments,
                                                   std::optional<milliseconds> patience, std::uint64_t tag) {
  const auto encoded = dictionary_.encode(command, arguments);
  if (!encoded) return Err(encoded.error().message);
  const bool retrieves = encoded->command->service == mission::StorageRetrieve::service &&
                         encoded->command->subtype == mission::StorageRetrieve::subtype;
  if (retrieves && retrievals_.size() == max_retrievals)
    return Err(std::string("too many retrievals are under way"));
  auto telecommand = uplink_.make(*encoded);
  if (!telecommand) return Err(telecommand.error());
  if (const auto written = port_.write(telecommand->cltu, write_patience); !written)
    return Err(written.error());
  const MonotonicTime now = monotonic_now();
  if (retrieves) {
    const auto request = mission::StorageRetrieve::decode(encoded->data);
    if (request) retrievals_.emplace_back(tag, request->front().store);
  }
  const StageReport report =
      commanding_.sent(telecommand->request, *encoded->command,
                       patience.value_or(encoded->command->timeout + report_margin), tag, now);
  on_stage(report, now);
  return telecommand->request;
}

Result<void, std::string> Station::on_readable() {
  const auto octets = port_.read();
  if (!octets) return Err(octets.error());
  const MonotonicTime now = monotonic_now();
  for (const auto& received : downlink_.push(*octets)) on_packet(received, now);
  return {};
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
    OctetReader in(received.packet.source);
    static_cast<void>(in.u16());
    if (const auto beacon = mission::Beacon::decode(in)) {
      for (std::size_t i = 0; i < beacon->sdls_spi.size(); ++i) {
        uplink_.on_spacecraft_counter(beacon->sdls_spi[i], beacon->sdls_counter[i]);
      }
    }
  }
  if (output_.telemetry) output_.telemetry(report);
  end_retrievals(now);
}

void Station::on_stage(const StageReport& report, MonotonicTime now) {
  if (output_.stage) output_.stage(report);
  for (auto& retrieval : retrievals_) retrieval.on_stage(report, now);
  end_retrievals(now);
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
  for (const auto& report : commanding_.on_time(now)) on_stage(report, now);
  end_retrievals(now);
}

std::optional<MonotonicTime> Station::next_deadline() const {
  auto deadline = commanding_.next_deadline();
  if (!retrievals_.empty()) {
    const MonotonicTime look = monotonic_now() + milliseconds(200);
    if (!deadline || look < *deadline) deadline = look;
  }
  return deadline;
}

}  // namespace srfs::ground
