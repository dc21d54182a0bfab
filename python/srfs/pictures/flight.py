# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""docs/pictures/flight.svg: flies the simulated spacecraft, types what an operator would, and draws the terminal with what really came, at the
times at which it came. About a minute."""

import html
import os
import re
import subprocess
import time

from srfs.flight import mission
from srfs.program import MissionError

COLUMNS, FONT_PX, LINE_PX, MARGIN_PX = 124, 12, 17, 16
CHARACTER_PX = 0.6 * FONT_PX  # of a monospace font
TYPING_S, THINKING_S, READING_S, END_S = 0.03, 0.5, 1.4, 6.0
INK = {"prompt": "#7ee787", "command": "#f0f6fc", "output": "#c9d1d9", "comment": "#8b949e"}
# (comment, command as typed, first and last lines of its output that are shown)
SCRIPT = (
    ("a telecommand over the serial line: accepted, executed in the next CAN slot", "srfs-ground tc eps.switch_load load=2 state=on --wait", 6, 0),
    ("a node is killed: its neighbour in the ring restarts it", "pkill -9 -o payload_eps; sleep 0.5; srfs faults --since 1m --node payload_eps", 6, 0),
    ("no other node was restarted", "srfs status", 11, 0),
    ("a picture of the sky, searched for debris on board", "srfs-ground tc image.capture task=7 frames=8 interval_ms=100 method=tracklet --wait", 3, 3),
)


def fly(bin_dir, folder):
    """[(seconds since the start, kind, text)] of all that stood on the terminal; a command's text comes as it is typed."""
    shown, now = [], 0.0
    with mission.Mission(folder / "var", "sim", bin_dir, say=print) as flight:
        environment = {**os.environ, "PATH": f"{bin_dir}:{os.environ['PATH']}", "SRFS_VAR": str(flight.var)}
        for comment, command, first, last in SCRIPT:
            shown.append((now, "comment", f"# {comment}"))
            now += THINKING_S
            shown.append((now, "command", command))
            now += TYPING_S * len(command) + 0.2
            begin = time.monotonic()
            process = subprocess.Popen(["bash", "-c", as_run(command, flight)], cwd=folder, env=environment, stdin=subprocess.DEVNULL,
                                       stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)  # fmt: skip
            lines = [(time.monotonic() - begin, line.rstrip("\n")) for line in process.stdout]
            if process.wait():
                raise MissionError(f"{command}: {lines}")
            if len(lines) > first + last:
                lines = lines[:first] + [(lines[-last][0], "    ...")] * bool(last) + lines[len(lines) - last :]
            shown += [(now + after, "output", fitted(line)) for after, line in lines]
            now += (lines[-1][0] if lines else 0) + READING_S
    return shown, now + END_S


def as_run(command, flight):
    """What is typed names no folder: the recording's own is filled in."""
    command = command.replace("pkill -9 -o payload_eps", f"kill -9 {flight.node_pid('payload_eps')}")
    command = command.replace("srfs-ground ", f"srfs-ground --port {flight.var}/rs422 ")
    return re.sub(r"\bsrfs (?=faults|status)", f"srfs --var {flight.var} --deployment sim ", command)


def fitted(line):
    line = re.sub(r"\x1b\[[0-9;]*m", "", line)
    return line if len(line) <= COLUMNS else line[: COLUMNS - 3] + "..."


def picture(shown, length_s):
    """The SVG. Without animations (or where they are not wanted) all of it stands there at once."""
    height = 2 * MARGIN_PX + 22 + LINE_PX * len(shown)
    width = round(2 * MARGIN_PX + CHARACTER_PX * COLUMNS)
    rules, body = [], []
    for number, (at_s, kind, text) in enumerate(shown):
        y = MARGIN_PX + 22 + LINE_PX * (number + 1) - 5
        percent = 100 * at_s / length_s
        rules.append(f"@keyframes k{number}{{0%,{percent:.2f}%{{opacity:0}}{percent + 0.01:.2f}%,100%{{opacity:1}}}}"
                     f".l{number}{{animation:k{number} {length_s:.1f}s infinite}}")  # fmt: skip
        prompt = f'<tspan fill="{INK["prompt"]}">$ </tspan>' if kind == "command" else ""
        body.append(f'<text class="l{number}" x="{MARGIN_PX}" y="{y}" fill="{INK[kind]}" xml:space="preserve">{prompt}{html.escape(text)}</text>')
    dots = "".join(f'<circle cx="{MARGIN_PX + 4 + 18 * n}" cy="{MARGIN_PX}" r="5" fill="{ink}"/>' for n, ink in enumerate(("#ff5f56", "#ffbd2e", "#27c93f")))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}">\n'
        "<title>A flight of the simulated spacecraft, as recorded</title>\n"
        f"<style>text{{font:{FONT_PX}px ui-monospace,'DejaVu Sans Mono',Menlo,Consolas,monospace}}\n"
        "@media (prefers-reduced-motion: no-preference){\n" + "\n".join(rules) + "\n}</style>\n"
        f'<rect width="{width}" height="{height}" rx="8" fill="#0d1117" stroke="#30363d"/>\n{dots}\n' + "\n".join(body) + "\n</svg>\n"
    )


def make(bin_dir, folder, out):
    out.write_text(picture(*fly(bin_dir, folder)))
