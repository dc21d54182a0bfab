# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""What a ROS 2 developer looks for in a running suite, and finds by `srfs` alone: echo, graph, diagnostics, a node without a deployment."""

import json
import signal
import subprocess

from support import BIN, DEADLINE_S, SystemTest

from srfs import nodes_page
from srfs.flight.processes import wait_until


class RosToolsTest(SystemTest):
    def test_topics_nodes_health_and_single_programs_are_seen(self):
        with self.flight() as flight:
            self.flown = flight
            self.check_echo()
            self.check_graph()
            self.check_diagnostics()
            self.check_run()

    def start(self, *arguments):
        process = subprocess.Popen([BIN / "srfs", *map(str, arguments)], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.kill)
        return process

    def end(self, process):
        """Ctrl-C. Returns what it printed."""
        process.send_signal(signal.SIGINT)
        said, errors = process.communicate(timeout=DEADLINE_S)
        self.assertEqual(process.returncode, 0, errors)
        return said

    def echo(self, topic, *options):
        """The messages that `srfs echo` prints."""
        result = subprocess.run([BIN / "srfs", "echo", topic, "--var", self.var, *map(str, options)], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=DEADLINE_S)
        return result, [json.loads(line) for line in result.stdout.splitlines()]

    def check_echo(self):
        result, ticks = self.echo("/timing/tick", "--count", 3)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual([tick["cycle"] - ticks[0]["cycle"] for tick in ticks], [0, 1, 2])
        self.assertEqual(set(ticks[0]["utc"]), {"sec", "nanosec"})
        result, none = self.echo("/nobody", "--patience", 1)
        self.assertEqual((result.returncode, none), (1, []))
        self.assertIn("nobody publishes /nobody", result.stderr)

    def graph(self):
        """{node: its ends}; "": what no node claims."""
        return {node["node"]: node for node in self.flown.srfs_json("graph")}

    def check_graph(self):
        tick = {"name": "/timing/tick", "type": "srfs_msgs/msg/TimeTick", "best_effort": False, "transient_local": False}
        mode = {"name": "/mode", "type": "srfs_msgs/msg/SystemMode", "best_effort": False, "transient_local": True}
        expected = (
            ("/timing", "publishers", tick),
            ("/can_switcher", "subscriptions", tick),
            ("/ttc", "publishers", mode),
            ("/timing", "services", {"name": "/timing/get_state", "type": "lifecycle_msgs/srv/GetState"}),
            ("/ttc", "action_clients", {"name": "/image/capture", "type": "srfs_msgs/action/CaptureImage"}),
        )

        def shows_all():
            graph = self.graph()
            nodes = {f"/{status['name']}" for status in self.flown.status()}
            return nodes <= graph.keys() and all(end in graph[node][ends] for node, ends, end in expected)

        wait_until(shows_all, DEADLINE_S, "every node is shown with what it has")
        shown = lambda: [node["node"] for node in json.loads(self.flown.srfs("graph", "timing", "--wait", 5000).stdout or "[]")]  # noqa: E731
        wait_until(lambda: shown() == ["/timing"], DEADLINE_S, "it alone is shown")
        none = self.flown.srfs("graph", "nobody")
        self.assertEqual(none.returncode, 1)
        self.assertIn("no node 'nobody'", none.stderr)
        self.check_the_page()

    def check_the_page(self):
        """docs/reference/nodes.md, which is made from the sources, is what flies."""
        nodes = [status["name"] for status in self.flown.status()]
        whole = wait_until(lambda: (graph := self.graph()) and all(f"/{node}" in graph for node in nodes) and graph, DEADLINE_S, "all nodes")
        self.assertEqual(nodes_page.missing_ends({node: whole[f"/{node}"] for node in nodes}), [])
        for node in nodes:
            described = wait_until(lambda: (d := self.flown.srfs("param", "describe", node)).returncode == 0 and d, DEADLINE_S, node)  # noqa: B023
            flown = {parameter["name"] for parameter in json.loads(described.stdout)["parameters"]}
            self.assertEqual(flown, nodes_page.parameters_on_page(node), node)

    def check_diagnostics(self):
        publisher = self.start("diagnostics", "--period", 200, "--var", self.var)
        nodes = {node["name"] for node in self.flown.status()}

        def health():
            """{name: level} of the last of a few messages."""
            _, messages = self.echo("/diagnostics", "--count", 3)
            return {status["name"]: status["level"] for status in messages[-1]["status"]} if messages else {}

        well = {f"sim: {node}": 0 for node in nodes}
        wait_until(lambda: health() == well, DEADLINE_S, "every node is well")
        _, (whole, *_) = self.echo("/diagnostics_agg", "--count", 1)
        self.assertEqual({status["name"] for status in whole["status"]}, {"/sim", *(f"/sim/{node}" for node in nodes)})
        self.flown.srfs("lifecycle", "payload_eps", "deactivate")
        wait_until(lambda: health() == {**well, "sim: payload_eps": 1}, DEADLINE_S, "the one that does not work is shown")
        self.flown.srfs("lifecycle", "payload_eps", "activate")
        self.end(publisher)

    def check_run(self):
        """A program that has no place in the deployment hears the suite, and obeys."""
        folder = self.folder / "ad_hoc"
        parameters = self.folder / "parameters.yaml"
        parameters.write_text("/**:\n  ros__parameters: { log_level: warn, callback_budget_ms: 77 }\n")
        node = self.start("run", "--folder", folder, "--name", "counter", "--domain", self.flown.domain, BIN / "tick_counter_node", "--ros-args",
                          "-p", "report_every:=7", "--params-file", parameters)  # fmt: skip
        target = ["--deployment", folder / "deployment.yaml", "--var", folder / "var"]

        def srfs(*words):
            done = subprocess.run([BIN / "srfs", *words, "--json", *target], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=DEADLINE_S)
            return json.loads(done.stdout) if done.returncode == 0 else None

        topics = lambda: {each["topic"] for each in self.flown.srfs_json("topics")}  # noqa: E731
        wait_until(lambda: "/counter/transition_event" in topics(), DEADLINE_S, "it is there under its name")
        wait_until(lambda: "/counter" in self.graph(), DEADLINE_S, "a node of no suite is shown, too")
        self.assertEqual((folder / "deployment.yaml").read_text().count("report_every: 7"), 1)
        self.assertEqual([status["name"] for status in srfs("status")], ["counter"])
        self.end(node)
        wrong = self.start("run", "--folder", folder, BIN / "tick_counter_node", "--ros-args", "-p", "report_every")
        self.assertIn("expected NAME:=VALUE", wrong.communicate(timeout=DEADLINE_S)[1])
        self.assertEqual(wrong.returncode, 2)
