# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The judgement of Fig. 13, and the deployment of the experiment."""

import pathlib
import tempfile
import unittest

from srfs.experiments import fig13
from srfs.flight import deployments


def phase(latencies_ms, **changes):
    said = {"topics": {"tick": {"samples": len(latencies_ms)}}, "lost": 0, "malformed": 0, "clock_moved_us": 0.3}
    return {**fig13.spread(latencies_ms), **said, **changes}


def failed(latencies_ms, realtime_kernel=False, **changes):
    return [c["what"] for c in fig13.judge_phase("imaging", phase(latencies_ms, **changes), realtime_kernel) if not c["ok"]]


class JudgementTest(unittest.TestCase):
    def test_some_milliseconds_pass(self):
        self.assertEqual(failed([0.1] * 99 + [19.9]), [])

    def test_a_realtime_kernel_owes_all_below_twenty_milliseconds_another_all_but_one_in_a_thousand(self):
        self.assertEqual(len(failed([0.1] * 999 + [20.1], realtime_kernel=True)), 1)
        self.assertEqual(failed([0.1] * 999 + [20.1]), [])
        self.assertEqual(len(failed([0.1] * 998 + [20.1] * 2)), 1)

    def test_more_than_one_in_a_hundred_later_than_ten_milliseconds_is_not_rare(self):
        self.assertEqual(len(failed([0.1] * 98 + [11.0] * 2)), 1)

    def test_a_silent_topic_a_lost_sample_and_a_step_of_the_clock_fail(self):
        self.assertIn("but not tick", failed([0.1] * 100, topics={"tick": {"samples": 0}})[0])
        self.assertEqual(len(failed([0.1] * 100, lost=1)), 1)
        self.assertEqual(len(failed([0.1] * 100, clock_moved_us=-5000.0)), 1)

    def test_nothing_heard_fails_and_misses_the_goals(self):
        self.assertTrue(failed([]))
        self.assertFalse(any(goal["met"] for goal in fig13.judge_goals({"idle": phase([])})))

    def test_a_goal_is_met_at_its_value(self):
        met = {goal["what"]: goal["met"] for goal in fig13.judge_goals({"idle": phase([0.15] * 100 + [5.1])})}
        self.assertEqual(met, {"p50": True, "p99": True, "max": False})


class TopicsTest(unittest.TestCase):
    def test_the_topics_of_the_payloads_count_together(self):
        self.assertEqual(fig13.group("/payload_eps/activity"), fig13.group("/payload_adcs/activity"))
        self.assertEqual(fig13.group("/can/bus_status"), "bus status")


class DeploymentTest(unittest.TestCase):
    def test_housekeeping_is_real_time_and_the_image_lane_has_one_cpu(self):
        for deployment in ("sim", "sim_open"):  # the second extends the first
            with tempfile.TemporaryDirectory() as folder:
                varied = deployments.read(fig13.Fig13.varied(deployment, pathlib.Path(folder)))
            scheduling = {node["name"]: node["scheduling"] for node in varied["nodes"]}
            self.assertEqual((scheduling["timing"]["policy"], scheduling["timing"]["priority"]), ("fifo", 50))
            self.assertTrue(scheduling["image_processing"]["background"])
            self.assertEqual(len(scheduling["image_processing"]["cpus"]), 1)
            self.assertEqual(scheduling["maintenance"]["policy"], "other")


if __name__ == "__main__":
    unittest.main()
