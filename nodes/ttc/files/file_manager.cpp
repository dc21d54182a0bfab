// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/files/file_manager.hpp"

#include <algorithm>
#include <utility>

#include <mission/structures.hpp>

namespace srfs {
namespace {

using cfdp::FileFault;

constexpr std::string_view ground_prefix = "ground:";
constexpr std::string_view outbox = "outbox/";
constexpr std::size_t status_name_octets = 200;
constexpr nanoseconds link_time_end = seconds(std::int64_t{1} << 32);  ///< CUC has 4 octets of seconds

std::uint16_t code_of(FileFault fault) {
  switch (fault) {
    case FileFault::bad_name:
      return mission::failure::bad_file_name;
    case FileFault::not_found:
      return mission::failure::file_not_found;
    case FileFault::not_a_file:
      return mission::failure::not_a_file;
    case FileFault::not_a_folder:
      return mission::failure::not_a_folder;
    case FileFault::not_empty:
      return mission::failure::folder_not_empty;
    case FileFault::denied:
      return mission::failure::file_denied;
    case FileFault::no_space:
      return mission::failure::no_space;
    case FileFault::io:
      return mission::failure::disk_failed;
  }
  return mission::failure::disk_failed;
}

FileOutcome failed(std::uint16_t code) {
  return {.failure = code};
}

FileOutcome outcome_of(const cfdp::FileResult<void>& result) {
  return result ? FileOutcome{} : failed(code_of(result.error()));
}

std::string joined(const std::string& folder, const std::string& name) {
  return folder.empty() ? name : folder + "/" + name;
}

/// A name of one part; where it leads, the tree judges.
bool is_single(const std::string& name) {
  return !name.empty() && name.find('/') == std::string::npos;
}

TaiTime link_time(std::int64_t utc_ns) {
  const TaiTime tai = to_tai(UtcTime(nanoseconds(utc_ns)));
  return TaiTime(std::clamp(tai.since_epoch(), nanoseconds(0), link_time_end - nanoseconds(1)));
}

mission::FileObject object_of(cfdp::EntryKind kind) {
  switch (kind) {
    case cfdp::EntryKind::file:
      return mission::FileObject::file;
    case cfdp::EntryKind::folder:
      return mission::FileObject::folder;
    case cfdp::EntryKind::other:
      break;
  }
  return mission::FileObject::other;
}

mission::FileCopyState state_of(const cfdp::Report& report) {
  using State = mission::FileCopyState;
  if (report.rest == cfdp::Rest::by_request) return State::suspended;
  if (report.cancelled) return State::cancelled;
  if (report.rest == cfdp::Rest::by_fault) return State::waits_for_contact;
  return report.waits_for_peer ? State::waits_for_peer : State::under_way;
}

const std::string& own_name(const cfdp::Report& report) {
  return report.role == cfdp::Role::sending ? report.source_file : report.destination_file;
}

bool is_within(const std::string& name, const std::string& folder) {
  return folder.empty() || name.starts_with(folder + "/");
}

}  // namespace

std::uint64_t operation_of(const cfdp::Report& report) {
  if (report.operation != 0) return report.operation;
  return report.id.source << 32 | (report.id.sequence & UINT32_MAX);
}

FileOutcome FileManager::serve(cfdp::TransferFolders& transfer_folders, const FileOrder& order,
                               MonotonicTime now) {
  if (reading_ && reading_->order != order.number) reading_.reset();  // no order waits for it any more
  if (!tree_) {
    auto opened = cfdp::FileTree::open(root_);
    if (!opened) return failed(mission::failure::disk_failed);
    tree_ = std::move(*opened);
  }
  switch (order.action) {
    case FileAction::delete_file:
      return delete_file(transfer_folders, order);
    case FileAction::report_attributes:
      return report_attributes(order);
    case FileAction::make_folder:
    case FileAction::remove_folder:
      return change_folder(order);
    case FileAction::list:
      return list(order);
    case FileAction::copy:
      return copy(transfer_folders, order);
    case FileAction::suspend:
    case FileAction::resume:
    case FileAction::abort:
      return change_copies(transfer_folders, order, now);
    case FileAction::report_copies:
      return report_copies(transfer_folders);
  }
  return failed(mission::failure::not_done);
}

FileOutcome FileManager::delete_file(const cfdp::TransferFolders& transfer_folders,
                                     const FileOrder& order) const {
  if (!is_single(order.name)) return failed(mission::failure::bad_file_name);
  const std::string name = joined(order.repository, order.name);
  for (const cfdp::Report& report : transfer_folders.entity().transactions()) {
    const bool reads_it =
        report.role == cfdp::Role::sending && !report.cancelled && report.source_file == name;
    if (reads_it) return failed(mission::failure::file_in_use);
  }
  const auto removed = tree_->remove_file(name);
  if (!removed && removed.error() == FileFault::not_found && order.repeated) return {};
  return outcome_of(removed);
}

FileOutcome FileManager::report_attributes(const FileOrder& order) {
  if (!is_single(order.name)) return failed(mission::failure::bad_file_name);
  const std::string name = joined(order.repository, order.name);
  if (!reading_) {
    auto file = tree_->open_file(name);
    if (!file) return failed(code_of(file.error()));
    const auto modular = wire::CfdpChecksum(wire::CfdpChecksumType::modular);
    reading_.emplace(
        Reading{.order = order.number, .file = std::move(*file), .digest = cfdp::FileDigest(modular)});
  }
  Reading& reading = *reading_;
  const std::uint64_t left = reading.file.stamp.octets - reading.digest.octets();
  Octets part(std::min<std::uint64_t>(left, octets_per_part));
  const auto read = cfdp::read_at(reading.file.fd.get(), reading.digest.octets(), part);
  const auto code = !read                 ? code_of(read.error())
                    : *read < part.size() ? mission::failure::file_changed
                                          : mission::failure::none;
  if (code != mission::failure::none) {
    reading_.reset();
    return failed(code);
  }
  reading.digest.update(part);
  if (reading.digest.octets() < reading.file.stamp.octets) return {.unfinished = true};

  Reading done = std::move(*reading_);
  reading_.reset();
  const auto now = tree_->stamp(name);
  if (!now) return failed(code_of(now.error()));
  if (*now != done.file.stamp) return failed(mission::failure::file_changed);
  mission::FileAttributes report;
  report.repository = order.repository;
  report.file = order.name;
  report.octets = done.file.stamp.octets;
  report.modified = link_time(done.file.stamp.modified_ns);
  report.checksum = done.digest.checksum();
  const Sha256::Digest hash = done.digest.finish();
  OctetReader words(hash);
  for (std::uint32_t& word : report.sha256) word = words.u32();
  return {.report_subtype = mission::FileAttributes::subtype, .reports = {report.encoded()}};
}

FileOutcome FileManager::change_folder(const FileOrder& order) const {
  if (!is_single(order.name)) return failed(mission::failure::bad_file_name);
  const std::string name = joined(order.repository, order.name);
  if (order.action == FileAction::make_folder) return outcome_of(tree_->make_folder(name));
  if (name == "outbox" || name == "unsent") return failed(mission::failure::file_denied);
  const auto removed = tree_->remove_folder(name);
  if (!removed && removed.error() == FileFault::not_found && order.repeated) return {};
  return outcome_of(removed);
}

FileOutcome FileManager::list(const FileOrder& order) const {
  const auto page = tree_->list(order.repository, order.name, order.most);
  if (!page) return failed(code_of(page.error()));
  FileOutcome outcome{.report_subtype = mission::RepositorySummary::subtype};
  mission::RepositorySummary report;
  report.repository = order.repository;
  report.total = page->total;
  report.left = page->left + static_cast<std::uint32_t>(page->entries.size());
  for (const cfdp::FolderEntry& entry : page->entries) {
    report.objects = 1;
    report.object = object_of(entry.kind);
    report.object_name = entry.name;
    report.octets = entry.octets;
    --report.left;
    outcome.reports.push_back(report.encoded());
  }
  if (page->entries.empty()) outcome.reports.push_back(report.encoded());
  return outcome;
}

FileOutcome FileManager::copy(cfdp::TransferFolders& transfer_folders, const FileOrder& order) const {
  const bool to_ground = order.target_repository.starts_with(ground_prefix);
  if (!to_ground || order.repository.starts_with(ground_prefix))
    return failed(mission::failure::copy_not_supported);
  const std::string target_name = order.target_name.empty() ? order.name : order.target_name;
  if (!is_single(order.name) || !is_single(target_name)) return failed(mission::failure::bad_file_name);
  const std::string source = joined(order.repository, order.name);
  const std::string target = joined(order.target_repository.substr(ground_prefix.size()), target_name);
  const std::uint64_t operation = order.operations.front();
  for (const cfdp::Report& report : transfer_folders.entity().transactions()) {
    if (report.role != cfdp::Role::sending) continue;
    const bool is_same = report.source_file == source && report.destination_file == target;
    if (report.operation == operation)
      return is_same && !report.cancelled ? FileOutcome{} : failed(mission::failure::operation_exists);
    // The first of two that ends takes the file out of the outbox.
    if (report.source_file == source && source.starts_with(outbox))
      return failed(mission::failure::file_in_use);
  }
  if (const auto stamp = tree_->stamp(source); !stamp) return failed(code_of(stamp.error()));
  const auto sent = transfer_folders.send(source, target, operation);
  if (sent) return {};
  switch (sent.error()) {
    case cfdp::PutError::no_room:
      return failed(mission::failure::too_many_copies);
    case cfdp::PutError::name_too_long:
      return failed(mission::failure::bad_file_name);
    case cfdp::PutError::file_too_large:
      return failed(mission::failure::copy_not_supported);
    case cfdp::PutError::file_refused:
      break;
  }
  return failed(mission::failure::disk_failed);
}

FileOutcome FileManager::change_copies(cfdp::TransferFolders& transfer_folders, const FileOrder& order,
                                       MonotonicTime now) {
  std::vector<cfdp::TransactionId> chosen;
  const std::vector<cfdp::Report> under_way = transfer_folders.entity().transactions();
  if (order.all_in_repository) {
    for (const cfdp::Report& report : under_way) {
      if (is_within(own_name(report), order.repository)) chosen.push_back(report.id);
    }
  } else {
    for (const std::uint64_t operation : order.operations) {
      const auto found = std::find_if(under_way.begin(), under_way.end(), [&](const cfdp::Report& report) {
        return operation_of(report) == operation;
      });
      if (found == under_way.end()) {
        OctetWriter parameter;
        parameter.u64(operation);
        return {.failure = mission::failure::unknown_operation, .failure_parameter = parameter.take()};
      }
      chosen.push_back(found->id);
    }
  }
  for (const cfdp::TransactionId id : chosen) {
    if (order.action == FileAction::suspend) transfer_folders.entity().suspend(id);
    if (order.action == FileAction::resume) transfer_folders.entity().resume(id, now);
    if (order.action == FileAction::abort) transfer_folders.entity().cancel(id, now);
  }
  return {};
}

FileOutcome FileManager::report_copies(const cfdp::TransferFolders& transfer_folders) {
  FileOutcome outcome{.report_subtype = mission::FileCopyStatus::subtype};
  const std::vector<cfdp::Report> under_way = transfer_folders.entity().transactions();
  auto left = static_cast<std::uint16_t>(under_way.size());
  for (const cfdp::Report& copy : under_way) {
    mission::FileCopyStatus report;
    report.operations = 1;
    report.operation = operation_of(copy);
    report.state = state_of(copy);
    report.direction =
        copy.role == cfdp::Role::sending ? mission::FileDirection::down : mission::FileDirection::up;
    report.source_entity = static_cast<std::uint16_t>(copy.id.source);
    report.sequence = static_cast<std::uint32_t>(copy.id.sequence);
    report.octets = copy.file_octets.value_or(UINT64_MAX);
    report.progress = copy.progress_octets;
    report.missing = copy.missing_octets;
    report.file = own_name(copy).substr(0, status_name_octets);
    report.left = --left;
    outcome.reports.push_back(report.encoded());
  }
  if (under_way.empty()) outcome.reports.push_back(mission::FileCopyStatus{}.encoded());
  return outcome;
}

}  // namespace srfs
