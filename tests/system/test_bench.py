# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Short runs of the benchmarks: checks conditions, not times."""

import argparse
import json
import subprocess
import unittest

from support import BIN

from srfs.measures import ros


class RestartCyclesTest(unittest.TestCase):
    def test_a_node_killed_and_restarted_finds_all_survivors_again_and_leaves_nothing_behind(self):
        parser = argparse.ArgumentParser()
        ros.add_options(parser)
        options = parser.parse_args(["--only", "cycles", "--cycles", "10"])

        results = ros.measure(BIN, options, print)

        hard = {line["what"]: line["value"] for line in results["verdicts"] if line["hard"]}
        self.assertEqual(hard, {"lost links in 10 cycles": 0, "matched counts right afterwards": "yes", "leaked files": 0,
                                "more descriptors in a survivor": 0, "fresh clients never answered": 0})


class IsoTpThroughputTest(unittest.TestCase):
    def test_every_message_arrives_and_the_bus_carries_no_more_than_the_ideal(self):
        # Eight frames after each flow control, and time-outs that a busy machine does not reach.
        run = subprocess.run([BIN / "bench_can", "isotp", "--messages", "3", "--block-size", "8", "--timeout-ms", "20000"],
                             capture_output=True, text=True, timeout=120)
        self.assertEqual(run.returncode, 0, run.stderr)

        found = json.loads(run.stdout)
        self.assertEqual((found["messages"], found["failed"], found["receiver"]), (3, 0, {"right": 3, "wrong": 0, "failed": 0}))
        self.assertEqual(found["most_frames_waiting"], 8, "the sender keeps a block ahead of its echoes")
        self.assertGreater(found["payload_octets_per_s"], 0)
        self.assertLessEqual(found["ratio"], 1)
        self.assertAlmostEqual(found["ratio"], found["bus_busy_share"], places=3, msg="what the bus itself counted")
        # 585 consecutive frames of at least 128 + 3 bits: the rate stays below the limit without stuff bits.
        self.assertLess(found["ideal_octets_per_s"], 4095 * 500e3 / (586 * 131))
        self.assertTrue(0 < found["stuff_share"] < 0.19, found["stuff_share"])


if __name__ == "__main__":
    unittest.main()
