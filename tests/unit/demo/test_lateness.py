"""The witness of the machine's lateness."""

import contextlib
import io
import pathlib
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT / "tools" / "demo"), str(ROOT / "tests" / "system")]

import lateness  # noqa: E402
import run_test  # noqa: E402


class LatenessTest(unittest.TestCase):
    def test_what_a_host_takes_is_the_eighth_of_the_times(self):
        self.assertEqual(lateness.cpu_times("cpu  100 20 30 400 5 6 7 32 9 1\ncpu0 1 2 3\n"), (32, 600))

    def test_an_old_kernel_tells_of_no_host(self):
        self.assertEqual(lateness.cpu_times("cpu  100 20 30 400 5 6 7\n"), (0, 568))

    def test_a_machine_had_time_when_the_witness_was_never_late_and_the_host_took_little(self):
        seen = {"wakeups": 1000, "late": 0, "longest_ms": 8.0, "stolen": 0.01}

        self.assertTrue(lateness.had_time(seen))
        self.assertFalse(lateness.had_time(seen | {"late": 1}))
        self.assertFalse(lateness.had_time(seen | {"stolen": 0.1}))

    @staticmethod
    def watched(times, ticks=()):
        """What the witness sees who falls asleep and wakes at these times, and reads these (stolen, all) ticks, (0, 0) when there is no more."""
        times, ticks, sleeps = iter(times), iter(ticks), iter([False] * (len(times) - 1) + [True])
        return lateness.watch(lambda: next(sleeps), lambda: next(times), lambda: next(ticks, (0, 0)))

    def test_only_what_is_late_counts_as_late(self):
        seen = self.watched([10.0, 10.006, 10.011, 10.061, 10.067])

        self.assertEqual((seen["wakeups"], seen["late"], seen["longest_ms"]), (4, 1, 45.0))
        self.assertEqual(seen["late_at"], [[10_011_000_000, 10_061_000_000]])

    def test_many_small_delays_in_a_row_are_noted_but_not_counted(self):
        seen = self.watched([10 + 0.012 * n for n in range(30)])  # each 7 ms too late

        self.assertEqual(seen["late"], 0)
        self.assertEqual(len(seen["late_at"]), 1)
        self.assertAlmostEqual((seen["late_at"][0][1] - seen["late_at"][0][0]) / 1e9, 0.324, 3)

    def test_what_the_host_took_of_any_cpu_is_noted_with_its_time(self):
        quiet = self.watched([10 + 0.005 * n for n in range(50)], [(5, 100), (6, 120), (7, 140), (7, 140)])
        self.assertEqual(quiet["late_at"], [], "one tick in 0.1 s is nothing")
        busy = self.watched([10 + 0.005 * n for n in range(50)], [(5, 100), (5, 120), (8, 140), (8, 140)])
        self.assertEqual([[round(at / 1e9, 1) for at in interval] for interval in busy["late_at"]], [[10.1, 10.2]])
        self.assertEqual((busy["late"], busy["stolen"]), (0, 0.075))

    def test_the_witness_ends_with_its_report(self):
        with lateness.Lateness() as witness:
            started = witness._process.pid

        self.assertEqual(witness.end(), witness.end())
        self.assertFalse(pathlib.Path(f"/proc/{started}").exists())

    def test_a_witness_that_died_has_seen_nothing_and_excuses_nothing(self):
        witness = lateness.Lateness()
        witness._process.kill()

        self.assertEqual(witness.end()["wakeups"], 0)
        self.assertTrue(lateness.had_time(witness.end()))
        self.assertIn("unknown", lateness.describe_lateness(witness.end()))


class RepeatTest(unittest.TestCase):
    IN_TIME = {"wakeups": 1000, "late": 0, "longest_ms": 8.0, "stolen": 0.01}
    LATE = IN_TIME | {"late": 3}

    def judged(self, *runs):
        """(exit code, how many runs were made, whether a repetition was said) of a test whose runs end like these."""
        left = list(runs)
        with contextlib.redirect_stderr(io.StringIO()) as said:
            code = run_test.main("a.Test", lambda name: left.pop(0))
        return code, len(runs) - len(left), "\nrepeated for the machine's lateness: a.Test" in said.getvalue()

    def test_what_passes_runs_once_also_on_a_late_machine(self):
        self.assertEqual(self.judged((True, self.LATE), (True, self.LATE)), (0, 1, False))

    def test_a_failure_on_a_machine_that_had_time_counts(self):
        self.assertEqual(self.judged((False, self.IN_TIME), (True, self.IN_TIME)), (1, 1, False))

    def test_a_failure_on_a_late_machine_is_repeated_once_and_said(self):
        self.assertEqual(self.judged((False, self.LATE), (True, self.LATE)), (0, 2, True))
        self.assertEqual(self.judged((False, self.LATE), (False, self.LATE), (True, self.LATE)), (1, 2, True))


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
