// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/files.hpp"

#include <algorithm>
#include <charconv>

#include <fmt/format.h>

#include "base/file.hpp"
#include "ground/terminal_text.hpp"

namespace srfs::ground {
namespace {

constexpr std::uint64_t ground_entity = 1;
constexpr std::uint64_t spacecraft_entity = 2;

std::string_view state_text(const cfdp::Report& report) {
  switch (report.rest) {
    case cfdp::Rest::by_request:
      return "suspended";
    case cfdp::Rest::by_fault:
      return "waits for contact";
    case cfdp::Rest::none:
      break;
  }
  return report.waits_for_peer ? "waits for the other end" : "under way";
}

std::uint64_t done_octets(const cfdp::Report& report) {
  const std::uint64_t missing = report.role == cfdp::Role::sending ? report.missing_octets : 0;
  return report.progress_octets - std::min(report.progress_octets, missing);
}

std::string_view direction_text(cfdp::Role role) {
  return role == cfdp::Role::sending ? "up" : "down";
}

/// The server ended, and what became of the file was not seen.
bool is_unknown(const cfdp::News& news) {
  const cfdp::Outcome& outcome = news.event.outcome;
  return news.event.kind == cfdp::EventKind::finished && outcome.incomplete &&
         outcome.condition == cfdp::CfdpCondition::no_error &&
         outcome.file_status == wire::CfdpFileStatus::unreported;
}

}  // namespace

Result<std::unique_ptr<cfdp::TransferFolders>, std::string> open_files(const std::filesystem::path& state_dir,
                                                                       UtcTime utc, MonotonicTime now) {
  // Room for all that the spacecraft sends at once, and for what goes up.
  const cfdp::Settings settings{.own_entity = ground_entity,
                                .peer_entity = spacecraft_entity,
                                .transactions_max = 32,
                                .receiving_max = 16,
                                .receiving_octets_max = std::uint64_t{4} << 30,
                                .safe_names = true};
  std::error_code error;
  std::filesystem::create_directories(state_dir, error);
  if (error) return Err(fmt::format("{}: {}", state_dir.string(), error.message()));
  // Above all that were ever used, should the checkpoint be lost.
  const auto first = static_cast<std::uint32_t>(utc.ns() / 1'000'000'000);
  auto opened = cfdp::TransferFolders::open(state_dir / "files", state_dir / "cfdp", settings, first, now);
  if (!opened) return Err(opened.error().message);
  return std::move(*opened);
}

std::optional<std::string> wrong_name_on_board(const std::string& name) {
  if (!name.empty() && name.front() != '.' && name.find('/') == std::string::npos) return std::nullopt;
  return fmt::format("'{}': a name on board contains no '/' and does not start with a dot", name);
}

Result<cfdp::TransactionId, std::string> put_file(cfdp::TransferFolders& transfer_folders,
                                                  const std::filesystem::path& file,
                                                  const std::string& name) {
  if (auto wrong = wrong_name_on_board(name)) return Err(std::move(*wrong));
  if (transfer_folders.sending(name))
    return Err(fmt::format("{}: a file with this name is already being sent", name));
  const std::filesystem::path part = transfer_folders.outbox() / ("." + name + ".part");
  std::error_code error;
  std::filesystem::copy_file(file, part, std::filesystem::copy_options::overwrite_existing, error);
  if (!error) std::filesystem::rename(part, transfer_folders.outbox() / name, error);
  if (error) return Err(fmt::format("{}: {}", file.string(), error.message()));
  transfer_folders.scan();
  const auto id = transfer_folders.sending(name);
  if (!id) return Err(fmt::format("{}: waiting in the queue, or cannot be sent", name));
  return *id;
}

Result<cfdp::TransactionId, std::string> put_or_resume(cfdp::TransferFolders& transfer_folders,
                                                       const std::filesystem::path& file,
                                                       const std::string& name) {
  const auto under_way = transfer_folders.sending(name);
  if (!under_way) return put_file(transfer_folders, file, name);
  const auto wanted = read_file(file);
  if (!wanted) return Err(wanted.error().message);
  const auto sent = read_file(transfer_folders.outbox() / name);
  if (!sent) return Err(sent.error().message);
  if (*sent != *wanted) return Err(fmt::format("{}: another file with this name is being sent", name));
  return *under_way;
}

std::string to_text(cfdp::TransactionId id) {
  return fmt::format("{}:{}", id.source, id.sequence);
}

std::optional<cfdp::TransactionId> parse_transaction(const std::string& text) {
  cfdp::TransactionId id;
  const char* const last = text.data() + text.size();
  const auto source = std::from_chars(text.data(), last, id.source);
  if (source.ec != std::errc() || source.ptr == last || *source.ptr != ':') return std::nullopt;
  const auto sequence = std::from_chars(source.ptr + 1, last, id.sequence);
  if (sequence.ec != std::errc() || sequence.ptr != last) return std::nullopt;
  return id;
}

bool has_arrived(const cfdp::News& news) {
  return news.event.kind == cfdp::EventKind::finished &&
         news.event.outcome.condition == cfdp::CfdpCondition::no_error && !news.event.outcome.incomplete;
}

nlohmann::json to_json(const cfdp::Report& report) {
  nlohmann::json json{{"type", "file"},
                      {"event", "progress"},
                      {"id", to_text(report.id)},
                      {"direction", direction_text(report.role)},
                      {"name", report.destination_file},
                      {"octets", nullptr},
                      {"progress", done_octets(report)},
                      {"missing", report.missing_octets},
                      {"state", state_text(report)}};
  if (report.file_octets) json["octets"] = *report.file_octets;
  return json;
}

nlohmann::json to_json(const cfdp::News& news) {
  nlohmann::json json = to_json(news.file);
  json["id"] = to_text(news.event.id);
  json["direction"] = direction_text(news.event.role);
  json["event"] = cfdp::to_string(news.event.kind);
  const bool finished = news.event.kind == cfdp::EventKind::finished;
  if (finished) {
    json["success"] = has_arrived(news);
    json.erase("state");
  }
  if (finished || news.event.kind == cfdp::EventKind::fault) {
    json["condition"] = is_unknown(news) ? "unknown" : wire::to_string(news.event.outcome.condition);
  }
  if (news.event.kind == cfdp::EventKind::fault) json["reaction"] = cfdp::to_string(news.event.handler);
  if (news.event.file_fault) json["problem"] = cfdp::to_string(*news.event.file_fault);
  return json;
}

std::string to_line(const cfdp::Report& report) {
  std::string line = fmt::format("{:<4} {:<12} {:<20}", direction_text(report.role), to_text(report.id),
                                 for_terminal(report.destination_file));
  const std::uint64_t done = done_octets(report);
  if (!report.file_octets) return line + fmt::format("  {} octets", done);
  constexpr std::uint64_t width = 24;
  const std::uint64_t all = std::max<std::uint64_t>(*report.file_octets, 1);
  const auto filled = static_cast<std::size_t>(std::min(done * width / all, width));
  line += fmt::format("  [{}{}] {:3} %  {} of {} octets, {}", std::string(filled, '#'),
                      std::string(width - filled, '.'), std::min<std::uint64_t>(done * 100 / all, 100), done,
                      *report.file_octets, state_text(report));
  if (report.missing_octets > 0) line += fmt::format(", {} lost", report.missing_octets);
  return line;
}

std::string to_line(const cfdp::News& news) {
  std::string line = fmt::format("{:<4} {:<12} {:<20}  ", direction_text(news.event.role),
                                 to_text(news.event.id), for_terminal(news.file.destination_file));
  if (has_arrived(news)) return line + fmt::format("arrived, {} octets", news.file.file_octets.value_or(0));
  if (is_unknown(news)) {
    line += "ended while the server was away; whether it arrived is not known";
  } else if (news.event.kind == cfdp::EventKind::finished) {
    line += fmt::format("ended: {}", wire::to_string(news.event.outcome.condition));
  } else if (news.event.kind == cfdp::EventKind::fault) {
    line += fmt::format("{}: {}", wire::to_string(news.event.outcome.condition),
                        cfdp::to_string(news.event.handler));
  } else {
    line += cfdp::to_string(news.event.kind);
  }
  if (news.event.file_fault) line += fmt::format(" ({})", cfdp::to_string(*news.event.file_fault));
  return line;
}

}  // namespace srfs::ground
