#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Writes the C++ view of the mission dictionary for flight code: mission/structures.hpp and, beside --source, its functions.

With a fragment: what it adds alone, as one header for the package of the node that it belongs to.

usage: mission_structures.py --dictionary FOLDER --out FILE (--source FILE | --fragment FILE [--check])
"""

import argparse
import pathlib
import sys

import jinja2

from mission_dictionary import FragmentView, OCTETS, camel, has_packet, has_parameter_value, linear, load, snake

CPP = {"u8": "std::uint8_t", "u16": "std::uint16_t", "u32": "std::uint32_t", "u64": "std::uint64_t", "i8": "std::int8_t",
       "i16": "std::int16_t", "i32": "std::int32_t", "i64": "std::int64_t", "f32": "float", "f64": "double", "bool": "bool",
       "time": "TaiTime", "text": "std::string", "packet": "Octets"}
SEVERITIES = {"info": 1, "low": 2, "medium": 3, "high": 4}
KEYWORDS = {"auto", "default", "switch", "new", "delete", "register", "protected"}


def identifier(label):
    return label + "_" if label in KEYWORDS else label


def structure_type(structure):
    return camel(structure["name"]) + ("Housekeeping" if structure["kind"] == "housekeeping" and structure["name"] != "beacon" else "")


class Emitter:
    """Turns fields into C++ lines."""

    def __init__(self, dictionary):
        self.dictionary = dictionary

    def element_type(self, field):
        if "enum" in field:
            return camel(field["enum"])
        return "float" if linear(field) else CPP[field["type"]]

    def member(self, field):
        if "structure" in field:
            return f"{structure_type(self.dictionary.structure_of[field['structure']])} {field['as']}{{}};"
        kind = self.element_type(field)
        if "count" in field:
            if "per" in field:
                return f"List<{kind}, most_{field['per']}> {field['name']}{{{field['count']}}};  ///< {field.get('description', '')}"
            kind = f"std::array<{kind}, {field['count']}>"
        unit = f" [{field['unit']}]" if "unit" in field else ""
        return f"{kind} {field['name']}{{}};  ///< {field.get('description', '')}{unit}"

    def encode(self, field, owner=""):
        if "structure" in field:
            return f"{owner}{field['as']}.encode(out);"
        name = "element" if "count" in field else owner + field["name"]
        if field["type"] == "text":
            put = f"detail::put_text(out, {name}, {field['max']});"
        elif field["type"] == "packet":
            put = f"out.bytes({name});"
        elif linear(field):
            offset, scale = linear(field)
            put = f"detail::put(out, detail::to_raw<{CPP[field['type']]}>({name}, {offset}, {scale}, {self.unknown(field)}));"
        else:
            put = f"detail::put(out, {name});"
        return f"for (const auto& element : {owner}{field['name']}) {put}" if "count" in field else put

    def decode(self, field, owner="value"):
        if "structure" in field:
            kind = structure_type(self.dictionary.structure_of[field["structure"]])
            return f"{{ const auto part = {kind}::decode(in); if (!part) return std::nullopt; {owner}.{field['as']} = *part; }}"
        name = "element" if "count" in field else f"{owner}.{field['name']}"
        if field["type"] == "text":
            take = f"if (!detail::take_text(in, {name}, {field['max']})) return std::nullopt;"
        elif field["type"] == "packet":
            take = f"if (!detail::take_packet(in, {name}, {field['max']})) return std::nullopt;"
        elif linear(field):
            offset, scale = linear(field)
            take = f"{name} = detail::from_raw(detail::take<{CPP[field['type']]}>(in), {offset}, {scale}, {self.unknown(field)});"
        elif field["type"] == "time":
            take = f"if (!detail::take_time(in, {name})) return std::nullopt;"
        else:
            take = f"{name} = detail::take<{self.element_type(field)}>(in);"
        return f"for (auto& element : {owner}.{field['name']}) {{ {take} }}" if "count" in field else take

    @staticmethod
    def unknown(field):
        return str(field["unknown"]) if "unknown" in field else "std::nullopt"

    def check(self, field, number):
        """Lines that read and check one argument; a bad one returns its number, a missing one 0."""
        name = f"value.{field['name']}"
        bad = f"return Err(ArgumentError{{{number}}});"
        short = "if (!in.ok()) return Err(ArgumentError{0});"
        if field["type"] == "text":
            return [f"if (!detail::take_text(in, {name}, {field['max']})) return Err(detail::argument_error(in, {number}));"]
        if field["type"] == "time":
            return [f"if (!detail::take_time(in, {name})) return Err(detail::argument_error(in, {number}));"]
        if field["type"] == "bool":
            return ["const std::uint8_t octet_" + field["name"] + " = in.u8();", short,
                    f"if (octet_{field['name']} > 1) {bad}", f"{name} = octet_{field['name']} == 1;"]
        lines = [f"{name} = detail::take<{self.element_type(field)}>(in);", short]
        if "enum" in field:
            lines.append(f"if (!is_valid({name})) {bad}")
        elif "range" in field and self.within(name, field):
            lines.append(f"if (!({self.within(name, field)})) {bad}")
        elif field["type"][0] == "f":
            lines.append(f"if (!std::isfinite({name})) {bad}")
        return lines

    @staticmethod
    def within(name, field):
        """Condition that the value is in its range (false for not-a-number); empty where every value of the type is."""
        low, high = field["range"]
        if field["type"][0] == "f":
            suffix = "F" if field["type"] == "f32" else ""
            return f"{name} >= {float(low)}{suffix} && {name} <= {float(high)}{suffix}"
        bits = 8 * OCTETS[field["type"]]
        lowest, highest = (0, 2**bits - 1) if field["type"][0] == "u" else (-2**(bits - 1), 2**(bits - 1) - 1)
        return " && ".join(([f"{name} >= {low}"] if low > lowest else []) + ([f"{name} <= {high}"] if high < highest else []))


def write(path, text):
    """Only what changes: who includes it is compiled again otherwise."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--dictionary", required=True)
    parser.add_argument("--out", required=True)
    kind = parser.add_mutually_exclusive_group(required=True)
    kind.add_argument("--source", help="what the header's functions do goes there: every source that includes the header compiles without them")
    kind.add_argument("--fragment", help="only what this fragment adds to the dictionary")
    parser.add_argument("--check", action="store_true", help="only say whether the file is as it should be")
    arguments = parser.parse_args()
    dictionary = load(arguments.dictionary, [arguments.fragment] if arguments.fragment else [])
    shown = FragmentView(dictionary) if arguments.fragment else dictionary
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(pathlib.Path(__file__).parent), trim_blocks=True,
                                     lstrip_blocks=True, undefined=jinja2.StrictUndefined)
    environment.globals.update(camel=camel, snake=snake, identifier=identifier, structure_type=structure_type, cpp=CPP,
                               octets=OCTETS, severities=SEVERITIES, emit=Emitter(dictionary), d=shown, has_packet=has_packet,
                               work_threads=[s for s in shown.structures if s["name"] == f"{s.get('node')}_work"],
                               has_parameter_value=has_parameter_value, fragment=arguments.fragment and pathlib.Path(arguments.fragment).name)
    def text_of(template):
        return environment.get_template(template).render()

    out = pathlib.Path(arguments.out)
    text = text_of("mission_structures.hpp.jinja")
    if arguments.check:
        if not out.exists() or out.read_text(encoding="utf-8") != text:
            sys.exit(f"{out} does not say what {arguments.fragment} says; write it again with mission_structures.py without --check")
        return
    write(out, text)
    if arguments.source:
        write(pathlib.Path(arguments.source), text_of("mission_structures.cpp.jinja"))


if __name__ == "__main__":
    main()
