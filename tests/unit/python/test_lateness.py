# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""python/srfs/flight/lateness.py, the witness that measures how late the machine is."""

import contextlib
import io
import os
import pathlib
import subprocess
import sys
import tempfile
import time
import unittest

from srfs import run_test
from srfs.flight import lateness


class LatenessTest(unittest.TestCase):
    def test_what_a_host_takes_is_the_eighth_of_the_times(self):
        self.assertEqual(lateness.cpu_times("cpu  100 20 30 400 5 6 7 32 9 1\ncpu0 1 2 3\n"), (32, 600))

    def test_an_old_kernel_tells_of_no_host(self):
        self.assertEqual(lateness.cpu_times("cpu  100 20 30 400 5 6 7\n"), (0, 568))

    @staticmethod
    def watched(times, ticks=()):
        """The result of a witness that falls asleep and wakes at these times, and reads these (stolen, all) ticks and then (0, 0)."""
        times, ticks, sleeps = iter(times), iter(ticks), iter([False] * (len(times) - 1) + [True])
        return lateness.watch(lambda: next(sleeps), lambda: next(times), lambda: next(ticks, (0, 0)))

    def test_only_what_is_late_counts_as_late(self):
        seen = self.watched([10.0, 10.006, 10.011, 10.061, 10.067])

        self.assertEqual((seen["wakeups"], seen["late"], seen["longest_ms"]), (4, 1, 45.0))
        self.assertEqual(seen["late_at"], [[10_011_000_000, 10_061_000_000]])

    def test_what_it_waited_for_a_cpu_that_another_had_is_not_late(self):
        times, waited, sleeps = iter([10.0, 10.11, 10.2]), iter([1.0, 1.104, 1.105]), iter([False, False, True])
        seen = lateness.watch(lambda: next(sleeps), lambda: next(times), lambda: (0, 0), lambda: next(waited))

        self.assertEqual(seen["late_at"], [[10_110_000_000, 10_200_000_000]])

    def test_many_small_delays_in_a_row_are_noted_but_not_counted(self):
        seen = self.watched([10 + 0.012 * n for n in range(30)])  # each wake-up 7 ms late

        self.assertEqual(seen["late"], 0)
        self.assertEqual(len(seen["late_at"]), 1)
        self.assertAlmostEqual((seen["late_at"][0][1] - seen["late_at"][0][0]) / 1e9, 0.324, 3)

    def test_what_the_host_took_of_any_cpu_is_noted_with_its_time(self):
        quiet = self.watched([10 + 0.005 * n for n in range(50)], [(5, 100), (6, 120), (7, 140), (7, 140)])
        self.assertEqual(quiet["late_at"], [], "one tick in 0.1 s is nothing")
        busy = self.watched([10 + 0.005 * n for n in range(50)], [(5, 100), (5, 120), (8, 140), (8, 140)])
        self.assertEqual([[round(at / 1e9, 1) for at in interval] for interval in busy["late_at"]], [[10.1, 10.2]])
        self.assertEqual((busy["late"], busy["stolen"]), (0, 0.075))

    def test_what_was_late_on_any_cpu_is_noted_once(self):
        on_one = self.watched([10.0, 10.006, 10.056, 10.061])
        on_another = self.watched([10.0, 10.030, 10.035, 10.2])
        seen = lateness.merged([on_one, on_another])

        self.assertEqual((seen["wakeups"], seen["late"], seen["longest_ms"]), (6, 2, 160.0))
        self.assertEqual([[round(at / 1e6) for at in interval] for interval in seen["late_at"]], [[10000, 10200]])

    def test_the_witness_sleeps_on_each_cpu(self):
        with lateness.Lateness() as witness:
            threads = pathlib.Path(f"/proc/{witness._process.pid}/task")
            allowed = lambda: {frozenset(os.sched_getaffinity(int(thread.name))) for thread in threads.iterdir()}  # noqa: E731
            end = time.monotonic() + 30
            while not {frozenset({cpu}) for cpu in os.sched_getaffinity(0)} <= allowed() and time.monotonic() < end:
                time.sleep(0.01)
            self.assertLessEqual({frozenset({cpu}) for cpu in os.sched_getaffinity(0)}, allowed())

    def test_the_witness_ends_with_its_report(self):
        with lateness.Lateness() as witness:
            started = witness._process.pid

        self.assertEqual(witness.end(), witness.end())
        self.assertFalse(pathlib.Path(f"/proc/{started}").exists())

    def test_a_witness_that_died_has_seen_nothing_and_excuses_nothing(self):
        witness = lateness.Lateness()
        witness._process.kill()

        self.assertEqual(witness.end()["wakeups"], 0)
        self.assertEqual(witness.end()["late_at"], [])
        self.assertIn("unknown", lateness.describe_lateness(witness.end()))


class WaitingTest(unittest.TestCase):
    SEEN = {"ttc": {"waited_s": 0.35, "waits": [[100, 200, 50], [300, 400, 100]]}, "timing": {"waited_s": 0.0, "waits": []}}

    def test_what_a_process_waited_between_two_times(self):
        self.assertEqual(lateness.waited_ns(self.SEEN, ["ttc", "timing", "unknown"], 0, 1000), 150)
        self.assertEqual(lateness.waited_ns(self.SEEN, ["ttc"], 190, 310), 20, "no more than lies in between")
        self.assertEqual(lateness.waited_ns(self.SEEN, ["ttc"], 200, 300), 0)
        self.assertEqual(lateness.waited_ns({}, ["ttc"], 0, 1000), 0, "without evidence nothing is excused")

    def test_processes_of_a_suite_are_known_by_their_command_line(self):
        for words, name in (("/b/ttc_node --name ttc --var /tmp/v", "ttc"), ("/b/hw_sim --var /tmp/v", "hw_sim"), ("/b/srfs-ground --port /tmp/v/rs422", "srfs-ground"),
                            ("/usr/bin/python3 demo.py --var /tmp/v", None), ("/b/ttc_node --name ttc --var /tmp/v2", None), ("", None)):  # fmt: skip
            self.assertEqual(lateness.name_of(words.split(), "/tmp/v"), name, words)

    def test_processes_that_share_one_cpu_wait_for_it(self):
        spin = [sys.executable, "-S", "-c", "import os\nos.sched_setaffinity(0, {min(os.sched_getaffinity(0))})\nwhile True: pass"]
        spinning = [subprocess.Popen(spin) for _ in range(2)]
        try:
            process = lateness.ProcessWait(spinning[0].pid)
            if process.read(time.monotonic_ns()) is None:
                self.skipTest("this kernel does not tell")
            waited = 0
            end = time.monotonic() + 30
            while waited < 200_000_000 and time.monotonic() < end:
                time.sleep(0.05)
                waited += process.read(time.monotonic_ns())
            self.assertGreaterEqual(waited, 200_000_000)
        finally:
            for one in spinning:
                one.kill()
                one.wait()
        self.assertIsNone(process.read(time.monotonic_ns()), "it has ended")
        process.close()

    def test_the_witness_sees_the_processes_of_the_suite(self):
        with tempfile.TemporaryDirectory() as var:
            process = subprocess.Popen(["sh", "-c", "read line", "--name", "x", "--var", var], stdin=subprocess.PIPE)
            with lateness.Waiting(var) as witness:
                time.sleep(0.5)
            process.communicate(b"\n")
        self.assertEqual(list(witness.end()), ["x"])


class VerdictTest(unittest.TestCase):
    LATE = {"wakeups": 1000, "late": 3, "longest_ms": 80.0, "stolen": 0.01}

    def judged(self, passed):
        """(exit code, number of runs, standard error) of a test on a late machine."""
        runs = []
        with contextlib.redirect_stderr(io.StringIO()) as said:
            code = run_test.main("a.Test", lambda name: runs.append(name) or (passed, self.LATE))
        return code, len(runs), said.getvalue()

    def test_a_class_runs_once_and_a_failure_counts_also_on_a_late_machine(self):
        self.assertEqual(self.judged(True)[:2], (0, 1))
        self.assertEqual(self.judged(False)[:2], (1, 1))

    def test_what_the_witness_saw_is_said(self):
        self.assertIn("witness: this machine was more than 20 ms late 3 times", self.judged(False)[2])


class TellingTest(unittest.TestCase):
    def test_a_failure_is_told_before_what_the_test_prints_at_its_end(self):
        class Failing(unittest.TestCase):
            def runTest(self):
                self.addCleanup(lambda: print("the logs", file=out))
                self.fail("the reason")

        out = io.StringIO()
        unittest.TextTestRunner(stream=out, resultclass=run_test.TellingResult).run(Failing())

        self.assertLess(out.getvalue().index("the reason"), out.getvalue().index("the logs"))


if __name__ == "__main__":
    unittest.main()
