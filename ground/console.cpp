// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/console.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>
#include <mission/structures.hpp>

#include "base/signals.hpp"
#include "base/text.hpp"
#include "cfdp/safe_name.hpp"
#include "ground/dictionary_json.hpp"
#include "ground/files.hpp"
#include "ground/link_order.hpp"
#include "ground/name_hint.hpp"
#include "ground/terminal_text.hpp"

namespace srfs::ground {
namespace {

constexpr seconds stats_period{5};
constexpr milliseconds progress_period{500};
constexpr milliseconds default_acceptance{5000};
constexpr milliseconds default_clcw{35000};  // the beacon comes every 30 s
constexpr seconds default_installation{900};
constexpr milliseconds longest_order{35'000};  // of package.install itself
constexpr seconds first_question{2};           // it may have been reported before
constexpr seconds question_period{15};
constexpr seconds refusal_patience{2};  // for the event beside a failure report
constexpr milliseconds screen_period{500};
constexpr milliseconds page_period{5000};  ///< of watch, where there is no terminal
constexpr std::size_t longest_line = 4096;
constexpr int exchange_attempts = 3;

/// Text from the spacecraft may be anything: in ASCII it steers no terminal.
std::string one_line(const nlohmann::json& json) {
  return json.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
}

}  // namespace

Console::Console(const mission::Dictionary& dictionary, std::unique_ptr<StationLink> link,
                 ConsoleOptions options)
    : dictionary_(dictionary),
      options_(options),
      signals_(termination_signals()),
      station_(dictionary, std::move(link),
               {.telemetry = [this](const auto& report) { on_telemetry(report); },
                .stage = [this](const auto& report) { on_stage(report); },
                .retrieval_over = [this](const auto& retrieval) { on_retrieval_over(retrieval); },
                .cop = [this](const auto& report) { on_cop(report); },
                .file = [this](const auto& news) { on_file(news); },
                .keys = [this](auto set, const auto& why) { on_keys(set, why); },
                .problem = [this](const auto& problem) { fail(problem); },
                .note = [this](const auto& text) { note(text); },
                .unverified =
                    [this](const auto& report) {
                      if (!quiet_telemetry_ && !watched_) show(report);
                    }}),
      next_stats_(monotonic_now() + stats_period) {
  if (!options.ad) return;
  if (const auto started = station_.start_ad(); !started) fail(started.error());
}

Exit Console::telecommand(const std::string& name, const std::vector<std::string>& arguments, bool wait,
                          std::optional<milliseconds> timeout, const std::optional<TimeTag>& at) {
  quiet_telemetry_ = true;
  if (!wait && !timeout && !at) timeout = default_acceptance;
  send(name, arguments, timeout, at);
  return follow(wait);
}

Exit Console::telecommand_with_reports(const std::string& name, const std::vector<std::string>& arguments,
                                       const ReportOrder& order, std::optional<milliseconds> timeout) {
  order_ = order;
  const Exit sent = telecommand(name, arguments, true, timeout);
  return sent == Exit::done ? follow_order() : sent;
}

Exit Console::follow_order() {
  order_->on_completed(monotonic_now());
  while (!order_->is_over(monotonic_now()) && !interrupted_) {
    if (!run(
            Watch::port, [&] { return order_->is_over(monotonic_now()); }, order_->deadline()))
      return Exit::link_closed;
  }
  const ReportOrder order = *std::exchange(order_, std::nullopt);
  if (order.came()) return Exit::done;
  if (interrupted_) return Exit::refused;
  if (order.may_be_none()) {
    note(fmt::format("no {} received: nothing to report, or lost on the link", order.what()));
    return Exit::done;
  }
  fail(fmt::format("completed, but no {} received within {} s: lost on the link; send the telecommand again",
                   order.what(), ReportOrder::patience / seconds(1)));
  return Exit::refused;
}

Exit Console::arm(const std::string& name, const std::vector<std::string>& arguments,
                  std::optional<milliseconds> timeout, const std::optional<TimeTag>& at) {
  quiet_telemetry_ = true;
  send(name, arguments, timeout, at, Sending::arming);
  return follow(!at);
}

Exit Console::follow(bool wait) {
  if (not_sent_) return *not_sent_;
  const auto over = [&] { return last_stage_ && (last_stage_->is_final() || (!wait && accepted_)); };
  if (!run(Watch::port, over, std::nullopt)) return Exit::link_closed;
  return end_of_telecommand(wait ? last_stage_ && last_stage_->is_completed() : accepted_);
}

Exit Console::end_of_telecommand(bool success) const {
  if (success) return Exit::done;
  return last_stage_ && last_stage_->outcome == Outcome::unknown ? Exit::unknown : Exit::refused;
}

Exit Console::ping(std::optional<milliseconds> timeout) {
  quiet_telemetry_ = true;
  send("ttc.ping", {}, timeout);
  if (not_sent_) return *not_sent_;
  const MonotonicTime sent = monotonic_now();
  const auto over = [&] { return pong_ || (last_stage_ && last_stage_->is_failure()); };
  const MonotonicTime deadline = sent + timeout.value_or(options_.ping_patience);
  if (!run(Watch::port, over, deadline)) return Exit::link_closed;
  if (!pong_) {
    fail(last_stage_ && last_stage_->is_failure() ? "no answer to the ping: " + last_stage_->failure_text
                                                  : "no answer to the ping");
    return end_of_telecommand(false);
  }
  if (!options_.json)
    write_lines(fmt::format("alive, answer after {:.1f} ms\n",
                            static_cast<double>((monotonic_now() - sent).count()) * 1e-6));
  return Exit::done;
}

Exit Console::listen(std::optional<milliseconds> duration) {
  const auto deadline = duration ? std::optional(monotonic_now() + *duration) : std::nullopt;
  const bool open = run(
      Watch::port, [] { return false; }, deadline);
  write_stats();
  return open ? Exit::done : Exit::link_closed;
}

Exit Console::watch(const std::string& filter, bool out_alone, std::optional<milliseconds> duration) {
  quiet_telemetry_ = true;
  watched_.emplace();
  const auto end = duration ? std::optional(monotonic_now() + *duration) : std::nullopt;
  while (!interrupted_ && (!end || monotonic_now() < *end)) {
    const MonotonicTime next = monotonic_now() + (options_.colour ? screen_period : page_period);
    if (!run(
            Watch::port, [] { return false; }, end ? std::min(*end, next) : next))
      return Exit::link_closed;
    const auto rows = watched_->rows(filter, out_alone);
    winsize window{};
    const bool sized = ioctl(STDOUT_FILENO, TIOCGWINSZ, &window) == 0 && window.ws_row > 2;
    const std::string screen =
        to_screen(rows, system_utc_now(), sized ? window.ws_row - 1U : SIZE_MAX, options_.colour);
    const std::string_view none = out_alone ? "no value outside its limits\n" : "nothing received yet\n";
    // Home, each line to its end, then what is below.
    write_lines((options_.colour ? "\033[H\033[2J" : "") + (rows.empty() ? std::string(none) : screen));
  }
  return Exit::done;
}

Exit Console::retrieve(const std::string& store, const std::string& from, const std::string& to,
                       std::optional<milliseconds> timeout) {
  quiet_telemetry_ = true;
  send("storage.retrieve", {"store=" + store, "from=" + from, "to=" + to}, timeout);
  if (not_sent_) return *not_sent_;
  if (!run(
          Watch::port, [&] { return last_retrieval_.has_value(); }, std::nullopt))
    return Exit::link_closed;
  return end_of_telecommand(last_retrieval_ && last_retrieval_->is_complete());
}

Exit Console::put(const std::string& file, const std::string& name, std::optional<milliseconds> timeout) {
  quiet_telemetry_ = true;
  const auto deadline = timeout ? std::optional(monotonic_now() + *timeout) : std::nullopt;
  return follow_file(station_.link().put(file, name, false), deadline);
}

Exit Console::follow_file(const Result<cfdp::TransactionId, OrderError>& put,
                          std::optional<MonotonicTime> deadline) {
  if (!put) return failed(put.error(), Exit::unusable);
  awaited_file_ = *put;
  if (!run(
          Watch::port, [&] { return awaited_arrived_.has_value(); }, deadline))
    return Exit::link_closed;
  if (!awaited_arrived_) {
    fail("the file is not up yet; the next put, files, listen or session continues it");
    return Exit::refused;
  }
  return *awaited_arrived_ ? Exit::done : Exit::refused;
}

Exit Console::install(const std::string& file, const std::string& name, bool activate,
                      std::optional<milliseconds> timeout) {
  quiet_telemetry_ = true;
  installation_begun_ = monotonic_now();
  const auto deadline = timeout ? std::optional(installation_begun_ + *timeout) : std::nullopt;
  const Exit up = follow_file(station_.link().put(file, name, true), deadline);
  if (up != Exit::done) return up;
  installing_ = name;
  const TelecommandText order = install_telecommand(name, activate);
  if (deadline) {
    const auto left = std::chrono::ceil<milliseconds>(*deadline - monotonic_now());
    timeout = std::clamp(left, milliseconds(1), longest_order);
  }
  send(order.name, order.arguments, timeout);
  const Exit taken = follow(true);
  if (last_stage_ && last_stage_->failure_name == "package_refused" &&
      !run(
          Watch::port, [&] { return refusal_told_; }, monotonic_now() + refusal_patience))
    return Exit::link_closed;
  // Its reports may be lost on the way: the spacecraft is asked.
  const bool unknown =
      taken == Exit::refused && accepted_ && last_stage_ && last_stage_->outcome == Outcome::timed_out;
  if (taken != Exit::done && !unknown) return taken;
  return follow_installation(activate, deadline.value_or(monotonic_now() + default_installation));
}

Exit Console::follow_installation(bool activate, MonotonicTime deadline) {
  for (seconds patience = first_question; !installation_end_ && !interrupted_ && monotonic_now() < deadline;
       patience = question_period) {
    if (!run(
            Watch::port, [&] { return installation_end_.has_value(); },
            std::min(deadline, monotonic_now() + patience)))
      return Exit::link_closed;
    if (installation_end_ || interrupted_) break;
    const TelecommandText question = installation_question();
    send(question.name, question.arguments, std::nullopt);
  }
  if (!installation_end_) {
    fail("result unknown yet; send telecommand package.report to get it");
    return Exit::refused;
  }
  const bool wanted = activate ? installation_end_ == InstallationEnd::installed
                               : installation_end_ != InstallationEnd::failed;
  return wanted ? Exit::done : Exit::refused;
}

bool Console::on_installation(const TelemetryReport& report) {
  if (installing_.empty() || !is_about_installation(report, installing_)) return false;
  if (const auto end = installation_end(report, installing_)) installation_end_ = end;
  refusal_told_ = refusal_told_ || report.name == "update.refused";
  if (options_.json) {
    write_json(to_json(report));
  } else if (report.kind == TelemetryKind::event) {
    const double elapsed_s = std::chrono::duration<double>(monotonic_now() - installation_begun_).count();
    write_lines(fmt::format("{:>9.3f} s  {}\n", elapsed_s, for_terminal(report.text)));
  } else if (installation_end_) {
    write_lines(to_lines(report, options_.colour));
  }
  return true;
}

Exit Console::files(std::optional<milliseconds> duration) {
  quiet_telemetry_ = true;
  // The spacecraft goes on with what rests there as soon as it hears the ground.
  send("ttc.ping", {}, std::nullopt);
  const auto deadline = duration ? std::optional(monotonic_now() + *duration) : std::nullopt;
  const bool open = run(
      Watch::port, [] { return false; }, deadline);
  return open ? Exit::done : Exit::link_closed;
}

Exit Console::exchange(const TelecommandText& telecommand, std::optional<milliseconds> timeout,
                       std::optional<std::uint64_t> left_before) {
  auto exit = Exit::refused;
  bool whole = false;
  for (int attempt = 0; attempt < exchange_attempts && !whole && !interrupted_; ++attempt) {
    exit = exchange_once(telecommand, timeout);
    if (exit != Exit::done) return exit;
    whole = is_whole(telecommand, answers_, left_before);
  }
  if (!options_.json) {
    for (const TelemetryReport& answer : answers_) write_lines(answer_lines(answer));
  }
  if (whole) return exit;
  fail(fmt::format("{}: done, but some answers were lost on the link; send it again", telecommand.name));
  return Exit::refused;
}

Exit Console::exchange_once(const TelecommandText& telecommand, std::optional<milliseconds> timeout) {
  quiet_telemetry_ = true;
  exchanging_ = true;
  const mission::Command* const command = dictionary_.command(telecommand.name);
  exchanged_service_ = command != nullptr ? command->service : std::uint8_t{0};
  answers_.clear();
  send(telecommand.name, telecommand.arguments, timeout);
  return follow(true);
}

Exit Console::ask(const TelecommandText& telecommand, std::optional<milliseconds> timeout) {
  const mission::Command* const command = dictionary_.command(telecommand.name);
  if (command != nullptr && command->hazardous) {
    exchanging_ = true;
    const Exit armed = arm(telecommand.name, telecommand.arguments, timeout);
    if (armed != Exit::done) return armed;
  }
  return exchange_once(telecommand, timeout);
}

Exit Console::remote(const RemoteRequest& request, std::optional<milliseconds> timeout) {
  awaited_name_ = cfdp::safe_name(request.awaited_file);
  auto worst = Exit::done;
  for (const TelecommandText& telecommand : request.telecommands) {
    std::optional<TelecommandText> page = telecommand;
    std::optional<std::uint64_t> left;
    while (page && !interrupted_) {
      const Exit exit = exchange(*page, timeout, left);
      left = left_behind(answers_);
      if (exit != Exit::done) worst = exit;
      if (exit != Exit::done && exit != Exit::refused) return exit;
      page = request.lists && exit == Exit::done ? next_page(*page, answers_) : std::nullopt;
    }
  }
  if (request.awaited_file.empty() || worst != Exit::done) return worst;
  const auto deadline = timeout ? std::optional(monotonic_now() + *timeout) : std::nullopt;
  if (!run(
          Watch::port, [&] { return awaited_arrived_.has_value(); }, deadline))
    return Exit::link_closed;
  if (!awaited_arrived_) {
    fail("the file is not down yet; the next get, put, files, listen or session continues it");
    return Exit::refused;
  }
  return *awaited_arrived_ ? Exit::done : Exit::refused;
}

Exit Console::get_parameters(const std::vector<const mission::Parameter*>& parameters,
                             std::optional<milliseconds> timeout) {
  auto worst = Exit::done;
  for (const mission::Parameter* parameter : parameters) {
    if (interrupted_) return Exit::refused;
    const Exit exit =
        exchange({.name = "parameters.report", .arguments = {"parameter=" + parameter->name}}, timeout);
    if (exit != Exit::done) worst = exit;
    if (exit != Exit::done && exit != Exit::refused) return exit;
  }
  return worst;
}

Exit Console::set_parameters(const std::vector<TelecommandText>& settings,
                             std::optional<milliseconds> timeout) {
  for (const TelecommandText& setting : settings) {
    const Exit exit = exchange(setting, timeout);
    if (exit != Exit::done) return exit;
    if (!options_.json) write_lines(to_line(setting) + "\n");
  }
  return Exit::done;
}

Exit Console::keep_parameters(const TelecommandText& telecommand, std::optional<milliseconds> timeout) {
  return exchange(telecommand, timeout);
}

void Console::on_file(const cfdp::News& news) {
  const bool came_down = news.event.kind == cfdp::EventKind::finished &&
                         news.event.role == cfdp::Role::receiving && !awaited_name_.empty() &&
                         news.file.destination_file == awaited_name_;
  if (came_down) awaited_arrived_ = has_arrived(news);
  if (awaited_file_ == news.event.id && news.event.kind == cfdp::EventKind::finished)
    awaited_arrived_ = has_arrived(news);
  options_.json ? write_json(to_json(news)) : write_lines(to_line(news) + "\n");
}

void Console::on_keys(suite::AssociationSet set, const std::string& why) {
  if (options_.json) return write_json({{"type", "keys"}, {"keys", to_text(set)}, {"why", why}});
  write_lines(fmt::format("keys {} from now on ({})\n", to_text(set), why));
}

bool Console::files_under_way() {
  const auto all = station_.link().transfers();
  return std::any_of(all.begin(), all.end(), [](const auto& t) { return t.rest == cfdp::Rest::none; });
}

void Console::tell_progress() {
  if (!station_.link().carries_files() || monotonic_now() < next_progress_) return;
  next_progress_ = monotonic_now() + progress_period;
  std::string told;
  for (const cfdp::Report& report : station_.link().transfers()) {
    told += (options_.json ? one_line(to_json(report)) : to_line(report)) + "\n";
  }
  if (told.empty() || told == last_progress_) return;
  last_progress_ = told;
  if (options_.json) return write_lines(told);
  if (!options_.colour) return;  // no terminal: show begin and end, not the progress
  // One line that is written over: the first file under way.
  const std::string line = told.substr(0, told.find('\n'));
  std::fputs(("\r\x1b[K" + line).c_str(), stdout);
  std::fflush(stdout);
  progress_shown_ = true;
}

Exit Console::session() {
  options_.json = true;
  const int flags = fcntl(STDIN_FILENO, F_GETFL);
  if (flags >= 0) fcntl(STDIN_FILENO, F_SETFL, flags | O_NONBLOCK);
  const bool open = run(
      Watch::port_and_input, [&] { return input_ended_ && station_.idle() && !files_under_way(); },
      std::nullopt);
  if (flags >= 0) fcntl(STDIN_FILENO, F_SETFL, flags);
  write_stats();
  return open ? Exit::done : Exit::link_closed;
}

Exit Console::script(const std::vector<ScriptStep>& steps, bool keep_going) {
  quiet_telemetry_ = true;
  std::size_t run = 0;
  std::size_t failed = 0;
  auto exit = Exit::done;
  for (const ScriptStep& step : steps) {
    line_ = step.line;
    const StepEnd end = run_step(step);
    ++run;
    tell_step(step, end);
    if (end == StepEnd::as_expected) continue;
    ++failed;
    exit = end == StepEnd::link_closed ? Exit::link_closed
           : end == StepEnd::unknown   ? Exit::unknown
                                       : Exit::refused;
    if (!keep_going || end != StepEnd::otherwise) break;
  }
  if (options_.json) {
    write_json({{"type", "script_done"}, {"steps", steps.size()}, {"run", run}, {"failed", failed}});
  } else {
    write_lines(fmt::format("{} of {} lines run, {} not as expected\n", run, steps.size(), failed));
  }
  return exit;
}

Console::StepEnd Console::run_step(const ScriptStep& step) {
  const auto wait_until = [&](MonotonicTime deadline) {
    const bool open = this->run(
        Watch::port, [] { return false; }, deadline);
    return !open ? StepEnd::link_closed : interrupted_ ? StepEnd::interrupted : StepEnd::as_expected;
  };
  const auto end_of = [&](Exit exit) {
    if (exit == Exit::link_closed) return StepEnd::link_closed;
    if (exit == Exit::unknown) return StepEnd::unknown;
    if (interrupted_) return StepEnd::interrupted;
    return exit == Exit::done ? StepEnd::as_expected : StepEnd::otherwise;
  };
  switch (step.kind) {
    case ScriptStep::Kind::telecommand:
      return run_telecommand_step(step);
    case ScriptStep::Kind::wait:
      return wait_until(monotonic_now() + step.duration);
    case ScriptStep::Kind::wait_until: {
      const nanoseconds left = step.until.since_epoch() - system_utc_now().since_epoch();
      return wait_until(monotonic_now() + std::max(left, nanoseconds(0)));
    }
    case ScriptStep::Kind::ad_on:
      return end_of(initiate(station_.start_ad()));
    case ScriptStep::Kind::ad_off: {
      const auto stopped = station_.stop_ad();
      return stopped ? StepEnd::as_expected : end_of(failed(stopped.error(), Exit::refused));
    }
    case ScriptStep::Kind::unlock:
      return end_of(initiate(station_.unlock()));
    case ScriptStep::Kind::set_vr:
      return end_of(initiate(station_.set_vr(step.vr)));
  }
  return StepEnd::otherwise;
}

Console::StepEnd Console::run_telecommand_step(const ScriptStep& step) {
  step_ = &step;
  step_judgement_.reset();
  const auto encoded = dictionary_.encode(step.name, step.arguments);
  const bool shows = encoded && !step.arms && !step.at && step.expectation == Expectation::completed;
  order_ = shows ? ReportOrder::of(dictionary_, *encoded) : std::nullopt;
  send(step.name, step.arguments, step.timeout, step.at, step.arms ? Sending::arming : Sending::itself);
  const bool open = not_sent_ || run(
                                     Watch::port, [&] { return step_judgement_.has_value(); }, std::nullopt);
  step_ = nullptr;
  if (!open) return StepEnd::link_closed;
  const bool known = not_sent_ != Exit::unknown && end_of_telecommand(false) != Exit::unknown;
  if (!known) return StepEnd::unknown;
  if (not_sent_) return StepEnd::otherwise;
  if (!step_judgement_) return StepEnd::interrupted;
  if (!*step_judgement_) return StepEnd::otherwise;
  if (!order_) return StepEnd::as_expected;
  const Exit reported = follow_order();
  if (reported == Exit::link_closed) return StepEnd::link_closed;
  if (interrupted_) return StepEnd::interrupted;
  return reported == Exit::done ? StepEnd::as_expected : StepEnd::otherwise;
}

void Console::tell_step(const ScriptStep& step, StepEnd end) {
  const std::string_view how = end == StepEnd::as_expected   ? "as expected"
                               : end == StepEnd::otherwise   ? "NOT as expected"
                               : end == StepEnd::interrupted ? "interrupted"
                               : end == StepEnd::unknown     ? "NOT KNOWN whether it was sent"
                                                             : "the link was closed";
  std::string expected =
      step.kind == ScriptStep::Kind::telecommand ? std::string(to_text(step.expectation)) : "";
  if (!step.failure.empty()) expected += " " + step.failure;
  if (options_.json) {
    nlohmann::json json{{"type", "script_step"},
                        {"line", step.line},
                        {"text", step.text},
                        {"expected", expected},
                        {"success", end == StepEnd::as_expected}};
    if (end == StepEnd::unknown) json["outcome"] = "unknown";
    return write_json(json);
  }
  write_lines(fmt::format("line {}: {}: {}{}\n", step.line, step.text, how,
                          expected.empty() ? "" : " (expected: " + expected + ")"));
}

Exit Console::initiate(const Result<void, OrderError>& order) {
  if (!order) return failed(order.error(), Exit::refused);
  if (!run(
          Watch::port, [&] { return !station_.ad_starting(); }, std::nullopt))
    return Exit::link_closed;
  return station_.cop().phase == AdPhase::on ? Exit::done : Exit::refused;
}

Exit Console::unlock() {
  quiet_telemetry_ = true;
  return initiate(station_.unlock());
}

Exit Console::set_vr(std::uint8_t vr) {
  quiet_telemetry_ = true;
  return initiate(station_.set_vr(vr));
}

Exit Console::clcw(std::optional<milliseconds> timeout) {
  quiet_telemetry_ = true;
  asks_for_clcw_ = true;
  if (station_.cop().clcw) on_cop(station_.cop());  // a server knows it already
  const MonotonicTime deadline = monotonic_now() + timeout.value_or(default_clcw);
  if (!run(
          Watch::port, [&] { return station_.cop().clcw.has_value(); }, deadline))
    return Exit::link_closed;
  if (!station_.cop().clcw) {
    fail("no CLCW received from the telecommand channel");
    return Exit::refused;
  }
  return Exit::done;
}

void Console::on_cop(const CopReport& report) {
  // Off and as it was: each telecommand of type BD changes the CLCW, which is no news to people.
  const bool news = report.phase != AdPhase::off || told_phase_ != AdPhase::off || !report.problem.empty();
  told_phase_ = report.phase;
  if (!news && !asks_for_clcw_ && !options_.json) return;
  options_.json ? write_json(to_json(report)) : write_lines(to_lines(report, options_.colour));
}

void Console::send(const std::string& name, const std::vector<std::string>& arguments,
                   std::optional<milliseconds> timeout, const std::optional<TimeTag>& at, Sending what) {
  last_stage_.reset();
  accepted_ = false;
  const auto release = at ? std::optional(at->at(system_utc_now())) : std::nullopt;
  const auto sent = what == Sending::arming ? station_.arm(name, arguments, timeout, line_, release)
                    : release               ? station_.send_at(*release, name, arguments, timeout, line_)
                                            : station_.send(name, arguments, timeout, line_);
  not_sent_ = sent ? std::nullopt : std::optional(failed(sent.error(), Exit::unusable));
}

void Console::on_telemetry(const TelemetryReport& report) {
  if (watched_) return watched_->take(report, system_utc_now());
  if (on_installation(report)) return;
  pong_ = pong_ || report.kind == TelemetryKind::pong;
  if (exchanging_) {
    const bool answers = (report.kind == TelemetryKind::report && report.service == exchanged_service_) ||
                         report.name == mission::ParameterGenerationHousekeeping::name;
    if (!answers && !(report.kind == TelemetryKind::event && report.name.starts_with("parameter."))) return;
    if (answers) answers_.push_back(report);
    if (options_.json) return write_json(to_json(report));
    if (report.kind == TelemetryKind::event) write_lines(to_lines(report, options_.colour));
    return;
  }
  const bool asked_for = order_ && order_->take(report, monotonic_now());
  const bool wanted = report.kind == TelemetryKind::pong || report.kind == TelemetryKind::schedule ||
                      report.vc == tm_channel::playback || asked_for;
  if (quiet_telemetry_ && !wanted) return;
  if (options_.json || asked_for || !(quiet_telemetry_ && report.kind == TelemetryKind::pong)) show(report);
}

void Console::show(const TelemetryReport& report) {
  options_.json ? write_json(to_json(report)) : write_lines(to_lines(report, options_.colour));
}

void Console::on_stage(const StageReport& report) {
  // How the insertion goes on is the time-tagged telecommand's news only when it fails. What is late is of
  // one that nobody waits for any more.
  const bool news = !report.late && (!report.insertion || report.is_failure());
  if (news) last_stage_ = report;
  if (step_ != nullptr && report.tag == step_->line && !step_judgement_ && !report.late)
    step_judgement_ = judge(*step_, report);
  // Later reports prove the acceptance whose own was lost.
  accepted_ =
      accepted_ || (news && (report.outcome == Outcome::passed || report.outcome == Outcome::scheduled));
  const bool asks = exchanging_ || report.command->name == installation_question().name;
  if (asks && !options_.json && !report.is_failure()) return;
  options_.json ? write_json(to_json(report)) : write_lines(to_lines(report, options_.colour));
}

void Console::on_retrieval_over(const Retrieval& retrieval) {
  last_retrieval_ = retrieval;
  if (options_.json) {
    nlohmann::json json{{"type", "retrieval_done"},
                        {"line", retrieval.tag()},
                        {"received", retrieval.received()},
                        {"complete", retrieval.is_complete()}};
    json["packets"] = retrieval.expected() ? nlohmann::json(*retrieval.expected()) : nlohmann::json();
    return write_json(json);
  }
  const std::string expected =
      retrieval.expected() ? fmt::format("{}", *retrieval.expected()) : "an unknown number";
  write_lines(fmt::format("{} of {} packets received, {}\n", retrieval.received(), expected,
                          retrieval.is_complete() ? "complete" : "incomplete"));
}

void Console::on_line(const std::string& line) {
  using Kind = CommandLine::Kind;
  ++line_;
  const auto command = parse_command_line(line);
  if (!command) return fail(command.error());
  if (const auto ordered = order_link(station_, *command)) {
    if (!*ordered) fail(ordered->error());
    return;
  }
  switch (command->kind) {
    case Kind::telecommand:
    case Kind::arming:
      return send(command->telecommand.name, command->telecommand.arguments, command->timeout, command->at,
                  command->kind == Kind::arming ? Sending::arming : Sending::itself);
    case Kind::clcw:
      return on_cop(station_.cop());
    case Kind::files:
      for (const cfdp::Report& report : station_.link().transfers()) write_json(to_json(report));
      return;
    case Kind::stats:
      return write_stats();
    case Kind::quit:
      interrupted_ = true;
      return;
    default:
      return;
  }
}

void Console::on_input() {
  std::array<char, longest_line> chunk{};
  const ssize_t got = ::read(STDIN_FILENO, chunk.data(), chunk.size());
  if (got < 0 && (errno == EAGAIN || errno == EINTR)) return;
  if (got <= 0) {
    input_ended_ = true;
    if (!input_.empty()) on_line(std::exchange(input_, {}));
    return;
  }
  input_.append(chunk.data(), static_cast<std::size_t>(got));
  for (auto end = input_.find('\n'); end != std::string::npos && !interrupted_; end = input_.find('\n')) {
    const std::string line = input_.substr(0, end);
    input_.erase(0, end + 1);
    on_line(line);
  }
  if (input_.size() > longest_line) {
    fail("dropped an input line that is too long");
    input_.clear();
  }
}

bool Console::run(Watch watch, const std::function<bool()>& over, std::optional<MonotonicTime> deadline) {
  bool closed = false;
  while (!over() && !interrupted_ && !closed) {
    if (deadline && monotonic_now() >= *deadline) break;
    wait_once(watch, deadline, closed);
    if (const auto alive = station_.on_time(); !alive && !std::exchange(closed, true)) fail(alive.error());
    tell_progress();
    if (watch == Watch::port_and_input && monotonic_now() >= next_stats_) write_stats();
  }
  return !closed;
}

void Console::wait_once(Watch watch, std::optional<MonotonicTime> deadline, bool& closed) {
  MonotonicTime wake = deadline.value_or(monotonic_now() + seconds(1));
  if (const auto next = station_.next_deadline(); next && *next < wake) wake = *next;
  const auto left = std::chrono::ceil<milliseconds>(wake - monotonic_now()).count();
  const bool input = watch == Watch::port_and_input && !input_ended_;
  // poll(2) and no event loop: the input may be a file, which epoll refuses.
  std::array<pollfd, 3> fds{
      {{station_.fd(), POLLIN, 0}, {signals_.get(), POLLIN, 0}, {input ? STDIN_FILENO : -1, POLLIN, 0}}};
  if (::poll(fds.data(), fds.size(), static_cast<int>(std::clamp<std::int64_t>(left, 0, 1000))) <= 0) return;
  if (fds[1].revents != 0) interrupted_ = true;
  if (fds[0].revents != 0) {
    if (const auto read = station_.on_readable(); !read) {
      fail(read.error());
      closed = true;
    }
  }
  if (fds[2].revents != 0) on_input();
}

void Console::write_json(const nlohmann::json& json) {
  write_lines(one_line(json) + "\n");
}

void Console::write_lines(const std::string& lines) {
  if (std::exchange(progress_shown_, false)) std::fputs("\r\x1b[K", stdout);
  std::fputs(lines.c_str(), stdout);
  std::fflush(stdout);
}

void Console::fail(const std::string& message) {
  if (options_.json) return write_json({{"type", "error"}, {"line", line_}, {"message", message}});
  std::fprintf(stderr, "srfs-ground: %s\n", message.c_str());
}

void Console::fail(const OrderError& error) {
  if (!options_.json || !error.is_unknown()) return fail(error.text);
  write_json({{"type", "error"}, {"line", line_}, {"message", error.text}, {"outcome", "unknown"}});
}

Exit Console::failed(const OrderError& error, Exit refused) {
  fail(error);
  return error.is_unknown() ? Exit::unknown : refused;
}

void Console::note(const std::string& message) {
  if (options_.json) return write_json({{"type", "note"}, {"line", line_}, {"message", message}});
  write_lines(message + "\n");
}

void Console::write_stats() {
  next_stats_ = monotonic_now() + stats_period;
  if (!options_.json) return write_lines(to_lines(station_.link().counters()));
  nlohmann::json json = to_json(station_.link().counters());
  json["telecommands_sent"] = station_.link().telecommands_sent();
  json["locked"] = station_.link().locked();
  json["cop"] = to_json(station_.cop());
  if (station_.link().clcw()) json["clcw"] = fmt::format("{:08x}", *station_.link().clcw());
  write_json(json);
}

Exit run_bridge(Bridge& bridge, bool json) {
  const Fd signals = termination_signals();
  const auto tell = [&] {
    const nlohmann::json counters = to_json(bridge.counters());
    if (json) {
      std::puts(counters.dump().c_str());
    } else {
      const BridgeCounters& c = bridge.counters();
      std::puts(
          fmt::format("{} TM frames down ({} bad, {} unsent), {} TC datagrams up ({} refused, {} unsent)",
                      c.tm_frames, c.tm_bad, c.tm_unsent, c.tc_datagrams, c.tc_refused, c.tc_unsent)
              .c_str());
    }
    std::fflush(stdout);
  };
  tell();  // it is ready
  MonotonicTime next = monotonic_now() + stats_period;
  while (true) {
    std::array<pollfd, 3> fds{
        {{bridge.line_fd(), POLLIN, 0}, {bridge.socket_fd(), POLLIN, 0}, {signals.get(), POLLIN, 0}}};
    const bool seeks = bridge.line_fd() < 0;  // the server has ended, and is looked for
    const auto left = std::chrono::ceil<milliseconds>(next - monotonic_now()).count();
    static_cast<void>(::poll(fds.data(), fds.size(),
                             static_cast<int>(std::clamp<std::int64_t>(left, 0, seeks ? 100 : 5000))));
    if (fds[2].revents != 0) break;
    if (fds[0].revents != 0 || seeks) {
      if (const auto read = bridge.on_line(); !read) {
        std::fprintf(stderr, "srfs-ground: %s\n", read.error().c_str());
        return Exit::link_closed;
      }
    }
    if (fds[1].revents != 0) bridge.on_socket();
    if (monotonic_now() >= next) {
      tell();
      next = monotonic_now() + stats_period;
    }
  }
  tell();
  return Exit::done;
}

Result<std::filesystem::path, std::string> find_deployment(const std::string& text) {
  if (std::filesystem::exists(text)) return std::filesystem::path(text);
  std::vector<std::filesystem::path> folders;
  if (const char* folder = std::getenv("SRFS_LAUNCH_DIR"); folder != nullptr && *folder != '\0')
    folders.emplace_back(folder);
  std::error_code error;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", error);
  folders.push_back(program.parent_path().parent_path() / "share/srfs/launch_config");
  folders.emplace_back(SRFS_LAUNCH_SOURCE_DIR);
  for (const auto& folder : folders) {
    const auto file = folder / (text + ".yaml");
    if (std::filesystem::exists(file, error)) return file;
  }
  return Err(
      fmt::format("{}: no such deployment file, and no {}.yaml in {}", text, text, folders.back().string()));
}

namespace {

std::string argument_line(const mission::Field& field) {
  std::string line = fmt::format("    {:<16} {}", field.name, field.description);
  if (field.enumeration != nullptr) {
    std::string labels;
    for (const auto& [value, label] : field.enumeration->labels)
      labels += (labels.empty() ? "" : " | ") + label;
    line += ": " + labels;
  } else if (field.type == mission::FieldType::time) {
    line += " (UTC, like 2026-11-21T08:00:00Z)";
  }
  if (field.range) line += ", " + mission::to_text(*field.range);
  if (!field.unit.empty()) line += " " + field.unit;
  if (field.has_default) line += fmt::format(" [{}]", field.default_text);
  return line + "\n";
}

}  // namespace

Exit list(const mission::Dictionary& dictionary, const std::string& name, bool json) {
  const bool exact = dictionary.command(name) != nullptr;
  bool found = false;
  for (const auto& command : dictionary.commands()) {
    if (!name.empty() && (exact ? command.name != name : !command.name.starts_with(name))) continue;
    found = true;
    if (json) {
      std::puts(to_json(command, dictionary)
                    .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)
                    .c_str());
      continue;
    }
    std::puts(
        fmt::format("{}{}  {}", command.name, command.hazardous ? " (hazardous)" : "", command.description)
            .c_str());
    for (const auto& field : command.arguments) std::fputs(argument_line(field).c_str(), stdout);
  }
  if (found) return Exit::done;
  std::vector<std::string> known;
  for (const auto& command : dictionary.commands()) known.push_back(command.name);
  std::fprintf(stderr, "srfs-ground: no telecommand is called '%s'%s\n", name.c_str(),
               did_you_mean(name, known).c_str());
  return Exit::unusable;
}

}  // namespace srfs::ground
