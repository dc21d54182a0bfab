# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""docs/reference/modes.md is what the deployments state."""

import unittest

from srfs import modes_page


class ModesPage(unittest.TestCase):
    def test_is_what_the_deployments_state(self):
        self.assertEqual(modes_page.PAGE.read_text(), modes_page.page(), "run python3 -m srfs.modes_page")

    def test_has_every_node_that_a_mode_asks_something(self):
        text = modes_page.page()
        for node in ("payload_eps", "payload_adcs", "payload_thermal", "image_acquisition", "image_processing", "maintenance", "ttc"):
            self.assertIn(f"- {node}: ", text)


if __name__ == "__main__":
    unittest.main()
