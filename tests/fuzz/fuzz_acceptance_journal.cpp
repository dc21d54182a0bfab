// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// ttc's journal of telecommands as read from a damaged disk. Input: one octet that selects the form; then
// either the octets of both segments (length u16 of the first), or records (kind u8, length u16, payload) as
// a sound disk with a wrong author would return them. Checks bounds, and that the journal works after any
// input.

#include <array>
#include <cstdlib>

#include "nodes/ttc/command/acceptance_journal.hpp"
#include "nodes/ttc/command/journal_log.hpp"

namespace {

using namespace srfs;

void require(bool condition) {
  if (!condition) std::abort();
}

class Memory final : public JournalMedium {
 public:
  std::array<Octets, segments> octets;
  Octets read(unsigned segment) override { return octets.at(segment); }
  Result<void, FileError> write(unsigned segment, std::size_t offset, OctetView added) override {
    Octets& to = octets.at(segment);
    to.resize(std::max(to.size(), offset + added.size()));
    std::copy(added.begin(), added.end(), to.begin() + static_cast<std::ptrdiff_t>(offset));
    return {};
  }
  Result<void, FileError> sync(unsigned) override { return {}; }
};

AcceptanceJournal make_journal() {
  return AcceptanceJournal("0f3a", seconds(60));
}

/// The contents of the journal as the next process finds them.
Octets written(AcceptanceJournal& journal, JournalLog& log) {
  JournalBatch batch = journal.take_batch(true);
  require(batch.snapshot.has_value());
  require(log.snapshot(*batch.snapshot).has_value());
  journal.on_written(batch, true, log.used_octets());
  return *batch.snapshot;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
  OctetReader in({input, size});
  const bool raw = in.u8() % 2 == 0;
  Memory disk;
  AcceptanceJournal journal = make_journal();
  if (raw) {
    const OctetView first = in.bytes(std::min<std::size_t>(in.u16(), in.remaining()));
    disk.octets[0].assign(first.begin(), first.end());
    const OctetView second = in.rest();
    disk.octets[1].assign(second.begin(), second.end());
  }
  JournalLog log(disk);
  for (const JournalRecord& record : log.load().records) (void)journal.apply(record);
  while (!raw && in.remaining() >= 3) {
    JournalRecord record{.kind = in.u8(), .payload = {}};
    const OctetView payload = in.bytes(std::min<std::size_t>(in.u16(), in.remaining()));
    record.payload.assign(payload.begin(), payload.end());
    (void)journal.apply(record);
  }
  const MonotonicTime now(seconds(100));
  journal.begin({}, 1, now);

  // Telecommands from the disk are reported and ended like all others.
  ReportQueue report_queue;
  std::size_t open = 0;
  std::vector<std::uint64_t> ids;
  for (const AcceptedTelecommand* t : journal.known()) {
    AcceptanceJournal::tell_again(*t, journal.told(), report_queue);
    ids.push_back(t->origin.id);
    open += t->end ? 0 : 1;
  }
  require(open == journal.open() && open <= AcceptanceJournal::max_open);
  require(ids.size() - open <= AcceptanceJournal::max_ended);
  if (journal.has_room()) {
    UplinkedPacket uplinked;
    uplinked.packet = {0x18, 1, 0xC0, 0, 0, 0, 0};
    uplinked.link = journal.link();
    mission::Command command;
    command.node = "ttc";
    const std::uint64_t id =
        journal.accept({.origin = {}, .command = &command, .expiry = now + seconds(10)}, uplinked, now);
    require(std::find(ids.begin(), ids.end(), id) == ids.end());
    ids.push_back(id);
  }
  const Octets state = written(journal, log);

  // The next process finds the same.
  AcceptanceJournal next = make_journal();
  JournalLog next_log(disk);
  for (const JournalRecord& record : next_log.load().records) (void)next.apply(record);
  next.begin({}, 1, now);
  require(next.known().size() == ids.size() && next.open() == journal.open());
  require(next.link() == journal.link());
  require(written(next, next_log) == state);

  for (const std::uint64_t id : ids) {
    next.on_taken(id);
    next.on_stage({.id = id, .stage = Stage::completion, .data = {}});
  }
  require(next.open() == 0);
  return 0;
}
