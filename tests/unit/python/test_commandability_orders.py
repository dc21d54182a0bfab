# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Which orders the commandability campaign gives."""

import collections
import unittest

from mission_dictionary import load

from srfs import ROOT
from srfs.campaign import commandability

DICTIONARY = load(ROOT / "mission")


class OrdersTest(unittest.TestCase):
    def setUp(self):
        self.orders = collections.defaultdict(list)
        for order in commandability.all_orders():
            self.orders[order.kind].append(order)

    def test_every_telecommand_is_given(self):
        given = {order.name.split()[0] for order in self.orders["telecommand"]}
        given |= {line.split()[1] for order in self.orders["parameter"] for line in order.lines}
        self.assertEqual({command["name"] for command in DICTIONARY.commands} - given, set())

    def test_every_parameter_is_set_to_both_ends_of_its_range(self):
        values = collections.defaultdict(list)
        for order in self.orders["parameter"]:
            name, _, value = order.name.partition("=")
            values[name].append(value)
        self.assertEqual(set(values), {parameter["full_name"] for parameter in DICTIONARY.parameters})
        for parameter in DICTIONARY.parameters:
            with self.subTest(parameter["full_name"]):
                self.assertEqual(len(values[parameter["full_name"]]), 3 if parameter["type"] == "text" else 2)
                if "range" in parameter:
                    self.assertEqual(values[parameter["full_name"]], [str(end) for end in parameter["range"]])

    def test_every_pair_of_hazardous_telecommands_is_given_with_both_ends_in_both_orders_and_armed(self):
        hazardous = {command["name"] for command in DICTIONARY.commands if command.get("hazardous")}
        pairs = self.orders["pair"]
        given = collections.Counter((order.lines[1].split()[1], order.lines[3].split()[1]) for order in pairs)
        self.assertEqual(set(given), {(a, b) for a in hazardous for b in hazardous})
        self.assertEqual(given["timing.step_time", "ttc.transmitter_off"], 4, "each with both ends")
        for order in pairs:
            self.assertEqual([line.split()[0] for line in order.lines], ["arm", "tc", "arm", "tc"])

    def test_every_node_is_taken_out_of_active_in_every_way(self):
        nodes = {entry["node"] for entry in DICTIONARY.apids}
        ways = collections.Counter(order.name.split()[0] for order in self.orders["on board"])
        self.assertEqual(ways, {node: 4 for node in nodes})


if __name__ == "__main__":
    unittest.main()
