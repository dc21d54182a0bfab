"""Parameters of the nodes by telecommand (PUS 20)."""

import json
import os
import signal
import subprocess
import unittest

from support import BIN, DEADLINE_S, ROOT, SystemTest, wait_until

import sys

sys.path.insert(0, str(ROOT / "msgs" / "generator"))

from mission_dictionary import load  # noqa: E402

PARAMETERS = {p["full_name"]: p for p in load(ROOT / "msgs" / "mission").parameters}


class ParametersTest(SystemTest):
    def tool(self, flight, *arguments):
        command = [str(BIN / "srfs-ground"), "--port", str(flight.var / "rs422"), "--deployment", str(flight.deployment), "--json", "param", *arguments]
        run = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=240)
        return run.returncode, [json.loads(line) for line in run.stdout.splitlines()]

    def values(self, flight, *names):
        code, lines = self.tool(flight, "get", *names)
        self.assertEqual(code, 0, lines[-3:])
        return {name: value for m in lines if m.get("structure") == "parameter_value" for name, value in m["fields"].items()}

    def at_the_node(self, flight, full_name):
        node, name = full_name.split(".", 1)
        return json.loads(flight.srfs("param", "get", node, name).stdout)["value"]

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
            code, lines = self.tool(flight, "get", "timing.tick_period_ms")
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
            self.assertEqual(ground.command("tc ring.hold node=image_processing", DEADLINE_S)["stage"], "completed")
            os.kill(flight.node_pid("image_processing"), signal.SIGKILL)
            wait_until(lambda: flight.node_pid("image_processing") is None, DEADLINE_S, "it is gone")
            outcome = ground.command("tc parameters.report parameter=image_processing.log_level", DEADLINE_S)
            self.assertEqual((outcome["stage"], outcome["name"]), ("failed", "parameter_node_silent"))
            outcome = ground.command("tc parameters.report parameter=image_acquisition.log_level", DEADLINE_S)
            self.assertEqual(outcome["stage"], "completed")


if __name__ == "__main__":
    unittest.main()
