// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Scrubbing in the node (lib/update/scrubber): one slice at a time on a worker that gives way to all other
// work.
#include <algorithm>

#include <dlfcn.h>

#include <mission/structures.hpp>

#include "msgs/mission/dictionary.hpp"
#include "nodes/maintenance/maintenance_node.hpp"
#include "nodes/maintenance/scrub_list.hpp"
#include "ros/launcher.hpp"

namespace srfs {
namespace {

// All other disk access goes first, so a slice may wait for long.
constexpr auto longest_slice = std::chrono::minutes(10);
constexpr std::size_t longest_file = 80;
constexpr std::size_t longest_why = 60;
constexpr std::size_t longest_build = 40;

std::filesystem::path library_folder() {
  Dl_info self{};
  if (dladdr(reinterpret_cast<const void*>(&ros::suite_bin_folder), &self) == 0 || self.dli_fname == nullptr)
    return {};
  return std::filesystem::absolute(self.dli_fname).parent_path();
}

}  // namespace

struct MaintenanceNode::Scrubbing {
  explicit Scrubbing(update::Scrubber::Settings settings)
      : scrubber(std::make_shared<update::Scrubber>(std::move(settings))) {}

  std::shared_ptr<update::Scrubber> scrubber;  ///< the worker's alone
  update::ScrubStatus status;                  ///< after the last slice
  update::ScrubMode mode = update::ScrubMode::start;
  bool under_way = false;
  bool first = true;
  bool retake = false;  ///< asked for
  std::shared_ptr<ros::Worker> worker;
  ros::Timer timer;
};

void MaintenanceNode::declare_scrubbing() {
  constexpr std::int64_t day_s = 86400;
  declare_parameter("scrub_first_after_s", std::int64_t{300}, ros::ParameterRange{0, day_s},
                    "Delay of the first scrubbing round after the configuration");
  declare_parameter("scrub_interval_s", std::int64_t{21600}, ros::ParameterRange{0, 30 * day_s},
                    "Pause between rounds; 0: rounds by telecommand only");
  declare_parameter("scrub_pause_ms", std::int64_t{100}, ros::ParameterRange{0, 10000},
                    "Pause between slices of 128 KiB");
}

void MaintenanceNode::open_scrubbing() {
  scrub_ = std::make_shared<Scrubbing>(update::Scrubber::Settings{.folder = var().root / "golden"});
  scrub_->worker =
      create_background_worker("scrubber", 2, std::max<milliseconds>(worker_deadline(), longest_slice));
  if (get_parameter<std::int64_t>("scrub_interval_s") > 0)
    scrub_later(seconds(get_parameter<std::int64_t>("scrub_first_after_s")));
}

void MaintenanceNode::close_scrubbing() {
  if (!scrub_) return;
  scrub_->timer.reset();
  scrub_->worker.reset();
  scrub_.reset();
}

void MaintenanceNode::scrub_later(nanoseconds wait) {
  scrub_->timer = create_one_shot(
      now() + wait, [this] { scrub_slice(); }, "scrubbing");
}

/// The next slice, or the first of a round.
void MaintenanceNode::scrub_slice() {
  struct Outcome {
    bool more = false;
    update::ScrubStatus status;
    std::vector<update::ScrubFinding> findings;
  };
  auto outcome = std::make_shared<Outcome>();
  const bool begins = !scrub_->under_way;
  if (begins) {
    scrub_->under_way = true;
    scrub_->mode = std::exchange(scrub_->retake, false) ? update::ScrubMode::retake
                   : scrub_->first                      ? update::ScrubMode::start
                                                        : update::ScrubMode::watch;
    scrub_->first = false;
  }
  const bool taken = scrub_->worker->post(
      [this, scrubber = scrub_->scrubber, begins, mode = scrub_->mode, outcome] {
        const UtcTime at = system_utc_now();
        if (begins) {
          const Installation installation{ros::suite_bin_folder(), library_folder(),
                                          mission::Dictionary::default_folder()};
          scrubber->begin(files_to_scrub(deployment(), var(), installation), mode, at);
          outcome->more = scrubber->status().running;
        } else {
          outcome->more = scrubber->step(at);
        }
        outcome->status = scrubber->status();
        outcome->findings = scrubber->take_findings();
      },
      [this, outcome] {
        if (!scrub_) return;
        scrub_->status = std::move(outcome->status);
        for (const update::ScrubFinding& finding : outcome->findings) report_finding(finding);
        if (outcome->more) {
          scrub_later(milliseconds(get_parameter<std::int64_t>("scrub_pause_ms")));
        } else {
          end_scrubbing_round();
        }
      });
  if (taken) return;
  if (begins) scrub_->under_way = false;
  scrub_later(seconds(1));
}

void MaintenanceNode::end_scrubbing_round() {
  scrub_->under_way = false;
  const update::ScrubStatus& status = scrub_->status;
  if (status.taken > 0 || scrub_->mode == update::ScrubMode::retake) {
    mission::MaintenanceFilesTakenEvent event;
    event.files = static_cast<std::uint16_t>(status.taken);
    event.build = status.build.substr(0, longest_build);
    raise(event);
  }
  log::info("scrubbing: {} files, {} KiB, {} accepted as good, {} lost, {} not repaired", status.files,
            status.octets / 1024, status.taken, status.lost, status.unmended);
  if (scrub_->retake) {
    scrub_slice();
  } else if (const auto interval = get_parameter<std::int64_t>("scrub_interval_s"); interval > 0) {
    scrub_later(seconds(interval));
  }
}

void MaintenanceNode::report_finding(const update::ScrubFinding& finding) {
  const std::string file = end_of(finding.path, longest_file);
  const std::string why = finding.why.substr(0, longest_why);
  log::warn("scrubbing: {}{}{}", finding.path, finding.why.empty() ? " was repaired" : ": ", finding.why);
  switch (finding.what) {
    case update::ScrubFinding::What::damaged: {
      mission::MaintenanceFileDamagedEvent event;
      event.file = file;
      event.why = why;
      raise(event);
      break;
    }
    case update::ScrubFinding::What::mended: {
      mission::MaintenanceFileMendedEvent event;
      event.file = file;
      raise(event);
      break;
    }
    case update::ScrubFinding::What::left: {
      mission::MaintenanceFileLostEvent event;
      event.file = file;
      event.why = why;
      raise(event);
      break;
    }
  }
}

// ---------------------------------------------------------------- telecommands

void MaintenanceNode::run_scrubbing(bool retake) {
  scrub_->retake = scrub_->retake || retake;
  if (!scrub_->under_way) {
    scrub_->timer.reset();
    scrub_slice();
  }
  finished(mission::failure::none);
}

mission::ScrubStatusHousekeeping MaintenanceNode::scrub_status() const {
  return to_mission(scrub_->status);
}

}  // namespace srfs
