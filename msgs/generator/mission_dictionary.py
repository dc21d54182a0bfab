"""Reads and checks the mission dictionary (msgs/mission/*.yaml) for the build-time generators.

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
IDENTIFIER = re.compile(r"^[a-z][a-z0-9]*(_[a-z0-9]+)*$")


class DictionaryError(Exception):
    """The dictionary cannot be used; the text names file and entry."""


class Dictionary:
    """All files of one folder, merged. Lists keep file order; files are read in the order of their names, mission.yaml first."""

    def __init__(self, folder):
        self.spacecraft = {}
        self.apids, self.services, self.stores, self.failure_codes = [], [], [], []
        self.enums = {}
        self.structures, self.commands, self.events = [], [], []
        folder = pathlib.Path(folder)
        files = sorted(folder.glob("*.yaml"), key=lambda f: (f.name != "mission.yaml", f.name))
        if not files:
            raise DictionaryError(f"{folder}: no dictionary here")
        for file in files:
            self._merge(file)
        self.apid_of = {a["node"]: a["apid"] for a in self.apids}
        self.structure_of = {s["name"]: s for s in self.structures}
        self._check()

    def _merge(self, file):
        content = yaml.safe_load(file.read_text(encoding="utf-8"))
        self.spacecraft.update(content.get("spacecraft", {}))
        for name, enum in content.get("enums", {}).items():
            if name in self.enums:
                raise DictionaryError(f"{file.name}: enum {name} stands twice")
            self.enums[name] = enum
        for key in ("apids", "services", "stores", "failure_codes", "structures", "commands", "events"):
            for entry in content.get(key, []):
                entry.setdefault("fields", [])
                entry["file"] = file.name
                getattr(self, key).append(entry)

    def _check(self):
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
            if field["type"] not in ("text", "packet") and field["type"] not in OCTETS:
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
        return OCTETS[field["type"]] * field.get("count", 1)


def has_packet(command):
    """Whether one of its arguments is a whole packet."""
    return any(a.get("type") == "packet" for a in command["arguments"])


def linear(field):
    """(offset, scale) of a field with a linear calibration, else None."""
    return field.get("calibration", {}).get("linear")


def camel(name):
    """'eps.switch_load' -> 'EpsSwitchLoad'"""
    return "".join(part.capitalize() for part in re.split(r"[._]", name))


def snake(name):
    """'eps.switch_load' -> 'eps_switch_load'"""
    return name.replace(".", "_")


def load(folder):
    """Loads or ends the program with a readable message."""
    try:
        return Dictionary(folder)
    except (DictionaryError, KeyError, yaml.YAMLError) as error:
        sys.exit(f"mission dictionary: {error}")
