# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""What `srfs record` saw of the CAN rotation and of telecommands, checked. Pure: messages in, facts out.

Messages may come in another thread than the one that asks for facts: facts are taken from copies (list() of a dict is one
step under the interpreter lock).
"""

from srfs.record.heartbeats import heartbeat_of, period_of


class Rotation:
    """Collects ticks, task flags, bus status, telecommands and reports. All times are CLOCK_MONOTONIC in ns."""

    def __init__(self):
        self.ticks = {}  # cycle -> time of receipt
        self.due = {}  # cycle -> when this tick was due
        self.grants = {}  # (switcher incarnation, grant counter) -> dict
        self.flag_latencies_us = []  # tick published -> flag received, both as the recorder sees them
        self.several_flags = 0  # messages with more than one flag true
        self.lost_statuses = []  # (when, messages) on /BUS/bus_status for which the recorder was too slow
        self.telecommands = {}  # id -> dict of target, at, {stage: time}
        self.last_slot = None
        self._tick_published = {}
        self._early_ends = {}  # ends of slots whose flag was not heard yet: topics do not keep each other's order

    def on_message(self, message):
        handler = getattr(self, "_on_" + message["type"], None)
        if handler:
            handler(message)

    def _on_tick(self, m):
        self.ticks.setdefault(m["cycle"], m["at_ns"])
        self.due.setdefault(m["cycle"], m["due_ns"])
        self._tick_published[m["cycle"]] = m["published_ns"]

    def _on_flags(self, m):
        if sum(1 for flag in m["flags"] if flag) > 1:
            self.several_flags += 1
        key = (m["switcher"], m["grant"])
        if not m["holder"] or key in self.grants:
            return
        self.grants[key] = {"holder": m["holder"], "cycle": m["cycle"], "caused": m["tick_received_ns"], "published": m["published_ns"], "lease_end": m["lease_end_ns"],
                            "status": None, "released": None, "used_us": None}  # fmt: skip
        self.grants[key].update(self._early_ends.pop(key, {}))
        if m["cycle"] in self._tick_published:
            self.flag_latencies_us.append((m["at_ns"] - self._tick_published[m["cycle"]]) / 1000)

    def _on_bus(self, m):
        if m["status"] not in ("released", "failed"):
            return
        key = (m["switcher"], m["grant"])
        # A payload that is not active, or not up yet, hands the slot back at once.
        status = "not used" if m["detail"] in ("inactive", "starting", "nothing to say") else m["status"]
        end = {"status": status, "released": m["said_ns"], "used_us": m["used_us"]}
        known = self.grants.get(key) or self._early_ends.get(key)
        if known and known["released"] is not None and known["released"] <= m["said_ns"]:
            return  # said again, to a recall that crossed it
        if key not in self.grants:
            self._early_ends[key] = end
            return
        self.grants[key].update(end)
        self.last_slot = self.grants[key]

    def _on_lost(self, m):
        if m["topic"].endswith("/bus_status"):
            self.lost_statuses.append((m["at_ns"], m["messages"]))

    def _on_telecommand(self, m):
        self.telecommands.setdefault(m["id"], {"target": m["target"], "at": m["at_ns"], "stages": {}})

    def _on_report(self, m):
        telecommand = self.telecommands.get(m["id"])
        if telecommand is not None:
            telecommand["stages"].setdefault(m["stage"], m["at_ns"])

    # --- facts ------------------------------------------------------------------------------------------------------

    def _ordered(self):
        """Grants in order, from the first whose end was recorded: an observer hears the topics one after the other."""
        ordered = [grant for _, grant in sorted(list(self.grants.items()), key=lambda item: item[0])]
        settled = next((i for i, grant in enumerate(ordered) if grant["released"] is not None), len(ordered))
        return ordered[settled:]

    def slots(self):
        """{payload: {granted, used, failed}} of what was recorded; a slot under way counts as granted."""
        counts = {}
        for grant in self._ordered():
            count = counts.setdefault(grant["holder"], {"granted": 0, "used": 0, "failed": 0})
            count["granted"] += 1
            count["used"] += grant["status"] == "released"
            count["failed"] += grant["status"] == "failed"
        return counts

    def failed_slots(self, payload):
        """Its slots that were over before the last recorded one of anybody and were neither used nor handed back."""
        ordered = self._ordered()
        return [grant for grant in ordered[:-1] if grant["holder"] == payload and grant["status"] not in ("released", "not used")]

    def overlaps(self, until=None):
        """Grants given while the holder before had neither released nor lost its lease. until: of those before this time alone.

        An end that was not recorded is no overlap if the recorder lost a message after the grant, one for each such end (undecided()). It knows
        of a loss with the next message of the same payload."""
        early, excused = self._early_grants(until)
        return self.several_flags + len(early) - excused

    def undecided(self):
        """Grants of which the recorder lost the end: only the frames on the bus show whether they overlap the next one."""
        return self._early_grants(None)[1]

    def _early_grants(self, until):
        """(grants whose end was not recorded before the next one, how many of these are excused)"""
        ordered = [grant for grant in self._ordered() if until is None or grant["published"] < until]
        early = [before for before, after in zip(ordered, ordered[1:]) if after["published"] < min(before["lease_end"], before["released"] or before["lease_end"])]
        waiting = [grant["published"] for grant in early if grant["released"] is None]
        missing = len(waiting)
        for at, messages in list(self.lost_statuses):
            covered = [published for published in waiting if published < at][:messages]
            waiting = waiting[len(covered):]
        return early, missing - len(waiting)

    def skipped(self):
        """(with cause, without): recorded ticks without a grant, the cause being a bus that was still held."""
        without = len(self.skips())
        return len(self._ticks_without_grant()) - without, without

    def skips(self):
        """Times of the recorded ticks without a grant and without cause."""
        ordered = self._ordered()
        return [at for at in self._ticks_without_grant()
                if not any(g["published"] < at and (g["released"] is None or g["released"] > at) and g["lease_end"] > at for g in ordered)]  # fmt: skip

    def _ticks_without_grant(self):
        ordered = self._ordered()
        granted = {grant["cycle"] for grant in ordered} | set(self._late_ticks(ordered))
        if not granted:
            return []
        return [at for cycle, at in list(self.ticks.items()) if min(granted) < cycle < max(granted) and cycle not in granted]

    def _late_ticks(self, ordered):
        """Ticks in whose place the switcher gave the bus at one of its own, as they did not come in time."""
        due = dict(sorted(list(self.due.items()), key=lambda tick: tick[1]))
        period = period_of(due)
        for grant in ordered:
            cycle, _ = heartbeat_of(grant["cycle"], grant["caused"], grant["cycle"] - 1, due, period)
            if cycle not in (None, grant["cycle"]):
                yield cycle

    def published_ticks(self):
        """{cycle: time published}."""
        return dict(list(self._tick_published.items()))

    def missed_ticks(self):
        """Gaps in the recorded cycle numbers."""
        return max(self.ticks) - min(self.ticks) + 1 - len(self.ticks) if self.ticks else 0

    def recorded_slots(self):
        """All slots in order; behind one whose successor was not recorded, a time with holder None."""
        slots, before = [], None
        for key, grant in sorted(list(self.grants.items()), key=lambda item: item[0]):
            if before and key != (before[0], before[1] + 1):
                last = slots[-1]
                over = last["lease_end"] if last["released"] is None else last["released"]
                slots.append({"holder": None, "published": over + 1})
            slots.append(grant)
            before = key
        return slots

    def slots_of(self, payload):
        """Its slots in order: [{published, lease_end, ...}]."""
        return [grant for grant in self._ordered() if grant["holder"] == payload]
