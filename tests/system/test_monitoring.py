# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""On-board monitoring (PUS 12) and event-action (PUS 19): a limit is crossed, reported, and its action runs, also when ttc is killed meanwhile."""

import collections
import random
import threading
import unittest

from support import DEADLINE_S, SystemTest, kill, wait_for_slots, wait_for_ttc

from srfs.flight.processes import wait_until

WATCHED = "parameter=payload_eps.load_switches check=expected low=0"
LOAD = 3
TURNS = 4
START, COMPLETION = 3, 7  # stages


class MonitoringTest(SystemTest):
    def define(self, ground, number, request):
        """A monitor of the load switches and an action on its event."""
        event = f"monitor.user_{number}"
        self.complete(ground, f"tc monitor.add id={300 + number} {WATCHED} low_event={event} repetition=1")
        self.complete(ground, f'tc event_action.add event={event} "request={request}"')
        self.complete(ground, f"tc event_action.enable event={event}")

    def begin(self, flight):
        recorder, ground = flight.recorder(), flight.ground()
        wait_for_slots(recorder, "payload_eps", "released", 2, 0)
        for load in range(4):
            self.complete(ground, f"tc eps.switch_load load={load} state=off")
        return recorder, ground

    def judge_delays(self, recorder, since, action):
        """In slots of the payload: from the end of the order that crosses the limit to the release, and from there to the action's start."""
        messages = recorder.select(lambda m: m["type"] in ("telecommand", "report") or m["type"] == "bus" and m["payload"] == "payload_eps"
                                   and m["status"] == "released", since)
        crossing = next(m["id"] for m in messages if m["type"] == "telecommand")

        def first(kind, number, stage=None):
            return next(i for i, m in enumerate(messages) if m["type"] == kind and m["id"] == number and stage in (None, m.get("stage")))

        marks = first("report", crossing, COMPLETION), first("telecommand", action), first("report", action, START)
        to_release, to_start = (sum(m["type"] == "bus" for m in messages[a:b]) for a, b in zip(marks, marks[1:]))
        print(f"slots of payload_eps: {to_release} from the crossing to the release, {to_start} to the start of the action")
        self.assertLessEqual(to_release, 2)
        self.assertLessEqual(to_start, 2)

    def executed(self, flight):
        return flight.control({"query": "executed"})["executed"]["eps"]

    def test_a_value_out_of_its_limits_is_reported_and_its_action_runs(self):
        with self.flight() as flight:
            recorder, ground = self.begin(flight)
            self.define(ground, 1, f"eps.switch_load load={LOAD} state=off")
            since = ground.position()
            self.complete(ground, "tc monitor.enable id=301")
            ordered = recorder.position()
            self.complete(ground, f"tc eps.switch_load load={LOAD} state=on")

            def transition(state):
                return ground.wait_for(lambda m: m.get("structure") == "monitor_transition" and m["fields"]["definition"] == 301
                                       and m["fields"]["state"] == state, DEADLINE_S, since)

            out = transition("unexpected")
            self.assertIsNotNone(out, "12,12")
            self.assertEqual((out["fields"]["parameter"], out["fields"]["value"]), ("payload_eps.load_switches", 1 << LOAD))
            self.wait_for_event(ground, "monitor.user_1", since)
            released = self.wait_for_event(ground, "event_action.released", since)
            self.assertEqual((released["fields"]["event"], released["fields"]["command"]), ("monitor.user_1", "eps.switch_load"))
            self.assertIsNotNone(transition("within"), "the action switched the load off")
            self.judge_delays(recorder, ordered, released["fields"]["telecommand"])
            status = ground.position()
            self.complete(ground, "tc event_action.report_status")
            known = {m["fields"]["event"]: m["fields"] for m in ground.select(lambda m: m.get("structure") == "event_action_status", status)}
            self.assertEqual((known["monitor.user_1"]["status"], known["monitor.user_1"]["released"]), ("enabled", 1))
            self.assertEqual(known["monitor.battery_empty"]["status"], "enabled")

            # What was changed outlives the process; what is out of limits now is found again.
            kill(flight, "ttc")
            wait_for_ttc(ground)
            again = ground.position()
            self.complete(ground, "tc monitor.report id=301")
            report = ground.wait_for(lambda m: m.get("structure") == "monitor_definition", DEADLINE_S, again)
            self.assertEqual((report["fields"]["id"], report["fields"]["status"]), (301, "enabled"))

    def test_a_functional_monitor_fails_when_all_of_its_monitors_do_and_its_action_runs(self):
        with self.flight() as flight:
            _, ground = self.begin(flight)
            for number, mask in ((320, 0b1000), (321, 0b0100)):  # load 3, load 2
                self.complete(ground, f"tc monitor.add id={number} parameter=payload_eps.load_switches check=expected mask={mask} low=0")
            self.complete(ground, "tc monitor.enable id=320,321")
            self.complete(ground, "tc functional_monitor.add id=20 monitor=320,321 minimum_failing=2 event=monitor.functional_1")
            self.complete(ground, "tc functional_monitor.enable id=20")
            self.complete(ground, "tc functional_monitor.protect id=20")
            self.complete(ground, 'tc event_action.add event=monitor.functional_1 "request=eps.switch_load load=3 state=off"')
            self.complete(ground, "tc event_action.enable event=monitor.functional_1")
            kill(flight, "ttc")
            wait_for_ttc(ground)
            self.assertEqual(ground.command("tc monitor.disable id=320", DEADLINE_S)["name"], "monitor_protected")

            self.complete(ground, "tc eps.switch_load load=3 state=on")
            since = ground.position()
            self.complete(ground, "tc eps.switch_load load=2 state=on")
            failed = self.wait_for_event(ground, "monitor.functional_1", since)
            self.assertEqual((failed["fields"]["functional"], failed["fields"]["failing"], failed["fields"]["monitors"]), (20, 2, 2))
            self.wait_for_event(ground, "event_action.released", since)
            wait_until(lambda: flight.control({"query": "truth"})["power"]["switches"] == 0b0100, DEADLINE_S, "the action switched load 3 off")

            def state():
                status = ground.position()
                self.complete(ground, "tc functional_monitor.report_status")
                report = ground.wait_for(lambda m: m.get("structure") == "functional_monitor_status", DEADLINE_S, status)
                return report["fields"]["state"]

            wait_until(lambda: state() == "running", DEADLINE_S, "one monitor out of limits is not enough")

    def test_an_empty_battery_commands_safe_mode(self):
        # The ground moves the limit: waiting for an empty battery takes hours.
        with self.flight() as flight:
            _, ground = self.begin(flight)
            since = ground.position()
            self.complete(ground, "tc monitor.modify id=1 parameter=payload_eps.state_of_charge check=at_least low=0.99 low_event=monitor.battery_empty")
            self.wait_for_event(ground, "monitor.battery_empty", since)
            self.wait_for_event(ground, "ttc.mode_changed", since, lambda m: m["fields"]["mode"] == "safe")

    def test_bad_requests_are_refused_with_their_reason(self):
        with self.flight() as flight:
            _, ground = self.begin(flight)

            def refused(line):
                outcome = ground.command(line, DEADLINE_S)
                return (outcome or {}).get("name")

            self.assertEqual(refused("tc monitor.add id=1 parameter=ttc.cycle check=at_most high=1"), "monitor_exists")
            self.assertEqual(refused("tc monitor.add id=310 parameter=beacon.mode_reason check=at_most high=1"), "not_monitorable")
            self.assertEqual(refused("tc monitor.add id=310 parameter=ttc.cycle check=limits low=2 high=1"), "contradictory_limits")
            self.assertEqual(refused('tc event_action.add event=eps.battery_low "request=eps.power_cycle_peripheral"'), "no_action")
            self.assertEqual(refused("tc monitor.delete_all"), "still_enabled")

    def test_killed_while_actions_fire_each_is_executed_once(self):
        seed = random.randrange(1 << 32)
        print(f"seed {seed}")
        chance = random.Random(seed)
        with self.flight() as flight:
            recorder, ground = self.begin(flight)
            for number in range(1, 5):
                self.define(ground, number, f"eps.set_charge_limit limit=0.9{number}")
                self.complete(ground, f"tc monitor.enable id={300 + number}")
            for turn in range(TURNS):
                wait_for_ttc(ground)
                since = recorder.position()
                self.complete(ground, f"tc eps.switch_load load={LOAD} state={'on' if turn % 2 == 0 else 'off'}")
                if turn % 2 == 0:  # the actions of this turn, or those of the last one that waited
                    self.assertIsNotNone(recorder.wait_for(lambda m: m["type"] == "telecommand" and m["target"] == "payload_eps", DEADLINE_S, since))
                threading.Event().wait(chance.uniform(0, 0.5))
                kill(flight, "ttc")
            wait_for_ttc(ground)
            self.complete(ground, "tc event_action.stop")

            def ordered():
                return {m["id"] & 0xFFFFFFFF for m in recorder.select(lambda m: m["type"] == "telecommand" and m["target"] == "payload_eps")}

            wait_until(lambda: ordered() <= set(self.executed(flight)["last"]), DEADLINE_S, "all that was ordered is executed")
            found = self.executed(flight)
            self.assertEqual(found["count"], len(found["last"]), "the list is complete")
            twice = [number for number, times in collections.Counter(found["last"]).items() if times > 1]
            self.assertEqual(twice, [], "executed twice")
            # A ttc that has just started orders before the recorder knows it; the payload's reports name these.
            reported = {m["id"] & 0xFFFFFFFF for m in recorder.select(lambda m: m["type"] == "report" and m["node"] == "payload_eps")}
            self.assertLessEqual(set(found["last"]), ordered() | reported)
            self.assertLessEqual(len(set(found["last"]) - ordered()), TURNS, "one for each ttc")
            actions = found["count"] - TURNS - 4
            self.assertGreaterEqual(actions, 4, "actions were released")


if __name__ == "__main__":
    unittest.main()
