#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Writes the mission dictionary as XTCE 1.2 (OMG, namespace 20180204) for Yamcs and other ground systems.

usage: mission_xtce.py --dictionary FOLDER --out FILE [--fragment FILE]... [--events FILE] [--verifiers yamcs|container]

docs/how-to/yamcs/README.md says what is where in the file, and what XTCE cannot say.
"""

import argparse
import hashlib
import json
import pathlib
import re
import struct
import sys
import xml.etree.ElementTree as ET

from mission_dictionary import OCTETS, DictionaryError, linear, load, snake

NAMESPACE = "http://www.omg.org/spec/XTCE/20180204"
SEVERITIES = {"info": 1, "low": 2, "medium": 3, "high": 4}
CUC_P_FIELD = 0x1F  # 4 octets of seconds, 3 of 2^-24 s, TAI, epoch 1958
CUC_SCALE_S = 2.0**-24
LONGEST = 2**63 - 1  # bounds of integers are xs:long
MAX_GROUPS = 16  # of a request with a repeated group, when the dictionary says no less
COMPLETION_GRACE_MS = 35000  # ttc itself ends a telecommand without a last word 30 s after its timeout
UPLINK_MS = 10000  # release to the first report

# Fields of the headers, in order: name, bits, description.
PRIMARY_HEADER = [
    ("packet_version", 3, "CCSDS packet version, 0"),
    ("packet_type", 1, "0 telemetry, 1 telecommand"),
    ("secondary_header_flag", 1, "1: a PUS header follows"),
    ("apid", 11, "Application process"),
    ("sequence_flags", 2, "3: unsegmented"),
    ("sequence_count", 14, "Per APID; live packets have gaps"),
    ("packet_length", 16, "Octets after this field, less one"),
]
TM_SECONDARY_HEADER = [
    ("pus_version", 4, "2: PUS-C"),
    ("time_status", 4, "0 not valid, 1 locked to GPS, 2 holdover, 3 set but not locked"),
    ("service", 8, "Service type"),
    ("subtype", 8, "Message subtype"),
    ("type_counter", 16, "Message type counter"),
    ("destination_id", 16, "Source id of the request it answers, 0: everybody"),
    ("time_p_field", 8, "P-field of the time code, 1F"),
]
REQUEST_ID = [
    ("request_packet_version", 3, "Of the telecommand"),
    ("request_packet_type", 1, "Of the telecommand"),
    ("request_secondary_header_flag", 1, "Of the telecommand"),
    ("request_apid", 11, "APID of the telecommand"),
    ("request_sequence_flags", 2, "Of the telecommand"),
    ("request_sequence_count", 14, "Sequence count of the telecommand"),
]
# Container, subtype, stage with a step, failure, description.
VERIFICATION_REPORTS = [
    ("acceptance_success", 1, False, False, "TM 1,1: the telecommand is accepted"),
    ("acceptance_failure", 2, False, True, "TM 1,2: the telecommand is refused"),
    ("start_success", 3, False, False, "TM 1,3: execution has begun"),
    ("start_failure", 4, False, True, "TM 1,4: execution cannot begin"),
    ("progress_success", 5, True, False, "TM 1,5: a step is done"),
    ("progress_failure", 6, True, True, "TM 1,6: a step failed"),
    ("completion_success", 7, False, False, "TM 1,7: execution is complete"),
    ("completion_failure", 8, False, True, "TM 1,8: execution failed"),
    ("routing_failure", 10, False, True, "TM 1,10: no application process has this APID"),
]
# Arguments that every telecommand inherits. The packet's length, sequence count and error control are the link's.
TC_ARGUMENTS = [
    ("tc_apid", 11, None, "APID of the telecommand"),
    ("tc_ack_flags", 4, 15, "Reports wanted: 1 acceptance, 2 start, 4 progress, 8 completion"),
    ("tc_service", 8, None, "Service type"),
    ("tc_subtype", 8, None, "Message subtype"),
    ("tc_source", 16, 0, "Comes back as destination id of the reports"),
]


def element(parent, tag, attributes=None, text=None):
    made = ET.SubElement(parent, tag, {k: str(v) for k, v in (attributes or {}).items() if v is not None})
    if text is not None:
        made.text = str(text)
    return made


def octets_of_packet_before(data):
    """Value of the packet length field for @p data octets of TM source data: PUS header, data, error control, less one."""
    return 15 + data + 2 - 1


def number(value):
    """A number of the dictionary as XML Schema writes it."""
    return repr(float(value)) if isinstance(value, float) else str(value)


def with_fields_in_place(dictionary, fields):
    """Structures that are part of others are laid out in place, as the loader does; an array becomes one field an element."""
    for field in fields:
        if "structure" in field:
            yield from with_fields_in_place(dictionary, dictionary.structure_of[field["structure"]]["fields"])
            continue
        labels = field.get("labels") or [str(i) for i in range(field.get("count", 1))]
        if field.get("count", 1) == 1:
            yield field
            continue
        for label in labels:
            single = {k: v for k, v in field.items() if k not in ("count", "labels")}
            single["name"] = f"{field['name']}_{label}"
            single["description"] = f"{field.get('description', '')}: {label}"
            yield single


class TypeWriter:
    """Data types, once for parameters and once for arguments: XTCE has a set of each."""

    def __init__(self, dictionary, kind):
        self.dictionary = dictionary
        self.kind = kind  # "Parameter" or "Argument"

    def labels(self, field):
        """Number and name of what the field can hold; None: a number."""
        if "enum" in field:
            return [(v, k) for k, v in self.dictionary.enums[field["enum"]]["labels"].items()]
        kind = field.get("reference")
        if kind == "structure":
            return [(s["id"], s["name"]) for s in self.dictionary.structures if "id" in s]
        if kind in ("event", "event_or_none"):
            none = [(0, "none")] if kind == "event_or_none" else []
            return none + [(e["id"], e["name"]) for e in self.dictionary.events]
        if kind == "store":
            return [(s["id"], s["name"]) for s in self.dictionary.stores]
        if kind == "parameter":
            return [(p["id"], p["full_name"]) for p in self.dictionary.parameters]
        if kind == "failure_code":
            return [(0, "none")] + [(f["code"], f["name"]) for f in self.dictionary.failure_codes]
        if field["type"] == "bool" and "limits" in field:
            return [(0, "false"), (1, "true")]  # XTCE has no ranges for booleans
        return None

    def unsigned(self, types, name, bits, low=None, high=None):
        made = element(types, f"Integer{self.kind}Type", {"name": name, "sizeInBits": max(bits, 32), "signed": "false"})
        element(made, "IntegerDataEncoding", {"sizeInBits": bits, "encoding": "unsigned"})
        self._valid_range(made, low, high)

    def write(self, types, name, field, path=None):
        """@param path  of the parameter, for conditions on its own raw value"""
        labels = self.labels(field)
        if labels is not None:
            self._enumerated(types, name, field, labels)
        elif field["type"] == "bool":
            made = element(types, f"Boolean{self.kind}Type", {"name": name, "oneStringValue": "true", "zeroStringValue": "false"})
            element(made, "IntegerDataEncoding", {"sizeInBits": 8, "encoding": "unsigned"})
        elif field["type"] == "text":
            self._text(types, name, field)
        elif field["type"] == "time":
            made = element(types, f"AbsoluteTime{self.kind}Type", {"name": name})
            encoding = element(made, "Encoding", {"units": "seconds", "scale": repr(CUC_SCALE_S)})
            element(encoding, "IntegerDataEncoding", {"sizeInBits": 56, "encoding": "unsigned"})
            element(element(made, "ReferenceTime"), "Epoch", text="TAI")
        else:
            self._numeric(types, name, field, path)

    def _enumerated(self, types, name, field, labels):
        made = element(types, f"Enumerated{self.kind}Type", {"name": name})
        self._unit(made, field)
        element(made, "IntegerDataEncoding", {"sizeInBits": 8 * OCTETS[field["type"]], "encoding": "unsigned"})
        entries = element(made, "EnumerationList")
        for value, label in labels:
            element(entries, "Enumeration", {"value": value, "label": label})
        if self.kind == "Parameter" and "limits" in field:
            levels = [(label, self._level(field, value)) for value, label in labels]
            if any(level for _, level in levels):
                alarms = element(element(made, "DefaultAlarm"), "EnumerationAlarmList")
                for label, level in levels:
                    if level:
                        element(alarms, "EnumerationAlarm", {"enumerationLabel": label, "alarmLevel": level})

    @staticmethod
    def _level(field, value):
        for bounds, level in (("hard", "critical"), ("soft", "warning")):
            low, high = field["limits"].get(bounds, (None, None))
            if (low is not None and value < low) or (high is not None and value > high):
                return level
        return None

    def _text(self, types, name, field):
        made = element(types, f"String{self.kind}Type", {"name": name})
        encoding = element(made, "StringDataEncoding", {"encoding": "UTF-8"})
        if self.kind == "Parameter":
            variable = element(encoding, "Variable", {"maxSizeInBits": 8 * field["max"]})
            size = element(variable, "DynamicValue")
            element(size, "ParameterInstanceRef", {"parameterRef": f"{name}_length", "useCalibratedValue": "false"})
            element(size, "LinearAdjustment", {"slope": 8, "intercept": 0})
            return
        # The operator writes the text and not its length. The schema wants a DynamicValue beside LeadingSize; the name is Yamcs'.
        variable = element(encoding, "Variable", {"maxSizeInBits": 8 * (1 + field["max"])})
        element(element(variable, "DynamicValue"), "ParameterInstanceRef", {"parameterRef": "_yamcs_ignore"})
        element(variable, "LeadingSize", {"sizeInBitsOfSizeTag": 8})
        element(made, "SizeRangeInCharacters", {"minInclusive": 0, "maxInclusive": field["max"]})

    def _numeric(self, types, name, field, path):
        bits = 8 * OCTETS[field["type"]]
        is_float = field["type"][0] == "f"
        coefficients = linear(field) or field.get("calibration", {}).get("polynomial")
        if is_float or coefficients:
            attributes = {"name": name, "sizeInBits": bits if is_float and not coefficients else 64}
            made = element(types, f"Float{self.kind}Type", attributes)
        else:
            signed = field["type"][0] == "i"
            made = element(types, f"Integer{self.kind}Type",
                           {"name": name, "sizeInBits": max(bits, 32), "signed": "true" if signed else "false"})
        self._unit(made, field)
        if is_float:
            encoding = element(made, "FloatDataEncoding", {"sizeInBits": bits, "encoding": "IEEE754_1985"})
        else:
            kind = "twosComplement" if field["type"][0] == "i" else "unsigned"
            encoding = element(made, "IntegerDataEncoding", {"sizeInBits": bits, "encoding": kind})
        if coefficients:
            polynomial = element(element(encoding, "DefaultCalibrator"), "PolynomialCalibrator")
            for exponent, coefficient in enumerate(coefficients):
                element(polynomial, "Term", {"coefficient": repr(float(coefficient)), "exponent": exponent})
        if field.get("format") == "hex" and not (is_float or coefficients):
            element(element(made, "ToString"), "NumberFormat",
                    {"numberBase": "Hexadecimal", "minimumIntegerDigits": bits // 4, "showThousandsGrouping": "false"})
        if self.kind == "Argument":
            self._valid_range(made, *self._range(field))
        else:
            self._unknown(made, field, bits)
            self._alarms(made, field, path)

    @staticmethod
    def _range(field):
        """Of an f32 a bound and the float nearest to it are both inside: that is what the spacecraft accepts."""
        low, high = field.get("range", (None, None))
        if field["type"] == "f32":
            nearest = [None if v is None else struct.unpack("f", struct.pack("f", v))[0] for v in (low, high)]
            low = low if low is None or low <= nearest[0] else nearest[0]
            high = high if high is None or high >= nearest[1] else nearest[1]
        return low, high

    def _valid_range(self, made, low, high):
        if low is None and high is None:
            return
        bounds = {"minInclusive": None if low is None else number(low), "maxInclusive": None if high is None else number(high)}
        element(element(made, "ValidRangeSet"), "ValidRange", bounds)

    def _unknown(self, made, field, bits):
        """The raw value that says "not known" is outside the valid range."""
        if "unknown" not in field:
            return
        signed = field["type"][0] == "i"
        lowest, highest = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
        if field["unknown"] not in (lowest, highest):
            raise DictionaryError(f"{field['name']}: XTCE can only say 'unknown' with the smallest or the largest raw value")
        bounds = {"minInclusive": lowest + (field["unknown"] == lowest),
                  "maxInclusive": min(highest - (field["unknown"] == highest), LONGEST), "validRangeAppliesToCalibrated": "false"}
        element(made, "ValidRange", bounds)

    def _alarms(self, made, field, path):
        if "limits" not in field:
            return
        ranges = element(element(made, "DefaultAlarm"), "StaticAlarmRanges", {"rangeForm": "outside"})
        for bounds, tag in (("soft", "WarningRange"), ("hard", "CriticalRange")):
            if bounds in field["limits"]:
                low, high = field["limits"][bounds]
                element(ranges, tag, {"minInclusive": None if low is None else number(low),
                                      "maxInclusive": None if high is None else number(high)})
        if "unknown" in field:  # no alarm for a value that is not known
            context = element(element(made, "ContextAlarmList"), "ContextAlarm")
            element(element(context, "ContextMatch"), "Comparison",
                    {"parameterRef": path, "value": field["unknown"], "useCalibratedValue": "false"})

    @staticmethod
    def _unit(made, field):
        if "unit" in field:
            element(element(made, "UnitSet"), "Unit", text=field["unit"])


class Telemetry:
    """TelemetryMetaData of one SpaceSystem, in the order the schema wants."""

    def __init__(self, writer, system, path):
        self.writer = writer
        self.path = path
        data = element(system, "TelemetryMetaData")
        self.types = element(data, "ParameterTypeSet")
        self.parameters = element(data, "ParameterSet")
        self.containers = element(data, "ContainerSet")
        self.names = set()

    def declare(self, name, description):
        if name in self.names:
            raise DictionaryError(f"{self.path}: XTCE would have the parameter '{name}' twice")
        self.names.add(name)
        element(self.parameters, "Parameter", {"name": name, "parameterTypeRef": name, "shortDescription": description or None})

    def bits(self, name, bits, description):
        self.writer.unsigned(self.types, name, bits)
        self.declare(name, description)

    def field(self, field):
        """@return the entries it takes in a container"""
        name, description = field["name"], field.get("description", "")
        entries = [name]
        if field["type"] == "text":
            entries = [f"{name}_length", name]
            self.bits(entries[0], 8, f"Octets of {name}")
        elif field["type"] == "time":
            entries = [f"{name}_p_field", name]
            self.bits(entries[0], 8, f"P-field of {name}, 1F")
        self.writer.write(self.types, name, field, f"{self.path}/{name}")
        self.declare(name, description)
        return entries

    def container(self, name, entries, base=None, conditions=(), abstract=False, description=None, alias=None):
        made = element(self.containers, "SequenceContainer",
                       {"name": name, "abstract": "true" if abstract else None, "shortDescription": description})
        if alias:
            element(element(made, "AliasSet"), "Alias", {"nameSpace": "SRFS", "alias": alias})
        if not abstract:
            element(element(made, "AncillaryDataSet"), "AncillaryData", {"name": "Yamcs"}, "UseAsArchivingPartition")
        entry_list = element(made, "EntryList")
        for entry in entries:
            element(entry_list, "ParameterRefEntry", {"parameterRef": entry})
        if base:
            criteria = element(element(made, "BaseContainer", {"containerRef": base}), "RestrictionCriteria")
            comparisons = element(criteria, "ComparisonList")
            for parameter, value, *operator in conditions:
                element(comparisons, "Comparison", {"parameterRef": parameter, "value": value, "comparisonOperator": operator[0] if operator else None})
        return entry_list


class Commands:
    """CommandMetaData of one SpaceSystem."""

    def __init__(self, writer, system):
        self.writer = writer
        data = element(system, "CommandMetaData")
        self.types = element(data, "ArgumentTypeSet")
        self.commands = element(data, "MetaCommandSet")


class Document:
    def __init__(self, dictionary, digest, verifiers):
        self.d = dictionary
        self.verifiers = verifiers
        self.name = dictionary.spacecraft["name"]
        self.root_path = f"/{self.name}"
        self.tm_types = TypeWriter(dictionary, "Parameter")
        self.tc_types = TypeWriter(dictionary, "Argument")
        self.root = ET.Element("SpaceSystem", {"name": self.name, "xmlns": NAMESPACE})
        element(self.root, "LongDescription",
                text="Made from the mission dictionary (msgs/mission) by msgs/generator/mission_xtce.py. Packet error control (CRC-16, "
                "the last two octets of every packet) is no entry of a container; length, sequence count and error control of "
                "telecommands are filled in by the link.")
        self._header(digest)

    def _header(self, digest):
        header = element(self.root, "Header", {"version": f"dictionary sha256 {digest}", "validationStatus": "Test"})
        notes = element(header, "NoteSet")
        element(notes, "Note", text=f"Spacecraft id {self.d.spacecraft['id']}, PUS-C (ECSS-E-ST-70-41C)")
        element(notes, "Note", text="Times are CUC 4+3 with P-field 1F: a parameter of 8 bits, then 56 bits of 2^-24 s since 1958-01-01 TAI")

    def write(self):
        self._packets()
        self._telecommand_packet()
        for process in self.d.apids:
            self._application_process(process)
        self._events()
        ET.indent(self.root, " ")
        return ET.tostring(self.root, encoding="utf-8", xml_declaration=True).decode() + "\n"

    # --- telemetry ---------------------------------------------------------------------------------------------------

    def _packets(self):
        tm = Telemetry(self.tm_types, self.root, self.root_path)
        for fields in (PRIMARY_HEADER, TM_SECONDARY_HEADER):
            for name, bits, description in fields:
                tm.bits(name, bits, description)
        tm.field({"name": "packet_time", "type": "time", "description": "When the packet was made"})
        tm.container("ccsds_packet", [f[0] for f in PRIMARY_HEADER], abstract=True, description="CCSDS 133.0-B Space Packet")
        tm.container("pus_tm", [f[0] for f in TM_SECONDARY_HEADER] + ["packet_time"], "ccsds_packet",
                     [("packet_type", 0), ("secondary_header_flag", 1)], abstract=True, description="PUS-C telemetry packet")
        self._verification(tm)
        tm.bits("structure_id", 16, "Housekeeping structure")
        tm.container("housekeeping", ["structure_id"], "pus_tm", [("service", 3), ("subtype", 25)], abstract=True,
                     description="TM 3,25: housekeeping report")
        tm.bits("event_id", 16, "Event")
        tm.container("event_report", ["event_id"], "pus_tm", [("service", 5), ("subtype", 5, "<")], abstract=True, description="TM 5,1 to 5,4: event report")
        if self.d.parameters:
            tm.bits("parameter_count", 16, "Parameters in the report, always 1")
            tm.bits("parameter_id", 16, "Node parameter")
            tm.container("parameter_value_report", ["parameter_count", "parameter_id"], "pus_tm", [("service", 20), ("subtype", 2)],
                         abstract=True, description="TM 20,2: value of a node parameter")
        tm.container("are_you_alive_report", [], "pus_tm", [("service", 17), ("subtype", 2)], description="TM 17,2: yes")
        self._schedule_and_time(tm)

    @staticmethod
    def _schedule_and_time(tm):
        """Of the lists of the schedule only their number: XTCE has no word for a list of whole packets."""
        tm.bits("schedule_count", 16, "Entries of the report")
        for name, subtype, description in (("schedule_detail_report", 10, "activities with their requests"),
                                           ("schedule_summary_report", 13, "activities"),
                                           ("schedule_group_report", 27, "scheduling groups")):
            tm.container(name, ["schedule_count"], "pus_tm", [("service", 11), ("subtype", subtype)],
                         description=f"TM 11,{subtype}: {description}")
        tm.bits("time_report_rate", 8, "N: a report every 2^N frames of virtual channel 0")
        entries = tm.field({"name": "time_report_time", "type": "time", "description": "When the frame was made"})
        tm.container("time_report", ["time_report_rate", *entries], "ccsds_packet",
                     [("packet_type", 0), ("secondary_header_flag", 0), ("apid", 0)], description="TM 9,2: time packet")

    def _verification(self, tm):
        for name, bits, description in REQUEST_ID:
            tm.bits(name, bits, description)
        tm.bits("step", 8, "Step of the execution")
        tm.field({"name": "failure_code", "type": "u16", "reference": "failure_code", "description": "Why it failed"})
        sizes = sorted({OCTETS[f["parameter"].split()[0]] for f in self.d.failure_codes if f.get("parameter")})
        for size in sizes:
            tm.bits(f"failure_parameter_u{8 * size}", 8 * size, "; ".join(
                f"{f['name']}: {f['parameter'].split(' ', 1)[1]}" for f in self.d.failure_codes
                if f.get("parameter") and OCTETS[f["parameter"].split()[0]] == size))
        tm.container("verification_report", [f[0] for f in REQUEST_ID], "pus_tm", [("service", 1)], abstract=True,
                     description="TM 1,1 to 1,8 and 1,10: verification of a telecommand")
        for name, subtype, has_step, is_failure, description in VERIFICATION_REPORTS:
            entries = (["step"] if has_step else []) + (["failure_code"] if is_failure else [])
            entry_list = tm.container(name, entries, "verification_report", [("subtype", subtype)], description=description)
            if not is_failure:
                continue
            for size in sizes:  # what follows the code depends on the code, and the packet's length says so
                data = 4 + (1 if has_step else 0) + 2 + size
                entry = element(entry_list, "ParameterRefEntry", {"parameterRef": f"failure_parameter_u{8 * size}"})
                element(element(entry, "IncludeCondition"), "Comparison",
                        {"parameterRef": "packet_length", "value": octets_of_packet_before(data)})

    def _application_process(self, process):
        system = element(self.root, "SpaceSystem", {"name": process["name"],
                                                    "shortDescription": f"APID {process['apid']}: {process['description']}"})
        commands = [c for c in self.d.wire_commands if c["node"] == process["node"]]
        if commands:
            made = Commands(self.tc_types, system)
            for command in commands:
                self._command(made, command, process)
            if len(made.types) == 0:
                list(system)[-1].remove(made.types)
        for structure in self.d.structures:
            if structure["kind"] in ("housekeeping", "report") and structure["node"] == process["node"]:
                self._structure(system, structure, process)
        for parameter in self.d.parameters:
            if parameter["node"] == process["node"]:
                self._parameter(system, parameter, process)

    def _parameter(self, parent, parameter, process):
        """Value of a node parameter: a container of its own, so that it has its type."""
        name = f"parameter_{parameter['name']}"
        system = element(parent, "SpaceSystem", {"name": name, "shortDescription": f"Node parameter {parameter['id']}"})
        element(system, "LongDescription", text=f"{parameter['description']}. Sent on request (parameters.report)")
        tm = Telemetry(self.tm_types, system, f"{self.root_path}/{process['name']}/{name}")
        value = {k: v for k, v in parameter.items() if k not in ("range", "id")}
        tm.container(name, tm.field({**value, "name": "value"}), f"{self.root_path}/parameter_value_report",
                     [(f"{self.root_path}/parameter_id", parameter["id"])], description=f"TM 20,2 of {parameter['full_name']}")

    def _structure(self, parent, structure, process):
        path = f"{self.root_path}/{process['name']}/{structure['name']}"
        description = structure.get("description", "")
        is_report = structure["kind"] == "report"
        title = "TM {},{}".format(*structure["service"]) if is_report else f"Structure {structure['id']}"
        when = ("Sent when it happens" if "unasked" in description else "Sent on request") if is_report else f"Live every {structure['interval_ms']} ms unless changed by command"
        system = element(parent, "SpaceSystem", {"name": structure["name"], "shortDescription": title})
        element(system, "LongDescription", text=f"{description}. {when}")
        tm = Telemetry(self.tm_types, system, path)
        # XTCE has no word for a whole packet: what stands before it is described.
        fields = [field for field in with_fields_in_place(self.d, structure["fields"]) if field["type"] != "packet"]
        entries = [e for field in fields for e in tm.field(field)]
        if is_report:
            base, conditions = "pus_tm", [("service", structure["service"][0]), ("subtype", structure["service"][1])]
        else:
            base, conditions, title = "housekeeping", [("structure_id", structure["id"])], f"TM 3,25 structure {structure['id']}"
        tm.container(structure["name"], entries, f"{self.root_path}/{base}",
                     [(f"{self.root_path}/{name}", value) for name, value in [*conditions, ("apid", process["apid"])]], description=title)

    def _events(self):
        parent = element(self.root, "SpaceSystem", {"name": "events", "shortDescription": "Event reports, TM 5,1 to 5,4"})
        for event in self.d.events:
            name = snake(event["name"])
            system = element(parent, "SpaceSystem", {"name": name, "shortDescription": f"Event {event['id']}, {event['severity']}"})
            element(system, "LongDescription", text=event["text"])
            tm = Telemetry(self.tm_types, system, f"{self.root_path}/events/{name}")
            entries = [e for field in with_fields_in_place(self.d, event["fields"]) for e in tm.field(field)]
            tm.container(name, entries, f"{self.root_path}/event_report",
                         [(f"{self.root_path}/event_id", event["id"]), (f"{self.root_path}/subtype", SEVERITIES[event["severity"]])],
                         description=f"TM 5,{SEVERITIES[event['severity']]} event {event['id']}", alias=event["name"])
            if not entries:  # the schema wants no empty sets
                data = system.find("TelemetryMetaData")
                data.remove(tm.types)
                data.remove(tm.parameters)

    # --- telecommands ------------------------------------------------------------------------------------------------

    def _telecommand_packet(self):
        made = Commands(self.tc_types, self.root)
        for name, bits, _, _ in TC_ARGUMENTS:
            self.tc_types.unsigned(made.types, name, bits)
        self.tc_types.unsigned(made.types, "function_id", 16)
        packet = element(made.commands, "MetaCommand", {"name": "pus_tc", "abstract": "true",
                                                        "shortDescription": "PUS-C telecommand packet"})
        arguments = element(packet, "ArgumentList")
        for name, _, default, description in TC_ARGUMENTS:
            element(arguments, "Argument", {"name": name, "argumentTypeRef": name, "initialValue": default, "shortDescription": description})
        entries = element(element(packet, "CommandContainer", {"name": "pus_tc"}), "EntryList")
        for name, value, bits in (("packet_version", "00", 3), ("packet_type", "01", 1), ("secondary_header_flag", "01", 1)):
            element(entries, "FixedValueEntry", {"name": name, "binaryValue": value, "sizeInBits": bits})
        element(entries, "ArgumentRefEntry", {"argumentRef": "tc_apid"})
        for name, value, bits in (("sequence_flags", "03", 2), ("sequence_count", "0000", 14), ("packet_length", "0000", 16),
                                  ("pus_version", "02", 4)):
            element(entries, "FixedValueEntry", {"name": name, "binaryValue": value, "sizeInBits": bits})
        for name in ("tc_ack_flags", "tc_service", "tc_subtype", "tc_source"):
            element(entries, "ArgumentRefEntry", {"argumentRef": name})

        function = element(made.commands, "MetaCommand", {"name": "function", "abstract": "true",
                                                          "shortDescription": "TC 8,1: perform a function of the APID"})
        self._base(function, "pus_tc", {"tc_service": 8, "tc_subtype": 1})
        arguments = element(function, "ArgumentList")
        element(arguments, "Argument", {"name": "function_id", "argumentTypeRef": "function_id"})
        container = element(function, "CommandContainer", {"name": "function"})
        element(element(container, "EntryList"), "ArgumentRefEntry", {"argumentRef": "function_id"})
        element(container, "BaseContainer", {"containerRef": "pus_tc"})

    @staticmethod
    def _base(command, base, assignments):
        made = element(element(command, "BaseMetaCommand", {"metaCommandRef": base}), "ArgumentAssignmentList")
        for name, value in assignments.items():
            element(made, "ArgumentAssignment", {"argumentName": name, "argumentValue": value})

    def _command(self, made, command, process):
        name = snake(command["name"])
        meta = element(made.commands, "MetaCommand", {"name": name, "shortDescription": self._short(command)})
        element(meta, "LongDescription", text=self._long(command))
        element(element(meta, "AliasSet"), "Alias", {"nameSpace": "SRFS", "alias": command["name"]})
        if "service" in command:
            base = "pus_tc"
            assignments = {"tc_apid": process["apid"], "tc_service": command["service"][0], "tc_subtype": command["service"][1]}
        else:
            base = "function"
            assignments = {"tc_apid": process["apid"], "function_id": command["function"]}
        self._base(meta, f"{self.root_path}/{base}", assignments)

        argument_list = element(meta, "ArgumentList")
        container = element(meta, "CommandContainer", {"name": name})
        entries = element(container, "EntryList")
        element(container, "BaseContainer", {"containerRef": f"{self.root_path}/{base}"})
        for value, bits in command.get("fixed", []):
            element(entries, "FixedValueEntry", {"binaryValue": f"{value:0{bits // 4}x}", "sizeInBits": bits})
        fields = list(with_fields_in_place(self.d, command["arguments"]))
        if command.get("repeated"):
            head = command.get("head", 0)
            self._arguments(made, name, fields[:head], argument_list, entries)
            self._groups(made, name, command, fields[head:], argument_list, entries)
        else:
            self._arguments(made, name, fields, argument_list, entries)
        if len(argument_list) == 0:
            meta.remove(argument_list)
        inherited = {a[0] for a in TC_ARGUMENTS} | {"function_id"}
        for argument in argument_list:
            if argument.get("name") in inherited:
                raise DictionaryError(f"{command['name']}: the argument '{argument.get('name')}' has the name of a header field")

        if command.get("hazardous"):
            element(meta, "DefaultSignificance", {"consequenceLevel": "critical", "reasonForWarning": "hazardous: arm, then fire"})
        self._verifiers(meta, command)

    @staticmethod
    def _short(command):
        kind = f"TC {command['service'][0]},{command['service'][1]}" if "service" in command else f"TC 8,1 function {command['function']}"
        return f"{kind}: {command['description'].split('. ')[0]}"

    @staticmethod
    def _long(command):
        sentences = [command["description"].rstrip(".") + ".", f"Repeat class {command['repeat']}."]
        if command.get("recovery"):
            sentences.append("Runs without storage too.")
        if "modes" in command:
            sentences.append(f"Allowed in the modes {', '.join(command['modes'])}.")
        sentences.append(f"Timeout {command.get('timeout_ms', 10000)} ms.")
        return " ".join(sentences)

    def _arguments(self, made, owner, fields, argument_list, entries):
        for field in fields:
            type_name = f"{owner}_{field['name']}"
            self.tc_types.write(made.types, type_name, field)
            element(argument_list, "Argument", {"name": field["name"], "argumentTypeRef": type_name, "initialValue": self._default(field),
                                                "shortDescription": field.get("description")})
            if field["type"] == "time":
                element(entries, "FixedValueEntry", {"name": f"{field['name']}_p_field", "binaryValue": f"{CUC_P_FIELD:02x}", "sizeInBits": 8})
            element(entries, "ArgumentRefEntry", {"argumentRef": field["name"]})

    def _groups(self, made, owner, command, fields, argument_list, entries):
        """A u16 count, then that many groups. Without its initial value the count follows from the array in Yamcs."""
        self.tc_types.unsigned(made.types, f"{owner}_count", 16, command.get("min_groups", 1), command.get("max_groups", MAX_GROUPS))
        members = []
        for field in fields:
            type_name = f"{owner}_{field['name']}"
            self.tc_types.write(made.types, type_name, field)
            if field["type"] == "time":
                self.tc_types.unsigned(made.types, f"{type_name}_p_field", 8, CUC_P_FIELD, CUC_P_FIELD)
                members.append((f"{field['name']}_p_field", f"{type_name}_p_field", CUC_P_FIELD, "P-field of the time that follows"))
            members.append((field["name"], type_name, self._default(field), field.get("description")))
        group = element(made.types, "AggregateArgumentType", {"name": f"{owner}_group"})
        member_list = element(group, "MemberList")
        for name, type_name, default, description in members:
            element(member_list, "Member", {"name": name, "typeRef": type_name, "initialValue": default, "shortDescription": description})
        array = element(made.types, "ArrayArgumentType", {"name": f"{owner}_groups", "arrayTypeRef": f"{owner}_group"})
        dimension = element(element(array, "DimensionList"), "Dimension")
        element(element(dimension, "StartingIndex"), "FixedValue", text=0)
        last = element(element(dimension, "EndingIndex"), "DynamicValue")
        element(last, "ArgumentInstanceRef", {"argumentRef": "count"})
        element(last, "LinearAdjustment", {"slope": 1, "intercept": -1})
        element(argument_list, "Argument", {"name": "count", "argumentTypeRef": f"{owner}_count", "shortDescription": "Number of groups"})
        element(argument_list, "Argument", {"name": "groups", "argumentTypeRef": f"{owner}_groups"})
        for name in ("count", "groups"):
            element(entries, "ArgumentRefEntry", {"argumentRef": name})

    @staticmethod
    def _default(field):
        default = field.get("default")
        if isinstance(default, bool):
            return "true" if default else "false"
        return default

    def _verifiers(self, meta, command):
        """Each report is compared with this very telecommand: its APID, and the sequence count that the link gave it."""
        timeout_ms = command.get("timeout_ms", 10000)
        verifiers = element(meta, "VerifierSet")
        for tag, name, subtypes, window_ms in (
                ("AcceptedVerifier", "Accepted", [1], UPLINK_MS), ("ExecutionVerifier", "Started", [3], UPLINK_MS + timeout_ms),
                ("CompleteVerifier", "Completed", [7], UPLINK_MS + timeout_ms + COMPLETION_GRACE_MS),
                ("FailedVerifier", "Failed", [2, 4, 8], UPLINK_MS + timeout_ms + COMPLETION_GRACE_MS)):
            verifier = element(verifiers, tag, {"name": name})
            if self.verifiers == "yamcs":
                self._own_report(verifier, subtypes, self.d.apid_of[command["node"]])
            else:
                self._any_report(verifier, subtypes)
            element(verifier, "CheckWindow", {"timeToStopChecking": f"PT{window_ms / 1000:g}S", "timeWindowIsRelativeTo": "commandRelease"})
            if tag == "FailedVerifier":
                element(verifier, "ReturnParmRef", {"parameterRef": f"{self.root_path}/failure_code"})

    def _own_report(self, verifier, subtypes, apid):
        conditions = element(element(verifier, "BooleanExpression"), "ANDedConditions")
        self._condition(conditions, f"{self.root_path}/request_apid", value=apid)
        self._condition(conditions, "/yamcs/cmdHist/ccsds-seqcount", parameter="request_sequence_count")
        self._condition(conditions, f"{self.root_path}/service", value=1)
        if len(subtypes) > 1:
            conditions = element(conditions, "ORedConditions")
        for subtype in subtypes:
            self._condition(conditions, f"{self.root_path}/subtype", value=subtype)

    def _any_report(self, verifier, subtypes):
        """Standard XTCE without names of a product: the container alone. Which telecommand is meant, the user must compare."""
        if len(subtypes) == 1:
            name = next(r[0] for r in VERIFICATION_REPORTS if r[1] == subtypes[0])
            element(verifier, "ContainerRef", {"containerRef": f"{self.root_path}/{name}"})
            return
        conditions = element(element(verifier, "BooleanExpression"), "ANDedConditions")
        self._condition(conditions, f"{self.root_path}/service", value=1)
        alternatives = element(conditions, "ORedConditions")
        for subtype in subtypes:
            self._condition(alternatives, f"{self.root_path}/subtype", value=subtype)

    def _condition(self, parent, left, value=None, parameter=None):
        made = element(parent, "Condition")
        element(made, "ParameterInstanceRef", {"parameterRef": left})
        element(made, "ComparisonOperator", text="==")
        if parameter:
            element(made, "ParameterInstanceRef", {"parameterRef": f"{self.root_path}/{parameter}"})
        else:
            element(made, "Value", text=value)


def event_templates(dictionary):
    """Texts of the events for Yamcs' PusEventDecoder."""
    templates = []
    for event in dictionary.events:
        path = f"/{dictionary.spacecraft['name']}/events/{snake(event['name'])}"
        text = re.sub(r"\{(\w+)\}", rf"{{{path}/\1}}", event["text"])
        templates.append({"eventId": str(event["id"]), "template": f"{event['name']}: {text}"})
    return json.dumps(templates, indent=1) + "\n"


def digest_of(folder):
    """First octets of the hash over all files, to distinguish one data base from the next."""
    digest = hashlib.sha256()
    for file in sorted(pathlib.Path(folder).glob("*.yaml")):
        digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--dictionary", required=True)
    parser.add_argument("--fragment", action="append", default=[], help="dictionary fragment of an added node; may be repeated")
    parser.add_argument("--out", required=True, help="file, or - for standard output")
    parser.add_argument("--events", help="also write the texts of the events for Yamcs (JSON)")
    parser.add_argument("--verifiers", choices=("yamcs", "container"), default="yamcs")
    arguments = parser.parse_args()
    dictionary = load(arguments.dictionary, arguments.fragment)
    try:
        text = Document(dictionary, digest_of(arguments.dictionary), arguments.verifiers).write()
    except (DictionaryError, KeyError) as error:
        sys.exit(f"mission dictionary: {error}")
    if arguments.out == "-":
        sys.stdout.write(text)
    else:
        pathlib.Path(arguments.out).write_text(text, encoding="utf-8")
    if arguments.events:
        pathlib.Path(arguments.events).write_text(event_templates(dictionary), encoding="utf-8")


if __name__ == "__main__":
    main()
