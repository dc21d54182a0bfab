# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""A simulation that ends by itself leaves nothing behind, not even nodes that are just being restarted."""

import os
import pathlib
import tempfile
import time
import unittest

from srfs.flight import mission
from srfs.flight.processes import command_line, end_processes, processes_of, wait_until

# A node that gets SIGTERM while it restarts others: each starts another one, LEFT times.
NODE = """#!/bin/sh
left=$5
trap 'if [ "$left" -gt 0 ]; then setsid "$0" "$1" "$2" "$3" "$4" $((left - 1)) & fi; exit 0' TERM
echo ready >> "$2/log/ready"
while :; do sleep 0.05; done
"""


class EndTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.var = pathlib.Path(folder.name) / "var"
        for name in ("run", "log", "versions/eps"):
            (self.var / name).mkdir(parents=True)
        self.node = self.var / "versions/eps/eps_node"
        self.node.write_text(NODE)
        self.node.chmod(0o755)
        self.flight = mission.Mission(self.var, "sim")
        self.addCleanup(lambda: end_processes(processes_of(self.var)))

    def start_node(self, left):
        ready = self.var / "log/ready"
        os.posix_spawn("/bin/sh", ["/bin/sh", str(self.node), "--var", str(self.var), "--name", "eps", str(left)], os.environ, setsid=True)
        wait_until(ready.exists, 20, "the node runs")

    def running(self):
        """{pid: program} of the nodes. They are scripts, so the word after the interpreter identifies them."""
        found = {}
        for entry in pathlib.Path("/proc").glob("[0-9]*"):
            words = command_line(entry.name)
            if len(words) > 1 and words[1] == str(self.node):
                found[int(entry.name)] = "eps_node"
        return found

    def test_a_node_that_was_starting_another_leaves_none(self):
        self.start_node(2)
        rounds = []
        for found, _ in self.flight._end_rounds(self.running):
            rounds.append(len(found))
            time.sleep(0.2)  # the process that it started runs by then
        self.assertEqual(self.running(), {})
        self.assertEqual(len(rounds), 3)
        self.assertTrue((self.var / "run/stopping").exists(), "nobody begins a restart")

    def test_one_that_always_leaves_another_does_not_keep_it_for_ever(self):
        self.start_node(1000)
        rounds = 0
        for _ in self.flight._end_rounds(self.running):
            rounds += 1
            time.sleep(0.2)
        self.assertEqual(rounds, mission.MOST_ROUNDS)
        for pid in self.running():
            os.kill(pid, 9)


if __name__ == "__main__":
    unittest.main()
