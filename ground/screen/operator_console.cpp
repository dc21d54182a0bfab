// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/screen/operator_console.hpp"

#include <algorithm>
#include <array>
#include <sstream>

#include <fmt/format.h>
#include <poll.h>

#include "ground/archive/archive.hpp"
#include "ground/archive/recorder.hpp"
#include "ground/files.hpp"
#include "ground/link_order.hpp"
#include "ground/name_hint.hpp"
#include "ground/screen/completion.hpp"
#include "ground/screen/terminal.hpp"
#include "ground/station_status.hpp"
#include "ground/terminal_text.hpp"

namespace srfs::ground::screen {
namespace {

constexpr std::size_t events_loaded = 50;
constexpr std::size_t answer_lines_max = 60;
constexpr milliseconds clock_period{1000};  ///< ages are drawn anew
constexpr milliseconds frame_period{100};   ///< at most so often
constexpr std::string_view keys_help =
    "Tab completes  Up Down history  F2 F3 view  PgUp PgDn values  help  quit";

std::string event_text(const TelemetryReport& report) {
  constexpr std::array severities{"?", "info", "low", "medium", "high"};
  const std::size_t severity = report.subtype < severities.size() ? report.subtype : 0;
  return fmt::format("{} {}: {}", severities.at(severity), for_terminal(report.source),
                     for_terminal(report.text));
}

Tone event_tone(const TelemetryReport& report) {
  return report.subtype >= 4 ? Tone::red : report.subtype == 3 ? Tone::yellow : Tone::plain;
}

/// Packets that are answers in any case; others are, when they were ordered.
bool is_answer(const TelemetryReport& report) {
  switch (report.kind) {
    case TelemetryKind::pong:
    case TelemetryKind::schedule:
      return true;
    default:
      return report.vc == tm_channel::playback;
  }
}

}  // namespace

OperatorConsole::OperatorConsole(const mission::Dictionary& dictionary, std::unique_ptr<ServedLink> link)
    : dictionary_(dictionary),
      views_(dictionary),
      link_(link.get()),
      station_(dictionary, std::move(link), output()) {
  state_.title = fmt::format("spacecraft {}", dictionary.spacecraft_id());
  state_.line_open = link_->line_was_open();
  state_.view = std::min<std::size_t>(1, views_.names().size() - 1);
  state_.hint = keys_help;
}

StationOutput OperatorConsole::output() {
  return {.telemetry = [this](const auto& report) { on_telemetry(report); },
          .stage = [this](const auto& report) { on_stage(report, true); },
          .retrieval_over =
              [this](const Retrieval& retrieval) {
                say(fmt::format("retrieval: {} packets received, {}", retrieval.received(),
                                retrieval.is_complete() ? "complete" : "incomplete"));
              },
          .cop = [this](const auto& report) { on_cop(report); },
          .file = [this](const auto& news) { on_file(news); },
          .keys =
              [this](auto set, const auto& why) {
                state_.keys = to_text(set);
                say(fmt::format("keys {} from now on ({})", state_.keys, why));
              },
          .problem = [this](const auto& text) { say(text, Tone::red); },
          .note =
              [this](const auto& text) {
                state_.line_open = link_->line_was_open();
                say(text);
              },
          .stage_of_other = [this](const auto& report) { on_stage(report, false); },
          .line_opened = [this] { state_.line_open = changed_ = true; }};
}

void OperatorConsole::load(const ArchivePlace& archive) {
  const auto opened = open_archive(archive, ArchiveUse::read);
  if (!opened) return say("the archive cannot be read: " + opened.error(), Tone::yellow);
  if (auto status = read_status(**opened, dictionary_)) state_.latest = std::move(status->latest);
  PacketFilter filter;
  filter.service = std::uint8_t{5};
  filter.newest_first = true;
  filter.most = events_loaded;
  const auto read = (*opened)->packets(filter, [this](const StoredPacket& stored) {
    const auto report = decode_telemetry(dictionary_, stored.packet);
    state_.events.push_front({stored.received, event_text(report), event_tone(report), ""});
    return true;
  });
  if (!read) say("the archive cannot be read: " + read.error(), Tone::yellow);
}

void OperatorConsole::use_history(const std::filesystem::path& file) {
  history_.emplace(file);
  take_history(history_->lines());
}

void OperatorConsole::keep_in_history(const std::string& line) {
  if (history_) take_history(history_->add(line));
}

void OperatorConsole::take_history(const Result<std::vector<std::string>, std::string>& lines) {
  if (lines) return editor_.set_history(*lines);
  say("lines are not kept for other consoles from now on: " + lines.error(), Tone::yellow);
  history_.reset();
}

void OperatorConsole::say(const std::string& text, Tone tone) {
  changed_ = true;
  std::istringstream in(text);
  std::size_t lines = 0;
  for (std::string line; std::getline(in, line);) {
    if (line.empty()) continue;
    if (++lines > answer_lines_max) {
      ScreenState::add(state_.news, {system_utc_now(), "... more lines: srfs-ground listen", Tone::dim, ""});
      return;
    }
    ScreenState::add(state_.news, {system_utc_now(), line, tone, ""});
  }
}

void OperatorConsole::on_telemetry(const TelemetryReport& report) {
  const UtcTime now = system_utc_now();
  changed_ = true;
  state_.latest.take(report, now);
  if (report.vc == tm_channel::live) state_.newest = now;
  if (report.kind == TelemetryKind::event && report.vc == tm_channel::live)
    ScreenState::add(state_.events, {now, event_text(report), event_tone(report), ""});
  const bool ordered = order_ && order_->take(report, monotonic_now());
  if (ordered || is_answer(report)) say(to_lines(report, false));
}

void OperatorConsole::on_stage(const StageReport& report, bool own) {
  changed_ = true;
  std::string text = to_lines(report, false);
  std::erase(text, '\n');
  if (!own) text += "  (" + for_terminal(report.who) + ")";
  const Tone tone = report.is_failure() ? Tone::red : report.is_completed() ? Tone::good : Tone::plain;
  ScreenState::add(state_.news, {system_utc_now(), text, tone, request_text(report.request)});
  if (own && order_ && ordered_by_ == report.tag) {
    if (report.is_completed()) order_->on_completed(monotonic_now());
    if (report.is_final() && !report.is_completed()) order_.reset();
  }
  if (own && hazardous_ && hazardous_->arming == report.tag && report.is_final()) on_armed(report);
}

void OperatorConsole::end_order() {
  if (!order_ || !order_->is_over(monotonic_now())) return;
  const ReportOrder order = *std::exchange(order_, std::nullopt);
  if (order.came()) return;
  if (order.may_be_none())
    return say(fmt::format("no {} received: nothing to report, or lost on the link", order.what()));
  say(fmt::format("completed, but no {} received: lost on the link; send the telecommand again",
                  order.what()),
      Tone::red);
}

void OperatorConsole::on_armed(const StageReport& report) {
  const CommandLine command = std::exchange(hazardous_, std::nullopt)->command;
  if (report.is_completed()) return send(command, false);
  say(command.telecommand.name + " is not sent: it could not be armed", Tone::red);
}

void OperatorConsole::on_cop(const CopReport& report) {
  changed_ = true;
  if (!report.problem.empty() && report.problem != state_.cop.problem)
    say("the AD service has ended: " + report.problem, Tone::red);
  state_.cop = report;
}

void OperatorConsole::on_file(const cfdp::News& news) {
  const bool failed = news.event.kind == cfdp::EventKind::finished && !has_arrived(news);
  ScreenState::add(state_.news, {system_utc_now(), to_line(news), failed ? Tone::red : Tone::plain,
                                 "file " + to_text(news.event.id)});
  changed_ = true;
}

void OperatorConsole::set_server(bool there) {
  if (there == state_.server_there) return;
  state_.server_there = there;
  state_.server_lost = system_utc_now();
  if (!there) say("the server is gone; looking for it", Tone::red);
}

Result<void, std::string> OperatorConsole::turn() {
  const auto closes = [this](const Result<void, std::string>& outcome) {
    if (outcome || link_->fd() < 0) return;
    if (std::exchange(state_.line_open, false)) say(outcome.error(), Tone::red);
  };
  closes(station_.on_readable());
  const auto alive = station_.on_time();
  if (!alive && link_->fd() < 0) return alive;
  closes(alive);
  end_order();
  set_server(link_->fd() >= 0);
  const bool locked = std::exchange(state_.locked, link_->locked()) != link_->locked();
  const std::uint64_t sent = link_->telecommands_sent();
  const bool more = std::exchange(state_.telecommands_sent, sent) != sent;
  changed_ = changed_ || locked || more;
  state_.archive_problem = link_->archive_problem();
  return {};
}

void OperatorConsole::on_input(const Input& input, Size size) {
  changed_ = true;
  const auto page = static_cast<std::size_t>(value_rows(size));
  const std::size_t views = views_.names().size();
  const std::size_t rows = views_.rows(state_.view, state_.latest).size();
  state_.hint = keys_help;
  switch (input.key) {
    case Key::enter: {
      if (hazardous_ && hazardous_->arming == 0) return on_answer(editor_.text());
      const std::string line = editor_.take_line();
      keep_in_history(line);
      return on_line(line);
    }
    case Key::complete:
      return complete_word();
    case Key::interrupt:
      if (hazardous_ && hazardous_->arming == 0) return on_answer("no");
      return editor_.clear();
    case Key::end_of_input:
      over_ = editor_.text().empty();
      return;
    case Key::previous_view:
    case Key::next_view:
      state_.view = (state_.view + (input.key == Key::next_view ? 1 : views - 1)) % views;
      state_.scroll = 0;
      return;
    case Key::page_up:
      state_.scroll -= std::min(state_.scroll, page);
      return;
    case Key::page_down:
      state_.scroll = std::min(state_.scroll + page, rows > page ? rows - page : 0);
      return;
    default:
      return editor_.take(input);
  }
}

void OperatorConsole::complete_word() {
  if (hazardous_ && hazardous_->arming == 0) return;
  const Completion completion = complete(editor_.before_cursor(), dictionary_, views_.names());
  if (completion.candidates.empty()) {
    state_.hint = "nothing begins so";
    return;
  }
  editor_.replace_before_cursor(completion.begin, completion.text);
  if (completion.candidates.size() == 1) return;
  state_.hint = fmt::format("{}: ", completion.candidates.size());
  for (const std::string& each : completion.candidates) state_.hint += each + "  ";
}

void OperatorConsole::on_line(const std::string& line) {
  const Words words = words_of(line);
  if (!words.empty() && words.front() == "view") return show_view(words.size() == 2 ? words[1] : "");
  if (words == Words{"help"}) return say(fmt::format("view NAME | {}\n{}", command_line_forms, keys_help));
  const auto command = parse_command_line(line);
  if (!command) return say(command.error(), Tone::red);
  if (command->kind == CommandLine::Kind::quit) {
    over_ = true;
    return;
  }
  if (command->kind == CommandLine::Kind::nothing) return;
  if (!state_.server_there) return say("nothing was sent: there is no server now", Tone::red);
  order(*command);
}

void OperatorConsole::show_view(const std::string& name) {
  const auto& names = views_.names();
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) {
    std::string known;
    for (const std::string& each : names) known += (known.empty() ? "" : " | ") + each;
    return say(fmt::format("view {}", known), Tone::red);
  }
  state_.view = static_cast<std::size_t>(found - names.begin());
  state_.scroll = 0;
}

void OperatorConsole::order(const CommandLine& command) {
  using Kind = CommandLine::Kind;
  if (command.kind != Kind::telecommand && command.kind != Kind::arming) return order_or_show(command);
  const auto& [name, arguments] = command.telecommand;
  const auto encoded = dictionary_.encode(name, arguments);
  if (!encoded) return say(explained(dictionary_, name, encoded.error().message), Tone::red);
  if (command.kind == Kind::arming) return send(command, true);
  if (!encoded->command->hazardous || command.at) return send(command, false);
  if (hazardous_) return say("another hazardous telecommand is being armed", Tone::red);
  hazardous_ = Hazardous{command, 0};
}

void OperatorConsole::on_answer(const std::string& answer) {
  editor_.clear();
  if (answer != "y" && answer != "yes") {
    hazardous_.reset();
    return say("nothing was sent: the answer was not yes");
  }
  if (!state_.server_there) {
    hazardous_.reset();
    return say("nothing was sent: there is no server now", Tone::red);
  }
  hazardous_->arming = next_tag_;
  send(hazardous_->command, true);
}

void OperatorConsole::send(const CommandLine& command, bool arms) {
  const auto& [name, arguments] = command.telecommand;
  const std::uint64_t tag = next_tag_++;
  const auto release = command.at ? std::optional(command.at->at(system_utc_now())) : std::nullopt;
  if (const auto encoded = dictionary_.encode(name, arguments); encoded && !arms && !release) {
    order_ = ReportOrder::of(dictionary_, *encoded);
    ordered_by_ = tag;
  }
  const auto sent = arms      ? station_.arm(name, arguments, command.timeout, tag, release)
                    : release ? station_.send_at(*release, name, arguments, command.timeout, tag)
                              : station_.send(name, arguments, command.timeout, tag);
  if (sent) return;
  say(sent.error().text, Tone::red);
  if (ordered_by_ == tag) order_.reset();
  if (!hazardous_ || hazardous_->arming != tag) return;
  hazardous_.reset();
  say(name + " is not sent: it could not be armed", Tone::red);
}

void OperatorConsole::order_or_show(const CommandLine& command) {
  if (const auto ordered = order_link(station_, command)) {
    if (!*ordered) say(ordered->error().text, Tone::red);
    return;
  }
  using Kind = CommandLine::Kind;
  if (command.kind == Kind::clcw) say(to_lines(station_.cop(), false));
  if (command.kind == Kind::files) show_transfers();
  if (command.kind == Kind::stats) say(to_lines(link_->counters()));
}

void OperatorConsole::show_transfers() {
  const auto transfers = link_->transfers();
  if (transfers.empty()) say("no transfer is in progress");
  for (const cfdp::Report& report : transfers) say(to_line(report));
}

Frame OperatorConsole::frame(Size size) {
  state_.now = system_utc_now();
  state_.line = editor_.text();
  state_.before_cursor = editor_.before_cursor();
  const bool asks = hazardous_ && hazardous_->arming == 0;
  state_.prompt =
      asks ? hazardous_->command.telecommand.name + " is hazardous. Arm it and send it? [yes/no] " : "> ";
  return draw(state_, views_, size);
}

namespace {

/// Waits for keys, signals, the server or @p deadline.
void wait(const Terminal& terminal, const OperatorConsole& console, MonotonicTime deadline) {
  if (const auto next = console.next_deadline(); next && *next < deadline) deadline = *next;
  const auto left = std::chrono::ceil<milliseconds>(deadline - monotonic_now()).count();
  std::array<pollfd, 3> fds{
      {{terminal.keys(), POLLIN, 0}, {terminal.signals(), POLLIN, 0}, {console.fd(), POLLIN, 0}}};
  static_cast<void>(
      ::poll(fds.data(), fds.size(), static_cast<int>(std::clamp<std::int64_t>(left, 0, 1000))));
}

}  // namespace

Result<void, ConsoleFailure> run_operator_console(const mission::Dictionary& dictionary,
                                                  const std::filesystem::path& state_dir,
                                                  const ArchivePlace& archive, ServerConnection connection) {
  OperatorConsole console(dictionary, std::make_unique<ServedLink>(std::move(connection), true));
  console.load(archive);
  console.use_history(state_dir / "console_history");
  const auto terminal = Terminal::open();
  if (!terminal) return Err(ConsoleFailure{false, terminal.error()});
  MonotonicTime next_clock;
  MonotonicTime next_frame;
  bool anew = false;
  while (!console.over() && !(*terminal)->has_gone()) {
    while (const auto input = (*terminal)->next_input()) {
      anew = anew || input->key == Key::redraw;
      console.on_input(*input, (*terminal)->size());
    }
    const auto signal = (*terminal)->take_signals();
    if (signal == Terminal::Signal::end) break;
    if (const auto alive = console.turn(); !alive) return Err(ConsoleFailure{true, alive.error()});
    const MonotonicTime now = monotonic_now();
    // What stands there after a change of its size, each terminal decides by itself.
    anew = anew || signal == Terminal::Signal::resized;
    const bool due = console.take_changed() || now >= next_clock || anew;
    if (due && now >= next_frame) {
      (*terminal)->show(console.frame((*terminal)->size()), std::exchange(anew, false));
      next_clock = now + clock_period;
      next_frame = now + frame_period;
    } else if (due) {
      next_clock = next_frame;
    }
    wait(**terminal, console, next_clock);
  }
  return {};
}

}  // namespace srfs::ground::screen
