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

    def test_only_what_is_late_counts_as_late(self):
        times = iter([10.0, 10.006, 10.011, 10.061, 10.067])  # asleep, and four times awake
        sleeps = iter([False, False, False, False, True])

        seen = lateness.watch(lambda: next(sleeps), lambda: next(times))

        self.assertEqual((seen["wakeups"], seen["late"], seen["longest_ms"]), (4, 1, 45.0))

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


if __name__ == "__main__":
    unittest.main()
