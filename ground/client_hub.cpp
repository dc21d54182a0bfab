// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/client_hub.hpp"

#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "base/version.hpp"
#include "ground/bounded_json.hpp"
#include "ground/files.hpp"
#include "ground/terminal_text.hpp"
#include "ground/uplink.hpp"

namespace srfs::ground {
namespace {

constexpr std::size_t text_octets_max = 256;        ///< of a name or a verb
constexpr std::size_t arguments_octets_max = 8192;  ///< of a telecommand as it was written

nlohmann::json refusal(const std::string& why) {
  return {{"error", why}};
}

nlohmann::json refusal(const OrderError& error) {
  nlohmann::json reply = refusal(error.text);
  if (error.is_unknown()) reply["unknown"] = true;
  if (error.kind == OrderError::Kind::unrecorded) reply["unrecorded"] = true;
  return reply;
}

template <class Error>
nlohmann::json outcome(const Result<void, Error>& result) {
  return result ? nlohmann::json::object() : refusal(result.error());
}

std::string short_text(const nlohmann::json& value) {
  auto text = value.get<std::string>();
  if (text.size() > text_octets_max) throw std::invalid_argument("a text is too long");
  return text;
}

/// A telecommand as a client describes it: the client's dictionary may have fragments of added nodes.
struct DescribedCommand {
  mission::Command command;
  Octets data;
  [[nodiscard]] mission::EncodedCommand encoded() const { return {&command, data}; }
};

DescribedCommand command_of(const nlohmann::json& message) {
  DescribedCommand described;
  described.command.name = short_text(message.at("name"));
  described.command.apid = message.at("apid").get<std::uint16_t>();
  described.command.service = message.at("service").get<std::uint8_t>();
  described.command.subtype = message.at("subtype").get<std::uint8_t>();
  described.data = serve::octets_of(message.at("data"));
  constexpr std::uint16_t apid_max = 0x7FE;
  if (described.command.apid > apid_max) throw std::invalid_argument("no application process");
  return described;
}

std::vector<std::string> arguments_of(const nlohmann::json& message) {
  auto arguments = message.at("arguments").get<std::vector<std::string>>();
  std::size_t octets = 0;
  for (const auto& argument : arguments) octets += argument.size();
  if (octets > arguments_octets_max) throw std::invalid_argument("the arguments are too long");
  return arguments;
}

/// What a client sees that does not use the AD service: of the spacecraft's end alone.
CopReport without_service(const CopReport& report) {
  CopReport seen;
  seen.clcw = report.clcw;
  seen.bad_clcws = report.bad_clcws;
  return seen;
}

}  // namespace

ClientHub::ClientHub(StationLink& link, Hooks hooks) : link_(link), hooks_(std::move(hooks)) {
  const auto all = [](const Client&) { return true; };
  const auto files = [](const Client& client) { return client.wants_files; };
  link_.set_output({.packet = [this](const auto& received) { on_packet(received); },
                    .ad = [this](auto number, auto progress) { on_ad(number, progress); },
                    .cop = [this](const auto& report) { on_cop(report); },
                    .file =
                        [this, files](const auto& news) {
                          if (hooks_.memory.file) hooks_.memory.file(news);
                          tell_all(serve::to_message(news), files);
                        },
                    .keys =
                        [this, all](auto set, const auto& why) {
                          tell_all({{"type", "keys"}, {"keys", to_text(set)}, {"why", why}}, all);
                        },
                    .problem =
                        [this, files](const auto& problem) {
                          hooks_.log(problem);
                          tell_all({{"type", "problem"}, {"message", problem}}, files);
                        },
                    .note = [this](const auto& text) { hooks_.log(text); }});
}

Result<ClientHub::ClientId, std::string> ClientHub::on_connect(const std::string& who) {
  if (clients_.size() >= clients_max) {
    hooks_.log(fmt::format("{} was refused: there are {} clients already", who, clients_max));
    return Err(serve::text_of(
        {{"type", "refused"},
         {"message", fmt::format("the server has {} clients already; end one of them", clients_max)}}));
  }
  const ClientId id = next_client_++;
  clients_[id].who = who;
  return id;
}

void ClientHub::on_disconnect(ClientId client) {
  const auto found = clients_.find(client);
  if (found == clients_.end()) return;
  if (const auto left = leave_ad(found->second); !left) hooks_.log(left.error().text);
  clients_.erase(client);
}

void ClientHub::on_message(ClientId id, std::string_view text) {
  const auto found = clients_.find(id);
  if (found == clients_.end() || found->second.closing) return;
  Client& client = found->second;
  try {
    const auto message = parse_bounded(text);
    if (message.is_discarded()) throw std::invalid_argument("it is not JSON, or nested too deeply");
    client.greeted ? answer(id, client, message) : greet(client, message);
  } catch (const nlohmann::json::exception& error) {
    sending_ = 0;
    close(client, "sent what is no message of this protocol: " + for_terminal(error.what()));
  } catch (const std::invalid_argument& error) {
    sending_ = 0;
    close(client, "sent what is no message of this protocol: " + for_terminal(error.what()));
  }
}

void ClientHub::greet(Client& client, const nlohmann::json& message) {
  if (message.at("type") != "hello") throw std::invalid_argument("expected hello");
  client.verb = for_terminal(short_text(message.at("verb")));
  const auto version_of_client = message.at("protocol").get<int>();
  if (version_of_client != serve::protocol) {
    queue(client,
          {{"type", "refused"},
           {"message",
            fmt::format("the server is of version {}, another than this program's: restart it", version())}});
    return close(client, fmt::format("speaks protocol {}, not {}", version_of_client, serve::protocol));
  }
  client.wants_files = message.at("files").get<bool>();
  client.wants_octets = message.at("octets").get<bool>();
  client.wants_telecommands = message.value("telecommands", false);
  if (message.contains("keys")) {
    client.keys = key_set_of(message.at("keys").get<std::string>());
    if (!client.keys) throw std::invalid_argument("no set of keys");
  }
  const bool goes_on_with_ad = message.value("ad", false);
  if (goes_on_with_ad) {
    client.uses_ad = true;
    static_cast<void>(link_.start_ad());  // its problem is in the welcome's report
  }
  client.greeted = true;
  nlohmann::json welcome = state();
  welcome["type"] = "welcome";
  welcome["protocol"] = serve::protocol;
  welcome["vc"] = link_.vc();
  welcome["ad"] = {{"window", hooks_.fop.window},
                   {"t1_ms", hooks_.fop.timer / milliseconds(1)},
                   {"transmissions", hooks_.fop.transmission_limit}};
  welcome["cop"] = serve::to_message(goes_on_with_ad ? link_.cop() : without_service(link_.cop()));
  welcome["transfers"] = serve::to_message(link_.transfers());
  welcome["clients"] = clients_.size() - 1;  // without this one
  welcome["line_open"] = link_.fd() >= 0;
  welcome["service"] = serve::to_message(link_.cop());
  welcome["archive"] = hooks_.memory.request_of != nullptr;
  queue(client, welcome);
  if (message.contains("after") && hooks_.memory.packets_after && !client.wants_octets)
    replay(client, message.at("after").get<std::int64_t>());
}

/// What came while this client had no server.
void ClientHub::replay(Client& client, std::int64_t after) {
  hooks_.memory.packets_after(after, [&](std::int64_t id, const ReceivedPacket& received) {
    nlohmann::json message = serve::to_message(received);
    message["id"] = id;
    queue(client, message);
  });
}

void ClientHub::answer(ClientId id, Client& client, const nlohmann::json& message) {
  const std::string type = short_text(message.at("type"));
  sending_ = id;
  nlohmann::json reply = carry_out(id, client, type, message);
  sending_ = 0;
  reply["type"] = "reply";
  reply["call"] = message.at("call").get<std::uint64_t>();
  queue(client, reply);
  link_.settle();
}

nlohmann::json ClientHub::carry_out(ClientId id, Client& client, const std::string& type,
                                    const nlohmann::json& message) {
  if (type == "send") return send(id, client, message);
  if (type == "packet") return make_packet(client, message);
  if (type == "start_ad" || type == "stop_ad" || type == "unlock" || type == "set_vr")
    return order_ad(client, type, message);
  if (type == "put" || type == "suspend" || type == "resume" || type == "cancel")
    return order_files(type, message);
  if (type == "acknowledge" || type == "fill_gaps") return order_memory(client, type, message);
  if (type == "select_keys") {
    const auto set = key_set_of(message.at("keys").get<std::string>());
    if (!set) throw std::invalid_argument("no set of keys");
    return outcome(link_.select_keys(*set, short_text(message.at("why"))));
  }
  if (type == "write") {
    const Octets octets = serve::octets_of(message.at("octets"));
    return outcome(hooks_.write(octets));
  }
  throw std::invalid_argument("unknown type '" + for_terminal(type) + "'");
}

nlohmann::json ClientHub::send(ClientId id, const Client& client, const nlohmann::json& message) {
  const DescribedCommand described = command_of(message);
  const mission::EncodedCommand encoded = described.encoded();
  const bool ad = message.at("ad").get<bool>();
  const auto of_client = message.at("number").get<std::uint64_t>();
  const std::string token = short_text(message.at("token"));
  // Before all refusals: they say that nothing was sent.
  if (auto known = sent_before(token, message.value("again", false))) return *std::move(known);
  if (ad && !client.uses_ad) return refusal("the AD service ended before the telecommand was transmitted");
  if (ad && client.keys)
    return refusal("the AD service is shared, so it uses the server's keys: leave out --keys or --ad");
  const std::uint64_t number = next_number_++;
  if (ad) ad_senders_[number] = {id, of_client};
  const auto request = link_.send({.command = encoded,
                                   .arguments = arguments_of(message),
                                   .number = number,
                                   .ad = ad,
                                   .keys = client.keys,
                                   .who = client.who + ", " + client.verb,
                                   .token = token,
                                   .recorded_alone = message.value("recorded_alone", false)});
  if (!request) {
    ad_senders_.erase(number);
    return refusal(request.error());
  }
  return {{"request", serve::to_message(*request)}};
}

std::optional<nlohmann::json> ClientHub::sent_before(const std::string& token, bool again) const {
  const Memory& memory = hooks_.memory;
  std::string why_unknown = "this server has no archive";
  if (memory.request_of) {
    const auto known = memory.request_of(token);
    if (known && *known) return nlohmann::json{{"request", serve::to_message(**known)}, {"known", true}};
    // While the archive fails, telecommands are sent without a record.
    why_unknown = !known ? known.error() : memory.problem ? memory.problem() : "";
  }
  if (!again || why_unknown.empty()) return std::nullopt;
  return refusal(OrderError{OrderError::Kind::unknown, why_unknown});
}

nlohmann::json ClientHub::make_packet(const Client& client, const nlohmann::json& message) {
  const DescribedCommand described = command_of(message);
  const mission::EncodedCommand encoded = described.encoded();
  const auto made = link_.make_packet({.command = encoded,
                                       .arguments = arguments_of(message),
                                       .who = client.who + ", " + client.verb,
                                       .token = short_text(message.at("token"))});
  if (!made) return refusal(made.error());
  return {{"request", serve::to_message(made->request)}, {"packet", to_hex(made->packet)}};
}

std::string ClientHub::other_ad_user(const Client& client) const {
  for (const auto& [id, other] : clients_) {
    if (other.uses_ad && &other != &client) return fmt::format("'{}' ({})", other.verb, other.who);
  }
  return "";
}

nlohmann::json ClientHub::order_ad(Client& client, const std::string& type, const nlohmann::json& message) {
  const std::string user = other_ad_user(client);
  const bool directive = type == "unlock" || type == "set_vr";
  if (directive && !user.empty())
    return refusal(
        fmt::format("the AD service is in use by {}; a directive would end it. End that client first", user));
  Result<void, OrderError> done;
  if (type == "stop_ad") {
    done = leave_ad(client);
  } else {
    client.uses_ad = true;
    done = type == "start_ad" ? link_.start_ad()
           : type == "unlock" ? link_.unlock()
                              : link_.set_vr(message.at("vr").get<std::uint8_t>());
  }
  // Where the service is now comes before the reply.
  const CopReport report = link_.cop();
  client.told_cop.clear();
  tell_cop(client, client.uses_ad ? report : without_service(report));
  // It ended at once; to this client it says so in the reply.
  if (done && type != "stop_ad" && report.phase == AdPhase::off)
    return refusal(report.problem.empty() ? "the AD service did not start" : report.problem);
  return outcome(done);
}

Result<void, OrderError> ClientHub::leave_ad(Client& client) {
  if (!std::exchange(client.uses_ad, false)) return {};
  if (!other_ad_user(client).empty()) return {};
  return link_.stop_ad();
}

nlohmann::json ClientHub::order_memory(const Client& client, const std::string& type,
                                       const nlohmann::json& message) {
  const Memory& memory = hooks_.memory;
  if (!memory.acknowledge || !memory.fill_gaps) return refusal("this server has no archive");
  if (type == "fill_gaps") {
    memory.fill_gaps();
    return nlohmann::json::object();
  }
  const std::string who = fmt::format("{} ({})", short_text(message.at("who")), client.who);
  return outcome(memory.acknowledge(message.at("id").get<std::int64_t>(), who));
}

nlohmann::json ClientHub::order_files(const std::string& type, const nlohmann::json& message) {
  if (!link_.carries_files()) return refusal("the server carries no files");
  nlohmann::json reply;
  if (type == "put") {
    const auto put = link_.put(message.at("file").get<std::string>(), short_text(message.at("name")),
                               message.at("resume").get<bool>());
    if (!put) return refusal(put.error());
    reply["id"] = to_text(*put);
  } else {
    const auto id = parse_transaction(short_text(message.at("id")));
    if (!id) throw std::invalid_argument("not a transaction id");
    const auto order = type == "suspend"  ? StationLink::TransferOrder::suspend
                       : type == "resume" ? StationLink::TransferOrder::resume
                                          : StationLink::TransferOrder::cancel;
    const auto known = link_.order_transfer(*id, order);
    if (!known) return refusal(known.error());
    reply["known"] = *known;
  }
  reply["transfers"] = serve::to_message(link_.transfers());
  return reply;
}

void ClientHub::on_packet(const ReceivedPacket& received) {
  nlohmann::json message = serve::to_message(received);
  // What is not verified is shown, and not recorded.
  if (hooks_.memory.packet && received.authenticity != Authenticity::unverified) {
    if (const std::int64_t id = hooks_.memory.packet(received); id != 0) message["id"] = id;
  }
  tell_all(message, [](const Client& client) { return !client.wants_octets; });
}

void ClientHub::on_octets(OctetView octets) {
  tell_all({{"type", "octets"}, {"octets", to_hex(octets)}},
           [](const Client& client) { return client.wants_octets; });
}

void ClientHub::on_ad(std::uint64_t number, AdProgress progress) {
  const auto found = ad_senders_.find(number);
  if (found == ad_senders_.end()) return;
  const Sender sender = found->second;
  if (progress != AdProgress::transmitted) ad_senders_.erase(found);
  const auto client = clients_.find(sender.client);
  if (client == clients_.end()) return;  // it has gone; its telecommand has not
  queue(client->second, {{"type", "ad"}, {"number", sender.number}, {"progress", serve::to_text(progress)}});
}

void ClientHub::on_cop(const CopReport& report) {
  for (auto& [id, client] : clients_) {
    tell_cop(client, client.uses_ad ? report : without_service(report));
    if (report.phase == AdPhase::off) client.uses_ad = false;
  }
}

void ClientHub::tell_cop(Client& client, const CopReport& report) {
  if (!client.greeted) return;
  const nlohmann::json message = serve::to_message(report);
  const std::string text = serve::text_of(message);
  if (std::exchange(client.told_cop, text) != text) queue(client, message);
}

void ClientHub::on_telecommand(const SeenTelecommand& seen) {
  const auto message = std::make_shared<const std::string>(serve::text_of(serve::to_message(seen)));
  for (auto& [id, client] : clients_) {
    if (client.greeted && client.wants_telecommands && id != sending_) queue(client, message);
  }
}

void ClientHub::on_line_opened() {
  tell_all({{"type", "line_opened"}}, [](const Client&) { return true; });
}

void ClientHub::on_line_closed(const std::string& why) {
  tell_all({{"type", "line_closed"}, {"message", why}}, [](const Client&) { return true; });
}

nlohmann::json ClientHub::state() const {
  nlohmann::json state{{"type", "state"},
                       {"counters", serve::to_message(link_.counters())},
                       {"locked", link_.locked()},
                       {"clcw", nullptr},
                       {"sent", link_.telecommands_sent()}};
  if (const auto clcw = link_.clcw()) state["clcw"] = *clcw;
  if (hooks_.memory.problem) state["archive_problem"] = hooks_.memory.problem();
  return state;
}

void ClientHub::close_silent(MonotonicTime now) {
  for (auto& [id, client] : clients_) {
    if (client.greeted || client.closing) continue;
    if (!client.hello_deadline) client.hello_deadline = now + hello_patience;
    if (now >= *client.hello_deadline)
      close(client, fmt::format("said nothing for {} s", hello_patience / seconds(1)));
  }
}

void ClientHub::on_time(MonotonicTime now) {
  close_silent(now);
  if (now < next_state_) return;
  next_state_ = now + state_period;
  const nlohmann::json changed = state();
  std::string text = serve::text_of(changed);
  if (std::exchange(told_state_, text) != text) tell_all(changed, [](const Client&) { return true; });
  const nlohmann::json transfers{{"type", "transfers"}, {"transfers", serve::to_message(link_.transfers())}};
  text = serve::text_of(transfers);
  if (std::exchange(told_transfers_, text) != text)
    tell_all(transfers, [](const Client& client) { return client.wants_files; });
}

void ClientHub::tell_all(const nlohmann::json& message, bool (*wants)(const Client&)) {
  const auto text = std::make_shared<const std::string>(serve::text_of(message));
  for (auto& [id, client] : clients_) {
    if (client.greeted && wants(client)) queue(client, text);
  }
}

void ClientHub::queue(Client& client, const nlohmann::json& message) {
  queue(client, std::make_shared<const std::string>(serve::text_of(message)));
}

void ClientHub::queue(Client& client, const Message& message) {
  if (client.closing) return;
  if (client.queued_octets + message->size() > queue_octets_max) {
    client.queue.clear();
    client.queued_octets = 0;
    return close(client, fmt::format("does not read: more than {} octets wait for it", queue_octets_max));
  }
  client.queue.push_back(message);
  client.queued_octets += message->size();
}

void ClientHub::close(Client& client, const std::string& why) {
  client.closing = true;
  hooks_.log(fmt::format("client '{}' ({}) is disconnected: {}", client.verb, client.who, why));
}

ClientHub::Message ClientHub::front(ClientId client) const {
  const auto found = clients_.find(client);
  return found == clients_.end() || found->second.queue.empty() ? nullptr : found->second.queue.front();
}

void ClientHub::pop(ClientId client) {
  const auto found = clients_.find(client);
  if (found == clients_.end() || found->second.queue.empty()) return;
  found->second.queued_octets -= found->second.queue.front()->size();
  found->second.queue.pop_front();
}

std::vector<ClientHub::ClientId> ClientHub::take_closing() {
  std::vector<ClientId> closing;
  for (const auto& [id, client] : clients_) {
    if (client.closing) closing.push_back(id);
  }
  return closing;
}

}  // namespace srfs::ground
