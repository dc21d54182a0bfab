// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/pass/pass_plan.hpp"

#include <algorithm>
#include <set>

#include <fmt/format.h>

#include "base/config.hpp"
#include "base/file.hpp"
#include "base/sha256.hpp"
#include "base/text.hpp"
#include "ground/arming.hpp"
#include "ground/files.hpp"
#include "ground/name_hint.hpp"
#include "ground/time_tag.hpp"
#include "wire/cadu.hpp"
#include "wire/tm_frame.hpp"
#include "wire/tm_sdls.hpp"

namespace srfs::ground::pass {
namespace {

constexpr std::size_t text_octets_max = 1 << 20;
constexpr std::size_t up_octets_max = std::size_t{256} << 20;
constexpr double bits_of_octet_on_line = 10;  // with start and stop bit
// Of an octet on the line: Space Packet and CFDP headers, packets cut over frames.
constexpr double packet_share = 0.94;
// CLTU (7 of 8 octets), frame, security header and trailer, CFDP.
constexpr double up_share = 0.75;
constexpr double report_header_octets = 26;

std::filesystem::path beside(const ConfigSection& section, const std::string& name) {
  return (std::filesystem::path(section.file()).parent_path() / name).lexically_normal();
}

ConfigError unusable(const ConfigSection& section, std::string_view key, std::string_view why) {
  const std::string path =
      section.path().empty() ? std::string(key) : fmt::format("{}.{}", section.path(), key);
  return ConfigError(fmt::format("{}: '{}': {}", section.file(), path, why));
}

/// The text of a file that a key names.
std::string text_of(const ConfigSection& section, std::string_view key) {
  auto text = read_file(beside(section, section.text(key)), text_octets_max);
  if (!text) throw unusable(section, key, text.error().message);
  return std::move(*text);
}

Site read_site(const ConfigSection& section) {
  Site site{.name = section.text("name"),
            .place = {.latitude_deg = section.number("latitude_deg", -90, 90),
                      .longitude_deg = section.number("longitude_deg", -180, 180),
                      .height_m = section.number("height_m", -500, 9000, 0)},
            .lowest_elevation_deg = section.number("lowest_elevation_deg", 0, 89, 10)};
  section.finish();
  return site;
}

void read_orbit(const ConfigSection& section, PassPlan& plan) {
  if (section.has("tle") == section.has("times"))
    throw unusable(section, "tle", "either tle or times is needed");
  if (section.has("tle")) {
    auto elements = parse_tle(text_of(section, "tle"));
    if (!elements) throw unusable(section, "tle", elements.error());
    if (const auto orbit = Sgp4::of(*elements); !orbit)
      throw unusable(section, "tle", to_text(orbit.error()));
    plan.elements = std::move(*elements);
  } else {
    auto times = parse_pass_times(text_of(section, "times"));
    if (!times) throw unusable(section, "times", times.error());
    plan.times = std::move(*times);
  }
  section.finish();
}

LineRates read_line(const ConfigSection& section) {
  constexpr double fastest = 1e9;
  const LineRates rates{.down_octets_s = section.number("down_octets_s", 1, fastest, 0),
                        .up_octets_s = section.number("up_octets_s", 1, fastest, 0)};
  section.finish();
  return rates;
}

/// A question may come twice: an answer that was lost on the way is asked for again.
std::vector<TelecommandText> read_queries(const ConfigSection& root, const mission::Dictionary& dictionary) {
  std::vector<TelecommandText> queries;
  for (const std::string& line : root.texts("queries")) {
    Words words = words_of(line);
    if (words.empty()) throw root.bad("queries", "telecommands");
    TelecommandText query{.name = words.front(), .arguments = {words.begin() + 1, words.end()}};
    const auto encoded = dictionary.encode(query.name, query.arguments);
    if (!encoded) throw unusable(root, "queries", explained(dictionary, query.name, encoded.error().message));
    if (encoded->command->repeat_class != mission::RepeatClass::idempotent || encoded->command->hazardous)
      throw unusable(
          root, "queries",
          fmt::format("{} may not be repeated as a question may: it belongs into the script", query.name));
    queries.push_back(std::move(query));
  }
  return queries;
}

/// Telecommands and waits; how the link works is no matter of a plan.
std::vector<ScriptStep> read_script(const ConfigSection& root, const mission::Dictionary& dictionary) {
  if (!root.has("script")) return {};
  auto steps = parse_script(
      text_of(root, "script"), [&](const auto& name, const auto& arguments) -> std::optional<std::string> {
        const auto encoded = dictionary.encode(name, arguments);
        return encoded ? std::nullopt : std::optional(explained(dictionary, name, encoded.error().message));
      });
  if (!steps)
    throw unusable(root, "script", fmt::format("line {}: {}", steps.error().line, steps.error().message));
  for (const ScriptStep& step : *steps) {
    using Kind = ScriptStep::Kind;
    if (step.kind != Kind::telecommand && step.kind != Kind::wait)
      throw unusable(root, "script", fmt::format("line {} is neither a telecommand nor a wait", step.line));
  }
  for (ScriptStep& step : *steps) {
    if (!step.arms) continue;  // what is sent is what arms it
    TelecommandText arming = arming_of(*dictionary.encode(step.name, step.arguments));
    step.name = std::move(arming.name);
    step.arguments = std::move(arming.arguments);
  }
  return std::move(*steps);
}

unsigned priority_of(const ConfigSection& section) {
  constexpr unsigned usual = 50;
  return static_cast<unsigned>(section.integer("priority", 0, PassPlan::lowest_priority, usual));
}

FileUp read_up(const ConfigSection& section) {
  FileUp up{.file = beside(section, section.text("file")), .name = "", .priority = priority_of(section)};
  up.name = section.text("name", up.file.filename().string());
  if (const auto wrong = wrong_name_on_board(up.name)) throw unusable(section, "name", *wrong);
  const auto content = read_file(up.file, up_octets_max);
  if (!content) throw unusable(section, "file", content.error().message);
  up.octets = content->size();
  up.sha256 = to_digits(sha256_of(as_octets(*content)));
  section.finish();
  return up;
}

FilesDown read_down(const ConfigSection& section) {
  FilesDown down{.folder = section.text("folder", ""),
                 .pattern = section.text("pattern", "*"),
                 .priority = priority_of(section)};
  while (down.folder.ends_with('/')) down.folder.pop_back();
  if (down.folder.size() > 100) throw section.bad("folder", "at most 100 characters");
  section.finish();
  return down;
}

/// In the order of priority; as written where that is the same.
template <class Wish, class Read>
std::vector<Wish> read_wishes(const ConfigSection& root, std::string_view key, const Read& read) {
  std::vector<Wish> wishes;
  for (const ConfigSection& section : root.sections(key)) wishes.push_back(read(section));
  std::stable_sort(wishes.begin(), wishes.end(),
                   [](const auto& a, const auto& b) { return a.priority < b.priority; });
  return wishes;
}

void check_bounds(const ConfigSection& root, const PassPlan& plan) {
  const auto check = [&](std::string_view key, std::size_t count) {
    if (count > PassPlan::wishes_max) throw root.bad(key, fmt::format("at most {}", PassPlan::wishes_max));
  };
  check("queries", plan.queries.size());
  check("script", plan.script.size());
  check("up", plan.up.size());
  check("down", plan.down.size());
  std::set<std::string> names;
  for (const FileUp& up : plan.up) {
    if (!names.insert(up.name).second)
      throw unusable(root, "up", fmt::format("two files are called {} on board", up.name));
  }
  constexpr std::string_view letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
  const bool named = !plan.name.empty() && plan.name.size() <= 40 &&
                     plan.name.find_first_not_of(letters) == std::string::npos;
  if (!named) throw root.bad("plan", "a name: 1 to 40 letters, digits, '-' or '_'");
}

}  // namespace

PassPlan PassPlan::load(const std::filesystem::path& file, const mission::Dictionary& dictionary) {
  const ConfigSection root = ConfigSection::load(file);
  PassPlan plan;
  plan.file = file;
  plan.name = root.text("plan");
  plan.site = read_site(root.section("station"));
  read_orbit(root.section("orbit"), plan);
  plan.line = read_line(root.section("line"));
  plan.queries = read_queries(root, dictionary);
  plan.script = read_script(root, dictionary);
  plan.gaps = root.boolean("gaps", false);
  plan.up = read_wishes<FileUp>(root, "up", read_up);
  plan.down = read_wishes<FilesDown>(root, "down", read_down);
  check_bounds(root, plan);
  root.finish();
  return plan;
}

Result<FoundPasses, std::string> PassPlan::passes(UtcTime from, UtcTime to) const {
  if (!elements) {
    FoundPasses found{.passes = times};
    std::erase_if(found.passes, [&](const PassTimes& pass) { return pass.set <= from || pass.rise >= to; });
    return found;
  }
  const auto orbit = Sgp4::of(*elements);
  if (!orbit) return Err(std::string(to_text(orbit.error())));
  const auto sight = [&](UtcTime time) -> std::optional<Sight> {
    const auto state = orbit->at(time);
    if (!state) return std::nullopt;
    return sight_of(to_earth_fixed(state->position_km, time), site.place);
  };
  return find_passes(sight, site.lowest_elevation_deg, from, to);
}

bool matches(std::string_view pattern, std::string_view text) {
  // The last '*' takes one character more whenever what follows it does not match.
  std::size_t p = 0;
  std::size_t t = 0;
  std::size_t star = std::string_view::npos;
  std::size_t taken = 0;
  while (t < text.size()) {
    if (p < pattern.size() && pattern[p] == '*') {
      star = p++;
      taken = t;
    } else if (p < pattern.size() && (pattern[p] == '?' || pattern[p] == text[t])) {
      ++p;
      ++t;
    } else if (star != std::string_view::npos) {
      p = star + 1;
      t = ++taken;
    } else {
      return false;
    }
  }
  return pattern.find_first_not_of('*', p) == std::string_view::npos;
}

LineRates useful_rates(const PassPlan& plan, const suite::LinkSettings& link,
                       const mission::Dictionary& dictionary) {
  const double line_octets_s = link.baud / bits_of_octet_on_line;
  const wire::CaduFormat cadu{.frame_octets = static_cast<std::size_t>(link.tm_frame_length),
                              .reed_solomon = link.tm_reed_solomon,
                              .interleave = static_cast<unsigned>(link.tm_interleave),
                              .randomize = link.tm_randomizer};
  const std::size_t overhead_octets =
      wire::tm_frame_overhead_octets + (link.tm_security ? wire::tm_sdls_overhead_octets : 0);
  const double frame_share =
      static_cast<double>(cadu.frame_octets - overhead_octets) / static_cast<double>(wire::cadu_octets(cadu));
  double live_octets_s = 0;
  for (const auto& structure : dictionary.structures()) {
    if (structure.kind != mission::StructureKind::housekeeping || structure.interval.count() <= 0) continue;
    live_octets_s += (static_cast<double>(structure.max_size()) + report_header_octets) * 1000 /
                     static_cast<double>(structure.interval.count());
  }
  const double down = plan.line.down_octets_s > 0 ? plan.line.down_octets_s : line_octets_s;
  const double up = plan.line.up_octets_s > 0 ? plan.line.up_octets_s : line_octets_s;
  return {.down_octets_s = std::max(0.0, down * frame_share - live_octets_s) * packet_share,
          .up_octets_s = up * up_share};
}

}  // namespace srfs::ground::pass
