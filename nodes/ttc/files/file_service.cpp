// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/files/file_service.hpp"

#include <algorithm>
#include <utility>

#include <mission/structures.hpp>

namespace srfs {
namespace {

template <class Groups>
std::vector<std::uint64_t> operations_of(const Groups& groups) {
  std::vector<std::uint64_t> operations;
  for (const auto& group : groups) operations.push_back(group.operation);
  return operations;
}

template <class Command>
std::optional<FileOrder> named_in_folder(OctetView arguments, FileAction action) {
  auto command = Command::decode(arguments);
  if (!command) return std::nullopt;
  FileOrder order{.action = action, .repository = std::move(command->repository)};
  if constexpr (requires { command->file; }) {
    order.name = std::move(command->file);
  } else {
    order.name = std::move(command->folder);
  }
  return order;
}

template <class Command>
std::optional<FileOrder> about_operations(OctetView arguments, FileAction action) {
  const auto groups = Command::decode(arguments);
  if (!groups) return std::nullopt;
  return FileOrder{.action = action, .operations = operations_of(*groups)};
}

template <class Command>
std::optional<FileOrder> about_repository(OctetView arguments, FileAction action) {
  auto command = Command::decode(arguments);
  if (!command) return std::nullopt;
  return FileOrder{.action = action, .repository = std::move(command->repository), .all_in_repository = true};
}

std::optional<FileOrder> copy_order(OctetView arguments) {
  auto command = mission::FileCopy::decode(arguments);
  if (!command) return std::nullopt;
  return FileOrder{.action = FileAction::copy,
                   .repository = std::move(command->source_repository),
                   .name = std::move(command->source_file),
                   .target_repository = std::move(command->target_repository),
                   .target_name = std::move(command->target_file),
                   .operations = {command->operation}};
}

std::optional<FileOrder> list_order(OctetView arguments) {
  auto command = mission::FileList::decode(arguments);
  if (!command) return std::nullopt;
  return FileOrder{.action = FileAction::list,
                   .repository = std::move(command->repository),
                   .name = std::move(command->after),
                   .most = command->most};
}

}  // namespace

std::optional<FileOrder> file_order_of(const mission::Command& command, OctetView arguments) {
  switch (command.subtype) {
    case mission::FileDelete::subtype:
      return named_in_folder<mission::FileDelete>(arguments, FileAction::delete_file);
    case mission::FileReport::subtype:
      return named_in_folder<mission::FileReport>(arguments, FileAction::report_attributes);
    case mission::FileMakeFolder::subtype:
      return named_in_folder<mission::FileMakeFolder>(arguments, FileAction::make_folder);
    case mission::FileRemoveFolder::subtype:
      return named_in_folder<mission::FileRemoveFolder>(arguments, FileAction::remove_folder);
    case mission::FileList::subtype:
      return list_order(arguments);
    case mission::FileCopy::subtype:
      return copy_order(arguments);
    case mission::FileSuspend::subtype:
      return about_operations<mission::FileSuspend>(arguments, FileAction::suspend);
    case mission::FileResume::subtype:
      return about_operations<mission::FileResume>(arguments, FileAction::resume);
    case mission::FileAbort::subtype:
      return about_operations<mission::FileAbort>(arguments, FileAction::abort);
    case mission::FileSuspendAll::subtype:
      return about_repository<mission::FileSuspendAll>(arguments, FileAction::suspend);
    case mission::FileResumeAll::subtype:
      return about_repository<mission::FileResumeAll>(arguments, FileAction::resume);
    case mission::FileAbortAll::subtype:
      return about_repository<mission::FileAbortAll>(arguments, FileAction::abort);
    case mission::FileReportCopies::subtype:
      return FileOrder{.action = FileAction::report_copies};
    default:
      return std::nullopt;
  }
}

void FileService::execute(const Telecommand& telecommand, MonotonicTime now) {
  const TelecommandOrigin& origin = telecommand.origin;
  if (telecommand.command->subtype == mission::FileStopReports::subtype) {
    status_interval_.reset();
    report_queue_.done(origin);
    return;
  }
  auto order = file_order_of(*telecommand.command, telecommand.arguments);
  if (!order) {
    report_queue_.failure(origin, Stage::start, mission::failure::unknown_subtype);
    return;
  }
  if (waiting_.size() == max_waiting) {
    report_queue_.failure(origin, Stage::start, mission::failure::busy);
    return;
  }
  if (const auto status = mission::FileReportCopies::decode(telecommand.arguments);
      status && order->action == FileAction::report_copies) {
    set_status_interval(origin, milliseconds(status->interval_ms), now);
  }
  order->number = next_number_++;
  order->repeated = telecommand.repeated;
  waiting_.push_back(
      {.origin = origin, .order = std::move(*order), .expiry = now + telecommand.command->timeout});
}

void FileService::set_status_interval(const TelecommandOrigin& origin, milliseconds interval,
                                      MonotonicTime now) {
  status_interval_.reset();
  if (interval == milliseconds(0)) return;
  status_interval_ = std::max(interval, shortest_interval);
  status_destination_ = origin.source_id;
  status_at_ = now + *status_interval_;
}

std::optional<FileOrder> FileService::next_order(MonotonicTime now) {
  if (at_worker_ || now < not_before_) return std::nullopt;
  if (!current_ && !waiting_.empty()) {
    current_ = std::move(waiting_.front());
    waiting_.pop_front();
  }
  status_running_ = !current_ && status_interval_ && now >= status_at_;
  if (status_running_) {
    status_at_ = now + *status_interval_;
    at_worker_ = true;
    return FileOrder{.number = next_number_++, .action = FileAction::report_copies};
  }
  if (!current_) return std::nullopt;
  at_worker_ = true;
  return current_->order;
}

void FileService::on_outcome(const FileOutcome& outcome, MonotonicTime now) {
  at_worker_ = false;
  const bool is_status = std::exchange(status_running_, false);
  if (!is_status && !current_) return;  // it was given up
  if (!is_status && outcome.unfinished) {
    if (!std::exchange(current_->started, true)) report_queue_.success(current_->origin, Stage::start);
    return on_time(now);
  }
  if (!is_status && outcome.failure != mission::failure::none) {
    report_queue_.failure(current_->origin, current_->started ? Stage::completion : Stage::start,
                          outcome.failure, outcome.failure_parameter);
    current_.reset();
    return;
  }
  if (!is_status && !current_->started) report_queue_.success(current_->origin, Stage::start);
  for (const Octets& data : outcome.reports) {
    report_queue_.put(Report{.apid = apid_,
                             .service = FileService::service_type,
                             .subtype = outcome.report_subtype,
                             .destination_id = is_status ? status_destination_ : current_->origin.source_id,
                             .data = data});
  }
  if (is_status) return;
  report_queue_.success(current_->origin, Stage::completion);
  current_.reset();
}

void FileService::on_refused(MonotonicTime now) {
  at_worker_ = false;
  status_running_ = false;
  not_before_ = now + retry_period;
}

void FileService::on_time(MonotonicTime now) {
  if (current_ && now >= current_->expiry) {
    end_overdue(*current_);
    current_.reset();
  }
  // Those of a shorter timeout may be over before one in front of them.
  std::erase_if(waiting_, [&](Request& request) {
    if (now < request.expiry) return false;
    end_overdue(request);
    return true;
  });
}

void FileService::end_overdue(Request& request) {
  // What is at the worker may still be done.
  const bool may_have_begun = at_worker_ && !status_running_ && current_ && &request == &*current_;
  if (may_have_begun && !request.started) report_queue_.success(request.origin, Stage::start);
  const bool begun = may_have_begun || request.started;
  report_queue_.failure(request.origin, begun ? Stage::completion : Stage::start,
                        begun ? mission::failure::completion_unknown : mission::failure::expired);
}

std::optional<MonotonicTime> FileService::next_due() const {
  std::optional<MonotonicTime> due;
  const auto sooner = [&](MonotonicTime t) {
    if (!due || t < *due) due = t;
  };
  if (current_) sooner(current_->expiry);
  for (const Request& request : waiting_) sooner(request.expiry);
  if (at_worker_) return due;
  if (current_ || !waiting_.empty()) sooner(not_before_);
  if (status_interval_) sooner(std::max(status_at_, not_before_));
  return due;
}

}  // namespace srfs
