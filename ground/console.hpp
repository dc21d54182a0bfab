// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "ground/bridge.hpp"
#include "ground/command_line.hpp"
#include "ground/exit.hpp"
#include "ground/installation.hpp"
#include "ground/latest_values.hpp"
#include "ground/remote.hpp"
#include "ground/report_order.hpp"
#include "ground/script.hpp"
#include "ground/station.hpp"

namespace srfs::ground {

struct ConsoleOptions {
  bool json = false;
  bool colour = false;
  bool ad = false;  ///< telecommands by the AD service from the start
  milliseconds ping_patience{3000};
};

/// One run of the tool: a station, its output as lines or JSON, and the loop that waits for the port, the
/// signals SIGINT and SIGTERM (they end it in order), standard input (session) and deadlines.
class Console {
 public:
  Console(const mission::Dictionary& dictionary, std::unique_ptr<StationLink> link, ConsoleOptions options);

  /// One telecommand. @param wait until completion, else until acceptance, or with @p at until it is
  /// scheduled
  [[nodiscard]] Exit telecommand(const std::string& name, const std::vector<std::string>& arguments,
                                 bool wait, std::optional<milliseconds> timeout,
                                 const std::optional<TimeTag>& at = std::nullopt);
  /// One telecommand until its completion, and until the reports that it orders have come, which are shown.
  /// Exit::refused: none came in time.
  [[nodiscard]] Exit telecommand_with_reports(const std::string& name,
                                              const std::vector<std::string>& arguments,
                                              const ReportOrder& order, std::optional<milliseconds> timeout);
  /// Arms a hazardous telecommand with these arguments, until that is completed, or with @p at scheduled.
  [[nodiscard]] Exit arm(const std::string& name, const std::vector<std::string>& arguments,
                         std::optional<milliseconds> timeout,
                         const std::optional<TimeTag>& at = std::nullopt);
  /// 17,1 until 17,2.
  [[nodiscard]] Exit ping(std::optional<milliseconds> timeout);
  [[nodiscard]] Exit listen(std::optional<milliseconds> duration);
  /// Newest values, drawn again and again. @param out_alone  those outside their limits alone
  [[nodiscard]] Exit watch(const std::string& filter, bool out_alone, std::optional<milliseconds> duration);
  [[nodiscard]] Exit retrieve(const std::string& store, const std::string& from, const std::string& to,
                              std::optional<milliseconds> timeout);
  /// Lines of a file, in order; a telecommand is followed to its end before the next line.
  [[nodiscard]] Exit script(const std::vector<ScriptStep>& steps, bool keep_going);
  /// COP-1 directives: until the AD service is on, or why not.
  [[nodiscard]] Exit unlock();
  [[nodiscard]] Exit set_vr(std::uint8_t vr);
  /// The next CLCW of the channel.
  [[nodiscard]] Exit clcw(std::optional<milliseconds> timeout);
  /// The following need a link that carries files.
  /// One file up, until the spacecraft has it. What is not up by then stays in the queue.
  [[nodiscard]] Exit put(const std::string& file, const std::string& name,
                         std::optional<milliseconds> timeout);
  /// Puts a package up, or goes on with it, orders package.install and follows that until the node runs it,
  /// or without @p activate until it is built and tested. @param timeout for all of it
  [[nodiscard]] Exit install(const std::string& file, const std::string& name, bool activate,
                             std::optional<milliseconds> timeout);
  /// Carries the queue up and what comes down. @param duration nullopt: until interrupted
  [[nodiscard]] Exit files(std::optional<milliseconds> duration);
  /// What is asked of the folder of files on board, with the answers as lines. A file that is to arrive is
  /// waited for on a link that carries files.
  [[nodiscard]] Exit remote(const RemoteRequest& request, std::optional<milliseconds> timeout);
  /// Values of node parameters (PUS 20).
  [[nodiscard]] Exit get_parameters(const std::vector<const mission::Parameter*>& parameters,
                                    std::optional<milliseconds> timeout);
  /// @param settings of setting_command()
  [[nodiscard]] Exit set_parameters(const std::vector<TelecommandText>& settings,
                                    std::optional<milliseconds> timeout);
  /// A telecommand about kept parameters, with the answers as lines.
  [[nodiscard]] Exit keep_parameters(const TelecommandText& telecommand, std::optional<milliseconds> timeout);
  /// One telecommand until its end, armed before if it is hazardous; what fails is shown.
  [[nodiscard]] Exit ask(const TelecommandText& telecommand, std::optional<milliseconds> timeout);
  /// Reports of its service that came until then.
  [[nodiscard]] const std::vector<TelemetryReport>& answers() const { return answers_; }
  void tell(const std::string& message) { note(message); }
  void tell_failure(const std::string& message) { fail(message); }
  /// Command lines from standard input; ends with "quit", or at its end when nothing is outstanding any more.
  [[nodiscard]] Exit session();

 private:
  enum class Watch : std::uint8_t { port, port_and_input };

  void on_telemetry(const TelemetryReport& report);
  void show(const TelemetryReport& report);
  /// Runs until the file that was put is up.
  [[nodiscard]] Exit follow_file(const Result<cfdp::TransactionId, OrderError>& put,
                                 std::optional<MonotonicTime> deadline);
  /// Shows and keeps what is about the installation. @return whether it was
  bool on_installation(const TelemetryReport& report);
  /// Runs until the spacecraft has reported how the installation ended; asks now and then.
  [[nodiscard]] Exit follow_installation(bool activate, MonotonicTime deadline);
  /// One telecommand until its end, again when answers were lost on the way. Shows and keeps the answers.
  /// @param left_before  of a listing (is_whole)
  [[nodiscard]] Exit exchange(const TelecommandText& telecommand, std::optional<milliseconds> timeout,
                              std::optional<std::uint64_t> left_before = std::nullopt);
  [[nodiscard]] Exit exchange_once(const TelecommandText& telecommand, std::optional<milliseconds> timeout);
  void on_stage(const StageReport& report);
  void on_retrieval_over(const Retrieval& retrieval);
  void on_cop(const CopReport& report);
  void on_file(const cfdp::News& news);
  void on_keys(suite::AssociationSet set, const std::string& why);
  void tell_progress();
  [[nodiscard]] bool files_under_way();
  /// Runs until the AD service that was ordered is on or off.
  [[nodiscard]] Exit initiate(const Result<void, OrderError>& order);
  enum class StepEnd : std::uint8_t { as_expected, otherwise, link_closed, interrupted, unknown };
  [[nodiscard]] StepEnd run_step(const ScriptStep& step);
  [[nodiscard]] StepEnd run_telecommand_step(const ScriptStep& step);
  void tell_step(const ScriptStep& step, StepEnd end);
  void on_line(const std::string& line);
  void on_input();
  enum class Sending : std::uint8_t { itself, arming };
  void send(const std::string& name, const std::vector<std::string>& arguments,
            std::optional<milliseconds> timeout, const std::optional<TimeTag>& at = std::nullopt,
            Sending what = Sending::itself);
  /// Runs until the reports of order_ have come; its telecommand was completed.
  [[nodiscard]] Exit follow_order();
  /// Runs until the telecommand that was sent is over.
  [[nodiscard]] Exit follow(bool wait);
  /// Runs until @p over says so, a signal, or the deadline. @return false when the link was closed
  bool run(Watch watch, const std::function<bool()>& over, std::optional<MonotonicTime> deadline);
  void wait_once(Watch watch, std::optional<MonotonicTime> deadline, bool& closed);
  void write_json(const nlohmann::json& json);
  void write_lines(const std::string& lines);
  void fail(const std::string& message);
  void fail(const OrderError& error);
  /// Says why, and of which exit code it is. @param refused  of an order that was refused
  [[nodiscard]] Exit failed(const OrderError& error, Exit refused);
  /// Of the telecommand that was followed.
  [[nodiscard]] Exit end_of_telecommand(bool success) const;
  /// What is no failure.
  void note(const std::string& message);
  void write_stats();

  const mission::Dictionary& dictionary_;
  ConsoleOptions options_;
  Fd signals_;
  Station station_;
  bool interrupted_ = false;
  bool input_ended_ = false;
  bool quiet_telemetry_ = false;  // only what belongs to the telecommand is shown
  std::optional<Exit> not_sent_;  // of the newest telecommand
  std::string input_;
  std::uint64_t line_ = 0;
  MonotonicTime next_stats_;
  std::optional<StageReport> last_stage_;
  const ScriptStep* step_ = nullptr;  // the telecommand a script waits for
  std::optional<bool> step_judgement_;
  bool accepted_ = false;
  bool pong_ = false;
  std::optional<ReportOrder> order_;  // telemetry that is shown though the rest is quiet
  AdPhase told_phase_ = AdPhase::off;
  bool asks_for_clcw_ = false;
  std::optional<Retrieval> last_retrieval_;
  bool exchanging_ = false;             // only answers and failures are shown
  std::uint8_t exchanged_service_ = 0;  // the telecommand's: other services report by themselves
  std::vector<TelemetryReport> answers_;
  std::string awaited_name_;  // of a file that is to come down
  std::optional<cfdp::TransactionId> awaited_file_;
  std::optional<bool> awaited_arrived_;
  std::string installing_;  // name on board of the package; empty: none
  MonotonicTime installation_begun_;
  std::optional<InstallationEnd> installation_end_;
  bool refusal_told_ = false;
  MonotonicTime next_progress_;
  std::string last_progress_;
  std::optional<LatestValues> watched_;
  bool progress_shown_ = false;  // the terminal's cursor is in a progress line
};

/// Carries frames between line and UDP until a signal comes or the line ends.
[[nodiscard]] Exit run_bridge(Bridge& bridge, bool json);

/// The deployment file that @p text means: a file, or a name in launch_config ($SRFS_LAUNCH_DIR, beside the
/// installed program, or in the source tree). The error is ready to print.
[[nodiscard]] Result<std::filesystem::path, std::string> find_deployment(const std::string& text);

/// All commands, or one with its arguments.
[[nodiscard]] Exit list(const mission::Dictionary& dictionary, const std::string& name, bool json);

}  // namespace srfs::ground
