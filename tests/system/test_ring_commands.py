# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Telecommands for the ring: hold, release, release Inactive, the fault ledger, log levels (nodes/maintenance)."""

import os
import signal
import unittest

from support import BIN, DEADLINE_S, SystemTest

from srfs import ROOT
from srfs.flight.processes import wait_until


class RingCommandsTest(SystemTest):
    def state(self, flight, node):
        return {n["name"]: n["state"] for n in flight.status()}[node]

    def refuse(self, ground, line):
        """Sends a telecommand that must fail. Returns the text of the failure."""
        outcome = ground.command(f"tc {line}", DEADLINE_S)
        self.assertNotEqual(outcome.get("stage"), "completed", outcome)
        return str(outcome)

    def test_a_node_is_held_released_inactive_and_its_fault_reported_by_telecommand(self):
        with self.flight() as flight:
            ground = flight.ground()
            self.complete(ground, "tc ring.hold node=payload_eps")
            os.kill(flight.node_pid("payload_eps"), signal.SIGKILL)
            held = lambda: "held" in flight.srfs("faults", "--node", "payload_eps").stdout  # noqa: E731
            wait_until(held, DEADLINE_S, "the ring has found it dead, and left it alone")
            self.assertIsNone(flight.node_pid("payload_eps"))

            self.complete(ground, "tc ring.release_inactive node=payload_eps")
            wait_until(lambda: self.state(flight, "payload_eps") == "inactive", DEADLINE_S, "the ring has started it, and it stays Inactive")
            self.assertIn("not while the node runs", self.refuse(ground, "ring.release_inactive node=payload_eps"))
            self.complete(ground, "tc ring.release node=payload_eps")

            since = ground.position()
            self.complete(ground, "tc ring.report_faults count=20")
            line = ground.wait_for(lambda m: m.get("structure") == "ring_fault" and m["fields"]["node"] == "payload_eps"
                                   and m["fields"]["outcome"] == "held", DEADLINE_S, since)  # fmt: skip
            self.assertIsNotNone(line)
            self.assertEqual(line["fields"]["fault"], "exited")

            self.assertIn("no such node", self.refuse(ground, "ring.hold node=payload_xyz"))
            for node in ("timing", "can_switcher", "ttc", "maintenance"):
                for command in ("ring.hold", "ring.release_inactive"):
                    self.assertIn("it can be restarted, not held or removed", self.refuse(ground, f"{command} node={node}"))
            self.complete(ground, "tc node.set_log_level node=timing level=debug")
            self.assertIn("debug", flight.srfs("param", "get", "timing", "log_level").stdout)

    def test_a_node_changes_its_version_and_goes_back_by_telecommand(self):
        with self.flight() as flight:
            ground = flight.ground()
            versions = flight.versions
            for node in ("payload_eps", "maintenance"):
                program = self.folder / "program"
                program.write_text(f'#!/bin/sh\nexec {BIN}/{node}_node "$@"\n')
                self.assertEqual(flight.srfs("versions", "add", node, str(program), "--origin", "a test").returncode, 0)
                self.complete(ground, f"tc node.use_version node={node} version=1")
                wait_until(lambda: versions(node)["running"] == 1 and self.state(flight, node) == "active", DEADLINE_S, f"version 1 of {node}")

            since = ground.position()
            self.complete(ground, "tc node.report_versions node=payload_eps")
            for version, state in ((0, "golden"), (1, "probation")):
                line = ground.wait_for(lambda m: m.get("structure") == "node_version" and m["fields"]["version"] == version, DEADLINE_S, since)
                self.assertEqual((line["fields"]["node"], line["fields"]["state"]), ("payload_eps", state))
            self.complete(ground, "tc node.confirm_version node=payload_eps version=1")
            self.assertEqual(versions("payload_eps")["last_good"], 1)

            for node in ("payload_eps", "maintenance"):
                self.complete(ground, f"tc node.previous_version node={node}")
                wait_until(lambda: versions(node)["running"] == 0 and self.state(flight, node) == "active", DEADLINE_S, f"golden {node}")
            self.assertEqual(versions("maintenance")["versions"][0]["state"], "failed", "vetoed in its probation")
            self.complete(ground, "tc node.remove_version node=maintenance version=1")
            self.assertIn("no such version", self.refuse(ground, "node.use_version node=payload_eps version=7"))
            self.assertIn("no such version", self.refuse(ground, "node.previous_version node=timing"))

    def test_a_ttc_that_works_and_is_deaf_to_the_operator_is_rolled_back_by_the_ring(self):
        with self.flight() as flight:
            ground = flight.ground()
            deaf = self.folder / "deaf.yaml"
            deaf.write_text((ROOT / "launch_config/sim.yaml").read_text().replace("spacecraft_id: 0xAB", "spacecraft_id: 0xAC"))
            program = self.folder / "program"
            program.write_text(f"#!/bin/sh\nexec {BIN}/ttc_node --name ttc --deployment {deaf} --var {flight.var}\n")
            self.assertEqual(flight.srfs("versions", "add", "ttc", str(program)).returncode, 0)
            versions = lambda: flight.versions("ttc")  # noqa: E731
            self.assertIn("does not run", self.refuse(ground, "node.confirm_version node=ttc version=1"))
            self.assertEqual(flight.srfs("versions", "use", "ttc", "1", "--probation", "12").returncode, 0)
            wait_until(lambda: versions()["running"] == 1 and self.state(flight, "ttc") == "active", DEADLINE_S, "version 1 of ttc")
            wait_until(lambda: versions()["running"] == 0 and self.state(flight, "ttc") == "active", 2 * DEADLINE_S, "golden ttc")
            self.assertEqual(versions()["versions"][0]["state"], "failed")
            self.assertIn("not confirmed in time", flight.srfs("faults", "--node", "ttc").stdout)
            self.complete(ground, "tc ring.report_faults count=1")

    def test_the_report_of_a_death_comes_down_as_a_file(self):
        with self.flight() as flight:
            ground = flight.ground()
            self.assertIn("no report", self.refuse(ground, "node.send_report node=payload_eps"))
            pid = flight.node_pid("payload_eps")
            os.kill(pid, signal.SIGSEGV)
            reports = flight.var / "state/payload_eps/reports"
            (report,) = wait_until(lambda: list(reports.glob("*.report")), DEADLINE_S, "the report of its death")

            since = ground.position()
            self.complete(ground, "tc node.send_report node=payload_eps")
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
            self.complete(ground, f"tc node.send_report node=payload_eps incarnation={report.stem}")

    def test_a_report_is_shown_with_the_telecommand_that_asks_for_it(self):
        with self.flight():
            for words in (["node.report_versions", "node=payload_eps"], ["node.report_versions", "node=payload_eps", "--show", "node_version"]):
                shown = self.ground_run("tc", *words)
                self.assertEqual(shown.returncode, 0, shown.stdout + shown.stderr)
                self.assertIn("golden", shown.stdout)
                self.assertNotIn("payload_adcs", shown.stdout, "other telemetry")
            orders = {
                "storage.summary": "packet_store_summary", "storage.status": "packet_store_status", "package.report": "update_status",
                "scrub.report": "scrub_status", "file.list": "repository_summary", "file.report_copies": "file_copy_status",
                "parameters.history node=ttc": "parameter_generation", "housekeeping.one_shot structure=timing": "timing",
                "parameters.report parameter=timing.log_level": "parameter_value", "schedule.detail_all": "schedule:",
                "schedule.summary_all": "schedule:", "schedule.report_groups": "schedule:", "ttc.ping": "are-you-alive report",
            }  # fmt: skip
            for telecommand, structure in orders.items():
                with self.subTest(telecommand):
                    shown = self.ground_run("tc", *telecommand.split())
                    self.assertEqual(shown.returncode, 0, shown.stdout + shown.stderr)
                    self.assertIn(structure, shown.stdout)
                    self.assertNotIn("4294967295", shown.stdout)
                    self.assertNotIn("1957", shown.stdout)
            nothing = self.ground_run("tc", "ring.report_faults")
            self.assertEqual(nothing.returncode, 0, nothing.stdout + nothing.stderr)
            self.assertRegex(nothing.stdout, "nothing to report|ring_fault", "a busy machine may have given it something")
            wrong = self.ground_run("tc", "package.report", "--show", "nonsense")
            self.assertEqual(wrong.returncode, 2, wrong.stdout + wrong.stderr)
            self.assertIn("no structure 'nonsense'", wrong.stdout + wrong.stderr)


if __name__ == "__main__":
    unittest.main()
