// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/rescue/starter.hpp"

#include <fmt/format.h>
#include <linux/reboot.h>
#include <sys/reboot.h>
#include <unistd.h>

#include "base/log.hpp"
#include "base/process.hpp"
#include "hw/open.hpp"
#include "programs/rescue/nodes_of_suite.hpp"
#include "suite/boot_store.hpp"
#include "suite/ring/fault_file.hpp"

namespace srfs::rescue {
namespace {

constexpr std::chrono::minutes longest_start{11};  // `srfs up`: ten deadlines of 60 s without progress
constexpr const char* patience_of_a_start_s = "60";
constexpr unsigned between_starts_s = 1;
constexpr unsigned between_tries_of_the_line_s = 5;

bool is_hardware(const std::string& watchdog) {
  return watchdog.starts_with("dev:");
}

/// Feeds the watchdog of a board during what may take longer than its time-out: measures, as long as they get
/// on, and a start of the suite, until timing has it, bounded by longest_start. This program hanging, a disk
/// that hangs, or the kernel, ends in a reset.
class WatchdogOfALongWork {
 public:
  explicit WatchdogOfALongWork(const suite::RescueSettings& settings)
      : settings_(settings), ours_(is_hardware(settings.watchdog)) {}
  void feed() {
    const MonotonicTime now = monotonic_now();
    if (!ours_ || now < next_) return;
    next_ = now + between_feeds;
    // Closed at once, so that timing can open it; closing does not disarm it.
    const auto watchdog =
        hw::open_watchdog(settings_.watchdog, settings_.var, seconds(settings_.watchdog_timeout_s));
    ours_ = watchdog && (*watchdog)->feed();
  }

 private:
  static constexpr milliseconds between_feeds{2000};
  const suite::RescueSettings& settings_;
  bool ours_;
  MonotonicTime next_;
};

}  // namespace

Starter::Starter(const suite::RescueSettings& settings)
    : settings_(settings),
      store_(std::filesystem::path(settings.var) / "state" / "boot"),
      record_(store_.read()) {}

void Starter::save() {
  ++record_.revision;
  const auto stored = store_.store(record_);
  if (!stored.durable()) return log::error("the start is not counted on the disk: {}", stored.problem);
  if (!stored.problem.empty()) log::warn("the start is counted in one copy alone: {}", stored.problem);
}

void Starter::count_start() {
  // Whoever made the suite healthy, or ended it in order, wrote it there meanwhile.
  if (suite::StepRecord stored = store_.read(); stored.revision > record_.revision)
    record_ = std::move(stored);
  const auto boot = suite::BootStore(std::filesystem::path(settings_.var) / "state" / "boot").load().state;
  const auto before = record_.step;
  record_ = suite::on_start(record_, boot, settings_.steps);
  save();
  if (record_.step != before) note_step();
  log::info("start {} since the suite was healthy, step {}", record_.starts, to_text(record_.step));
}

void Starter::note_step() const {
  suite::FaultRecord note;
  note.utc = system_utc_now();
  note.monotonic = monotonic_now();
  note.boot = kernel_boot_id().value_or("unknown");
  note.observer = "srfs_rescue";
  note.subject = "suite";
  note.misses = record_.unhealthy_starts();
  note.detail = fmt::format("step {}, cause {}", to_text(record_.step), to_text(record_.cause));
  note.cause = record_.detail;
  const bool runs = record_.step != suite::BootStep::rescue;
  note.outcome = runs ? suite::RestartOutcome::What::restarted : suite::RestartOutcome::What::held;
  const auto ledger = std::filesystem::path(settings_.var) / "state" / "ring" / "faults.log";
  if (const auto noted = suite::append_fault(ledger, std::move(note)); !noted)
    log::error("the step is not in the ledger: {}", noted.error());
}

void Starter::take_measures(suite::BootStep step) {
  WatchdogOfALongWork watchdog(settings_);
  const RecoveryFiles files(settings_, [&watchdog] { watchdog.feed(); });
  record_.set_aside = files.next_number(record_.set_aside);
  save();  // the number before the folder
  log::warn("step {}: its measures are taken", to_text(step));
  (void)files.make_room(RecoveryFiles::RoomFor::measures);
  LinkStore link(std::filesystem::path(settings_.var) / "state" / "ttc");
  (void)link.load(monotonic_now());
  if (const auto problems = files.take_measures(step, record_.set_aside, link); !problems.empty())
    log::error("{}", problems);
}

std::string Starter::start_suite() const {
  WatchdogOfALongWork watchdog(settings_);
  return run_program({settings_.program, "--deployment", settings_.deployment, "--var", settings_.var, "up",
                      "--deadline", patience_of_a_start_s},
                     longest_start, [&watchdog] { watchdog.feed(); });
}

std::optional<int> Starter::be_on_the_line() {
  if (!end_suite(settings_.var)) log::error("a node of the suite survives SIGKILL and may hold the line");
  auto rescuer = Rescuer::create(settings_, record_);
  while (!rescuer) {
    log::error("{}; tried again", rescuer.error());
    sleep(between_tries_of_the_line_s);
    rescuer = Rescuer::create(settings_, record_);
  }
  const RescueEnd end = (*rescuer)->serve();
  const std::uint32_t set_aside = (*rescuer)->step().set_aside;
  rescuer->reset();  // frees the line; the watchdog stays armed
  if (suite::StepRecord stored = store_.read(); stored.revision > record_.revision)
    record_ = std::move(stored);
  record_.set_aside = std::max(record_.set_aside, set_aside);
  if (end.kind == RescueEnd::Kind::reboot) {
    sync();
    if (is_hardware(settings_.watchdog)) (void)reboot(LINUX_REBOOT_CMD_RESTART);
    return restart_exit_code;
  }
  end_rescue(end);
  return std::nullopt;
}

void Starter::end_rescue(const RescueEnd& end) {
  if (end.kind == RescueEnd::Kind::start_suite) {
    // Before the record: after a cut in the middle it is rescue that comes again, and the order with it.
    for (const auto step : {suite::BootStep::last_good, suite::BootStep::golden}) {
      if (step <= end.step) take_measures(step);
    }
    record_ = suite::on_commanded(record_, end.step);
  } else {
    log::warn("no telecommand for {} s: the suite gets another try", settings_.steps.no_contact.count());
    record_ = suite::on_no_contact(record_, settings_.steps);
  }
  save();
  note_step();
}

void Starter::begin_start() {
  count_start();
  while (const auto step = suite::next_measures(record_, settings_.steps)) {
    take_measures(*step);
    record_ = suite::on_measures_taken(record_, *step);
    save();
  }
  RecoveryFiles(settings_).keep_reserve();
}

int Starter::start() {
  if (suite_runs(settings_.var)) return start_suite().empty() ? 0 : restart_exit_code;
  (void)end_suite(settings_.var);  // of a start that was cut off: nodes that are still being loaded
  while (true) {
    begin_start();
    if (record_.step == suite::BootStep::rescue) {
      if (const auto exit_code = be_on_the_line()) return *exit_code;
      continue;
    }
    record_.detail = start_suite();
    if (record_.detail.empty()) return 0;
    log::error("{}", record_.detail);
    save();
    (void)end_suite(settings_.var);
    sleep(between_starts_s);
  }
}

int Starter::answer() {
  return be_on_the_line().value_or(restart_exit_code);
}

int Starter::serve() {
  const auto exit_code = be_on_the_line();
  return exit_code ? *exit_code : start();
}

}  // namespace srfs::rescue
