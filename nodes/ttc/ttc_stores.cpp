// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// ttc and the packet stores (PUS service 15): commits, retrieval, what the ground has set.
#include <algorithm>

#include "nodes/ttc/ttc_node.hpp"

#include "base/saturate.hpp"

namespace srfs {
namespace {

constexpr int patience_commits = 10;  ///< a commit that misses so many of its seconds is a failing disk
constexpr const char* stores_name = "packet stores";

}  // namespace

void TtcNode::commit_stores() {
  if (commit_running_) {  // a slow disk: what comes meanwhile waits, bounded
    if (++commits_missed_ == patience_commits)
      note_storage(stores_work_, false, "the packet stores do not answer", stores_name);
    return;
  }
  commits_missed_ = 0;
  persist_journal(true);
  // What has left and is in this commit, the ground has or can ask for.
  const bool all_left = link_->downlink.empty(DownlinkChannel::live) && outgoing_.empty();
  const std::uint64_t told = all_left ? link_->journal.said() : 0;
  const auto counts = frame_count_reserve_.wanted(link_->downlink.frame_counts());
  struct Committed {
    PacketStoresStatus status;
    Result<void, FileError> counts;
  };
  commit_running_ = store_worker_->ask(
      [stores = stores_, items = to_store_, bounded = link_->stores.bounded(), file = frame_count_file_,
       counts] {
        stores->set_bounded(bounded);
        for (const StoreItem& item : items) stores->append(item);
        stores->commit();
        Committed committed{stores->status(), {}};
        if (counts) committed.counts = file->store(*counts);
        return committed;
      },
      [this, told, counts](const Committed& committed) {
        commit_running_ = false;
        if (counts) on_frame_counts_stored(*counts, committed.counts);
        if (committed.status.failure.empty()) link_->journal.on_told(told);
        on_store_status(committed.status);
      });
  if (commit_running_) to_store_.clear();
}

void TtcNode::on_frame_counts_stored(const wire::TmFrameCounts& counts,
                                     const Result<void, FileError>& stored) {
  if (stored) frame_count_reserve_.on_stored(counts);
  if (!stored && frame_counts_stored_)
    log::warn("{}: a reset of the computer may use TM frame counters twice", stored.error().message);
  frame_counts_stored_ = stored.has_value();
}

void TtcNode::on_store_status(const PacketStoresStatus& status) {
  for (const auto& [id, store] : status.stores) {
    const auto before = std::find_if(store_status_.stores.begin(), store_status_.stores.end(),
                                     [id = id](const auto& known) { return known.first == id; });
    const std::uint64_t known =
        before == store_status_.stores.end() ? 0 : before->second.counters.damaged_octets;
    if (link_->stores.on_status(id, store)) {
      mission::TtcStoreFullEvent event;
      event.store = id;
      raise(event);
    }
    if (store.counters.damaged_octets == known) continue;
    mission::TtcStoreDamagedEvent event;
    event.store = id;
    event.skipped = as_u32(store.counters.damaged_octets - known);
    raise(event);
  }
  store_status_ = status;
  note_storage(stores_work_, status.failure.empty(), status.failure, stores_name);
  if (is_active()) settle();  // open retrieval may have something to send
}

void TtcNode::feed_playback() {
  PacketRetrieval& retrieval = link_->retrieval;
  const bool empty = link_->downlink.empty(DownlinkChannel::playback);
  retrieval.on_playback(empty);
  link_->stores.on_left(link_->downlink.framed_octets(DownlinkChannel::playback));
  send_reports(link_->report_queue.take(), std::nullopt);  // the completion, before its event
  for (const RetrievalDone& done : retrieval.take_done()) {
    mission::TtcRetrievalDoneEvent event;
    event.store = done.store;
    event.packets = done.packets;
    event.octets = done.octets;
    send_behind_ends(event);
  }
  persist_journal();

  const std::size_t room = link_->downlink.room_octets(DownlinkChannel::playback);
  if (const auto batch = retrieval.next_batch(room)) {
    const bool taken =
        read_batch(*batch, [this](std::uint64_t request, std::optional<RetrievedPackets> read) {
          if (read) return link_->retrieval.on_batch(request, std::move(*read));
          link_->retrieval.fail(request);
          return std::vector<Octets>{};
        });
    if (!taken) retrieval.on_batch_refused();
  }
  if (const auto batch = link_->stores.next_batch(room)) {
    const bool taken =
        read_batch(*batch, [this](std::uint64_t request, std::optional<RetrievedPackets> read) {
          return link_->stores.on_batch(request, std::move(read));
        });
    if (!taken) link_->stores.on_batch_refused();
  }
}

bool TtcNode::read_batch(const PacketRetrieval::Batch& batch, BatchTaker take) {
  const bool posted = store_worker_->ask(
      [stores = stores_, batch, items = to_store_] {
        for (const StoreItem& item : items)
          stores->append(item);  // what was sent up to now belongs to the period too
        return stores->read(batch.period.store, batch.period.range, batch.cursor,
                            PacketRetrieval::batch_octets);
      },
      [this, request = batch.request, take = std::move(take)](std::optional<RetrievedPackets> read) {
        for (Octets& packet : take(request, std::move(read)))
          link_->downlink.push(DownlinkChannel::playback, std::move(packet), false, now());
        link_->stores.on_pushed(link_->downlink.pushed_octets(DownlinkChannel::playback));
        if (is_active()) settle();
      });
  if (posted) to_store_.clear();
  return posted;
}

std::string TtcNode::load_stores() const {
  return read_file(state_dir() / "stores", 4096).value_or("");
}

void TtcNode::store_stores_change() {
  const auto change = link_->stores.take_change();
  if (!change) return;
  write_state("stores", change->stored_text,
              [this, change = *change](bool stored) { link_->stores.change_stored(change, stored); });
}

void TtcNode::store_open_progress() {
  if (!link_->stores.take_progress()) return;
  state_worker_->post([path = state_dir() / "stores", text = link_->stores.stored_text()] {
    if (const auto written = write_file_atomically(path, text); !written)
      log::warn("cannot save the position of the open retrieval: {}", written.error().message);
  });
}

}  // namespace srfs
