"""What the ground asks of the ring: hold, release, release Inactive, the fault ledger, log levels (nodes/maintenance)."""

import os
import signal
import unittest

from support import DEADLINE_S, SystemTest, wait_until


class RingCommandsTest(SystemTest):
    def state(self, flight, node):
        return {n["name"]: n["state"] for n in flight.status()}[node]

    def complete(self, ground, line):
        outcome = ground.command(f"tc {line}", DEADLINE_S)
        self.assertEqual(outcome.get("stage"), "completed", outcome)

    def refuse(self, ground, line):
        """Text of the failure."""
        outcome = ground.command(f"tc {line}", DEADLINE_S)
        self.assertNotEqual(outcome.get("stage"), "completed", outcome)
        return str(outcome)

    def test_a_node_is_held_released_inactive_and_its_fault_reported_by_telecommand(self):
        with self.flight() as flight:
            ground = flight.ground()
            self.complete(ground, "ring.hold node=payload_eps")
            os.kill(flight.node_pid("payload_eps"), signal.SIGKILL)
            held = lambda: "held" in flight.srfs("faults", "--node", "payload_eps").stdout  # noqa: E731
            wait_until(held, DEADLINE_S, "the ring has found it dead, and left it alone")
            self.assertIsNone(flight.node_pid("payload_eps"))

            self.complete(ground, "ring.release_inactive node=payload_eps")
            wait_until(lambda: self.state(flight, "payload_eps") == "inactive", DEADLINE_S, "the ring has started it, and it stays Inactive")
            self.assertIn("not while the node runs", self.refuse(ground, "ring.release_inactive node=payload_eps"))
            self.complete(ground, "ring.release node=payload_eps")

            since = ground.position()
            self.complete(ground, "ring.report_faults count=20")
            line = ground.wait_for(lambda m: m.get("structure") == "ring_fault" and m["fields"]["node"] == "payload_eps"
                                   and m["fields"]["outcome"] == "held", DEADLINE_S, since)  # fmt: skip
            self.assertIsNotNone(line)
            self.assertEqual(line["fields"]["fault"], "exited")

            self.assertIn("no such node", self.refuse(ground, "ring.hold node=payload_xyz"))
            self.complete(ground, "node.set_log_level node=timing level=debug")
            self.assertIn("debug", flight.srfs("param", "get", "timing", "log_level").stdout)

    def test_the_report_of_a_death_comes_down_as_a_file(self):
        with self.flight() as flight:
            ground = flight.ground()
            self.assertIn("no report", self.refuse(ground, "node.send_report node=payload_eps"))
            pid = flight.node_pid("payload_eps")
            os.kill(pid, signal.SIGSEGV)
            reports = flight.var / "state/payload_eps/reports"
            (report,) = wait_until(lambda: list(reports.glob("*.report")), DEADLINE_S, "the report of its death")

            since = ground.position()
            self.complete(ground, "node.send_report node=payload_eps")
            name = f"payload_eps_{report.stem}.report"
            queued = ground.wait_for(lambda m: m.get("event") == "maintenance.report_queued", DEADLINE_S, since)
            self.assertIsNotNone(queued)
            self.assertEqual(queued["fields"]["name"], name)
            came = ground.wait_for(
                lambda m: m["type"] == "file" and m["event"] == "finished" and m["name"] == name, DEADLINE_S, since
            )
            self.assertIsNotNone(came, "the file did not come down")
            self.assertTrue(came["success"], came)
            text = (flight.var / "ground/files" / name).read_text(errors="replace")
            self.assertIn(f"*** fatal signal 11 (SIGSEGV) in thread payload_eps_nod of pid {pid}", text)
            self.assertIn("*** end of backtrace", text)
            self.assertIn("octets of its log", text)
            self.assertIn("lifecycle: active", text.partition("octets of its log")[2], "the log itself")
            self.assertEqual(text, report.read_text(errors="replace"), "as it lies on board")

            self.assertIn("no report", self.refuse(ground, "node.send_report node=payload_eps incarnation=4000"))
            self.assertIn("no such node", self.refuse(ground, "node.send_report node=payload_xyz"))
            self.complete(ground, f"node.send_report node=payload_eps incarnation={report.stem}")


if __name__ == "__main__":
    unittest.main()
