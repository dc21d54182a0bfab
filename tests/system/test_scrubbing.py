# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Scrubbing compares protected files with their digests and repairs them from a good copy (lib/update, nodes/maintenance)."""

import os
import shutil
import unittest

from support import BIN, DEADLINE_S, SystemTest

from srfs.flight.processes import wait_until


class ScrubbingTest(SystemTest):
    def rot(self, path):
        """Changes one octet of a file but not its times. (A running program cannot be written to, hence a new file.)"""
        was = path.stat()
        octets = bytearray(path.read_bytes())
        octets[len(octets) // 2] ^= 0x10
        damaged = path.with_suffix(".damaged")
        damaged.write_bytes(octets)
        damaged.chmod(was.st_mode & 0o7777)
        os.utime(damaged, ns=(was.st_atime_ns, was.st_mtime_ns))
        damaged.rename(path)

    def status(self, ground):
        since = ground.position()
        self.complete(ground, "tc scrub.report")
        status = ground.wait_for(lambda m: m.get("structure") == "scrub_status", DEADLINE_S, since)
        self.assertIsNotNone(status, "scrub_status")
        return status["fields"]

    def scrub(self, ground):
        """Runs a whole round. @return the position of the ground's messages before it"""
        before = self.status(ground)
        self.assertFalse(before["running"])
        since = ground.position()
        self.complete(ground, "tc scrub.run")
        wait_until(lambda: self.status(ground)["rounds"] > before["rounds"], 2 * DEADLINE_S, "the end of the round")
        return since

    def wait_for_file(self, ground, name, since, end_of_path):
        """The fields of the event about a file."""
        return self.wait_for_event(ground, name, since, lambda m: m["fields"].get("file", "").endswith(end_of_path))["fields"]

    def test_a_program_and_a_key_are_mended_and_what_is_damaged_twice_is_reported(self):
        program = self.folder / "installed" / "bin" / "payload_eps_node"
        program.parent.mkdir(parents=True)
        (program.parent.parent / "lib").symlink_to(BIN.parent / "lib")  # programs find their libraries relative to themselves
        shutil.copyfile(BIN / "payload_eps_node", program)
        program.chmod(0o755)
        os.utime(program, (1_700_000_000, 1_700_000_000))
        deployment = self.deployment(
            ("executable: payload_eps_node", f"executable: {program}"),
            ("executable: maintenance_node\n", "executable: maintenance_node\n    parameters: { scrub_pause_ms: 0, scrub_interval_s: 0 }\n"),
        )
        with self.flight(deployment) as flight:
            ground = flight.ground()
            key = flight.var / "keys" / "tc_contingency.key"
            os.utime(key, (1_700_000_000, 1_700_000_000))
            since = self.scrub(ground)
            taken = self.wait_for_event(ground, "maintenance.files_taken", since)["fields"]
            self.assertGreaterEqual(taken["files"], 2)
            self.assertEqual(len(taken["build"]), 16)

            whole = {path: path.read_bytes() for path in (program, key)}
            for path, octets in whole.items():
                self.rot(path)
                since = self.scrub(ground)
                found = self.wait_for_file(ground, "maintenance.file_damaged", since, path.name)
                self.assertIn("SHA-256", found["why"])
                self.wait_for_file(ground, "maintenance.file_mended", since, path.name)
                self.assertEqual(path.read_bytes(), octets)

            (copy,) = [f for f in (flight.var / "golden").iterdir() if f.read_bytes() == whole[key]]
            self.rot(copy)
            self.rot(key)
            since = self.scrub(ground)
            self.assertIn("copy is damaged too", self.wait_for_file(ground, "maintenance.file_lost", since, key.name)["why"])
            self.assertNotEqual(key.read_bytes(), whole[key])
            self.assertEqual(program.read_bytes(), whole[program])
            status = self.status(ground)
            self.assertEqual((status["lost"], status["damaged"], status["mended"]), (1, 3, 2))
            self.assertTrue(status["last_damaged"].endswith(key.name))

            since = ground.position()
            self.complete(ground, "tc scrub.retake")
            self.wait_for_event(ground, "maintenance.files_taken", since)


if __name__ == "__main__":
    unittest.main()
