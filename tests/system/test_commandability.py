# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The short form of `./run campaign commandability`: the orders that come nearest to making the satellite deaf."""

import unittest

from support import BIN, SystemTest

from srfs.campaign import commandability


class CommandabilityTest(SystemTest):
    def test_no_dangerous_order_makes_the_satellite_deaf(self):
        with commandability.Trials(self.var, self.deployment(commandability.LIMIT), BIN, print) as trials:
            trials.give_all(commandability.dangerous_orders())
        verdict = trials.judge()
        self.assertTrue(verdict["ok"], verdict)


if __name__ == "__main__":
    unittest.main()
