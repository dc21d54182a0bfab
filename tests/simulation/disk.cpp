// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/disk.hpp"

namespace srfs::simulation {

nanoseconds Disk::write_time() {
  const nanoseconds usual = random_.between(microseconds(300), milliseconds(12));
  return longest_ > nanoseconds(0) ? random_.between(usual, longest_) : usual;
}

void Disk::write(Host& host, std::string file, Octets content, Done done) {
  auto& jobs = jobs_[static_cast<std::size_t>(host.lane())];
  jobs.push_back({std::move(file), std::move(content), std::move(done)});
  if (jobs.size() == 1) begin(host);
}

void Disk::begin(Host& host) {
  kernel_.later(write_time(), [this, &host, pid = host.pid()] { finish(host, pid); });
}

void Disk::finish(Host& host, pid_t pid) {
  if (host.pid() != pid) return;
  auto& jobs = jobs_[static_cast<std::size_t>(host.lane())];
  const Job job = std::move(jobs.front());
  jobs.pop_front();
  const bool stored = !failing_;
  if (stored) files_[job.file] = job.content;
  host.trace(Lane::world, stored ? "file written" : "file not written", job.content.size());
  if (!jobs.empty()) begin(host);
  host.give([done = job.done, stored] { done(stored); });
}

bool Disk::write_now(const std::string& file, Octets content) {
  if (!failing_) files_[file] = std::move(content);
  return !failing_;
}

std::optional<Octets> Disk::read(const std::string& file) const {
  const auto found = files_.find(file);
  return found == files_.end() ? std::nullopt : std::optional(found->second);
}

void Disk::on_end(const Host& host) {
  auto& jobs = jobs_[static_cast<std::size_t>(host.lane())];
  if (!jobs.empty() && !failing_ && random_.one_in(2)) files_[jobs.front().file] = jobs.front().content;
  jobs.clear();
}

}  // namespace srfs::simulation
