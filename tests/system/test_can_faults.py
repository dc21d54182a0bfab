# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Faults of the CAN bus and its users: bus-off, a flood, a peripheral that babbles, a holder that does not give the bus back, a switcher
that misses the end of a slot. The rotation continues."""

import contextlib
import os
import signal
import subprocess
import sys
import time
import unittest

from support import DEADLINE_S, JUDGED, SystemTest, restarts, slots, wait_for_slots

from srfs.flight.deployments import PAYLOADS
from srfs.flight.processes import wait_until
from srfs.record import can_frames

# For slots that last nearly until their lease ends, in which a machine that stands still for a moment must not have the holder killed.
LONG_LEASES = [(f"{{ payload: {payload}, allotted_ms: 60, overrun_ms: 20,", f"{{ payload: {payload}, allotted_ms: 60, overrun_ms: 300,") for payload in PAYLOADS]
HEALTHY = ("payload_adcs", "payload_thermal")


class CanFaultTest(SystemTest):
    def wait_for_all(self, recorder, status, count):
        """Waits until every payload has ended `count` more slots with this status."""
        since = recorder.position()
        for payload in PAYLOADS:
            wait_for_slots(recorder, payload, status, count, since)

    def bus(self, ground, matches):
        """The fields of the next can_bus packet that matches."""
        packet = ground.housekeeping("can_bus", DEADLINE_S, matches=matches)
        self.assertIsNotNone(packet, "no such can_bus packet; the last: %s" % ground.fresh("can_bus"))
        return packet["fields"]

    def wait_for_rotation(self, flight, recorder):
        """Waits until every payload has used the bus, and notes the restart counts at that time."""
        self.wait_for_all(recorder, "released", 2)
        self.restarts = restarts(flight)

    def assert_nobody_was_restarted(self, flight):
        self.assertEqual(restarts(flight), self.restarts)
        self.assertEqual([node["state"] for node in flight.status()], ["active"] * 9)

    def is_slot_of_eps(self, message, *statuses):
        return message["type"] == "bus" and message["payload"] == "payload_eps" and message["status"] in statuses


class BusOffTest(CanFaultTest):
    def test_the_computer_comes_back_by_the_restart_time_of_its_interface(self):
        self.fall_off_and_come_back({"bus_off": "computer", "restart_ms": 150})

    def test_the_driver_restarts_a_controller_whose_interface_does_not(self):
        self.fall_off_and_come_back({"bus_off": "computer", "restart_ms": 0})

    def fall_off_and_come_back(self, fault):
        with self.flight() as flight:
            recorder, ground = flight.recorder(), flight.ground()
            self.wait_for_rotation(flight, recorder)
            since = recorder.position()
            flight.control({"can": fault})
            # Longer than a tick: at least one payload gets a grant for a bus that it cannot write to.
            wait_until(lambda: self.off_the_bus(recorder, since), DEADLINE_S, "a slot failed because of the bus-off")
            self.wait_for_all(recorder, "released", 3)

            fields = self.bus(ground, lambda f: f["bus_off"] >= 1 and f["controller_restarts"] >= 1)
            self.assertEqual(fields["controller"], "active")
            counters = flight.control({"query": "counters"})["can"]
            self.assertEqual(counters["bus_off"], 1)
            self.assertEqual(counters["restarts"], 1)
            self.assert_nobody_was_restarted(flight)

    def test_a_bus_off_in_the_middle_of_a_slot_ends_it_as_no_silence_of_the_peripheral(self):
        payload = "executable: payload_eps_node\n    peripheral: { can_address: 0x12, power_line: 1 }\n    scheduling: { policy: other, priority: 0, cpus: [] }"
        deployment = self.deployment((payload, payload + "\n    parameters: { answer_timeout_ms: 40, silent_slots_to_power_cycle: 0 }"), *LONG_LEASES)
        with self.flight(deployment) as flight:
            recorder = flight.recorder()
            self.wait_for_rotation(flight, recorder)
            # The EPS's slots then last long enough to hit one after its request was sent, and end long before the lease.
            flight.control({"peripheral": "eps", "fault": "silent"})
            since = recorder.position()

            def hit():
                taken = recorder.wait_for(lambda m: self.is_slot_of_eps(m, "taken"), DEADLINE_S, recorder.position())
                self.assertIsNotNone(taken)
                flight.control({"can": {"bus_off": "computer"}})
                after = recorder.position()
                wait_for_slots(recorder, "payload_eps", "failed", 1, after)
                return [m for m in slots(recorder, "payload_eps", "failed", since) if m["detail"] == "bus off" and m["sent"] > 0]

            wait_until(hit, DEADLINE_S, "a slot ended by a bus-off after its request was sent")
            flight.control({"peripheral": "eps", "fault": "none"})
            self.wait_for_all(recorder, "released", 3)
            self.assert_nobody_was_restarted(flight)

    def off_the_bus(self, recorder, since):
        return any(m["detail"] == "bus off" for payload in PAYLOADS for m in slots(recorder, payload, "failed", since))


class FloodTest(CanFaultTest):
    def test_a_node_that_floods_the_bus_with_the_highest_priority_stops_slots_and_no_process(self):
        with self.flight(self.deployment(*LONG_LEASES)) as flight:
            recorder, ground = flight.recorder(), flight.ground()
            self.wait_for_rotation(flight, recorder)
            memory = flight.memory_kib()

            flight.control({"can": {"babble": {"id": 0}}})
            flooded = self.wait_for_event(ground, "can_switcher.bus_flooded")
            self.assertEqual(flooded["fields"]["identifier"], "0x00000000")
            self.wait_for_all(recorder, "failed", 3)
            fields = self.bus(ground, lambda f: f["flooded"])
            self.assertGreater(fields["foreign_frames"], 1000)
            since = recorder.position()

            flight.control({"can": {}})
            for payload in PAYLOADS:
                wait_for_slots(recorder, payload, "released", 3, since)
            self.wait_for_event(ground, "can_switcher.bus_flood_over")
            self.assertGreater(flight.control({"query": "counters"})["can"]["withdrawn"], 0)
            self.assert_nobody_was_restarted(flight)
            after = flight.memory_kib()
            for name in JUDGED:
                self.assertLess(after[name] - memory[name], 16 * 1024, f"{name} grew")

    def test_foreign_traffic_of_low_priority_at_full_load_does_not_stop_the_payloads(self):
        with self.flight() as flight:
            recorder, ground = flight.recorder(), flight.ground()
            self.wait_for_rotation(flight, recorder)
            flight.control({"can": {"babble": {"id": 0x1FFFFFFF, "extended": True}}})
            self.wait_for_event(ground, "can_switcher.bus_flooded")
            self.wait_for_all(recorder, "released", 5)
            self.assert_nobody_was_restarted(flight)


class BabblingPeripheralTest(CanFaultTest):
    def test_it_is_cut_off_comes_back_and_in_the_end_stays_off_until_it_is_commanded(self):
        with self.flight() as flight:
            recorder, ground = flight.recorder(), flight.ground()
            self.wait_for_rotation(flight, recorder)

            with self.subTest("a power cycle helps"):
                flight.control({"peripheral": "eps", "fault": "babble", "cured_by": "power_cycle"})
                self.wait_for_event(ground, "payload.peripheral_babbles")
                self.wait_for_all(recorder, "released", 3)

            with self.subTest("no power cycle helps"):
                flight.control({"peripheral": "eps", "fault": "babble"})
                self.wait_for_event(ground, "payload.peripheral_kept_off")
                self.assertFalse(flight.control({"query": "counters"})["peripherals"]["eps"]["powered"])
                since = recorder.position()
                for payload in HEALTHY:
                    wait_for_slots(recorder, payload, "released", 5, since)
                refused = ground.command("tc eps.switch_load load=2 state=on", DEADLINE_S)
                self.assertEqual(refused.get("name"), "peripheral_off", refused)
                self.assertEqual(self.frames_of_eps(flight), [], "nothing of it on the bus")
                packet = ground.housekeeping("payload_eps_counters", DEADLINE_S, matches=lambda f: f["kept_off"])
                self.assertGreaterEqual(packet["fields"]["babble_cuts"], 4)

            with self.subTest("commanded"):
                flight.control({"peripheral": "eps", "fault": "none"})
                since = recorder.position()
                self.complete(ground, "arm eps.power_cycle_peripheral off_ms=100")
                commanded = ground.command("tc eps.power_cycle_peripheral off_ms=100", DEADLINE_S)
                self.assertEqual(commanded.get("stage"), "completed", commanded)
                wait_for_slots(recorder, "payload_eps", "released", 10, since)
            self.assert_nobody_was_restarted(flight)

    def frames_of_eps(self, flight):
        """The frames that the EPS sent in two seconds, from the record of the bus."""
        begin = can_frames.last_time(flight.can_log()[-100:])
        lines = flight.can_log(until_ns=begin + 2_000_000_000, deadline_s=DEADLINE_S)
        return [line for line in lines if "18DA0112#" in line and can_frames.last_time([line]) > begin]


class UnattendedPeripheralTest(CanFaultTest):
    def test_a_peripheral_that_babbles_while_its_payload_has_no_process_is_cut_off_and_comes_back_with_its_payload(self):
        with self.flight() as flight:
            recorder, ground = flight.recorder(), flight.ground()
            self.wait_for_rotation(flight, recorder)
            self.assertEqual(flight.srfs("ring", "hold", "payload_eps").returncode, 0)
            os.kill(flight.node_pid("payload_eps"), signal.SIGKILL)
            wait_until(lambda: flight.node_pid("payload_eps") is None, DEADLINE_S, "payload_eps has ended")

            flight.control({"peripheral": "eps", "fault": "babble"})
            event = self.wait_for_event(ground, "can_switcher.peripheral_cut")
            self.assertEqual(event["fields"]["payload"], "payload_eps")
            self.assertFalse(self.powered(flight))
            packet = ground.housekeeping("can_switcher", DEADLINE_S, matches=lambda f: f["peripherals_cut"] == 1)
            self.assertIsNotNone(packet)
            since = recorder.position()
            for payload in HEALTHY:
                wait_for_slots(recorder, payload, "released", 5, since)

            flight.control({"peripheral": "eps", "fault": "none"})
            since = recorder.position()
            self.assertEqual(flight.srfs("ring", "release", "payload_eps").returncode, 0)
            wait_for_slots(recorder, "payload_eps", "released", 5, since)
            self.assertTrue(self.powered(flight))

    def powered(self, flight):
        return flight.control({"query": "counters"})["peripherals"]["eps"]["powered"]


class LateHolderTest(CanFaultTest):
    LATE_MS, ANSWER_TIMEOUT_MS = 15, 25  # of the peripheral; default of the payloads

    def test_a_payload_that_got_no_cpu_takes_the_answer_that_waits_and_does_not_blame_its_peripheral(self):
        with self.flight(self.deployment(*LONG_LEASES)) as flight:
            recorder = flight.recorder()
            self.wait_for_rotation(flight, recorder)
            flight.control({"peripheral": "eps", "fault": "late", "delay_ms": self.LATE_MS})
            pid, since = flight.node_pid("payload_eps"), recorder.position()

            def hit():
                taken = recorder.wait_for(lambda m: self.is_slot_of_eps(m, "taken"), DEADLINE_S, recorder.position())
                self.assertIsNotNone(taken)
                os.kill(pid, signal.SIGSTOP)
                stopped_ms = (time.monotonic_ns() - taken["said_ns"]) / 1e6
                time.sleep(0.03)
                continued_ns = time.monotonic_ns()
                os.kill(pid, signal.SIGCONT)
                ended = recorder.wait_for(lambda m: self.is_slot_of_eps(m, "released", "failed") and m["grant"] == taken["grant"], DEADLINE_S, since)
                self.assertIsNotNone(ended)
                missed_it = stopped_ms < self.LATE_MS and (continued_ns - taken["said_ns"]) / 1e6 > self.ANSWER_TIMEOUT_MS
                return missed_it and ended["status"] == "released" and ended["said_ns"] > continued_ns

            wait_until(hit, DEADLINE_S, "a slot was used though its payload was stopped from before the answer until behind its deadline")
            flight.control({"peripheral": "eps", "fault": "none"})
            self.wait_for_all(recorder, "released", 2)
            self.assert_nobody_was_restarted(flight)


class StarvedSimulatorTest(CanFaultTest):
    STARVED = 3  # slots
    # For 0.15 s, then again after 0.1 s, as long as the test lives.
    TAKES_ONE_CPU = """
import os, sys, time
os.sched_setaffinity(0, {int(sys.argv[1])})
os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
test = os.getppid()
while os.getppid() == test:
    time.sleep(0.1)
    end = time.monotonic() + 0.15
    while time.monotonic() < end:
        pass
"""

    def setUp(self):
        super().setUp()
        probe = subprocess.run([sys.executable, "-S", "-c", "import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))"], capture_output=True)
        if probe.returncode != 0 or len(os.sched_getaffinity(0)) < 2:
            self.skipTest("needs the right to real-time priorities, and two CPUs")

    def test_a_simulated_bus_without_a_cpu_has_no_payload_killed(self):
        """The frames of a holder leave when hw_sim has a CPU. On board no process plays the bus."""
        with self.flight() as flight, contextlib.ExitStack() as stack:
            recorder, ground = flight.recorder(), flight.ground()
            self.wait_for_rotation(flight, recorder)
            cpu, pid = min(os.sched_getaffinity(0)), flight.hw_sim.pid
            starved = lambda: (ground.fresh("can_switcher") or {}).get("starved_holders", 0)  # noqa: E731
            before = starved()
            os.sched_setaffinity(pid, {cpu})
            taker = subprocess.Popen([sys.executable, "-S", "-c", self.TAKES_ONE_CPU, str(cpu)])
            stack.callback(taker.wait)
            stack.callback(taker.kill)

            def lasted():
                self.assertIsNone(taker.poll(), "it takes the CPU")
                return starved() >= before + self.STARVED

            wait_until(lasted, DEADLINE_S, "slots lasted beyond their leases, as hw_sim waited for a CPU")
            stack.close()
            self.wait_for_all(recorder, "released", 3)
            self.assert_nobody_was_restarted(flight)


class FenceTest(CanFaultTest):
    MARKER = " 1CDA0101#"

    def markers(self, log):
        return len([line for line in log if self.MARKER in line])

    def fence(self, flight, ground):
        """Stops the EPS's payload and waits until the switcher has killed it."""
        pid = flight.node_pid("payload_eps")
        os.kill(pid, signal.SIGSTOP)
        self.wait_for_event(ground, "can_switcher.holder_fenced", matches=lambda m: m["fields"]["payload"] == "payload_eps")
        wait_until(lambda: flight.node_pid("payload_eps") != pid, DEADLINE_S, "payload_eps has been killed")

    def test_behind_a_fenced_holder_one_marker_proves_that_its_frames_are_gone(self):
        with self.flight() as flight:
            recorder, ground = flight.recorder(), flight.ground()
            self.wait_for_rotation(flight, recorder)
            before = self.markers(flight.can_log(time.monotonic_ns()))
            self.assertGreaterEqual(before, 1, "behind whoever was before this switcher")
            withdrawn = flight.control({"query": "counters"})["can"]["withdrawn"]
            self.fence(flight, ground)
            since = recorder.position()
            for payload in HEALTHY:
                wait_for_slots(recorder, payload, "released", 3, since)
            self.assertEqual(self.markers(flight.can_log(time.monotonic_ns())), before + 1)
            self.assertEqual(flight.control({"query": "counters"})["can"]["withdrawn"], withdrawn, "on a healthy bus nothing is taken back")

    def test_on_a_jammed_bus_the_marker_is_taken_back_and_the_rotation_goes_on(self):
        with self.flight() as flight:
            recorder, ground = flight.recorder(), flight.ground()
            self.wait_for_rotation(flight, recorder)
            before = self.markers(flight.can_log(time.monotonic_ns()))
            flight.control({"can": {"babble": {"id": 0}}})
            self.fence(flight, ground)
            since = recorder.position()
            for payload in HEALTHY:
                wait_for_slots(recorder, payload, "failed", 3, since)
            self.assertEqual(self.markers(flight.can_log(time.monotonic_ns())), before, "none got the bus")
            flight.control({"can": {}})
            since = recorder.position()
            for payload in HEALTHY:
                wait_for_slots(recorder, payload, "released", 3, since)


class UnwatchedSlotTest(CanFaultTest):
    def test_a_switcher_that_was_unconfigured_in_the_middle_of_a_slot_asks_for_it_back_and_kills_nobody(self):
        slot = "payload: payload_eps, allotted_ms: "
        payload = "executable: payload_eps_node\n    peripheral: { can_address: 0x12, power_line: 1 }\n    scheduling: { policy: other, priority: 0, cpus: [] }"
        deployment = self.deployment(
            (slot + "60", slot + "4000"),
            (payload, payload + "\n    parameters: { answer_timeout_ms: 10000, silent_slots_to_power_cycle: 0 }"),
        )
        with self.flight(deployment) as flight:
            recorder, ground = flight.recorder(), flight.ground()
            self.wait_for_rotation(flight, recorder)
            before = {payload: flight.node_pid(payload) for payload in PAYLOADS}
            flight.control({"peripheral": "eps", "fault": "silent"})  # its slots last for their full allotted time
            since = recorder.position()

            def unconfigured_in_the_middle_of_a_slot():
                taken = recorder.wait_for(lambda m: self.is_of_eps(m, "taken"), DEADLINE_S, recorder.position())
                self.assertIsNotNone(taken)
                position = recorder.position()
                for transition in ("deactivate", "cleanup"):
                    self.assertEqual(flight.srfs("lifecycle", "can_switcher", transition).returncode, 0)
                unheard = not slots(recorder, "payload_eps", "failed", position)
                wait_for_slots(recorder, "payload_eps", "failed", 1, position)
                for transition in ("configure", "activate"):
                    self.assertEqual(flight.srfs("lifecycle", "can_switcher", transition).returncode, 0)
                return unheard

            wait_until(unconfigured_in_the_middle_of_a_slot, DEADLINE_S, "a slot whose end nobody heard")
            flight.control({"peripheral": "eps", "fault": "none"})
            recalled = recorder.wait_for(lambda m: self.is_of_eps(m, "released") and m["detail"] == "recalled", DEADLINE_S, since)
            self.assertIsNotNone(recalled)
            self.wait_for_all(recorder, "released", 3)
            self.assertEqual({payload: flight.node_pid(payload) for payload in PAYLOADS}, before)
            fenced = ground.find(lambda m: m["type"] == "event" and m.get("event") == "can_switcher.holder_fenced")
            self.assertIsNone(fenced)

    def is_of_eps(self, message, status):
        return message["type"] == "bus" and message["payload"] == "payload_eps" and message["status"] == status


if __name__ == "__main__":
    unittest.main()
