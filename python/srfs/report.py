# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""How results are judged, summed up, written, drawn and shown. Pure but for files and the terminal."""

import csv
import json
import sys
import threading
import time

MOST_SHOWN = 5  # violations of a check
SHARES = {"p50": 0.5, "p90": 0.9, "p99": 0.99, "p99_9": 0.999, "max": 1.0}

# --- what was judged: one line each, true or not -------------------------------------------------------------------------


def check(good, what):
    return {"ok": bool(good), "what": what}


def check_none(violations, what, count=None):
    """violations: texts, of `count` that were looked at."""
    return {"what": what, "ok": not violations, "violations": len(violations), "shown": violations[:MOST_SHOWN],
            **({} if count is None else {"of": count})}  # fmt: skip


def all_ok(checks):
    return all(result["ok"] for result in checks)


def show_checks(checks):
    for result in checks:
        count = f" ({result['of']})" if "of" in result else ""
        print(f"  {'ok    ' if result['ok'] else 'NOT OK'}  {result['what']}{count}")
        for line in result.get("shown", ()):
            print(f"            {line}")


def conclude(checks):
    """Shows the checks and their number; the exit code of a program that is its checks."""
    show_checks(checks)
    failed = sum(not result["ok"] for result in checks)
    print(f"{len(checks) - failed} passed, {failed} failed")
    return int(failed != 0)


def verdict(met):
    return "met" if met else "missed"


# --- figures of many values ----------------------------------------------------------------------------------------------


def percentile(values, q):
    """The q-quantile (0 to 1) of values, None without values."""
    if not values:
        return None
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(q * len(ordered)))]


def quantiles(values, names="p50 p99 max", unit=1, digits=None, suffix=""):
    """{name + suffix: that quantile, in units, rounded}; None each without values."""
    found = {name: percentile(values, SHARES[name]) for name in names.split()}
    return {name + suffix: value if value is None or digits is None else round(value / unit, digits) for name, value in found.items()}


# --- files ---------------------------------------------------------------------------------------------------------------


def write_csv(path, head, rows):
    with open(path, "w", newline="") as file:
        lines = csv.writer(file)
        lines.writerow(head)
        lines.writerows(rows)


def write_messages(path, messages):
    """Messages of a Lines, one a line, without the time of their arrival here."""
    with open(path, "w") as file:
        for message in messages:
            file.write(json.dumps({key: value for key, value in message.items() if key != "arrived"}) + "\n")


def pyplot():
    """matplotlib's, that draws into files; ImportError where it is missing."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    return pyplot


def save(figure, folder, name, dpi, rect=(0, 0, 1, 1)):
    """NAME.svg and NAME.png."""
    figure.tight_layout(rect=rect)
    for kind in ("svg", "png"):
        figure.savefig(folder / f"{name}.{kind}", dpi=dpi)
    pyplot().close(figure)


# --- the terminal --------------------------------------------------------------------------------------------------------


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
