// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/api/gateway.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <utility>

#include <fmt/format.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "base/random_octets.hpp"
#include "ground/files.hpp"
#include "ground/station_status.hpp"

namespace srfs::ground::api {
namespace {

constexpr milliseconds order_patience{5000};  ///< until an order is begun
constexpr milliseconds state_period{250};
constexpr milliseconds schedule_span{5000};  ///< packets of one report of the schedule

}  // namespace

nlohmann::json stage_json(const StageReport& report, const std::string& token) {
  nlohmann::json json = to_json(report);
  json.erase("line");
  if (!token.empty()) json["token"] = token;
  if (!report.who.empty()) json["who"] = report.who;
  return json;
}

Result<std::unique_ptr<Gateway>, std::string> Gateway::open(const mission::Dictionary& dictionary,
                                                            const std::filesystem::path& state_dir,
                                                            const ArchivePlace& place) {
  auto server = ServerConnection::open(state_dir / serve::socket_name,
                                       {.verb = "web", .files = true, .telecommands = true});
  if (!server) return Err(server.error());
  if (!*server)
    return Err(fmt::format("no server runs at {}; start it: srfs-ground serve --web",
                           (state_dir / serve::socket_name).string()));
  Fd wake(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  if (!wake) return Err(fmt::format("no eventfd: {}", errno_text(errno)));
  std::unique_ptr<Gateway> gateway(new Gateway(dictionary, std::move(wake)));
  auto link = std::make_unique<ServedLink>(std::move(**server), true);
  gateway->link_ = link.get();
  gateway->line_open_ = link->line_was_open();
  gateway->has_archive_ = link->has_archive();
  gateway->station_ = std::make_unique<Station>(dictionary, std::move(link), gateway->output());
  Octets random(8);
  if (!fill_random(random)) return Err(std::string("no random octets"));
  gateway->token_prefix_ = to_hex(random);
  // What came before is known from the archive; what comes from now on waits in the socket.
  if (const auto archive = open_archive(place, ArchiveUse::read)) {
    auto& snapshot = gateway->snapshot_;
    if (auto status = read_status(**archive, dictionary)) snapshot.latest = std::move(status->latest);
    if (const auto newest = (*archive)->newest_packet()) snapshot.newest_id = *newest;
    PacketFilter schedules;
    schedules.service = std::uint8_t{11};
    schedules.newest_first = true;
    static_cast<void>((*archive)->packets(schedules, [&](const StoredPacket& stored) {
      auto report = decode_telemetry(dictionary, stored.packet);
      if (report.kind != TelemetryKind::schedule) return true;
      if (snapshot.schedule.empty()) snapshot.schedule_received = stored.received;
      if (snapshot.schedule_received - stored.received > schedule_span) return false;
      snapshot.schedule.insert(snapshot.schedule.begin(), std::move(report));
      return true;
    }));
  }
  gateway->tell_state(monotonic_now());
  return gateway;
}

StationOutput Gateway::output() {
  return {
      .telemetry = [this](const auto& report) { on_telemetry(report); },
      .stage = [this](const auto& report) { on_stage(report); },
      .retrieval_over =
          [this](const Retrieval& retrieval) {
            nlohmann::json json{{"type", "retrieval_done"},
                                {"received", retrieval.received()},
                                {"packets", nullptr},
                                {"complete", retrieval.is_complete()}};
            if (retrieval.expected()) json["packets"] = *retrieval.expected();
            if (const auto token = followed_.find(retrieval.tag()); token != followed_.end())
              json["token"] = token->second;
            publish(json);
          },
      .cop = [this](const auto& report) { publish(to_json(report)); },
      .file = [this](const auto& news) { publish(to_json(news)); },
      .keys =
          [this](auto set, const auto& why) {
            {
              const std::lock_guard lock(snapshot_mutex_);
              snapshot_.keys = to_text(set);
            }
            publish({{"type", "keys"}, {"keys", to_text(set)}, {"why", why}});
          },
      .problem =
          [this](const auto& text) {
            publish({{"type", "note"}, {"problem", true}, {"message", text}});
          },
      .note =
          [this](const auto& text) {
            publish({{"type", "note"}, {"message", text}});
            set_line(link_->line_was_open(), "another server");  // the only note of a served link
          },
      .stage_of_other = [this](const auto& report) { publish(stage_json(report, ""), report.archive_id); },
      .line_opened = [this] { set_line(true, ""); }};
}

void Gateway::publish(const nlohmann::json& json, std::int64_t id) {
  stream_.publish(stream_item(id, json));
}

void Gateway::on_telemetry(const TelemetryReport& report) {
  const UtcTime now = system_utc_now();
  {
    const std::lock_guard lock(snapshot_mutex_);
    snapshot_.latest.take(report, now);
    snapshot_.newest_id = std::max(snapshot_.newest_id, report.archive_id);
    if (report.kind == TelemetryKind::schedule) {
      const bool begins = now - snapshot_.schedule_received > schedule_span;
      if (begins) snapshot_.schedule.clear();
      if (begins) snapshot_.schedule_received = now;
      snapshot_.schedule.push_back(report);
    }
  }
  publish(to_json(report), report.archive_id);
}

void Gateway::on_stage(const StageReport& report) {
  const auto token = followed_.find(report.tag);
  nlohmann::json json = stage_json(report, token == followed_.end() ? "" : token->second);
  if (const auto arming = armings_.find(report.tag); arming != armings_.end()) {
    json["arms"] = arming->second.order.name;
    json["token"] = arming->second.token;
    if (report.is_final() && !report.late) arming->second.succeeded = report.is_completed();
  }
  {
    const std::lock_guard lock(snapshot_mutex_);
    snapshot_.newest_id = std::max(snapshot_.newest_id, report.archive_id);
  }
  publish(json, report.archive_id);
  // After timed_out an end may follow; a late one may be that of the insertion.
  const bool ended = report.has_ended() && !report.late && !report.insertion;
  if (ended && token != followed_.end()) followed_.erase(token);
}

void Gateway::set_line(bool open, const std::string& why) {
  if (std::exchange(line_open_, open) == open) return;
  nlohmann::json json{{"type", "line"}, {"line", open ? "open" : "closed"}};
  if (!why.empty()) json["why"] = why;
  publish(json);
  next_state_ = {};
}

void Gateway::tell_state(MonotonicTime now) {
  if (now < next_state_) return;
  next_state_ = now + state_period;
  has_archive_ = link_->has_archive();
  records_telecommands_ = has_archive_ && link_->archive_problem().empty();
  nlohmann::json stats = to_json(link_->counters());
  nlohmann::json transfers{{"type", "transfers"}, {"transfers", nlohmann::json::array()}};
  for (const auto& report : link_->transfers()) transfers["transfers"].push_back(to_json(report));
  {
    const std::lock_guard lock(snapshot_mutex_);
    snapshot_.line_open = line_open_ && link_->fd() >= 0;
    snapshot_.locked = link_->locked();
    snapshot_.counters = link_->counters();
    snapshot_.cop = link_->cop();
    snapshot_.clcw = link_->clcw();
    snapshot_.telecommands_sent = link_->telecommands_sent();
    snapshot_.transfers = link_->transfers();
    snapshot_.archive_problem = link_->archive_problem();
  }
  stats["telecommands_sent"] = link_->telecommands_sent();
  stats["locked"] = link_->locked();
  if (std::exchange(told_stats_, stats.dump()) != stats.dump()) publish(stats);
  const std::string text = transfers.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  if (std::exchange(told_transfers_, text) != text) publish(transfers);
}

Snapshot Gateway::snapshot() {
  const std::lock_guard lock(snapshot_mutex_);
  return snapshot_;
}

HttpResponse Gateway::order(Work work) {
  const auto order = std::make_shared<Order>();
  order->work = std::move(work);
  auto answer = order->answer.get_future();
  {
    const std::lock_guard lock(orders_mutex_);
    if (orders_.size() >= orders_max) return error_response(429, "too many orders wait; try again");
    orders_.push_back(order);
  }
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto told = ::write(wake_.get(), &one, sizeof one);
  if (answer.wait_for(order_patience) != std::future_status::ready) {
    auto waiting = Order::State::waiting;
    if (order->state.compare_exchange_strong(waiting, Order::State::taken_back))
      return error_response(503, "the server does not answer; nothing was ordered");
  }
  return answer.get();  // what was begun ends: each call to the server has a deadline
}

void Gateway::carry_out_orders() {
  std::uint64_t count = 0;
  [[maybe_unused]] const auto told = ::read(wake_.get(), &count, sizeof count);
  for (;;) {
    std::shared_ptr<Order> order;
    {
      const std::lock_guard lock(orders_mutex_);
      if (orders_.empty()) return;
      order = orders_.front();
      orders_.pop_front();
    }
    auto waiting = Order::State::waiting;
    if (!order->state.compare_exchange_strong(waiting, Order::State::begun)) continue;
    order->answer.set_value(order->work());
  }
}

HttpResponse failure_response(const OrderError& error, int refused) {
  return error.is_unknown() ? unknown_response(error.text) : error_response(refused, error.text);
}

HttpResponse Gateway::failure(const OrderError& error) {
  return failure_response(error, line_open_ && link_->fd() >= 0 ? 409 : 503);
}

HttpResponse Gateway::dispatch(const TelecommandRequest& order, const std::string& token) {
  if (order.ad && link_->cop().phase == AdPhase::off) {
    const auto started = station_->start_ad();
    if (!started) return failure({OrderError::Kind::refused, started.error().text + "; nothing was sent"});
  }
  const std::uint64_t tag = next_tag_++;
  if (followed_.size() >= followed_max) followed_.erase(followed_.begin());
  followed_[tag] = token;
  const auto sent = order.at ? station_->send_at(order.at->at(system_utc_now()), order.name, order.arguments,
                                                 std::nullopt, tag, order.token)
                             : station_->send(order.name, order.arguments, std::nullopt, tag, order.token);
  if (!sent) {
    followed_.erase(tag);
    return failure(sent.error());
  }
  return json_response(202, {{"token", token}, {"id", request_text(*sent)}});
}

HttpResponse Gateway::send(const TelecommandRequest& order) {
  const std::string token =
      order.token.empty() ? fmt::format("{}-{}", token_prefix_, next_tag_) : order.token;
  if (!order.arm) return dispatch(order, token);
  if (armings_.size() >= armings_max) return error_response(429, "too many telecommands are being armed");
  // Armed now, it would be refused at its release: an arming lasts half a minute.
  if (order.at)
    return error_response(409,
                          "a hazardous telecommand with a time is armed on board shortly before it: "
                          "srfs-ground arm --at, then send it without \"arm\"");
  const std::uint64_t tag = next_tag_++;
  armings_[tag] = {order, token, std::nullopt};
  const auto armed = station_->arm(order.name, order.arguments, std::nullopt, tag);
  if (!armed) {
    armings_.erase(tag);
    return failure({OrderError::Kind::refused, armed.error().text + "; " + order.name + " was not sent"});
  }
  return json_response(202, {{"token", token}, {"id", nullptr}, {"arming", request_text(*armed)}});
}

/// Telecommands whose arming has ended: they are sent, or the stream says why not, or that it is not known.
void Gateway::send_armed() {
  std::vector<Arming> ended;
  std::erase_if(armings_, [&ended](const auto& each) {
    if (each.second.succeeded) ended.push_back(each.second);
    return each.second.succeeded.has_value();
  });
  for (const Arming& arming : ended) {
    std::string why = "it could not be armed";
    bool known = true;
    if (*arming.succeeded) {
      const HttpResponse response = dispatch(arming.order, arming.token);
      if (response.status == 202) continue;
      known = response.status != unknown_outcome;
      why = nlohmann::json::parse(response.body, nullptr, false).value("error", why);
    }
    publish({{"type", "tc_stage"},
             {"id", nullptr},
             {"command", arming.order.name},
             {"token", arming.token},
             {"stage", known ? "not_sent" : "unknown"},
             {"success", false},
             {"final", true},
             {"text", why}});
  }
}

void Gateway::on_outcome(const Result<void, std::string>& outcome) {
  if (!outcome && link_->fd() >= 0) set_line(false, outcome.error());
}

void Gateway::wait(int stop) {
  MonotonicTime wake = monotonic_now() + state_period;
  if (const auto next = station_->next_deadline(); next && *next < wake) wake = *next;
  const auto left = std::chrono::ceil<milliseconds>(wake - monotonic_now()).count();
  std::array<pollfd, 3> fds{{{stop, POLLIN, 0}, {wake_.get(), POLLIN, 0}, {station_->fd(), POLLIN, 0}}};
  static_cast<void>(
      ::poll(fds.data(), fds.size(), static_cast<int>(std::clamp<std::int64_t>(left, 0, 1000))));
}

Result<void, std::string> Gateway::run(int stop) {
  pollfd ends{stop, POLLIN, 0};
  while (::poll(&ends, 1, 0) == 0) {
    wait(stop);
    on_outcome(station_->on_readable());
    const auto alive = station_->on_time();
    if (!alive && link_->fd() < 0) {
      stream_.close();
      return Err(alive.error());
    }
    on_outcome(alive);
    carry_out_orders();
    send_armed();
    tell_state(monotonic_now());
  }
  stream_.close();
  return {};
}

}  // namespace srfs::ground::api
