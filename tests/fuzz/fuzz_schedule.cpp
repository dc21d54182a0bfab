// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The schedule as read from the disk, and the arguments of service 11 as received from the line.
#include <cstdlib>

#include <mission/structures.hpp>

#include "nodes/ttc/services/schedule_service.hpp"
#include "wire/pus.hpp"

namespace {

using namespace srfs;

void check(const TimeSchedule& schedule) {
  std::size_t octets = 0;
  for (const auto& [id, activity] : schedule.activities()) {
    octets += activity.packet.size();
  }
  if (octets != schedule.octets() || octets > TimeSchedule::max_octets) std::abort();
  if (schedule.activities().size() > TimeSchedule::max_activities) std::abort();
  if (schedule.groups().size() > TimeSchedule::max_groups) std::abort();
}

/// Checks that a decoded schedule stays the same when it is written and read again.
void read_state(OctetView octets) {
  OctetReader in(octets);
  const auto schedule = TimeSchedule::read(in);
  if (!schedule) return;
  check(*schedule);
  OctetWriter out(1U << 20);
  schedule->write(out);
  OctetReader again(out.view());
  if (TimeSchedule::read(again) != schedule) std::abort();
}

void read_changes(OctetView octets) {
  TimeSchedule schedule;
  OctetReader in(octets);
  for (int i = 0; i < 16 && in.remaining() > 0; ++i) {
    const auto change = read_schedule_change(in);
    if (!change) break;
    schedule.apply(*change);
    check(schedule);
  }
}

/// Input: successive requests, each with subtype, length and arguments. Carries out the requests that the
/// dictionary accepts.
void execute(const mission::Dictionary& dictionary, OctetView octets) {
  AcceptanceJournal journal("boot", seconds(60));
  ReportQueue report_queue;
  ScheduleService service(journal, report_queue, seconds(60));
  service.set_request_check([](OctetView packet) {
    return wire::parse_tc_packet(packet) ? std::nullopt
                                         : std::optional<ScheduleService::RequestError>({1, std::uint8_t{0}});
  });
  OctetReader in(octets);
  std::uint64_t id = 0;
  TaiTime now = to_tai(UtcTime(seconds(1'795'000'000)));
  while (in.ok() && in.remaining() > 2 && id < 64) {
    const std::uint8_t subtype = in.u8();
    const OctetView arguments = in.bytes(in.u8());
    const mission::Command* command =
        dictionary.request(mission::apid::ttc, ScheduleService::service_type, subtype);
    const Telecommand telecommand{
        .origin = {.id = ++id}, .command = command, .arguments = {arguments.begin(), arguments.end()}};
    if (command == nullptr || !dictionary.check_arguments(*command, arguments)) continue;
    if (service.why_refused(telecommand)) continue;
    service.on_time(now, id % 8 != 0);
    service.execute(telecommand, {});
    service.on_written(journal.revision(), true);
    service.drop_overdue();
    static_cast<void>(service.take_dropped());
    service.on_written(journal.revision(), true);
    while (const ScheduledActivity* activity = service.due()) service.on_refused(*activity);
    check(service.schedule());
    for (const Report& report : report_queue.take()) {
      if (report.data.size() > ScheduleService::report_octets) std::abort();
    }
    static_cast<void>(report_queue.take_stages());
    now += seconds(1);
  }
}

}  // namespace

/// The first octet selects the target.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const mission::Dictionary dictionary =
      mission::Dictionary::load(mission::Dictionary::default_folder());
  if (size == 0) return 0;
  const OctetView rest(data + 1, size - 1);
  switch (data[0] % 3) {
    case 0:
      read_state(rest);
      break;
    case 1:
      read_changes(rest);
      break;
    default:
      execute(dictionary, rest);
  }
  return 0;
}
