// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Carries out what the schedule of scrubbing decides (scrub_schedule.hpp): each slice on a worker that gives
// way to all other work.
#include <algorithm>

#include <dlfcn.h>

#include <mission/structures.hpp>

#include "msgs/mission/dictionary.hpp"
#include "nodes/maintenance/maintenance_node.hpp"
#include "nodes/maintenance/scrub_list.hpp"
#include "suite/launcher.hpp"

namespace srfs {
namespace {

// All other disk access goes first, so a slice may wait for long.
constexpr auto longest_slice = std::chrono::minutes(10);
constexpr std::size_t longest_file = 80;
constexpr std::size_t longest_why = 60;
constexpr std::size_t longest_build = 40;

std::filesystem::path library_folder() {
  Dl_info self{};
  if (dladdr(reinterpret_cast<const void*>(&suite::suite_bin_folder), &self) == 0 ||
      self.dli_fname == nullptr)
    return {};
  return std::filesystem::absolute(self.dli_fname).parent_path();
}

}  // namespace

void MaintenanceNode::declare_scrubbing() {
  constexpr std::int64_t day_s = 86400;
  declare_parameter("scrub_first_after_s", std::int64_t{300}, ros::ParameterRange{0, day_s},
                    "Delay of the first scrubbing round after the configuration");
  declare_parameter("scrub_interval_s", std::int64_t{21600}, ros::ParameterRange{0, 30 * day_s},
                    "Pause between rounds; 0: rounds by telecommand only");
  declare_parameter("scrub_pause_ms", std::int64_t{100}, ros::ParameterRange{0, 10000},
                    "Pause between slices of 128 KiB");
}

ScrubSchedule::Pace MaintenanceNode::scrub_pace() const {
  return {.first_after = seconds(get_parameter<std::int64_t>("scrub_first_after_s")),
          .interval = seconds(get_parameter<std::int64_t>("scrub_interval_s")),
          .pause = milliseconds(get_parameter<std::int64_t>("scrub_pause_ms"))};
}

void MaintenanceNode::open_scrubbing() {
  scrub_worker_ =
      create_background_worker("scrubber", 2, std::max<milliseconds>(worker_deadline(), longest_slice));
  scrubber_ = std::make_shared<update::Scrubber>(update::Scrubber::Settings{.folder = var().root / "golden"});
  scrubbing_.emplace();
  run(ScrubSchedule::start(scrub_pace()));
}

void MaintenanceNode::close_scrubbing() {
  scrub_timer_.reset();
  scrub_worker_.reset();
  scrub_actions_.clear();
  scrubbing_.reset();
  scrubber_.reset();
}

namespace {

/// None: it cannot be read, which open_limits() reports.
std::vector<std::filesystem::path> dictionary_files() {
  try {
    return mission::Dictionary::files(mission::Dictionary::default_folder());
  } catch (const ConfigError&) {
    return {};
  }
}

}  // namespace

void MaintenanceNode::carry_out(const CheckSlice& action) {
  scrub_timer_.reset();
  auto slice = std::make_shared<ScrubSchedule::Slice>();
  auto deployment = action.begins ? std::make_shared<const suite::Deployment>(this->deployment()) : nullptr;
  const bool taken = scrub_worker_->post(
      [var = var(), deployment, scrubber = scrubber_, begins = action.begins, slice] {
        const UtcTime at = system_utc_now();
        if (begins) {
          const Installation installation{suite::suite_bin_folder(), library_folder(), dictionary_files()};
          scrubber->begin(files_to_scrub(*deployment, var, installation), *begins, at);
          slice->more = scrubber->status().running;
        } else {
          slice->more = scrubber->step(at);
        }
        slice->status = scrubber->status();
        slice->findings = scrubber->take_findings();
      },
      [this, slice] {
        if (scrubbing_) run(scrubbing_->on_slice(std::move(*slice), scrub_pace()));
      });
  if (!taken) run(scrubbing_->on_refused());
}

void MaintenanceNode::carry_out(const AwaitSlice& action) {
  scrub_timer_ = create_one_shot(
      now() + action.wait, [this] { run(scrubbing_->on_due()); }, "scrubbing");
}

void MaintenanceNode::carry_out(const ReportFilesTaken& action) {
  raise(mission::MaintenanceFilesTakenEvent{.files = static_cast<std::uint16_t>(action.files),
                                            .build = action.build.substr(0, longest_build)});
}

void MaintenanceNode::carry_out(const ReportScrubRound& action) {
  const update::ScrubStatus& status = action.status;
  log::info("scrubbing: {} files, {} KiB, {} accepted as good, {} lost, {} not repaired", status.files,
            status.octets / 1024, status.taken, status.lost, status.unmended);
}

void MaintenanceNode::carry_out(const ReportFinding& action) {
  const update::ScrubFinding& finding = action.finding;
  const std::string file = end_of(finding.path, longest_file);
  const std::string why = finding.why.substr(0, longest_why);
  log::warn("scrubbing: {}{}{}", finding.path, finding.why.empty() ? " was repaired" : ": ", finding.why);
  switch (finding.what) {
    case update::ScrubFinding::What::damaged:
      return raise(mission::MaintenanceFileDamagedEvent{.file = file, .why = why});
    case update::ScrubFinding::What::mended:
      return raise(mission::MaintenanceFileMendedEvent{.file = file});
    case update::ScrubFinding::What::left:
      return raise(mission::MaintenanceFileLostEvent{.file = file, .why = why});
  }
}

}  // namespace srfs
