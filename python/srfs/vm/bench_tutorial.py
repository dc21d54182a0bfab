# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""docs/tutorial/from_simulation_to_bench.md word for word, with the sections that need hardware: in a virtual machine whose hardware QEMU and
the kernel play. Two USB serial adapters (FTDI) on one line, two CAN adapters (SJA1000) on one bus, the kernel's virtual camera (vivid). Their
drivers are Linux' own; levels, bit times and real sensors are not there. Three flights on an emulated processor, about three minutes. The last
line is "N passed, M failed".

Exit codes: 0 all passed, 1 some failed, 2 cannot be done here.
"""

import argparse
import contextlib
import os
import pathlib
import select
import socket
import sys
import tempfile
import threading

from srfs import ROOT
from srfs.vm import guest

DEADLINE_S = 1200


class SerialLine:
    """Between the two serial adapters. What the other end does not read is lost, as on a line; QEMU alone would stop the guest until it is read."""

    ENDS = ("board", "ground")

    def __init__(self, folder):
        self.paths = [folder / end for end in self.ENDS]
        self._stop, self._wake = socket.socketpair()
        self._listeners = []
        for path in self.paths:
            listener = socket.socket(socket.AF_UNIX)
            listener.bind(str(path))
            listener.listen(1)
            self._listeners.append(listener)
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self):
        ends = []
        for listener in self._listeners:
            if self._stop in select.select([listener, self._stop], [], [])[0]:
                return
            end = listener.accept()[0]
            end.setblocking(False)
            end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)  # as little as an adapter holds
            ends.append(end)
        others = dict(zip(ends, reversed(ends)))
        while True:
            ready = select.select([self._stop, *ends], [], [])[0]
            if self._stop in ready:
                return
            for end in ready:
                try:
                    octets = end.recv(4096)
                except ConnectionResetError:
                    octets = b""
                if not octets:
                    return  # QEMU ended
                with contextlib.suppress(BlockingIOError, BrokenPipeError):
                    others[end].send(octets)

    def close(self):
        self._wake.close()
        self._thread.join()


def adapters(line):
    """QEMU's words: two CAN adapters on one bus, two serial ones on the line."""
    words = ["-object", "can-bus,id=bus", "-device", "kvaser_pci,canbus=bus", "-device", "kvaser_pci,canbus=bus", "-device", "qemu-xhci"]
    for path in line.paths:
        words += ["-chardev", f"socket,id={path.name},path={path}", "-device", f"usb-serial,chardev={path.name}"]
    return words


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    guest.add_options(parser, str(DEADLINE_S))
    parser.set_defaults(deadline=DEADLINE_S)
    options = parser.parse_args()
    os.chdir(ROOT)

    def run():
        with tempfile.TemporaryDirectory(prefix="srfs-bench-") as folder:
            line = SerialLine(pathlib.Path(folder))
            try:
                return guest.run(guest.python("bench_tutorial.py", SRFS_IN_GUEST=1), options, guest.say, adapters(line))
            finally:
                line.close()

    return guest.exit_code_of(run)


if __name__ == "__main__":
    sys.exit(main())
