// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/served_link.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include "base/random_octets.hpp"
#include "ground/files.hpp"
#include "ground/local_socket.hpp"
#include "ground/uplink.hpp"

namespace srfs::ground {
namespace {

constexpr milliseconds seek_period{100};
constexpr std::size_t messages_a_turn = 256;
constexpr int servers_of_a_telecommand = 5;

nlohmann::json described(const mission::EncodedCommand& command) {
  return {{"name", command.command->name},
          {"apid", command.command->apid},
          {"service", command.command->service},
          {"subtype", command.command->subtype},
          {"data", to_hex(command.data)}};
}

/// A message of the server, or nullopt: it is none.
std::optional<nlohmann::json> parse(const std::string& text) {
  auto json = nlohmann::json::parse(text, nullptr, false);
  return json.is_object() && json.contains("type") ? std::optional(std::move(json)) : std::nullopt;
}

/// They say how things are; those of a server that has ended say it no longer.
bool is_state(const nlohmann::json& message) {
  const auto& type = message["type"];
  return type == "state" || type == "cop" || type == "transfers";
}

std::string text(const nlohmann::json& message, const char* name) {
  return message.contains(name) && message[name].is_string() ? message[name].get<std::string>() : "";
}

Result<nlohmann::json, OrderError> judged(nlohmann::json reply) {
  if (!reply.contains("error")) return reply;
  const std::string why = text(reply, "error");
  if (reply.value("unknown", false)) return not_known(why);
  return refused(why);
}

}  // namespace

Result<std::optional<ServerConnection>, std::string> ServerConnection::open(
    const std::filesystem::path& socket, Hello hello) {
  ServerConnection connection(socket, std::move(hello));
  const auto connected = connection.connect();
  if (!connected) return Err(connected.error());
  if (!*connected) return std::optional<ServerConnection>();
  return std::optional<ServerConnection>(std::move(connection));
}

Result<bool, std::string> ServerConnection::connect() {
  auto socket = connect_to(path_);
  if (!socket) return Err(socket.error());
  if (!*socket) return false;
  socket_ = std::move(**socket);
  nlohmann::json hello{{"type", "hello"},
                       {"protocol", serve::protocol},
                       {"verb", hello_.verb},
                       {"files", hello_.files},
                       {"octets", hello_.octets}};
  if (hello_.telecommands) hello["telecommands"] = true;
  if (hello_.keys) hello["keys"] = to_text(*hello_.keys);
  if (seen_ != 0) hello["after"] = seen_;
  if (ad_wanted_) hello["ad"] = true;
  const MonotonicTime deadline = monotonic_now() + reply_patience;
  // A server that refuses says so, and may have closed before the hello.
  static_cast<void>(send_message(socket_.get(), serve::text_of(hello)));
  if (auto welcome = receive(deadline)) {
    if ((*welcome)["type"] == "refused") {
      socket_.reset();
      return Err(text(*welcome, "message"));
    }
    welcome_ = std::move(*welcome);
    if (welcome_.contains("cop")) follow(welcome_["cop"]);
    std::erase_if(pending_, is_state);
    return true;
  }
  socket_.reset();
  if (monotonic_now() >= deadline)
    return Err(fmt::format("{}: the server does not answer; end it and start it again", path_.string()));
  return false;
}

std::optional<nlohmann::json> ServerConnection::receive(MonotonicTime deadline) {
  while (socket_) {
    auto received = receive_message(socket_.get(), serve::message_octets_max);
    if (const auto* message = std::get_if<std::string>(&received)) {
      if (auto json = parse(*message)) {
        follow(*json);
        return json;
      }
      continue;
    }
    if (!std::holds_alternative<NoMessage>(received)) return std::nullopt;
    const auto left = std::chrono::ceil<milliseconds>(deadline - monotonic_now()).count();
    if (left <= 0) return std::nullopt;
    pollfd wait{socket_.get(), POLLIN, 0};
    static_cast<void>(::poll(&wait, 1, static_cast<int>(left)));
  }
  return std::nullopt;
}

void ServerConnection::follow(const nlohmann::json& message) {
  const std::string type = text(message, "type");
  if (type == "packet" && message.contains("id") && message["id"].is_number_integer())
    seen_ = std::max(seen_, message["id"].get<std::int64_t>());
  if (type == "cop" && message.contains("phase")) ad_wanted_ = message["phase"] != AdPhase::off;
}

void ServerConnection::lose(MonotonicTime now) {
  if (!socket_) return;
  socket_.reset();
  lost_ = now;
  next_seek_ = now;
}

std::vector<nlohmann::json> ServerConnection::take_messages() {
  std::vector<nlohmann::json> messages;
  while (!pending_.empty()) {
    messages.push_back(std::move(pending_.front()));
    pending_.pop_front();
  }
  while (socket_ && messages.size() < messages_a_turn) {
    auto received = receive_message(socket_.get(), serve::message_octets_max);
    if (std::holds_alternative<NoMessage>(received)) break;
    const auto* message = std::get_if<std::string>(&received);
    if (message == nullptr) {
      lose(monotonic_now());
      break;
    }
    if (auto json = parse(*message)) {
      follow(*json);
      messages.push_back(std::move(*json));
    }
  }
  return messages;
}

Result<void, std::string> ServerConnection::hand_over(const std::string& message) {
  const MonotonicTime deadline = monotonic_now() + reply_patience;
  while (true) {
    if (socket_ && send_message(socket_.get(), message) == SendResult::sent) return {};
    lose(monotonic_now());
    if (monotonic_now() >= deadline) return Err("the server has ended, and no other is there");
    static_cast<void>(::poll(nullptr, 0, static_cast<int>(seek_period.count())));
    if (const auto sought = seek(monotonic_now()); !sought) return sought;
  }
}

std::optional<nlohmann::json> ServerConnection::receive_reply(std::uint64_t call) {
  while (auto received = receive(monotonic_now() + reply_patience)) {
    if ((*received)["type"] == "reply" && received->contains("call") && (*received)["call"] == call)
      return received;
    if (pending_.size() < pending_max) pending_.push_back(std::move(*received));
  }
  lose(monotonic_now());
  return std::nullopt;
}

Result<nlohmann::json, OrderError> ServerConnection::call(nlohmann::json message, int servers_max) {
  const std::uint64_t number = next_call_++;
  message["call"] = number;
  const bool strict = message.value("recorded_alone", false);
  message["recorded_alone"] = strict || servers_max > 1;
  bool perhaps_done = false;
  for (int servers = 0; servers < servers_max; ++servers) {
    if (const auto handed = hand_over(serve::text_of(message)); !handed)
      return perhaps_done ? not_known(handed.error()) : refused(handed.error());
    auto reply = receive_reply(number);
    const bool repeatable = message["recorded_alone"].get<bool>();
    if (reply && repeatable && reply->value("unrecorded", false)) {
      if (strict) return refused(text(*reply, "error") + "; it was not sent");
      // The archive fails: the order goes up without a record. No other server could know of it then. Its
      // token is another one: the database may have recorded the first attempt, and said so too late.
      message["recorded_alone"] = false;
      if (message.contains("token")) message["token"] = message["token"].get<std::string>() + "-unrecorded";
      servers_max = servers + 2;
      continue;
    }
    if (reply) return judged(std::move(*reply));
    perhaps_done = true;
    if (!repeatable || !welcome_.value("archive", false)) break;
    message["again"] = true;
  }
  return not_known("the server ended before it answered");
}

Result<void, std::string> ServerConnection::seek(MonotonicTime now) {
  if (socket_ || now < next_seek_) return {};
  next_seek_ = now + seek_period;
  const auto connected = connect();
  if (!connected) return Err(connected.error());
  if (*connected) {
    found_ = true;
    return {};
  }
  if (now - lost_ < server_patience) return {};
  return Err(fmt::format("the server at {} has ended, and none came back for {} s", path_.string(),
                         server_patience / seconds(1)));
}

std::optional<MonotonicTime> ServerConnection::next_seek() const {
  return socket_ ? std::nullopt : std::optional(next_seek_);
}

ServedLink::ServedLink(ServerConnection connection, bool files)
    : connection_(std::move(connection)), files_(files) {
  take_welcome();
}

void ServedLink::take_welcome() {
  const nlohmann::json& welcome = connection_.welcome();
  try {
    take_state(welcome);
    vc_ = welcome.at("vc").get<std::uint8_t>();
    cop_ = serve::cop_of(welcome.at("cop"));
    transfers_ = serve::transfers_of(welcome.at("transfers"));
  } catch (const std::exception&) {
    // a server of this protocol says all of it; what is missing stays as it is
  }
}

/// Unique among all clients of all servers of this archive.
std::string ServedLink::new_token() {
  if (token_.empty()) {
    Octets random(16);
    if (!fill_random(random)) random.assign(random.size(), 0);
    token_ = to_hex(random) + fmt::format("-{}-{}", ::getpid(), system_utc_now().ns());
  }
  return fmt::format("{}-{}", token_, tokens_++);
}

Result<nlohmann::json, OrderError> ServedLink::call(nlohmann::json message, int servers_max) {
  auto reply = connection_.call(std::move(message), servers_max);
  resume_with_server();  // before anything of the reply counts
  return reply;
}

Result<wire::RequestId, OrderError> ServedLink::send(const TelecommandOrder& order) {
  nlohmann::json message = described(order.command);
  message["type"] = "send";
  message["arguments"] = order.arguments;
  message["number"] = order.number;
  message["ad"] = order.ad;
  message["token"] = order.token.empty() ? new_token() : order.token;
  message["recorded_alone"] = order.recorded_alone;
  if (order.again) message["again"] = true;
  const auto reply = call(std::move(message), servers_of_a_telecommand);
  if (!reply && reply.error().is_unknown())
    return not_known(fmt::format("{}: it is not known whether it was sent: {}", order.command.command->name,
                                 reply.error().text));
  if (!reply) return Err(reply.error());
  if (order.ad) (reply->value("known", false) ? orphans_ : in_ad_).insert(order.number);
  return serve::request_of(reply->at("request"));
}

Result<TelecommandPacket, OrderError> ServedLink::make_packet(const TelecommandOrder& order) {
  nlohmann::json message = described(order.command);
  message["type"] = "packet";
  message["arguments"] = order.arguments;
  message["token"] = new_token();
  const auto reply = call(std::move(message));
  if (!reply) return refused(reply.error().text + "; nothing was sent");
  return TelecommandPacket{serve::request_of(reply->at("request")), serve::octets_of(reply->at("packet"))};
}

Result<void, OrderError> ServedLink::order_ad(nlohmann::json message) {
  const auto reply = call(std::move(message));
  if (!reply) return Err(reply.error());
  line_ = take_messages();  // where the service is now
  return {};
}

Result<void, OrderError> ServedLink::select_keys(suite::AssociationSet set, const std::string& why) {
  const auto reply = call({{"type", "select_keys"}, {"keys", to_text(set)}, {"why", why}});
  if (!reply) return Err(reply.error());
  return {};
}

Result<void, OrderError> ServedLink::fill_gaps() {
  const auto reply = call({{"type", "fill_gaps"}});
  if (!reply) return Err(reply.error());
  return {};
}

Result<void, OrderError> ServedLink::acknowledge(std::int64_t event, const std::string& who) {
  const auto reply = call({{"type", "acknowledge"}, {"id", event}, {"who", who}});
  if (!reply) return Err(reply.error());
  return {};
}

Result<cfdp::TransactionId, OrderError> ServedLink::put(const std::filesystem::path& file,
                                                        const std::string& name, bool resume) {
  std::error_code error;
  const auto absolute = std::filesystem::absolute(file, error);
  const auto reply = call({{"type", "put"}, {"file", absolute.string()}, {"name", name}, {"resume", resume}});
  if (!reply && reply.error().is_unknown())
    return not_known(fmt::format("{}: it is not known whether it goes up: {}", name, reply.error().text));
  if (!reply) return Err(reply.error());
  transfers_ = serve::transfers_of(reply->at("transfers"));
  const auto id = parse_transaction(reply->at("id").get<std::string>());
  if (!id) return not_known("the server gave no id of the transfer");
  return *id;
}

Result<bool, OrderError> ServedLink::order_transfer(cfdp::TransactionId id, TransferOrder order) {
  const char* const type = order == TransferOrder::suspend  ? "suspend"
                           : order == TransferOrder::resume ? "resume"
                                                            : "cancel";
  const auto reply = call({{"type", type}, {"id", to_text(id)}});
  if (!reply) return Err(reply.error());
  transfers_ = serve::transfers_of(reply->at("transfers"));
  return reply->at("known").get<bool>();
}

Result<void, std::string> ServedLink::on_readable() {
  return take_messages();
}

Result<void, std::string> ServedLink::take_messages() {
  auto outcome = std::exchange(line_, {});  // what came after the line was closed is taken, too
  for (const nlohmann::json& message : connection_.take_messages()) {
    try {
      if (const auto taken = take(message); !taken) outcome = taken;
    } catch (const nlohmann::json::exception& error) {
      report_problem(std::string("a message of the server cannot be read: ") + error.what());
    } catch (const std::invalid_argument& error) {
      report_problem(std::string("a message of the server cannot be read: ") + error.what());
    }
  }
  return outcome;
}

Result<void, std::string> ServedLink::take(const nlohmann::json& message) {
  const auto type = message.at("type").get<std::string>();
  if (type == "packet" && output_.packet) output_.packet(serve::packet_of(message));
  if (type == "state") take_state(message);
  if (type == "cop") take_cop(serve::cop_of(message));
  if (type == "transfers") transfers_ = serve::transfers_of(message.at("transfers"));
  if (type == "file") take_file(serve::news_of(message));
  if (type == "problem") report_problem(message.at("message").get<std::string>());
  if (type == "keys" && output_.keys) {
    const auto set = key_set_of(message.at("keys").get<std::string>());
    if (set) output_.keys(*set, message.at("why").get<std::string>());
  }
  if (type == "ad") {
    const auto number = message.at("number").get<std::uint64_t>();
    const AdProgress progress = serve::ad_progress_of(message);
    if (progress != AdProgress::transmitted) {
      in_ad_.erase(number);
      orphans_.erase(number);
    }
    if (output_.ad) output_.ad(number, progress);
  }
  if (type == "telecommand" && output_.telecommand) output_.telecommand(serve::telecommand_of(message));
  if (type == "line_opened" && output_.line_opened) output_.line_opened();
  if (type == "line_closed") return Err(message.at("message").get<std::string>());
  return {};
}

void ServedLink::take_file(const cfdp::News& news) {
  if (news.event.kind == cfdp::EventKind::finished) {
    const auto is_it = [&news](const cfdp::Report& report) { return report.id == news.event.id; };
    std::erase_if(transfers_, is_it);
    std::erase_if(ended_, is_it);
  }
  if (output_.file) output_.file(news);
}

void ServedLink::take_state(const nlohmann::json& message) {
  counters_ = serve::counters_of(message.at("counters"));
  locked_ = message.at("locked").get<bool>();
  clcw_.reset();
  if (!message.at("clcw").is_null()) clcw_ = message.at("clcw").get<std::uint32_t>();
  sent_ = message.at("sent").get<std::uint64_t>();
  archive_problem_ = message.value("archive_problem", "");
}

void ServedLink::take_cop(const CopReport& report) {
  const bool news = serve::to_message(report) != serve::to_message(cop_);
  cop_ = report;
  if (news && output_.cop) output_.cop(report);
}

Result<void, std::string> ServedLink::on_time() {
  if (connection_.has_pending() || !line_) {
    if (const auto taken = take_messages(); !taken) return taken;
  }
  if (const auto sought = connection_.seek(monotonic_now()); !sought) return sought;
  resume_with_server();
  tell_resumed();
  return {};
}

void ServedLink::resume_with_server() {
  if (!connection_.take_found()) return;
  resumed_ = true;
  orphans_.merge(in_ad_);
  const auto transfers = std::exchange(transfers_, {});
  const nlohmann::json cop = serve::to_message(cop_);
  take_welcome();
  cop_changed_ = cop_changed_ || serve::to_message(cop_) != cop;
  if (files_) end_transfers(transfers);
}

void ServedLink::end_transfers(const std::vector<cfdp::Report>& before) {
  for (const cfdp::Report& report : before) {
    const bool goes_on = std::any_of(transfers_.begin(), transfers_.end(),
                                     [&report](const auto& known) { return known.id == report.id; });
    if (!goes_on) ended_.push_back(report);
  }
}

/// After the last messages of the server that ended: telecommands in the hands of its AD service went with
/// it, and a file that is no longer under way ended without a witness.
void ServedLink::tell_resumed() {
  if (std::exchange(resumed_, false) && output_.note)
    output_.note("the server ended; connected to the next one");
  if (std::exchange(cop_changed_, false) && output_.cop) output_.cop(cop_);
  for (const std::uint64_t number : std::exchange(orphans_, {})) {
    if (output_.ad) output_.ad(number, AdProgress::unknown);
  }
  for (const cfdp::Report& report : std::exchange(ended_, {})) {
    cfdp::News news{.event = {.kind = cfdp::EventKind::finished, .id = report.id, .role = report.role},
                    .file = report};
    news.event.outcome.incomplete = true;
    news.event.outcome.file_status = wire::CfdpFileStatus::unreported;
    if (output_.file) output_.file(news);
  }
}

std::optional<MonotonicTime> ServedLink::next_deadline() const {
  if (connection_.has_pending() || !line_ || resumed_ || !orphans_.empty() || !ended_.empty())
    return monotonic_now();
  return connection_.next_seek();
}

Result<Octets, std::string> ServedLine::read() {
  if (const auto sought = connection_.seek(monotonic_now()); !sought) return Err(sought.error());
  Octets octets;
  for (const nlohmann::json& message : connection_.take_messages()) {
    if (message["type"] == "line_closed") return Err(text(message, "message"));
    if (message["type"] != "octets") continue;
    const auto more = from_hex(text(message, "octets"));
    if (more) octets.insert(octets.end(), more->begin(), more->end());
  }
  return octets;
}

Result<void, std::string> ServedLine::write(OctetView octets, milliseconds patience) {
  static_cast<void>(patience);  // the server's
  const auto reply = connection_.call({{"type", "write"}, {"octets", to_hex(octets)}});
  if (!reply) return Err(reply.error().text);
  return {};
}

}  // namespace srfs::ground
