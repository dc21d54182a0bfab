# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The judgement of the measures of lib/ros, against made-up figures."""

import unittest

from srfs.measures import ros


def quantiles(p50, p99, top=None):
    return {"p50": p50, "p90": p99, "p99": p99, "max": top or p99, "samples": 100}


def latency(topic, service, raw=(100, 200)):
    return {"topic": {"srfs": {"one_way": quantiles(*topic)}, "raw": {"one_way": quantiles(*raw)}},
            "service": {"srfs": quantiles(*service), "raw": quantiles(*raw)}}


def cycles(**changes):
    return {"cycles": 1000, "lost_links": 0, "matched_counts_right_after_the_last": True, "leaked_files": [], "descriptors_more": [0, 0],
            "own_memory_growth_kb_in_1000": [3.0, -2.0], "fresh_client": {"srfs": quantiles(80, 200), "raw": quantiles(80, 200), "unanswered": 0},
            **changes}


def ring(**changes):
    return {"nodes": 9, "period_ms": 100, "ring_cpu_percent": 4.5, "raw_cpu_percent": 3.0, "ratio": 1.5, "cpu_percent_together": {"ring": 6.0, "raw": 4.5},
            "raw_requests": {"asked": 1000, "answered": 1000}, "heard": {"checks_answered_per_s": 90.0}, "nobody_died": True,
            "evidence": {"percent_together": 0.1}, **changes}


def missed(name, result):
    return [line["what"] for line in ros.verdicts({name: result}) if not line["met"]]


class JudgementTest(unittest.TestCase):
    def test_a_ratio_at_its_goal_is_met(self):
        self.assertEqual(missed("latency", latency((115, 260), (115, 260))), [])

    def test_a_slow_quantile_is_missed_alone(self):
        self.assertEqual(missed("latency", latency((120, 200), (100, 300))), ["topic, one way, p50, us", "service round trip, p99, us"])

    def test_under_load_the_goal_is_a_time(self):
        self.assertEqual(missed("latency_under_load", latency((900, 900, 6000), (1, 1))), ["topic, one way, max, us"])

    def test_what_was_skipped_is_not_judged(self):
        self.assertEqual(ros.verdicts({"latency_under_load": {"skipped": "stress-ng is missing"}}), [])

    def test_cycles_without_a_trace_are_met(self):
        self.assertEqual(missed("cycles", cycles()), [])

    def test_one_leaked_file_makes_the_run_unsound(self):
        result = cycles(leaked_files=["/dev/shm/fastrtps_x"])
        self.assertFalse(ros.is_sound({"verdicts": ros.verdicts({"cycles": result})}))

    def test_a_late_client_is_missed_and_leaves_the_run_sound(self):
        result = cycles(fresh_client={"srfs": quantiles(80, 400), "raw": quantiles(80, 200), "unanswered": 0})
        self.assertEqual(missed("cycles", result), ["fresh client answered, p99, ms"])
        self.assertTrue(ros.is_sound({"verdicts": ros.verdicts({"cycles": result})}))

    def test_a_ring_of_one_and_a_half_raw_requests_is_met_and_a_dearer_one_missed(self):
        self.assertEqual(missed("ring", ring()), [])
        self.assertEqual(missed("ring", ring(ratio=1.51)), ["checks of 9 nodes, one each 100 ms: CPU, % of one"])

    def test_evidence_that_costs_a_hundredth_of_a_core_is_missed(self):
        self.assertEqual(missed("ring", ring(evidence={"percent_together": 1.0})), ["evidence of who had a CPU, % of one"])

    def test_a_ring_or_a_peer_that_did_not_check_is_no_measure(self):
        for idle in ({"heard": {"checks_answered_per_s": 40.0}}, {"raw_requests": {"asked": 1000, "answered": 500}}):
            self.assertEqual(missed("ring", ring(**idle)), ["checks answered in a second"])

    def test_a_restart_makes_the_run_unsound(self):
        self.assertFalse(ros.is_sound({"verdicts": ros.verdicts({"ring": ring(nobody_died=False)})}))

    def test_a_survivor_that_grows_is_missed(self):
        self.assertEqual(missed("cycles", cycles(own_memory_growth_kb_in_1000=[0, 500])), ["own memory of a survivor, kB more in 1000"])


if __name__ == "__main__":
    unittest.main()
