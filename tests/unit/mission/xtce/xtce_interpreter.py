# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""A small interpreter of XTCE 1.2 that relies on the file alone: decodes packets by its containers and encodes its commands.

It supports only what the file at hand uses; anything else raises an error.
"""

import math
import struct
import xml.etree.ElementTree as ET
from fractions import Fraction

NAMESPACE = "{http://www.omg.org/spec/XTCE/20180204}"


class XtceError(Exception):
    """The file uses something that this interpreter does not support, or a packet does not match the file."""


class Refused(Exception):
    """The file does not allow this value."""


def local(node):
    return node.tag.removeprefix(NAMESPACE)


def child(node, *path):
    for name in path:
        node = None if node is None else node.find(NAMESPACE + name)
    return node


def children(node, *path):
    node = child(node, *path)
    return [] if node is None else list(node)


class Bits:
    """Reads and writes bit fields, most significant bit first."""

    def __init__(self, octets=b""):
        self.value = int.from_bytes(octets, "big")
        self.length = 8 * len(octets)
        self.position = 0

    def take(self, bits):
        if self.position + bits > self.length:
            raise XtceError(f"the packet ends at bit {self.length}, wanted {bits} from {self.position} on")
        self.position += bits
        return (self.value >> (self.length - self.position)) & ((1 << bits) - 1)

    def put(self, value, bits):
        if not 0 <= value < (1 << bits):
            raise XtceError(f"{value} does not fit into {bits} bits")
        self.value = self.value << bits | value
        self.length += bits

    def octets(self):
        if self.length % 8:
            raise XtceError("not whole octets")
        return self.value.to_bytes(self.length // 8, "big")


class Value:
    """One decoded parameter."""

    def __init__(self, raw, value, valid=True, level="normal"):
        self.raw, self.value, self.valid, self.level = raw, value, valid, level


class Database:
    def __init__(self, text):
        self.root = ET.fromstring(text)
        self.parameters, self.parameter_types, self.argument_types = {}, {}, {}
        self.containers, self.commands = {}, {}
        self._index(self.root, "")
        self.derived = {}
        for path, container in self.containers.items():
            base = child(container, "BaseContainer")
            if base is not None:
                self.derived.setdefault(self.resolve(base.get("containerRef"), path), []).append(path)

    def _index(self, system, parent):
        path = f"{parent}/{system.get('name')}"
        for node in children(system, "TelemetryMetaData", "ParameterTypeSet"):
            self._add(self.parameter_types, path, node)
        for node in children(system, "TelemetryMetaData", "ParameterSet"):
            self._add(self.parameters, path, node)
        for node in children(system, "TelemetryMetaData", "ContainerSet"):
            self._add(self.containers, path, node)
        for node in children(system, "CommandMetaData", "ArgumentTypeSet"):
            self._add(self.argument_types, path, node)
        for node in children(system, "CommandMetaData", "MetaCommandSet"):
            self._add(self.commands, path, node)
        for node in system.findall(NAMESPACE + "SpaceSystem"):
            self._index(node, path)

    @staticmethod
    def _add(table, path, node):
        name = f"{path}/{node.get('name')}"
        if name in table:
            raise XtceError(f"{name} twice")
        table[name] = node

    @staticmethod
    def resolve(reference, owner):
        """The absolute path of a reference: already absolute, or a name in the SpaceSystem of @p owner."""
        return reference if reference.startswith("/") else owner.rsplit("/", 1)[0] + "/" + reference

    # --- telemetry ---------------------------------------------------------------------------------------------------

    def decode(self, octets, root):
        """@return (path of the most specific container, its parameters by path, octets that no entry covers)"""
        bits = Bits(octets)
        values = {}
        path = root
        while True:
            for entry in children(self.containers[path], "EntryList"):
                self._entry(entry, path, bits, values)
            fitting = [d for d in self.derived.get(path, []) if self._restricted(d, values)]
            if not fitting:
                break
            if len(fitting) > 1:
                raise XtceError(f"more than one container fits: {fitting}")
            path = fitting[0]
        if self.containers[path].get("abstract") == "true":
            raise XtceError(f"no container but the abstract {path} fits")
        for name, value in values.items():
            value.level = self._level(name, value, values)
        return path, values, (bits.length - bits.position) / 8

    def _entry(self, entry, owner, bits, values):
        if local(entry) != "ParameterRefEntry":
            raise XtceError(f"{owner}: {local(entry)}")
        condition = None
        for part in entry:
            if local(part) != "IncludeCondition":
                raise XtceError(f"{owner}: {local(part)}")
            condition = part
        if condition is not None and not self._criteria(condition, owner, values):
            return
        path = self.resolve(entry.get("parameterRef"), owner)
        kind = self.resolve(self.parameters[path].get("parameterTypeRef"), path)
        values[path] = self._parameter(self.parameter_types[kind], kind, bits, values)

    def _restricted(self, path, values):
        criteria = child(self.containers[path], "BaseContainer", "RestrictionCriteria")
        return criteria is None or self._criteria(criteria, path, values)

    def _criteria(self, criteria, owner, values):
        (what,) = criteria
        if local(what) == "Comparison":
            return self._comparison(what, owner, values)
        if local(what) == "ComparisonList":
            return all(self._comparison(c, owner, values) for c in what)
        raise XtceError(f"{owner}: {local(what)}")

    def _comparison(self, comparison, owner, values):
        operator = comparison.get("comparisonOperator", "==")
        if operator not in ("==", "<"):
            raise XtceError(f"{owner}: {operator}")
        value = values[self.resolve(comparison.get("parameterRef"), owner)]
        seen = value.raw if comparison.get("useCalibratedValue") == "false" else value.value
        return seen < int(comparison.get("value")) if operator == "<" else str(seen) == comparison.get("value")

    def _parameter(self, kind, path, bits, values):
        name = local(kind).removesuffix("ParameterType")
        if name == "AbsoluteTime":
            encoding = child(kind, "Encoding")
            raw = self._take(encoding[0], path, bits, values)
            return Value(raw, self._seconds(kind, encoding, raw))
        encoding = self._encoding(kind)
        raw = self._take(encoding, path, bits, values)
        value = raw
        if name == "Boolean":
            value = raw != 0
        elif name == "Enumerated":
            value = next((e.get("label") for e in children(kind, "EnumerationList") if int(e.get("value")) == raw), None)
        elif name in ("Integer", "Float"):
            value = self._calibrated(encoding, raw)
        elif name != "String":
            raise XtceError(f"{path}: {local(kind)}")
        return Value(raw, value, self._is_valid(child(kind, "ValidRange"), raw, value))

    @staticmethod
    def _encoding(kind):
        (encoding,) = [c for c in kind if local(c).endswith("DataEncoding")]
        return encoding

    def _take(self, encoding, path, bits, values):
        name = local(encoding)
        if set(encoding.attrib) - {"sizeInBits", "encoding"}:
            raise XtceError(f"{path}: {encoding.attrib}")
        if name == "IntegerDataEncoding":
            size = int(encoding.get("sizeInBits"))
            raw = bits.take(size)
            if encoding.get("encoding") == "twosComplement":
                return raw - (1 << size) if raw >> (size - 1) else raw
            if encoding.get("encoding") != "unsigned":
                raise XtceError(f"{path}: {encoding.get('encoding')}")
            return raw
        if name == "FloatDataEncoding":
            size = int(encoding.get("sizeInBits"))
            return struct.unpack({32: ">f", 64: ">d"}[size], bits.take(size).to_bytes(size // 8, "big"))[0]
        if name == "StringDataEncoding":
            size = self._string_bits(encoding, path, values)
            return bits.take(size).to_bytes(size // 8, "big").decode(encoding.get("encoding"))
        raise XtceError(f"{path}: {name}")

    def _string_bits(self, encoding, path, values):
        variable = child(encoding, "Variable")
        if child(variable, "LeadingSize") is not None:
            raise XtceError(f"{path}: a leading size in telemetry")
        reference = child(variable, "DynamicValue", "ParameterInstanceRef")
        value = values[self.resolve(reference.get("parameterRef"), path)]
        size = value.raw if reference.get("useCalibratedValue") == "false" else value.value
        adjustment = child(variable, "DynamicValue", "LinearAdjustment")
        size = size * int(adjustment.get("slope")) + int(adjustment.get("intercept"))
        if size > int(variable.get("maxSizeInBits")):
            raise XtceError(f"{path}: {size} bits of text")
        return size

    @staticmethod
    def _calibrated(encoding, raw):
        calibrator = child(encoding, "DefaultCalibrator")
        if calibrator is None:
            return raw
        terms = {int(t.get("exponent")): float(t.get("coefficient")) for t in child(calibrator, "PolynomialCalibrator")}
        value = 0.0
        for exponent in range(max(terms), -1, -1):  # Horner's rule
            value = value * raw + terms.get(exponent, 0.0)
        return value

    @staticmethod
    def _seconds(kind, encoding, raw):
        """Seconds of TAI since 1958."""
        if child(kind, "ReferenceTime", "Epoch").text != "TAI" or encoding.get("units", "seconds") != "seconds":
            raise XtceError("another epoch than TAI")
        return raw * Fraction(float(encoding.get("scale", 1))) + Fraction(float(encoding.get("offset", 0)))

    @staticmethod
    def _is_valid(valid_range, raw, value):
        if valid_range is None:
            return True
        judged = raw if valid_range.get("validRangeAppliesToCalibrated") == "false" else value
        return inside(valid_range, judged)

    # --- alarms ------------------------------------------------------------------------------------------------------

    def _level(self, path, value, values):
        """normal, warning or critical; none: not monitored, or not in this context."""
        kind = self.parameter_types[self.resolve(self.parameters[path].get("parameterTypeRef"), path)]
        alarm = child(kind, "DefaultAlarm")
        if alarm is None:
            return "none"
        for context in children(kind, "ContextAlarmList"):
            if self._criteria(child(context, "ContextMatch"), path, values):
                alarm = context
        if local(kind) == "EnumeratedParameterType":
            levels = {a.get("enumerationLabel"): a.get("alarmLevel") for a in children(alarm, "EnumerationAlarmList")}
            return levels.get(value.value, alarm.get("defaultAlarmLevel", "normal"))
        ranges = child(alarm, "StaticAlarmRanges")
        if ranges is None or math.isnan(value.value):
            return "none"
        if ranges.get("rangeForm") != "outside":
            raise XtceError(f"{path}: {ranges.get('rangeForm')}")
        for tag, level in (("CriticalRange", "critical"), ("WarningRange", "warning")):
            bounds = child(ranges, tag)
            if bounds is not None and not inside(bounds, value.value):
                return level
        return "normal"

    # --- telecommands ------------------------------------------------------------------------------------------------

    def encode(self, path, given):
        """Octets of a command; missing arguments take their initial value."""
        if self.commands[path].get("abstract") == "true":
            raise XtceError(f"{path} is abstract")
        line = [path]
        while child(self.commands[line[0]], "BaseMetaCommand") is not None:
            line.insert(0, self.resolve(child(self.commands[line[0]], "BaseMetaCommand").get("metaCommandRef"), line[0]))
        arguments, assigned = {}, {}
        for name in line:
            for assignment in children(self.commands[name], "BaseMetaCommand", "ArgumentAssignmentList"):
                if assignment.get("argumentName") not in arguments:
                    raise XtceError(f"{name} assigns the unknown {assignment.get('argumentName')}")
                assigned[assignment.get("argumentName")] = assignment.get("argumentValue")
            for argument in children(self.commands[name], "ArgumentList"):
                if argument.get("name") in arguments:
                    raise XtceError(f"{name}: argument {argument.get('name')} twice")
                arguments[argument.get("name")] = (argument, name)
        unknown = set(given) - set(arguments) | set(given) & set(assigned)
        if unknown:
            raise Refused(f"{path}: {unknown}")
        values = {}
        for name, (argument, _) in arguments.items():
            values[name] = assigned.get(name, given.get(name, argument.get("initialValue")))
        bits = Bits()
        for name in line:
            base = child(self.commands[name], "CommandContainer", "BaseContainer")
            if (base is None) != (name == line[0]):
                raise XtceError(f"{name}: the container does not extend that of the base")
            for entry in children(self.commands[name], "CommandContainer", "EntryList"):
                if local(entry) == "FixedValueEntry":
                    bits.put(int(entry.get("binaryValue"), 16), int(entry.get("sizeInBits")))
                elif local(entry) == "ArgumentRefEntry":
                    argument, owner = arguments[entry.get("argumentRef")]
                    self._put(self.resolve(argument.get("argumentTypeRef"), owner), values[entry.get("argumentRef")], bits, values)
                else:
                    raise XtceError(f"{name}: {local(entry)}")
        return bits.octets()

    def _put(self, path, value, bits, values):
        if value is None:
            raise Refused(f"no value for {path}")
        kind = self.argument_types[path]
        name = local(kind).removesuffix("ArgumentType")
        if name == "Array":
            for element in self._elements(kind, path, value, values):
                self._put(self.resolve(kind.get("arrayTypeRef"), path), element, bits, values)
        elif name == "Aggregate":
            members = {m.get("name"): m for m in children(kind, "MemberList")}
            if set(value) - set(members):
                raise Refused(f"{path}: {set(value) - set(members)}")
            for member in members.values():
                self._put(self.resolve(member.get("typeRef"), path), value.get(member.get("name"), member.get("initialValue")), bits, values)
        elif name == "AbsoluteTime":
            encoding = child(kind, "Encoding")
            scale, offset = Fraction(float(encoding.get("scale", 1))), Fraction(float(encoding.get("offset", 0)))
            self._seconds(kind, encoding, 0)  # checks the epoch
            self._put_raw(encoding[0], path, round((Fraction(value) - offset) / scale), bits)
        else:
            self._put_raw(self._encoding(kind), path, self._raw(kind, name, path, value), bits)

    @staticmethod
    def _elements(kind, path, value, values):
        (dimension,) = child(kind, "DimensionList")
        if child(dimension, "StartingIndex", "FixedValue").text != "0":
            raise XtceError(path)
        last = child(dimension, "EndingIndex", "DynamicValue")
        adjustment = child(last, "LinearAdjustment")
        count = int(values[child(last, "ArgumentInstanceRef").get("argumentRef")])
        if count * int(adjustment.get("slope")) + int(adjustment.get("intercept")) != len(value) - 1:
            raise Refused(f"{path}: {len(value)} elements")
        return value

    @staticmethod
    def _raw(kind, name, path, value):
        if name == "Boolean":
            if isinstance(value, str):
                value = {kind.get("oneStringValue"): True, kind.get("zeroStringValue"): False}[value]
            return int(value)
        if name == "Enumerated":
            for entry in children(kind, "EnumerationList"):
                if entry.get("label") == value:
                    return int(entry.get("value"))
            raise Refused(f"{path}: {value}")
        if name == "String":
            bounds = child(kind, "SizeRangeInCharacters")
            if not inside(bounds, len(value)):
                raise Refused(f"{path}: {len(value)} characters")
            return value
        if name not in ("Integer", "Float"):
            raise XtceError(f"{path}: {local(kind)}")
        value = int(value) if name == "Integer" else float(value)
        ranges = children(kind, "ValidRangeSet")
        if ranges and not any(inside(r, value) for r in ranges):
            raise Refused(f"{path}: {value}")
        return value

    @staticmethod
    def _put_raw(encoding, path, value, bits):
        name = local(encoding)
        if name == "IntegerDataEncoding":
            size = int(encoding.get("sizeInBits"))
            if encoding.get("encoding") == "twosComplement":
                if not -(1 << (size - 1)) <= value < 1 << (size - 1):
                    raise Refused(f"{path}: {value}")
                value &= (1 << size) - 1
            if not 0 <= value < 1 << size:
                raise Refused(f"{path}: {value}")
            bits.put(value, size)
        elif name == "FloatDataEncoding":
            size = int(encoding.get("sizeInBits"))
            bits.put(int.from_bytes(struct.pack({32: ">f", 64: ">d"}[size], value), "big"), size)
        elif name == "StringDataEncoding":
            variable = child(encoding, "Variable")
            tag = int(child(variable, "LeadingSize").get("sizeInBitsOfSizeTag"))
            octets = value.encode(encoding.get("encoding"))
            if tag + 8 * len(octets) > int(variable.get("maxSizeInBits")):
                raise Refused(f"{path}: {len(octets)} octets")
            bits.put(len(octets), tag)
            bits.put(int.from_bytes(octets, "big"), 8 * len(octets))
        else:
            raise XtceError(f"{path}: {name}")


def inside(bounds, value):
    if set(bounds.attrib) - {"minInclusive", "maxInclusive", "validRangeAppliesToCalibrated"}:
        raise XtceError(f"{bounds.attrib}")
    low, high = bounds.get("minInclusive"), bounds.get("maxInclusive")
    exact = int if isinstance(value, int) and not any("." in b or "e" in b for b in (low, high) if b) else float
    return not (low is not None and value < exact(low)) and not (high is not None and value > exact(high))
