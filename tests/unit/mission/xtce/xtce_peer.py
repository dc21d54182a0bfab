#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Writes the C++ source of the peer. The peer makes packets of every structure, event and telecommand of a dictionary with the
encoders of the flight code, and prints the values in them.

usage: xtce_peer.py --dictionary FOLDER --out FILE [--verification]
"""

import argparse
import pathlib

import jinja2
from mission_dictionary import camel, linear, load, snake
from mission_structures import CPP, identifier, structure_type

PARSER = argparse.ArgumentParser()
PARSER.add_argument("--dictionary", required=True)
PARSER.add_argument("--out", required=True)
PARSER.add_argument("--verification", action="store_true", help="also the reports of ttc")
ARGUMENTS = PARSER.parse_args()

D = load(ARGUMENTS.dictionary)
NAME_OF_NODE = {a["node"]: a["name"] for a in D.apids}
for entry in D.structures + D.wire_commands + D.parameters:
    if "node" in entry:
        entry["node_name"] = NAME_OF_NODE[entry["node"]]


def reference_values(kind):
    if kind == "structure":
        return [(s["id"], s["name"]) for s in D.structures if "id" in s]
    if kind in ("event", "event_or_none"):
        return [(0, "none")] * (kind == "event_or_none") + [(e["id"], e["name"]) for e in D.events]
    if kind == "store":
        return [(s["id"], s["name"]) for s in D.stores]
    if kind == "telemetry":  # the first element of each structure
        return [(0, "none")] + [(s["id"] << 16, s["name"]) for s in D.structures if "id" in s]
    if kind == "parameter":
        return [(p["id"], p["full_name"]) for p in D.parameters]
    return [(0, "none")] + [(f["code"], f["name"]) for f in D.failure_codes]


def described(fields):
    """XTCE has no word for a whole packet, which is the last field."""
    return [field for field in fields if field.get("type") != "packet"]


def is_named(field):
    """XTCE has a label for each value; elements of telemetry are too many."""
    return field.get("reference", "telemetry") != "telemetry"


def random_value(field, argument):
    """C++ expression for the random value of one element."""
    kind = field["type"]
    if "enum" in field:
        labels = ", ".join(f"{camel(field['enum'])}::{identifier(k)}" for k in D.enums[field["enum"]]["labels"])
        return f"random.pick<{camel(field['enum'])}>({{{labels}}})"
    if "reference" in field:
        return f"random.pick<{CPP[kind]}>({{{', '.join(str(v) for v, _ in reference_values(field['reference']))}}})"
    if kind == "text":
        return f"random.text({field['max']})"
    if kind == "time":
        return "random.time()"
    if kind == "bool":
        return "random.boolean()"
    if linear(field):
        offset, scale = linear(field)
        unknown = str(field["unknown"]) if "unknown" in field else "std::nullopt"
        return f"detail::from_raw<{CPP[kind]}>(random.integer<{CPP[kind]}>(), {offset}, {scale}, {unknown})"
    low, high = field.get("range", (None, None)) if argument else (None, None)
    if kind[0] == "f":
        if low is None:
            return f"random.real<{CPP[kind]}>({'true' if argument else 'false'})"
        return f"random.between<{CPP[kind]}>({float(low)}, {float(high)})"
    if low is None:
        return f"random.integer<{CPP[kind]}>()"
    return f"random.integer_between<{CPP[kind]}>({low}, {high})"


def fill(fields, target, argument=False):
    for field in fields:
        if "structure" in field:
            yield from fill(D.structure_of[field["structure"]]["fields"], f"{target}.{field['as']}", argument)
        elif field.get("count", 1) > 1:
            yield f"for (auto& element : {target}.{field['name']}) element = {random_value(field, argument)};"
        else:
            yield f"{target}.{field['name']} = {random_value(field, argument)};"


def expect(fields, target, out):
    """C++ lines that write the values as the ground should decode them."""
    for field in fields:
        if "structure" in field:
            yield from expect(D.structure_of[field["structure"]]["fields"], f"{target}.{field['as']}", out)
            continue
        names = f", names_of_{field['reference']}()" if is_named(field) else ""
        if field.get("count", 1) == 1:
            yield f"{out}[\"{field['name']}\"] = shown({target}.{field['name']}{names});"
            continue
        for i, label in enumerate(field.get("labels") or range(field["count"])):
            yield f"{out}[\"{field['name']}_{label}\"] = shown({target}.{field['name']}[{i}]{names});"


def put(field, value):
    """C++ line that encodes one value as the link carries it."""
    if field["type"] == "text":
        return f"detail::put_text(out, {value}, {field['max']});"
    return f"detail::put(out, {value});"


def main():
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(pathlib.Path(__file__).parent), trim_blocks=True,
                                     lstrip_blocks=True, undefined=jinja2.StrictUndefined)
    environment.globals.update(d=D, camel=camel, cpp=CPP, snake=snake, structure_type=structure_type, fill=fill, expect=expect, put=put, random_value=random_value,
                               reference_values=reference_values, described=described, verification=ARGUMENTS.verification)
    pathlib.Path(ARGUMENTS.out).write_text(environment.get_template("xtce_peer.cpp.jinja").render() + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
