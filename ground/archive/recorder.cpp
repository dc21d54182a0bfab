// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/archive/recorder.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "ground/files.hpp"

namespace srfs::ground {
namespace {

constexpr seconds minute{60};
constexpr milliseconds fill_period{500};
constexpr std::uint8_t housekeeping = 3;

UtcTime begin_of(std::int64_t minute_number) {
  return UtcTime(minute_number * nanoseconds(minute));
}

/// Of service 3 only reports have a structure; without a subtype an index alone answers count().
PacketFilter housekeeping_of(std::uint16_t structure, const Period& period) {
  return {.period = period,
          .apid = {},
          .service = housekeeping,
          .subtype = {},
          .structure = structure,
          .after_id = {}};
}

/// The packets of one minute and structure, decoded.
Result<std::map<std::string, Aggregate>, std::string> aggregates_of(Archive& archive,
                                                                    const mission::Dictionary& dictionary,
                                                                    const Archive::DirtyMinute& dirty) {
  std::vector<TelemetryReport> reports;
  const Period period{begin_of(dirty.minute), begin_of(dirty.minute + 1)};
  const auto read =
      archive.packets(housekeeping_of(dirty.structure, period), [&](const StoredPacket& stored) {
        reports.push_back(decode_telemetry(dictionary, stored.packet));
        return true;
      });
  if (!read) return Err(read.error());
  return aggregate(reports);
}

const mission::Structure* structure_of(const mission::Dictionary& dictionary, const std::string& parameter) {
  for (std::size_t dot = parameter.find('.'); dot != std::string::npos; dot = parameter.find('.', dot + 1)) {
    if (const auto* structure = dictionary.structure(parameter.substr(0, dot))) return structure;
  }
  return nullptr;
}

}  // namespace

void Recorder::judge(const Archive::Outcome& written) {
  if (written) return;
  unrecorded_ += std::exchange(pending_, 0);
  problem_ = written.error();
  if (!std::exchange(failing_, true))
    log_(fmt::format("the archive fails: {}; what comes is shown, and not recorded", written.error()));
}

void Recorder::report_unreadable(const std::string& error) {
  if (!std::exchange(told_unreadable_, true))
    log_(fmt::format("the archive cannot be read: {}; see srfs-ground archive check", error));
}

Archive::Outcome Recorder::commit_all() {
  const auto committed = archive_->commit();
  if (!committed) return Err(committed.error());
  if (!*committed) return {};  // nothing was tried
  pending_ = 0;
  problem_.clear();
  if (std::exchange(failing_, false))
    log_(fmt::format("the archive works again; {} packets were not recorded", std::exchange(unrecorded_, 0)));
  return {};
}

std::int64_t Recorder::on_packet(const ReceivedPacket& packet, UtcTime now) {
  if (filler_) filler_->on_packet(packet, monotonic_now());
  const auto added = archive_->add(packet, now);
  if (added) {
    ++pending_;
    return *added;
  }
  judge(Err(added.error()));
  ++unrecorded_;
  return 0;
}

Archive::Outcome Recorder::on_telecommand(const TelecommandOrder& order, const wire::RequestId& request,
                                          bool scheduled, UtcTime now) {
  auto outcome = archive_->add(TelecommandEntry{.token = order.token,
                                                .request = request,
                                                .sent = now,
                                                .who = order.who,
                                                .name = order.command.command->name,
                                                .arguments = order.arguments,
                                                .ad = order.ad,
                                                .scheduled = scheduled});
  if (outcome) outcome = commit_all();
  judge(outcome);
  return outcome;
}

void Recorder::on_not_sent(const std::string& token) {
  auto outcome = archive_->forget_token(token);
  if (outcome) {
    // Perhaps there was nothing to forget: it does not say that the archive works again.
    const auto committed = archive_->commit();
    if (committed)
      pending_ = 0;
    else
      outcome = Err(committed.error());
  }
  judge(outcome);
}

void Recorder::on_file(const cfdp::News& news, UtcTime now) {
  const cfdp::Event& event = news.event;
  const bool finished = event.kind == cfdp::EventKind::finished;
  const std::string ended =
      has_arrived(news) ? "arrived" : std::string(wire::to_string(event.outcome.condition));
  const auto outcome =
      archive_->add(FileEntry{.time = now,
                              .transaction = to_text(event.id),
                              .direction = event.role == cfdp::Role::sending ? "up" : "down",
                              .name = news.file.destination_file,
                              .event = finished ? ended : std::string(cfdp::to_string(event.kind)),
                              .octets = news.file.file_octets});
  judge(outcome);
}

Archive::Outcome Recorder::acknowledge(std::int64_t packet, const Acknowledgement& acknowledgement) {
  const auto done = archive_->acknowledge(packet, acknowledgement);
  if (!done) {
    judge(Err(done.error()));
    return Err(done.error());
  }
  const auto known = archive_->acknowledgement_of(packet);
  if (!known) return Err(known.error());
  if (!*known) return Err(fmt::format("packet {} is no event of the archive", packet));
  if (!*done) return Err(fmt::format("acknowledged before, by {}", (*known)->who));
  const auto committed = commit_all();
  judge(committed);
  return committed;
}

void Recorder::commit() {
  judge(commit_all());
}

bool Recorder::make_minute(UtcTime now) {
  if (minute_failed_ && now >= *minute_failed_ && now - *minute_failed_ < minute) return false;
  minute_failed_.reset();
  const auto dirty = archive_->dirty_minute(now - minute);
  if (!dirty || !*dirty) {
    static_cast<void>(archive_->commit());  // others write on
    return false;
  }
  auto aggregates = aggregates_of(*archive_, dictionary_, **dirty);
  if (!aggregates) {
    report_unreadable(aggregates.error());
    minute_failed_ = now;
    judge(commit_all());
    return false;
  }
  auto outcome = archive_->set_minute(**dirty, *aggregates);
  if (outcome) outcome = commit_all();
  judge(outcome);
  if (!outcome) minute_failed_ = now;
  return outcome.has_value();
}

void Recorder::close_gaps(const std::vector<std::int64_t>& gaps) {
  for (const std::int64_t gap : gaps) {
    judge(archive_->close_gap(gap));
  }
}

void Recorder::fill(StationLink& link, MonotonicTime now) {
  if (!filler_ || now < next_fill_) return;
  next_fill_ = now + fill_period;
  close_gaps(filler_->on_time(now));
  if (!filler_->is_ready(now)) return;
  auto open = archive_->gaps({}, true);
  if (!open) return report_unreadable(open.error());
  const bool begins = filler_->filling().empty();
  for (const StoredGap& stored : *open) {
    const bool hopeless = GapFiller::is_exhausted(stored) || GapFiller::is_undated(stored);
    if (begins && hopeless) judge(archive_->give_up_gap(stored.id));
  }
  const auto order = filler_->next(GapFiller::to_try(std::move(*open), system_utc_now()), now);
  if (!order) return;
  for (const std::int64_t gap : filler_->filling()) {
    if (!begins) break;
    judge(archive_->count_attempt(gap));
  }
  const auto encoded = dictionary_.encode(order->name, order->arguments);
  if (!encoded) {
    log_("cannot fill a gap: " + encoded.error().message);
    return close_gaps(filler_->give_up());
  }
  const auto sent = link.send({.command = *encoded,
                               .arguments = order->arguments,
                               .who = "serve --fill",
                               .token = fmt::format("fill-{}-{}", system_utc_now().ns(), fills_++)});
  if (!sent) log_("cannot fill gaps: " + sent.error().text);
  filler_->on_sent(sent ? std::optional(*sent) : std::nullopt, *encoded->command, now);
}

Result<std::optional<wire::RequestId>, std::string> Recorder::request_of(const std::string& token) {
  const auto found = archive_->request_of(token);
  if (!found) report_unreadable(found.error());
  return found;
}

void Recorder::packets_after(std::int64_t id, std::size_t most,
                             const std::function<void(const StoredPacket&)>& take) {
  PacketFilter filter;
  filter.after_id = id;
  filter.most = most;
  const auto read = archive_->packets(filter, [&](const StoredPacket& stored) {
    take(stored);
    return true;
  });
  if (!read) report_unreadable(read.error());
}

Result<std::vector<Point>, std::string> history(Archive& archive, const mission::Dictionary& dictionary,
                                                const std::string& parameter, const Period& period,
                                                std::size_t most) {
  const auto* structure = structure_of(dictionary, parameter);
  if (structure == nullptr)
    return Err(fmt::format("'{}': expected STRUCTURE.FIELD, as in docs/reference/dictionary.md", parameter));
  const auto filter = housekeeping_of(structure->id, period);
  auto bounded = filter;
  bounded.most = most + 1;
  const auto there = archive.count(bounded);
  if (!there) return Err(there.error());
  std::vector<Point> points;
  if (*there <= most) {
    const auto read = archive.packets(filter, [&](const StoredPacket& stored) {
      const TelemetryReport report = decode_telemetry(dictionary, stored.packet);
      for (const auto& field : report.fields) {
        if (parameter_name(report, field) != parameter) continue;
        if (const auto number = number_in(field)) {
          Aggregate value;
          value.add(*number, field.limit);
          points.push_back({to_utc(report.time), value});
        }
      }
      return true;
    });
    if (!read) return Err(read.error());
    return points;
  }
  auto made = archive.minutes(parameter, period);
  if (!made) return made;
  points = std::move(*made);
  const auto dirty = archive.dirty_minutes(structure->id, period);
  if (!dirty) return Err(dirty.error());
  for (const std::int64_t number : *dirty) {
    const auto fresh = aggregates_of(archive, dictionary, {structure->id, number});
    if (!fresh) return Err(fresh.error());
    std::erase_if(points, [&](const Point& point) { return point.time == begin_of(number); });
    const auto values = fresh->find(parameter);
    if (values != fresh->end()) points.push_back({begin_of(number), values->second});
  }
  std::sort(points.begin(), points.end(), [](const auto& a, const auto& b) { return a.time < b.time; });
  return thinned(points, most);
}

}  // namespace srfs::ground
