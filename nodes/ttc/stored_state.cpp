// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/stored_state.hpp"

#include <algorithm>

#include "base/log.hpp"
#include "base/process.hpp"

namespace srfs {
namespace {

/// There while the counters of the uplink have no floor yet.
constexpr const char* wanted_floor_file = "counters_lost";
constexpr std::string_view first_start_text = "first start\n";  ///< in it; else counters were lost

}  // namespace

StoredState::StoredState(std::filesystem::path folder, std::filesystem::path keys)
    : folder_(std::move(folder)),
      keys_(std::move(keys)),
      journal_file_(folder_ / "telecommands"),
      journal_log_(journal_file_),
      link_file_(folder_ / "link_state") {}

// ---- start

bool StoredState::ran_before(const std::filesystem::path& stores) const {
  std::error_code ec;
  if (std::filesystem::exists(folder_ / "link_state", ec) || std::filesystem::exists(folder_ / "mode", ec))
    return true;
  // Its own state may be lost and the packets it stored not.
  const auto stored = std::filesystem::directory_iterator(stores, ec);
  return !ec && std::any_of(begin(stored), end(stored), [](const auto& store) {
    std::error_code none;
    return store.is_directory(none) && !std::filesystem::is_empty(store.path(), none);
  });
}

ModeManager StoredState::load_mode(MissionMode initial, bool ran) const {
  const std::filesystem::path file = folder_ / "mode";
  const auto stored = read_file(file, 512);
  const StoredModeState state = stored ? StoredModeState::present
                                : ran  ? StoredModeState::missing
                                       : StoredModeState::first_start;
  // Of what is lost nothing is known but that it counted from 0, one in a second at most.
  const auto lost_change = static_cast<std::uint32_t>(system_utc_now().ns() / 1'000'000'000);
  ModeManager manager(state, stored.value_or(""), initial, lost_change);
  if (const auto written = write_file_atomically(file, manager.stored_text()); !written) {
    log::error("the mode is not durable: {}", written.error().message);
  }
  log::info("mode {}: {}", to_text(manager.mode()), manager.reason());
  return manager;
}

TransmitterSwitch StoredState::load_transmitter(MonotonicTime now) const {
  const std::filesystem::path file = folder_ / "transmitter";
  const auto stored = read_file(file, 256);
  TransmitterSwitch transmitter(kernel_boot_id().value_or("unknown"), stored.value_or(""), now);
  if (!transmitter.may_transmit(now))
    log::warn("the transmitter stays off for {} s", transmitter.rest(now) / seconds(1));
  // A silence that begins anew with this boot must not do so with the next.
  if (const auto written = write_file_atomically(file, transmitter.stored_text()); !written)
    log::error("the state of the transmitter is not durable: {}", written.error().message);
  return transmitter;
}

CommandLossTimer StoredState::load_command_loss(seconds patience, MonotonicTime now) const {
  const auto stored = read_file(folder_ / "command_loss", 256);
  return {kernel_boot_id().value_or("unknown"), stored.value_or(""), patience, now};
}

std::string StoredState::load_stores() const {
  return read_file(folder_ / "stores", 4096).value_or("");
}

FoundTable StoredState::load_table(std::string_view name) const {
  auto file = stored_table_file(folder_ / name);
  auto found = file.load();
  if (found.state && !found.damaged.empty()) {  // the damaged copy is made whole
    if (const auto stored = file.store(*found.state); !stored.problem.empty())
      log::error("{}", stored.problem);
  }
  const bool damaged = found.existed() && !found.state;
  return {.table = std::move(found.state), .damaged = damaged};
}

KeySelection StoredState::load_keys(UplinkConfig& config, std::vector<TtcCore::KeyNews>& news) const {
  auto file = key_selection_file(folder_ / "key_selection");
  const auto found = file.load();
  const KeySelection selection = found.state.value_or(KeySelection{});
  const bool lost = found.existed() && !found.state;
  for (UplinkChannel& channel : config.channels) {
    if (channel.associations.empty()) continue;
    const auto has = [&channel](KeySet set) {
      return std::any_of(channel.associations.begin(), channel.associations.end(),
                         [set](const UplinkAssociation& a) { return a.set == set; });
    };
    const auto stored = selection.sets.find(channel.vc);
    if (stored != selection.sets.end()) channel.selected = stored->second;
    if (lost) news.push_back({channel.vc, channel.selected, "the stored selection is damaged"});
    const KeySet other = channel.selected == KeySet::a ? KeySet::b : KeySet::a;
    if (!has(channel.selected) && has(other)) {
      channel.selected = other;
      news.push_back({channel.vc, other, "the selected keys are unusable"});
    }
  }
  if (found.damaged.empty()) return selection;
  if (const auto stored = file.store(selection); !stored.problem.empty()) log::error("{}", stored.problem);
  return selection;
}

FoundSessionKeys StoredState::load_session_keys(UplinkConfig& config) const {
  return srfs::load_session_keys(keys_, config);
}

/// A first start looks like the loss of everything that ttc wrote: it wants a floor, too.
/// @param nothing no state of the link was found. @param ran although there was one
FloorWanted StoredState::floor_wanted(bool nothing, bool ran) const {
  const std::filesystem::path marker = folder_ / wanted_floor_file;
  const auto noted = read_file(marker, 64);
  const bool lost = (nothing && ran) || (noted && *noted != first_start_text);
  if (!nothing && !noted) return FloorWanted::no;
  if (lost) log::error("the counters of the uplink are lost: any is taken until the time is valid");
  if (const auto written = write_file_atomically(marker, lost ? "" : first_start_text); !written)
    log::error("that the counters want a floor is not durable: {}", written.error().message);
  return lost ? FloorWanted::counters_lost : FloorWanted::first_start;
}

void StoredState::load_journal(TtcCore::Setup& setup, bool ran, std::uint64_t known_id, UtcTime utc,
                               MonotonicTime now) {
  AcceptanceJournal& journal = setup.journal;
  const JournalLog::Found found = journal_log_.load();
  setup.journal_damaged_octets = found.damaged_octets;
  for (const JournalRecord& record : found.records) {
    if (!journal.apply(record))
      setup.journal_damaged_octets += record.payload.size() + journal_record_overhead;
  }
  const LinkStateFile::Found copy = link_file_.load();
  const bool lost = found.existed && !journal.has_state() && journal.link().generation == 0;
  setup.journal_damage = !lost ? setup.journal_damaged_octets > 0 ? "the rest is read" : ""
                         : copy.state.generation != 0 ? "telecommands lost, counters from their copy"
                                                      : "telecommands and counters lost";
  if (!setup.journal_damage.empty()) {
    log::error("the journal of telecommands is damaged, {} octets skipped: {}", setup.journal_damaged_octets,
               setup.journal_damage);
  }
  setup.copied_generation = copy.state.generation;
  journal.begin(copy.state, first_telecommand_id(copy.state.next_telecommand_id, known_id, utc), now);
  const bool nothing = !journal.has_state() && journal.link().generation == 0;
  setup.first_start = nothing && !(ran || found.existed);
  setup.floor = floor_wanted(nothing, ran || found.existed);
  // A first start that is killed from here on has left a journal, and is none any more.
  if (!nothing) return;
  const JournalBatch batch = journal.take_batch(true);
  const JournalWritten written = write_journal(batch);
  journal.on_written(batch, written.written.has_value(), written.used_octets);
}

// ---- writing

StoredState::JournalWritten StoredState::write_journal(const JournalBatch& batch) {
  JournalWritten outcome;
  outcome.written = batch.snapshot ? journal_log_.snapshot(*batch.snapshot)
                                   : journal_log_.append(batch.records, batch.sync);
  outcome.used_octets = journal_log_.used_octets();
  return outcome;
}

bool StoredState::write(const std::string& name, const std::string& text) const {
  const auto written = write_file_atomically(folder_ / name, text);
  if (!written) log::warn("{}", written.error().message);
  return written.has_value();
}

bool StoredState::write_keys(const KeySelection& selection) const {
  const auto stored = key_selection_file(folder_ / "key_selection").store(selection);
  if (!stored.problem.empty()) log::error("{}", stored.problem);
  return stored.durable();
}

bool StoredState::write_session_keys(const wire::SessionKeys& keys) const {
  return store_session_keys(keys_, keys);
}

bool StoredState::write_rescue_entry() const {
  const std::string problem =
      suite::StepStore(folder_.parent_path() / "boot").change(suite::on_order_into_rescue);
  if (!problem.empty()) log::error("{}", problem);
  return problem.empty();
}

bool StoredState::write_table(const std::string& name, const StoredTable& table) const {
  const auto stored = stored_table_file(folder_ / name).store(table);
  if (!stored.problem.empty()) log::error("{}", stored.problem);
  return stored.durable();
}

void StoredState::copy_link_state(const LinkState& state) {
  if (const auto written = link_file_.store(state); !written) log::warn("{}", written.error().message);
}

void StoredState::forget_wanted_floor() const {
  const std::filesystem::path marker = folder_ / wanted_floor_file;
  std::error_code ec;
  std::filesystem::remove(marker, ec);
  if (ec) log::error("{}: cannot be removed: {}", marker.string(), ec.message());
}

}  // namespace srfs
