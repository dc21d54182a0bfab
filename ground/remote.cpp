// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/remote.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <mission/structures.hpp>

#include "base/text.hpp"
#include "ground/terminal_text.hpp"

namespace srfs::ground {
namespace {

using Words = std::vector<std::string>;

const std::string parameter_prefix = "parameter=";
const std::string value_prefix = "value=";

struct Path {
  std::string folder;
  std::string name;
};

Path split(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  if (slash == std::string::npos) return {.folder = "", .name = path};
  return {.folder = path.substr(0, slash), .name = path.substr(slash + 1)};
}

/// "images/" is the folder "images", "/" the folder of files.
std::string folder_of(std::string path) {
  while (path.ends_with('/')) path.pop_back();
  return path;
}

TelecommandText about(const std::string& command, const std::string& path, const std::string& what) {
  const Path parts = split(path);
  return {.name = command, .arguments = {"repository=" + parts.folder, what + "=" + parts.name}};
}

bool is_number(const std::string& word) {
  return to_number<std::uint64_t>(word).has_value();
}

/// Ids of copies, or folders (ending with '/'; "all" is the folder of files).
RemoteRequest about_copies(const std::string& verb, const Words& words) {
  RemoteRequest request;
  for (const std::string& word : words) {
    if (is_number(word)) {
      request.telecommands.push_back({.name = "file." + verb, .arguments = {"operation=" + word}});
    } else {
      const std::string folder = word == "all" ? "" : folder_of(word);
      request.telecommands.push_back(
          {.name = "file." + verb + "_all", .arguments = {"repository=" + folder}});
    }
  }
  return request;
}

RemoteRequest copy_down(const Words& words, UtcTime utc) {
  const Path source = split(words[0]);
  const std::string target = words.size() > 1 ? words[1] : source.name;
  // Another one than the copies that may be under way: a number of the last 49 days.
  const std::uint64_t id =
      std::max<std::uint64_t>(static_cast<std::uint64_t>(utc.ns() / 1'000'000) & UINT32_MAX, 1);
  const Path parts = split(target);
  return {.telecommands = {{.name = "file.copy",
                            .arguments = {fmt::format("operation={}", id),
                                          "source_repository=" + source.folder, "source_file=" + source.name,
                                          "target_repository=ground:" + parts.folder,
                                          "target_file=" + parts.name}}},
          .awaited_file = target};
}

/// The same, for a line.
std::string shown(const TelemetryReport& report, std::string_view field) {
  return for_terminal(field_text(report, field));
}

std::optional<std::uint64_t> number_of(const TelemetryReport& report, std::string_view field) {
  for (const auto& one : report.fields) {
    if (one.name != field) continue;
    const auto* number = std::get_if<std::uint64_t>(&one.value);
    if (number != nullptr) return *number;
  }
  return std::nullopt;
}

/// Each says that one less is left than the one before.
bool count_down(const std::vector<TelemetryReport>& answers) {
  for (std::size_t i = 1; i < answers.size(); ++i) {
    const auto before = number_of(answers[i - 1], "left");
    const auto left = number_of(answers[i], "left");
    if (!before || !left || *before != *left + 1) return false;
  }
  return !answers.empty();
}

std::string path_text(const std::string& folder, const std::string& name) {
  return folder.empty() ? name : folder + "/" + name;
}

std::string copy_line(const TelemetryReport& report) {
  if (field_text(report, "operations") == "0") return "no copy is in progress\n";
  const std::string octets = field_text(report, "octets");
  std::string line = fmt::format("{:<20} {:<4} {:<17} {} of {} octets", field_text(report, "operation"),
                                 field_text(report, "direction"), field_text(report, "state"),
                                 field_text(report, "progress"), octets == "unknown" ? "?" : octets);
  if (field_text(report, "missing") != "0") line += fmt::format(", {} lost", field_text(report, "missing"));
  return line + "  " + shown(report, "file") + "\n";
}

}  // namespace

std::string field_text(const TelemetryReport& report, std::string_view field) {
  for (const auto& one : report.fields) {
    if (one.name == field) return one.text;
  }
  return "";
}

std::string reported_sha256(const TelemetryReport& report) {
  std::string digits;
  for (const auto& field : report.fields) {
    if (field.name.starts_with("sha256") && field.text.size() > 2) digits += field.text.substr(2);
  }
  return digits;
}

std::string remote_actions() {
  return "ls [FOLDER] | stat FILE... | rm FILE... | mkdir FOLDER | rmdir FOLDER | get FILE [NAME] | copies | "
         "suspend|resume|abort ID... | suspend|resume|abort all | suspend|resume|abort FOLDER/";
}

Result<RemoteRequest, std::string> remote_request(const std::string& action, const Words& words,
                                                  UtcTime utc) {
  const auto each = [&](const char* command, const char* what) {
    RemoteRequest request;
    for (const std::string& word : words)
      request.telecommands.push_back(about(command, folder_of(word), what));
    return request;
  };
  if (action == "ls" && words.size() <= 1) {
    const std::string folder = words.empty() ? "" : folder_of(words[0]);
    return RemoteRequest{.telecommands = {{.name = "file.list", .arguments = {"repository=" + folder}}},
                         .awaited_file = "",
                         .lists = true};
  }
  if (action == "stat" && !words.empty()) return each("file.report", "file");
  if (action == "rm" && !words.empty()) return each("file.delete", "file");
  if (action == "mkdir" && words.size() == 1) return each("file.make_folder", "folder");
  if (action == "rmdir" && words.size() == 1) return each("file.remove_folder", "folder");
  if (action == "get" && (words.size() == 1 || words.size() == 2)) return copy_down(words, utc);
  if (action == "copies" && words.empty())
    return RemoteRequest{.telecommands = {{.name = "file.report_copies", .arguments = {}}},
                         .awaited_file = ""};
  const bool copies = action == "suspend" || action == "resume" || action == "abort";
  if (copies && !words.empty()) return about_copies(action, words);
  return Err("expected " + remote_actions());
}

std::optional<std::uint64_t> left_behind(const std::vector<TelemetryReport>& answers) {
  return answers.empty() ? std::nullopt : number_of(answers.back(), "left");
}

bool is_whole(const TelecommandText& telecommand, const std::vector<TelemetryReport>& answers,
              std::optional<std::uint64_t> left_before) {
  if (telecommand.name == "file.report" || telecommand.name == "parameters.report")
    return answers.size() == 1;
  if (telecommand.name == "file.report_copies") return count_down(answers) && left_behind(answers) == 0U;
  if (telecommand.name != "file.list") return true;
  if (!count_down(answers)) return false;
  if (number_of(answers.front(), "objects") == 0U) return true;
  const auto expected = left_before ? left_before : number_of(answers.front(), "total");
  const auto first = number_of(answers.front(), "left");
  return expected && first && *expected == *first + 1;
}

std::optional<TelecommandText> next_page(const TelecommandText& page,
                                         const std::vector<TelemetryReport>& answers) {
  if (answers.empty() || field_text(answers.back(), "left") == "0") return std::nullopt;
  const std::string last = field_text(answers.back(), "object_name");
  if (last.empty()) return std::nullopt;
  TelecommandText next{.name = page.name, .arguments = {page.arguments.front(), "after=" + last}};
  if (next.arguments == page.arguments) return std::nullopt;  // the spacecraft does not get ahead
  return next;
}

Result<std::vector<const mission::Parameter*>, std::string> parameters_named(
    const mission::Dictionary& dictionary, const Words& words) {
  std::vector<const mission::Parameter*> found;
  for (const auto& parameter : dictionary.parameters()) {
    if (words.empty()) found.push_back(&parameter);
  }
  for (const std::string& word : words) {
    const std::size_t before = found.size();
    for (const auto& parameter : dictionary.parameters()) {
      if (parameter.name == word || parameter.node == word) found.push_back(&parameter);
    }
    if (found.size() == before)
      return Err(fmt::format("no node parameter is called '{}' (srfs-ground param list shows all)", word));
  }
  return found;
}

Result<TelecommandText, std::string> keeping_command(const std::string& action, const Words& words) {
  const std::string name = action == "reset" ? "factory_reset" : action;
  const bool restores = action == "restore";
  if (words.size() != (restores ? 2U : 1U))
    return Err(fmt::format("expected param {} NODE{}", action, restores ? " GENERATION" : ""));
  TelecommandText command{.name = "parameters." + name, .arguments = {"node=" + words.front()}};
  if (restores) command.arguments.push_back("generation=" + words.back());
  return command;
}

Result<TelecommandText, std::string> setting_command(const std::string& change) {
  const std::size_t equals = change.find('=');
  if (equals == std::string::npos) return Err(fmt::format("'{}': expected NODE.PARAMETER=VALUE", change));
  return TelecommandText{
      .name = "parameters.set",
      .arguments = {parameter_prefix + change.substr(0, equals), value_prefix + change.substr(equals + 1)}};
}

std::string to_line(const TelecommandText& setting) {
  return setting.arguments.front().substr(parameter_prefix.size()) + "=" +
         setting.arguments.back().substr(value_prefix.size());
}

std::string to_line(const mission::Parameter& parameter) {
  std::string values;
  const mission::Field& field = parameter.field;
  if (field.enumeration != nullptr) {
    for (const auto& [value, label] : field.enumeration->labels)
      values += (values.empty() ? "" : "|") + label;
  } else if (field.type == mission::FieldType::boolean) {
    values = "true|false";
  } else if (field.range) {
    values = mission::to_text(*field.range);
  } else if (parameter.list) {
    values = "a,b,...";
  }
  if (!field.unit.empty()) values += " " + field.unit;
  if (parameter.guarded) values += ", guarded";
  return fmt::format("{:<44} {:<28} {}\n", parameter.name, values, field.description);
}

std::string answer_lines(const TelemetryReport& report) {
  if (report.name == mission::ParameterGenerationHousekeeping::name) {
    const std::string left = field_text(report, "trial_left_s");
    const bool on_trial = field_text(report, "current") == "true" && left != "0";
    return fmt::format("{} {:>5}  {:<21} {:>3} values  {:<32} {}\n{}",
                       field_text(report, "current") == "true" ? "*" : " ", field_text(report, "number"),
                       shown(report, "saved"), field_text(report, "values"), shown(report, "origin"),
                       shown(report, "content"), on_trial ? fmt::format("  on trial for {} s\n", left) : "");
  }
  if (report.service == mission::RepositorySummary::service) {
    switch (report.subtype) {
      case mission::RepositorySummary::subtype: {
        if (field_text(report, "objects") == "0") return "";
        const bool folder = field_text(report, "object") == "folder";
        return fmt::format("{:<7} {:>12}  {}{}\n", field_text(report, "object"),
                           folder ? "" : field_text(report, "octets"), shown(report, "object_name"),
                           folder ? "/" : "");
      }
      case mission::FileAttributes::subtype:
        return fmt::format("{}\n    octets    {}\n    modified  {}\n    checksum  {}\n    sha256    {}\n",
                           path_text(shown(report, "repository"), shown(report, "file")),
                           field_text(report, "octets"), field_text(report, "modified"),
                           field_text(report, "checksum"), reported_sha256(report));
      case mission::FileCopyStatus::subtype:
        return copy_line(report);
      default:
        break;
    }
  }
  std::string lines;
  for (const auto& field : report.fields)
    lines += fmt::format("{} = {}{}\n", field.name, for_terminal(field.text),
                         field.unit.empty() || !field.known ? "" : " " + field.unit);
  return lines;
}

}  // namespace srfs::ground
