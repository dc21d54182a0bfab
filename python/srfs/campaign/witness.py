# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Judges a recording made while processes were stopped and killed: the record of the bus against the grants, and the peripherals' list of
executed telecommands against the reports. Pure functions, independent of the flight code; docs/reference/icd_can.md is their source.

All times are CLOCK_MONOTONIC in ns.
"""

import bisect
import collections
import dataclasses

from srfs.flight.deployments import PAYLOADS
from srfs.record.can_frames import computer_frames
from srfs.report import all_ok, check_none, quantiles

MS = 1_000_000
ACCEPTED, STARTED, COMPLETED = 1, 3, 7  # stages of srfs_msgs/TelecommandReport
INTERRUPTED, EXPIRED = 36, 20  # failure codes: outcome unknown; never begun
UNANSWERED = {30, 31, 35}  # silence, garbage, slot over, three times in a row (a reset: once): also of unknown outcome
ANSWERED_OF = 1000  # in a soak, one of so many telecommands may go unanswered
COMPLETION_UNKNOWN = 40  # its node reported no end in time
NOT_TAKEN = 21  # its node did not accept it before it expired
REFUSALS = {10, 11, 22}  # by the node, before acceptance: no room, no storage, not active
FIRST_PERIPHERAL_ACTION = 16  # functions from here on reset or power-cycle the peripheral: at most once


@dataclasses.dataclass(frozen=True, order=True)
class Grant:
    published: int
    switcher: int
    number: int
    holder: str
    lease_end: int

    @property
    def id(self):
        return (self.switcher, self.number)


def grants_of(messages):
    """The grants in order of publication. The observer may miss a flag whose sender was killed while it sent to one receiver after the
    other; such a grant is taken from its holder's TAKEN message, which precedes the first frame."""
    grants = {}
    taken = {}
    for m in messages:
        key = (m.get("switcher"), m.get("grant"))
        if m["type"] == "flags" and m["holder"]:
            grants.setdefault(key, Grant(m["published_ns"], *key, m["holder"], m["lease_end_ns"]))
        elif m["type"] == "bus" and m["status"] == "taken":
            taken.setdefault(key, Grant(m["said_ns"], *key, m["payload"], 0))
    return sorted({**taken, **grants}.values())


def at(ns):
    return f"{ns / 1e9:.6f}"


# --- the bus ------------------------------------------------------------------------------------------------------------


def frames_in_their_slots(frames, grants):
    """Every frame belongs to the holder of the newest grant; none follows the publication of a newer grant."""
    starts = [grant.published for grant in grants]
    wrong = []
    for frame in frames:
        running = bisect.bisect_right(starts, frame.at) - 1
        if running < 0 or grants[running].holder != frame.payload:
            holder = f"{grants[running].holder} (grant {grants[running].id})" if running >= 0 else "nobody"
            wrong.append(f"{at(frame.at)} a frame of {frame.payload} while {holder} had the bus")
    return check_none(wrong, "every frame of the computer is in a slot of its payload, none after a newer grant", len(frames))


def no_interleaving(frames, grants):
    """No frame of another payload lies between two frames of one payload in the same grant: a payload that sends again after another one
    sent must have received a new grant in between."""
    wrong = []
    last_of = {}
    starts_of = collections.defaultdict(list)
    for grant in grants:
        starts_of[grant.holder].append(grant.published)
    before = None
    for frame in frames:
        if before is not None and before.payload != frame.payload and frame.payload in last_of:
            own = last_of[frame.payload]
            between = bisect.bisect_right(starts_of[frame.payload], frame.at) - bisect.bisect_right(starts_of[frame.payload], own)
            if between == 0:
                wrong.append(f"{at(frame.at)} a frame of {frame.payload} after one of {before.payload} at {at(before.at)}, both in one grant")
        last_of[frame.payload] = frame.at
        before = frame
    return check_none(wrong, "frames of two payloads never interleave within one grant")


def one_flag(messages):
    wrong = [f"{at(m['at_ns'])} flags {m['flags']}" for m in messages if m["type"] == "flags" and sum(map(bool, m["flags"])) > 1]
    return check_none(wrong, "at most one flag is true")


def grants_rise(grants):
    wrong = [f"{b.id} published after {a.id}" for a, b in zip(grants, grants[1:]) if b.id <= a.id]
    return check_none(wrong, "grants rise, across restarts of the switcher too", len(grants))


def one_holder(messages, grants):
    """No grant comes before the holder gave the bus back or its lease ended. An end that the observer missed proves nothing here: its sender
    was stopped or killed after its report to the switcher, or had just started. The checks of the frames cover that case."""
    ended = {}
    for m in messages:
        if m["type"] == "bus" and m["status"] in ("released", "failed"):
            ended.setdefault((m["switcher"], m["grant"]), m["said_ns"])
    wrong = []
    for a, b in zip(grants, grants[1:]):
        until = min(a.lease_end, ended.get(a.id, 0))
        if b.published < until:
            wrong.append(f"{b.id} for {b.holder} at {at(b.published)}, {a.holder} had the bus until {at(until)}")
    return check_none(wrong, "nobody is granted before the holder gave the bus back or its lease was over")


# --- telecommands -------------------------------------------------------------------------------------------------------


@dataclasses.dataclass
class Telecommand:
    target: str
    function: int
    accepted: bool = False
    success: bool = False
    failure: int | None = None
    heard: int = 0  # when it was published
    failed: int = 0  # when it was reported as failed

    @property
    def at_most_once(self):
        return self.function >= FIRST_PERIPHERAL_ACTION


def telecommands_of(messages):
    """{id: Telecommand} of everything published to payloads, with the reports on it."""
    found = {}
    for m in messages:
        if m["type"] == "telecommand" and m["target"] in PAYLOADS:
            found.setdefault(m["id"], Telecommand(m["target"], m["function"], heard=m["at_ns"]))
    for m in messages:
        t = found.get(m.get("id")) if m["type"] == "report" else None
        if t is None:
            continue
        if m["stage"] == ACCEPTED:
            t.accepted |= m["success"]
        elif m["stage"] == COMPLETED and m["success"]:
            t.success = True
        elif not m["success"]:
            t.failure, t.failed = m["failure_code"], m["at_ns"]
    return found


def was_late(late, begin, end):
    return any(a <= end and b >= begin for a, b in late)


def never_late(_payload, _begin, _end):
    return None


def executed_once(telecommands, executed, soak=False, late=(), why_late=never_late):
    """executed: {payload: [low 32 bits of ids, in order]} as the peripherals report it.
    soak: hours on a busy machine, where an answer may come too late three times in a row; otherwise every telecommand must be answered.
    late: [(begin, end)] of periods in which the machine, and with it the simulated peripherals, was late (python/srfs/flight/lateness.py);
    telecommands under way in such a period may go unanswered.
    why_late(payload, begin, end): why what needed this payload between two times may have come late; None: no reason was measured."""
    counts = {payload: collections.Counter(ids) for payload, ids in executed.items()}
    repeated, missing, false_reports, unanswered = [], [], [], []
    accepted = excused = 0
    for number, t in telecommands.items():
        if t.at_most_once:
            continue
        times = counts.get(t.target, {}).get(number & 0xFFFFFFFF, 0)
        accepted += t.accepted
        name = f"{number:#x} to {t.target}"
        if times > 1:
            repeated.append(f"{name} was executed {times} times")
        if t.success and times == 0:
            false_reports.append(f"{name} is reported as completed and was not executed")
        if t.failure == EXPIRED and times > 0:
            false_reports.append(f"{name} is reported as expired and was executed")
        # The observer may miss reports of a process that has just started; told_to_the_ground() judges what the ground received.
        if t.accepted and not t.success and t.failure not in UNANSWERED | {INTERRUPTED} and not (t.failure is None and times == 1) and not (t.failure == EXPIRED and times == 0):
            missing.append(f"{name}: {'failure code ' + str(t.failure) if t.failure is not None else 'no end was reported'}, executed {times} times")
        if t.accepted and t.failure in UNANSWERED:
            if was_late(late, t.heard, t.failed) or why_late(t.target, t.heard, t.failed):
                excused += 1
            else:
                unanswered.append(f"{name}: failure code {t.failure}, executed {times} times")
    return [
        check_none(repeated, "no telecommand is executed twice at a peripheral"),
        check_none(false_reports, "what is reported is what the peripheral did"),
        check_none(missing, "every accepted telecommand is executed once, or reported as expired or of unknown outcome", accepted),
        check_none(unanswered if len(unanswered) > (accepted // ANSWERED_OF if soak else 0) else [],
              "peripherals answer every telecommand" + (f" but {len(unanswered)}, at most one in {ANSWERED_OF}" if soak else "")
              + (f" and {excused} while this machine was late" if excused else "")),  # fmt: skip
    ]


def told_to_the_ground(stages, soak=False, late=(), overloads=(), why_late=never_late):
    """Every telecommand sent has its end on the ground, and an accepted one fails only with a code that states what happened.
    In a soak, executed_once() judges how many remain unanswered. late: as in executed_once(). overloads: [(begin, end)] of overloads made
    by the campaign, in which a telecommand may expire before its node gets a CPU to accept it. why_late: as in executed_once()."""
    first, last, wrong = {}, {}, []
    for m in stages:
        first.setdefault(m["line"], m)
        last[m["line"]] = m
    for m in last.values():
        begin, end = first[m["line"]]["at_ns"], m["at_ns"]
        allowed = REFUSALS | {INTERRUPTED, EXPIRED}
        if soak or m["command"].endswith(".reset_peripheral") or was_late(late, begin, end):
            allowed |= UNANSWERED
        if was_late(overloads, begin, end):
            allowed |= {NOT_TAKEN}
        fails = m["final"] and not m["success"] and m["code"] not in allowed
        if fails and why_late("payload_" + m["command"].split(".")[0], begin, end):
            allowed |= UNANSWERED | {NOT_TAKEN, COMPLETION_UNKNOWN}
        if not m["final"]:
            wrong.append(f"{m['command']} (line {m['line']}): {m['stage']}, and no end")
        elif not m["success"] and m["code"] not in allowed:
            wrong.append(f"{m['command']} (line {m['line']}): {m['stage']}, code {m['code']}")
    return check_none(wrong, "the ground is told the end of every telecommand", len(last))


def at_most_once(telecommands, frames, orders):
    """Resets carry no id, so the bus must not carry more of them than telecommands and the switcher ordered. Their ends are judged from the
    ground's record, because the observer may miss reports of a process that has just started."""
    wrong = []
    by_payload = collections.Counter(frame.payload for frame in frames if frame.is_reset)
    for payload, seen in by_payload.items():
        commanded = sum(1 for t in telecommands.values() if t.target == payload and t.at_most_once)
        ordered = sum(1 for m in orders if m["payload"] == payload)
        if seen > commanded + ordered:
            wrong.append(f"{seen} resets of {payload}, ordered by {commanded} telecommands and {ordered} times by the switcher")
    return check_none(wrong, "at-most-once telecommands are never repeated", sum(by_payload.values()))


# --- recovery -----------------------------------------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Fault:
    kind: str  # class of the fault: the action and its target
    victim: str
    begin: int
    end: int  # when a stopped process continues; for a kill: begin


@dataclasses.dataclass(frozen=True)
class Recovery:
    fault: Fault
    bus_gap: int | None  # from the fault to the end of the first slot granted and used after it
    victim_gap: int | None  # from the fault's end to the victim's next used slot; None for the switcher, which has no slot


def used_slots(messages, grants):
    """[(published, given back, holder)] of slots whose payload used and gave back the bus, by time of publication."""
    by_id = {grant.id: grant for grant in grants}
    used = []
    for m in messages:
        grant = by_id.get((m.get("switcher"), m.get("grant"))) if m["type"] == "bus" and m["status"] == "released" else None
        if grant and m["sent"] > 0:
            used.append((grant.published, m["said_ns"], grant.holder))
    return sorted(used)


def recoveries(faults, slots):
    found = []
    for fault in faults:
        first = next((slot for slot in slots[bisect.bisect_left(slots, (fault.begin,)):]), None)
        own = next((slot for slot in slots[bisect.bisect_left(slots, (fault.end,)):] if slot[2] == fault.victim), None)
        is_payload = fault.victim in PAYLOADS
        found.append(Recovery(fault, first and first[1] - fault.begin, own and is_payload and own[1] - fault.end or None))
    return found


def bounded_gaps(found, bound_ns):
    """bound_ns: limit of the bus gap, in addition to the time for which the victim was stopped, and limit of the victim's gap."""
    wrong = []
    for r in found:
        stopped = r.fault.end - r.fault.begin
        if r.bus_gap is None or r.bus_gap > stopped + bound_ns:
            wrong.append(f"{at(r.fault.begin)} {r.fault.kind}: the bus was not used again for {'ever' if r.bus_gap is None else f'{r.bus_gap / MS:.0f} ms'}")
        if r.fault.victim in PAYLOADS and (r.victim_gap is None or r.victim_gap > bound_ns):
            wrong.append(f"{at(r.fault.begin)} {r.fault.kind}: {r.fault.victim} had no slot "
                         f"{'any more' if r.victim_gap is None else f'for {r.victim_gap / MS:.0f} ms'}")  # fmt: skip
    return check_none(wrong, f"after every fault the rotation goes on and the victim comes back, each within {bound_ns / 1e9:g} s", len(found))


def distribution(values):
    return {"count": len(values), **(quantiles(values, "p50 p90 p99 max", MS, 1, "_ms") if values else {})}


# --- all of it ----------------------------------------------------------------------------------------------------------


def judge(lines, messages, executed, faults, bound_ns, late=(), why_late=never_late):
    grants = grants_of(messages)
    # The bus was in use before the observer received flags: its record of earlier slots may lack some.
    flags = {(m["switcher"], m["grant"]) for m in messages if m["type"] == "flags" and m["holder"]}
    begin = next((grant.published for grant in grants if grant.id in flags), 0)
    frames = [frame for frame in computer_frames(lines) if frame.at >= begin]
    telecommands = telecommands_of(messages)
    found = recoveries(faults, used_slots(messages, grants))
    orders = [m for m in messages if m["type"] == "peripheral_reset"]
    checks = [
        check_none([] if frames and grants else ["nothing was recorded"], "the bus was recorded"),
        one_flag(messages),
        grants_rise(grants),
        one_holder(messages, grants),
        frames_in_their_slots(frames, grants),
        no_interleaving(frames, grants),
        *executed_once(telecommands, executed, late=late, why_late=why_late),
        at_most_once(telecommands, frames, orders),
        told_to_the_ground([m for m in messages if m["type"] == "tc_stage"], late=late, why_late=why_late),
        bounded_gaps(found, bound_ns),
    ]
    kinds = sorted({r.fault.kind for r in found})
    return {
        "ok": all_ok(checks),
        "checks": checks,
        "slots": len(grants),
        "slots_used": len(used_slots(messages, grants)),
        "frames": len(frames),
        "late_frames": sum(1 for _ in late_frames(frames, grants)),
        "peripheral_resets_ordered": len(orders),
        "telecommands": {
            "sent": len(telecommands),
            "accepted": sum(t.accepted for t in telecommands.values()),
            "completed": sum(t.success for t in telecommands.values()),
            "outcome_unknown": sum(t.failure == INTERRUPTED for t in telecommands.values()),
            "executed": sum(map(len, executed.values())),
        },
        "faults": {kind: {
            "count": sum(1 for r in found if r.fault.kind == kind),
            "bus_gap": distribution([r.bus_gap for r in found if r.fault.kind == kind and r.bus_gap is not None]),
            "victim_gap": distribution([r.victim_gap for r in found if r.fault.kind == kind and r.victim_gap is not None]),
        } for kind in kinds},
    }, found  # fmt: skip


def late_frames(frames, grants):
    """Frames that end after the lease they were sent under. The handle no longer writes by then, so these frames waited for the bus."""
    starts = [grant.published for grant in grants]
    for frame in frames:
        running = bisect.bisect_right(starts, frame.at) - 1
        if running >= 0 and grants[running].lease_end and frame.at > grants[running].lease_end:
            yield frame
