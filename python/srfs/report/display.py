# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Progress on a terminal: lines, and on a tty one live line below them."""

import sys
import threading
import time


class Display:
    """Thread-safe. Colours and the live line only on a tty; plain lines otherwise; nothing when quiet."""

    def __init__(self, quiet=False, stream=sys.stdout):
        self.stream = stream
        self.quiet = quiet
        self.tty = stream.isatty() and not quiet
        self._lock = threading.Lock()
        self._live = ""
        self._start = time.monotonic()

    def colour(self, text, code):
        return f"\033[{code}m{text}\033[0m" if self.tty else text

    def line(self, text=""):
        if self.quiet:
            return
        with self._lock:
            self._wipe()
            self.stream.write(text + "\n")
            self._draw()

    def step(self, text):
        self.line(self.colour(f"[{time.monotonic() - self._start:5.1f} s] {text}", "1"))

    def result(self, good, text):
        mark = self.colour("ok", "32") if good else self.colour("NOT OK", "31;1")
        self.line(f"          {mark}  {text}")

    def note(self, text):
        self.line(f"          {text}")

    def live(self, text):
        if not self.tty:
            return
        with self._lock:
            self._wipe()
            self._live = text
            self._draw()

    def _wipe(self):
        if self.tty and self._live:
            self.stream.write("\r\033[K")

    def _draw(self):
        if self.tty and self._live:
            self.stream.write(self.colour(self._live[:150], "2"))
        self.stream.flush()


def table(rows, indent="  "):
    """Lines of a table; the first row is the heading. Numbers to the right."""
    texts = [[cell if isinstance(cell, str) else "-" if cell is None else f"{cell}" for cell in row] for row in rows]
    widths = [max(len(row[i]) for row in texts) for i in range(len(rows[0]))]
    lines = []
    for texts_row, row in zip(texts, rows):
        cells = [t.ljust(w) if isinstance(c, str) else t.rjust(w) for t, w, c in zip(texts_row, widths, row)]
        lines.append((indent + "  ".join(cells)).rstrip())
    return lines
