// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/commanding.hpp"

#include <algorithm>

#include <fmt/format.h>
#include <mission/structures.hpp>

namespace srfs::ground {
namespace {

constexpr std::uint8_t verification_service = 1;

/// The subtype of a success is that of its stage, a failure's is one more; there is no success of routing.
std::optional<std::pair<Stage, Outcome>> stage_of(std::uint8_t subtype) {
  const bool failed = subtype % 2 == 0;
  const auto stage = static_cast<Stage>(subtype - (failed ? 1 : 0));
  if (!is_valid(stage) || (stage == Stage::routing && !failed)) return std::nullopt;
  return std::pair(stage, failed ? Outcome::failed : Outcome::passed);
}

std::string_view to_text(Stage stage, bool failed) {
  switch (stage) {
    case Stage::acceptance:
    case Stage::routing:
      return failed ? "rejected" : "accepted";
    case Stage::start:
      return failed ? "start_failed" : "started";
    case Stage::progress:
      return failed ? "progress_failed" : "progress";
    case Stage::completion:
      return failed ? "failed" : "completed";
  }
  return "?";
}

}  // namespace

std::string_view to_text(const StageReport& report) {
  switch (report.outcome) {
    case Outcome::sent:
      return "sent";
    case Outcome::scheduled:
      return "scheduled";
    case Outcome::passed:
      return to_text(report.stage, false);
    case Outcome::failed:
      return to_text(report.stage, true);
    case Outcome::timed_out:
      return "timed_out";
    case Outcome::not_sent:
      return "not_sent";
    case Outcome::unknown:
      return "unknown";
  }
  return "?";
}

StageReport Commanding::sent(const wire::RequestId& request, const mission::Command& command,
                             milliseconds patience, std::uint64_t tag, MonotonicTime now) {
  forget_late(request);
  make_room();
  outstanding_.push_back({request, &command, tag, now, patience, now + patience});
  return report_of(outstanding_.back(), Outcome::sent, now);
}

void Commanding::forget_late(const wire::RequestId& request) {
  std::erase_if(outstanding_, [&](const auto& t) { return t.timed_out && t.request == request; });
}

void Commanding::forget_late(MonotonicTime now) {
  std::erase_if(outstanding_, [&](const auto& t) { return t.timed_out && now >= t.deadline + late_longest; });
}

void Commanding::make_room() {
  if (outstanding_.size() < max_outstanding) return;
  const auto late =
      std::find_if(outstanding_.begin(), outstanding_.end(), [](const auto& t) { return t.timed_out; });
  outstanding_.erase(late == outstanding_.end() ? outstanding_.begin() : late);
}

void Commanding::follow_scheduled(const wire::RequestId& request, const mission::Command& command,
                                  milliseconds patience, std::uint64_t tag, MonotonicTime now) {
  static_cast<void>(sent(request, command, patience, tag, now));
  outstanding_.back().scheduled = true;
}

std::optional<StageReport> Commanding::on_inserted(const wire::RequestId& request, bool success,
                                                   MonotonicTime now) {
  const auto newest = std::find_if(outstanding_.rbegin(), outstanding_.rend(),
                                   [&](const auto& t) { return t.scheduled && t.request == request; });
  if (newest == outstanding_.rend()) return std::nullopt;
  StageReport report = report_of(*newest, success ? Outcome::scheduled : Outcome::not_sent, now);
  if (success) return report;
  report.failure_text = "could not be scheduled";
  outstanding_.erase(std::next(newest).base());
  return report;
}

std::size_t Commanding::outstanding() const {
  return static_cast<std::size_t>(std::count_if(outstanding_.begin(), outstanding_.end(),
                                                [](const auto& t) { return !t.scheduled && !t.timed_out; }));
}

std::optional<StageReport> Commanding::on_packet(const wire::TmPacket& packet, MonotonicTime now) {
  const auto stage = stage_of(packet.subtype);
  if (packet.service != verification_service || !stage) return std::nullopt;
  OctetReader in(packet.source);
  const std::uint16_t identification = in.u16();
  const wire::RequestId request{identification, in.u16()};
  forget_late(now);
  // Sequence counts wrap: the newest telecommand with this id is meant.
  const auto newest = std::find_if(outstanding_.rbegin(), outstanding_.rend(),
                                   [&](const auto& t) { return t.request == request; });
  if (!in.ok() || newest == outstanding_.rend()) return std::nullopt;
  StageReport report = report_of(*newest, stage->second, now);
  report.stage = stage->first;
  if (report.stage == Stage::progress) report.step = in.u8();
  if (report.is_failure()) read_failure(in, report);
  if (report.is_final()) outstanding_.erase(std::next(newest).base());
  return report;
}

void Commanding::extend(std::uint64_t tag, MonotonicTime now) {
  for (auto& telecommand : outstanding_) {
    if (telecommand.tag == tag)
      telecommand.deadline = std::max(telecommand.deadline, now + telecommand.patience);
  }
}

void Commanding::extend(const wire::RequestId& request, MonotonicTime now) {
  for (auto& telecommand : outstanding_) {
    if (telecommand.request == request)
      telecommand.deadline = std::max(telecommand.deadline, now + telecommand.patience);
  }
}

std::vector<StageReport> Commanding::on_time(MonotonicTime now) {
  forget_late(now);
  std::vector<StageReport> reports;
  for (auto& telecommand : outstanding_) {
    if (telecommand.timed_out || telecommand.deadline > now) continue;
    reports.push_back(report_of(telecommand, Outcome::timed_out, now));
    telecommand.timed_out = true;
  }
  return reports;
}

std::optional<MonotonicTime> Commanding::next_deadline() const {
  std::optional<MonotonicTime> next;
  for (const auto& telecommand : outstanding_) {
    if (!telecommand.timed_out && (!next || telecommand.deadline < *next)) next = telecommand.deadline;
  }
  return next;
}

StageReport Commanding::report_of(const Outstanding& telecommand, Outcome outcome, MonotonicTime now) const {
  StageReport report;
  report.request = telecommand.request;
  report.command = telecommand.command;
  report.tag = telecommand.tag;
  report.outcome = outcome;
  report.elapsed = now - telecommand.sent;
  report.late = telecommand.timed_out;
  if (outcome == Outcome::timed_out)
    report.failure_text = fmt::format("no final report within {} ms", report.elapsed / milliseconds(1));
  return report;
}

void Commanding::read_failure(OctetReader& in, StageReport& report) const {
  report.failure_code = in.u16();
  if (!in.ok()) {
    report.failure_text = "the report carries no failure code";
    return;
  }
  const auto* code = dictionary_.failure_code(report.failure_code);
  report.failure_name = code == nullptr ? "unknown" : code->name;
  report.failure_text = code == nullptr ? "failure code unknown to the dictionary" : code->text;
  if (report.failure_code == mission::failure::bad_argument && in.remaining() == 1) {
    const std::size_t number = in.u8();
    const auto& arguments = report.command->arguments;
    report.failure_text += fmt::format(": argument {}", number);
    if (number >= 1 && number <= arguments.size())
      report.failure_text += fmt::format(" '{}'", arguments[number - 1].name);
  } else if (report.failure_code == mission::failure::scheduled_request_refused && in.remaining() == 4) {
    const unsigned activity = in.u8();
    const std::uint16_t reason = in.u16();
    const unsigned argument = in.u8();
    const auto* inner = dictionary_.failure_code(reason);
    report.failure_text += fmt::format(": activity {}: {}", activity,
                                       inner == nullptr ? fmt::format("code {}", reason) : inner->text);
    if (argument != 0) report.failure_text += fmt::format(": argument {}", argument);
  } else if (in.remaining() > 0) {
    report.failure_text += fmt::format(" ({})", to_hex(in.rest()));
  }
}

bool Retrieval::on_packet(const ReceivedPacket& received, MonotonicTime now) {
  if (received.vc == tm_channel::playback) {
    if (counting_) {
      ++received_;
      last_news_ = now;
    }
    return false;
  }
  const auto& packet = received.packet;
  if (!started_ || expected_ || packet.service != 5 || packet.apid != mission::apid::ttc) return false;
  OctetReader in(packet.source);
  if (in.u16() != mission::event::ttc_retrieval_done || !in.ok()) return false;
  const auto done = mission::TtcRetrievalDoneEvent::decode(in);
  if (!done || done->store != store_) return false;
  expected_ = done->packets;
  last_news_ = now;
  return true;
}

void Retrieval::on_stage(const StageReport& report, MonotonicTime now) {
  if (report.outcome == Outcome::passed && report.stage == Stage::start && report.command != nullptr &&
      report.command->service == mission::StorageRetrieve::service &&
      report.command->subtype == mission::StorageRetrieve::subtype) {
    counting_ = report.tag == tag_;
    started_ = started_ || counting_;
  }
  if (report.tag != tag_ || !report.is_final()) return;
  last_news_ = now;
  (report.is_failure() ? failed_ : completed_) = true;
}

bool Retrieval::is_over(MonotonicTime now) const {
  return failed_ || is_complete() || (completed_ && now - last_news_ >= patience);
}

}  // namespace srfs::ground
