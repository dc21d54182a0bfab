# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""docs/reference/nodes.md is what the sources of the nodes make and declare."""

import unittest

from srfs import nodes_page
from srfs.flight import deployments


class NodesPage(unittest.TestCase):
    def test_is_what_the_sources_state(self):
        self.assertEqual(nodes_page.PAGE.read_text(), nodes_page.page(), "run python3 -m srfs.nodes_page")

    def test_has_every_node_of_the_deployment_sim(self):
        known = nodes_page.nodes()
        for node in deployments.read("sim")["nodes"]:
            with self.subTest(node["name"]):
                self.assertTrue(set(nodes_page.sections_of(node["name"])[1:]) & known.keys())

    def test_has_every_parameter_that_a_deployment_sets(self):
        for deployment in ("sim", "sim_mission", "board_rk3568"):
            for node in deployments.read(deployment)["nodes"]:
                with self.subTest(deployment=deployment, node=node["name"]):
                    self.assertLessEqual(node.get("parameters", {}).keys(), nodes_page.parameters_on_page(node["name"]))


class SourcesOfNodes(unittest.TestCase):
    def parameter(self, call):
        return nodes_page.parameter_of(nodes_page.arguments_after(call, call.index("(") + 1), call)

    def test_a_parameter_has_its_range_default_and_meaning(self):
        call = 'declare_parameter("wait_ms", std::int64_t{3 * day}, ros::ParameterRange{1, 86\'400}, "Longest " "wait, (of one)", true);'
        found = self.parameter(call + " constexpr int day = 7;")
        self.assertEqual(found, nodes_page.Parameter("wait_ms", "integer", "1 to 86400", "21", True, "Longest wait, (of one)"))

    def test_a_parameter_may_be_one_of_some_texts(self):
        found = self.parameter('declare_parameter("clock", std::string("a"), {"a", "b"}, "Which.")')
        self.assertEqual(found, nodes_page.Parameter("clock", "string", "`a`, `b`", "`a`", False, "Which"))

    def test_names_of_other_nodes_are_general(self):
        self.assertEqual(nodes_page.name_of('"/" + action.node + "/get_state"'), "/NODE/get_state")
        self.assertEqual(nodes_page.Topics().find("suite::topics::telemetry(name())")[0], "~/telemetry")
        self.assertEqual(nodes_page.Topics().find("suite::topics::telemetry(node)")[0], "/NODE/telemetry")

    def test_what_is_not_understood_is_an_error(self):
        for call in ("create_publisher(chosen_topic)", "create_service<srfs_msgs::srv::SetTime>(name, f)", 'declare_parameter(name, 5, "Text")',
                     'declare_parameter("a", unknown_value, "Text")', 'declare_parameter("a", 5, text)'):  # fmt: skip
            with self.subTest(call), self.assertRaises(ValueError):
                nodes_page.node_of(call + ";")

    def test_a_flight_with_more_than_the_page_is_reported(self):
        ends = {key: [] for key in nodes_page.KEYS.values()}
        known = {**ends, "publishers": [{"name": "/ttc/telemetry", "type": "srfs_msgs/msg/PayloadTelemetry"}],
                 "clients": [{"name": "/timing/get_state", "type": "lifecycle_msgs/srv/GetState"}]}  # fmt: skip
        self.assertEqual(nodes_page.missing_ends({"ttc": known}), [])
        unknown = {**ends, "services": [{"name": "/ttc/dance", "type": "srfs_msgs/srv/Dance"}]}
        self.assertEqual(nodes_page.missing_ends({"ttc": unknown}), ["ttc services: /ttc/dance (srfs_msgs/srv/Dance)"])


if __name__ == "__main__":
    unittest.main()
