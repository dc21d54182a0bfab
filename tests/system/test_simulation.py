# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""./run sim: start, operation and stop; two at a time on one machine; a start after it was killed."""

import os
import re
import signal
import subprocess
import threading
import unittest

from support import BIN, DEADLINE_S, PROGRAM, SystemTest

from srfs.flight.processes import lock_owner, processes_of, wait_until
from srfs.program import MissionError


class Sim:
    """A running ./run sim and its output so far."""

    def __init__(self, var, *options, before=None):
        self.process = subprocess.Popen(
            [*PROGRAM, "srfs.sim", "--bin", str(BIN), "--var", str(var), *map(str, options)],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, preexec_fn=before,
        )  # fmt: skip
        self.said = ""
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self):
        for line in self.process.stdout:
            self.said += line

    def says(self, pattern, deadline_s=DEADLINE_S):
        """Waits for a regular expression in its output."""
        try:
            wait_until(lambda: re.search(pattern, self.said) or self.process.poll() is not None, deadline_s, f"'{pattern}'")
        except MissionError as error:
            raise AssertionError(f"{error}; said:\n{self.said}") from error
        if not re.search(pattern, self.said):
            raise AssertionError(f"ended without saying '{pattern}':\n{self.said}")

    def domain(self):
        return int(re.search(r"DDS domain (\d+)", self.said).group(1))

    def ends(self):
        code = self.process.wait(DEADLINE_S)
        self._thread.join(5)
        self.process.stdout.close()
        return code

    def stop(self, number=signal.SIGTERM):
        self.process.send_signal(number)
        return self.ends()


def ping(var):
    return subprocess.run([BIN / "srfs-ground", "--port", var / "rs422", "ping", "--timeout", "10"], capture_output=True, text=True).returncode


class SimulationTest(SystemTest):
    def test_stays_up_until_a_signal_and_leaves_nothing_behind(self):
        for number in (signal.SIGINT, signal.SIGTERM):
            with self.subTest(signal=number.name):
                sim = Sim(self.var)
                sim.says("Ctrl-C ends it")
                self.assertEqual(ping(self.var), 0)

                self.assertEqual(sim.stop(number), 0, sim.said)
                self.assert_nothing_left(self.var)

    def test_two_run_side_by_side_and_a_second_in_the_same_folder_is_refused(self):
        other_var = self.folder / "other"
        first, second = Sim(self.var), Sim(other_var)
        first.says("Ctrl-C ends it")
        second.says("Ctrl-C ends it")
        self.assertNotEqual(first.domain(), second.domain())

        refused = Sim(self.var)
        self.assertEqual(refused.ends(), 2)
        self.assertIn(f"{self.var} is in use by a running simulation (pid {first.process.pid})", refused.said)

        self.assertEqual(ping(self.var), 0)
        self.assertEqual(ping(other_var), 0)
        self.assertEqual(first.stop(), 0, first.said)
        self.assertEqual(ping(other_var), 0, "the end of one does not touch the other")
        self.assertEqual(second.stop(), 0, second.said)
        self.assert_nothing_left(self.var)
        self.assert_nothing_left(other_var)

    def test_says_when_a_node_or_the_spacecraft_is_killed(self):
        sim = Sim(self.var)
        sim.says("Ctrl-C ends it")
        pid = lock_owner(self.var / "run" / "payload_thermal.lock")
        os.kill(pid, signal.SIGKILL)
        wait_until(lambda: f"payload_thermal (pid {pid}) is gone" in sim.said or "payload_thermal was restarted" in sim.said, DEADLINE_S,
                   f"word of its end in:\n{sim.said}")  # fmt: skip

        os.kill(int((self.var / "run" / "hw_sim.pid").read_text()), signal.SIGKILL)
        sim.says("the simulated spacecraft killed by signal 9")
        self.assertEqual(sim.ends(), 1)
        self.assertEqual(processes_of(self.var), {})


class OrphansTest(SystemTest):
    def test_what_a_killed_simulation_left_is_ended_before_a_new_one_starts(self):
        killed = Sim(self.var)
        killed.says("Ctrl-C ends it")
        killed.stop(signal.SIGKILL)
        orphans = processes_of(self.var)
        self.assertIn("hw_sim", orphans.values())
        self.assertIn("ttc_node", orphans.values())

        sim = Sim(self.var)
        sim.says("was killed; ending what it left")
        sim.says("Ctrl-C ends it")
        self.assertEqual(set(orphans) & set(processes_of(self.var)), set())
        self.assertEqual(ping(self.var), 0)
        self.assertEqual(sim.stop(), 0, sim.said)
        self.assert_nothing_left(self.var)


if __name__ == "__main__":
    unittest.main()
