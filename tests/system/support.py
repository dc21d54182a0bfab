# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""What the system tests share: the programs under test, a VAR folder of their own, conditions with deadlines."""

import contextlib
import fcntl
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = pathlib.Path(os.environ.get("SRFS_BIN", ROOT / "build-release" / "bin"))
PYTHON = "/usr/bin/python3"
DEMO = ROOT / "tools" / "demo"
sys.path.insert(0, str(DEMO))

import can_frames  # noqa: E402, F401  (found through the path above)
import mission  # noqa: E402
from mission import wait_until  # noqa: E402, F401

PAYLOADS = ("payload_adcs", "payload_eps", "payload_thermal")
NODES = ("timing", "can_switcher", *PAYLOADS, "ttc", "image_acquisition", "image_processing", "maintenance")
JUDGED = tuple(name for name in NODES if not name.startswith("image_"))  # those run behind all others, and starve first
DEADLINE_S = 90  # for a condition; waits end with it, and the machine may be busy
FOLDER_PREFIX = "srfs_system_test_"
PREFIXES = (FOLDER_PREFIX, "srfs_test_")  # the other: of unit and node tests, tests/temporary_folder.hpp


def run(*command, **options):
    """Standard output of a program that ends well; what it said when it does not."""
    done = subprocess.run([str(c) for c in command], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=200, **options)
    assert done.returncode == 0, f"{command}\n{done.stdout[-4000:]}\n{done.stderr[-4000:]}"
    return done.stdout


def _lock(folder, wait=False):
    """A descriptor of the folder with its lock, None when somebody else has it. Whoever looks for abandoned folders has it for a moment."""
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
    """Ends what a test left running: it would open the lines of the next flight, for the kernel gives the numbers of terminals again.
    Returns {pid: program} of it."""
    ended = {}
    for _ in range(5):
        left = mission.processes_of(var)
        if not left:
            break
        ended.update(left)
        with contextlib.suppress(OSError):
            (var / "run" / "stopping").touch()  # nobody may restart what is ended now
        mission.end_processes(left)
    shutil.rmtree(mission.memory_folder(var), ignore_errors=True)  # what was shared by processes that were killed
    return ended


def remove_abandoned_folders(parent=None, youngest_s=60):
    """Removes what killed tests left, of system, node and unit tests: a living owner holds its lock."""
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


def temporary_folder():
    """(path, descriptor that locks it) of a folder that goes with this process at the latest."""
    remove_abandoned_folders()
    folder = pathlib.Path(tempfile.mkdtemp(prefix=FOLDER_PREFIX))
    return folder, _lock(folder, wait=True)


def _parents():
    """{pid: pid of its parent} of all processes."""
    found = {}
    for entry in filter(lambda e: e.name.isdigit(), pathlib.Path("/proc").iterdir()):
        with contextlib.suppress(OSError):
            found[int(entry.name)] = int((entry / "stat").read_text(errors="replace").rpartition(")")[2].split()[1])
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
    """The build lane takes only the CPU time that all others leave, on a busy machine none. Meanwhile what it runs for this VAR folder gets
    a normal share, where that is allowed."""
    ended = threading.Event()

    def run():
        while not ended.wait(0.3):
            parents = _parents()
            lane = {pid for pid in parents if _is_lane(mission.command_line(pid), var)}
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
    """Each test has its own VAR; what is still there of its processes at the end is ended, by pid, and fails the test."""

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
            self._show_logs()
        shutil.rmtree(self.folder, ignore_errors=True)
        self.assertEqual(left, {}, "processes left behind")

    def _has_failed(self):
        # Not _outcome.success: during a clean-up that tells about the clean-up.
        result = self._outcome.result
        return any(self in (test, getattr(test, "test_case", None)) for test, _ in result.failures + result.errors)

    def _show_logs(self):
        for log in sorted(self.folder.glob("*/log/*.log")):
            lines = log.read_text(errors="replace").splitlines()[-15:]
            print(f"--- {log.relative_to(self.folder)}", *lines, sep="\n", file=sys.stderr)

    @contextlib.contextmanager
    def flight(self, deployment="sim"):
        """A running simulation; that it ends without leaving anything behind is part of every test."""
        with mission.Mission(self.var, deployment, BIN, print) as flight:
            yield flight

    def ground_run(self, *words):
        """One run of srfs-ground on the flight's line, beside no session."""
        command = [str(BIN / "srfs-ground"), "--port", str(self.var / "rs422"), *words]
        return subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60)

    def deployment(self, *replacements, base="sim"):
        """A copy of a deployment with some text replaced."""
        text = (ROOT / "launch_config" / f"{base}.yaml").read_text()
        for old, new in replacements:
            self.assertIn(old, text)
            text = text.replace(old, new, 1)
        path = self.folder / "changed.yaml"
        path.write_text(text)
        return path

    def assert_nothing_left(self, var):
        self.assertEqual(mission.processes_of(var), {})
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


def restarts(flight, nodes=JUDGED):
    """Name: how often it was restarted. Two of these are compared, the first from when the suite is at work: while nine nodes start on
    a busy machine, one may get no CPU time for the length of its lease of the bus, and be fenced for it."""
    return {node["name"]: node["restarts"] for node in flight.status() if node["name"] in nodes}


def slots(recorder, payload, status, since=0):
    """The recorded ends of slots of a payload ("released" or "failed")."""
    return recorder.select(lambda m: m["type"] == "bus" and m["payload"] == payload and m["status"] == status, since)


def wait_for_slots(recorder, payload, status, count, since):
    """Waits for `count` ends of slots from position `since` on."""
    wait_until(lambda: len(slots(recorder, payload, status, since)) >= count, DEADLINE_S, f"{count} {status} slots of {payload}")
