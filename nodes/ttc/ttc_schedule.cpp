// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The time-based schedule and the time reports in the node: what is due goes the way of a telecommand.
#include <algorithm>

#include <mission/structures.hpp>

#include "nodes/ttc/ttc_node.hpp"

namespace srfs {

void TtcNode::run_schedule() {
  const MonotonicTime at = monotonic_now();
  ScheduleService& schedule = link_->schedule;
  schedule.on_time(link_->clock.tai_at(at), link_->clock.valid());
  if (!is_active()) return;  // the time of what is restored; nothing is released yet
  schedule.drop_overdue();
  report_dropped();
  // In the order of time: what finds no room holds up what is due after it.
  while (const ScheduledActivity* activity = schedule.due()) {
    if (!release(*activity, at)) break;
  }
}

bool TtcNode::release(const ScheduledActivity& activity, MonotonicTime at) {
  AcceptanceJournal& journal = link_->journal;
  if (!link_->gate.has_room() || !journal.has_room()) return false;
  JudgedTelecommand judged = link_->router.judge(activity.packet, at);
  if (judged.command != nullptr) {
    UplinkedPacket packet;  // it came in no frame: nothing repeats it
    packet.packet = activity.packet;
    judged.origin.id = journal.accept(packet, judged.origin, judged.command->node, judged.expiry,
                                      link_->uplink.state(), at, activity.id);
    link_->schedule.on_released();
  } else if (judged.refusal.code == mission::failure::queue_full) {
    return false;
  } else {
    record_refusal(judged, journal.link());  // before its place in the schedule goes
    link_->schedule.on_refused(activity);
  }
  link_->gate.enter(std::move(judged), journal.revision(), at);
  return true;
}

void TtcNode::report_dropped() {
  for (const DroppedActivity& dropped : link_->schedule.take_dropped()) {
    mission::ScheduleActivityDroppedEvent event;
    event.apid = dropped.request.apid;
    event.sequence = dropped.request.sequence;
    event.release = dropped.release;
    event.reason = dropped.disabled ? mission::ScheduleDrop::disabled : mission::ScheduleDrop::late;
    raise(event);
  }
}

void TtcNode::fill_next_scheduled(BeaconInputs& inputs) {
  link_->schedule.on_time(link_->clock.tai_at(now()), link_->clock.valid());
  const auto next = link_->schedule.next();
  if (!next) return;
  const auto packet = wire::parse_tc_packet(next->activity->packet);
  constexpr std::uint8_t function_service = 8;
  if (packet && packet->service == function_service)
    inputs.next_scheduled_function = OctetReader(packet->application).u16();
  if (next->in) {
    const auto whole = std::chrono::duration_cast<seconds>(*next->in).count();
    inputs.next_scheduled_in_s = static_cast<std::uint32_t>(std::min<std::int64_t>(whole, UINT32_MAX - 1));
  }
}

void TtcNode::send_schedule_housekeeping() {
  const TimeSchedule& schedule = link_->schedule.schedule();
  const ScheduleCounters& counters = link_->schedule.counters();
  mission::TtcScheduleHousekeeping h;
  h.enabled = schedule.enabled() ? mission::ScheduleStatus::enabled : mission::ScheduleStatus::disabled;
  h.activities = static_cast<std::uint16_t>(schedule.activities().size());
  h.octets = static_cast<std::uint32_t>(schedule.octets());
  h.groups = static_cast<std::uint8_t>(schedule.groups().size());
  h.inserted = counters.inserted;
  h.released = counters.released;
  h.late = counters.late;
  h.disabled = counters.disabled;
  h.refused = counters.refused;
  if (const auto report = link_->housekeeping.on_sample(h.apid, h.structure_id, h.encoded(), now()))
    send(report->report, report->live, true, false);
  settle();
}

void TtcNode::send_time_report() {
  const MonotonicTime at = now();
  if (auto packet = link_->time_reports.on_frames(link_->downlink.live_frames(), link_->clock.tai_at(at)))
    link_->downlink.push(DownlinkChannel::live, std::move(*packet), false, at);
}

}  // namespace srfs
