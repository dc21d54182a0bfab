# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Reads and checks the mission dictionary (msgs/mission, mission) for the build-time generators.

The run-time loader (msgs/mission/dictionary.cpp) checks the same files for themselves and names lines; here only what the
generated code relies on is checked.
"""

import pathlib
import re
import sys

import yaml

OCTETS = {"u8": 1, "u16": 2, "u32": 4, "u64": 8, "i8": 1, "i16": 2, "i32": 4, "i64": 8, "f32": 4, "f64": 8, "bool": 1, "time": 8}
MAX_STRUCTURE = 1024  # srfs_msgs/PayloadTelemetry.data
MAX_EVENT = 200  # srfs_msgs/Event.data
MAX_ARGUMENTS = 512  # srfs_msgs/Telecommand.arguments
MAX_PACKET = 1024  # the same with a packet among them: never forwarded
FRAGMENT_KEYS = {"subsystem", "apids", "enums", "structures", "commands", "events", "parameters"}
IDENTIFIER = re.compile(r"^[a-z][a-z0-9]*(_[a-z0-9]+)*$")


class DictionaryError(Exception):
    """The dictionary cannot be used; the text names file and entry."""


def core_folder():
    """SRFS' own part of the dictionary: beside the generator, installed or in the source tree."""
    beside = pathlib.Path(__file__).resolve().parent.parent
    return beside / "core" if (beside / "core").exists() else beside / "mission"


def files_of(folder):
    """As Dictionary::files (msgs/mission/dictionary.hpp)."""
    own = folder / "mission.yaml"
    included = yaml.safe_load(own.read_text(encoding="utf-8")).get("include") if own.exists() else None
    if included is not None:
        for name in included:
            if not re.fullmatch(r"(?!\.\.)[^/]+/dictionary\.yaml", name):
                raise DictionaryError(f"{own}: include: FOLDER/dictionary.yaml, not '{name}'")
        return [own, *sorted(core_folder().glob("*.yaml")), *(folder / name for name in included)]
    files = sorted(folder.glob("*.yaml"), key=lambda f: (f.name != "mission.yaml", f.name))
    if not files:
        raise DictionaryError(f"{folder}: no dictionary here")
    return files


class Dictionary:
    """All files of one folder and fragments of added nodes, merged. Lists keep file order; files are read in the order of their names, mission.yaml first."""

    def __init__(self, folder, fragments=()):
        self.spacecraft = {}
        self.apids, self.services, self.stores, self.failure_codes = [], [], [], []
        self.enums = {}
        self.structures, self.commands, self.events, self.parameters = [], [], [], []
        self.payloads, self.parameter_ids, self.beacon, self.modes = [], {}, {}, {}
        self.monitors, self.event_actions = [], []
        for file in files_of(pathlib.Path(folder)):
            self._merge(file)
        self._add_modes()
        for fragment in fragments:
            self._merge(pathlib.Path(fragment), fragment=True)
        self.apid_of = {a["node"]: a["apid"] for a in self.apids}
        own = sorted((a for a in self.apids if not a["fragment"]), key=lambda a: a["apid"])
        self.lists = {"payloads": self.payloads, "nodes": [a["node"] for a in own]}
        for structure in self.structures:
            for field in structure["fields"]:
                self._lay_out(field, structure)
        self.structure_of = {s["name"]: s for s in self.structures}
        self.structures = self._included_first()
        self.parameters = [single for entry in self.parameters for single in self._of_each_node(entry)]
        self._check()
        self.wire_commands = list(self._wire_commands())

    def _included_first(self):
        """The structures in their order, but each behind those that it includes."""
        ordered = {}

        def add(structure, including):
            if structure["name"] in including:
                raise DictionaryError(f"{structure['file']}: {structure['name']} includes itself")
            for field in structure["fields"]:
                if field.get("structure") in self.structure_of:
                    add(self.structure_of[field["structure"]], {*including, structure["name"]})
            ordered.setdefault(structure["name"], structure)

        for structure in self.structures:
            add(structure, set())
        return list(ordered.values())

    def _merge(self, file, fragment=False):
        content = yaml.safe_load(file.read_text(encoding="utf-8"))
        if fragment and not content.keys() <= FRAGMENT_KEYS:
            raise DictionaryError(f"{file.name}: a fragment has only {', '.join(sorted(FRAGMENT_KEYS))}")
        self.spacecraft.update(content.get("spacecraft", {}))
        self.payloads += content.get("payloads", [])
        self.monitors += content.get("monitors", [])
        self.event_actions += content.get("event_actions", [])
        self.parameter_ids.update(content.get("parameter_ids", {}))
        self.beacon.update(content.get("beacon", {}))
        self.modes.update(content.get("modes", {}))
        for name, enum in content.get("enums", {}).items():
            if name in self.enums:
                raise DictionaryError(f"{file.name}: enum {name} stands twice")
            self.enums[name] = {**enum, "fragment": fragment}
        for key in ("apids", "services", "stores", "failure_codes", "structures", "commands", "events", "parameters"):
            for entry in content.get(key, []):
                entry.setdefault("fields", [])
                entry["file"] = file.name
                entry["of_srfs"] = file.parent == core_folder()
                entry["fragment"] = fragment
                getattr(self, key).append(entry)

    def _add_modes(self):
        """The mission's modes beside those of SRFS."""
        labels = self.enums.get("mission_mode", {}).get("labels", {})
        for name, number in self.modes.items():
            if name in labels or number in labels.values() or not 0 < number <= 31:
                raise DictionaryError(f"mission.yaml: modes: {name}: a new name, and a new number from 1 to 31")
            labels[name] = number

    def _lay_out(self, field, structure):
        """A field per payload or per node (`count: payloads`) has as many elements as the mission has."""
        if field.get("count") in self.lists:
            field["labels"] = self.lists[field["count"]]
            field["per"], field["count"] = field["count"], len(field["labels"])
            if not field["labels"]:
                raise DictionaryError(f"{structure['file']}: {structure['name']}.{field['name']}: the mission's file has no payloads")

    def _of_each_node(self, entry):
        """One entry for each node that has the parameter, with ids that count up; "name" is that at the node."""
        nodes = entry.get("nodes") or [entry["node"]]
        first = self.parameter_ids.get(entry["name"], entry["id"]) if "nodes" in entry else entry["id"]
        for i, node in enumerate(self.lists["nodes" if nodes == "all" else nodes] if isinstance(nodes, str) else nodes):
            yield {**entry, "node": node, "id": first + i, "full_name": f"{node}.{entry['name']}"}

    def _wire_commands(self):
        """Commands whose arguments have one form each: not those with a whole packet, and instead of one whose value has the type of a parameter, one for
        each parameter."""
        for command in self.commands:
            if has_packet(command):
                continue
            if not has_parameter_value(command):
                yield command
                continue
            for parameter in self.parameters:
                value = {k: v for k, v in parameter.items() if k in ("type", "unit", "range", "enum", "max", "description")}
                yield {**command, "name": f"{command['name']}_{parameter['full_name']}", "repeated": False, "fixed": [(1, 16), (parameter["id"], 16)],
                       "description": f"Set {parameter['full_name']}: {parameter['description']}", "arguments": [{"name": "value", **value}],
                       "parameter": parameter}

    def _check(self):
        self._unique(self.parameters, "id")
        self._unique(self.parameters, "full_name")
        own_nodes = {a["node"] for a in self.apids if a["of_srfs"]}
        for parameter in self.parameters:
            self._check_fields(parameter, [parameter], MAX_ARGUMENTS)
            if parameter["node"] not in self.apid_of:
                raise DictionaryError(f"{parameter['file']}: {parameter['name']}: unknown node '{parameter['node']}'")
            if parameter.get("guarded") and parameter["node"] in own_nodes and not parameter["of_srfs"]:
                raise DictionaryError(f"{parameter['file']}: {parameter['name']}: guarded, but the program of {parameter['node']} is SRFS' own and does not know it")
        self._unique(self.structures, "name")
        self._unique([s for s in self.structures if "id" in s], "id")
        self._unique(self.commands, "name")
        self._unique(self.events, "name")
        self._unique(self.events, "id")
        self._unique(self.failure_codes, "code")
        self._unique(self.apids, "apid")
        for structure in self.structures:
            limit = structure.get("max_size", MAX_STRUCTURE)
            self._check_fields(structure, structure["fields"], limit)
        for event in self.events:
            self._check_fields(event, event["fields"], MAX_EVENT)
            for name in re.findall(r"\{(.*?)\}", event["text"]):
                if name not in [f["name"] for f in event["fields"]]:
                    raise DictionaryError(f"{event['file']}: {event['name']}: text names the unknown field '{name}'")
        for command in self.commands:
            command.setdefault("arguments", [])
            self._check_fields(command, command["arguments"], MAX_PACKET if has_packet(command) else MAX_ARGUMENTS)
            if command["node"] not in self.apid_of:
                raise DictionaryError(f"{command['file']}: {command['name']}: unknown node '{command['node']}'")
            ordered = command.get("reports", {}).get("structure")
            if ordered is not None and ordered not in self.structure_of:
                raise DictionaryError(f"{command['file']}: {command['name']}: unknown structure '{ordered}'")

    @staticmethod
    def _unique(entries, key):
        seen = {}
        for entry in entries:
            if entry[key] in seen:
                raise DictionaryError(f"{entry['file']}: {key} {entry[key]} stands in {seen[entry[key]]} already")
            seen[entry[key]] = entry["file"]

    def _check_fields(self, owner, fields, limit):
        where = f"{owner['file']}: {owner['name']}"
        for field in fields:
            if "structure" in field:
                if field["structure"] not in self.structure_of:
                    raise DictionaryError(f"{where}: unknown structure '{field['structure']}'")
                continue
            if not IDENTIFIER.match(field["name"]):
                raise DictionaryError(f"{where}: '{field['name']}' is not a lower-case identifier")
            if field["type"] not in ("text", "packet", "parameter_value") and field["type"] not in OCTETS:
                raise DictionaryError(f"{where}.{field['name']}: unknown type '{field['type']}'")
            if "enum" in field and field["enum"] not in self.enums:
                raise DictionaryError(f"{where}.{field['name']}: unknown enum '{field['enum']}'")
        if self.size(fields) > limit:
            raise DictionaryError(f"{where}: {self.size(fields)} octets, at most {limit}")

    def size(self, fields):
        """Largest encoded size in octets."""
        return sum(self.field_size(f) for f in fields)

    def field_size(self, field):
        if "structure" in field:
            return self.size(self.structure_of[field["structure"]]["fields"])
        if field["type"] == "text":
            return 1 + field["max"]
        if field["type"] == "packet":
            return field["max"]
        if field["type"] == "parameter_value":
            return 256
        return OCTETS[field["type"]] * field.get("count", 1)


def has_packet(command):
    """Whether one of its arguments is a whole packet."""
    return any(a.get("type") == "packet" for a in command["arguments"])


def has_parameter_value(command):
    """The type of an argument depends on another one: there is no struct for such a command."""
    return any(f["type"] == "parameter_value" for f in command["arguments"])


def linear(field):
    """(offset, scale) of a field with a linear calibration, else None."""
    return field.get("calibration", {}).get("linear")


def camel(name):
    """'eps.switch_load' -> 'EpsSwitchLoad'"""
    return "".join(part.capitalize() for part in re.split(r"[._]", name))


def snake(name):
    """'eps.switch_load' -> 'eps_switch_load'"""
    return name.replace(".", "_")


class FragmentView:
    """What the fragments of a dictionary add to it."""

    def __init__(self, dictionary):
        self.size, self.apid_of = dictionary.size, dictionary.apid_of
        for key in ("apids", "structures", "commands", "events", "parameters"):
            setattr(self, key, [entry for entry in getattr(dictionary, key) if entry["fragment"]])
        self.enums = {name: enum for name, enum in dictionary.enums.items() if enum["fragment"]}


def load(folder, fragments=()):
    """Loads or ends the program with a readable message."""
    try:
        return Dictionary(folder, fragments)
    except (DictionaryError, KeyError, OSError, yaml.YAMLError) as error:
        sys.exit(f"mission dictionary: {error}")
