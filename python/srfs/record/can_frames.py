# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Which telecommand was on the CAN bus when: read from the simulated bus' own record, judged against the slots. Pure.

The record (simulation.can_log, `candump -L` format) holds every frame with the CLOCK_MONOTONIC time of its end on the bus. A
command's request is an ISO-TP message whose first frame carries the low 32 bits of the telecommand's id
(docs/reference/icd_can.md, sections 2 and 3).
"""

import bisect
import re
from typing import NamedTuple

# A telecommand read this long before a slot begins must run in that slot: the bound for its acceptance on board.
ACCEPTANCE_NS = 20_000_000

PAYLOAD_OF_ADDRESS = {"11": "payload_adcs", "12": "payload_eps", "13": "payload_thermal"}
# computer 01 -> peripheral
COMPUTER_FRAME = re.compile(r"^\((\d+)\.(\d{6})\) \S+ 18DA(11|12|13)01#(.*)$")
COMMAND = re.compile(r"1[0-9A-F]{3}02[0-9A-F]{2}([0-9A-F]{8})$")  # first frame "1LLL", opcode 02, sequence, id (4 octets)
ANY_FRAME = re.compile(r"^\((\d+)\.(\d{6})\) ")


def _ns(match):
    return int(match[1]) * 1_000_000_000 + int(match[2]) * 1000


class Frame(NamedTuple):
    at: int  # end of the frame on the bus, in ns
    payload: str  # payload addressed by the computer; its process sent the frame
    data: str

    @property
    def is_reset(self):
        return len(self.data) >= 4 and self.data[0] == "0" and self.data[2:4] == "03"


def computer_frames(lines):
    """The frames that payload nodes sent, in order."""
    matches = filter(None, (COMPUTER_FRAME.match(line.rstrip()) for line in lines))
    return [Frame(_ns(match), PAYLOAD_OF_ADDRESS[match[3]], match[4]) for match in matches]


def command_frames(lines):
    """{(payload, low 32 bits of the id): [times in ns]} of the commands that were on the bus; repeats in order."""
    found = {}
    for frame in computer_frames(lines):
        if command := COMMAND.match(frame.data):
            found.setdefault((frame.payload, int(command[1], 16)), []).append(frame.at)
    return found


def judge_slots(frames, slots, clock_error_ns=0):
    """Whose slot each of the computer's frames was in: (frames in the sender's own slot, [what is wrong]).

    frames  as computer_frames gives them, on the clock of the slots
    slots   in order: [{holder, published, lease_end, released or None}]; frames before the first or behind the last are not judged

    A slot is over with its release; without one, at the end of its lease. A holder of None is a time without a record: not judged.
    """
    starts = [slot["published"] for slot in slots]
    good, wrong = 0, []
    for at, payload, *_ in frames:
        place = bisect.bisect_right(starts, at + clock_error_ns) - 1
        if place < 0 or place + 1 == len(slots) or slots[place]["holder"] is None:
            continue
        slot = slots[place]
        end = slot["lease_end"] if slot["released"] is None else slot["released"]
        if slot["holder"] != payload:
            wrong.append(f"a frame of {payload} at {at} ns in the slot of {slot['holder']}")
        elif at > end + clock_error_ns:
            wrong.append(f"a frame of {payload} at {at} ns, {(at - end) / 1e6:.3f} ms behind the end of its slot")
        else:
            good += 1
    return good, wrong


def last_time(lines):
    """Time of the last frame in ns, None without frames."""
    return max((_ns(match) for match in map(ANY_FRAME.match, lines) if match), default=None)


def next_slot_fact(sent_ns, payload, telecommands, slots, frames):
    """Whether the frame of one telecommand came in time: {payload, frame_after_ms, in_next_slot, why}.

    sent_ns       when its octets were about to be written to the operator's end of the line
    telecommands  {id: {target, at}} as published on /telecommand
    slots         the payload's slots in order: [{published, lease_end}]
    frames        as command_frames gives them
    """
    fact = {"payload": payload, "frame_after_ms": None, "in_next_slot": False, "why": "never published to the nodes"}
    published = [(t["at"], number) for number, t in telecommands.items() if t["target"] == payload and t["at"] >= sent_ns]
    if not published:
        return fact
    times = frames.get((payload, min(published)[1] & 0xFFFFFFFF))
    if not times:
        return fact | {"why": "no frame of it on the bus"}
    fact["frame_after_ms"] = (times[0] - sent_ns) / 1e6
    starts = [slot["published"] for slot in slots]
    running = bisect.bisect_right(starts, times[0]) - 1
    if running < 0 or times[0] > slots[running]["lease_end"]:
        return fact | {"why": "its frame was outside the payload's slots"}
    following = bisect.bisect_right(starts, sent_ns + ACCEPTANCE_NS)
    if running > following:
        return fact | {"why": f"{running - following} slots late"}
    return fact | {"in_next_slot": True, "why": ""}
