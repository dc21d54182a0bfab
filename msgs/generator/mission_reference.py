#!/usr/bin/python3
"""Writes docs/dictionary.md, the reference page of the mission dictionary, or says that it is stale.

usage: mission_reference.py --dictionary FOLDER --page FILE [--check]
"""

import argparse
import pathlib
import sys

import jinja2

from mission_dictionary import load

COMMAND = "cmake --build <build folder> --target srfs_mission_reference"


def bounds(pair):
    low, high = pair
    if low is None:
        return f"≤ {high}"
    return f"≥ {low}" if high is None else f"{low} … {high}"


def kind(field):
    if "structure" in field:
        return "structure"
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
        parts.append(f"default {field['default']}")
    for name in ("soft", "hard"):
        if name in field.get("limits", {}):
            parts.append(f"{name} {bounds(field['limits'][name])}")
    return "; ".join(parts)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--dictionary", required=True)
    parser.add_argument("--page", required=True)
    parser.add_argument("--check", action="store_true")
    arguments = parser.parse_args()
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(pathlib.Path(__file__).parent), trim_blocks=True,
                                     lstrip_blocks=True, undefined=jinja2.StrictUndefined)
    environment.globals.update(d=load(arguments.dictionary), kind=kind, remarks=remarks)
    text = environment.get_template("mission_reference.md.jinja").render() + "\n"
    page = pathlib.Path(arguments.page)
    if not arguments.check:
        page.write_text(text, encoding="utf-8")
    elif not page.exists() or page.read_text(encoding="utf-8") != text:
        sys.exit(f"{page} does not say what the mission dictionary says; write it again with: {COMMAND}")


if __name__ == "__main__":
    main()
