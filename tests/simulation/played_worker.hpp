// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <utility>

#include "tests/simulation/disk.hpp"

namespace srfs::simulation {

/// A worker of a process: its jobs wait for the disk, one after another. What it does for one is done at one
/// time; the answer comes behind it on the work thread.
class PlayedWorker {
 public:
  using Job = std::function<void()>;
  PlayedWorker(Host& host, Disk& disk) : host_(host), disk_(disk) {}

  void ask(Job job, Job answer) {
    jobs_.push_back({std::move(job), std::move(answer)});
    if (jobs_.size() == 1) begin();
  }
  [[nodiscard]] bool busy() const { return !jobs_.empty(); }
  /// Its process ends in the middle of the first job.
  void finish_first() {
    if (!jobs_.empty()) jobs_.front().work();
  }

 private:
  struct Entry {
    Job work;
    Job answer;
  };
  void begin() {
    host_.later(disk_.write_time(), [this] {
      const Entry entry = std::move(jobs_.front());
      jobs_.pop_front();
      entry.work();
      if (!jobs_.empty()) begin();
      entry.answer();
    });
  }
  Host& host_;
  Disk& disk_;
  std::deque<Entry> jobs_;  ///< the first is being done
};

}  // namespace srfs::simulation
