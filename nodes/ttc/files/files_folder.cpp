// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/files/files_folder.hpp"

#include <mission/structures.hpp>

#include "base/log.hpp"

namespace srfs {
namespace {

constexpr std::uint64_t cfdp_ground = 1;
constexpr std::uint64_t cfdp_spacecraft = 2;

/// A file of ours stands whole at the ground.
bool has_arrived(const cfdp::News& news) {
  return news.event.kind == cfdp::EventKind::finished && news.event.role == cfdp::Role::sending &&
         news.event.outcome.condition == wire::CfdpCondition::no_error && !news.event.outcome.incomplete;
}

}  // namespace

Result<void, std::string> FilesFolder::open(MonotonicTime now) {
  if (transfer_folders_) return {};
  const cfdp::Settings settings{.own_entity = cfdp_spacecraft,
                                .peer_entity = cfdp_ground,
                                .receiving_octets_max = settings_.uplink_quota_octets,
                                .free_floor_octets = settings_.free_floor_octets};
  auto opened = cfdp::TransferFolders::open(settings_.root, settings_.checkpoint, settings,
                                            settings_.first_transaction(), now);
  if (!opened) return Err(opened.error().message);
  transfer_folders_ = std::move(*opened);
  if (transfer_folders_->damaged()) {
    log::error("restarting file transfers in progress: checkpoint {}",
               cfdp::to_string(*transfer_folders_->damaged()));
  }
  return {};
}

Result<cfdp::TransferTurnResult, std::string> FilesFolder::take_turn(const cfdp::TransferTurn& turn,
                                                                     MonotonicTime now) {
  if (const auto opened = open(now); !opened) return Err(opened.error());
  cfdp::TransferTurnResult result = cfdp::take_turn(*transfer_folders_, turn, now);
  for (const cfdp::News& news : result.news) {
    if (has_arrived(news)) images_.on_sent(news.file.source_file);
  }
  images_.mark_some();
  return result;
}

FileOutcome FilesFolder::serve(const FileOrder& order, MonotonicTime now) {
  if (!open(now)) return {.failure = mission::failure::disk_failed};
  return manager_.serve(*transfer_folders_, order, now);
}

ImagingOutcome FilesFolder::serve(const ImagingOrder& order, MonotonicTime now) {
  ImagingOutcome outcome;
  const OutboxImage image{.task = order.task, .frame = order.frame, .run = order.run};
  if (order.action == ImagingAction::list_frames) {
    outcome.frames = images_.newest_frames_of(order.task, order.frame);
    return outcome;
  }
  if (const auto opened = open(now); !opened) {
    outcome.products.reason = opened.error();
    return outcome;
  }
  if (order.action == ImagingAction::queue_products) {
    outcome.products = images_.queue(image, order.files, [this](const std::string& name) {
      return transfer_folders_->sending(name).has_value();
    });
    return outcome;
  }
  const std::vector<std::string> names = images_.queued(order.task);
  for (const std::string& name : names) {
    if (const auto sending = transfer_folders_->sending(name))
      transfer_folders_->entity().cancel(*sending, now);
  }
  outcome.products = {.queued = images_.remove(names)};
  return outcome;
}

}  // namespace srfs
