# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The XTCE file against the flight code's encoders: values and octets, for every packet and telecommand of the dictionary."""

import binascii
import json
import math
import os
import pathlib
import re
import struct
import subprocess
import sys
import tempfile
import unittest
from fractions import Fraction

import yaml
from mission_dictionary import linear, load, snake
from mission_xtce import with_fields_in_place
from xtce_interpreter import Database, Refused, child, children

from srfs import ROOT
from srfs.flight import deployments

HERE = pathlib.Path(__file__).resolve().parent
GENERATOR = ROOT / "msgs/generator"

DICTIONARIES = {"flying": ROOT / "mission", "fixture": HERE / "fixture"}
ROUNDS = {"flying": 4, "fixture": 60}
EMULATOR = os.environ.get("SRFS_TEST_EMULATOR", "").split()  # set in a cross-build
LEVELS = {"none": "none", "green": "normal", "yellow": "warning", "red": "critical"}


def generate(dictionary, *options):
    """@return the XTCE file"""
    return subprocess.run([sys.executable, "-B", GENERATOR / "mission_xtce.py", "--dictionary", DICTIONARIES[dictionary], "--out", "-",
                           *options], check=True, capture_output=True, text=True, timeout=200).stdout


def as_the_link_sends(packet, sequence_count):
    """Fills in what the ground's link adds: sequence count, length, error control."""
    whole = bytearray(packet + b"\0\0")
    whole[2:4] = (int.from_bytes(whole[2:4], "big") | sequence_count).to_bytes(2, "big")
    whole[4:6] = (len(whole) - 7).to_bytes(2, "big")
    whole[-2:] = binascii.crc_hqx(whole[:-2], 0xFFFF).to_bytes(2, "big")
    return bytes(whole)


def argument_of(value):
    """Converts a value of the peer for the interpreter: labels for enumerations, seconds for times."""
    if isinstance(value, list):
        return [argument_of(v) for v in value]
    if isinstance(value, dict):
        if "tai_ns" in value:
            return Fraction(value["tai_ns"], 10**9)
        if "label" in value:
            return value["label"]
        return {k: argument_of(v) for k, v in value.items()}
    return value


class XtceTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.text = {name: generate(name) for name in DICTIONARIES}
        cls.database = {name: Database(text) for name, text in cls.text.items()}
        cls.dictionary = {name: load(folder) for name, folder in DICTIONARIES.items()}
        cls.lines = {}
        for name, folder in DICTIONARIES.items():
            seed = os.environ.get("XTCE_SEED", "1")
            run = subprocess.run([*EMULATOR, pathlib.Path(os.environ["SRFS_TEST_BIN"]) / f"xtce_peer_{name}", folder, seed, str(ROUNDS[name])],
                                 check=True, capture_output=True, text=True, timeout=60)
            cls.lines[name] = [json.loads(line) for line in run.stdout.splitlines()]

    def each(self, kind):
        return [(name, line) for name, lines in self.lines.items() for line in lines if kind in line]

    def told(self, name, line):
        return self.subTest(dictionary=name, what=line.get("tm") or line.get("tc"), packet=line["packet"])

    def test_the_files_are_valid_against_the_schema_of_the_omg(self):
        with tempfile.TemporaryDirectory() as folder:
            for name in DICTIONARIES:
                for verifiers in ("yamcs", "container"):
                    file = pathlib.Path(folder, f"{name}_{verifiers}.xml")
                    file.write_text(generate(name, "--verifiers", verifiers), encoding="utf-8")
                    run = subprocess.run(["xmllint", "--nonet", "--noout", "--schema", HERE / "schema/SpaceSystem.xsd", file],
                                         capture_output=True, text=True, timeout=60)
                    self.assertEqual(run.returncode, 0, f"{name}, {verifiers}: {run.stderr[:2000]}")

    def test_a_packet_of_the_flight_code_has_the_values_it_was_made_with(self):
        for name, line in self.each("tm"):
            with self.told(name, line):
                database = self.database[name]
                root = "/" + self.dictionary[name].spacecraft["name"]
                container, values, rest = database.decode(bytes.fromhex(line["packet"]), f"{root}/ccsds_packet")
                self.assertEqual(container, line["tm"])
                self.assertEqual(rest, 2, "all but the error control is described")
                place = container.rsplit("/", 1)[0]
                for field, expected in line["header"].items():
                    self.compare(values[f"{root}/{field}"], expected, field)
                seen = {p.rsplit("/", 1)[1] for p in values if p.rsplit("/", 1)[0] == place}
                for field, expected in line["values"].items():
                    self.compare(values[f"{place}/{field}"], expected, field)
                if place == root:
                    seen -= {*line["header"], "structure_id", "event_id"}
                hidden = {s for s in seen - set(line["values"]) if s.removesuffix("_length").removesuffix("_p_field") in line["values"]}
                self.assertEqual(seen - hidden, set(line["values"]), "no parameter too many")

    def compare(self, seen, expected, field):
        if isinstance(expected, dict) and "tai_ns" in expected:
            self.assertAlmostEqual(seen.value * 10**9, expected["tai_ns"], delta=1, msg=field)  # half a nanosecond may round either way
        elif isinstance(expected, dict):
            self.assertEqual((seen.raw, seen.value), (expected["raw"], expected["label"]), field)
        elif expected is None:
            self.assertTrue(not seen.valid or seen.value != seen.value, f"{field}: {seen.value} is not unknown")
        elif isinstance(expected, bool):
            self.assertIn(seen.value, (expected, "true" if expected else "false"), field)
        elif isinstance(expected, float) and isinstance(seen.value, float):
            narrow = struct.unpack("f", struct.pack("f", seen.value))[0]
            self.assertIn(expected, (seen.value, narrow), field)
            self.assertTrue(seen.valid, field)
        elif isinstance(seen.value, float):
            self.assertEqual(seen.raw, expected, field)  # a polynomial calibration: the struct holds the raw value
        else:
            self.assertEqual(seen.value, expected, field)

    def test_calibrated_values_and_limits_are_those_of_our_ground_tool(self):
        judged = {"none": 0, "normal": 0, "warning": 0, "critical": 0}
        for name, line in self.each("tm"):
            with self.told(name, line):
                root = "/" + self.dictionary[name].spacecraft["name"]
                container, values, _ = self.database[name].decode(bytes.fromhex(line["packet"]), f"{root}/ccsds_packet")
                for field, ground in line.get("ground", {}).items():
                    seen = values[f"{container.rsplit('/', 1)[0]}/{field.replace('.', '_').replace('[', '_').rstrip(']')}"]
                    self.assertEqual(seen.level, LEVELS[ground["limit"]], field)
                    judged[seen.level] += 1
                    if ground.get("value") is not None:
                        if EMULATOR and isinstance(ground["value"], float):  # the emulated processor fuses multiply and add: one rounding
                            self.assertTrue(math.isclose(seen.value, ground["value"], rel_tol=1e-12), f"{field}: {seen.value}, {ground['value']}")
                        else:
                            self.assertEqual(seen.value, ground["value"], field)
        self.assertGreater(min(judged.values()), 20, judged)

    def test_every_structure_event_and_report_was_compared(self):
        for name, dictionary in self.dictionary.items():
            root = "/" + dictionary.spacecraft["name"]
            compared = {line["tm"] for line in self.lines[name] if "tm" in line}
            concrete = {p for p, c in self.database[name].containers.items() if c.get("abstract") != "true"}
            reports = {p for p in concrete if p.count("/") == 2}
            self.assertEqual(compared, concrete if name == "flying" else concrete - reports)
            structures = [s for s in dictionary.structures if s["kind"] in ("housekeeping", "report")]
            self.assertEqual(len(concrete - reports), len(structures) + len(dictionary.events) + len(dictionary.parameters))
            self.assertEqual(len(reports), 14)
            for process in dictionary.apids:
                self.assertTrue(any(s.get("name") == process["name"] and f"APID {process['apid']}:" in s.get("shortDescription")
                                    for s in self.database[name].root), f"{root}/{process['name']}")

    def test_a_telecommand_has_the_octets_of_the_flight_code(self):
        for name, line in self.each("tc"):
            with self.told(name, line):
                arguments = argument_of(line["arguments"])
                if "groups" in arguments:
                    arguments["count"] = len(arguments["groups"])
                packet = self.database[name].encode(line["tc"], arguments)
                self.assertEqual(as_the_link_sends(packet, line["sequence_count"]).hex(), line["packet"])
        for name, dictionary in self.dictionary.items():
            compared = {line["tc"] for line in self.lines[name] if "tc" in line}
            concrete = {p for p, c in self.database[name].commands.items() if c.get("abstract") != "true"}
            self.assertEqual((compared, len(compared)), (concrete, len(dictionary.wire_commands)))

    def test_arguments_outside_their_range_are_refused(self):
        refused = 0
        for name, line in self.each("tc"):
            with self.told(name, line):
                command = next(c for c in self.dictionary[name].wire_commands if snake(c["name"]) == line["tc"].rsplit("/", 1)[1])
                good = argument_of(line["arguments"])
                if "groups" in good:
                    good["count"] = len(good["groups"])
                    for count in (*range(command.get("min_groups", 1)), command.get("max_groups", 16) + 1):
                        bad = dict(good, count=count, groups=(good["groups"] * 20)[:count])
                        self.assertRaises(Refused, self.database[name].encode, line["tc"], bad)
                for number, field in enumerate(command["arguments"]):
                    wrong = []
                    if "range" in field:
                        low, high = field["range"]
                        step = 1 if field["type"][0] in "ui" else 1e-3
                        wrong = [low - step, high + step]
                    elif "enum" in field or field.get("reference", "telemetry") != "telemetry":
                        wrong = ["no_such_label"]
                    elif field["type"] == "text":
                        wrong = ["x" * (field["max"] + 1)]
                    for value in wrong:
                        bad = {**good, field["name"]: value}
                        if "groups" in good and number >= command.get("head", 0):
                            if not good["groups"]:
                                continue
                            bad = {**good, "groups": good["groups"][:-1] + [{**good["groups"][-1], field["name"]: value}]}
                        self.assertRaises(Refused, self.database[name].encode, line["tc"], bad)
                        refused += 1
        self.assertGreater(refused, 100)

    def test_defaults_stand_in_for_arguments_that_are_not_given(self):
        for name, dictionary in self.dictionary.items():
            for path, command in self.database[name].commands.items():
                if command.get("abstract") == "true" or child(command, "ArgumentList") is None:
                    continue
                fields = next(c for c in dictionary.wire_commands if snake(c["name"]) == path.rsplit("/", 1)[1])["arguments"]
                given = {a.get("name"): a.get("initialValue") for a in children(command, "ArgumentList")}
                for field in fields:
                    if field["name"] in given:
                        default = field.get("default")
                        expected = {True: "true", False: "false"}[default] if isinstance(default, bool) else default
                        self.assertEqual(given[field["name"]], None if expected is None else str(expected), f"{path} {field['name']}")

    def test_every_telecommand_is_verified_by_its_own_reports(self):
        for name, dictionary in self.dictionary.items():
            root = "/" + dictionary.spacecraft["name"]
            for path, command in self.database[name].commands.items():
                if command.get("abstract") == "true":
                    continue
                entry = next(c for c in dictionary.wire_commands if snake(c["name"]) == path.rsplit("/", 1)[1])
                verifiers = {v.get("name"): v for v in children(command, "VerifierSet")}
                subtypes = {n: self.conditions(v, f"{root}/subtype") for n, v in verifiers.items()}
                self.assertEqual(subtypes, {"Accepted": ["1"], "Started": ["3"], "Completed": ["7"], "Failed": ["2", "4", "8"]}, path)
                for verifier in verifiers.values():
                    self.assertEqual(self.conditions(verifier, f"{root}/service"), ["1"])
                    self.assertEqual(self.conditions(verifier, f"{root}/request_apid"), [str(dictionary.apid_of[entry["node"]])])
                    self.assertEqual(self.conditions(verifier, "/yamcs/cmdHist/ccsds-seqcount"), [f"{root}/request_sequence_count"])
                    window = child(verifier, "CheckWindow").get("timeToStopChecking")
                    self.assertGreaterEqual(float(window[2:-1]), 10)
                window = float(child(verifiers["Completed"], "CheckWindow").get("timeToStopChecking")[2:-1])
                self.assertGreater(window * 1000, entry.get("timeout_ms", 10000) + 30000)
                significance = child(command, "DefaultSignificance")
                self.assertEqual(significance is not None and significance.get("consequenceLevel") == "critical", entry.get("hazardous", False))

    @staticmethod
    def conditions(verifier, parameter):
        """The values that @p parameter is compared with."""
        found = []
        for condition in verifier.iter("{http://www.omg.org/spec/XTCE/20180204}Condition"):
            left, operator, right = condition
            if left.get("parameterRef") == parameter and operator.text == "==":
                found.append(right.get("parameterRef") or right.text)
        return found

    def test_units_and_descriptions_are_those_of_the_dictionary(self):
        for name, dictionary in self.dictionary.items():
            database = self.database[name]
            root = "/" + dictionary.spacecraft["name"]
            owners = [(f"{root}/{a['name']}/{s['name']}", s) for s in dictionary.structures if s["kind"] in ("housekeeping", "report")
                      for a in dictionary.apids if a["node"] == s["node"]]
            owners += [(f"{root}/events/{snake(e['name'])}", e) for e in dictionary.events]
            for path, owner in owners:
                for field in with_fields_in_place(dictionary, owner["fields"]):
                    if field["type"] == "packet":
                        continue
                    parameter = database.parameters[f"{path}/{field['name']}"]
                    self.assertEqual(parameter.get("shortDescription") or "", field.get("description", ""))
                    kind = database.parameter_types[f"{path}/{parameter.get('parameterTypeRef')}"]
                    units = [u.text for u in children(kind, "UnitSet")]
                    self.assertEqual(units, [field["unit"]] if "unit" in field else [], f"{path}/{field['name']}")
                    self.assertEqual(linear(field) is not None and "Float" not in kind.tag, False)

    def test_no_reference_points_to_nothing(self):
        tables = {"parameterRef": "parameters", "containerRef": "containers", "parameterTypeRef": "parameter_types",
                  "argumentTypeRef": "argument_types", "arrayTypeRef": "argument_types", "typeRef": "argument_types",
                  "metaCommandRef": "commands"}
        for name, database in self.database.items():
            def walk(node, system, database=database):
                path = f"{system}/{node.get('name')}" if node.tag.endswith("}SpaceSystem") else system
                for attribute, table in tables.items():
                    target = node.get(attribute)
                    # Yamcs itself defines two names: the sequence count of the sent command, and "no reference" where the schema requires one.
                    if target is None or target in ("_yamcs_ignore", "/yamcs/cmdHist/ccsds-seqcount"):
                        continue
                    known = set(getattr(database, table)) | (set(database.commands) if table == "containers" else set())
                    self.assertIn(database.resolve(target, f"{path}/"), known, f"{attribute} in {path}")
                for part in node:
                    walk(part, path)
            walk(database.root, "")


class YamcsConfigurationTest(unittest.TestCase):
    """The folder docs/how-to/yamcs agrees with the deployment it is for and with the files that ./run xtce writes."""

    @classmethod
    def setUpClass(cls):
        folder = ROOT / "docs/how-to/yamcs/etc"
        cls.instance = yaml.safe_load((folder / "yamcs.srfs.yaml").read_text())
        cls.server = yaml.safe_load((folder / "yamcs.yaml").read_text())
        cls.processor = yaml.safe_load((folder / "processor.yaml").read_text())
        cls.links = {link["name"]: link for link in cls.instance["dataLinks"]}
        cls.deployment = deployments.read("sim_open")["link"]

    def test_the_instance_is_started(self):
        self.assertEqual(self.server["instances"], ["srfs"])

    def test_the_links_are_those_of_the_deployment(self):
        link = self.deployment
        down, up = self.links["tm"], self.links["tc"]
        self.assertEqual((down["class"], up["class"]), ("org.yamcs.tctm.ccsds.UdpTmFrameLink", "org.yamcs.tctm.ccsds.UdpTcFrameLink"))
        self.assertEqual((down["port"], up["port"]), (10015, 10025))
        self.assertEqual((down["spacecraftId"], up["spacecraftId"]), (link["spacecraft_id"], link["spacecraft_id"]))
        self.assertEqual((down["frameType"], down["frameLength"], down["errorDetection"]), ("TM", link["tm"]["frame_length"], "CRC16"))
        self.assertEqual([c["vcId"] for c in down["virtualChannels"]], [0, 1, 2])
        self.assertEqual((up["cltuEncoding"], up["randomizeCltu"], up["maxFrameLength"]), ("BCH", link["tc"]["randomizer"], 1024))
        open_channels = [c["vc"] for c in link["tc_channels"] if c["security"] == "none"]
        self.assertEqual([c["vcId"] for c in up["virtualChannels"]], open_channels)
        for channel in up["virtualChannels"]:
            self.assertEqual((channel["mapId"], channel["multiplePacketsPerFrame"], channel["useCop1"]), (0, False, True))
            self.assertEqual(channel["clcwStream"], down["clcwStream"])

    def test_streams_and_root_container_exist(self):
        database = Database(generate("flying"))
        streams = {s["name"]: s for s in self.instance["streamConfig"]["tm"]}
        for channel in self.links["tm"]["virtualChannels"]:
            if channel["service"] == "PACKET":
                self.assertIn(channel["stream"], streams)
        for stream in streams.values():
            self.assertIn(stream["rootContainer"], database.containers)
        commands = {s["name"] for s in self.instance["streamConfig"]["tc"]}
        self.assertTrue(all(c["stream"] in commands for c in self.links["tc"]["virtualChannels"]))
        self.assertEqual({s["processor"] for s in [*streams.values(), *self.instance["streamConfig"]["tc"]] if "processor" in s}, {"realtime"})
        self.assertIn("realtime", self.processor)

    def test_the_texts_of_the_events_name_parameters_that_exist(self):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder, "events.json")
            database = Database(generate("flying", "--events", str(file)))
            templates = json.loads(file.read_text())
        dictionary = load(DICTIONARIES["flying"])
        self.assertEqual([t["eventId"] for t in templates], [str(e["id"]) for e in dictionary.events])
        names = [n for t in templates for n in re.findall(r"\{(.*?)\}", t["template"])]
        self.assertGreater(len(names), 50)
        for name in names:
            self.assertIn(name, database.parameters)
        (decoder,) = [s for s in self.instance["services"] if s["class"].endswith("PusEventDecoder")]
        self.assertIn(decoder["args"]["eventIdParameter"], database.parameters)


if __name__ == "__main__":
    unittest.main()
