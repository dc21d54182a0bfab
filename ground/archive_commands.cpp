// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/archive_commands.hpp"

#include <algorithm>
#include <cstdio>
#include <functional>

#include <fmt/format.h>

#include "ground/archive/archive_copy.hpp"
#include "ground/archive/archive_report.hpp"
#include "ground/archive/recorder.hpp"
#include "ground/terminal_text.hpp"

namespace srfs::ground {
namespace {

constexpr std::size_t points_default = 2000;
constexpr seconds progress_period{1};

Exit fail(const std::string& message) {
  std::fprintf(stderr, "srfs-ground: %s\n", message.c_str());
  return Exit::unusable;
}

void put(const std::string& text) {
  std::fwrite(text.data(), 1, text.size(), stdout);
}

/// Writes rows in the form that was asked for: a line for people, or an object.
class Rows {
 public:
  Rows(RowForm form, std::vector<std::string> columns) : form_(form), columns_(std::move(columns)) {
    if (form_ == RowForm::csv) put(csv_line(columns_));
  }
  void write(const nlohmann::json& object, const std::string& line) const {
    if (form_ == RowForm::lines) put(line);
    if (form_ == RowForm::json)
      put(object.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace) + "\n");
    if (form_ == RowForm::csv) put(csv_line(object, columns_));
  }

 private:
  RowForm form_;
  std::vector<std::string> columns_;
};

using Work = std::function<Archive::Outcome(Archive&)>;

/// Opens the archive and does @p work with it.
Exit with_archive(const ArchiveCommand& command, ArchiveUse use, const Work& work) {
  const auto archive = open_archive(command.place, use);
  if (!archive) return fail(archive.error());
  const auto done = work(**archive);
  return done ? Exit::done : fail(done.error());
}

std::size_t most_of(const ArchiveCommand& command) {
  return command.most == 0 ? SIZE_MAX : command.most;
}

/// The newest so many packets of a filter, oldest first.
Archive::Outcome newest(Archive& archive, PacketFilter filter, std::size_t most,
                        const std::function<bool(const StoredPacket&)>& wanted,
                        const std::function<void(const StoredPacket&)>& take) {
  if (most == SIZE_MAX) {
    return archive.packets(filter, [&](const StoredPacket& stored) {
      if (wanted(stored)) take(stored);
      return true;
    });
  }
  filter.newest_first = true;
  std::vector<StoredPacket> found;
  const auto done = archive.packets(filter, [&](const StoredPacket& stored) {
    if (wanted(stored)) found.push_back(stored);
    return found.size() < most;
  });
  for (auto stored = found.rbegin(); stored != found.rend(); ++stored) take(*stored);
  return done;
}

}  // namespace

Exit show_events(const ArchiveCommand& command, const mission::Dictionary& dictionary) {
  return with_archive(command, ArchiveUse::read, [&](Archive& archive) {
    const Rows rows(command.form, {"time", "source", "event", "severity", "text"});
    PacketFilter filter;
    filter.period = command.period;
    filter.service = std::uint8_t{5};
    return newest(
        archive, filter, most_of(command),
        [&](const StoredPacket& stored) { return stored.packet.packet.subtype >= command.severity; },
        [&](const StoredPacket& stored) {
          const TelemetryReport report = decode_telemetry(dictionary, stored.packet);
          rows.write(to_json(report), to_lines(report, false));
        });
  });
}

Exit show_packets(const ArchiveCommand& command, const mission::Dictionary& dictionary) {
  PacketFilter filter;
  filter.period = command.period;
  if (!command.source.empty()) {
    const auto* process = dictionary.apid_of_node(command.source);
    for (const auto& other : dictionary.apids()) {
      if (other.name == command.source) process = &other;
    }
    if (process == nullptr) return fail(fmt::format("no application process is called '{}'", command.source));
    filter.apid = process->apid;
  }
  return with_archive(command, ArchiveUse::read, [&](Archive& archive) {
    const Rows rows(command.form, {"time", "received", "source", "apid", "sequence", "service", "subtype",
                                   "structure", "live", "retrieved", "verified", "octets"});
    return newest(
        archive, filter, most_of(command), [](const StoredPacket&) { return true; },
        [&](const StoredPacket& stored) {
          const TelemetryReport report = decode_telemetry(dictionary, stored.packet);
          nlohmann::json json = to_json(report);
          json["id"] = stored.id;
          json["received"] = to_iso8601(stored.received);
          json["live"] = stored.live;
          json["retrieved"] = stored.retrieved;
          json["octets"] = to_hex(stored.packet.raw);
          rows.write(json, to_lines(report, false));
        });
  });
}

Exit show_commands(const ArchiveCommand& command, const mission::Dictionary& dictionary) {
  return with_archive(command, ArchiveUse::read, [&](Archive& archive) -> Archive::Outcome {
    const auto found = archive.telecommands(command.period, most_of(command));
    if (!found) return Err(found.error());
    const Rows rows(command.form,
                    {"sent", "verdict", "name", "arguments", "who", "request", "ad", "scheduled"});
    const UtcTime now = system_utc_now();
    for (const auto& stored : *found)
      rows.write(to_json(stored, dictionary, now), to_line(stored, dictionary, now));
    return {};
  });
}

Exit show_history(const ArchiveCommand& command, const mission::Dictionary& dictionary) {
  return with_archive(command, ArchiveUse::read, [&](Archive& archive) -> Archive::Outcome {
    const auto points = history(archive, dictionary, command.parameter, command.period,
                                command.most == 0 ? points_default : command.most);
    if (!points) return Err(points.error());
    const Rows rows(command.form, {"time", "count", "min", "mean", "max", "worst"});
    for (const Point& point : *points) {
      const Aggregate& values = point.values;
      std::string line = fmt::format("{}  {}", to_iso8601(point.time), values.mean);
      if (values.count > 1)
        line += fmt::format("  {} to {}, {} values", values.min, values.max, values.count);
      if (values.worst > mission::LimitState::green) line += fmt::format("  ({})", to_text(values.worst));
      rows.write(to_json(point, command.parameter), line + "\n");
    }
    return {};
  });
}

Exit show_gaps(const ArchiveCommand& command, const mission::Dictionary& dictionary) {
  return with_archive(command, ArchiveUse::read, [&](Archive& archive) -> Archive::Outcome {
    const auto found = archive.gaps(command.period, false);
    if (!found) return Err(found.error());
    const Rows rows(command.form,
                    {"source", "apid", "first", "count", "from", "to", "missing", "attempts", "state"});
    for (const StoredGap& stored : *found) {
      const nlohmann::json json = to_json(stored, dictionary);
      const std::string count =
          stored.gap.count ? fmt::format("{}", *stored.gap.count) : "an unknown number of";
      rows.write(json, fmt::format("{} to {}  {}: {} packets, {} ({} missing)\n", to_iso8601(stored.gap.from),
                                   to_iso8601(stored.gap.to), json["source"].get<std::string>(), count,
                                   to_text(stored.state), stored.missing));
    }
    return {};
  });
}

Exit show_passes(const ArchiveCommand& command) {
  return with_archive(command, ArchiveUse::read, [&](Archive& archive) -> Archive::Outcome {
    const auto found = archive.passes(command.period);
    if (!found) return Err(found.error());
    const Rows rows(command.form, {"began", "ended", "packets"});
    for (const Pass& pass : *found)
      rows.write(to_json(pass), fmt::format("{} to {}  {} packets\n", to_iso8601(pass.began),
                                            to_iso8601(pass.ended), pass.packets));
    return {};
  });
}

Exit show_transfers(const ArchiveCommand& command) {
  return with_archive(command, ArchiveUse::read, [&](Archive& archive) -> Archive::Outcome {
    const auto found = archive.files(command.period);
    if (!found) return Err(found.error());
    const Rows rows(command.form, {"time", "id", "direction", "name", "event", "octets"});
    for (const FileEntry& file : *found)
      rows.write(to_json(file),
                 fmt::format("{}  {:<4} {:<14} {}  {}\n", to_iso8601(file.time), file.direction,
                             file.transaction, for_terminal(file.name), file.event));
    return {};
  });
}

Exit check_archive(const ArchiveCommand& command) {
  const auto archive = open_archive(command.place, ArchiveUse::read);
  const auto wrong = archive ? (*archive)->check() : Err(archive.error());
  if (!wrong) return fail(wrong.error());
  for (const std::string& problem : *wrong) put(for_terminal(problem) + "\n");
  const char* const advice = is_shared(command.place)
                                 ? "it comes from below the database: its backup, or pg_amcheck, help\n"
                                 : "end the server, then: srfs-ground archive repair\n";
  put(wrong->empty() ? "nothing is wrong\n" : advice);
  return wrong->empty() ? Exit::done : Exit::refused;
}

Exit repair(const ArchiveCommand& command) {
  if (is_shared(command.place))
    return fail("archive repair is for SQLite files; a PostgreSQL is restored from its backup");
  const auto repaired = repair_archive(command.place.address);
  if (!repaired) return fail(repaired.error());
  if (repaired->completed) {
    put("an interrupted repair is complete\n");
    return Exit::done;
  }
  put(fmt::format("{} rows kept, {} lost; the damaged file is {}\n", repaired->rows, repaired->lost,
                  repaired->damaged.string()));
  for (const std::string& table : repaired->incomplete) put(fmt::format("of {} more may be lost\n", table));
  return repaired->incomplete.empty() ? Exit::done : Exit::refused;
}

Exit rebuild(const ArchiveCommand& command) {
  return with_archive(command, ArchiveUse::care, [](Archive& archive) {
    auto done = archive.forget_minutes();
    if (done) put("srfs-ground serve makes the aggregates anew\n");
    return done;
  });
}

Exit prune(const ArchiveCommand& command) {
  return with_archive(command, ArchiveUse::care, [&](Archive& archive) -> Archive::Outcome {
    const auto rows = archive.prune(command.table, *command.period.to);
    if (!rows) return Err(rows.error());
    put(fmt::format("{} rows of {} removed\n", *rows, command.table));
    return {};
  });
}

Exit copy(const ArchiveCommand& command) {
  MonotonicTime next = monotonic_now() + progress_period;
  const auto copied = copy_archive(command.place, command.target, [&](const CopiedRows& so_far) {
    if (monotonic_now() < next) return;
    next = monotonic_now() + progress_period;
    std::fprintf(stderr, "%s: %llu rows so far\n", so_far.table.c_str(),
                 static_cast<unsigned long long>(so_far.read));
  });
  if (!copied) return fail(copied.error());
  const Rows rows(command.form, {"table", "read", "added"});
  for (const CopiedRows& of : *copied)
    rows.write({{"type", "copied"}, {"table", of.table}, {"read", of.read}, {"added", of.added}},
               fmt::format("{}: {} rows, {} of them new\n", of.table, of.read, of.added));
  return Exit::done;
}

}  // namespace srfs::ground
