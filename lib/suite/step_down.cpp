// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/step_down.hpp"

#include <algorithm>
#include <array>
#include <sstream>
#include <thread>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include "base/crc32c.hpp"
#include "base/file.hpp"
#include "base/text.hpp"

namespace srfs::suite {
namespace {

constexpr std::string_view magic = "step1";

void change_step(StepRecord& record, BootStep step, StepCause cause) {
  record.step = step;
  record.cause = cause;
  record.reported = false;
}

bool is_ordered_into_rescue(const StepRecord& record) {
  return record.step == BootStep::rescue && record.cause == StepCause::commanded;
}

/// Printable, on one line, within its bound: it stands in the record as it is.
std::string clean(std::string_view detail) {
  std::string text(detail.substr(0, StepRecord::most_detail));
  for (char& c : text) {
    if (c < ' ' || c > '~') c = '?';
  }
  while (!text.empty() && text.back() == ' ') text.pop_back();
  text.erase(0, std::min(text.find_first_not_of(' '), text.size()));
  return text;
}

}  // namespace

std::string_view to_text(BootStep step) {
  switch (step) {
    case BootStep::normal:
      return "normal";
    case BootStep::last_good:
      return "last_good";
    case BootStep::golden:
      return "golden";
    case BootStep::rescue:
      break;
  }
  return "rescue";
}

std::string_view to_text(StepCause cause) {
  switch (cause) {
    case StepCause::none:
      return "none";
    case StepCause::unhealthy_starts:
      return "unhealthy_starts";
    case StepCause::start_failed:
      return "start_failed";
    case StepCause::commanded:
      return "commanded";
    case StepCause::no_contact:
      return "no_contact";
    case StepCause::calm:
      return "calm";
    case StepCause::record_damaged:
      break;
  }
  return "record_damaged";
}

BootStep step_after(std::uint32_t unhealthy_starts, const StepPolicy& policy) {
  if (unhealthy_starts >= policy.rescue) return BootStep::rescue;
  if (unhealthy_starts >= policy.golden) return BootStep::golden;
  return unhealthy_starts >= policy.last_good ? BootStep::last_good : BootStep::normal;
}

StepRecord on_start(StepRecord before, const std::optional<wire::BootRecord>& last,
                    const StepPolicy& policy) {
  if (last && last->healthy && last->count != before.healthy_boot) {
    before = on_healthy(std::move(before));
    before.healthy_boot = last->count;
  }
  if (before.starts < UINT32_MAX) ++before.starts;
  const BootStep asked = step_after(before.unhealthy_starts(), policy);
  if (asked > before.step) change_step(before, asked, StepCause::unhealthy_starts);
  return before;
}

std::optional<BootStep> next_measures(const StepRecord& record, const StepPolicy& policy) {
  if (is_ordered_into_rescue(record)) return std::nullopt;  // the suite is not tried
  // Rescue takes none of its own: those of golden were taken on the way, or are on their way now.
  const BootStep asked = std::min(step_after(record.unhealthy_starts(), policy), BootStep::golden);
  if (asked <= record.applied) return std::nullopt;
  return record.applied == BootStep::normal ? BootStep::last_good : BootStep::golden;
}

StepRecord on_measures_taken(StepRecord record, BootStep step) {
  record.applied = std::max(record.applied, step);
  return record;
}

StepRecord on_healthy(StepRecord record) {
  record.starts = 0;
  record.applied = BootStep::normal;
  // A healthy suite is not in rescue, however it was started; one that was told to go there is on its way.
  if (record.step == BootStep::rescue && !is_ordered_into_rescue(record))
    change_step(record, BootStep::golden, StepCause::calm);
  return record;
}

StepRecord on_order_into_rescue(StepRecord record) {
  change_step(record, BootStep::rescue, StepCause::commanded);
  return record;
}

StepRecord on_calm(StepRecord record) {
  const bool was_in_rescue = record.step == BootStep::rescue;
  record = on_healthy(std::move(record));
  if (record.step == BootStep::normal || was_in_rescue) return record;
  change_step(record, static_cast<BootStep>(static_cast<std::uint8_t>(record.step) - 1), StepCause::calm);
  return record;
}

StepRecord on_commanded(StepRecord record, BootStep step) {
  record = on_healthy(std::move(record));
  change_step(record, std::min(step, BootStep::golden), StepCause::commanded);
  return record;
}

StepRecord on_no_contact(StepRecord record, const StepPolicy& policy) {
  if (is_ordered_into_rescue(record)) {
    record = on_commanded(std::move(record), BootStep::normal);
    record.cause = StepCause::no_contact;
    return record;
  }
  record.starts = policy.rescue - 1;
  record.applied = BootStep::golden;
  change_step(record, BootStep::golden, StepCause::no_contact);
  return record;
}

std::string encode(const StepRecord& record) {
  const auto number = [](auto value) { return static_cast<unsigned>(value); };
  const std::string line =
      fmt::format("{} {} {} {} {} {} {} {} {} {}", magic, number(record.step), number(record.cause),
                  record.starts, record.healthy_boot, number(record.applied), record.set_aside,
                  number(record.reported), record.revision, clean(record.detail));
  return line + fmt::format(" {:08x}\n", crc32c(as_octets(line)));
}

std::optional<StepRecord> decode_step_record(std::string_view text) {
  constexpr std::size_t checksum_octets = 10;  // " 01234567\n"
  if (text.size() < checksum_octets) return std::nullopt;
  std::istringstream in{std::string(text.substr(0, text.size() - checksum_octets))};
  std::string found;
  StepRecord record;
  unsigned step = 0;
  unsigned cause = 0;
  unsigned applied = 0;
  unsigned reported = 0;
  in >> found >> step >> cause >> record.starts >> record.healthy_boot >> applied >> record.set_aside >>
      reported >> record.revision;
  if (!in || step > static_cast<unsigned>(BootStep::rescue) ||
      applied > static_cast<unsigned>(BootStep::golden) ||
      cause > static_cast<unsigned>(StepCause::record_damaged) || reported > 1)
    return std::nullopt;
  record.step = static_cast<BootStep>(step);
  record.cause = static_cast<StepCause>(cause);
  record.applied = static_cast<BootStep>(applied);
  record.reported = reported == 1;
  in.get();  // the space before the detail
  std::getline(in, record.detail);
  // Whatever is not exactly what encode() writes is damage.
  return encode(record) == text ? std::optional(record) : std::nullopt;
}

namespace {

constexpr StateCodec<StepRecord> codec{
    .encode = [](const StepRecord& record) { return encode(record); },
    .decode = [](std::string_view text) { return decode_step_record(text); },
    .is_newer = [](const StepRecord& record,
                   const StepRecord& than) { return record.revision > than.revision; },
};

constexpr std::array copies{"step_a", "step_b"};

/// Over what is there; a record is smaller than the block of the disk that the file has already.
bool overwrite(const std::filesystem::path& file, const std::string& text) {
  const Fd fd(open(file.c_str(), O_WRONLY | O_CLOEXEC | O_NOFOLLOW));
  const auto octets = static_cast<ssize_t>(text.size());
  return fd && pwrite(fd.get(), text.data(), text.size(), 0) == octets && ftruncate(fd.get(), octets) == 0 &&
         fsync(fd.get()) == 0;
}

}  // namespace

StepStore::StepStore(const std::filesystem::path& boot_folder)
    : StateFile(boot_folder / copies[0], boot_folder / copies[1], codec), folder_(boot_folder) {}

StepStore::Stored StepStore::store(const StepRecord& record) {
  Stored stored = StateFile::store(record);
  if (stored.durable()) return stored;
  std::array<std::uint32_t, copies.size()> revisions{};  // 0: damaged
  for (std::size_t i = 0; i < copies.size(); ++i) {
    const auto text = read_file(folder_ / copies.at(i), largest_octets);
    const auto found = text ? decode_step_record(*text) : std::nullopt;
    revisions.at(i) = found ? found->revision : 0;
  }
  const std::size_t older = revisions[0] <= revisions[1] ? 0 : 1;
  if (overwrite(folder_ / copies.at(older), encode(record))) ++stored.copies;
  return stored;
}

Fd StepStore::lock_folder() const {
  constexpr milliseconds period{2};
  Fd folder(open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!folder) return folder;
  for (milliseconds waited{0}; flock(folder.get(), LOCK_EX | LOCK_NB) != 0; waited += period) {
    if (waited >= lock_patience) return {};
    std::this_thread::sleep_for(period);
  }
  return folder;
}

StepRecord StepStore::read() {
  const Found found = load();
  if (found.state) return *found.state;
  StepRecord record;
  if (found.existed()) change_step(record, BootStep::normal, StepCause::record_damaged);
  return record;
}

}  // namespace srfs::suite
