# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""States of the payloads over time, as `srfs record` saw them, and what the paper's Fig. 14 says about their shape. Pure.

All times are CLOCK_MONOTONIC in ns. A state lasts from its message to the next one of the same payload.
"""

import dataclasses

from srfs.record.heartbeats import AHEAD_NS, heartbeat_of, period_of
from srfs.report import check, percentile

OFF, OCCUPYING, PROCESSING, ASYNC = "off", "occupying_can", "data_processing", "other_async_command"
STATES = (OFF, OCCUPYING, PROCESSING, ASYNC)  # as the paper lists them, lowest in the drawing first

COMPLETED = 7  # srfs_msgs/TelecommandReport.COMPLETED

MS = 1_000_000
SWITCH_BOUND_NS = 50 * MS  # heartbeat -> flag -> the payload has the bus, half of the times
LATE_NS = 200 * MS  # the same, each time: on a busy machine two processes may each wait for a CPU
RELEASE_BOUND_NS = 100 * MS  # release -> the switcher hears it
PULSE_BOUND_NS = 200 * MS  # "an instantaneous state": storing one telecommand, with its disk write


@dataclasses.dataclass(frozen=True)
class Interval:
    payload: str
    state: str
    begin: int
    end: int

    def overlap(self, other):
        return max(0, min(self.end, other.end) - max(self.begin, other.begin))


@dataclasses.dataclass(frozen=True)
class Grant:
    payload: str
    cycle: int  # of the heartbeat that the switcher had heard last
    caused: int  # when the switcher heard this heartbeat, made one itself, or heard what else made it grant the bus
    published: int


@dataclasses.dataclass(frozen=True)
class Switch:
    """A slot and the heartbeat at which it was given: its number, and when it was due. None: at none."""

    slot: Interval
    cycle: int | None = None
    due: int | None = None


class Timeline:
    """Collects messages of `srfs record`; on_message may run in another thread than what asks."""

    def __init__(self, payloads):
        self.payloads = list(payloads)
        self.changes = []  # (since, payload, state)
        self.due = {}  # cycle -> when this heartbeat was due
        self.grants = {}  # (switcher incarnation, grant counter) -> Grant
        self.telecommands = {}  # id -> (target, when heard)
        self.completed = {}  # id -> when its completion was heard

    def on_message(self, m):
        kind = m["type"]
        if kind == "activity" and m["payload"] in self.payloads:
            self.changes.append((m["since_ns"], m["payload"], m["state"]))
        elif kind == "tick":
            self.due[m["cycle"]] = m["due_ns"]
        elif kind == "flags" and m["holder"]:
            grant = Grant(m["holder"], m["cycle"], m["tick_received_ns"], m["published_ns"])
            self.grants.setdefault((m["switcher"], m["grant"]), grant)
        elif kind == "telecommand":
            self.telecommands.setdefault(m["id"], (m["target"], m["at_ns"]))
        elif kind == "report" and m["stage"] == COMPLETED and m["success"]:
            self.completed.setdefault(m["id"], m["at_ns"])

    def intervals(self, begin, end):
        """What every payload did from begin to end, in order of time; off before its first message."""
        found = []
        for payload in self.payloads:
            at, state = begin, OFF
            for since, who, new in sorted(list(self.changes)):
                if who != payload or since >= end:
                    continue
                if since > at:
                    found.append(Interval(payload, state, at, since))
                at, state = max(since, begin), new
            found.append(Interval(payload, state, at, end))
        return sorted(found, key=lambda i: (i.begin, i.payload))

    def heartbeats(self, begin, end):
        """{cycle: when it was due}, in order of time."""
        return {cycle: t for cycle, t in sorted(list(self.due.items()), key=lambda tick: tick[1]) if begin <= t < end}

    def switches(self, begin, end):
        """Each slot with its heartbeat, from what the switcher says of its grants and timing of its heartbeats. Each grant gives one slot."""
        due = self.heartbeats(0, end)
        period = period_of(due)
        grants = [grant for _, grant in sorted(list(self.grants.items()))]
        found, used = [], set()
        for slot in of_state(self.intervals(begin, end), OCCUPYING):
            places = [k for k, grant in enumerate(grants) if grant.payload == slot.payload and grant.published <= slot.begin]
            if not places or places[-1] in used:
                found.append(Switch(slot))
                continue
            used.add(places[-1])
            grant = grants[places[-1]]
            before = grants[places[-1] - 1].cycle if places[-1] else -1
            found.append(Switch(slot, *heartbeat_of(grant.cycle, grant.caused, before, due, period)))
        return found


# --- what the paper says ---------------------------------------------------------------------------------------------


def of_state(intervals, state, payload=None):
    return [i for i in intervals if i.state == state and payload in (None, i.payload)]


def starts_off(intervals, payloads):
    """"Initially, all payload nodes are in the off state."""
    first = {p: next(i for i in intervals if i.payload == p) for p in payloads}
    return check(all(i.state == OFF for i in first.values()), "all payloads are off at the beginning")


def one_on_the_bus(intervals):
    slots = of_state(intervals, OCCUPYING)
    shared = sum(a.overlap(b) for k, a in enumerate(slots) for b in slots[k + 1 :])
    return check(shared == 0 and slots, f"at most one payload occupies the CAN bus at any time ({len(slots)} slots)")


def in_rotation(intervals, payloads):
    order = [i.payload for i in of_state(intervals, OCCUPYING)]
    wrong = sum(payloads[(payloads.index(a) + 1) % len(payloads)] != b for a, b in zip(order, order[1:]))
    return check(wrong == 0 and len(order) > len(payloads), f"the bus rotates in the configured order, {wrong} of {max(0, len(order) - 1)} switches do not")


def processing_follows(intervals, end):
    """"After finishing their use of the CAN bus, they automatically move to the data processing state."""
    wrong = judged = 0
    for slot in of_state(intervals, OCCUPYING):
        if slot.end >= end:
            continue
        judged += 1
        following = next((i for i in intervals if i.payload == slot.payload and i.begin == slot.end), None)
        wrong += following is None or following.state != PROCESSING
    return check(judged and wrong == 0, f"data processing follows every use of the bus, {wrong} of {judged} without")


def is_at_the_next_heartbeat(before, switch, heartbeats, bound_ns):
    """bound_ns: so near each other the switcher may hear a release and a heartbeat in the other order."""
    if switch.cycle is None or before.cycle is not None and switch.cycle <= before.cycle:
        return False
    passed_over = any(t > before.slot.end + bound_ns and cycle < switch.cycle for cycle, t in heartbeats.items())
    came_before_the_release = switch.due < before.slot.end - bound_ns
    return not passed_over and not came_before_the_release and switch.slot.begin >= switch.due - AHEAD_NS


def switched_at_the_next_heartbeat(switches, heartbeats):
    """"... to the next node at the next heartbeat after each payload node completes its use of the bus."

    Which heartbeat it was is judged here, and not how late the switch came. On a busy machine the switcher may hear a release and a
    heartbeat in the other order now and then: RELEASE_BOUND_NS excuses it for a quarter of the switches at most.
    """
    pairs = list(zip(switches, switches[1:]))
    exactly, nearly = (sum(is_at_the_next_heartbeat(*pair, heartbeats, bound_ns) for pair in pairs) for bound_ns in (0, RELEASE_BOUND_NS))
    right = nearly if 4 * (nearly - exactly) <= len(pairs) else exactly
    wrong = len(pairs) - right + (bool(switches) and switches[0].cycle is None)
    return check(switches[1:] and wrong == 0, f"every switch comes at the first heartbeat after the release, {wrong} of {len(switches)} do not")


def delays(switches):
    """From each heartbeat to the slot given at it, in ns."""
    return [s.slot.begin - s.due for s in switches if s.due is not None]


def switched_soon(switches):
    found = delays(switches)
    late = sum(delay > LATE_NS for delay in found)
    medians = [percentile(delays([s for s in switches if s.slot.payload == payload]), 0.5) for payload in {s.slot.payload for s in switches}]
    return [
        check(found and max(median or 0 for median in medians) <= SWITCH_BOUND_NS,
              f"half of the switches to each payload come within {SWITCH_BOUND_NS // MS} ms of their heartbeat"),
        check(found and late == 0, f"every switch comes within {LATE_NS // MS} ms of its heartbeat, {late} of {len(found)} come later than that"),
    ]


def blocked_heartbeats(switches, heartbeats):
    """[(switch, heartbeats that came while its payload had the bus)] without the one that gave it."""
    found = []
    for switch in switches:
        slot = switch.slot
        inside = [t for cycle, t in heartbeats.items() if slot.begin < t < slot.end and cycle != switch.cycle]
        if inside:
            found.append((switch, inside))
    return found


def no_async(intervals, payloads, except_for=()):
    others = [i for i in of_state(intervals, ASYNC) if i.payload not in except_for]
    who = "no payload" if not except_for else "no other payload"
    return check(not others, f"{who} is in the state 'other async commands' ({len(others)} times)")


def common(intervals, switches, heartbeats, payloads, end):
    return [
        starts_off(intervals, payloads),
        one_on_the_bus(intervals),
        in_rotation(intervals, payloads),
        processing_follows(intervals, end),
        switched_at_the_next_heartbeat(switches, heartbeats),
        *switched_soon(switches),
    ]


def fig14a(intervals, switches, heartbeats, payloads, end):
    """Normal."""
    blocked = blocked_heartbeats(switches, heartbeats)
    return [
        *common(intervals, switches, heartbeats, payloads, end),
        check(not blocked, f"every use of the bus ends before the next heartbeat, {len(blocked)} do not"),
        no_async(intervals, payloads),
    ]


def fig14b(intervals, switches, heartbeats, payloads, end, slow):
    """CAN bus blocked: one payload uses the bus for longer than anticipated."""
    blocked = [switch for switch, _ in blocked_heartbeats(switches, heartbeats)]
    own = [s for s in blocked if s.slot.payload == slow]
    others = [s for s in blocked if s not in own and (s.due is None or s.slot.begin - s.due <= SWITCH_BOUND_NS)]
    return [
        *common(intervals, switches, heartbeats, payloads, end),
        check(own, f"{slow} has the bus over a heartbeat ({len(own)} times)"),
        check(not others, f"only {slow} blocks the switch, but for slots that began late: {len(others)} others"),
        no_async(intervals, payloads),
    ]


def fig14c(intervals, switches, heartbeats, payloads, end):
    """Processing of one payload goes on while the next has the bus."""
    slots = of_state(intervals, OCCUPYING)
    processing = of_state(intervals, PROCESSING)
    parallel = judged = 0
    for before, slot in zip(slots, slots[1:]):
        judged += 1
        parallel += any(p.payload == before.payload and p.overlap(slot) > 0 for p in processing)
    return [
        *common(intervals, switches, heartbeats, payloads, end),
        check(judged and parallel == judged, f"processing of a payload continues while the next one has the bus: {parallel} of {judged} slots"),
        no_async(intervals, payloads),
    ]


def fig14d(intervals, switches, heartbeats, payloads, end, target, telecommands, completed, frames):
    """A telecommand: a pulse on its payload when it comes, execution in the payload's next slot.

    telecommands {id: (target, heard)}, completed {id: heard}, frames {id: when its frame was on the bus}
    """
    ours = {number: at for number, (who, at) in telecommands.items() if who == target}
    pulses = of_state(intervals, ASYNC, target)
    slots = of_state(intervals, OCCUPYING, target)
    results = [
        *common(intervals, switches, heartbeats, payloads, end),
        check(ours and len(telecommands) == len(ours), f"{len(ours)} telecommands went to {target}, none to another payload"),
        no_async(intervals, payloads, except_for=(target,)),
        check(pulses and all(p.end - p.begin <= PULSE_BOUND_NS for p in pulses), f"{target} shows 'other async commands' as a brief pulse ({len(pulses)})"),
    ]
    for number, at in ours.items():
        near = [p for p in pulses if p.end >= at - PULSE_BOUND_NS and p.begin <= at + PULSE_BOUND_NS]
        following = next((s for s in slots if s.begin > at), None)
        frame = frames.get(number)
        results.append(check(near, f"telecommand {number:x}: its payload shows the pulse when it comes"))
        results.append(check(following and frame and following.begin <= frame <= following.end, f"telecommand {number:x}: its frame is in the payload's next slot"))
        results.append(check(following and completed.get(number, 0) > following.begin, f"telecommand {number:x}: completed"))
    return results


# --- figures ---------------------------------------------------------------------------------------------------------


def next_tick_period_ms(least_ms):
    """The shortest tick period of at least so much that timing accepts: it divides the second or is whole seconds."""
    divisors = [p for p in range(1, 1001) if 1000 % p == 0 and p >= least_ms]
    return divisors[0] if divisors else -(-int(-(-least_ms // 1)) // 1000) * 1000


def use_of_the_bus(intervals, heartbeats, begin, end):
    """Slots a second and bus utilisation as they were, and as they would be if a payload kept the bus until its data were processed.

    Durations are means of the intervals that lie whole in begin to end.
    """
    slots = of_state(intervals, OCCUPYING)
    processing = of_state(intervals, PROCESSING)
    whole_slots = [i.end - i.begin for i in slots if begin < i.begin and i.end < end]
    whole_processing = [i.end - i.begin for i in processing if begin < i.begin and i.end < end]
    slot = sum(whole_slots) / len(whole_slots) if whole_slots else 0
    work = slot + (sum(whole_processing) / len(whole_processing) if whole_processing else 0)
    span = slots[-1].begin - slots[0].begin if len(slots) > 1 else 0
    period = period_of(heartbeats)
    sequential = -(-work // period) * period if period else 0  # heartbeats a slot, rounded up: the bus is switched at heartbeats only
    return {
        "slots": len(slots),
        "slots_per_s": round((len(slots) - 1) / span * 1e9, 3) if span else None,
        "slots_per_s_sequential": round(1e9 / sequential, 3) if sequential else None,
        "bus_utilisation": round(sum(s.end - s.begin for s in slots) / (end - begin), 4),
        "bus_utilisation_sequential": round(slot / sequential, 4) if sequential else None,
        "slot_ms": round(slot / MS, 3),
        "processing_ms": round((work - slot) / MS, 3),
        "processing_beside_the_bus_ms": round(sum(p.overlap(s) for p in processing for s in slots) / MS, 1),
    }


def longest_work(intervals):
    """Of a slot with its processing, in ns: what would have to fit between two heartbeats."""
    def longest(state):
        return max((i.end - i.begin for i in of_state(intervals, state)), default=0)

    return longest(OCCUPYING) + longest(PROCESSING)


def parallelism(as_run, sequential):
    """How much more of the bus is used than by strictly sequential work; both as use_of_the_bus gives them."""
    both = as_run["slots_per_s"] and sequential["slots_per_s"]
    return round(as_run["slots_per_s"] / sequential["slots_per_s"], 2) if both else None
