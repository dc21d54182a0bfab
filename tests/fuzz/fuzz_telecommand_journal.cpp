// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The journal of a node that executes telecommands, with a correct checksum over arbitrary content, followed
// by arbitrary operations. Input: length u16 and octets of the file without checksum; then steps of one octet
// each.

#include <cstdlib>

#include <mission/structures.hpp>

#include "suite/commanding/telecommand_journal.hpp"
#include "wire/crc16.hpp"

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
  using namespace srfs;
  OctetReader in({input, size});
  OctetWriter content;
  content.bytes(in.bytes(std::min<std::size_t>(in.u16(), in.remaining())));
  const std::uint16_t check = wire::crc16(content.view());
  content.u16(check);
  TelecommandJournal journal("0f3a");
  (void)journal.restore(content.view());
  // The file as it comes from the disk, mostly with a wrong checksum.
  (void)TelecommandJournal("0f3a").restore({input, size});

  MonotonicTime now(seconds(5));
  std::uint64_t id = 1;
  while (in.remaining() > 0) {
    const std::uint8_t step = in.u8();
    const StoredTelecommand* const next = journal.next(now);
    switch (step % 8) {
      case 0:
        journal.add({.id = id++,
                     .function = step,
                     .repeat = static_cast<RepeatClass>(1 + step / 8 % 3),
                     .expiry = now + seconds(step / 8),
                     .arguments = {step}});
        break;
      case 1:
      case 2:
        journal.on_written(journal.revision(), step % 8 == 1);
        break;
      case 3:
        now += milliseconds(100 * (step / 8));
        break;
      case 4:
        journal.repeat_reports(step / 8);
        break;
      case 5:
        journal.on_ids_lost();
        break;
      default:
        if (next == nullptr) break;
        if (next->repeat == RepeatClass::at_most_once) {
          journal.mark_started();
          if (!journal.start_is_durable()) break;
        }
        journal.begin();
        if (step % 8 == 6) {
          journal.finish(mission::failure::none);
        } else {
          (void)journal.attempt_failed(mission::failure::peripheral_silent);
        }
    }
    require(journal.pending() <= TelecommandJournal::capacity);
    (void)journal.take_reports();
  }

  // The next process must be able to read what this one writes.
  const Octets written = journal.encode();
  TelecommandJournal again("0f3a");
  require(again.restore(written).has_value());
  require(again.pending() <= journal.pending());
  require(again.encode().size() <= written.size() + TelecommandJournal::capacity * 16);
  return 0;
}
