"""The restart cycles of the benchmark in a short form: conditions only, no times."""

import argparse
import unittest

from support import BIN

import ros_measures


class RestartCyclesTest(unittest.TestCase):
    def test_a_node_killed_and_restarted_finds_all_survivors_again_and_leaves_nothing_behind(self):
        parser = argparse.ArgumentParser()
        ros_measures.add_options(parser)
        options = parser.parse_args(["--only", "cycles", "--cycles", "10"])

        results = ros_measures.measure(BIN, options, print)

        hard = {line["what"]: line["value"] for line in results["verdicts"] if line["hard"]}
        self.assertEqual(hard, {"lost links in 10 cycles": 0, "matched counts right afterwards": "yes", "leaked files": 0,
                                "more descriptors in a survivor": 0, "fresh clients never answered": 0})


if __name__ == "__main__":
    unittest.main()
