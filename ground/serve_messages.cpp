// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/serve_messages.hpp"

#include <array>
#include <stdexcept>

#include "ground/files.hpp"

namespace srfs::ground::serve {
namespace {

constexpr std::array ad_texts{"transmitted", "delivered", "undelivered", "not_sent", "unknown"};

/// An enum by its number, up to the last of its values.
template <class E>
E enum_of(const nlohmann::json& value, E last) {
  const auto number = value.get<std::uint64_t>();
  if (number > static_cast<std::uint64_t>(last)) throw std::invalid_argument("number outside its range");
  return static_cast<E>(number);
}

template <class E>
int number_of(E value) {
  return static_cast<int>(value);
}

cfdp::TransactionId id_of(const nlohmann::json& text) {
  const auto id = parse_transaction(text.get<std::string>());
  if (!id) throw std::invalid_argument("not a transaction id");
  return *id;
}

cfdp::Report report_of(const nlohmann::json& json) {
  cfdp::Report report;
  report.id = id_of(json.at("id"));
  report.role = enum_of(json.at("role"), cfdp::Role::receiving);
  report.source_file = json.at("source").get<std::string>();
  report.destination_file = json.at("destination").get<std::string>();
  if (!json.at("octets").is_null()) report.file_octets = json.at("octets").get<std::uint64_t>();
  report.progress_octets = json.at("progress").get<std::uint64_t>();
  report.missing_octets = json.at("missing").get<std::uint64_t>();
  report.waits_for_peer = json.at("waits").get<bool>();
  report.rest = enum_of(json.at("rest"), cfdp::Rest::by_fault);
  report.operation = json.at("operation").get<std::uint64_t>();
  report.cancelled = json.at("cancelled").get<bool>();
  return report;
}

}  // namespace

nlohmann::json to_message(const ReceivedPacket& received) {
  nlohmann::json json{{"type", "packet"}, {"vc", received.vc}, {"octets", to_hex(received.raw)}};
  if (received.authenticity != Authenticity::not_judged)
    json["verified"] = received.authenticity == Authenticity::verified;
  return json;
}

ReceivedPacket packet_of(const nlohmann::json& message) {
  ReceivedPacket received;
  received.vc = message.at("vc").get<std::uint8_t>();
  received.raw = octets_of(message.at("octets"));
  auto telemetry = telemetry_in(received.raw);
  if (!telemetry) throw std::invalid_argument("not a telemetry packet");
  received.packet = std::move(*telemetry);
  received.archive_id = message.value("id", std::int64_t{0});
  if (message.contains("verified"))
    received.authenticity =
        message.at("verified").get<bool>() ? Authenticity::verified : Authenticity::unverified;
  return received;
}

nlohmann::json to_message(const SeenTelecommand& seen) {
  return {{"type", "telecommand"},
          {"request", to_message(seen.request)},
          {"name", seen.name},
          {"who", seen.who},
          {"scheduled", seen.scheduled}};
}

SeenTelecommand telecommand_of(const nlohmann::json& message) {
  return {.request = request_of(message.at("request")),
          .name = message.at("name").get<std::string>(),
          .who = message.at("who").get<std::string>(),
          .scheduled = message.at("scheduled").get<bool>()};
}

nlohmann::json to_message(const CopReport& report) {
  nlohmann::json json{{"type", "cop"},
                      {"phase", number_of(report.phase)},
                      {"state", number_of(report.state)},
                      {"vs", report.vs},
                      {"nnr", report.nnr},
                      {"outstanding", report.outstanding},
                      {"queued", report.queued},
                      {"repeated", report.repeated},
                      {"clcw", nullptr},
                      {"bad_clcws", report.bad_clcws},
                      {"problem", report.problem}};
  if (report.clcw) json["clcw"] = wire::encode_clcw(*report.clcw);
  return json;
}

CopReport cop_of(const nlohmann::json& message) {
  CopReport report;
  report.phase = enum_of(message.at("phase"), AdPhase::on);
  report.state = enum_of(message.at("state"), wire::FopState::initial);
  report.vs = message.at("vs").get<std::uint8_t>();
  report.nnr = message.at("nnr").get<std::uint8_t>();
  report.outstanding = message.at("outstanding").get<std::size_t>();
  report.queued = message.at("queued").get<std::size_t>();
  report.repeated = message.at("repeated").get<std::uint64_t>();
  if (!message.at("clcw").is_null()) {
    const auto clcw = wire::decode_clcw(message.at("clcw").get<std::uint32_t>());
    if (clcw) report.clcw = *clcw;
  }
  report.bad_clcws = message.at("bad_clcws").get<std::uint64_t>();
  report.problem = message.at("problem").get<std::string>();
  return report;
}

nlohmann::json to_message(const DownlinkCounters& c) {
  return {{"octets", c.octets},
          {"frames", c.frames},
          {"idle_frames", c.idle_frames},
          {"bad_frames", c.bad_frames},
          {"lost_frames", c.lost_frames},
          {"corrected_octets", c.corrected_octets},
          {"noise_octets", c.noise_octets},
          {"packets", c.packets},
          {"packet_octets", c.packet_octets},
          {"bad_packets", c.bad_packets},
          {"authenticated", c.authenticated},
          {"forged_frames", c.forged_frames},
          {"replayed_frames", c.replayed_frames},
          {"old_frames", c.old_frames}};
}

DownlinkCounters counters_of(const nlohmann::json& message) {
  const auto number = [&message](const char* name) { return message.at(name).get<std::uint64_t>(); };
  return {.octets = number("octets"),
          .frames = number("frames"),
          .idle_frames = number("idle_frames"),
          .bad_frames = number("bad_frames"),
          .lost_frames = number("lost_frames"),
          .corrected_octets = number("corrected_octets"),
          .noise_octets = number("noise_octets"),
          .packets = number("packets"),
          .packet_octets = number("packet_octets"),
          .bad_packets = number("bad_packets"),
          .authenticated = message.value("authenticated", false),
          .forged_frames = message.value("forged_frames", std::uint64_t{0}),
          .replayed_frames = message.value("replayed_frames", std::uint64_t{0}),
          .old_frames = message.value("old_frames", std::uint64_t{0})};
}

nlohmann::json to_message(const cfdp::Report& report) {
  nlohmann::json json{{"id", ground::to_text(report.id)},
                      {"role", number_of(report.role)},
                      {"source", report.source_file},
                      {"destination", report.destination_file},
                      {"octets", nullptr},
                      {"progress", report.progress_octets},
                      {"missing", report.missing_octets},
                      {"waits", report.waits_for_peer},
                      {"rest", number_of(report.rest)},
                      {"operation", report.operation},
                      {"cancelled", report.cancelled}};
  if (report.file_octets) json["octets"] = *report.file_octets;
  return json;
}

nlohmann::json to_message(const std::vector<cfdp::Report>& transfers) {
  constexpr std::size_t most = 256;  // a message has a bound; there are far fewer at once
  nlohmann::json list = nlohmann::json::array();
  for (std::size_t i = 0; i < transfers.size() && i < most; ++i) list.push_back(to_message(transfers[i]));
  return list;
}

std::vector<cfdp::Report> transfers_of(const nlohmann::json& message) {
  std::vector<cfdp::Report> transfers;
  for (const auto& entry : message) transfers.push_back(report_of(entry));
  return transfers;
}

nlohmann::json to_message(const cfdp::News& news) {
  const cfdp::Event& event = news.event;
  nlohmann::json json{{"type", "file"},
                      {"kind", number_of(event.kind)},
                      {"id", ground::to_text(event.id)},
                      {"role", number_of(event.role)},
                      {"condition", number_of(event.outcome.condition)},
                      {"incomplete", event.outcome.incomplete},
                      {"file_status", number_of(event.outcome.file_status)},
                      {"handler", number_of(event.handler)},
                      {"fault", nullptr},
                      {"file", to_message(news.file)}};
  if (event.file_fault) json["fault"] = number_of(*event.file_fault);
  return json;
}

cfdp::News news_of(const nlohmann::json& message) {
  cfdp::News news;
  news.event.kind = enum_of(message.at("kind"), cfdp::EventKind::checkpoint_failed);
  news.event.id = id_of(message.at("id"));
  news.event.role = enum_of(message.at("role"), cfdp::Role::receiving);
  news.event.outcome.condition = enum_of(message.at("condition"), static_cast<cfdp::CfdpCondition>(15));
  news.event.outcome.incomplete = message.at("incomplete").get<bool>();
  news.event.outcome.file_status = enum_of(message.at("file_status"), wire::CfdpFileStatus::unreported);
  news.event.handler = enum_of(message.at("handler"), cfdp::FaultHandler::abandon);
  if (!message.at("fault").is_null())
    news.event.file_fault = enum_of(message.at("fault"), cfdp::FileFault::io);
  news.file = report_of(message.at("file"));
  return news;
}

nlohmann::json to_message(wire::RequestId request) {
  return nlohmann::json::array({request.packet_identification, request.packet_sequence_control});
}

wire::RequestId request_of(const nlohmann::json& message) {
  return {.packet_identification = message.at(0).get<std::uint16_t>(),
          .packet_sequence_control = message.at(1).get<std::uint16_t>()};
}

Octets octets_of(const nlohmann::json& hexadecimal) {
  auto octets = from_hex(hexadecimal.get<std::string>());
  if (!octets) throw std::invalid_argument("not hexadecimal digits");
  return std::move(*octets);
}

std::string_view to_text(AdProgress progress) {
  return ad_texts.at(static_cast<std::size_t>(progress));
}

AdProgress ad_progress_of(const nlohmann::json& message) {
  const auto text = message.at("progress").get<std::string>();
  for (std::size_t i = 0; i < ad_texts.size(); ++i) {
    if (text == ad_texts.at(i)) return static_cast<AdProgress>(i);
  }
  throw std::invalid_argument("no progress of the AD service: " + text);
}

std::optional<ServerStatus> status_of(const nlohmann::json& welcome) {
  try {
    return ServerStatus{.clients = welcome.at("clients").get<std::size_t>(),
                        .line_open = welcome.at("line_open").get<bool>(),
                        .locked = welcome.at("locked").get<bool>(),
                        .counters = counters_of(welcome.at("counters")),
                        .cop = cop_of(welcome.at("service")),
                        .archive_problem = welcome.value("archive_problem", "")};
  } catch (const std::exception&) {
    return std::nullopt;
  }
}

std::string text_of(const nlohmann::json& message) {
  return message.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace srfs::ground::serve
