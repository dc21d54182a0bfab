// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/api/api.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <fmt/format.h>
#include <unistd.h>
#include <mission/structures.hpp>

#include "base/file.hpp"
#include "base/octets.hpp"
#include "base/sha256.hpp"
#include "base/text.hpp"
#include "ground/api/web_files.hpp"
#include "ground/archive/archive_report.hpp"
#include "ground/archive/recorder.hpp"
#include "ground/dictionary_json.hpp"
#include "ground/files.hpp"
#include "ground/station_status.hpp"

namespace srfs::ground::api {
namespace {

constexpr std::size_t points_default = 2000;
constexpr std::size_t points_max = 20'000;
constexpr std::size_t replay_packets = 200;  ///< read at once; none is held while a reader is written to
constexpr milliseconds comment_period{10'000};
constexpr milliseconds look_period{1000};  ///< whether a reader is still there
constexpr std::uint8_t verification = 1;
constexpr std::uint8_t event_service = 5;
constexpr std::size_t operator_octets_max = 64;

constexpr std::string_view uploads_folder = "web_uploads";  ///< in STATE: files until the server has a copy

/// What a gateway left that was killed.
void remove_old_uploads(const std::filesystem::path& folder) {
  constexpr std::chrono::hours old{1};
  std::error_code error;
  const auto now = std::filesystem::file_time_type::clock::now();
  for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code unknown;
    if (now - entry->last_write_time(unknown) > old && !unknown)
      std::filesystem::remove(entry->path(), unknown);
  }
}

/// What tells a request from another one of the same client.
std::string digest_of(const HttpRequest& request) {
  std::string text = request.method;
  for (const std::string& segment : request.target.segments) text += "\n" + segment;
  for (const auto& [name, value] : request.target.query) text += "\n" + name + "=" + value;
  text += "\n\n" + request.body;
  return to_hex(sha256_of({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}));
}

/// The token of a telecommand that may be repeated: server and archive know it, also after the end of this
/// process. Of another request with the same key it is another one.
std::string token_of(const HttpRequest& request) {
  if (request.idempotency_key.empty()) return "";
  return fmt::format("web-{}-{}", request.idempotency_key, digest_of(request));
}

std::string query_of(const Target& target, const std::string& name) {
  const auto found = target.query.find(name);
  return found == target.query.end() ? "" : found->second;
}

/// The newest @p most elements.
nlohmann::json newest_of(nlohmann::json list, std::size_t most) {
  if (list.size() > most) list.erase(list.begin(), list.end() - static_cast<std::ptrdiff_t>(most));
  return list;
}

template <class T, class ToJson>
Result<nlohmann::json, std::string> list_of(const Result<std::vector<T>, std::string>& rows, std::size_t most,
                                            const ToJson& to_json_of) {
  if (!rows) return Err(rows.error());
  nlohmann::json list = nlohmann::json::array();
  for (const T& row : *rows) list.push_back(to_json_of(row));
  return newest_of(std::move(list), most);
}

/// What a verification report says of its telecommand.
std::optional<StageReport> stage_of(const StoredPacket& stored, const StoredTelecommand& telecommand,
                                    const mission::Dictionary& dictionary) {
  const auto* command = dictionary.command(telecommand.entry.name);
  if (command == nullptr) return std::nullopt;
  Commanding commanding(dictionary);
  static_cast<void>(commanding.sent(telecommand.entry.request, *command, command->timeout, 0, {}));
  auto report = commanding.on_packet(stored.packet.packet, {});
  if (!report) return std::nullopt;
  report->elapsed = stored.received - telecommand.entry.sent;
  report->archive_id = stored.id;
  report->who = telecommand.entry.who;
  return report;
}

nlohmann::json number_or_null(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

nlohmann::json point_json(const Point& point, bool minutes) {
  const Aggregate& values = point.values;
  nlohmann::json json{{"time", to_iso8601(point.time)}};
  if (minutes)
    json.update({{"min", number_or_null(values.min)},
                 {"mean", number_or_null(values.mean)},
                 {"max", number_or_null(values.max)},
                 {"count", values.count}});
  else
    json["value"] = number_or_null(values.mean);
  if (values.worst > mission::LimitState::green || minutes) json["limit"] = to_text(values.worst);
  return json;
}

std::string unit_of(const mission::Dictionary& dictionary, const std::string& parameter) {
  for (const auto& structure : dictionary.structures()) {
    if (!parameter.starts_with(structure.name + ".")) continue;
    const std::string field = parameter.substr(structure.name.size() + 1);
    for (const auto& each : structure.fields) {
      const bool element = each.count > 1 && field.starts_with(each.name);
      if (each.name == field || element) return each.unit;
    }
  }
  return "";
}

/// A reader is given up when it takes nothing for a while, not when there is much for it.
bool write_in_parts(Transport& transport, std::string_view text) {
  constexpr std::size_t part = 65'536;
  for (; !text.empty(); text.remove_prefix(std::min(part, text.size()))) {
    if (!transport.write(text.substr(0, part), monotonic_now() + HttpServer::write_patience)) return false;
  }
  return true;
}

nlohmann::json beacon_keys(const Snapshot& snapshot) {
  nlohmann::json keys{{"set", nullptr}};
  if (!snapshot.keys.empty()) keys["set"] = snapshot.keys;
  if (const auto* beacon = snapshot.latest.structure("beacon")) {
    const auto json = to_json(beacon->report);
    for (const auto& [name, value] : json["fields"].items()) {
      if (name.starts_with("sdls_")) keys[name] = value;
    }
  }
  return keys;
}

}  // namespace

Result<RowQuery, std::string> read_row_query(const Target& target, UtcTime now) {
  RowQuery query;
  for (const auto& [name, end] : {std::pair("from", &query.period.from), std::pair("to", &query.period.to)}) {
    const std::string text = query_of(target, name);
    if (text.empty()) continue;
    *end = parse_moment(text, now);
    if (!*end)
      return Err(fmt::format(
          "'{}': expected a UTC time like 2026-11-21T08:00:00Z, or how long ago: 10m, 2h, 3d", name));
  }
  if (const std::string text = query_of(target, "limit"); !text.empty()) {
    const auto most = to_number<std::size_t>(text);
    if (!most || *most == 0 || *most > RowQuery::rows_max)
      return Err(fmt::format("'limit': expected 1 to {}", RowQuery::rows_max));
    query.most = *most;
  }
  if (const std::string text = query_of(target, "before"); !text.empty()) {
    query.before = to_number<std::int64_t>(text);
    if (!query.before || *query.before < 0) return Err(std::string("'before': expected the id of a packet"));
  }
  return query;
}

nlohmann::json archived_json(const StoredPacket& stored, Archive& archive,
                             const mission::Dictionary& dictionary) {
  if (stored.packet.packet.service == verification) {
    OctetReader in(stored.packet.packet.source);
    const wire::RequestId request{in.u16(), in.u16()};
    const auto telecommand = archive.telecommand_of(request, stored.received);
    if (in.ok() && telecommand && *telecommand) {
      if (const auto stage = stage_of(stored, **telecommand, dictionary)) return stage_json(*stage, "");
    }
  }
  return to_json(decode_telemetry(dictionary, stored.packet));
}

namespace {

/// nullopt: orders are remembered by this process alone.
std::optional<OrderJournal> open_journal(const std::filesystem::path& file) {
  if (file.empty()) return std::nullopt;
  auto journal = OrderJournal::open(file, AnsweredOrders::kept_max);
  if (journal) return std::move(*journal);
  std::fprintf(stderr, "orders are not remembered beyond the end of this process: %s\n",
               journal.error().c_str());
  return std::nullopt;
}

}  // namespace

Api::Api(const mission::Dictionary& dictionary, Gateway& gateway, Settings settings)
    : dictionary_(dictionary),
      gateway_(gateway),
      settings_(std::move(settings)),
      dictionary_text_(json_response(200, to_json(dictionary)).body),
      answered_(open_journal(settings_.orders_file)) {
  remove_old_uploads(settings_.state_dir / uploads_folder);
}

Result<std::unique_ptr<Archive>, std::string> Api::open() const {
  return open_archive(settings_.archive, ArchiveUse::read);
}

HttpApplication::Admission Api::admit(const HttpRequest& request) {
  if (const auto wrong = wrong_site(request, settings_.site)) return {.refusal = error_response(403, *wrong)};
  if (!is_api(request.target)) {
    if (request.method == "GET") return {};
    HttpResponse refusal = error_response(405, "the page has files alone; the API is at /api/v1");
    refusal.headers["Allow"] = "GET";
    return {.refusal = refusal};
  }
  const auto found = route_of(request.method, request.target);
  const auto* route = std::get_if<Found>(&found);
  const Role role = role_of(request, settings_.tokens, route != nullptr && route->route->token_in_query);
  if (role == Role::stranger) {
    HttpResponse refusal =
        error_response(401, "a token is needed: Authorization: Bearer TOKEN (STATE/web.json)");
    refusal.headers["WWW-Authenticate"] = "Bearer";
    return {.refusal = refusal};
  }
  if (const auto* wrong = std::get_if<WrongMethod>(&found)) {
    HttpResponse refusal = error_response(405, "this method is not one of this resource");
    refusal.headers["Allow"] = wrong->allowed;
    return {.refusal = refusal};
  }
  if (route == nullptr)
    return {.refusal = error_response(404, "no such resource; ground/web/openapi.yaml lists them")};
  if (role < route->route->role)
    return {.refusal = error_response(403, "this token observes; it cannot order")};
  return {.refusal = std::nullopt, .body_max = route->route->body_max, .known = true};
}

HttpResponse Api::answer(const HttpRequest& request) {
  if (!is_api(request.target)) return page_file(settings_.web_root, request.target);
  const auto found = route_of(request.method, request.target);
  const auto* route = std::get_if<Found>(&found);
  if (route == nullptr) return error_response(404, "no such resource");
  const bool orders = route->route->role == Role::commander;
  return orders && !request.idempotency_key.empty() ? answer_once(request, *route)
                                                    : answer_route(request, *route);
}

HttpResponse Api::answer_once(const HttpRequest& request, const Found& found) {
  const std::string& key = request.idempotency_key;
  if (!AnsweredOrders::is_key(key))
    return error_response(400, fmt::format("'Idempotency-Key': expected {} to {} letters, digits, '-' or '_'",
                                           AnsweredOrders::key_octets_min, AnsweredOrders::key_octets_max));
  // The archive knows more of a telecommand than that it was begun: whether it was sent.
  const Endpoint endpoint = found.route->endpoint;
  const bool is_telecommand = endpoint == Endpoint::telecommand || endpoint == Endpoint::retrieve;
  const bool journaled = !is_telecommand || !gateway_.records_telecommands();
  const auto known = answered_.begin(key, digest_of(request), HttpServer::write_patience, journaled);
  if (known) return *known;
  HttpResponse response = unknown_response("the request has failed; whether it was carried out is not known");
  try {
    response = answer_route(request, found);
  } catch (...) {
    answered_.end(key, response);
    throw;
  }
  answered_.end(key, response);
  return response;
}

HttpResponse Api::answer_route(const HttpRequest& request, const Found& found) {
  const Target& target = request.target;
  switch (found.route->endpoint) {
    case Endpoint::dictionary:
      return {.status = 200, .body = dictionary_text_};
    case Endpoint::station:
      return get_station();
    case Endpoint::latest:
      return get_latest();
    case Endpoint::stream:
      return error_response(429, "too many readers of the stream; try again");
    case Endpoint::history:
      return get_history(target);
    case Endpoint::transfers:
      if (query_of(target, "live") == "true") return get_live_transfers();
      return get_rows(target, found.route->endpoint);
    case Endpoint::packets:
    case Endpoint::events:
    case Endpoint::commands:
    case Endpoint::gaps:
    case Endpoint::passes:
      return get_rows(target, found.route->endpoint);
    case Endpoint::files:
      return json_response(200, list_files(settings_.state_dir / "files"));
    case Endpoint::file:
      return received_file(settings_.state_dir / "files", found.parameter, query_of(target, "view"));
    case Endpoint::schedule:
      return get_schedule();
    case Endpoint::telecommand:
      return post_telecommand(request.body, token_of(request));
    case Endpoint::uplink:
      return post_uplink(request);
    case Endpoint::order_transfer:
      return post_transfer(found.parameter, request.body);
    case Endpoint::retrieve:
      return post_retrieve(request.body, token_of(request));
    case Endpoint::fill_gaps:
      return gateway_.order([this] {
        const auto done = gateway_.link().fill_gaps();
        return done ? json_response(202, {{"filling", true}}) : failure_response(done.error(), 409);
      });
    case Endpoint::order_cop:
      return post_cop(request.body);
    case Endpoint::select_keys:
      return post_keys(request.body);
    case Endpoint::acknowledge:
      return post_acknowledge(found.parameter, request.body);
  }
  return error_response(404, "no such resource");
}

HttpResponse Api::get_station() {
  const Snapshot now = gateway_.snapshot();
  StationStatus status;
  if (const auto archive = open()) {
    auto read = read_status(**archive, dictionary_);
    if (!read) return error_response(500, read.error());
    status = std::move(*read);
  }
  status.latest = now.latest;
  status.server = ServerStatus{.clients = 0,
                               .line_open = now.line_open,
                               .locked = now.locked,
                               .counters = now.counters,
                               .cop = now.cop,
                               .archive_problem = now.archive_problem};
  nlohmann::json json = to_json(status, dictionary_, system_utc_now());
  json["server"].erase("clients");
  json["line"] = now.line_open ? "open" : "closed";
  json["locked"] = now.locked;
  json["clcw"] = now.clcw ? nlohmann::json(*now.clcw) : nlohmann::json(nullptr);
  json["cop"] = to_json(now.cop);
  json["keys"] = beacon_keys(now);
  json["mode"] = nullptr;
  json["mode_reason"] = nullptr;
  if (json["beacon"].is_object()) {
    for (const char* field : {"mode", "mode_reason"}) {
      if (json["beacon"]["fields"].contains(field)) json[field] = json["beacon"]["fields"][field];
    }
  }
  json["health"] = nullptr;
  if (const auto* health = now.latest.structure("health")) json["health"] = to_json(health->report);
  json["counters"] = to_json(now.counters);
  json["telecommands_sent"] = now.telecommands_sent;
  json["readers"] = gateway_.stream().readers();
  json["server_time"] = to_iso8601(system_utc_now());
  return json_response(200, json);
}

HttpResponse Api::get_latest() {
  const Snapshot now = gateway_.snapshot();
  nlohmann::json json{{"id", now.newest_id}, {"values", nlohmann::json::object()}, {"beacon", nullptr}};
  for (const auto& [name, entry] : now.latest.all()) {
    nlohmann::json report = to_json(entry.report);
    report["received"] = to_iso8601(entry.received);
    if (entry.report.kind == TelemetryKind::beacon) json["beacon"] = report;
    json["values"][name] = std::move(report);
  }
  return json_response(200, json);
}

HttpResponse Api::get_history(const Target& target) {
  const std::string parameter = query_of(target, "parameter");
  if (parameter.empty()) return error_response(400, "'parameter': expected STRUCTURE.FIELD");
  const auto query = read_row_query(target, system_utc_now());
  if (!query) return error_response(400, query.error());
  std::size_t most = points_default;
  if (const std::string text = query_of(target, "points"); !text.empty()) {
    const auto points = to_number<std::size_t>(text);
    if (!points || *points == 0 || *points > points_max)
      return error_response(400, fmt::format("'points': expected 1 to {}", points_max));
    most = *points;
  }
  const auto archive = open();
  if (!archive) return error_response(500, archive.error());
  const auto points = history(**archive, dictionary_, parameter, query->period, most);
  if (!points) return error_response(400, points.error());
  const bool minutes =
      std::any_of(points->begin(), points->end(), [](const Point& point) { return point.values.count != 1; });
  nlohmann::json json{{"parameter", parameter},
                      {"unit", unit_of(dictionary_, parameter)},
                      {"minutes", minutes},
                      {"points", nlohmann::json::array()}};
  for (const Point& point : *points) json["points"].push_back(point_json(point, minutes));
  return json_response(200, json);
}

HttpResponse Api::get_schedule() {
  const Snapshot now = gateway_.snapshot();
  if (now.schedule.empty()) return json_response(200, nullptr);
  nlohmann::json json = to_json(now.schedule.front());
  for (std::size_t i = 1; i < now.schedule.size(); ++i) {
    const auto more = to_json(now.schedule[i]);
    for (const char* list : {"activities", "groups"}) {
      if (!json.contains(list) || !more.contains(list)) continue;
      json[list].insert(json[list].end(), more[list].begin(), more[list].end());
    }
  }
  json["received"] = to_iso8601(now.schedule_received);
  return json_response(200, json);
}

HttpResponse Api::get_live_transfers() {
  nlohmann::json list = nlohmann::json::array();
  for (const auto& report : gateway_.snapshot().transfers) list.push_back(to_json(report));
  return json_response(200, list);
}

Api::Rows Api::packets_of(Archive& archive, const RowQuery& query, bool events) {
  PacketFilter filter;
  filter.period = query.period;
  filter.newest_first = true;
  filter.most = query.most;
  filter.before_id = query.before;
  if (events) filter.service = event_service;
  std::vector<nlohmann::json> found;
  const auto read = archive.packets(filter, [&](const StoredPacket& stored) {
    nlohmann::json json = to_json(decode_telemetry(dictionary_, stored.packet));
    json["id"] = stored.id;
    json["received"] = to_iso8601(stored.received);
    json["live"] = stored.live;
    json["retrieved"] = stored.retrieved;
    if (!events) json["octets"] = to_hex(stored.packet.raw);
    found.push_back(std::move(json));
    return true;
  });
  if (!read) return Err(read.error());
  std::reverse(found.begin(), found.end());
  for (auto& json : found) {
    if (!events) break;
    const auto acknowledged = archive.acknowledgement_of(json["id"].get<std::int64_t>());
    if (!acknowledged) return Err(acknowledged.error());
    json["acknowledged"] = nullptr;
    if (*acknowledged)
      json["acknowledged"] = {{"time", to_iso8601((*acknowledged)->time)}, {"who", (*acknowledged)->who}};
  }
  return nlohmann::json(found);
}

HttpResponse Api::get_rows(const Target& target, Endpoint endpoint) {
  const UtcTime now = system_utc_now();
  const auto query = read_row_query(target, now);
  if (!query) return error_response(400, query.error());
  const auto opened = open();
  if (!opened) return error_response(500, opened.error());
  Archive& archive = **opened;
  Rows rows = Err(std::string("no such rows"));
  switch (endpoint) {
    case Endpoint::packets:
    case Endpoint::events:
      rows = packets_of(archive, *query, endpoint == Endpoint::events);
      break;
    case Endpoint::commands:
      rows = list_of(archive.telecommands(query->period, query->most), query->most,
                     [&](const auto& row) { return to_json(row, dictionary_, now); });
      break;
    case Endpoint::gaps:
      rows = list_of(archive.gaps(query->period, false), query->most,
                     [&](const auto& row) { return to_json(row, dictionary_); });
      break;
    case Endpoint::passes:
      rows =
          list_of(archive.passes(query->period), query->most, [](const auto& row) { return to_json(row); });
      break;
    default:
      rows = list_of(archive.files(query->period), query->most, [](const auto& row) { return to_json(row); });
      break;
  }
  return rows ? json_response(200, *rows) : error_response(500, rows.error());
}

std::optional<HttpResponse> Api::sent_before(const TelecommandRequest& order) const {
  if (order.token.empty()) return std::nullopt;
  const auto archive = open();
  if (!archive) return std::nullopt;  // the server itself knows the token, too
  const auto request = (*archive)->request_of(order.token);
  if (!request || !*request) return std::nullopt;
  nlohmann::json json{{"token", order.token}, {"id", request_text(**request)}, {"repeated", true}};
  if (order.at) json["id"] = nullptr;  // that is the insertion
  return json_response(202, json);
}

HttpResponse Api::post_telecommand(const std::string& body, const std::string& token) {
  auto order = read_telecommand(body, dictionary_);
  if (!order) return order.error();
  if (order->check) return json_response(200, {{"octets", to_hex(order->encoded)}});
  order->token = token;
  if (const auto known = sent_before(*order)) return *known;
  return gateway_.order([this, &order] { return gateway_.send(*order); });
}

HttpResponse Api::post_uplink(const HttpRequest& request) {
  const std::string name = query_of(request.target, "name");
  if (name.empty()) return error_response(400, "'name': expected the file's name on board");
  if (const auto wrong = wrong_name_on_board(name)) return error_response(400, *wrong);
  const auto folder = settings_.state_dir / uploads_folder;
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  const auto file = folder / fmt::format("upload_{}_{}", ::getpid(), uploads_++);
  const auto written = write_file_atomically(file, request.body);
  if (!written) return error_response(503, written.error().message);
  HttpResponse response = gateway_.order([&] {
    const auto put = gateway_.link().put(file, name, false);
    return put ? json_response(202, {{"id", to_text(*put)}}) : gateway_.failure(put.error());
  });
  std::filesystem::remove(file, error);
  return response;
}

HttpResponse Api::post_transfer(const std::string& id, const std::string& body) {
  const auto json = read_object(body);
  if (!json) return json.error();
  const auto transaction = parse_transaction(id);
  const auto order = json->value("order", nlohmann::json());
  using Order = StationLink::TransferOrder;
  const auto what = order == "suspend"  ? std::optional(Order::suspend)
                    : order == "resume" ? std::optional(Order::resume)
                    : order == "cancel" ? std::optional(Order::cancel)
                                        : std::nullopt;
  if (!transaction) return error_response(400, "expected the id of a transfer, as in 1:17");
  if (!what) return error_response(400, "'order': expected suspend, resume or cancel");
  return gateway_.order([&] {
    const auto known = gateway_.link().order_transfer(*transaction, *what);
    if (!known) return gateway_.failure(known.error());
    if (!*known) return error_response(404, "no such transfer is under way");
    return json_response(202, {{"id", id}});
  });
}

HttpResponse Api::post_retrieve(const std::string& body, const std::string& token) {
  const auto json = read_object(body);
  if (!json) return json.error();
  nlohmann::json arguments{{"store", "housekeeping"}};
  for (const char* name : {"from", "to", "store"}) {
    if (json->contains(name)) arguments[name] = (*json)[name];
  }
  const nlohmann::json order{{"name", mission::StorageRetrieve::name}, {"arguments", arguments}};
  return post_telecommand(order.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace), token);
}

HttpResponse Api::post_cop(const std::string& body) {
  const auto json = read_object(body);
  if (!json) return json.error();
  const auto order = json->value("order", nlohmann::json());
  const auto vr = json->value("vr", nlohmann::json());
  constexpr std::uint64_t vr_max = 255;
  const bool sets = order == "set_vr";
  if (sets && (!vr.is_number_unsigned() || vr.get<std::uint64_t>() > vr_max))
    return error_response(400, "'vr': expected 0 to 255");
  if (!sets && order != "ad_on" && order != "ad_off" && order != "unlock")
    return error_response(400, "'order': expected ad_on, ad_off, unlock or set_vr");
  const bool drops = json->value("drop", nlohmann::json(false)) == true;
  return gateway_.order([&] {
    ServedLink& link = gateway_.link();
    // All pages and programs of the API are one user of the service: one of them ends it for all.
    if (const std::size_t waiting = gateway_.in_ad(); order == "ad_off" && waiting != 0 && !drops)
      return json_response(
          409, {{"error", fmt::format("the AD service has {} telecommands of this API under way; \"drop\": "
                                      "true ends it all the same",
                                      waiting)},
                {"under_way", waiting}});
    Result<void, OrderError> done;
    if (order == "ad_off") done = link.stop_ad();
    if (order == "ad_on") done = link.start_ad();
    if (order == "unlock") done = link.unlock();
    if (sets) done = link.set_vr(static_cast<std::uint8_t>(vr.get<std::uint64_t>()));
    return done ? json_response(202, {{"cop", to_json(link.cop())}}) : gateway_.failure(done.error());
  });
}

HttpResponse Api::post_keys(const std::string& body) {
  const auto json = read_object(body);
  if (!json) return json.error();
  const auto keys = json->value("keys", nlohmann::json());
  const auto set = keys.is_string() ? key_set_of(keys.get<std::string>()) : std::nullopt;
  if (!set || *set == suite::AssociationSet::contingency)
    return error_response(400, "'keys': expected a or b");
  return gateway_.order([&] {
    const auto done = gateway_.link().select_keys(*set, "ordered by the web");
    return done ? json_response(202, {{"keys", to_text(*set)}}) : gateway_.failure(done.error());
  });
}

HttpResponse Api::post_acknowledge(const std::string& id, const std::string& body) {
  const auto number = to_number<std::int64_t>(id);
  if (!number || *number <= 0) return error_response(400, "expected the id of an event");
  std::string who = "web";
  if (!body.empty()) {
    const auto json = read_object(body);
    if (!json) return json.error();
    const auto given = json->value("who", nlohmann::json(who));
    if (!given.is_string() || given.get<std::string>().size() > operator_octets_max)
      return error_response(400,
                            fmt::format("'who': expected a text of at most {} octets", operator_octets_max));
    who = given.get<std::string>();
  }
  return gateway_.order([&] {
    const auto done = gateway_.link().acknowledge(*number, who);
    return done ? json_response(200, {{"id", *number}, {"who", who}}) : failure_response(done.error(), 409);
  });
}

bool Api::replay(Transport& transport, std::int64_t& last) {
  if (!gateway_.has_archive()) return true;
  const auto told_that_some_is_missing = [&](const std::string& why) {
    const nlohmann::json note{
        {"type", "note"},
        {"problem", true},
        {"message", fmt::format("the archive cannot be read: {}; what came before now is not shown", why)}};
    return write_in_parts(transport, *stream_item(0, note).text);
  };
  const auto archive = open();
  if (!archive) return told_that_some_is_missing(archive.error());
  if (const auto newest = (*archive)->newest_packet()) last = std::min(last, *newest);
  for (bool more = true; more;) {
    std::string text;
    PacketFilter filter;
    filter.after_id = last;
    filter.most = replay_packets;
    std::vector<StoredPacket> packets;
    const auto read = (*archive)->packets(filter, [&packets](const StoredPacket& stored) {
      packets.push_back(stored);
      return true;
    });
    if (!read) return told_that_some_is_missing(read.error());
    for (const StoredPacket& stored : packets) {
      nlohmann::json json = archived_json(stored, **archive, dictionary_);
      json["received"] = to_iso8601(stored.received);  // what is replayed is no news
      text += *stream_item(stored.id, json).text;
      last = stored.id;
    }
    more = packets.size() == replay_packets;
    if (!write_in_parts(transport, text)) return false;
  }
  return true;
}

bool Api::stream(const HttpRequest& request, Transport& transport) {
  if (!is_api(request.target)) return false;
  const auto found = route_of(request.method, request.target);
  const auto* route = std::get_if<Found>(&found);
  if (route == nullptr || route->route->endpoint != Endpoint::stream) return false;
  const auto reader = gateway_.stream().subscribe();
  if (reader == nullptr) return false;
  // Subscribed before the archive is read: what comes meanwhile waits, and is in the archive, too.
  const std::string after =
      request.last_event_id.empty() ? query_of(request.target, "after") : request.last_event_id;
  bool open = write_in_parts(transport, stream_head("text/event-stream") + "retry: 1000\n\n");
  std::int64_t last = 0;
  if (const auto id = to_number<std::int64_t>(after); open && id && *id >= 0) {
    last = *id;
    open = replay(transport, last);
  }
  std::vector<StreamItem> items;
  MonotonicTime next_comment = monotonic_now() + comment_period;
  while (open && reader->wait(look_period, items)) {
    std::string text;
    for (const StreamItem& item : items) {
      if (item.id != 0 && item.id <= last) continue;
      text += *item.text;
    }
    if (monotonic_now() >= next_comment) {
      next_comment = monotonic_now() + comment_period;
      text += ": still here\n\n";
    }
    open = !transport.has_gone() && write_in_parts(transport, text);
  }
  gateway_.stream().unsubscribe(reader);
  return true;
}

}  // namespace srfs::ground::api
