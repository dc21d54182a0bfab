# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The transmitter switched off by telecommand: silence for the commanded time even if a node is killed, and no longer."""

import unittest

from support import DEADLINE_S, SystemTest, kill

from srfs.flight.processes import wait_until

SILENCE_S = 12
USUAL_GAP_S = 3  # longest gap between packets while the spacecraft transmits, with margin for a busy machine


class TransmitterTest(SystemTest):
    def silences(self, ground, since):
        """Gaps without telemetry, in s, that are longer than usual."""
        times = [m["arrived"] for m in ground.select(lambda m: m["type"] in ("housekeeping", "event"), since)]
        return [b - a for a, b in zip(times, times[1:]) if b - a > USUAL_GAP_S]

    def test_it_is_off_for_the_time_that_was_commanded_though_ttc_is_killed_and_telecommands_switch_it_on(self):
        with self.flight() as flight:
            ground = flight.ground()
            off = f"ttc.transmitter_off duration_s={SILENCE_S}"
            refused = ground.command(f"tc {off}", DEADLINE_S)
            self.assertEqual(refused.get("name"), "not_armed", refused)
            self.complete(ground, f"arm {off}")
            since = ground.position()
            self.complete(ground, f"tc {off}")
            ended = ground.position()
            wait_until(lambda: "off for" in self.log_of(flight, "ttc"), DEADLINE_S, "ttc says that it is off")
            kill(flight, "ttc")
            on = ground.wait_for(lambda m: m["type"] == "event" and m["event"] == "ttc.transmitter_on", SILENCE_S + 3 * DEADLINE_S, ended)
            self.assertIsNotNone(on, "it comes back by itself")
            self.assertEqual(on["fields"]["why"], "its time is over")
            self.assertGreater(max(self.silences(ground, since), default=0), SILENCE_S - 4, "it was silent")

            # Blind commanding: nothing comes down, but telecommands go up.
            off = "ttc.transmitter_off duration_s=86400"
            self.complete(ground, f"arm {off}")
            self.complete(ground, f"tc {off}")
            since = ground.position()
            ground.send("tc ttc.transmitter_on --timeout 60")
            on = ground.wait_for(lambda m: m["type"] == "event" and m["event"] == "ttc.transmitter_on", DEADLINE_S, since)
            self.assertIsNotNone(on, "switched on by command")
            self.assertEqual(on["fields"]["why"], "commanded")
            self.complete(ground, "ping")

    def log_of(self, flight, node):
        return "".join(file.read_text(errors="replace") for file in (flight.var / "log").glob(f"{node}*"))


if __name__ == "__main__":
    unittest.main()
