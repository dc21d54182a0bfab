// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_processing/product_store.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "base/file.hpp"
#include "base/text.hpp"

namespace srfs {
namespace {

constexpr std::size_t task_digits = 10;

std::optional<std::uint32_t> task_of(const std::filesystem::path& folder) {
  const std::string name = folder.filename().string();
  return name.size() == task_digits ? to_number<std::uint32_t>(name) : std::nullopt;
}

std::uint64_t size_of(const std::filesystem::path& file) {
  std::error_code failed;
  const auto size = std::filesystem::file_size(file, failed);
  return failed ? 0 : size;
}

/// The files of a folder; none where it cannot be read.
std::vector<std::filesystem::path> files_in(const std::filesystem::path& folder) {
  std::error_code failed;
  std::vector<std::filesystem::path> files;
  for (std::filesystem::directory_iterator at(folder, failed), end; !failed && at != end;
       at.increment(failed))
    files.push_back(at->path());
  return files;
}

}  // namespace

ProductStore::ProductStore(std::filesystem::path images, std::uint64_t quota_octets)
    : images_(std::move(images)), quota_octets_(quota_octets) {
  scan();
  while (octets() > quota_octets_ && remove_oldest()) {
  }
}

void ProductStore::scan() {
  struct Found {
    std::filesystem::file_time_type newest;
    Task task;
  };
  std::vector<Found> found;
  for (const auto& path : files_in(images_ / "products")) {
    const auto number = task_of(path);
    if (!number) continue;
    Found task{std::filesystem::file_time_type::min(), {*number, 0}};
    std::error_code failed;
    for (const auto& file : files_in(path)) {
      if (file.extension() == ".tmp") {  // a write that power loss ended
        std::filesystem::remove(file, failed);
        continue;
      }
      task.task.octets += size_of(file);
      const auto written = std::filesystem::last_write_time(file, failed);
      if (!failed) task.newest = std::max(task.newest, written);
    }
    found.push_back(task);
  }
  std::sort(found.begin(), found.end(), [](const Found& a, const Found& b) {
    return a.newest != b.newest ? a.newest < b.newest : a.task.number < b.task.number;
  });
  for (const Found& f : found) tasks_.push_back(f.task);
}

void ProductStore::begin(std::uint32_t task, bool anew) {
  const auto known =
      std::find_if(tasks_.begin(), tasks_.end(), [&](const Task& t) { return t.number == task; });
  Task own{task, 0};
  if (known != tasks_.end()) tasks_.erase(known);
  std::error_code failed;
  for (const auto& file : files_in(folder(task))) {
    if (anew && !file.filename().string().starts_with(frame_prefix))
      std::filesystem::remove(file, failed);
    else
      own.octets += size_of(file);
  }
  tasks_.push_back(own);
  begun_ = true;
}

Result<std::string, StoreFailure> ProductStore::put(const std::string& name, OctetView content) {
  if (!begun_) return Err(StoreFailure{StoreProblem::disk, "no task is in progress"});
  const std::uint32_t task = tasks_.back().number;
  const auto path = folder(task) / name;
  const std::uint64_t before = size_of(path);
  while (octets() - before + content.size() > quota_octets_) {
    if (!remove_oldest())
      return Err(StoreFailure{StoreProblem::quota, fmt::format("{}: the product store is full", name)});
  }
  const std::string_view text = as_text(content);
  auto written = write_file_atomically(path, text);
  if (!written && remove_oldest()) written = write_file_atomically(path, text);
  if (!written) return Err(StoreFailure{StoreProblem::disk, written.error().message});
  tasks_.back().octets += content.size() - before;
  return fmt::format("products/{:010}/{}", task, name);
}

std::uint64_t ProductStore::octets() const {
  std::uint64_t sum = 0;
  for (const Task& t : tasks_) sum += t.octets;
  return sum;
}

std::filesystem::path ProductStore::folder(std::uint32_t task) const {
  return images_ / "products" / fmt::format("{:010}", task);
}

/// @return whether there was one
bool ProductStore::remove_oldest() {
  if (tasks_.size() <= (begun_ ? 1U : 0U)) return false;
  std::error_code failed;
  std::filesystem::remove_all(folder(tasks_.front().number), failed);
  tasks_.erase(
      tasks_.begin());  // what cannot be removed is no longer counted; the next start counts it again
  ++removed_tasks_;
  return true;
}

}  // namespace srfs
