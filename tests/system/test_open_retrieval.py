# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Packet stores controlled by the ground (PUS 15): open retrieval over a restart, disabled and bounded stores, their reports."""

import unittest

from support import DEADLINE_S, SystemTest, kill

from srfs.flight.processes import wait_until


class OpenRetrievalTest(SystemTest):
    def test_new_events_go_down_by_themselves_also_after_ttc_was_killed_until_it_is_suspended(self):
        with self.flight() as flight:
            ground = flight.ground()
            since = ground.position()
            self.complete(ground, "tc storage.resume_open store=events")
            started = ground.wait_for(
                lambda m: m["type"] == "event" and m["event"] == "node.started" and m.get("vc") == 1, DEADLINE_S, since
            )
            self.assertIsNotNone(started, "what was stored before comes first")

            since = ground.position()
            kill(flight, "ttc")
            again = ground.wait_for(
                lambda m: m["type"] == "event" and m["event"] == "node.started" and m["apid"] == 1 and m.get("vc") == 1,
                3 * DEADLINE_S,
                since,
            )
            self.assertIsNotNone(again, "its own start is stored, and sent because open retrieval goes on")

            self.complete(ground, "tc storage.suspend_open store=events")
            since = ground.position()
            self.complete(ground, "tc storage.status")
            status = self.report(ground, "packet_store_status", "events", since)
            self.assertEqual((status["open_retrieval"], status["storage"], status["type"]), ("suspended", "enabled", "circular"))

    def test_a_disabled_store_takes_nothing_and_says_how_much_it_refused(self):
        with self.flight() as flight:
            ground = flight.ground()
            self.complete(ground, "tc storage.disable store=verification")
            self.complete(ground, "tc storage.make_bounded store=housekeeping")
            self.complete(ground, "ping")
            since = ground.position()
            self.complete(ground, "tc storage.status")
            status = self.report(ground, "packet_store_status", "verification", since)
            self.assertEqual(status["storage"], "disabled")
            self.assertGreater(status["refused"], 0)
            self.assertEqual(self.report(ground, "packet_store_status", "housekeeping", since)["type"], "bounded")

            summary = wait_until(lambda: self.summary_of_events(ground), DEADLINE_S, "the events of the start are committed, once a second")
            self.assertLessEqual(summary["oldest"], summary["newest"])

    def summary_of_events(self, ground):
        """The summary of the store of events; None while the store is empty."""
        since = ground.position()
        self.complete(ground, "tc storage.summary store=events")
        summary = self.report(ground, "packet_store_summary", "events", since)
        self.assertEqual(summary["oldest"] is None, summary["newest"] is None)
        return summary if summary["oldest"] else None

    def report(self, ground, structure, store, since):
        message = ground.wait_for(
            lambda m: m.get("structure") == structure and m["fields"]["store"] == store, DEADLINE_S, since
        )
        self.assertIsNotNone(message, f"{structure} of {store}")
        return message["fields"]


if __name__ == "__main__":
    unittest.main()
