# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The `rescue` campaign: whatever is on the disk, the ground gets an answer and brings the suite back.

Each trial takes a flown suite that is down, damages files at random (deleted, cut, bits flipped, rubbish): programs, libraries, the deployment, the
dictionary, state, keys, stores, golden copies. The ground's own files, the simulated devices and srfs_rescue with its settings stay whole. Then
`srfs_rescue start` starts the suite, again after each start without an answer, as a watchdog would. The trial is good when

- after BOUND_STARTS starts at most either ttc or srfs_rescue answers a ping, and
- telecommands alone bring all nodes to Active: rescue.mend, files sent up and rescue.restore, rescue.reset, rescue.start_suite.
"""

import contextlib
import dataclasses
import os
import pathlib
import random
import shutil
import signal
import subprocess
import time

from srfs.flight import deployments, mission
from srfs.flight.processes import PATIENCE, lock_owner, processes_of, send_signal, stop_child, wait_until
from srfs.program import MissionError
from srfs.report import show_checks

STEPS = {"last_good": 1, "golden": 2, "rescue": 3}  # of a trial: soon
BOUND_STARTS = STEPS["rescue"] + 1
ANSWER_S = 90 * PATIENCE  # for what a healthy machine does in two seconds
QUIET_S = 20 * PATIENCE  # without an answer of a suite whose `srfs up` was done: the watchdog would bite
NOT_NEEDED = ("srfs-ground", "srfs-product", "srfs-detect", "srfs-lane", "hw_sim")  # on the ground, or of the lane


def tree(folder):
    return sorted(p for p in folder.rglob("*") if p.is_file() and not p.is_symlink())


class Board:
    """An installation and its VAR in folders of their own, on a simulated line. The simulated devices have a folder of their own, too: VAR is the
    computer's alone."""

    def __init__(self, folder, installed_bin, say=lambda text: None, own_programs=True, content=None):
        self.folder, self.say = pathlib.Path(folder), say
        self.whole_bin = pathlib.Path(installed_bin)  # hw_sim and the ground run from here
        (self.folder / "etc").mkdir(parents=True)
        self.prefix = self.folder / "prefix" if own_programs else self.whole_bin.parent
        self.var = self.folder / "var"
        self.devices = self.folder / "devices"
        self.station = self.folder / "station"
        self.copies = [self.folder / "rescue_a", self.folder / "rescue_b"]
        if own_programs:
            self._copy_programs()
        content = content or deployments.read("sim")
        self.nodes = [node["name"] for node in content["nodes"]]
        content["simulation"]["watchdog"]["restart_command"] = ["/bin/true"]  # the campaign is the watchdog
        content["devices"] = {name: uri.replace(":", f":{self.devices}/", 1) for name, uri in content["devices"].items() if uri}
        content["step_down"] = {**STEPS, "no_contact_s": 600}
        for node in content["nodes"]:
            if node["name"] == "maintenance":
                node.setdefault("parameters", {}).update(scrub_first_after_s=0, scrub_pause_ms=0)
        self.deployment = deployments.write(content, self.folder / "etc" / "deployment.yaml")
        self.ground_deployment = deployments.write(content, self.folder / "ground.yaml")
        self.flight = mission.Mission(self.devices, self.ground_deployment, self.whole_bin, say)
        self.starter = None
        self.said = self.folder / "rescue.log"

    def _copy_programs(self):
        stage = self.whole_bin.parent
        shutil.copytree(stage / "bin", self.prefix / "bin", ignore=shutil.ignore_patterns(*NOT_NEEDED))
        shutil.copytree(stage / "lib", self.prefix / "lib", symlinks=True, ignore=shutil.ignore_patterns("*.a", "cmake"))
        shutil.copytree(stage / "share", self.prefix / "share", symlinks=True, ignore=shutil.ignore_patterns("doc"))

    def __enter__(self):
        self.flight._take_lock()
        self.flight._start_hw_sim()
        self.station.mkdir(exist_ok=True)
        (self.station / "rs422").symlink_to(self.devices / "rs422")
        for place in (self.var, self.station):
            shutil.copytree(self.devices / "keys", place / "keys")
        self.rescue_program("rescue", "prepare", *(word for copy in self.copies for word in ("--into", copy)))
        return self

    def __exit__(self, *_):
        self.end_starter()
        self.srfs(self.whole_bin, "down")
        self.flight.stop()

    # --- on board

    def srfs(self, folder, *words, timeout_s=10 * ANSWER_S):
        command = [str(folder / "srfs"), *map(str, words), "--deployment", str(self.ground_deployment if folder == self.whole_bin else self.deployment), "--var", str(self.var)]
        return subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=timeout_s)

    def rescue_program(self, *words):
        result = self.srfs(self.prefix / "bin", *words)
        if result.returncode != 0:
            raise MissionError(f"srfs {' '.join(map(str, words))}: {result.stderr}")

    def start(self):
        """Begins `srfs_rescue start`, which ends when the suite runs."""
        self.end_starter()
        settings = [word for copy in self.copies for word in ("--settings", str(copy / "settings"))]
        with open(self.said, "ab") as log:
            self.starter = subprocess.Popen([str(self.copies[0] / "srfs_rescue"), "start", *settings], stdin=subprocess.DEVNULL, stdout=log, stderr=log)

    def end_starter(self):
        if self.starter:
            stop_child(self.starter)
        self.starter = None

    def lose_power(self):
        """Everything on board ends at once."""
        self.end_starter()
        for _ in range(5):
            for pid in processes_of(self.var):  # what is being loaded, and what holds no lock that can be read
                send_signal(pid, signal.SIGKILL)
            for lock in (self.var / "run").glob("*.lock"):
                send_signal(lock_owner(lock), signal.SIGKILL)
            time.sleep(0.05)

    # --- on the ground

    def ground(self, *words, timeout_s=2 * ANSWER_S):
        command = [str(self.whole_bin / "srfs-ground"), "--port", str(self.station / "rs422"), "--deployment", str(self.ground_deployment), *map(str, words)]
        return subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=timeout_s)

    def ping(self, timeout_s=2):
        """Whether anything answers with the keys in use, or with the contingency's."""
        return any(self.ground(*keys, "ping", "--timeout", timeout_s).returncode == 0 for keys in ((), ("--keys", "contingency")))

    def order(self, *words):
        """(completed, output) of a telecommand, with the keys that work."""
        output = ""
        for keys in ((), ("--keys", "contingency")):
            result = self.ground(*keys, "tc", *words, "--wait", "--timeout", 60 * PATIENCE)
            output += result.stdout + result.stderr
            if result.returncode == 0:
                return True, output
        return False, output

    def speaker(self):
        """rescue or suite: which of both sent the newest boot_step."""
        return "rescue" if self.order("rescue.report")[0] else "suite"

    def all_active(self):
        return all(mission.has_come(self.var, node) for node in self.nodes)

    def answers(self):
        """Waits for an answer of the suite or of rescue, through as many starts as the bound allows. Returns the number of starts; None: none came."""
        for number in range(1, BOUND_STARTS + 1):
            self.start()
            quiet_since = None
            while True:
                if self.ping(1):
                    return number
                if self.starter.poll() is None:
                    continue  # it starts, or is on the line in a moment
                quiet_since = quiet_since or time.monotonic()
                if self.starter.returncode != 0 or time.monotonic() - quiet_since > QUIET_S:
                    break
            self.lose_power()
        return None


# --- damage

@dataclasses.dataclass
class Damage:
    path: pathlib.Path
    kind: str

    def __str__(self):
        return f"{self.kind} {self.path}"


def damage(file, kind, order):
    content = file.read_bytes()
    mode = file.stat().st_mode & 0o7777
    if kind == "deleted":
        file.unlink()
        return
    if kind == "cut":
        content = content[: order.randrange(len(content) + 1)]
    elif kind == "bits":
        content = bytearray(content)
        for _ in range(min(len(content), order.randrange(1, 64))):
            content[order.randrange(len(content))] ^= 1 << order.randrange(8)
    else:
        content = order.randbytes(len(content))
    file.chmod(mode | 0o200)
    file.write_bytes(bytes(content))
    file.chmod(mode)


def damage_at_random(board, order):
    """One to twelve files, of every kind of them with the same chance."""
    kinds = [tree(board.prefix / "bin"), tree(board.prefix / "lib"), tree(board.prefix / "share"), [board.deployment],
             tree(board.var / "state"), tree(board.var / "keys"), tree(board.var / "golden"), tree(board.var / "store")]  # fmt: skip
    kinds = [files for files in kinds if files]
    done = []
    for _ in range(order.randrange(1, 13)):
        file = order.choice(order.choice(kinds))
        if not file.exists():
            continue
        kind = order.choice(("deleted", "cut", "bits", "rubbish"))
        damage(file, kind, order)
        done.append(Damage(file.relative_to(board.folder), kind))
    return done


# --- recovery

def send_up(board, pristine, target):
    """Puts the ground's copy of a file in its place on board. Returns what went wrong."""
    name = f"up_{len(list(board.station.glob('up_*')))}"
    shutil.copy(pristine / target.relative_to(board.folder), board.station / name)
    result = board.ground("put", board.station / name, name)
    if result.returncode != 0:
        return f"put {target}: {result.stdout}{result.stderr}"
    below_var = target.is_relative_to(board.var)
    done, output = board.order("rescue.restore", f"file={name}", f"target={target.relative_to(board.var) if below_var else target}")
    return "" if done else f"rescue.restore {target}: {output}"


def bring_back(board, pristine, damaged):
    """What an operator does, by telecommands alone. Returns what went wrong; empty: all nodes are Active."""
    if board.speaker() == "suite":
        with contextlib.suppress(MissionError):
            wait_until(board.all_active, QUIET_S, "all nodes are Active")
            return ""
        # The suite answers and a node does not come: scrubbing mends what a golden copy is left of.
        board.order("scrub.run")
        with contextlib.suppress(MissionError):
            wait_until(board.all_active, ANSWER_S, "all nodes are Active after scrubbing")
            return ""
        return "the suite answers, and not all nodes come"
    said = []
    mended, output = board.order("rescue.mend")
    said += [output] * (not mended)
    for one in damaged:
        path, whole = board.folder / one.path, pristine / one.path
        # An operator would send all that may be the cause; the campaign looks, to save the time of the line.
        if whole.exists() and not (path.exists() and path.read_bytes() == whole.read_bytes()):
            problem = send_up(board, pristine, path)
            said += [problem] * bool(problem)
    for part in ("versions", "parameters", "schedule", "state"):
        done, output = board.order("rescue.reset", f"part={part}")
        said += [output] * (not done)
    done, output = board.order("rescue.start_suite")
    said += [output] * (not done)
    try:
        wait_until(board.all_active, ANSWER_S, "all nodes are Active")
    except MissionError as error:
        return "; ".join([str(error), *said])
    return ""


def fly_once(board):
    """The suite flies until its files have golden copies. Then it is down."""
    for file in (board.deployment, *tree(board.var / "keys")):
        os.utime(file, (1_700_000_000, 1_700_000_000))  # scrubbing takes no file that was written just now
    board.start()
    wait_until(board.all_active, 3 * ANSWER_S, "all nodes are Active")
    wait_until(lambda: (board.var / "golden" / "manifest_b").exists(), 3 * ANSWER_S, "golden copies of all files")
    board.srfs(board.whole_bin, "down")


class Campaign:
    def __init__(self, folder, bin_dir, say):
        self.folder, self.bin, self.say = pathlib.Path(folder), mission.installed(bin_dir), say
        self.trials = []

    def trial(self, seed):
        order = random.Random(seed)
        folder = self.folder / f"trial_{seed}"
        shutil.rmtree(folder, ignore_errors=True)
        begin = time.monotonic()
        with Board(folder, self.bin, self.say) as board:
            fly_once(board)
            pristine = folder / "pristine"
            for part in ("prefix", "etc"):
                shutil.copytree(folder / part, pristine / part, symlinks=True)
            damaged = damage_at_random(board, order)
            starts = board.answers()
            speaker = board.speaker() if starts else "silence"
            problem = bring_back(board, pristine, damaged) if starts else "no answer"
        self.trials.append({"seed": seed, "damaged": [str(d) for d in damaged], "starts": starts, "answered": speaker, "problem": problem,
                            "took_s": round(time.monotonic() - begin, 1)})  # fmt: skip
        if not problem:
            shutil.rmtree(folder, ignore_errors=True)
        return self.trials[-1]

    def judge(self):
        answered = [t for t in self.trials if t["starts"]]
        back = [t for t in answered if not t["problem"]]
        return {"trials": len(self.trials), "answered": len(answered), "brought_back": len(back), "by_rescue": sum(t["answered"] == "rescue" for t in self.trials),
                "failed": [t for t in self.trials if t["problem"]],
                "checks": [{"what": f"each is answered within {BOUND_STARTS} starts", "ok": len(answered) == len(self.trials), "of": len(self.trials)},
                           {"what": "each that is answered comes back by telecommands alone", "ok": len(back) == len(answered), "of": len(answered)}],
                "ok": len(back) == len(self.trials)}  # fmt: skip


def show(summary):
    show_checks(summary["checks"])
    print(f"  {'trials':>8} {'answered':>9} {'by rescue':>10} {'brought back':>13}")
    print(f"  {summary['trials']:8} {summary['answered']:9} {summary['by_rescue']:10} {summary['brought_back']:13}")
    for trial in summary["failed"]:
        print(f"  seed {trial['seed']}: {trial['problem'][:300]}\n    damaged: {', '.join(trial['damaged'])}")
