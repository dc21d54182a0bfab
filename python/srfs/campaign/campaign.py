# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""What the campaigns share: a mission under telecommands, the record of what it did, and the faults of its processes."""

import random
import time

from srfs.campaign.executions import Executions
from srfs.flight.deployments import PAYLOADS
from srfs.report import write_messages

KEPT = {"flags", "bus", "telecommand", "report", "peripheral_reset"}  # message types of `srfs record` that are kept
TELECOMMANDS = {  # by_id: each is executed once
    "payload_adcs": ("adcs.set_target_quaternion x=0 y=0 z=0 w=1", "adcs.set_mode mode=point"),
    "payload_eps": ("eps.set_charge_limit limit=0.9", "eps.switch_load load=2 state=on"),
    "payload_thermal": ("thermal.set_setpoint heater=0 setpoint_k=291", "thermal.set_setpoint heater=1 setpoint_k=289"),
}
MOST_UNDER_WAY = 3  # telecommands per payload
FORGET_S = 20  # after this time, a telecommand without a final stage no longer counts as under way


class Campaign:
    def __init__(self, flight, signals, seed, say):
        self.flight, self.signals, self.say = flight, signals, say
        self.random = random.Random(seed)
        self.messages = []
        self.executions = Executions(flight.run_dir)
        self._ends = {}  # line of the ground's session -> whether its last stage was the final one
        self._under_way = {payload: {} for payload in PAYLOADS}

    def listen(self):
        self.flight.recorder().on_message(self.on_record)
        self._ground = self.flight.ground()
        self._ground.on_message(self.on_downlink)

    def on_record(self, message):
        if message["type"] in KEPT:
            self.messages.append(message)

    def on_downlink(self, message):
        if message["type"] == "tc_stage" and (message["final"] or not message.get("late")):  # a late end counts, not what comes before it
            self.messages.append({"at_ns": time.monotonic_ns(), **message})
            self._ends[message["line"]] = message["final"]
        if message["type"] == "error" or (message["type"] == "tc_stage" and message["final"]):
            for under_way in self._under_way.values():
                under_way.pop(message.get("line"), None)

    def telecommand(self, payload):
        """The next telecommand for a payload."""
        return self.random.choice(TELECOMMANDS[payload])

    def send_telecommand(self, payload):
        """One more, unless MOST_UNDER_WAY are."""
        now, under_way = time.monotonic(), self._under_way[payload]
        for line in [line for line, sent in list(under_way.items()) if now - sent > FORGET_S]:
            under_way.pop(line, None)
        if len(under_way) < MOST_UNDER_WAY:
            under_way[self._ground.send(f"tc {self.telecommand(payload)}")] = now

    def all_ended(self):
        """Whether every telecommand that was sent has its final stage, also those of which nothing came yet."""
        ends = self._ends.copy()
        sent = [line for under_way in self._under_way.values() for line in list(under_way)]
        return all(ends.values()) and all(ends.get(line) for line in sent)

    def write_record(self, folder):
        write_messages(folder / "record.jsonl", self.messages)
