# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""docs/reference/modes.md: what each node does in each mode, from the deployments' `modes`.

    python3 -m srfs.modes_page            # writes the page
    python3 -m srfs.modes_page --check    # exit code 1 when it is stale
"""

import argparse
import sys

from srfs import ROOT
from srfs.flight import deployments

PAGE = ROOT / "docs" / "reference" / "modes.md"
FLOWN = ("sim", "sim_mission", "board_rk3568")
HEAD = """# Modes

What each node does in each mode, as the deployments state it (`modes` in
[launch_config](../../launch_config/README.md#modes)). Written by `python3 -m srfs.modes_page`; a test
reports when it is stale. [Modes of the mission](../how-to/modes_of_the_mission.md) explains how to
change them.
"""


def reaction_lines(node, row):
    for key, words in (("hold", "held"), ("once", "once")):
        for order in row.get(key, []):
            yield f"- {node}: {words} `{order}`"
    if row.get("work") is False:
        yield f"- {node}: no work begins, what runs is ended in order"
    if "beacon_ms" in row:
        yield f"- {node}: a beacon each {row['beacon_ms'] / 1000:g} s"
    if row.get("open_retrieval") is False:
        yield f"- {node}: stored packets go down on request only"
    if "downlink_octets_s" in row:
        yield f"- {node}: stored packets and files share {row['downlink_octets_s']} octets/s"


def cause_line(cause):
    below = "enter_below" in cause
    enter, leave = (cause["enter_below"], cause["over_above"]) if below else (cause["enter_above"], cause["over_below"])
    first, second = ("below", "above") if below else ("above", "below")
    stale_s = cause.get("stale_s", 120)
    stale = f"; also without a sample for {stale_s} s" if stale_s else ""
    back = "then the commanded mode comes back" if cause.get("returns") else "then a telecommand may leave it"
    return (
        f"- {cause['name']}, mode {cause.get('mode', 'safe')}: `{cause['structure']}.{cause['field']}` {first} {enter:g}"
        f" in {cause.get('samples', 3)} samples in a row{stale};\n  over {second} {leave:g}, {back}"
    )


def section(name, before):
    modes = deployments.read(name)["modes"]
    critical = modes.get("critical") or deployments.read(name).get("ring", {}).get("critical") or []
    yield f"\n## {name}\n"
    yield f"- A node goes to safe by itself when `/mode` is silent for {modes.get('silence_ms', 30000) / 1000:g} s, or damaged."
    yield f"- Orders that are held are sent again each {modes.get('repeat_ms', 10000) / 1000:g} s."
    yield f"- A critical node ({', '.join(critical)}) that is not Active for {modes.get('lost_ms', 30000) / 1000:g} s: mode safe."
    yield from map(cause_line, modes.get("causes", []))
    if before and deployments.read(before)["modes"]["table"] == modes["table"]:
        yield f"- Reactions as in [{before}](#{before})."
        return
    for mode, rows in modes["table"].items():
        yield f"\n### {mode} ({name})\n"
        if rows and rows.get("shed"):
            yield f"Shed: {rows['shed']}.\n"
        lines = [line for node, row in (rows or {}).items() if node != "shed" for line in reaction_lines(node, row or {})]
        yield from lines or ["Nothing special."]


def page():
    sections = (section(name, FLOWN[0] if name != FLOWN[0] else None) for name in FLOWN)
    return HEAD + "\n".join(line for lines in sections for line in lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description="Writes docs/reference/modes.md from the deployments.")
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 when the page is stale")
    arguments = parser.parse_args()
    if not arguments.check:
        PAGE.write_text(page())
    elif not PAGE.exists() or PAGE.read_text() != page():
        print(f"{PAGE} is stale: PYTHONPATH=python python3 -m srfs.modes_page", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
