// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/pass/pass_report.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "ground/terminal_text.hpp"

namespace srfs::ground::pass {
namespace {

constexpr double old_elements_days = 7;

std::string day_and_time(UtcTime time) {
  std::string text = to_iso8601(time, 0);
  text[10] = ' ';
  text.pop_back();
  return text;
}

std::string time_of_day(UtcTime time) {
  return to_iso8601(time, 0).substr(11, 8);
}

std::string length_text(nanoseconds length) {
  const auto whole = std::chrono::round<seconds>(length).count();
  return fmt::format("{} min {:02} s", whole / 60, whole % 60);
}

std::string octets_text(std::uint64_t octets) {
  if (octets < 10'000) return fmt::format("{}", octets);
  if (octets < 10'000'000) return fmt::format("{:.1f} k", static_cast<double>(octets) / 1e3);
  return fmt::format("{:.1f} M", static_cast<double>(octets) / 1e6);
}

std::string parts_text(const Forecast& pass, const std::vector<Item>& items) {
  std::string text;
  for (const auto& part : pass.parts) {
    if (!text.empty()) text += ", ";
    text += markdown_cell(items.at(part.item).text);
    if (!part.whole) text += fmt::format(" ({} octets of it)", octets_text(part.octets));
  }
  return text;
}

std::string highest_text(const PassTimes& times) {
  if (!times.highest) return "";
  return fmt::format("{:.0f}° in {:.0f}°, {}", times.highest->sight.elevation_deg,
                     times.highest->sight.azimuth_deg, time_of_day(times.highest->time));
}

std::optional<double> elements_age_days(const PassReport& report) {
  if (!report.plan.elements) return std::nullopt;
  return std::chrono::duration<double, std::ratio<86400>>(report.now - report.plan.elements->epoch).count();
}

std::string passes_section(const PassReport& report) {
  const Site& site = report.plan.site;
  std::string text = fmt::format("## Coming passes over {}\n\n", for_terminal(site.name));
  if (const auto age = elements_age_days(report)) {
    text += fmt::format(
        "Elements of {} UTC, {:.1f} days old; above {:.0f}°.{}\n\n",
        day_and_time(report.plan.elements->epoch), *age, site.lowest_elevation_deg,
        std::abs(*age) > old_elements_days ? " They are too old for a pass: get newer ones." : "");
  }
  if (report.coming.empty()) text += "None in this period.\n\n";
  if (!report.coming.empty())
    text +=
        "| Rise (UTC) | Set | Duration | Highest | Octets down | Octets up | Files "
        "|\n|---|---|---|---|---|---|---|\n";
  for (const Forecast& pass : report.coming)
    text += fmt::format("| {} | {} | {} | {} | {} | {} | {} |\n", day_and_time(pass.times.rise),
                        time_of_day(pass.times.set), length_text(pass.times.duration()),
                        highest_text(pass.times), octets_text(pass.down_octets), octets_text(pass.up_octets),
                        parts_text(pass, report.items));
  if (report.orbit_unknown_from)
    text += fmt::format("\nFrom {} on the elements describe no orbit any more.\n",
                        day_and_time(*report.orbit_unknown_from));
  return text;
}

/// The items in some states, as a table.
std::string items_section(const PassReport& report, std::string_view title,
                          std::initializer_list<ItemState> states) {
  std::string rows;
  for (const Item& item : report.items) {
    if (std::find(states.begin(), states.end(), item.state) == states.end()) continue;
    rows += fmt::format("| {} | {} | {} | {} | {} |\n", to_text(item.kind), markdown_cell(item.text),
                        item.is_file() ? octets_text(item.octets) : "", to_text(item.state),
                        markdown_cell(item.detail));
  }
  if (rows.empty()) return "";
  return fmt::format("\n## {}\n\n| Kind | What | Octets | State | Why |\n|---|---|---|---|---|\n{}", title,
                     rows);
}

std::string flown_section(const PassReport& report) {
  if (report.journal.flown.empty()) return "\nNo pass was flown yet.\n";
  std::string text =
      "\n## Passes flown\n\n| Began (UTC) | Ended | Octets of the line down | Items done | End "
      "|\n|---|---|---|---|---|\n";
  for (const FlownPass& pass : report.journal.flown)
    text += fmt::format("| {} | {} | {} | {} | {} |\n", day_and_time(pass.began),
                        pass.ended ? time_of_day(*pass.ended) : "", octets_text(pass.down_octets),
                        pass.items_done,
                        pass.ended ? markdown_cell(pass.end) : "the program ended before the pass did");
  return text;
}

nlohmann::json to_json(const Forecast& pass, const std::vector<Item>& items) {
  nlohmann::json json{{"rise", to_iso8601(pass.times.rise)},
                      {"set", to_iso8601(pass.times.set)},
                      {"duration_s", std::chrono::duration<double>(pass.times.duration()).count()},
                      {"down_octets", pass.down_octets},
                      {"up_octets", pass.up_octets},
                      {"files", nlohmann::json::array()}};
  if (pass.times.highest) {
    json["highest"] = {{"time", to_iso8601(pass.times.highest->time)},
                       {"elevation_deg", pass.times.highest->sight.elevation_deg},
                       {"azimuth_deg", pass.times.highest->sight.azimuth_deg},
                       {"range_km", pass.times.highest->sight.range_km}};
    json["rise_azimuth_deg"] = pass.times.rise_azimuth_deg;
    json["set_azimuth_deg"] = pass.times.set_azimuth_deg;
  }
  for (const auto& part : pass.parts)
    json["files"].push_back(
        {{"item", items.at(part.item).text}, {"octets", part.octets}, {"whole", part.whole}});
  return json;
}

nlohmann::json to_json(const FlownPass& pass) {
  return {{"began", to_iso8601(pass.began)},
          {"ended", pass.ended ? nlohmann::json(to_iso8601(*pass.ended)) : nlohmann::json()},
          {"end", pass.end},
          {"down_octets", pass.down_octets},
          {"items_done", pass.items_done}};
}

}  // namespace

std::string markdown_cell(std::string_view text) {
  std::string safe;
  for (const char c : for_terminal(text)) safe += c == '|' ? std::string("\\|") : std::string(1, c);
  return safe;
}

nlohmann::json to_json(const Item& item) {
  nlohmann::json json{{"kind", to_text(item.kind)},
                      {"what", item.text},
                      {"state", to_text(item.state)},
                      {"why", item.detail}};
  if (item.is_file()) json["octets"] = item.octets;
  return json;
}

std::string plan_to_markdown(const PassReport& report) {
  return fmt::format("# Plan {}\n\n{}", report.plan.name, passes_section(report));
}

std::string to_markdown(const PassReport& report) {
  std::string text = fmt::format("# Plan {}: report of {} UTC\n", report.plan.name, day_and_time(report.now));
  text += items_section(report, "Done", {ItemState::done});
  text += items_section(report, "Left", {ItemState::waiting, ItemState::ordered});
  text += items_section(report, "Failed, or not known", {ItemState::failed, ItemState::unknown});
  if (report.journal.left_out > 0)
    text += fmt::format(
        "\n{} more files on board are left out: a plan fetches at most {}. Go on under another name "
        "of the plan.\n",
        report.journal.left_out, PassJournal::found_files_max);
  return text + flown_section(report) + "\n" + passes_section(report);
}

nlohmann::json to_json(const PassReport& report) {
  const auto age = elements_age_days(report);
  const Site& site = report.plan.site;
  nlohmann::json json{{"type", "pass_report"},
                      {"plan", report.plan.name},
                      {"time", to_iso8601(report.now)},
                      {"station",
                       {{"name", site.name},
                        {"latitude_deg", site.place.latitude_deg},
                        {"longitude_deg", site.place.longitude_deg},
                        {"height_m", site.place.height_m},
                        {"lowest_elevation_deg", site.lowest_elevation_deg}}},
                      {"elements_age_days", age ? nlohmann::json(*age) : nlohmann::json()},
                      {"down_octets_s", report.rates.down_octets_s},
                      {"up_octets_s", report.rates.up_octets_s},
                      {"files_left_out", report.journal.left_out},
                      {"passes", nlohmann::json::array()},
                      {"items", nlohmann::json::array()},
                      {"flown", nlohmann::json::array()}};
  for (const Forecast& pass : report.coming) json["passes"].push_back(to_json(pass, report.items));
  for (const Item& item : report.items) json["items"].push_back(to_json(item));
  for (const FlownPass& pass : report.journal.flown) json["flown"].push_back(to_json(pass));
  return json;
}

}  // namespace srfs::ground::pass
