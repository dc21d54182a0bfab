# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Several callers start and end the same suite at the same time: one start wins, an end is complete."""

import collections
import os
import pathlib
import re
import signal
import subprocess
import unittest

from support import BIN, DEADLINE_S, SystemTest, ToolTest
from test_simulation import Sim, ping

from srfs.flight import mission
from srfs.flight.processes import lock_owner, processes_of, wait_until

ROUNDS = 4
MOST_QUOTA_S = 300


class StartsTest(SystemTest):
    def srfs(self, flight, *words):
        command = [BIN / "srfs", *words, "--deployment", flight.deployment, "--var", flight.var]
        return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    def test_two_ups_and_the_ring_start_each_node_once_and_all_succeed(self):
        with self.flight() as flight:
            for _ in range(ROUNDS):
                for node in ("ttc", "payload_eps"):
                    os.kill(flight.node_pid(node), signal.SIGKILL)
                ups = [self.srfs(flight, "up", "--deadline", "30") for _ in range(2)]
                for up in ups:
                    said, _ = up.communicate(timeout=2 * DEADLINE_S)
                    self.assertEqual(up.returncode, 0, said)
                programs = collections.Counter(processes_of(flight.var).values())
                self.assertEqual({program: count for program, count in programs.items() if count != 1}, {}, "each once")
            for log in (flight.var / "log").glob("*.log"):
                self.assertNotIn("is already running as pid", log.read_text(errors="replace"), log.name)

    def test_a_suite_is_the_same_by_whatever_path_its_folder_is_named(self):
        with self.flight() as flight:
            pids = {node: flight.node_pid(node) for node in ("ttc", "payload_eps")}
            link = self.folder / "link"
            link.symlink_to(self.var)
            for var in (link, f"{self.var}/"):
                up = subprocess.run([BIN / "srfs", "up", "--deployment", str(flight.deployment), "--var", str(var)], stdin=subprocess.DEVNULL,
                                    capture_output=True, text=True, timeout=60)  # fmt: skip
                self.assertEqual(up.returncode, 0, up.stderr)
            self.assertEqual({node: flight.node_pid(node) for node in pids}, pids)

    @staticmethod
    def may_be_ahead():
        """Whether a new session of this user may have a negative niceness."""
        tried = subprocess.run(["/bin/sh", "-c", "echo -8 > /proc/self/autogroup"], start_new_session=True, stderr=subprocess.DEVNULL)
        return tried.returncode == 0

    def test_a_node_has_its_weight_against_other_programs_once_it_has_started(self):
        with self.flight() as flight:
            ahead = -8 if self.may_be_ahead() else 0
            for node, niceness in {"ttc": ahead, "payload_eps": ahead, "image_processing": 10}.items():
                session = pathlib.Path(f"/proc/{flight.node_pid(node)}/autogroup")
                if not session.exists():
                    self.skipTest("this kernel does not share its CPUs among sessions")
                wait_until(lambda: session.read_text().endswith(f" nice {niceness}\n"), DEADLINE_S, f"the session of {node} has niceness {niceness}")

    def test_a_late_restart_by_the_watchdog_does_not_start_what_was_stopped(self):
        with self.flight() as flight:
            self.assertEqual(flight.srfs("down").returncode, 0)
            late = self.srfs(flight, "restart", "--if-up")
            said, _ = late.communicate(timeout=DEADLINE_S)
            self.assertEqual(late.returncode, 0, said)
            self.assertIn("the suite was stopped meanwhile", said)
            self.assertEqual(set(processes_of(flight.var).values()), {"hw_sim"})

    def test_a_simulation_that_ends_by_itself_leaves_none_that_the_ring_restarted(self):
        sim = Sim(self.var)
        sim.says("Ctrl-C ends it")
        pids = {node: lock_owner(self.var / "run" / f"{node}.lock") for node in ("payload_eps", "ttc", "maintenance")}
        os.kill(int((self.var / "run" / "hw_sim.pid").read_text()), signal.SIGKILL)
        for pid in pids.values():
            os.kill(pid, signal.SIGKILL)  # the ring restarts nodes while the suite is being ended
        self.assertEqual(sim.ends(), 1)
        self.assertEqual(processes_of(self.var), {})
        wait_until(lambda: not mission.memory_folder(self.var).exists(), DEADLINE_S, "nothing is left in memory")


class WithoutTheImageLaneTest(SystemTest):
    def test_flight_begins_without_a_node_that_it_does_not_need_and_says_when_it_has_come(self):
        release, late = self.folder / "release", self.folder / "late_node"
        late.write_text(f'#!/bin/sh\nwhile [ ! -e {release} ]; do sleep 0.1; done\nexec {BIN}/image_processing_node "$@"\n')
        late.chmod(0o755)
        sim = Sim(self.var, "--deployment", self.deployment(("executable: image_processing_node", f"executable: {late}"),
                                                            ("ring:", "ring:\n  restarts: 1000\n  quarantine_deaths: 1000")))  # fmt: skip
        sim.says(r"still starting, not needed for flight: (.*, )?image_processing\n")
        sim.says("Ctrl-C ends it")
        self.assertEqual(ping(self.var), 0, sim.said)
        release.touch()
        sim.says("image_processing has come: all nodes are up")
        self.assertEqual(sim.stop(), 0, sim.said)
        self.assert_nothing_left(self.var)


class GivenUpTest(ToolTest):
    def test_a_start_without_progress_names_the_node_the_load_and_what_to_do(self):
        sleeper = self.folder / "sleeper_node"
        sleeper.write_text("#!/bin/sh\nexec sleep 1000\n")
        sleeper.chmod(0o755)
        self.file = self.folder / "t.yaml"
        self.file.write_text(f"""
deployment: t
nodes:
  - {{ name: comes, executable: faulty_node, parameters: {{ configure_ms: 20 }} }}
  - {{ name: sleeps, executable: {sleeper} }}
""")
        self.var.mkdir()
        self.addCleanup(lambda: self.srfs("down"))
        up = self.srfs("up", "--deadline", "10")
        said = up.stdout + up.stderr
        self.assertNotEqual(up.returncode, 0, said)
        self.assertRegex(said, r"sleeps is (loading|not running) instead of active")
        self.assertNotIn("comes is", said)
        self.assertIn("gave up after", said)
        self.assertIn("load average", said)
        self.assertIn("`srfs up` starts only what is missing", said)


class QuotaTest(SystemTest):
    """A container's CPU quota: the kernel takes the CPUs away from all processes of the suite at once."""

    QUOTA_PERCENT = 20  # of one CPU
    FOLDERS = (pathlib.Path("/sys/fs/cgroup/cpu"), pathlib.Path("/sys/fs/cgroup"))  # version 1, version 2

    def setUp(self):
        super().setUp()
        name = f"srfs_test_{os.getpid()}"
        for parent in self.FOLDERS:
            self.group = parent / name
            version_1 = (parent / "cpu.cfs_quota_us").exists()
            try:
                self.group.mkdir()
                self.addCleanup(self.group.rmdir)  # runs after the flight has ended
                if version_1:
                    (self.group / "cpu.cfs_period_us").write_text("100000")
                (self.group / ("cpu.cfs_quota_us" if version_1 else "cpu.max")).write_text(f"{self.QUOTA_PERCENT * 1000}" + ("" if version_1 else " 100000"))
                return
            except OSError:
                continue
        self.skipTest("no control group with a CPU quota can be made here (root, cgroup cpu)")

    def test_a_suite_with_a_fifth_of_a_cpu_comes_up_works_and_restarts_nobody(self):
        sim = Sim(self.var, before=lambda: (self.group / "cgroup.procs").write_text(str(os.getpid())))
        sim.says("Ctrl-C ends it", MOST_QUOTA_S)
        self.assertEqual(ping(self.var), 0, sim.said)  # from outside the group
        self.assertEqual([line for line in sim.said.splitlines() if line.startswith("! ")], [])
        throttled = re.search(r"nr_throttled (\d+)", (self.group / "cpu.stat").read_text()).group(1)
        self.assertGreater(int(throttled), 0, "the quota was felt")
        self.assertEqual(sim.stop(), 0, sim.said)


if __name__ == "__main__":
    unittest.main()
