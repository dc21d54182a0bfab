# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""One running simulation: the simulated spacecraft and the suite in a VAR folder, started, watched and ended in order.

Used by ./run sim, ./run demo, ./run bench and the system tests. 
"""

import contextlib
import fcntl
import json
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import time

from srfs.flight import deployments
from srfs.flight.ground import ANSWER_DEADLINE_S, GroundSession, Lines
from srfs.flight.processes import MOST_PATIENCE, PATIENCE, STOP_PATIENCE_S, command_line, end_processes, is_flocked, kib_of, lock_owner, output, processes_of, stop_child, wait_until
from srfs.program import MissionError
from srfs.record import can_frames

# Waits end as soon as what they wait for is there; how long they last at most is for a machine that others use, too.
READY_DEADLINE_S = 60 * PATIENCE
UP_DEADLINE_S = 20 * PATIENCE  # without progress of any node; ten times as long in all
MOST_ROUNDS = 5  # of ending what was started while its starter was asked to end


def installed(bin_dir):
    """The programs of an installation of the build that bin_dir belongs to: what compiles on board needs headers and libraries beside them."""
    build = pathlib.Path(bin_dir).absolute().parent
    if not (build / "CMakeCache.txt").exists():
        return bin_dir  # an installation already
    stage = build / "stage"
    with open(build / ".stage.lock", "a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        output("cmake", "--install", build, "--prefix", stage, timeout_s=600)
    return stage / "bin"


def _runtime_folder(var, suffix, otherwise):
    """The folder of a VAR folder's suite in a runtime folder, if it is there (VarPaths::memory_name in lib/suite/instance.cpp)."""
    value = 0xCBF29CE484222325  # FNV-1a
    for octet in f"{os.path.normpath(os.path.abspath(var))}/".encode():
        value = (value ^ octet) * 0x100000001B3 % 2**64
    user = os.stat(var).st_uid if os.path.exists(var) else os.geteuid()
    folders = [pathlib.Path(parent, f"{value:016x}{suffix}") for parent in ("/run/srfs", f"/run/user/{user}/srfs")]
    return next((folder for folder in folders if folder.exists()), pathlib.Path(var, *otherwise))


def memory_folder(var):
    """Where the nodes of a VAR folder share memory (VarPaths::memory)."""
    return _runtime_folder(var, "", ("run", "memory"))


def keys_folder(var):
    """Where the keys of this start of the suite lie (order_keys in lib/suite/command_keys.cpp)."""
    return _runtime_folder(var, ".keys", ("keys", "orders"))


def forget_memory(var):
    """Removes what killed processes left in memory."""
    for folder in (keys_folder(var), memory_folder(var)):
        shutil.rmtree(folder, ignore_errors=True)


def has_come(var, node):
    """Whether a node is in its desired state, by its heartbeat page (lib/suite/ring/heartbeat_page.cpp)."""
    try:
        _, process, _, _, lifecycle, _ = struct.unpack("6Q", (memory_folder(var) / f"{node}.heartbeat").read_bytes()[:48])
    except (OSError, struct.error):
        return False
    state, desired = lifecycle & 0xFFFFFFFF, lifecycle >> 32
    return state != 0 and state == desired and process & 0xFFFFFFFF == lock_owner(var / "run" / f"{node}.lock")


@contextlib.contextmanager
def short_flight(bin_dir, deployment="sim", before=lambda var: None, parent=None):
    """A flight in a folder of its own, which goes with it. deployment: a NAME, or what the file says; before(var): what lies there at the start."""
    with tempfile.TemporaryDirectory(prefix="srfs-bench-", dir=parent) as folder:
        var = pathlib.Path(folder) / "var"
        if isinstance(deployment, dict):
            deployment = deployments.write(deployment, var.with_name("deployment.yaml"))
        before(var)
        with Mission(var, deployment, bin_dir) as flight:
            yield flight


def show_logs(var, lines=15, file=None):
    """The ends of a flight's logs, on standard error unless given."""
    for log in sorted(var.glob("log/*.log")):
        print(f"--- {log.relative_to(var.parent)}", *log.read_text(errors="replace").splitlines()[-lines:], sep="\n", file=file or sys.stderr)


class Mission:
    """The simulated spacecraft and the suite, up between __enter__ and __exit__."""

    def __init__(self, var, deployment="sim", bin_dir="build-release/bin", say=lambda text: None, only=(), insist_s=0, wait_for_all=True):
        self.var = pathlib.Path(var).absolute()
        self.deployment = deployments.find(deployment)
        self.simulated = self.deployment  # what hw_sim reads; another file where a real device stands in for one of its own
        self.bin_dir = pathlib.Path(bin_dir).absolute()
        self.say = say
        self.only = only  # nodes that are started; empty: all
        self.insist_s = insist_s  # so long ended nodes are restarted: without a ring, nodes the switcher kills on a late machine stay down
        self.wait_for_all = wait_for_all  # else nodes that flight does not need (the image lane) join when they can
        self.coming = []  # those of them that are not there yet
        self.run_dir = self.var / "run"
        self.hw_sim = None
        self.up_report = None
        self._lock = None
        self._lines = []
        self._rest = None
        self._watched = {}

    # --- starting ---------------------------------------------------------------------------------------------------

    def __enter__(self):
        self.start()
        return self

    def start(self):
        self._take_lock()
        try:
            self._end_orphans()
            self._start_hw_sim()
            self._start_suite()
        except BaseException:
            self._end_quietly()
            raise

    def program(self, name):
        path = self.bin_dir / name
        if not path.exists():
            raise MissionError(f"{path} is missing: build first (./run build)", code=2)
        return str(path)

    def _take_lock(self):
        self.var.mkdir(parents=True, exist_ok=True)
        self.run_dir.mkdir(mode=0o700, exist_ok=True)  # locks and sockets of this user alone
        (self.var / "log").mkdir(exist_ok=True)
        path = self.run_dir / "mission.lock"
        for _ in range(10):  # the last holder removes the file on its way out: then it is another file now
            lock = open(path, "a+", opener=lambda name, flags: os.open(name, flags | os.O_NOFOLLOW, 0o600))
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                lock.seek(0)
                pid = lock.read().strip() or "unknown"
                lock.close()
                raise MissionError(
                    f"{self.var} is in use by a running simulation (pid {pid}): end that one, or choose another folder with --var",
                    code=2,
                ) from None
            with contextlib.suppress(FileNotFoundError):
                if os.fstat(lock.fileno()).st_ino == os.stat(path).st_ino:
                    break
            lock.close()
        else:
            raise MissionError(f"{path}: cannot lock")
        lock.truncate(0)
        lock.write(f"{os.getpid()}\n")
        lock.flush()
        self._lock = lock

    def _orphans(self):
        """{pid: name} of what an earlier simulation that was killed left running in VAR."""
        found = {}
        for lock in self.run_dir.glob("*.lock"):
            pid = lock_owner(lock)
            if pid and str(self.var) in command_line(pid):
                found[pid] = lock.stem
        if is_flocked(self.run_dir / "hw_sim.lock"):
            with contextlib.suppress(OSError, ValueError):
                pid = int((self.run_dir / "hw_sim.pid").read_text())
                if str(self.var) in command_line(pid):
                    found[pid] = "hw_sim"
        found.update({pid: name for pid, name in processes_of(self.var).items() if pid not in found})
        return found

    def _end_orphans(self):
        for orphans, killed in self._end_rounds(self._orphans):
            names = ", ".join(f"{name} (pid {pid})" for pid, name in sorted(orphans.items()))
            self.say(f"an earlier simulation in {self.var} was killed; ending what it left: {names}")
            for pid in killed:
                self.say(f"{orphans[pid]} (pid {pid}) did not end in time and was killed")
        self._remove_run_files()

    def _end_rounds(self, running):
        """Ends what running() finds, {pid: name}, until it finds nothing: a node that was just restarting another when it was asked to end
        leaves that one behind. Yields, for each round, what was found and which of it needed SIGKILL."""
        (self.run_dir / "stopping").touch()  # no restart begins from now on
        for _ in range(MOST_ROUNDS):
            found = running()
            if not found:
                return
            yield found, end_processes(found)

    def _remove_run_files(self):
        for path in self.run_dir.iterdir():
            if path.name != "mission.lock":
                path.unlink(missing_ok=True)
        forget_memory(self.var)
        with contextlib.suppress(OSError):
            (self.var / "rs422").unlink()

    def _start_hw_sim(self):
        log = self.var / "log" / "hw_sim.log"
        with open(log, "ab") as file:
            begin = file.tell()
            self.hw_sim = subprocess.Popen(
                [self.program("hw_sim"), "--deployment", str(self.simulated), "--var", str(self.var)],
                stdin=subprocess.DEVNULL, stdout=file, stderr=file, start_new_session=True,
            )  # fmt: skip
        wait_until(
            lambda: (self.run_dir / "hw_sim.ready").exists() or self.hw_sim.poll() is not None,
            READY_DEADLINE_S, f"the simulated spacecraft is ready (see {log})", pid=self.hw_sim.pid,
        )  # fmt: skip
        if self.hw_sim.poll() is not None:
            said = log.read_bytes()[begin:].decode(errors="replace").strip()
            raise MissionError(f"{self.deployment}: the simulated spacecraft did not start:\n{said}", code=2)

    def _start_suite(self):
        earlier = {log.stem: log.stat().st_size for log in (self.var / "log").glob("*.log")}
        options = [word for name in self.only for word in ("--only", name)] + ["--all"] * self.wait_for_all
        begin = time.monotonic()
        while True:
            code, output, said = self._srfs_up("--deadline", str(UP_DEADLINE_S), *options)
            try:
                self.up_report = json.loads(output)
            except ValueError:
                raise MissionError(f"srfs up: {said.strip()}", code=code or 1) from None
            if self.up_report["ok"] or time.monotonic() - begin >= self.insist_s:
                break
        if not self.up_report["ok"]:
            late = [node["name"] for node in self.up_report["nodes"] if node["state"] != "active"]
            errors = [error for name in late for error in self._last_error(name, earlier.get(name, 0))]
            in_the_file = any(str(self.deployment) in error for error in errors)
            raise MissionError("the suite did not come up:\n" + "\n".join(self.up_report["problems"] + errors + self.up_report["advice"]), code=2 if in_the_file else 1)
        self.coming = self.up_report["coming"]
        self._watched = {node["name"]: node["pid"] for node in self.up_report["nodes"]}

    def _srfs_up(self, *options):
        """(exit code, output, errors) of `srfs up`, which says on its error output, line by line, what it waits for."""
        said = []
        with subprocess.Popen(self._command("srfs", "up", *options, "--json"), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            try:
                for line in process.stderr:
                    said.append(line)
                    self.say(f"  {line.rstrip()}")
                output = process.stdout.read()
            except BaseException:
                process.terminate()
                raise
        return process.returncode, output, "".join(said)

    def start_rest(self):
        """`srfs up` that starts what is missing and waits for all nodes, also those that flight does not need, as long as they make
        progress; ended with the mission."""
        command = self._command("srfs", "up", "--all", "--deadline", UP_DEADLINE_S)
        with open(self.var / "log" / "up.log", "ab") as log:
            self._rest = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True)
        return self._rest

    def _last_error(self, node, begin):
        """The last error in a node's log behind octet `begin`, as a list of at most one line."""
        with contextlib.suppress(OSError):
            lines = (self.var / "log" / f"{node}.log").read_bytes()[begin:].decode(errors="replace").splitlines()
            return [line for line in lines if " ERROR " in line or " FATAL " in line][-1:]
        return []

    # --- while it runs ----------------------------------------------------------------------------------------------

    @property
    def domain(self):
        return self.up_report["domain"]

    def srfs(self, *arguments, timeout_s=3 * ANSWER_DEADLINE_S):
        """One run of `srfs` with --json for this deployment and VAR."""
        return subprocess.run(self._command("srfs", *arguments, "--json"), stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=timeout_s)

    def srfs_json(self, *arguments):
        """What such a run prints, which must succeed."""
        return json.loads(output(*self._command("srfs", *arguments, "--json"), timeout_s=3 * ANSWER_DEADLINE_S))

    def _command(self, program, *arguments):
        return [self.program(program), *map(str, arguments), "--deployment", str(self.deployment), "--var", str(self.var)]

    def ground_tool(self, *arguments, timeout_s=60):
        """What one run of srfs-ground prints that needs no line to the spacecraft: packages, keys."""
        return output(self.program("srfs-ground"), *arguments, timeout_s=timeout_s)

    def status(self):
        """[{name, state, pid, incarnation, version, restarts, last_restart_cause}] as `srfs status` lists them."""
        return json.loads(self.srfs("status").stdout)

    def versions(self, node):
        """What `srfs versions` says of a node."""
        return self.srfs_json("versions", "--node", node)[0]

    def restarts(self):
        """How often nodes were restarted since the suite was up. (VAR keeps counting from flight to flight.)"""
        before = {node["name"]: node["restarts"] for node in self.up_report["nodes"]}
        return sum(node["restarts"] - before.get(node["name"], 0) for node in self.status())

    def node_pid(self, name):
        return lock_owner(self.run_dir / f"{name}.lock")

    def control(self, request):
        """One request to hw_sim (faults, truth, counters); returns its reply."""
        return json.loads(output(self.program("hw_sim"), "--var", self.var, "--control", json.dumps(request), timeout_s=ANSWER_DEADLINE_S))

    def can_log(self, until_ns=0, deadline_s=5):
        """The lines of the simulated bus' record, once it has come past until_ns; [] when none is kept."""
        path = self.var / "log" / "can.log"
        end = time.monotonic() + deadline_s
        while True:
            lines = []
            for part in (path.with_name("can.log.1"), path):
                with contextlib.suppress(OSError):
                    lines += part.read_text().splitlines()
            late = until_ns > 0 and (can_frames.last_time(lines[-100:]) or 0) <= until_ns  # what is kept is written with a delay
            if not path.exists() or not late or time.monotonic() > end:
                return lines
            time.sleep(0.1)

    def ground_command(self, *words):
        """The command line of srfs-ground on this flight's line, which serves one at a time."""
        return [self.program("srfs-ground"), "--port", str(self.var / "rs422"), "--deployment", str(self.deployment), *map(str, words)]

    def ground(self):
        """Opens the operator's session; ended with the mission."""
        self._lines.append(GroundSession(self))
        return self._lines[-1]

    def hang_up(self, session):
        """Ends a session before the mission ends; the line serves one at a time."""
        self._lines.remove(session)
        session.end()

    def recorder(self):
        """Listens to the nodes' own topics; ended with the mission."""
        recorder = Lines(self._command("srfs", "record"), self.var / "log" / "record.log")
        self._lines.append(recorder)
        if not recorder.wait_for(lambda m: m["type"] == "recording", ANSWER_DEADLINE_S):
            raise MissionError(f"srfs record does not listen: see {recorder.log_path}")
        return recorder

    def news_of_processes(self):
        """What ended or was restarted since the last call, as lines; and whether the simulation itself is gone."""
        news = []
        if self.hw_sim.poll() is not None:
            code = self.hw_sim.returncode
            how = f"killed by signal {-code}" if code < 0 else f"ended with exit code {code}"
            return [f"the simulated spacecraft {how}; its log: {self.var / 'log' / 'hw_sim.log'}"], True
        for name, pid in self._watched.items():
            now = self.node_pid(name)
            if now == pid:
                continue
            if pid is None and name in self.coming:
                pass  # its first process
            elif now is None:
                news.append(f"{name} (pid {pid}) is gone; its log: {self.var / 'log' / (name + '.log')}")
            else:
                news.append(f"{name} was restarted: pid {now}")
            self._watched[name] = now
        for name in [name for name in self.coming if has_come(self.var, name)]:
            self.coming.remove(name)
            news.append(f"{name} has come: all nodes are up" if not self.coming else f"{name} has come")
        return news, False

    def memory_kib(self):
        """PSS of each node; None for a node that is not there."""
        memory = {}
        for name in self._watched:
            memory[name] = kib_of(f"/proc/{self.node_pid(name)}/smaps_rollup", "Pss")
        return memory

    # --- ending -----------------------------------------------------------------------------------------------------

    def __exit__(self, kind, value, traceback):
        left = self.stop()
        if left and kind is None:
            raise MissionError("the simulation did not end cleanly:\n" + "\n".join(left))

    def stop(self):
        """Ends everything in order. Returns what was left behind (and has been ended or named), empty when nothing."""
        left = []
        for lines in reversed(self._lines):
            lines.end()
        self._lines = []
        if self._rest:
            stop_child(self._rest)  # it would hold `srfs down` up
        left += self._stop_suite()
        left += self._stop_hw_sim()
        left += self._leftovers()
        self._remove_run_files()
        self._release_lock()
        return left

    def _stop_suite(self):
        try:
            result = self.srfs("down", "--patience", str(1000 * STOP_PATIENCE_S), timeout_s=3 * MOST_PATIENCE * STOP_PATIENCE_S)
            report = json.loads(result.stdout)
        except subprocess.TimeoutExpired:
            return ["srfs down did not end in time"]
        except ValueError:
            return [f"srfs down: {result.stderr.strip()}"]
        for name in report["starved"]:
            self.say(f"{name} got too little CPU time to end within {MOST_PATIENCE * STOP_PATIENCE_S} s and was killed: this machine is too busy")
        hung = [name for name in report["killed"] if name not in report["starved"]]
        return [f"{name} did not stop in time and was killed" for name in hung] + [f"{name} could not be stopped" for name in report["left"]]

    def _stop_hw_sim(self):
        if self.hw_sim.poll() is not None:
            return [] if self.hw_sim.returncode == 0 else [f"the simulated spacecraft ended with {self.hw_sim.returncode}"]
        if not stop_child(self.hw_sim):
            return ["hw_sim did not end in time and was killed"]
        return [] if self.hw_sim.returncode == 0 else [f"hw_sim ended with {self.hw_sim.returncode}"]

    def _leftovers(self):
        left = []
        for remaining, _ in self._end_rounds(lambda: processes_of(self.var)):
            left += [f"process {name} (pid {pid})" for pid, name in remaining.items()]
        (self.run_dir / "stopping").unlink(missing_ok=True)
        if self.hw_sim.returncode < 0:
            return left  # killed, it could not remove its files; that was reported already
        left += [f"file {path}" for path in self.run_dir.iterdir() if path.name != "mission.lock"]
        if (self.var / "rs422").is_symlink():
            left.append(f"link {self.var / 'rs422'}")
        left += [f"in memory: {folder}" for folder in (memory_folder(self.var), keys_folder(self.var)) if folder.exists()]
        return left

    def _end_quietly(self):
        for lines in reversed(self._lines):
            lines.end()
        self._lines = []
        for _ in self._end_rounds(self._orphans):
            pass
        if self.hw_sim:
            self.hw_sim.wait()
        self._remove_run_files()
        self._release_lock()

    def _release_lock(self):
        if self._lock:
            (self.run_dir / "mission.lock").unlink(missing_ok=True)
            self._lock.close()
            self._lock = None
