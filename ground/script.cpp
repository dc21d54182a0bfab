// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/script.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "base/text.hpp"

namespace srfs::ground {
namespace {

std::optional<Expectation> expectation_of(std::string_view text) {
  for (const auto expectation : {Expectation::completed, Expectation::accepted, Expectation::rejected,
                                 Expectation::failed, Expectation::scheduled}) {
    if (to_text(expectation) == text) return expectation;
  }
  return std::nullopt;
}

constexpr std::string_view forms =
    "expected ping | tc NAME [key=value ...] [--timeout S] [--at TIME] | arm NAME [key=value ...] "
    "[--at TIME] | expect completed|accepted|scheduled|rejected|failed [CODE] | "
    "wait DURATION | wait until UTC | ad on|off | unlock | setvr N";

/// One line that is not an `expect`. The error is a message.
Result<ScriptStep, std::string> step_of(Words words) {
  ScriptStep step;
  using Kind = ScriptStep::Kind;
  const std::string verb = words.front();
  words.erase(words.begin());
  if (verb == "ping" || verb == "tc" || verb == "arm") {
    step.arms = verb == "arm";
    const auto timeout = take_timeout(words);
    if (!timeout) return Err(timeout.error());
    const auto at = take_time_tag(words);
    if (!at) return Err(at.error());
    step.timeout = *timeout;
    step.at = *at;
    if (step.at) step.expectation = Expectation::scheduled;
    if (verb == "ping") words.insert(words.begin(), "ttc.ping");
    if (words.empty() || (verb == "ping" && words.size() > 1)) return Err(std::string(forms));
    step.name = words.front();
    step.arguments.assign(words.begin() + 1, words.end());
    return step;
  }
  if (verb == "wait" && words.size() == 1) {
    const auto duration = parse_duration(words[0]);
    if (!duration) return Err(fmt::format("'{}' is not a duration like 5s, 200ms or 2min", words[0]));
    step.kind = Kind::wait;
    step.duration = *duration;
    return step;
  }
  if (verb == "wait" && words.size() == 2 && words[0] == "until") {
    const auto until = from_iso8601(words[1]);
    if (!until) return Err(fmt::format("'{}' is not a UTC time like 2026-11-21T08:00:00Z", words[1]));
    step.kind = Kind::wait_until;
    step.until = *until;
    return step;
  }
  if (verb == "ad" && words.size() == 1 && (words[0] == "on" || words[0] == "off")) {
    step.kind = words[0] == "on" ? Kind::ad_on : Kind::ad_off;
    return step;
  }
  if (verb == "unlock" && words.empty()) {
    step.kind = Kind::unlock;
    return step;
  }
  if (verb == "setvr" && words.size() == 1) {
    const auto vr = to_number<std::uint8_t>(words[0]);
    if (!vr) return Err(fmt::format("'{}' is not a V(R) of 0 to 255", words[0]));
    step.vr = *vr;
    step.kind = Kind::set_vr;
    return step;
  }
  return Err(std::string(forms));
}

}  // namespace

std::string_view to_text(Expectation expectation) {
  switch (expectation) {
    case Expectation::completed:
      return "completed";
    case Expectation::accepted:
      return "accepted";
    case Expectation::rejected:
      return "rejected";
    case Expectation::failed:
      return "failed";
    case Expectation::scheduled:
      return "scheduled";
  }
  return "?";
}

Result<std::vector<ScriptStep>, ScriptError> parse_script(
    std::string_view text,
    const std::function<std::optional<std::string>(const std::string&, const std::vector<std::string>&)>&
        check) {
  if (text.size() > script_octets_max) return Err(ScriptError{0, "the script is too long"});
  std::vector<ScriptStep> steps;
  std::uint64_t number = 0;
  bool expectation_fits = false;  // the line before was a telecommand
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    if (++number > script_lines_max) return Err(ScriptError{number, "the script has too many lines"});
    const Words words = words_of(line.substr(0, line.find('#')));
    if (words.empty()) continue;
    if (words[0] == "expect") {
      const auto expectation =
          words.size() == 2 || words.size() == 3 ? expectation_of(words[1]) : std::nullopt;
      if (!expectation) return Err(ScriptError{number, std::string(forms)});
      if (!expectation_fits) return Err(ScriptError{number, "expect must follow a telecommand"});
      const bool fails = *expectation == Expectation::rejected || *expectation == Expectation::failed;
      if (*expectation == Expectation::scheduled && !steps.back().at)
        return Err(ScriptError{number, "expect scheduled needs a telecommand with --at"});
      if (words.size() == 3 && !fails)
        return Err(ScriptError{number, "only rejected and failed take a failure code"});
      steps.back().expectation = *expectation;
      if (words.size() == 3) steps.back().failure = words[2];
      expectation_fits = false;
      continue;
    }
    auto step = step_of(words);
    if (!step) return Err(ScriptError{number, step.error()});
    step->line = number;
    for (const std::string& word : words) step->text += (step->text.empty() ? "" : " ") + word;
    expectation_fits = step->kind == ScriptStep::Kind::telecommand;
    if (expectation_fits) {
      if (const auto problem = check(step->name, step->arguments)) return Err(ScriptError{number, *problem});
    }
    steps.push_back(std::move(*step));
  }
  return steps;
}

std::optional<bool> judge(const ScriptStep& step, const StageReport& report) {
  const bool name_fits = step.failure.empty() || step.failure == report.failure_name;
  const bool runs = report.outcome == Outcome::passed;
  const bool failed = report.outcome == Outcome::failed;
  const bool rejected = failed && (report.stage == Stage::acceptance || report.stage == Stage::routing);
  if (report.insertion && !report.is_failure()) return std::nullopt;
  switch (step.expectation) {
    case Expectation::scheduled:
      if (report.outcome == Outcome::scheduled || runs) return true;
      break;
    case Expectation::completed:
      if (report.is_completed()) return true;
      break;
    case Expectation::accepted:
      if (runs) return true;
      break;
    case Expectation::rejected:
      if (rejected) return name_fits;
      if (runs) return false;
      break;
    case Expectation::failed:
      if (failed && (report.stage == Stage::start || report.stage == Stage::completion)) return name_fits;
      break;
  }
  return report.is_final() ? std::optional(false) : std::nullopt;
}

}  // namespace srfs::ground
