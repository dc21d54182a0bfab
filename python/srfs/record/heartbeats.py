# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Which heartbeat of timing a grant of the CAN bus was made at. Pure; all times are CLOCK_MONOTONIC in ns.

The switcher makes a heartbeat itself when timing's does not come in time. Its grant then has the number of the heartbeat before, and the one
that comes too late gives no grant.
"""

from srfs.report import percentile

SUBSTITUTE_PERIODS = 1.2  # behind the last heartbeat; the switcher makes one itself after 1.25 or more (nodes/can_switcher/tick_holdover.cpp)
AHEAD_NS = 10_000_000  # of a heartbeat that is due: timing's slew, the phase of one that the switcher makes itself


def period_of(due):
    """Median distance of two heartbeats in a row, of {cycle: when it was due}, in ns; 0 where there are none."""
    return int(percentile([at - due[cycle - 1] for cycle, at in due.items() if cycle - 1 in due], 0.5) or 0)


def heartbeat_of(cycle, caused, cycle_before, due, period):
    """(number, when it was due) of the heartbeat of a grant that names this cycle, was caused at this time and follows one that named
    cycle_before; (None, None): it was made at none, but at the release of an unused slot, or the heartbeat was not recorded."""
    if cycle not in due:
        return None, None
    waited = caused - due[cycle]
    if period and waited >= SUBSTITUTE_PERIODS * period:
        behind = (waited + min(AHEAD_NS, period // 10)) // period
        return cycle + behind, due.get(cycle + behind, due[cycle] + behind * period)
    return (cycle, due[cycle]) if cycle > cycle_before and waited >= -AHEAD_NS else (None, None)
