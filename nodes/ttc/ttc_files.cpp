// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// ttc and the folder of files: CFDP between link and disk, the PUS service 23.
#include <numeric>

#include "nodes/ttc/ttc_node.hpp"

#include "base/saturate.hpp"

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

void TtcNode::serve_files() {
  const auto order = link_->file_service.next_order(monotonic_now());
  if (!order) return;
  const bool taken = files_worker_->ask([files = files_, order = *order] { return files->serve(order); },
                                        [this](const FileOutcome& outcome) {
                                          link_->file_service.on_outcome(outcome, monotonic_now());
                                          link_->files.on_change();
                                          if (is_active()) settle();
                                        });
  if (!taken) link_->file_service.on_refused(monotonic_now());
}

void TtcNode::pump_files() {
  auto turn = link_->files.next_turn(link_->downlink.room_octets(DownlinkChannel::files), monotonic_now(),
                                     {.octets = link_->downlink.field_octets(),
                                      .filled = link_->downlink.begun_octets(DownlinkChannel::files)});
  if (!turn) return;
  using Outcome = Result<cfdp::TransferTurnResult, std::string>;
  const bool taken = files_worker_->ask(
      [files = files_, turn = std::make_shared<cfdp::TransferTurn>(std::move(*turn))] {
        return files->take_turn(*turn);
      },
      [this](Outcome result) { on_files_turn(result); });
  if (!taken) link_->files.on_turn_refused(monotonic_now());
}

void TtcNode::on_files_turn(Result<cfdp::TransferTurnResult, std::string>& result) {
  note_storage(files_work_, result.has_value(), result ? "" : result.error(), "files");
  if (!result) {
    link_->files.on_turn_refused(monotonic_now());
  } else {
    for (Octets& packet : link_->files.on_turn(*result)) {
      link_->downlink.push(DownlinkChannel::files, std::move(packet), false, now());
    }
    for (const cfdp::News& news : result->news) tell_of_file(news);
    const cfdp::Counters& c = result->counters;
    files_status_.transactions = static_cast<std::uint8_t>(result->transactions);
    files_status_.resting = static_cast<std::uint8_t>(result->resting);
    const std::uint64_t malformed = std::accumulate(c.malformed.begin(), c.malformed.end(), std::uint64_t{0});
    files_status_.pdus_malformed = as_u32(malformed + link_->files.counters().malformed);
    files_status_.pdus_refused =
        as_u32(c.class_1 + c.not_for_us + c.no_room + c.no_transaction + c.late + c.unexpected);
    files_status_.data_repeated = as_u32(c.duplicate_data);
    files_status_.data_dropped = as_u32(c.dropped_data);
    files_status_.checkpoints = as_u32(c.checkpoints);
    files_status_.checkpoint_failures = as_u32(c.checkpoint_failures);
  }
  if (is_active()) settle();
}

void TtcNode::tell_of_file(const cfdp::News& news) {
  constexpr std::size_t name_octets_max = 120;
  const std::string name = news.file.destination_file.substr(0, name_octets_max);
  const bool down = news.event.role == cfdp::Role::sending;
  const auto direction = down ? mission::FileDirection::down : mission::FileDirection::up;
  const auto condition = static_cast<mission::FileCondition>(news.event.outcome.condition);
  if (news.event.kind == cfdp::EventKind::fault) {
    mission::FileFaultEvent event;
    event.name = name;
    event.direction = direction;
    event.condition = condition;
    event.reaction = cfdp::to_string(news.event.handler);
    return raise(event);
  }
  if (news.event.kind != cfdp::EventKind::finished) return;
  if (news.event.outcome.condition != wire::CfdpCondition::no_error || news.event.outcome.incomplete) {
    ++files_status_.failed;
    mission::FileFailedEvent event;
    event.name = name;
    event.direction = direction;
    event.condition = condition;
    return raise(event);
  }
  const auto say = [&](auto event) {
    event.name = name;
    event.octets = news.file.file_octets.value_or(0);
    raise(event);
  };
  if (down) {
    ++files_status_.sent;
    if (outbox_image(name)) link_->imaging.on_product_sent();
    say(mission::FileSentEvent{});
  } else {
    ++files_status_.received;
    say(mission::FileReceivedEvent{});
  }
}

}  // namespace srfs
