#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Writes docs/reference/dictionary.md, the reference page of the mission dictionary, or reports that the page is stale.

usage: mission_reference.py --dictionary FOLDER --page FILE [--check]
"""

import argparse
import pathlib
import sys
import textwrap

import jinja2

from mission_dictionary import load

COMMAND = "cmake --build <build folder> --target srfs_mission_reference"
PROSE, LONGEST = 100, 120  # columns: of wrapped text; of any line
NO_BREAK = "\u00a0"
BELOW = "*below*"  # in a cell whose text stands in the list below the table


def bounds(pair):
    low, high = pair
    if low is None:
        return f"≤ {high}"
    return f"≥ {low}" if high is None else f"{low} … {high}"


def kind(field):
    if "structure" in field:
        return "structure"
    if field["type"] == "parameter_value":
        return "as the parameter"
    name = f"{field['type']} ≤ {field['max']}" if field["type"] in ("text", "packet") else field["type"]
    return f"{name}[{field['count']}]" if "count" in field else name


def remarks(field):
    parts = []
    if "labels" in field:
        parts.append("elements: " + ", ".join(field["labels"]))
    if "enum" in field:
        parts.append(f"enum {field['enum']}")
    if "reference" in field:
        parts.append(f"number of a {field['reference'].replace('_', ' ')}")
    if "calibration" in field:
        parts.append(f"calibration {list(field['calibration'].values())[0]}")
    if "unknown" in field:
        parts.append(f"raw {field['unknown']} = unknown")
    if "range" in field:
        parts.append("range " + bounds(field["range"]))
    if "default" in field:
        parts.append(f"default {field['default']}" if field["default"] != "" else "default empty")
    for name in ("soft", "hard"):
        if name in field.get("limits", {}):
            parts.append(f"{name} {bounds(field['limits'][name])}")
    if field.get("guarded", False):
        parts.append("guarded")
    return "; ".join(parts)


def ordered(reports):
    """What a telecommand requests from the spacecraft, in a phrase."""
    if "argument" in reports:
        what = f"the structure that the argument {reports['argument']} names"
    elif "structure" in reports:
        what = f"structure {reports['structure']}"
    else:
        what = f"TM {reports['service'][0]},{reports['service'][1]}"
    several = reports.get("several", False)
    if reports.get("may_be_none", False):
        return f"{what}, {'any number of reports' if several else 'or nothing'}"
    return f"{what}, one report or more" if several else what


def groups(command):
    """The counted groups of a telecommand's arguments, in a sentence."""
    head = command.get("head", 0)
    count = f"a u16 count ({command.get('min_groups', 1)} to {command.get('max_groups', 16)})"
    if not head:
        return f"Layout: {count}, then that many groups of the arguments."
    first = "argument" if head == 1 else f"{head} arguments"
    return f"Layout: the first {first} once, {count}, then that many groups of the other arguments."


def how(command, apid):
    """Address and properties of a telecommand, in sentences."""
    address = f"service {command['service'][0]},{command['service'][1]}" if "service" in command else f"service 8,1 function {command['function']}"
    sentences = [f"APID {apid} ({command['node']}), {address}."]
    if "repeated" in command:
        sentences.append(groups(command))
    sentences.append(f"Repeat: {command['repeat']}.")
    sentences.append(f"Completes within {command.get('timeout_ms', 10000)} ms.")
    if "modes" in command:
        sentences.append(f"Modes: {', '.join(command['modes'])}.")
    if command.get("hazardous", False):
        sentences.append("**Hazardous.**")
    if command.get("recovery", False):
        sentences.append("Runs without storage.")
    if "reports" in command:
        sentences.append(f"Requests {ordered(command['reports'])}.")
    return " ".join(sentences)


def unbroken(text):
    """Stays in one line in `wrapped`."""
    return text.replace(" ", NO_BREAK)


def wrapped(text, indent=""):
    lines = textwrap.fill(text, PROSE, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    return lines.replace(NO_BREAK, " ")


def line_of(cells):
    return f"| {' | '.join(str(cell) for cell in cells)} |"


def table(head, rows, names=0, movable=()):
    """A table whose lines fit. A row that is too long gives its cells of these columns, the last first, to a list below the table, where the cell of
    column `names` names it."""
    lines = [line_of(head), "|" + "---|" * len(head)]
    notes = []
    for row in rows:
        cells, moved = list(row), []
        for column in movable:
            if len(line_of(cells)) <= LONGEST:
                break
            if cells[column]:
                moved.insert(0, cells[column])
                cells[column] = BELOW
        lines.append(line_of(cells))
        if moved:
            notes.append(wrapped(f"- `{row[names]}`: {'; '.join(moved)}", "  "))
    return "\n".join(lines + (["", *notes] if notes else []))


def field_table(head, fields):
    """The arguments of a telecommand or the fields of a structure."""
    rows = []
    for f in fields:
        if "structure" in f:
            rows.append((f"*{f['structure']}*", "", "", "its fields, in this place", ""))
        else:
            rows.append((f["name"], kind(f), f.get("unit", ""), f["description"], remarks(f)))
    return table((head, "Type", "Unit", "Meaning", "Values"), rows, movable=(4, 3))


def parameter_list(parameters):
    """One entry for each name: parameters of several nodes have one meaning."""
    meanings = {}
    for p in parameters:
        meanings.setdefault((p["name"], p["description"]), None)
    return "\n".join(wrapped(f"- `{name}`: {meaning}", "  ") for name, meaning in meanings)


def event_entry(event):
    """Number, name, severity and text of an event, and the type of each field."""
    fields = ", ".join(unbroken(f"`{f['name']}` {kind(f)}") for f in event["fields"])
    entry = f"- {event['id']} **{event['name']}**, {event['severity']}: \"{event['text']}\"."
    return wrapped(f"{entry} Fields: {fields}" if fields else entry, "  ")


def enum_entry(name, enum):
    labels = ", ".join(unbroken(f"{value} {label}") for label, value in enum["labels"].items())
    return wrapped(f"- `{name}` ({enum['type']}): {enum['description']}. Values: {labels}", "  ")


def elements(d, fields):
    """(name, field) of each element, structures laid out in place: as a monitor names them."""
    for field in fields:
        if "structure" in field:
            yield from elements(d, d.structure_of[field["structure"]]["fields"])
        elif field.get("count", 1) == 1:
            yield field["name"], field
        else:
            for i in range(field["count"]):
                yield field["name"] + (f".{field['labels'][i]}" if "labels" in field else f"[{i}]"), field


def monitor_rows(d):
    """The factory set of monitors, as nodes/ttc/services/monitoring.cpp makes it."""
    rows = [(m["id"], m["parameter"], f"{m['check']} {bounds([m.get('low'), m.get('high')])}", m.get("low_event", m.get("high_event", ""))) for m in d.monitors]
    listed = {(m["parameter"], m.get("low"), m.get("high")) for m in d.monitors}
    structures = sorted((s for s in d.structures if "id" in s and not s["fragment"]), key=lambda s: s["id"])
    number, stale = 1000, []
    for structure in structures:
        for name, field in elements(d, structure["fields"]):
            if structure["name"] == "beacon" and field["name"] in d.beacon:
                continue
            for kind_of_limit in ("soft", "hard"):
                low, high = field.get("limits", {}).get(kind_of_limit, (None, None))
                if low is None and high is None:
                    continue
                if (f"{structure['name']}.{name}", low, high) not in listed:
                    rows.append((number, f"{structure['name']}.{name}", bounds([low, high]), f"monitor.{kind_of_limit}_limit"))
                number += 1
        if structure["node"] != "ttc" and structure["interval_ms"] >= 1000:
            first = next(name for name, _ in elements(d, structure["fields"]))
            stale.append((2000 + structure["id"], f"{structure['name']}.{first}", f"a sample in {10 * structure['interval_ms'] // 1000} s", "monitor.stale"))
    return rows + stale


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--dictionary", required=True)
    parser.add_argument("--page", required=True)
    parser.add_argument("--check", action="store_true")
    arguments = parser.parse_args()
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(pathlib.Path(__file__).parent), trim_blocks=True,
                                     lstrip_blocks=True, undefined=jinja2.StrictUndefined)
    environment.globals.update(d=load(arguments.dictionary), enum_entry=enum_entry, event_entry=event_entry, field_table=field_table, how=how, kind=kind,
                               parameter_list=parameter_list, monitor_rows=monitor_rows, remarks=remarks, table=table, wrapped=wrapped)
    text = environment.get_template("mission_reference.md.jinja").render().rstrip("\n") + "\n"
    page = pathlib.Path(arguments.page)
    too_long = [line for line in text.splitlines() if len(line) > LONGEST]
    if too_long:
        sys.exit(f"{page} would have lines of more than {LONGEST} characters, for example: {too_long[0]}")
    if not arguments.check:
        page.write_text(text, encoding="utf-8")
    elif not page.exists() or page.read_text(encoding="utf-8") != text:
        sys.exit(f"{page} differs from the mission dictionary; write it again with: {COMMAND}")


if __name__ == "__main__":
    main()
