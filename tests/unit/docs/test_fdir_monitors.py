# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""docs/explanation/fdir_monitors.md: every fault of fdir.md has a monitor or a reason, and every monitor that it names is in the factory set."""

import re
import unittest

from srfs import ROOT

FAULTS = (ROOT / "docs/explanation/fdir.md").read_text()
PAGE = re.sub(r"\n  +", " ", (ROOT / "docs/explanation/fdir_monitors.md").read_text())
REASONS = set(re.findall(r"^- \*\*(.+?)\*\*", PAGE, re.M))
FOUND_BY = {}
for line in PAGE.splitlines():
    for fault in re.findall(r"^- \*\*(.+)\*\*$", FAULTS, re.M):
        if line.startswith(f"- {fault}: "):
            FOUND_BY[fault] = line[len(fault) + 4:]


class FdirMonitors(unittest.TestCase):
    def test_every_fault_has_a_monitor_or_a_reason(self):
        faults = re.findall(r"^- \*\*(.+)\*\*$", FAULTS, re.M)
        self.assertGreater(len(faults), 120)
        self.assertEqual([fault for fault in faults if fault not in FOUND_BY], [])
        for fault, found_by in FOUND_BY.items():
            with self.subTest(fault):
                self.assertTrue("`" in found_by or "stale" in found_by or any(reason in found_by for reason in REASONS), found_by)

    def test_every_monitor_that_is_named_is_in_the_factory_set(self):
        dictionary = (ROOT / "docs/reference/dictionary.md").read_text()
        section = dictionary.split("## Monitors")[1].split("## Event-actions")[0]
        monitored = set(re.findall(r"^\| \d+ \| (\S+) \|", section, re.M))
        for fault, found_by in FOUND_BY.items():
            for parameter in re.findall(r"`([a-z_]+\.[a-z_.]+)`", found_by):
                with self.subTest(fault, parameter=parameter):
                    self.assertIn(parameter, monitored)


if __name__ == "__main__":
    unittest.main()
