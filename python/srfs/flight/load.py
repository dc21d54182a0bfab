# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Programs beside a flight that take the CPUs."""

import contextlib
import os
import shutil
import signal
import subprocess
import tempfile

from srfs.program import MissingProgram


@contextlib.contextmanager
def stress_ng(options, each_alone=False):
    """Runs `stress-ng OPTIONS` until the end of the block. Yields is_running().

    each_alone: each worker has its own session: a kernel that shares CPU time among sessions (autogroup, as in Debian) would treat all
    workers of one session as a single competitor, which is no load.
    """
    if not shutil.which("stress-ng"):
        raise MissingProgram("stress-ng")
    workers = [options.split()]
    if each_alone:
        workers = [[what, "1"] for what, count in zip(workers[0][::2], workers[0][1::2]) for _ in range(int(count))]
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        loads = []
        for worker in workers:
            loads.append(subprocess.Popen(["stress-ng", *worker, "--quiet"], cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                          stderr=subprocess.DEVNULL, start_new_session=True))  # fmt: skip
            stack.callback(_end_session, loads[-1])
        yield lambda: all(load.poll() is None for load in loads)


def _end_session(process):
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
