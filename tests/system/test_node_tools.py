# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""An engineer's tools for a single node: `srfs lifecycle`, `stats`, `param`, `status`; and the handling of a node that fails."""

import json
import unittest

from support import BIN, DEADLINE_S, ToolTest

from srfs.flight.processes import wait_until

DEPLOYMENT = """
deployment: t
nodes:
  - { name: faulty, executable: faulty_node, parameters: { configure_ms: 20 } }
"""


class NodeToolsTest(ToolTest):
    def setUp(self):
        super().setUp()
        self.file = self.folder / "faulty.yaml"
        self.file.write_text(DEPLOYMENT)
        self.var.mkdir()
        result = self.srfs("up")
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        self.addCleanup(lambda: self.srfs("down"))  # runs before the check that nothing is left

    def status(self):
        return json.loads(self.srfs("status", "--json").stdout)[0]

    def restart(self):
        self.assertEqual(self.srfs("down").returncode, 0)
        self.assertEqual(self.srfs("up").returncode, 0)

    def starts_as(self, text):
        """Makes the deployment start the node through a script with this text."""
        script = self.folder / "start.sh"
        script.write_text(f"#!/bin/sh\n{text}\n")
        script.chmod(0o755)
        self.file.write_text(DEPLOYMENT.replace("faulty_node", str(script)))

    def test_up_waits_for_a_node_that_loads_slowly_but_not_for_one_that_has_ended(self):
        self.assertEqual(self.srfs("down").returncode, 0)
        self.starts_as(f'sleep 3\nexec {BIN.resolve()}/faulty_node "$@"')  # longer than the launcher waits for its instance lock
        result = self.srfs("up", "--deadline", "40")
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        self.assertEqual(self.srfs("down").returncode, 0)
        self.starts_as("exit 1")
        result = self.srfs("up", "--deadline", "600")  # longer than this test waits for it
        self.assertEqual(result.returncode, 3, result.stdout + result.stderr)
        self.assertIn("faulty is not running instead of active", result.stderr)

    def test_a_transition_that_takes_longer_than_the_deadline_is_still_running_not_failed(self):
        self.assertEqual(self.srfs("lifecycle", "faulty", "deactivate").returncode, 0)
        self.assertEqual(self.srfs("lifecycle", "faulty", "cleanup").returncode, 0)
        self.assertEqual(self.srfs("param", "set", "faulty", "configure_ms", "10000").returncode, 0)
        result = self.srfs("lifecycle", "faulty", "configure", "--deadline", "3000")
        self.assertEqual(result.returncode, 3, result.stderr)
        self.assertIn("/faulty is still configuring after 3.0 s", result.stderr)
        wait_until(lambda: self.status()["state"] == "inactive", DEADLINE_S, "the end of configuring")

    def test_a_refused_and_a_failed_transition_say_why(self):
        result = self.srfs("lifecycle", "faulty", "configure")
        self.assertEqual(result.returncode, 1)
        self.assertIn("refused 'configure' and is active: not possible in state active", result.stderr)
        self.assertEqual(self.srfs("lifecycle", "faulty", "deactivate").returncode, 0)
        self.assertEqual(self.srfs("param", "set", "faulty", "fault", "fail_activation").returncode, 0)
        result = self.srfs("lifecycle", "faulty", "activate")
        self.assertEqual(result.returncode, 1)
        self.assertIn("failed to 'activate' and is inactive: the fault that was asked for", result.stderr)
        self.assertEqual(self.status()["reason"], "the fault that was asked for")

    def test_a_node_whose_callback_throws_comes_up_again_in_the_same_process(self):
        before = self.status()
        for fault, failed in (("throw", 1), ("raise", 1)):
            self.assertEqual(self.srfs("param", "set", "faulty", "fault", fault).returncode, 0)
            wait_until(lambda: self.srfs("param", "get", "faulty", "fault").stdout == '"none"\n', DEADLINE_S, "the fault")
            wait_until(lambda: self.status()["state"] == "active", DEADLINE_S, "the node's return")
            after = self.status()
            self.assertEqual((after["pid"], after["incarnation"]), (before["pid"], before["incarnation"]))
            self.assertEqual(after["failed_callbacks"], failed)
        log = (self.var / "log" / "faulty.log").read_text()
        self.assertIn("timer work ended with an exception: the fault that was asked for", log)

    def test_statistics_name_the_callback_that_is_over_its_budget(self):
        self.assertEqual(self.srfs("param", "set", "faulty", "fault", "slow").returncode, 0)

        def over():
            callbacks = self.json("stats", "faulty")["callbacks"]
            work = [c for c in callbacks if c["name"] == "work"][0]
            return work["over_budget"] >= 3 and work

        wait_until(over, DEADLINE_S, "runs over budget")
        self.assertGreaterEqual(over()["max_us"], 30000)
        table = self.srfs("stats", "faulty").stdout
        self.assertIn("work", table)
        self.assertIn("/faulty/get_executor_statistics", table)

    def test_parameters_are_listed_described_changed_saved_and_cleared(self):
        self.assertEqual(self.json("param", "list", "faulty")["parameters"]["configure_ms"], 20)
        described = self.json("param", "describe", "faulty", "configure_ms")
        self.assertEqual(described["range"], {"from": 0, "to": 60000, "step": 10})
        all_described = {each["name"]: each for each in self.json("param", "describe", "faulty")["parameters"]}
        self.assertEqual({**all_described["configure_ms"], "ok": True}, described)
        self.assertEqual(all_described.keys(), self.json("param", "list", "faulty")["parameters"].keys())
        result = self.srfs("param", "set", "faulty", "configure_ms", "25")
        self.assertEqual(result.returncode, 1)
        self.assertIn("25 is not 0 plus a multiple of 10", result.stderr)
        self.assertEqual(self.srfs("param", "set", "faulty", "configure_ms", "many").returncode, 2)
        self.assertEqual(self.srfs("param", "set", "faulty", "window", "[3]").returncode, 1, "read-only")

        self.assertEqual(self.srfs("param", "set", "faulty", "configure_ms", "30").returncode, 0)
        self.assertEqual(self.json("param", "keep", "faulty")["stored"], ["configure_ms"])
        stored = self.srfs("param", "set", "faulty", "window", "[3, 4]", "--next-start")
        self.assertEqual(stored.returncode, 0, stored.stderr)
        self.restart()
        values = self.json("param", "list", "faulty")["parameters"]
        self.assertEqual((values["configure_ms"], values["window"]), (30, [3, 4]))

        self.assertEqual(self.json("param", "forget", "faulty")["stored"], [])
        self.restart()
        values = self.json("param", "list", "faulty")["parameters"]
        self.assertEqual((values["configure_ms"], values["window"]), (20, [1, 2]))

    def test_mistakes_have_their_own_exit_codes(self):
        self.assertEqual(self.srfs("stats", "nobody").returncode, 2)
        self.assertEqual(self.srfs("param", "get", "faulty", "nothing").returncode, 2)
        self.assertEqual(self.srfs("down").returncode, 0)
        self.assertEqual(self.srfs("stats", "faulty").returncode, 4)


if __name__ == "__main__":
    unittest.main()
