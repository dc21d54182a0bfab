// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// ttc and the folder of files, on its worker: CFDP, the PUS service 23, products of imaging.
#include "nodes/ttc/ttc_node.hpp"

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

Result<void, std::string> TtcNode::Files::open() {
  if (transfer_folders) return {};
  const cfdp::Settings settings{.own_entity = cfdp_spacecraft,
                                .peer_entity = cfdp_ground,
                                .receiving_octets_max = uplink_quota_octets,
                                .free_floor_octets = free_floor_octets};
  // Above all that were ever used, should the checkpoint be lost: less than one file a second was sent.
  const auto first = static_cast<std::uint32_t>(system_utc_now().ns() / 1'000'000'000);
  auto opened = cfdp::TransferFolders::open(root, checkpoint, settings, first, monotonic_now());
  if (!opened) return Err(opened.error().message);
  transfer_folders = std::move(*opened);
  if (transfer_folders->damaged()) {
    log::error("restarting file transfers in progress: checkpoint {}",
               cfdp::to_string(*transfer_folders->damaged()));
  }
  return {};
}

Result<cfdp::TransferTurnResult, std::string> TtcNode::Files::take_turn(const cfdp::TransferTurn& turn) {
  if (const auto opened = open(); !opened) return Err(opened.error());
  cfdp::TransferTurnResult result = cfdp::take_turn(*transfer_folders, turn, monotonic_now());
  for (const cfdp::News& news : result.news) {
    if (has_arrived(news)) images->on_sent(news.file.source_file);
  }
  images->mark_some();
  return result;
}

FileOutcome TtcNode::Files::serve(const FileOrder& order) {
  if (!open()) return {.failure = mission::failure::disk_failed};
  return manager->serve(*transfer_folders, order, monotonic_now());
}

ImagingOutcome TtcNode::Files::serve(const ImagingOrder& order) {
  ImagingOutcome outcome;
  const OutboxImage image{.task = order.task, .frame = order.frame, .run = order.run};
  if (order.action == ImagingAction::list_frames) {
    outcome.frames = images->newest_frames_of(order.task, order.frame);
    return outcome;
  }
  if (const auto opened = open(); !opened) {
    outcome.products.reason = opened.error();
    return outcome;
  }
  if (order.action == ImagingAction::queue_products) {
    outcome.products = images->queue(image, order.files, [this](const std::string& name) {
      return transfer_folders->sending(name).has_value();
    });
    return outcome;
  }
  const std::vector<std::string> names = images->queued(order.task);
  const MonotonicTime at = monotonic_now();
  for (const std::string& name : names) {
    if (const auto sending = transfer_folders->sending(name)) transfer_folders->entity().cancel(*sending, at);
  }
  outcome.products = {.queued = images->remove(names)};
  return outcome;
}

}  // namespace srfs
