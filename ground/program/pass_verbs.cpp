// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/program/verbs.hpp"

#include <algorithm>
#include <cstdio>

#include <fmt/format.h>
#include <poll.h>

#include "base/config.hpp"
#include "base/file.hpp"
#include "base/signals.hpp"
#include "ground/archive/archive_report.hpp"
#include "ground/archive/recorder.hpp"
#include "ground/files.hpp"
#include "ground/pass/first_contact.hpp"
#include "ground/pass/pass_report.hpp"
#include "ground/pass/pass_runner.hpp"
#include "ground/pass/rehearsal.hpp"
#include "ground/terminal_text.hpp"

namespace srfs::ground::program {
namespace {

using pass::Finding;
using pass::PassPlan;
using pass::PassReport;
using pass::PassTimes;

constexpr std::chrono::hours longest_wait{24 * 7};

struct Opened {
  PassPlan plan;
  pass::JournalFile file;
  pass::PassJournal journal;
  pass::LineRates rates;
};

std::filesystem::path passes_folder(const Operation& operation) {
  return operation.state_dir / "passes";
}

/// The error is ready to print.
Result<Opened, std::string> open_plan(const Operation& operation) {
  PassPlan plan;
  try {
    plan = PassPlan::load(operation.arguments.pass.plan, operation.dictionary);
  } catch (const ConfigError& error) {
    return Err(std::string(error.what()));
  }
  pass::JournalFile file(passes_folder(operation), plan.name);
  auto journal = file.load();
  if (!journal) return Err(journal.error());
  const pass::LineRates rates = useful_rates(plan, link_of(operation.arguments), operation.dictionary);
  return Opened{std::move(plan), std::move(file), std::move(*journal), rates};
}

/// From --from on, --hours long.
Result<pass::FoundPasses, std::string> coming_passes(const Operation& operation, const PassPlan& plan,
                                                     UtcTime now) {
  const PassArguments& arguments = operation.arguments.pass;
  UtcTime from = now;
  if (!arguments.from.empty()) {
    const auto at = parse_moment(arguments.from, now);
    if (!at) return Err(fmt::format("'{}': expected a UTC time like 2026-11-21T08:00:00Z", arguments.from));
    from = *at;
  }
  return plan.passes(from, from + std::chrono::seconds(static_cast<std::int64_t>(arguments.hours * 3600)));
}

std::string one_line(const nlohmann::json& json) {
  return json.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace) + "\n";
}

/// The report of a plan as it stands. The error is ready to print.
Result<void, std::string> with_report(const Operation& operation, const Opened& opened,
                                      const std::function<void(const PassReport&)>& use) {
  const UtcTime now = system_utc_now();
  const auto found = coming_passes(operation, opened.plan, now);
  if (!found) return Err(found.error());
  const auto items = with_journal(items_of(opened.plan), opened.journal);
  use({.plan = opened.plan,
       .items = items,
       .journal = opened.journal,
       .coming = forecast(found->passes, items, opened.rates, now),
       .orbit_unknown_from = found->unknown_from,
       .rates = opened.rates,
       .now = now});
  return {};
}

void print(const std::string& text) {
  std::fputs(text.c_str(), stdout);
  std::fflush(stdout);
}

Exit show(const Operation& operation, std::string (*to_text)(const PassReport&)) {
  const Arguments& a = operation.arguments;
  const auto opened = open_plan(operation);
  if (!opened) return fail(a, opened.error());
  const auto shown = with_report(operation, *opened, [&](const PassReport& report) {
    print(a.json ? one_line(to_json(report)) : to_text(report));
  });
  return shown ? Exit::done : fail(a, shown.error());
}

/// The pass that is under way, or the next one.
Result<std::optional<PassTimes>, std::string> next_pass(const PassPlan& plan) {
  const UtcTime now = system_utc_now();
  const auto found = plan.passes(now, now + longest_wait);
  if (!found) return Err(found.error());
  return found->passes.empty() ? std::nullopt : std::optional(found->passes.front());
}

/// @return false: a signal came
bool wait_until(UtcTime time) {
  const Fd signals = termination_signals();
  while (system_utc_now() < time) {
    const auto left = std::chrono::ceil<milliseconds>(time - system_utc_now()).count();
    pollfd wait{signals.get(), POLLIN, 0};
    // The clock may be set meanwhile.
    if (::poll(&wait, 1, static_cast<int>(std::clamp<std::int64_t>(left, 0, 1000))) > 0) return false;
  }
  return true;
}

/// How long this run has. Waits for the pass if that is wanted. nullopt: a signal came meanwhile.
Result<std::optional<nanoseconds>, std::string> length_of_run(const Arguments& a, const PassPlan& plan) {
  if (const auto said = duration(a.duration_s)) return std::optional<nanoseconds>(*said);
  const auto pass = next_pass(plan);
  if (!pass) return Err(pass.error());
  if (!*pass) return Err(std::string("no pass in the next 7 days"));
  const UtcTime rise = (*pass)->rise;
  if (system_utc_now() < rise) {
    const std::string when = to_iso8601(rise, 0);
    if (!a.pass.wait)
      return Err(fmt::format(
          "the next pass rises at {}: --wait waits for it, --duration S goes on without one", when));
    print(a.json ? one_line({{"type", "pass_wait"}, {"rise", when}})
                 : fmt::format("waiting for the pass of {}\n", when));
    if (!wait_until(rise)) return std::optional<nanoseconds>();
  }
  return std::optional<nanoseconds>((*pass)->set - system_utc_now());
}

pass::RunnerOutput runner_output(const Arguments& a) {
  return {.item =
              [&a](const pass::Item& item) {
                if (a.json) return print(one_line(pass::to_json(item)));
                const std::string why = item.detail.empty() ? "" : ": " + item.detail;
                print(for_terminal(fmt::format("{} {} {}, {}{}", to_iso8601(system_utc_now(), 0),
                                               to_text(item.kind), item.text, to_text(item.state), why)) +
                      "\n");
              },
          .note = [&a](const std::string& text) { warn(a, text); }};
}

Exit exit_of(const pass::RunEnd& end, const std::vector<pass::Item>& items) {
  const auto has = [&](pass::ItemState state) {
    return std::any_of(items.begin(), items.end(),
                       [&](const pass::Item& item) { return item.state == state; });
  };
  if (end.how == pass::RunEnd::How::link_closed) return Exit::link_closed;
  if (end.how != pass::RunEnd::How::over || !end.contact || has(pass::ItemState::failed))
    return Exit::refused;
  return has(pass::ItemState::unknown) ? Exit::unknown : Exit::done;
}

/// What a first look at the spacecraft says, unless there is nothing to say.
void write_findings(const Arguments& a, const std::vector<Finding>& findings, bool contact) {
  const UtcTime now = system_utc_now();
  print(a.json ? one_line(contact_to_json(findings, contact, now))
               : contact_to_markdown(findings, now) + "\n");
}

/// One pass with what is opened.
Exit fly(const Operation& operation, Opened& opened, nanoseconds length) {
  const Arguments& a = operation.arguments;
  auto link = open_link(operation, link_of(a), true);
  if (!link) return fail(a, link.error());
  pass::PassRunner runner(operation.dictionary, opened.plan, std::move(*link),
                          {.files = operation.state_dir / "files", .archive = archive_place(operation)},
                          runner_output(a));
  const auto end = runner.run(opened.file, opened.journal, opened.rates, a.pass.keep_going, length);
  write_findings(a, pass::assess_spacecraft(runner.latest(), system_utc_now()), end.contact);
  if (end.how == pass::RunEnd::How::not_stored) return fail(a, end.why);
  const auto reported = with_report(operation, opened, [&](const PassReport& report) {
    const std::string text = to_markdown(report);
    print(a.json ? one_line(to_json(report)) : text);
    const auto stored = write_file_atomically(passes_folder(operation) / (opened.plan.name + ".md"), text);
    if (!stored) warn(a, stored.error().message);
  });
  if (!reported) warn(a, reported.error());
  return exit_of(end, runner.items());
}

/// One pass of a rehearsal, by this program itself on the simulated line. @return its exit code
Result<int, std::string> rehearse_pass(const Operation& operation, const std::filesystem::path& var,
                                       nanoseconds length, int stop) {
  const Arguments& a = operation.arguments;
  std::vector<std::string> command{"/proc/self/exe", "--port", (var / "rs422").string(), "--deployment",
                                   a.deployment};
  if (a.json) command.emplace_back("--json");
  for (const std::string& fragment : a.fragments) command.insert(command.end(), {"--fragment", fragment});
  const double length_s = std::chrono::duration<double>(length).count();
  command.insert(command.end(), {"pass", "run", a.pass.plan, "--duration", fmt::format("{:.3f}", length_s)});
  if (a.pass.keep_going) command.emplace_back("--keep-going");
  const auto show_said = [](std::string_view said) { print(std::string(said)); };
  return pass::run_program(command, length + std::chrono::minutes(2), show_said, stop);
}

/// The coming passes, one after the other, against a simulated spacecraft. Nothing of the plan's own journal
/// changes.
Exit rehearse(const Operation& operation, const PassPlan& plan) {
  const Arguments& a = operation.arguments;
  constexpr std::size_t passes_flown = 3;
  constexpr double shortest_s = 40;          // the beginning and the end of a pass do not shrink
  const Fd signals = termination_signals();  // what was started is taken down then
  const int stop = signals.get();
  const auto end_by = [&a, stop](const std::string& why) {
    return pass::is_stopped(stop) ? Exit::refused : fail(a, why);
  };
  const UtcTime now = system_utc_now();
  const auto found = plan.passes(now, now + longest_wait);
  if (!found) return fail(a, found.error());
  if (found->passes.empty()) return fail(a, "no pass in the next 7 days");
  // Another rehearsal of this plan has its simulated spacecraft in the folder.
  const auto lock = pass::JournalFile(passes_folder(operation), "rehearsal-" + plan.name).lock();
  if (!lock) return fail(a, lock.error());
  std::error_code error;
  const auto folder = std::filesystem::absolute(passes_folder(operation), error) / ("rehearsal-" + plan.name);
  std::filesystem::remove_all(folder, error);
  const auto programs = std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
  const auto deployment = find_deployment(a.deployment);
  if (!deployment) return fail(a, deployment.error());
  const auto simulated =
      pass::Rehearsal::start(programs, std::filesystem::absolute(*deployment), folder, stop);
  if (!simulated) return end_by(simulated.error());
  auto exit = Exit::done;
  for (std::size_t i = 0; i < std::min(passes_flown, found->passes.size()); ++i) {
    const double whole_s = std::chrono::duration<double>(found->passes[i].duration()).count();
    const milliseconds length(static_cast<std::int64_t>(1000 * std::max(shortest_s, whole_s / a.pass.scale)));
    print(a.json ? one_line({{"type", "rehearsal_pass"}, {"rise", to_iso8601(found->passes[i].rise, 0)}})
                 : fmt::format("--- rehearsal of the pass of {}\n", to_iso8601(found->passes[i].rise, 0)));
    const auto code = rehearse_pass(operation, folder, length, stop);
    if (!code) return end_by(code.error());
    if (*code != 0) exit = static_cast<Exit>(*code);
  }
  return exit;
}

// One function for each subcommand. What can be checked is checked before the port is opened.
namespace verbs {

Exit plan(const Operation& operation) {
  return show(operation, pass::plan_to_markdown);
}

Exit report(const Operation& operation) {
  return show(operation, pass::to_markdown);
}

Exit run(const Operation& operation) {
  const Arguments& a = operation.arguments;
  auto opened = open_plan(operation);
  if (!opened) return fail(a, opened.error());
  if (a.pass.rehearse) return rehearse(operation, opened->plan);
  const auto length = length_of_run(a, opened->plan);
  if (!length) return fail(a, length.error());
  if (!*length) return Exit::refused;
  // Two runs of one plan would send its telecommands twice.
  const auto lock = opened->file.lock();
  if (!lock) return fail(a, lock.error());
  auto journal = opened->file.load();
  if (!journal) return fail(a, journal.error());
  opened->journal = std::move(*journal);
  return fly(operation, *opened, **length);
}

Exit first_contact(const Operation& operation) {
  const Arguments& a = operation.arguments;
  auto link = open_link(operation, link_of(a), false);
  if (!link) return fail(a, link.error());
  const auto length = duration(a.duration_s).value_or(milliseconds(600'000));
  const auto end = pass::run_first_contact(operation.dictionary, std::move(*link), a.pass.set_time, length,
                                           [&a](const std::string& text) { warn(a, text); });
  write_findings(a, end.findings, end.answered);
  return end.answered ? Exit::done : Exit::refused;
}

}  // namespace verbs

CLI::App& add_nested(CLI::App& parent, Arguments& a, const std::string& name, const std::string& help,
                     Verb verb) {
  CLI::App& sub = *parent.add_subcommand(name, help)->fallthrough();
  sub.add_option("plan", a.pass.plan, "File of the plan (docs/how-to/plan_a_pass.md)")
      ->required()
      ->check(CLI::ExistingFile);
  sub.final_callback([&a, verb, name] {
    a.verb = "pass " + name;
    a.exit = operate(a, verb);
  });
  return sub;
}

void add_period(CLI::App& sub, Arguments& a) {
  sub.add_option("--from", a.pass.from, "Passes from this UTC time on (default: now)");
  sub.add_option("--hours", a.pass.hours, "How far to look ahead")
      ->check(CLI::Range(0.1, 744.0))
      ->capture_default_str();
}

void define_pass_run(CLI::App& pass, Arguments& a) {
  CLI::App& run = add_nested(
      pass, a, "run", "Do what the plan wants, in the pass that is under way; go on where the last run ended",
      verbs::run);
  CLI::Option* wait = run.add_flag("--wait", a.pass.wait, "Wait for the next pass");
  CLI::Option* rehearse =
      run.add_flag("--rehearse", a.pass.rehearse,
                   "Fly the next three passes against a simulated spacecraft, which is started for it")
          ->excludes(wait);
  run.add_option("--scale", a.pass.scale, "By how much the passes of a rehearsal are shorter")
      ->check(CLI::Range(1.0, 100.0))
      ->capture_default_str()
      ->needs(rehearse);
  add_duration(run, a);
  run.add_flag("--keep-going", a.pass.keep_going,
               "Go on with the script after a line that did not end as expected");
}

}  // namespace

void define_passes(CLI::App& app, Arguments& a) {
  CLI::App& pass =
      *app.add_subcommand("pass", "Passes over the station: planned, flown, reported")->fallthrough();
  pass.require_subcommand(1);
  add_period(add_nested(pass, a, "plan", "Show the coming passes and what each would carry", verbs::plan), a);
  define_pass_run(pass, a);
  add_period(add_nested(pass, a, "report", "Show what came, what went, what is left and why", verbs::report),
             a);
  CLI::App& contact =
      add(app, a, "first-contact",
          "Call a spacecraft whose state is not known, until it answers, and say what its state is",
          verbs::first_contact);
  contact.add_option("--duration", a.duration_s, "Seconds (default: 600)")->check(CLI::PositiveNumber);
  contact.add_flag("--set-time", a.pass.set_time, "Set its clock to that of the ground, if it was never set");
}

}  // namespace srfs::ground::program
