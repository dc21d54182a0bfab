// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/pass/first_contact.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "base/text.hpp"
#include "ground/pass/order_follower.hpp"
#include "ground/pass/pass_report.hpp"
#include "ground/remote.hpp"

namespace srfs::ground::pass {
namespace {

using Level = Finding::Level;
constexpr std::string_view recovery = "docs/how-to/recover_a_spacecraft.md";

/// The newest packet of a structure, asked for its fields.
class Packet {
 public:
  Packet(const LatestValues& latest, const std::string& structure) : entry_(latest.structure(structure)) {}
  [[nodiscard]] explicit operator bool() const { return entry_ != nullptr; }
  [[nodiscard]] const LatestValues::Entry& operator*() const { return *entry_; }
  /// For people; "unknown" where the spacecraft does not know it, empty when there is no such field.
  [[nodiscard]] std::string text(std::string_view field) const {
    return entry_ == nullptr ? "" : field_text(entry_->report, field);
  }
  [[nodiscard]] std::optional<double> number(std::string_view field) const {
    return entry_ == nullptr ? std::nullopt : to_number<double>(field_text(entry_->report, field));
  }
  /// Fields outside their limits.
  [[nodiscard]] std::vector<const mission::DecodedField*> out() const {
    std::vector<const mission::DecodedField*> fields;
    if (entry_ == nullptr) return fields;
    for (const auto& field : entry_->report.fields) {
      if (field.limit > mission::LimitState::green) fields.push_back(&field);
    }
    return fields;
  }

 private:
  const LatestValues::Entry* entry_;
};

DownlinkCounters since(const DownlinkCounters& before, DownlinkCounters now) {
  now.octets -= before.octets;
  now.frames -= before.frames;
  now.bad_frames -= before.bad_frames;
  now.forged_frames -= before.forged_frames;
  now.replayed_frames -= before.replayed_frames;
  now.old_frames -= before.old_frames;
  return now;
}

void assess_boot(const Packet& beacon, const Packet& timing, const Packet& step,
                 std::vector<Finding>& findings) {
  if (step && step.text("in_rescue") == "true") {
    findings.push_back({Level::act,
                        fmt::format("srfs_rescue answers, the suite is down: {} unhealthy starts, {}",
                                    step.text("unhealthy_starts"), step.text("detail")),
                        fmt::format("follow {}; it answers ping and rescue.* alone", recovery)});
  } else if (step && step.text("step") != "normal") {
    findings.push_back({Level::look,
                        fmt::format("started with step {} ({})", step.text("step"), step.text("cause")),
                        fmt::format("{} says what was set aside", recovery)});
  }
  if (beacon) {
    const std::string cause = beacon.text("reset_cause");
    const bool first = beacon.text("boot_count") == "1";
    const Level level = cause == "watchdog" || cause == "crash" ? Level::look : Level::fine;
    findings.push_back({level,
                        fmt::format("boot {}, reset cause {}{}", beacon.text("boot_count"), cause,
                                    first ? ": it was never started before" : ""),
                        level == Level::look ? "ask why: srfs-ground events --severity medium" : ""});
  }
  if (timing.number("unhealthy_boots").value_or(0) > 0)
    findings.push_back(
        {Level::act, fmt::format("{} boots in a row did not become healthy", timing.text("unhealthy_boots")),
         fmt::format("read {} before the next start", recovery)});
}

void assess_mode(const Packet& beacon, const Packet& health, std::vector<Finding>& findings) {
  if (!beacon && !health) return;
  const std::string mode = health ? health.text("mode") : beacon.text("mode");
  const std::string reason = health ? health.text("reason") : beacon.text("mode_reason");
  Finding finding{mode == "safe" ? Level::look : Level::fine,
                  fmt::format("mode {}: {}", mode, reason.empty() ? "no reason given" : reason)};
  if (!health.text("present").empty())
    finding.what += fmt::format("; present now: {}", health.text("present"));
  if (!health.text("next").empty()) finding.what += fmt::format("; next by itself: {}", health.text("next"));
  if (mode == "safe") finding.advice = "leave it there until power, rotation and clock are known";
  findings.push_back(finding);
}

void assess_clock(const Packet& beacon, UtcTime now, std::vector<Finding>& findings) {
  if (!beacon) return;
  if (beacon.text("time_valid") != "true") {
    findings.push_back({Level::act, "its clock was never set: times of packets mean nothing",
                        fmt::format("srfs-ground tc timing.set_time utc={} (or first-contact --set-time)",
                                    to_iso8601(now, 0))});
    return;
  }
  const auto& [report, received] = *beacon;
  const double ahead_s = std::chrono::duration<double>(to_utc(report.time) - received).count();
  constexpr double bearable_s = 2;
  const bool far = std::abs(ahead_s) > bearable_s;
  findings.push_back(
      {far ? Level::look : Level::fine,
       fmt::format("its clock is {:.1f} s {} that of the ground", std::abs(ahead_s),
                   ahead_s < 0 ? "behind" : "ahead of"),
       far ? "telecommands with a time are released by its clock; correct it with timing.set_time" : ""});
}

void assess_commanding(const Packet& beacon, const Packet& ttc, std::vector<Finding>& findings) {
  if (beacon) {
    findings.push_back(
        {Level::fine, fmt::format("keys: association {}, last accepted counter {}",
                                  beacon.text("sdls_spi.bd"), beacon.text("sdls_counter.bd"))});
    if (beacon.text("farm_lockout") == "true")
      findings.push_back({Level::look, "FARM-1 is locked out: AD frames are refused, BD frames are not",
                          "srfs-ground unlock"});
    const auto left_s = beacon.number("command_loss_s");
    if (left_s)
      findings.push_back(
          {Level::fine, fmt::format("command-loss timer: next step in {:.1f} h", *left_s / 3600)});
  }
  if (ttc.number("sdls_keys_unusable").value_or(0) > 0)
    findings.push_back(
        {Level::act,
         fmt::format("{} associations have no usable key on board", ttc.text("sdls_keys_unusable")),
         "docs/how-to/replace_keys.md"});
}

/// The magnitude of the body rates, where the mission reports one.
void assess_rotation(const LatestValues& latest, std::vector<Finding>& findings) {
  constexpr double tumbling_deg_s = 5;
  for (const auto& [name, entry] : latest.all()) {
    const auto rate = to_number<double>(field_text(entry.report, "rate_deg_s"));
    if (!rate) continue;
    const bool tumbles = *rate > tumbling_deg_s;
    findings.push_back(
        {tumbles ? Level::act : Level::fine, fmt::format("it turns by {:.1f} deg/s ({})", *rate, name),
         tumbles
             ? "it tumbles: expect fading on the link, send short telecommands, and have it detumbled first"
             : ""});
  }
}

void assess_limits(const LatestValues& latest, std::vector<Finding>& findings) {
  for (const auto& [name, entry] : latest.all()) {
    for (const auto* field : Packet(latest, name).out()) {
      const bool red = field->limit == mission::LimitState::red;
      findings.push_back(
          {red ? Level::act : Level::look, fmt::format("{}.{} = {} {} ({})", name, field->name, field->text,
                                                       field->unit, to_text(field->limit))});
    }
  }
}

}  // namespace

std::string_view to_text(Finding::Level level) {
  constexpr std::array<std::string_view, 3> levels{"fine", "look", "act"};
  return levels.at(static_cast<std::size_t>(level));
}

std::vector<Finding> assess_spacecraft(const LatestValues& latest, UtcTime now) {
  std::vector<Finding> findings;
  const Packet beacon(latest, "beacon");
  assess_boot(beacon, Packet(latest, "timing"), Packet(latest, "boot_step"), findings);
  assess_mode(beacon, Packet(latest, "health"), findings);
  assess_clock(beacon, now, findings);
  assess_commanding(beacon, Packet(latest, "ttc"), findings);
  assess_rotation(latest, findings);
  assess_limits(latest, findings);
  return findings;
}

std::vector<Finding> assess_link(const LinkFacts& facts) {
  const DownlinkCounters& c = facts.counters;
  if (c.octets == 0)
    return {Finding{Level::act, "nothing came from the line",
                    "check pointing, receiver, cable and --port; in which minute does it rise?"}};
  if (c.frames == 0 && c.forged_frames + c.replayed_frames + c.old_frames > 0)
    return {Finding{Level::act,
                    fmt::format("frames came, and none is taken: {} not authentic, {} with used numbers, {} "
                                "too old",
                                c.forged_frames, c.replayed_frames, c.old_frames),
                    "compare keys/tm_downlink.key and this computer's clock; --unverified mark shows them, "
                    "--frames-from is for a spacecraft that lost its numbers"}};
  if (c.frames == 0)
    return {
        Finding{Level::act, fmt::format("{} octets came, and no frame among them", c.octets),
                "check baud rate, polarity and the deployment's coding (tm_frame_length, tm_reed_solomon, "
                "tm_randomizer)"}};
  std::vector<Finding> findings;
  if (c.bad_frames * 10 > c.frames)
    findings.push_back({Level::look,
                        fmt::format("{} of {} frames are bad", c.bad_frames, c.bad_frames + c.frames),
                        "the signal is weak or fades: the spacecraft may tumble"});
  if (facts.answered) return findings;
  findings.push_back(
      facts.beacon
          ? Finding{Level::act, "it is heard, and no telecommand came through",
                    "compare keys (--keys) and counters: when the beacon's counter is ahead of this "
                    "station's, wait for "
                    "the next beacon or use --counters-from; check power and frequency of the uplink"}
          : Finding{Level::act, "frames came, and neither a beacon nor an answer",
                    "wait for the beacon (every 30 s) and check spacecraft_id of the deployment"});
  return findings;
}

std::vector<TelecommandText> FirstContact::questions_of(const mission::Dictionary& dictionary) {
  std::vector<TelecommandText> questions;
  for (const char* structure : {"beacon", "boot_step", "health", "timing", "ttc", "payload_adcs"}) {
    TelecommandText question{.name = "housekeeping.one_shot",
                             .arguments = {fmt::format("structure={}", structure)}};
    if (dictionary.encode(question.name, question.arguments)) questions.push_back(std::move(question));
  }
  return questions;
}

PassAction FirstContact::order(TelecommandText telecommand) {
  current_ = next_tag_++;
  return {.kind = PassAction::Kind::telecommand, .tag = *current_, .telecommand = std::move(telecommand)};
}

std::optional<PassAction> FirstContact::next(MonotonicTime now, UtcTime utc, const LatestValues& latest) {
  if (current_ || is_over(now) || (resting_until_ && now < *resting_until_)) return std::nullopt;
  const bool rescue = Packet(latest, "boot_step").text("in_rescue") == "true";
  switch (step_) {
    case Step::call:
      return order({.name = "ttc.ping", .arguments = {}});
    case Step::ask:
      // srfs_rescue answers none of the suite's questions, and has said what it knows.
      if (!rescue && asked_ < questions_.size()) return order(questions_.at(asked_));
      done_ = rescue || !sets_time_ || Packet(latest, "beacon").text("time_valid") != "false";
      if (done_) return std::nullopt;
      step_ = Step::set_time;
      [[fallthrough]];
    case Step::set_time:
      return order({.name = "timing.set_time", .arguments = {"utc=" + to_iso8601(utc), "accuracy_ms=1000"}});
    case Step::look_at_time:
      return order({.name = "housekeeping.one_shot", .arguments = {"structure=beacon"}});
  }
  return std::nullopt;
}

void FirstContact::next_question() {
  losses_ = 0;
  ++asked_;
}

void FirstContact::on_end(std::uint64_t tag, const OrderEnd& end, MonotonicTime now) {
  if (current_ != tag) return;
  current_.reset();
  constexpr unsigned losses_max = 5;
  const bool as_wanted = end.how == OrderEnd::How::as_wanted;
  const bool came_through = as_wanted || end.how == OrderEnd::How::otherwise;
  answered_ = answered_ || came_through;
  switch (step_) {
    case Step::call:
      if (came_through) step_ = Step::ask;
      if (!came_through) resting_until_ = now + call_period;
      return;
    case Step::ask:
      // Refused is not answered: a node that has just started has sampled nothing yet.
      if (as_wanted || ++losses_ == losses_max) return next_question();
      resting_until_ = now + PassSession::rest;
      return;
    case Step::set_time:
      // Never twice: a time that was sent is of that moment.
      findings_.push_back(as_wanted
                              ? Finding{Level::fine, "its clock was set to that of the ground"}
                              : Finding{Level::act, "its clock could not be set: " + end.why,
                                        "see whether it was, by the next beacon, before you send it again"});
      step_ = Step::look_at_time;
      return;
    case Step::look_at_time:
      done_ = came_through || ++losses_ == losses_max;
      return;
  }
}

MonotonicTime FirstContact::next_deadline(MonotonicTime now) const {
  return resting_until_ && now < *resting_until_ ? std::min(*resting_until_, deadline_) : deadline_;
}

ContactEnd run_first_contact(const mission::Dictionary& dictionary, std::unique_ptr<StationLink> link,
                             bool sets_time, nanoseconds length,
                             std::function<void(const std::string&)> note) {
  constexpr milliseconds longest_wait{200};
  OrderFollower orders(dictionary, std::move(link), {.file = {}, .note = std::move(note)});
  FirstContact procedure(FirstContact::questions_of(dictionary), sets_time, monotonic_now() + length);
  const DownlinkCounters before = orders.link().counters();
  while (!procedure.is_over(monotonic_now()) && !orders.interrupted()) {
    if (const auto action = procedure.next(monotonic_now(), system_utc_now(), orders.latest()))
      orders.send(*action);
    if (!orders.wait(std::min(procedure.next_deadline(monotonic_now()), monotonic_now() + longest_wait)))
      break;
    if (const auto ended = orders.take_end()) procedure.on_end(ended->tag, ended->end, monotonic_now());
  }
  const bool beacon =
      orders.latest().structure("beacon") != nullptr || orders.latest().structure("boot_step") != nullptr;
  ContactEnd end{.findings = assess_link({.counters = since(before, orders.link().counters()),
                                          .beacon = beacon,
                                          .answered = procedure.answered()}),
                 .answered = procedure.answered()};
  const auto add = [&end](const std::vector<Finding>& more) {
    end.findings.insert(end.findings.end(), more.begin(), more.end());
  };
  add(procedure.findings());
  add(assess_spacecraft(orders.latest(), system_utc_now()));
  return end;
}

std::string contact_to_markdown(const std::vector<Finding>& findings, UtcTime now) {
  std::string text = fmt::format("# First contact, {} UTC\n\n| | Finding | What to do |\n|---|---|---|\n",
                                 to_iso8601(now, 0));
  for (const Level level : {Level::act, Level::look, Level::fine}) {
    for (const Finding& finding : findings) {
      if (finding.level == level)
        text += fmt::format("| {} | {} | {} |\n", to_text(level), markdown_cell(finding.what),
                            markdown_cell(finding.advice));
    }
  }
  return text;
}

nlohmann::json contact_to_json(const std::vector<Finding>& findings, bool answered, UtcTime now) {
  nlohmann::json json{{"type", "first_contact"},
                      {"time", to_iso8601(now)},
                      {"contact", answered},
                      {"findings", nlohmann::json::array()}};
  for (const Finding& finding : findings)
    json["findings"].push_back(
        {{"level", to_text(finding.level)}, {"what", finding.what}, {"advice", finding.advice}});
  return json;
}

}  // namespace srfs::ground::pass
