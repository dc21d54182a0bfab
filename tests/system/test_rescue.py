# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""A suite that cannot start any more steps down to srfs_rescue; stock srfs-ground brings it back by telecommands alone (programs/rescue)."""

import hashlib
import json
import shutil
import unittest

from support import BIN, DEADLINE_S, SystemTest

from srfs.campaign import rescue
from srfs.flight import mission
from srfs.flight.processes import wait_until


def step_of(board):
    return json.loads(board.srfs(board.whole_bin, "rescue", "step", "--json").stdout)


class RescueTest(SystemTest):
    def test_a_damaged_suite_is_answered_for_and_brought_back_by_telecommands_alone(self):
        with rescue.Board(self.folder / "board", mission.installed(BIN)) as board:
            self.addCleanup(mission.forget_memory, board.var)
            rescue.fly_once(board)
            pristine = self.folder / "pristine"
            shutil.copytree(board.folder / "etc", pristine / "etc")

            # A program is cut, a library is gone, the deployment is rubbish and has no good copy on board.
            ttc = board.prefix / "bin" / "ttc_node"
            ttc.write_bytes(ttc.read_bytes()[:1000])
            (board.prefix / "lib" / "libsrfs_base.so.0").resolve().unlink()
            golden = board.var / "golden" / hashlib.sha256(board.deployment.read_bytes()).hexdigest()
            golden.write_text("rubbish")
            board.deployment.write_text("rubbish")
            self.assertIsNotNone(board.answers())
            self.assertEqual(board.speaker(), "rescue")
            self.assertIn("srfs_rescue: unhealthy_starts, the suite is down", board.ground("status", "--timeout", "30").stdout)
            step = step_of(board)
            self.assertEqual((step["step"], step["cause"]), ("rescue", "unhealthy_starts"))

            # What only the suite does is refused, logs come down, keys do not.
            self.assertIn("no application process", board.ground("tc", "ring.hold", "node=ttc", "--wait").stdout)
            self.assertIn("ttc", board.order("rescue.list", "path=state")[1])
            for path in ("log/timing.log", "state/ring/faults.log", "state/boot/step_a"):
                self.assertTrue(board.order("rescue.fetch", f"path={path}")[0])
            came = board.station / "ground" / "files"
            wanted = [came / name for name in ("log_timing.log", "state_ring_faults.log", "state_boot_step_a")]
            wait_until(lambda: board.ground("files", "--duration", "2") and all(file.exists() for file in wanted), DEADLINE_S, "the files come down")
            self.assertIn("timing", (came / "log_timing.log").read_text())
            self.assertIn("step1 ", (came / "state_boot_step_a").read_text())
            ledger = [json.loads(line.split("\t")[0]) for line in (came / "state_ring_faults.log").read_text().splitlines()]
            steps = [line["detail"] for line in ledger if line["observer"] == "srfs_rescue"]
            self.assertEqual(steps, [f"step {name}, cause unhealthy_starts" for name in ("last_good", "golden", "rescue")])
            self.assertNotEqual(board.ground("tc", "rescue.fetch", "path=keys/tc_uplink.key", "--wait").returncode, 0)

            damaged = [rescue.Damage(board.deployment.relative_to(board.folder), "rubbish")]
            self.assertEqual(rescue.bring_back(board, pristine, damaged), "")
            wait_until(lambda: board.ping(2), DEADLINE_S, "ttc answers with the same counters")
            self.assertEqual(board.speaker(), "suite")
            self.assertTrue(board.order("boot.step_up")[0])

            # A suite that answers is ordered into rescue, and back.
            before = step_of(board)
            self.assertNotEqual(board.ground("tc", "rescue.enter", "--wait").returncode, 0, "hazardous: to be armed")
            self.assertTrue(board.order("rescue.enter", "--arm")[0])
            wait_until(lambda: "timing is inactive" in (board.var / "log" / "ttc.log").read_text(), DEADLINE_S, "the watchdog is not fed any more")
            board.lose_power()
            board.start()
            wait_until(lambda: board.ping(1), DEADLINE_S, "srfs_rescue answers")
            step = step_of(board)
            self.assertEqual((step["step"], step["cause"]), ("rescue", "commanded"))
            self.assertEqual(step["set_aside"], before["set_aside"], "nothing is moved")
            self.assertTrue(board.order("rescue.start_suite")[0])
            wait_until(board.all_active, DEADLINE_S, "the suite runs as before")


if __name__ == "__main__":
    unittest.main()
