// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/station.hpp"

#include <algorithm>
#include <utility>

#include <mission/structures.hpp>

#include "ground/arming.hpp"

namespace srfs::ground {
namespace {

constexpr milliseconds longest_schedule = std::chrono::hours(24);  ///< of a telecommand of another user

}  // namespace

Station::Station(const mission::Dictionary& dictionary, std::unique_ptr<StationLink> link,
                 StationOutput output)
    : dictionary_(dictionary),
      link_(std::move(link)),
      commanding_(dictionary),
      others_(dictionary),
      output_(std::move(output)) {
  link_->set_output(
      {.packet = [this](const auto& packet) { on_packet(packet, monotonic_now()); },
       .ad = [this](auto number, auto progress) { on_ad(number, progress); },
       .cop = output_.cop,
       .file = output_.file,
       .keys = output_.keys,
       .problem = output_.problem,
       .note = output_.note,
       .telecommand = [this](const auto& seen) { on_telecommand_of_other(seen, monotonic_now()); },
       .line_opened = output_.line_opened});
}

void Station::on_telecommand_of_other(const SeenTelecommand& seen, MonotonicTime now) {
  const auto* command = dictionary_.command(seen.name);
  if (command == nullptr || !output_.stage_of_other) return;
  if (whose_.size() == Commanding::max_outstanding) whose_.erase(whose_.begin());
  const std::uint64_t tag = next_other_++;
  whose_[tag] = seen.who;
  commanding_.forget_late(seen.request);
  if (seen.scheduled) return others_.follow_scheduled(seen.request, *command, longest_schedule, tag, now);
  tell_stage_of_other(others_.sent(seen.request, *command, command->timeout + report_margin, tag, now));
}

void Station::tell_stage_of_other(StageReport report) {
  const auto whose = whose_.find(std::exchange(report.tag, 0));
  report.who = whose == whose_.end() ? "?" : whose->second;
  if (whose != whose_.end() && report.has_ended()) whose_.erase(whose);
  output_.stage_of_other(report);
}

Result<wire::RequestId, OrderError> Station::send(const std::string& command,
                                                  const std::vector<std::string>& arguments,
                                                  std::optional<milliseconds> patience, std::uint64_t tag,
                                                  const std::string& token, bool again, bool recorded_alone) {
  const auto encoded = dictionary_.encode(command, arguments);
  if (!encoded) return refused(encoded.error().message);
  return dispatch(*encoded, arguments, patience, tag, token, again, recorded_alone, std::nullopt);
}

Result<wire::RequestId, OrderError> Station::send_at(UtcTime release, const std::string& command,
                                                     const std::vector<std::string>& arguments,
                                                     std::optional<milliseconds> patience, std::uint64_t tag,
                                                     const std::string& token, bool again,
                                                     bool recorded_alone) {
  const auto encoded = dictionary_.encode(command, arguments);
  if (!encoded) return refused(encoded.error().message);
  const auto made = link_->make_packet({.command = *encoded, .arguments = arguments});
  if (!made) return Err(made.error());
  constexpr int decimals = 9;
  const std::vector<std::string> inserted{"release=" + to_iso8601(release, decimals),
                                          "request=" + to_hex(made->packet)};
  const auto insertion = dictionary_.encode(mission::ScheduleInsert::name, inserted);
  if (!insertion) return refused(insertion.error().message);
  const auto left = std::chrono::ceil<milliseconds>(release - system_utc_now());
  const milliseconds wait =
      std::max(left, milliseconds(0)) + patience.value_or(encoded->command->timeout + report_margin);
  return dispatch(*insertion, inserted, std::nullopt, tag, token, again, recorded_alone,
                  Scheduled{made->request, encoded->command, wait});
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
  const bool may_be_there = report.outcome == Outcome::timed_out || report.outcome == Outcome::unknown;
  if (may_be_there) return;
  const auto inserted = commanding_.on_inserted(telecommand, report.is_completed(), now);
  if (inserted && output_.stage) output_.stage(*inserted);
}

Result<wire::RequestId, OrderError> Station::dispatch(const mission::EncodedCommand& encoded,
                                                      const std::vector<std::string>& arguments,
                                                      std::optional<milliseconds> patience, std::uint64_t tag,
                                                      const std::string& token, bool again,
                                                      bool recorded_alone,
                                                      const std::optional<Scheduled>& scheduled) {
  const bool retrieves = encoded.command->service == mission::StorageRetrieve::service &&
                         encoded.command->subtype == mission::StorageRetrieve::subtype;
  if (retrieves && retrievals_.size() == max_retrievals)
    return refused("too many retrievals are in progress");
  const milliseconds wait = patience.value_or(encoded.command->timeout + report_margin);
  if (encoded.command->name == mission::TtcSelectKeys::name) {
    if (asked_keys_.size() == Commanding::max_outstanding) asked_keys_.erase(asked_keys_.begin());
    const auto select = mission::TtcSelectKeys::decode(OctetView(encoded.data).subspan(2));
    if (select && select->vc == link_->vc())
      asked_keys_[tag] =
          select->set == mission::KeySet::b ? suite::AssociationSet::b : suite::AssociationSet::a;
  }
  const bool by_ad = link_->cop().phase != AdPhase::off;
  const std::uint64_t number = next_ad_number_++;
  const auto request = link_->send({.command = encoded,
                                    .arguments = arguments,
                                    .number = number,
                                    .ad = by_ad,
                                    .token = token,
                                    .recorded_alone = recorded_alone,
                                    .again = again});
  if (request) {
    const MonotonicTime now = monotonic_now();
    if (by_ad) ad_telecommands_[number] = {*request, encoded.command, wait, tag};
    if (retrieves) {
      const auto packets = mission::StorageRetrieve::decode(encoded.data);
      if (packets) retrievals_.emplace_back(tag, packets->front().store);
    }
    follow(*request, scheduled, tag, now);
    others_.forget_late(*request);
    if (!by_ad) on_stage(commanding_.sent(*request, *encoded.command, wait, tag, now), now);
  }
  link_->settle();
  return request;
}

Result<wire::RequestId, OrderError> Station::arm(const std::string& command,
                                                 const std::vector<std::string>& arguments,
                                                 std::optional<milliseconds> patience, std::uint64_t tag,
                                                 std::optional<UtcTime> release) {
  const auto encoded = dictionary_.encode(command, arguments);
  if (!encoded) return refused(encoded.error().message);
  const TelecommandText arming = arming_of(*encoded);
  return release ? send_at(*release, arming.name, arming.arguments, patience, tag)
                 : send(arming.name, arming.arguments, patience, tag);
}

void Station::on_ad(std::uint64_t number, AdProgress progress) {
  const auto found = ad_telecommands_.find(number);
  if (found == ad_telecommands_.end()) return;
  AdTelecommand& telecommand = found->second;
  const MonotonicTime now = monotonic_now();
  switch (progress) {
    case AdProgress::transmitted:
      if (std::exchange(telecommand.transmitted, true))
        commanding_.extend(telecommand.request, now);
      else
        on_stage(commanding_.sent(telecommand.request, *telecommand.command, telecommand.patience,
                                  telecommand.tag, now),
                 now);
      return;
    case AdProgress::delivered:
    case AdProgress::undelivered:  // it may have arrived: its reports or its patience decide
      return end_ad(found, std::nullopt, "");
    case AdProgress::not_sent:
      return end_ad(found, Outcome::not_sent, "the AD service ended before the telecommand was transmitted");
    case AdProgress::unknown:
      if (telecommand.transmitted) return end_ad(found, std::nullopt, "");
      return end_ad(found, Outcome::unknown, "it is not known whether it was sent: the server ended");
  }
}

void Station::end_ad(std::map<std::uint64_t, AdTelecommand>::iterator telecommand,
                     std::optional<Outcome> outcome, const std::string& why) {
  const MonotonicTime now = monotonic_now();
  const AdTelecommand ended = telecommand->second;
  ad_telecommands_.erase(telecommand);
  if (!outcome) return commanding_.extend(ended.request, now);
  StageReport report;
  report.request = ended.request;
  report.command = ended.command;
  report.tag = ended.tag;
  report.outcome = *outcome;
  report.failure_text = why;
  on_stage(report, now);
}

Result<void, std::string> Station::on_readable() {
  return link_->on_readable();
}

void Station::on_packet(const ReceivedPacket& received, MonotonicTime now) {
  if (received.authenticity == Authenticity::unverified) {
    if (output_.unverified) output_.unverified(decode_telemetry(dictionary_, received));
    return;
  }
  for (auto& retrieval : retrievals_) {
    if (received.vc == tm_channel::playback) commanding_.extend(retrieval.tag(), now);
    if (retrieval.on_packet(received, now)) break;
  }
  if (received.vc != tm_channel::playback) {
    if (auto report = commanding_.on_packet(received.packet, now)) {
      report->archive_id = received.archive_id;
      on_stage(*report, now);
      return;
    }
    if (auto report = others_.on_packet(received.packet, now)) {
      report->archive_id = received.archive_id;
      tell_stage_of_other(*report);
      return;
    }
  }
  const TelemetryReport report = decode_telemetry(dictionary_, received);
  if (output_.telemetry) output_.telemetry(report);
  end_retrievals(now);
}

void Station::on_stage(const StageReport& stage, MonotonicTime now) {
  StageReport report = stage;
  report.insertion = insertions_.contains(report.request);
  if (output_.stage) output_.stage(report);
  if (report.insertion) on_insertion(report, now);
  for (auto& retrieval : retrievals_) retrieval.on_stage(report, now);
  if (const auto asked = asked_keys_.find(report.tag); asked != asked_keys_.end() && report.has_ended()) {
    // Even if it could not be stored, it holds until the spacecraft's next restart; the beacon shows it.
    if (report.is_completed()) {
      const auto selected = link_->select_keys(asked->second, "ttc.select_keys");
      if (!selected && output_.problem) output_.problem(selected.error().text);
    }
    asked_keys_.erase(report.tag);
  }
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

Result<void, std::string> Station::on_time() {
  auto alive = link_->on_time();
  const MonotonicTime now = monotonic_now();
  for (const auto& report : commanding_.on_time(now)) on_stage(report, now);
  for (const auto& report : others_.on_time(now)) tell_stage_of_other(report);
  end_retrievals(now);
  return alive;
}

std::optional<MonotonicTime> Station::next_deadline() const {
  auto deadline = commanding_.next_deadline();
  if (const auto of_link = link_->next_deadline(); of_link && (!deadline || *of_link < *deadline))
    deadline = of_link;
  if (const auto of_others = others_.next_deadline(); of_others && (!deadline || *of_others < *deadline))
    deadline = of_others;
  if (!retrievals_.empty()) {
    const MonotonicTime look = monotonic_now() + milliseconds(200);
    if (!deadline || look < *deadline) deadline = look;
  }
  return deadline;
}

}  // namespace srfs::ground
