# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Which heartbeat of timing a grant of the CAN bus was made at. Pure; all times are CLOCK_MONOTONIC in ns.

The switcher makes a heartbeat itself when timing's does not come in time. Its grant then has the number of the heartbeat before, and the one
that comes too late gives no grant.
"""

from srfs.report import percentile

SUBSTITUTE_PERIODS = 1.2  # behind the last heartbeat; the switcher makes one itself after 1.25 (nodes/can_switcher/tick_holdover.hpp)
AHEAD_NS = 10_000_000  # of a heartbeat that is due: timing's slew, the phase of one that the switcher makes itself


def period_of(due):
    """Median distance of heartbeats ({cycle: when it was due}, in order of time) in ns, 0 with fewer than two."""
    times = list(due.values())
    return int(percentile([b - a for a, b in zip(times, times[1:])], 0.5) or 0)


def heartbeat_of(cycle, caused, cycle_before, due, period):
    """(number, when it was due) of the heartbeat of a grant that names this cycle, was caused at this time and follows one that named
    cycle_before; (None, None): it was made at none, but at the release of an unused slot."""
    if cycle not in due:
        return None, None
    waited = caused - due[cycle]
    if period and waited >= SUBSTITUTE_PERIODS * period:
        behind = int((waited + AHEAD_NS) // period)
        return cycle + behind, due.get(cycle + behind, due[cycle] + behind * period)
    return (cycle, due[cycle]) if cycle > cycle_before and waited >= -AHEAD_NS else (None, None)
