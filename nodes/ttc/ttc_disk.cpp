// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/ttc_disk.hpp"

#include "base/log.hpp"

namespace srfs {

TtcDisk::TtcDisk(Parts parts, Workers workers, TtcCore& core, std::function<void()> answered)
    : core_(core),
      answered_(std::move(answered)),
      state_(std::move(parts.state)),
      frame_counts_(std::move(parts.frame_counts)),
      frame_numbers_(std::move(parts.frame_numbers)),
      stores_(std::move(parts.stores)),
      files_(parts.files),
      workers_(std::move(workers)) {
  workers_.stores->post([this, counts = core_.reserved_counts()] {
    (void)frame_counts_.store(counts);  // the first commit writes them again, and says what fails
    stores_->open();
  });
}

// ---- journal

void TtcDisk::carry_out(const WriteJournal& action) {
  const auto batch = std::make_shared<const JournalBatch>(action.batch);
  const auto done = [this, batch](const StoredState::JournalWritten& outcome) {
    core_.on_journal_written(*batch, outcome.written, outcome.used_octets, monotonic_now());
    answered_();
  };
  const bool taken = workers_.journal->ask([this, batch] { return state_->write_journal(*batch); }, done);
  if (!taken) done({Err(FileError{"the journal's worker is busy"}), 0});
}

// ---- small files

void TtcDisk::carry_out(const WriteState& action) {
  const auto done = [this, change = action.change](bool stored) {
    core_.on_state_written(change, stored);
    answered_();
  };
  const bool taken = workers_.state->ask(
      [this, name = action.name, text = action.text] { return state_->write(name, text); }, done);
  if (taken) return;
  log::warn("{}: not written, its worker is busy", state_->path_of(action.name).string());
  done(false);
}

void TtcDisk::carry_out(const WriteKeys& action) {
  const auto done = [this, change = action.change](bool stored) {
    core_.on_keys_written(change, stored, monotonic_now());
    answered_();
  };
  const bool taken = workers_.state->ask(
      [this, selection = action.selection] { return state_->write_keys(selection); }, done);
  if (!taken) done(false);
}

void TtcDisk::carry_out(const WriteSessionKeys& action) {
  const auto change = std::make_shared<const SessionKeyChange>(action.change);
  const auto done = [this, change](bool stored) {
    core_.on_session_keys_written(*change, stored, monotonic_now());
    answered_();
  };
  const bool taken =
      workers_.state->ask([this, change] { return state_->write_session_keys(change->keys); }, done);
  if (!taken) done(false);
}

void TtcDisk::carry_out(const WriteRescueEntry& action) {
  const auto done = [this, entry = action.entry](bool stored) {
    core_.on_rescue_entry_written(entry, stored);
    answered_();
  };
  if (!workers_.state->ask([this] { return state_->write_rescue_entry(); }, done)) done(false);
}

void TtcDisk::carry_out(const WriteTable& action) {
  const auto written = std::make_shared<const WriteTable>(action);
  const auto done = [this, written](bool stored) {
    core_.on_table_written(written->name, written->change, stored);
    answered_();
  };
  const bool taken = workers_.state->ask(
      [this, written] { return state_->write_table(written->name, written->change.table); }, done);
  if (!taken) done(false);
}

void TtcDisk::carry_out(const CopyLinkState& action) {
  workers_.state->post([this, state = action.state] { state_->copy_link_state(state); });
}

void TtcDisk::carry_out(const ForgetWantedFloor& /*action*/) {
  workers_.state->post([this] { state_->forget_wanted_floor(); });
}

// ---- packet stores

void TtcDisk::carry_out(const CommitStores& action) {
  struct Committed {
    PacketStoresStatus status;
    Result<void, FileError> counts;
  };
  const auto commit = std::make_shared<const CommitStores>(action);
  const bool taken = workers_.stores->ask(
      [this, commit] {
        stores_->set_bounded(commit->bounded);
        for (const StoreItem& item : commit->items) stores_->append(item);
        stores_->commit();
        return Committed{stores_->status(), store_frames(*commit)};
      },
      [this, commit](const Committed& committed) {
        core_.on_committed(*commit, committed.status, committed.counts);
        answered_();  // open retrieval may have something to send
      });
  if (!taken) core_.on_commit_refused(action);
}

Result<void, FileError> TtcDisk::store_frames(const CommitStores& commit) {
  if (commit.numbers) {
    const auto stored = frame_numbers_.store(*commit.numbers);
    if (!stored.durable()) return Err(FileError{stored.problem});
  }
  return commit.counts ? frame_counts_.store(*commit.counts) : Result<void, FileError>();
}

void TtcDisk::carry_out(const ReadStore& action) {
  const auto read = std::make_shared<const ReadStore>(action);
  const bool taken = workers_.stores->ask(
      [this, read] {
        for (const StoreItem& item : read->items) stores_->append(item);
        return stores_->read(read->batch.period.store, read->batch.period.range, read->batch.cursor,
                             PacketRetrieval::batch_octets);
      },
      [this, read](std::optional<RetrievedPackets> packets) {
        core_.on_store_read(*read, std::move(packets), monotonic_now());
        answered_();
      });
  if (!taken) core_.on_read_refused(action);
}

void TtcDisk::store_rest() {
  auto items = core_.take_unstored();
  if (items.empty()) return;
  workers_.stores->post([this, items = std::move(items)] {
    for (const StoreItem& item : items) stores_->append(item);
    stores_->commit();
  });
}

// ---- files

void TtcDisk::carry_out(const ServeFile& action) {
  const bool taken =
      workers_.files->ask([this, order = action.order] { return files_.serve(order, monotonic_now()); },
                          [this](const FileOutcome& outcome) {
                            core_.on_file_outcome(outcome, monotonic_now());
                            answered_();
                          });
  if (!taken) core_.on_file_refused(monotonic_now());
}

void TtcDisk::carry_out(const TakeFilesTurn& action) {
  const bool taken = workers_.files->ask(
      [this, turn = std::make_shared<const cfdp::TransferTurn>(action.turn)] {
        return files_.take_turn(*turn, monotonic_now());
      },
      [this](Result<cfdp::TransferTurnResult, std::string> result) {
        core_.on_files_turn(result, monotonic_now());
        answered_();
      });
  if (!taken) core_.on_files_turn_refused(monotonic_now());
}

void TtcDisk::carry_out(const ServeImages& action) {
  const auto order = std::make_shared<const ImagingOrder>(action.order);
  const auto done = [this, order](const ImagingOutcome& outcome) {
    core_.on_imaging_job(*order, outcome);
    answered_();
  };
  if (!workers_.files->ask([this, order] { return files_.serve(*order, monotonic_now()); }, done)) done({});
}

// ---- end

void TtcDisk::close() {
  // No more is sent: the next start goes on exactly there.
  workers_.stores->post([this, counts = core_.frame_counts()] {
    if (const auto stored = frame_counts_.store(counts); !stored) log::warn("{}", stored.error().message);
  });
  store_rest();
  workers_.state->drain();
  workers_.stores->drain();
  workers_.files->drain();
}

}  // namespace srfs
