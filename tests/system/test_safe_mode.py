# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Safe mode that every node obeys: the flight of an operator who switches everything on, and every node by itself when ttc is dead."""

import os
import signal
import unittest

from support import DEADLINE_S, SystemTest, kill

from srfs.flight.processes import wait_until

FASTER = ("time_acceleration: 120", "time_acceleration: 240")
SHED = 0b1100  # camera and high-rate transmitter
LONG_S = 4 * DEADLINE_S  # a battery that is charged again, in fast time


class FastFlight(SystemTest):
    def power(self, flight):
        return flight.control({"query": "truth"})["power"]

    def mode_event(self, ground, mode, deadline_s=DEADLINE_S, since=0):
        event = ground.wait_for(
            lambda m: m["type"] == "event" and m["event"] == "ttc.mode_changed" and m["fields"]["mode"] == mode, deadline_s, since
        )
        self.assertIsNotNone(event, f"mode {mode}")
        return event["fields"]

    def switch_everything_on(self, flight, ground):
        for load in range(4):
            self.complete(ground, f"tc eps.switch_load load={load} state=on --wait")
        self.assertEqual(self.power(flight)["switches"], 0b1111)

    def packet(self, ground, structure):
        packet = ground.wait_for(lambda m: m.get("structure") == structure and m["fields"]["mode"] == "safe", DEADLINE_S)
        self.assertIsNotNone(packet, f"{structure} in safe mode")
        return packet["fields"]

    def wait_until_shed(self, flight):
        wait_until(lambda: self.power(flight)["switches"] & SHED == 0, DEADLINE_S, "camera and transmitter are off")

    def obedience(self, ground):
        health = ground.fresh("health", DEADLINE_S) or {}
        return [value for key, value in health.items() if key.startswith("node_obeys.")]

    def all_obey(self, ground):
        def obeyed():
            nodes = self.obedience(ground)
            return "pending" not in nodes and nodes.count("obeys") == 7

        wait_until(obeyed, DEADLINE_S, "every node obeys the mode")


class SafeModeTest(FastFlight):
    def test_a_battery_that_nothing_protects_takes_the_computer_with_it_and_comes_back(self):
        without = ("enter_below: 0.35, over_above: 0.55", "enter_below: 0.0, over_above: 0.0")
        flat = ("initial_charge: 0.76", "initial_charge: 0.2")
        restored = ("restore_charge: 0.15", "restore_charge: 0.06")
        with self.flight(self.deployment(FASTER, without, flat, restored, base="sim_mission")) as flight:
            before = flight.node_pid("timing")
            ground = flight.ground()
            self.complete(ground, "tc event_action.stop")  # it would command safe mode below 0.15
            for load in (2, 3):
                ground.send(f"tc eps.switch_load load={load} state=on")
            wait_until(lambda: self.power(flight)["cut_outs"] == 1, LONG_S, "the computer loses its power")
            wait_until(lambda: self.power(flight)["computer_on"], LONG_S, "the battery is charged again")
            wait_until(lambda: flight.node_pid("timing") not in (None, before), DEADLINE_S, "the suite is started anew")
            self.assertIsNotNone(ground.fresh("health", DEADLINE_S))

    def test_orders_that_keep_the_battery_from_being_charged_are_put_right_in_safe_mode(self):
        slower = ("time_acceleration: 120", "time_acceleration: 1")
        with self.flight(self.deployment(slower, base="sim_mission")) as flight:
            ground = flight.ground()
            self.complete(ground, "tc eps.set_charge_limit limit=0 --wait")  # no charge at all
            self.complete(ground, "tc thermal.set_heater heater=0 mode=on --wait")  # a frozen battery takes none: by off; on is seen

            def heats():
                packet = ground.fresh("payload_thermal", DEADLINE_S) or {}
                return int(packet.get("heater_states", "0"), 0) & 1

            wait_until(heats, DEADLINE_S, "heater 0 is on")
            self.assertEqual(self.power(flight)["charge_limit"], 0)
            self.complete(ground, "tc ttc.set_mode mode=safe --wait")
            wait_until(lambda: self.power(flight)["charge_limit"] > 0.9, DEADLINE_S, "the battery is charged again")
            wait_until(lambda: not heats(), DEADLINE_S, "the heater goes by the temperature again")

    def test_nodes_go_to_safe_by_themselves_when_ttc_is_dead(self):
        no_ring = ("modes:\n", "ring: null\n\nmodes:\n")  # nobody restarts it
        slower = ("time_acceleration: 120", "time_acceleration: 1")
        with self.flight(self.deployment(no_ring, slower, base="sim_mission")) as flight:
            ground = flight.ground()
            self.switch_everything_on(flight, ground)
            os.kill(flight.node_pid("ttc"), signal.SIGKILL)
            self.wait_until_shed(flight)
            wait_until(
                lambda: flight.control({"query": "truth"})["attitude"]["mode"] == 3, DEADLINE_S, "the attitude control turns to the sun"
            )
            wait_until(
                lambda: flight.control({"query": "truth"})["thermal"]["setpoint_k"] == [278, 263], DEADLINE_S, "survival setpoints"
            )


class SafeModeFlightTest(FastFlight):
    def test_all_loads_on_ends_in_safe_mode_in_time_and_in_nominal_when_the_battery_is_charged(self):
        with self.flight(self.deployment(base="sim_mission")) as flight:
            ground = flight.ground()
            self.switch_everything_on(flight, ground)
            safe = self.mode_event(ground, "safe", LONG_S)
            self.assertTrue(safe["reason"].startswith("battery: state_of_charge"), safe)
            # The event may be late on a busy machine; what was shed when is judged by the charge alone.
            kill(flight, "payload_eps")  # its orders are a level: the next process gives them
            self.wait_until_shed(flight)
            self.assertGreater(self.power(flight)["lowest_charge"], 0.20)
            kill(flight, "ttc")  # the mode is on the disk
            # From what came down while it lasted: in fast time the battery is charged again soon.
            health = self.packet(ground, "health")
            self.assertEqual((health["cause"], health["commanded"]), ("measurement", "nominal"))
            self.assertEqual(health["shed"], "camera, high-rate transmitter")
            self.assertEqual(health["next"], "nominal when state_of_charge is above 0.55")
            beacon = self.packet(ground, "beacon")
            self.assertTrue(beacon["mode_reason"].startswith("battery: state_of_charge"), beacon)
            self.assertEqual(beacon["mode_causes"], "0x01")

            back = self.mode_event(ground, "nominal", LONG_S)
            self.assertTrue(back["reason"].startswith("battery is over"), back)
            self.complete(ground, "tc eps.switch_load load=2 state=on --wait")
            power = self.power(flight)
            self.assertEqual(power["switches"] & 0b0100, 0b0100, "commanded work goes on")
            self.assertGreater(power["lowest_charge"], 0.20)
            self.assertEqual(power["cut_outs"], 0)

    def test_a_commanded_safe_mode_is_obeyed_by_all_others_while_one_node_is_dead_and_across_a_reset(self):
        slower = ("time_acceleration: 120", "time_acceleration: 1")
        with self.flight(self.deployment(slower, base="sim_mission")) as flight:
            ground = flight.ground()
            self.switch_everything_on(flight, ground)
            self.complete(ground, "tc ring.hold node=payload_thermal --wait")
            os.kill(flight.node_pid("payload_thermal"), signal.SIGKILL)
            self.complete(ground, "tc ttc.set_mode mode=safe --wait")
            self.wait_until_shed(flight)
            wait_until(lambda: self.obedience(ground).count("pending") == 1, DEADLINE_S, "all but the dead node obey")
            beacon = ground.fresh("beacon", DEADLINE_S)
            self.assertEqual(beacon["mode_pending"], 1)
            self.complete(ground, "tc ring.release node=payload_thermal --wait")
            self.all_obey(ground)
            kelvin = flight.control({"query": "truth"})["thermal"]["setpoint_k"]
            self.assertEqual(kelvin, [278, 263], "survival setpoints")
            # A task is refused by the lane itself, too.
            refused = ground.command("tc image.process task=1 --wait", DEADLINE_S)
            self.assertNotEqual(refused["stage"], "completed")
            # Levels: whoever switches the load on in safe mode sees it go off again.
            self.complete(ground, "tc eps.switch_load load=2 state=on --wait")
            self.wait_until_shed(flight)
            self.complete(ground, "tc ttc.set_mode mode=nominal --wait")
            self.complete(ground, "tc eps.switch_load load=2 state=on --wait")
            wait_until(
                lambda: flight.control({"query": "truth"})["thermal"]["setpoint_k"] == [283, 278], DEADLINE_S, "setpoints of nominal are back"
            )
            self.assertEqual(self.power(flight)["switches"] & 0b0100, 0b0100)


if __name__ == "__main__":
    unittest.main()
