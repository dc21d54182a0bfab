# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Shared by the system tests: the programs under test, a VAR folder for each test, conditions with deadlines."""

import contextlib
import fcntl
import json
import os
import pathlib
import shutil
import signal
import subprocess
import tempfile
import threading
import time
import unittest

from srfs import ROOT
from srfs.flight import deployments, mission
from srfs.flight.deployments import NODES
from srfs.flight.processes import command_line, end_processes, pids, processes_of, send_signal, wait_until

BIN = pathlib.Path(os.environ.get("SRFS_BIN", ROOT / "build-release" / "bin"))
PROGRAM = ("/usr/bin/python3", "-B", "-m")  # of python/srfs
JUDGED = tuple(name for name in NODES if not name.startswith("image_"))  # the image nodes have the lowest priority, and starve first
DEADLINE_S = 90  # for a condition; a wait ends when the condition holds, and the machine may be busy
FOLDER_PREFIX = "srfs_system_test_"
PREFIXES = (FOLDER_PREFIX, "srfs_test_")  # the second: unit and node tests, tests/temporary_folder.hpp


def _lock(folder, wait=False):
    """Locks the folder. Returns the descriptor that holds the lock; None if another process holds it. remove_abandoned_folders() holds the
    lock of each folder for a moment."""
    try:
        fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    except OSError:
        return None
    try:
        fcntl.flock(fd, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(fd)
        return None
    return fd


def end_flight(var):
    """Ends the processes that a test left running. They would open the lines of the next flight, because the kernel reuses the numbers of
    terminals. Returns their {pid: program}."""
    ended = {}
    for _ in range(5):
        left = processes_of(var)
        if not left:
            break
        ended.update(left)
        with contextlib.suppress(OSError):
            (var / "run" / "stopping").touch()  # no node may restart the processes ended now
        end_processes(left)
    mission.forget_memory(var)
    return ended


def remove_abandoned_folders(parent=None, youngest_s=60):
    """Removes the folders that killed system, node and unit tests left behind. A living owner holds the lock of its folder."""
    parent = pathlib.Path(parent or tempfile.gettempdir())
    for folder in (found for prefix in PREFIXES for found in parent.glob(f"{prefix}*")):
        fd = _lock(folder)
        if fd is None:
            continue
        status = os.fstat(fd)
        if status.st_uid == os.geteuid() and time.time() - status.st_mtime >= youngest_s:
            with contextlib.suppress(OSError):
                for var in filter(pathlib.Path.is_dir, folder.iterdir()):
                    end_flight(var)
            shutil.rmtree(folder, ignore_errors=True)
        os.close(fd)


class TemporaryFolder(tempfile.TemporaryDirectory):
    """A folder of a test without a flight, as tempfile makes it, and locked: no other test takes it for abandoned."""

    def __init__(self):
        super().__init__(prefix=PREFIXES[1])
        self._descriptor = _lock(self.name, wait=True)

    def cleanup(self):
        super().cleanup()
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def temporary_folder():
    """Makes a folder. Returns (path, descriptor that locks it); the lock ends with this process at the latest."""
    remove_abandoned_folders()
    folder = pathlib.Path(tempfile.mkdtemp(prefix=FOLDER_PREFIX))
    return folder, _lock(folder, wait=True)


def _parents():
    """{pid: parent's pid} of all processes."""
    found = {}
    for pid in pids():
        with contextlib.suppress(OSError):
            found[pid] = int(pathlib.Path(f"/proc/{pid}/stat").read_text(errors="replace").rpartition(")")[2].split()[1])
    return found


def _is_lane(words, var):
    return os.path.basename(words[0] if words else "") == "srfs-lane" and str(var) in " ".join(words)


def _take_normal_share(pid):
    with contextlib.suppress(OSError):
        pathlib.Path(f"/proc/{pid}/autogroup").write_text("0")
    for task in pathlib.Path(f"/proc/{pid}/task").glob("*"):
        with contextlib.suppress(OSError):
            if os.sched_getscheduler(int(task.name)) == os.SCHED_IDLE:
                os.sched_setscheduler(int(task.name), os.SCHED_OTHER, os.sched_param(0))


@contextlib.contextmanager
def hurried_lane(var):
    """Gives the build lane of this VAR folder a normal share of CPU time, if permitted. By default it gets only the time that all others
    leave; on a busy machine that is none."""
    ended = threading.Event()

    def run():
        while not ended.wait(0.3):
            parents = _parents()
            lane = {pid for pid in parents if _is_lane(command_line(pid), var)}
            while more := {pid for pid, parent in parents.items() if parent in lane} - lane:
                lane |= more
            for pid in lane:
                _take_normal_share(pid)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


class SystemTest(unittest.TestCase):
    """Each test has its own VAR. A process that is still running at the end of a test is ended, by pid, and fails the test."""

    def setUp(self):
        self.folder, lock = temporary_folder()
        self.addCleanup(os.close, lock)
        self.var = self.folder / "var"
        self.addCleanup(self._clean)

    def _clean(self):
        left = {}
        for var in self.folder.iterdir():
            left.update(end_flight(var))
        if left or self._has_failed():
            for var in self.folder.iterdir():
                mission.show_logs(var)
        shutil.rmtree(self.folder, ignore_errors=True)
        self.assertEqual(left, {}, "processes left behind")

    def _has_failed(self):
        # Not _outcome.success: during a clean-up it describes the clean-up.
        result = self._outcome.result
        return any(self in (test, getattr(test, "test_case", None)) for test, _ in result.failures + result.errors)

    @contextlib.contextmanager
    def flight(self, deployment="sim"):
        """A running simulation. Every test also checks that it ends without leaving anything behind."""
        with mission.Mission(self.var, deployment, BIN, print) as flight:
            yield flight

    def ground_run(self, *words):
        """Runs srfs-ground once on the flight's line. No session may be open."""
        command = [str(BIN / "srfs-ground"), "--port", str(self.var / "rs422"), *words]
        return subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60)

    def complete(self, ground, line, deadline_s=DEADLINE_S):
        """Sends a line whose telecommand must be completed. Returns its outcome."""
        outcome = ground.command(line, deadline_s)
        self.assertEqual((outcome or {}).get("stage"), "completed", f"{line}: {outcome}")
        return outcome

    def wait_for_event(self, ground, name, since=0, matches=lambda event: True):
        event = ground.wait_for(lambda m: m["type"] == "event" and m.get("event") == name and matches(m), DEADLINE_S, since)
        self.assertIsNotNone(event, f"event {name}")
        return event

    def deployment(self, *replacements, base="sim"):
        """Copies a deployment with some text replaced."""
        return deployments.copy(deployments.FOLDER / f"{base}.yaml", self.folder / "changed.yaml", replacements)

    def assert_nothing_left(self, var):
        self.assertEqual(processes_of(var), {})
        self.assertEqual([p.name for p in (var / "run").glob("*")], [])
        self.assertFalse((var / "rs422").is_symlink())


class ToolTest(SystemTest):
    """`srfs` on the deployment file self.file, without a simulation."""

    def srfs(self, *arguments):
        command = [str(BIN / "srfs"), *arguments, "--deployment", str(self.file), "--var", str(self.var)]
        return subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=200)

    def json(self, *arguments):
        result = self.srfs(*arguments, "--json")
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        return json.loads(result.stdout)


def kill(flight, *nodes):
    """Kills nodes and waits until the ring has restarted them."""
    pids = {node: flight.node_pid(node) for node in nodes}
    for pid in pids.values():
        send_signal(pid, signal.SIGKILL)
    wait_until(lambda: all(flight.node_pid(node) not in (None, pids[node]) for node in nodes), 3 * DEADLINE_S, f"{', '.join(nodes)} restarted")


def wait_for_ttc(ground):
    wait_until(lambda: (ground.command("ping --timeout 1") or {}).get("stage") == "completed", DEADLINE_S, "ttc works")


def restarts(flight, nodes=JUDGED):
    """{name: number of restarts}. Tests compare two of these, and take the first when the suite is at work: while nine nodes start on a busy
    machine, one of them may get no CPU time during its lease of the bus and be fenced."""
    return {node["name"]: node["restarts"] for node in flight.status() if node["name"] in nodes}


def slots(recorder, payload, status, since=0):
    """The recorded ends of slots of a payload ("released" or "failed")."""
    return recorder.select(lambda m: m["type"] == "bus" and m["payload"] == payload and m["status"] == status, since)


def wait_for_slots(recorder, payload, status, count, since):
    """Waits for `count` ends of slots from position `since` on."""
    wait_until(lambda: len(slots(recorder, payload, status, since)) >= count, DEADLINE_S, f"{count} {status} slots of {payload}")
