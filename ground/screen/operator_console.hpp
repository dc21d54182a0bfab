// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "ground/command_line.hpp"
#include "ground/report_order.hpp"
#include "ground/screen/history_file.hpp"
#include "ground/screen/line_editor.hpp"
#include "ground/screen/operator_screen.hpp"
#include "ground/served_link.hpp"
#include "ground/station.hpp"

namespace srfs::ground::screen {

/// What an operator does with keys, and what comes back, over the link of a server: keeps the state of the
/// screen. Knows no terminal.
class OperatorConsole {
 public:
  OperatorConsole(const mission::Dictionary& dictionary, std::unique_ptr<ServedLink> link);

  /// What the archive knows: newest values, events.
  void load(const ArchivePlace& archive);
  /// Lines of other consoles, and where those of this one are kept.
  void use_history(const std::filesystem::path& file);

  void on_input(const Input& input, Size size);
  /// Reads what is there, does what is due. An error: the server has gone, and none came back in time.
  [[nodiscard]] Result<void, std::string> turn();
  [[nodiscard]] int fd() const { return station_.fd(); }
  [[nodiscard]] std::optional<MonotonicTime> next_deadline() const { return station_.next_deadline(); }
  [[nodiscard]] bool over() const { return over_; }
  /// Whether something changed since the last call.
  [[nodiscard]] bool take_changed() { return std::exchange(changed_, false); }
  [[nodiscard]] Frame frame(Size size);

 private:
  /// A hazardous telecommand: asked about, then armed, then sent.
  struct Hazardous {
    CommandLine command;
    std::uint64_t arming = 0;  ///< tag of the telecommand that arms it; 0: it is asked about
  };
  [[nodiscard]] StationOutput output();
  void on_line(const std::string& line);
  void on_answer(const std::string& answer);
  void order(const CommandLine& command);
  /// What is no telecommand.
  void order_or_show(const CommandLine& command);
  void send(const CommandLine& command, bool arms);
  void show_view(const std::string& name);
  void show_transfers();
  void complete_word();
  void on_telemetry(const TelemetryReport& report);
  void on_stage(const StageReport& report, bool own);
  void on_armed(const StageReport& report);
  /// The reports that were ordered have come, or will not.
  void end_order();
  void on_cop(const CopReport& report);
  void on_file(const cfdp::News& news);
  /// Text of several lines, ready to print.
  void say(const std::string& text, Tone tone = Tone::plain);
  void set_server(bool there);
  void keep_in_history(const std::string& line);
  void take_history(const Result<std::vector<std::string>, std::string>& lines);

  const mission::Dictionary& dictionary_;
  Views views_;
  ScreenState state_;
  LineEditor editor_;
  std::optional<HistoryFile> history_;  ///< nullopt: lines are not kept
  ServedLink* link_;                    ///< the station's
  Station station_;
  std::optional<Hazardous> hazardous_;
  std::optional<ReportOrder> order_;  ///< of the newest telecommand: its reports are shown
  std::uint64_t ordered_by_ = 0;      ///< its tag
  std::uint64_t next_tag_ = 1;
  bool over_ = false;
  bool changed_ = true;
};

/// `srfs-ground console`: until the operator quits, a signal ends it, or the server has gone for good.
struct ConsoleFailure {
  bool began = false;  ///< the server went away; else it could not begin
  std::string text;    ///< ready to print
};
[[nodiscard]] Result<void, ConsoleFailure> run_operator_console(const mission::Dictionary& dictionary,
                                                                const std::filesystem::path& state_dir,
                                                                const ArchivePlace& archive,
                                                                ServerConnection connection);

}  // namespace srfs::ground::screen
