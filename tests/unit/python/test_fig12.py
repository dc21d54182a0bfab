# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The judgement of Fig. 12, and the CPU frequency that is locked and restored."""

import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest

from srfs.experiments import fig12
from srfs.flight import machine

SAID = """# /dev/cpu_dma_latency set to 0us
# Histogram
000000 000000\t000000
000001 000900\t000100
000002 000090\t000890
000600 000010\t000000
# Total: 000001000 000000990
# Min Latencies: 00001 00001
# Avg Latencies: 00001 00002
# Max Latencies: 00600 25000
# Histogram Overflows: 00000 00010
# Histogram Overflow at cycle number:
# Thread 0:
# Thread 1: 12 13
"""


class HistogramTest(unittest.TestCase):
    def setUp(self):
        self.found = fig12.parse_histogram(SAID)

    def test_counts_of_each_thread_are_read(self):
        self.assertEqual(self.found["counts"], [{1: 900, 2: 90, 600: 10}, {1: 100, 2: 890}])
        self.assertEqual(self.found["later"], [0, 10])
        self.assertEqual(self.found["max_us"], [600, 25000])

    def test_what_lies_past_the_histogram_counts(self):
        summary = fig12.summarize(self.found)
        self.assertEqual((summary["wakeups"], summary["p50_us"], summary["max_us"]), (2000, 2, 25000))
        self.assertEqual(summary["later_than_500_us"], 20)
        self.assertIsNone(summary["p99_9_us"], "it is one of those past the histogram")

    def test_nothing_recorded_is_no_quantile_and_fails(self):
        summary = fig12.summarize(fig12.parse_histogram(""))
        self.assertEqual((summary["wakeups"], summary["p50_us"], summary["max_us"]), (0, None, None))
        self.assertFalse(all(c["ok"] for c in fig12.judge_phase("idle", summary, 1000, False)))


class JudgementTest(unittest.TestCase):
    def failed(self, realtime=False, **changes):
        phase = {"wakeups": 2000, "later_than_500_us": 20, "max_us": 600, **changes}
        return [c["what"] for c in fig12.judge_phase("idle", phase, 2000, realtime) if not c["ok"]]

    def test_one_late_wake_up_in_a_hundred_is_the_limit(self):
        self.assertEqual(self.failed(), [])
        self.assertEqual(len(self.failed(later_than_500_us=21)), 1)

    def test_missing_wake_ups_fail(self):
        self.assertEqual(len(self.failed(wakeups=1000, later_than_500_us=0)), 1)

    def test_only_a_realtime_kernel_owes_a_maximum(self):
        self.assertEqual(len(self.failed(realtime=True)), 1)
        self.assertEqual(self.failed(realtime=True, max_us=336), [])


class PreemptionTest(unittest.TestCase):
    def test_a_realtime_kernel_says_so_itself(self):
        self.assertEqual(machine.preemption("#1 SMP PREEMPT_RT Debian 6.1", None, None, None, None), "PREEMPT_RT")
        self.assertEqual(machine.preemption("#1 SMP PREEMPT RT", "1", None, None, None), "PREEMPT_RT")

    def test_the_dynamic_mode_is_that_of_now_then_of_the_command_line_then_of_the_configuration(self):
        version, configuration = "#1 SMP PREEMPT_DYNAMIC Debian 6.1", "CONFIG_PREEMPT_BUILD=y\nCONFIG_PREEMPT_NONE=y\n"
        self.assertEqual(machine.preemption(version, None, "none voluntary (full)", configuration, "preempt=voluntary"), "PREEMPT_DYNAMIC (full)")
        self.assertEqual(machine.preemption(version, None, None, configuration, "quiet preempt=voluntary"), "PREEMPT_DYNAMIC (voluntary)")
        self.assertEqual(machine.preemption(version, None, None, configuration, "quiet"), "PREEMPT_DYNAMIC (none)")
        self.assertEqual(machine.preemption(version, None, None, None, None), "PREEMPT_DYNAMIC (mode unknown)")


class LockedFrequencyTest(unittest.TestCase):
    BEFORE = {"scaling_governor": "schedutil", "scaling_min_freq": "408000", "scaling_max_freq": "1800000"}
    FIXED = {"scaling_available_governors": "performance schedutil", "cpuinfo_max_freq": "1992000"}

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.cpus = pathlib.Path(folder.name)

    def make(self, **changes):
        for cpu in ("cpu0", "cpu1"):
            (self.cpus / cpu / "cpufreq").mkdir(parents=True)
            for name, value in {**self.BEFORE, **self.FIXED, **changes}.items():
                (self.cpus / cpu / "cpufreq" / name).write_text(value)

    def values(self):
        return [{name: (self.cpus / cpu / "cpufreq" / name).read_text() for name in self.BEFORE} for cpu in ("cpu0", "cpu1")]

    def test_it_is_locked_inside_and_put_back_outside(self):
        self.make()
        with fig12.LockedFrequency(self.cpus):
            locked = {"scaling_governor": "performance", "scaling_min_freq": "1992000", "scaling_max_freq": "1992000"}
            self.assertEqual(self.values(), [locked] * 2)
        self.assertEqual(self.values(), [self.BEFORE] * 2)

    def test_it_is_put_back_when_the_experiment_is_killed(self):
        self.make()
        program = f"import pathlib, sys; from srfs.experiments import fig12\nwith fig12.LockedFrequency(pathlib.Path({str(self.cpus)!r})):\n print('locked', flush=True); sys.stdin.read()"
        with subprocess.Popen([sys.executable, "-B", "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as run:
            run.stdout.readline()
            self.assertNotEqual(self.values(), [self.BEFORE] * 2)
            os.kill(run.pid, signal.SIGKILL)
        deadline = time.monotonic() + 10
        while self.values() != [self.BEFORE] * 2 and time.monotonic() < deadline:
            time.sleep(0.01)
        self.assertEqual(self.values(), [self.BEFORE] * 2)

    def test_a_machine_without_it_is_told_of(self):
        with self.assertRaisesRegex(fig12.NotPossible, "no frequency scaling"), fig12.LockedFrequency(self.cpus):
            pass

    def test_a_governor_that_is_missing_changes_nothing(self):
        self.make(scaling_available_governors="powersave")
        with self.assertRaisesRegex(fig12.NotPossible, "performance"), fig12.LockedFrequency(self.cpus):
            pass
        self.assertEqual(self.values(), [self.BEFORE] * 2)


if __name__ == "__main__":
    unittest.main()
