# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The pictures of README.md and docs/: the text around each names the script that makes it, and the nodes picture shows the deployed nodes."""

import re
import unittest
import xml.etree.ElementTree

from srfs import ROOT
from srfs.pictures import nodes as nodes_picture

SVG = "{http://www.w3.org/2000/svg}"
NEAR = 8  # the script must be named within so many lines below the picture, or above it in its section


def texts_of(svg, kind):
    return [t.text for t in svg.iter(f"{SVG}text") if kind in t.get("class", "").split()]


class NodesPicture(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.svg = xml.etree.ElementTree.parse(ROOT / "docs/pictures/nodes.svg").getroot()

    def test_is_what_its_script_draws(self):
        self.assertEqual((ROOT / "docs/pictures/nodes.svg").read_text(), nodes_picture.picture(nodes_picture.deployed_nodes()), "run python3 -m srfs.pictures nodes")

    def test_shows_the_nodes_of_the_deployment_in_the_order_of_the_ring(self):
        nodes = nodes_picture.deployed_nodes()
        devices = {device[4] for device in nodes_picture.DEVICES}
        self.assertEqual(sorted(set(texts_of(self.svg, "name")) - devices), sorted(nodes))
        self.assertEqual(texts_of(self.svg, "ring-name"), nodes)

    def test_its_topics_are_those_of_the_code(self):
        sources = "".join(p.read_text() for folder in ("lib/ros", "lib/suite", "nodes") for p in (ROOT / folder).rglob("*.?pp"))
        topics = texts_of(self.svg, "topic")
        self.assertGreater(len(topics), 8)
        for topic in topics:
            parts = [part for part in re.split(r"<\w+>", topic) if part != "/"]
            self.assertTrue(all(f'{part}"' in sources for part in parts), topic)

    def test_a_node_without_a_place_is_refused(self):
        with self.assertRaises(SystemExit):
            nodes_picture.picture([*nodes_picture.deployed_nodes(), "payload_new"])


class Pictures(unittest.TestCase):
    def test_each_names_what_makes_it(self):
        seen, silent = set(), []
        for document in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md")):
            lines = document.read_text().splitlines()
            for number, line in enumerate(lines):
                for picture in re.findall(r"!\[.*?\]\((.*?)\)", line):
                    seen.add((document.parent / picture).resolve())
                    head = max(n for n in range(number) if lines[n].startswith("#"))
                    around = "\n".join(lines[head : number + NEAR + 1])
                    if not re.search(r"\./run (experiment|campaign|bench)|python/srfs/pictures/\w+\.py", around):
                        silent.append(f"{document.name}:{number + 1}: {picture}")
        self.assertEqual(silent, [])
        drawn = {p.resolve() for pattern in ("*.svg", "*.png") for p in (ROOT / "docs").rglob(pattern)}
        self.assertEqual(drawn - seen, set(), "pictures that no page shows")


if __name__ == "__main__":
    unittest.main()
