# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the nodes by telecommand (PUS 20)."""

import json
import os
import signal
import subprocess
import unittest

from mission_dictionary import load
from support import DEADLINE_S, SystemTest, kill

from srfs import ROOT
from srfs.flight.deployments import NODES
from srfs.flight.processes import wait_until

PARAMETERS = {p["full_name"]: p for p in load(ROOT / "mission").parameters}


class ParameterTools(SystemTest):
    def tool(self, flight, *arguments):
        run = subprocess.run(flight.ground_command("--json", "param", *arguments), stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=240)
        return run.returncode, [json.loads(line) for line in run.stdout.splitlines()]

    def values(self, flight, *names):
        code, lines = self.tool(flight, "get", *names)
        self.assertEqual(code, 0, lines[-3:])
        return {name: value for m in lines if m.get("structure") == "parameter_value" for name, value in m["fields"].items()}

    def at_the_node(self, flight, full_name):
        node, name = full_name.split(".", 1)
        return json.loads(flight.srfs("param", "get", node, name).stdout)["value"]


class ParametersTest(ParameterTools):
    def test_every_parameter_of_the_dictionary_is_read_and_can_be_set_again(self):
        with self.flight() as flight:
            values = self.values(flight)
            self.assertEqual(set(values), set(PARAMETERS))
            code, lines = self.tool(flight, "set", *(f"{name}={str(v).lower() if isinstance(v, bool) else v}" for name, v in values.items()))
            self.assertEqual(code, 0, lines[-3:])
            self.assertEqual(self.values(flight, "timing", "can_switcher"),
                             {n: v for n, v in values.items() if n.startswith(("timing.", "can_switcher."))})  # fmt: skip

    def test_a_parameter_is_changed_and_its_node_has_it(self):
        with self.flight() as flight:
            self.assertEqual(self.values(flight, "can_switcher.early_handover"), {"can_switcher.early_handover": False})
            code, lines = self.tool(flight, "set", "can_switcher.early_handover=true", "payload_eps.log_level=warn",
                                    "can_switcher.rotation_order=payload_eps,payload_adcs")  # fmt: skip
            self.assertEqual(code, 0, lines)
            self.assertEqual(self.at_the_node(flight, "can_switcher.early_handover"), True)
            self.assertEqual(self.at_the_node(flight, "payload_eps.log_level"), "warn")
            self.assertEqual(self.at_the_node(flight, "can_switcher.rotation_order"), ["payload_eps", "payload_adcs"])
            self.assertEqual(self.values(flight, "can_switcher.rotation_order"), {"can_switcher.rotation_order": "payload_eps,payload_adcs"})

    def test_what_cannot_be_is_refused_by_the_ground_the_spacecraft_or_the_node_and_why_is_said(self):
        with self.flight() as flight:
            code, lines = self.tool(flight, "set", "timing.leap_seconds=61")
            self.assertEqual((code, lines[0]["type"]), (2, "error"))
            self.assertIn("61 is out of range 30..60", lines[0]["message"])
            code, lines = self.tool(flight, "get", "timing.gps_baud")
            self.assertEqual(code, 2)

            ground = flight.ground()
            outcome = ground.command("tc parameters.set parameter=can_switcher.rotation_order value=payload_x", DEADLINE_S)
            self.assertEqual((outcome["stage"], outcome["name"]), ("failed", "parameter_refused"))
            said = ground.wait_for(lambda m: m["type"] == "event" and m["event"] == "parameter.refused", DEADLINE_S)
            self.assertEqual(said["fields"]["parameter"], "can_switcher.rotation_order")
            self.assertIn("'payload_x' has no slot in the deployment", said["fields"]["reason"])

    def test_a_node_that_is_gone_fails_its_requests_and_the_others_are_answered(self):
        with self.flight() as flight:
            ground = flight.ground()
            self.complete(ground, "tc ring.hold node=image_processing")
            os.kill(flight.node_pid("image_processing"), signal.SIGKILL)
            wait_until(lambda: flight.node_pid("image_processing") is None, DEADLINE_S, "it is gone")
            outcome = ground.command("tc parameters.report parameter=image_processing.log_level", DEADLINE_S)
            self.assertEqual((outcome["stage"], outcome["name"]), ("failed", "parameter_node_silent"))
            outcome = ground.command("tc parameters.report parameter=image_acquisition.log_level", DEADLINE_S)
            self.assertEqual(outcome["stage"], "completed")


class KeptParametersTest(ParameterTools):
    def flight_with_short_trials(self):
        short = "parameter_trial_s: 6"
        return self.flight(self.deployment(("watchdog_timeout_s: 10 }", f"watchdog_timeout_s: 10, {short} }}"), ("initial_mode: nominal }", f"initial_mode: nominal, {short} }}")))

    def do(self, flight, *arguments):
        code, lines = self.tool(flight, *arguments)
        self.assertEqual(code, 0, lines[-3:])
        return lines

    def kill(self, flight, *nodes):
        """Kills the nodes with SIGKILL and waits until new processes work."""
        kill(flight, *nodes)
        wait_until(lambda: all(node["state"] == "active" for node in flight.status()), 2 * DEADLINE_S, "all work again")

    def value(self, flight, full_name):
        """The parameter's value; None while the node does not answer."""
        node, name = full_name.split(".", 1)
        answer = flight.srfs("param", "get", node, name)
        return json.loads(answer.stdout)["value"] if answer.returncode == 0 else None

    def wait_for_value(self, flight, full_name, value):
        wait_until(lambda: self.value(flight, full_name) == value, 2 * DEADLINE_S, f"{full_name} is {value}")

    def history(self, flight, node):
        lines = self.do(flight, "history", node)
        return [m["fields"] for m in lines if m.get("structure") == "parameter_generation"]

    def test_a_kept_value_outlives_its_process_until_a_factory_reset_which_can_be_undone(self):
        with self.flight() as flight:
            self.assertEqual([g["number"] for g in self.history(flight, "payload_eps")], [0])
            self.do(flight, "set", "payload_eps.answer_timeout_ms=31", "payload_eps.log_level=warn")
            self.do(flight, "keep", "payload_eps")
            self.kill(flight, "payload_eps")
            self.wait_for_value(flight, "payload_eps.answer_timeout_ms", 31)
            self.assertEqual(self.value(flight, "payload_eps.log_level"), "warn")

            self.do(flight, "reset", "payload_eps")
            self.assertEqual(self.value(flight, "payload_eps.answer_timeout_ms"), 25, "at once")
            self.kill(flight, "payload_eps")
            self.wait_for_value(flight, "payload_eps.answer_timeout_ms", 25)
            newest, first = self.history(flight, "payload_eps")
            self.assertEqual((newest["number"], newest["current"], newest["values"]), (2, True, 0))
            self.assertEqual((first["number"], first["content"]), (1, "answer_timeout_ms=31, log_level=warn"))
            self.assertEqual(first["origin"], "keep (telecommand)")

            self.do(flight, "restore", "payload_eps", "1")
            self.assertEqual(self.value(flight, "payload_eps.answer_timeout_ms"), 31)

            # An octet on the disk changes.
            file = flight.var / "state" / "payload_eps" / "parameters.yaml"
            file.write_text(file.read_text().replace("value: 31", "value: 91"))
            ground = flight.ground()
            since = ground.position()
            self.kill(flight, "payload_eps")
            self.wait_for_value(flight, "payload_eps.answer_timeout_ms", 25)
            said = ground.wait_for(lambda m: m["type"] == "event" and m["event"] == "node.parameter_set_aside", DEADLINE_S, since)
            self.assertIn("checksum", said["fields"]["reason"])

    def test_a_guarded_value_goes_back_when_its_time_is_over_though_ttc_and_maintenance_died(self):
        with self.flight_with_short_trials() as flight:
            ground = flight.ground()
            outcome = ground.command("tc parameters.set parameter=timing.late_tick_ms value=77", DEADLINE_S)
            self.assertEqual(outcome["stage"], "completed")
            self.assertIsNotNone(ground.wait_for(lambda m: m["type"] == "event" and m["event"] == "parameter.on_trial", DEADLINE_S))
            self.complete(ground, "tc parameters.keep node=timing")
            since = ground.position()
            self.kill(flight, "ttc", "maintenance")
            self.wait_for_value(flight, "timing.late_tick_ms", 50)
            self.kill(flight, "timing")
            self.wait_for_value(flight, "timing.late_tick_ms", 50)

            # Without deaths, the ground receives an event.
            outcome = ground.command("tc parameters.set parameter=timing.late_tick_ms value=78", 2 * DEADLINE_S)
            self.assertEqual(outcome["stage"], "completed")
            said = ground.wait_for(lambda m: m["type"] == "event" and m["event"] == "parameter.reverted", DEADLINE_S, since)
            self.assertEqual((said["fields"]["reason"], said["fields"]["content"]), ("not confirmed in time", "late_tick_ms=50"))

    def test_a_guarded_value_that_is_confirmed_holds_and_one_that_is_not_dies_with_its_node_or_the_whole_suite(self):
        with self.flight() as flight:
            ground = flight.ground()
            self.complete(ground, "tc parameters.set parameter=ttc.beacon_period_ms value=2000")
            self.complete(ground, "tc parameters.keep node=ttc")
            since = ground.position()
            self.kill(flight, "ttc")
            self.wait_for_value(flight, "ttc.beacon_period_ms", 30000)
            said = ground.wait_for(lambda m: m["type"] == "event" and m["event"] == "parameter.reverted", DEADLINE_S, since)
            self.assertEqual(said["fields"]["reason"], "restarted before it was confirmed")
            outcome = ground.command("tc parameters.confirm node=ttc", DEADLINE_S)
            self.assertEqual((outcome["stage"], outcome["name"]), ("failed", "parameters_refused"))
            said = ground.wait_for(lambda m: m["type"] == "event" and m["event"] == "parameter.request_refused", DEADLINE_S, since)
            self.assertEqual((said["fields"]["node"], said["fields"]["reason"]), ("ttc", "nothing is on trial"))
            outcome = ground.command("tc parameters.keep node=nobody", DEADLINE_S)
            self.assertEqual(outcome["name"], "unknown_node")

            self.complete(ground, "tc parameters.set parameter=ttc.beacon_period_ms value=2000")
            self.complete(ground, "tc parameters.keep node=ttc")
            self.complete(ground, "tc parameters.confirm node=ttc")
            self.kill(flight, "ttc")
            self.wait_for_value(flight, "ttc.beacon_period_ms", 2000)

            self.complete(ground, "tc parameters.set parameter=ttc.beacon_period_ms value=3000", 2 * DEADLINE_S)
            self.complete(ground, "tc parameters.keep node=ttc")
            self.kill(flight, *NODES)
            self.wait_for_value(flight, "ttc.beacon_period_ms", 2000)
            self.complete(ground, "tc parameters.history node=ttc", 2 * DEADLINE_S)


if __name__ == "__main__":
    unittest.main()
