# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The deployments that the campaigns use."""

import pathlib
import tempfile
import unittest

from srfs import ROOT
from srfs.campaign import faults
from srfs.flight import deployments


class Deployment(unittest.TestCase):
    def test_with_real_time_rights_no_node_keeps_a_niceness_or_gives_way(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            for name in ("sim", "fencing"):
                base = ROOT / "launch_config" / f"{name}.yaml"
                self.assertTrue(any(node["scheduling"].get("background") for node in deployments.read(base)["nodes"]))
                wrappers = faults.Wrappers(folder / "bin", folder, folder / "none.so")
                file = wrappers.deployment(base, folder / "deployment.yaml", realtime=True)
                for node in deployments.read(file)["nodes"]:
                    self.assertEqual(node["scheduling"], {"policy": "fifo", "priority": faults.NODE_PRIORITY, "cpus": []}, f"{name}: {node['name']}")


if __name__ == "__main__":
    unittest.main()
