# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Which telecommands of a campaign are under way."""

import itertools
import pathlib
import unittest

from srfs.campaign.campaign import Campaign


class Flight:
    """A flight whose ground numbers what it is given, and says nothing."""

    run_dir = pathlib.Path("/nonexistent")

    def __init__(self):
        self._lines = itertools.count(1)

    def recorder(self):
        return self

    ground = recorder

    def on_message(self, _callback):
        pass

    def send(self, _line):
        return next(self._lines)


class CampaignTest(unittest.TestCase):
    def setUp(self):
        self.campaign = Campaign(Flight(), None, 1, print)
        self.campaign.listen()
        self.assertTrue(self.campaign.all_ended())
        self.campaign.send_telecommand("payload_eps")

    def stage(self, stage, final):
        self.campaign.on_downlink({"type": "tc_stage", "line": 1, "stage": stage, "final": final})

    def test_a_telecommand_of_which_nothing_came_yet_has_not_ended(self):
        self.assertFalse(self.campaign.all_ended())
        self.stage("sent", False)
        self.assertFalse(self.campaign.all_ended())
        self.stage("completed", True)
        self.assertTrue(self.campaign.all_ended())

    def test_one_that_the_ground_refused_has_ended(self):
        self.campaign.on_downlink({"type": "error", "line": 1})
        self.assertTrue(self.campaign.all_ended())


if __name__ == "__main__":
    unittest.main()
